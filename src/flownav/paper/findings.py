"""Findings of the reproduction on the paper's claims, each sentence and verdict computed from the numbers.

Those marked `decides` make the command's exit status 1 where they do not agree.
"""

from typing import NamedTuple

import numpy as np

from flownav.paper import published
from flownav.paper.flights import Flights
from flownav.paper.laboratory import Laboratory, delay_s
from flownav.paper.published import HEIGHTS_M, RELATION_FITS, ErrorRow
from flownav.report.panels import listed
from flownav.scoring import errors

FIT_TOLERANCE = 6.0
LARGEST_TOLERANCE = 0.20
SAME_FIT = 0.5  # points of fit that do not distinguish two orders
SLOW_M_S = 0.4  # "small velocities of the pendulum which are below 0.4 m/sec"
LOST_SLOPE = 0.5
START_S = 2.0  # of a run, before the push is over
BACK_SOLVED_STATE = "x"  # of Table 5, whose standard deviation the white GPS noise was chosen from
SAME_SPREAD = 1.5  # factor between standard deviations that count as alike


class Finding(NamedTuple):
    """A claim of the paper, what came out here, and whether the two agree. decides: counts for the exit status.

    circular: why an agreement is no evidence, where what was flown was chosen from the very table; else empty.
    """

    topic: str
    paper: str
    here: str
    agrees: bool
    decides: bool = False
    circular: str = ""

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        if self.circular and self.agrees:
            return "agrees, circular"
        return "agrees" if self.agrees else "differs"

    def as_json(self) -> dict[str, object]:
        """The finding as the command prints it."""
        return {name: value for name, value in self._asdict().items() if name != "decides"}


def of_laboratory(laboratory: Laboratory) -> list[Finding]:
    """About Table 1."""
    return [
        *_fits(laboratory),
        _law(laboratory),
        *_gain_and_delay(laboratory),
        _dynamics(laboratory),
        _slow(laboratory),
        *_orders(laboratory),
    ]


def _fits(laboratory: Laboratory) -> list[Finding]:
    found = []
    for height_m, target in RELATION_FITS.items():
        ours, (low, high) = laboratory.mean_fit(height_m), laboratory.spread(height_m)
        words = f"{ours:.1f} % ({low:.1f} to {high:.1f} over seven runs), {ours - target:+.1f} points"
        near = abs(ours - target) <= FIT_TOLERANCE
        found.append(Finding(f"Fit at {height_m:.1f} m", f"{target:.0f} %", words, near, decides=True))
    rows = published.table_1()
    means = [float(np.mean([m.fit_percent for m in rows if m.height_m == height])) for height in HEIGHTS_M]
    every = [laboratory.mean_fit(height) for height in HEIGHTS_M]
    falls = bool((np.diff(every) < 0.0).all())
    return [
        *found,
        Finding(
            "Fit falls with height", f"mean of seven: {_series(means)} %", f"mean of seven: {_series(every)} %", falls
        ),
    ]


def _law(laboratory: Laboratory) -> Finding:
    off = {height: laboratory.mean_fit(height) - published.accuracy_law(height) for height in HEIGHTS_M}
    worst = max(off, key=lambda height: abs(off[height]))
    words = f"within {abs(off[worst]):.1f} points of it; farthest at {worst:.1f} m ({off[worst]:+.1f})"
    return Finding("Accuracy rule", "fit = 90 % √(0.6/h)", words, abs(off[worst]) <= FIT_TOLERANCE)


def _gain_and_delay(laboratory: Laboratory) -> list[Finding]:
    found = []
    for what, unit, digits, scale, of_model, of_run in (
        ("Gain a/c", "", 2, 1.0, lambda m: m.gain, lambda r: r.fits[2].point.gain),
        ("Delay b/c", " ms", 0, 1e3, lambda m: m.delay_s, delay_s),
    ):
        outside, theirs, ours = [], [], []
        for height in HEIGHTS_M:
            printed = [scale * of_model(m) for m in published.table_1() if m.height_m == height]
            here = float(np.median([scale * of_run(run) for run in laboratory.at(height)]))
            theirs.append(f"{min(printed):.{digits}f} to {max(printed):.{digits}f}")
            ours.append(f"{here:.{digits}f}")
            if not min(printed) <= here <= max(printed):
                outside.append(f"{height:.1f} m")
        words = f"{', '.join(ours)}{unit}: " + (
            f"outside the paper's range at {listed(outside)}" if outside else "inside the paper's range at every height"
        )
        found.append(Finding(f"{what} by height", f"{', '.join(theirs)}{unit}", words, not outside))
    return found


def _dynamics(laboratory: Laboratory) -> Finding:
    rows = published.table_1()
    rates = [m.natural_frequency_rad_s for m in rows]
    ours = [run.dynamics.natural_frequency_rad_s for run in laboratory.runs]
    whole = sum(run.excitation.complete for run in laboratory.runs)
    bound = sum(0.985 <= m.damping_ratio <= 1.005 for m in rows)
    return Finding(
        "A second-order dynamics is identified",
        f"natural frequencies of {min(rates):.0f} to {max(rates):.0f} rad/s; {bound} of {len(rows)} dampings at 0.99 "
        "to 1.00",
        f"{min(ours):.0f} to {max(ours):.0f} rad/s from one and the same sensor: in {whole} of {len(laboratory.runs)} "
        "runs does a swing show all three parameters; it shows gain and delay",
        whole > len(laboratory.runs) // 2,
    )


def _orders(laboratory: Laboratory) -> list[Finding]:
    found = []
    for kind in ("swing", "chirp"):
        tests = [test for test in laboratory.orders if test.kind == kind]
        if not tests:
            continue
        means = {order: float(np.mean([test.fits[order] for test in tests])) for order in tests[0].fits}
        rivals = {order: fit for order, fit in means.items() if order != 2}
        as_good = [order for order, fit in rivals.items() if fit > means[2] - SAME_FIT]
        better = [order for order in as_good if rivals[order] > means[2] + SAME_FIT]
        words = ", ".join(f"{_order_name(order)} {fit:.1f} %" for order, fit in means.items())
        if better:
            words += f". Better than second order: {listed(_order_name(order) for order in better)}"
        elif as_good:
            words += f". As good as second order: {listed(_order_name(order) for order in as_good)}"
        claim = "first, third and higher order models \u201cwere not as fit as the second order models\u201d"
        found.append(Finding(f"Order of the model ({kind})", claim, words, not any(order > 0 for order in as_good)))
    return found


def _order_name(order: int) -> str:
    return "gain and delay" if order == 0 else f"order {order}"


def _slow(laboratory: Laboratory) -> Finding:
    """Whether slow velocities are lost at 1.5 m: slope of the sensor's on the encoder's, delay taken out."""
    slopes = []
    for run in laboratory.at(HEIGHTS_M[-1]):
        log = run.log
        later = log.time_s > START_S
        truth = np.interp(log.time_s[later] - delay_s(run), log.time_s, log.reference_velocity_m_s)
        slow = np.abs(truth) < SLOW_M_S
        slopes.append(float(np.polyfit(truth[slow], log.flow_velocity_m_s[later][slow], 1)[0]))
    slope = float(np.median(slopes))
    words = f"below it the sensor reads {slope:.2f} times the velocity"
    claim = f"\u201cfailed in recognizing\u201d velocities below {SLOW_M_S:g} m/s"
    return Finding(f"Slow velocities at {HEIGHTS_M[-1]:.1f} m", claim, words, slope < LOST_SLOPE)


def of_table_2(ours: list[ErrorRow]) -> list[Finding]:
    """Validation errors by height."""
    return [_errors("Validation error by height (Table 2)", published.table_2(), ours)]


def of_table_3(ours: list[ErrorRow], own: list[ErrorRow]) -> list[Finding]:
    """The selected model's errors by height, and whether it does as well there as the height's own models (`own`)."""
    printed = published.table_3()
    here, theirs = _excess(ours, own), _excess(printed, published.table_2())
    claim = "\u201csmall mean errors and small SD errors at various heights\u201d"
    claim += f"; at worst {theirs:.2f} times the error of the height's own models"
    words = f"at worst {here:.2f} times the error of the height's own models"
    return [
        _errors("Error of the selected model by height (Table 3)", printed, ours),
        Finding("One model serves every height", claim, words, here <= SAME_SPREAD),
    ]


def _excess(selected: list[ErrorRow], own: list[ErrorRow]) -> float:
    """Largest ratio, over the heights, of the selected model's standard deviation to the mean of the height's own."""
    means = {h: float(np.mean([row.std_error for row in own if row.height_m == h])) for h in HEIGHTS_M}
    return max(row.std_error / means[row.height_m] for row in selected)


def _errors(topic: str, printed: list[ErrorRow], ours: list[ErrorRow]) -> Finding:
    theirs, here = (
        [float(np.median([row.std_error for row in table if row.height_m == h])) for h in HEIGHTS_M]
        for table in (printed, ours)
    )
    ratios = {height: b / a for height, a, b in zip(HEIGHTS_M, theirs, here, strict=True)}
    apart = [f"{h:.1f} m ({ratio:.2f})" for h, ratio in ratios.items() if not 1.0 / SAME_SPREAD <= ratio <= SAME_SPREAD]
    words = f"{_series(here, 3)} m/s" + (f"; not alike, times the paper's at {listed(apart)}" if apart else "; alike")
    return Finding(topic, f"{_series(theirs, 3)} m/s", words, not apart)


def of_flights(flights: Flights) -> list[Finding]:
    """Largest error, the states' spreads, and the receiver of Table 4."""
    printed, ours = flights.published["max_position_error_m"], flights.scores["max_position_error_m"]
    title, name = flights.published["title"], flights.what
    near = abs(ours["median"] / printed - 1.0) <= LARGEST_TOLERANCE
    words = f"{_spread(ours)} m; the paper's flight at percentile {flights.percentile['max_position_error_m']:.0f}"
    chosen = circular(flights)
    honest = flights.honest["max_position_error_m"]
    outside = [state for state, entry in flights.percentile["states"].items() if not 5.0 <= entry["std_error"] <= 95.0]
    spreads = f"{len(outside)} of 6 outside our 5 to 95 %" + (f": {listed(outside)}" if outside else "")
    return [
        Finding(f"Largest position error, {name}", f"{printed:.4f} m", f"{words}; {chosen}", near, True, chosen),
        Finding(f"Errors by state, {name}", f"{title}, standard deviations", spreads, not outside),
        Finding(
            f"Largest position error with the GPS of Table 4 (2 m CEP), {name}",
            f"{published.LARGEST_CLAIM_M:g} m",
            f"{_spread(honest)} m",
            abs(honest["median"] / printed - 1.0) <= LARGEST_TOLERANCE,
        ),
    ]


def circular(flights: Flights) -> str:
    """Why positions that agree with Tables 5 and 6 are little evidence: where the white GPS noise comes from."""
    table_5 = errors.published(5)
    assert table_5 is not None
    printed = float(table_5["states"][BACK_SOLVED_STATE]["std_error"])
    leaves = float(flights.scores["states"][BACK_SOLVED_STATE]["std_error"]["median"]) / flights.white_noise_m
    return (
        f"circular: the paper states no noise. The {flights.white_noise_m:g} m are back-solved from the x of Table 5: "
        f"{printed:.4f} m over the {leaves:.3f} of the noise that the filter leaves is {printed / leaves:.2f} m"
    )


def _spread(entry: dict[str, float]) -> str:
    return f"{entry['median']:.3f} ({entry['p05']:.3f} to {entry['p95']:.3f})"


def _series(values: list[float], digits: int = 1) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def broken(findings: list[Finding]) -> list[Finding]:
    """Those that decide and do not agree."""
    return [finding for finding in findings if finding.decides and not finding.agrees]
