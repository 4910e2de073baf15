"""Faults in the closed loop: the autopilot uses the faulty estimate, from take-off to rest.

Each fault is flown by a block of flights with truths and noise of their own, and by as many without it. The vehicle's
outcome counts: whether it landed, went around or crashed, and how large the error of the estimate was before any
warning.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.faults.catalogue import Fault, law_of
from flownav.campaigns.faults.table import NO_FAULT, SINK_M_S, durations_of, hovering, window_start
from flownav.campaigns.local import touchdown_history
from flownav.core.compile import LANES
from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED
from flownav.core.text import finite_or_none
from flownav.estimation.gating import Reason
from flownav.navigation.rows import InnovationRow
from flownav.navigation.tape import EVENT_NAMES
from flownav.scoring.landings import REST_DISTANCE, column_of, verdict_of
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.engine import Flown, fly_written
from flownav.simulation.history import column, columns
from flownav.simulation.scenario import Scenario, load_scenario
from flownav.simulation.sensing import EPOCH_S
from flownav.simulation.truth import SOUND, SensorFault

HEIGHTS_M = (0.5, 1.5, 3.0)
DURATIONS_S = (5.0, 20.0)  # over before the descent begins, and through the touchdown
DESCENDS_AFTER_S = 5.0
AROUND_S = 35.0  # time for a go-around
WITHIN_S = 1.0
CONTACT_S = column_of("contact", "t_s")
VERDICTS = ("landed", "went around", "crashed", "unfinished")
# the navigator's warnings; starts, datums and standing still are none
WARNINGS = {
    ("flow", "doubted"), ("filter", "dead_reckoning"), ("filter", "position_invalid"), ("imu", "lost"),
    ("imu", "doubted"), ("imu", "spike"), ("range", "stuck"), ("range", "reset"), ("gps", "reset"),
    ("filter", "suspects"), ("heading", "refuted"),
}  # fmt: skip
# for the last metres, and when a landing is broken off
AUTOPILOT = {
    "precision": {
        "land_height_m": 3.5, "land_speed_m_s": SINK_M_S, "align_height_m": 0.5, "align_radius_m": 0.3,
        "align_speed_m_s": 0.4, "commit_height_m": 0.15,
    },
    "go_around": {"height_m": 2.5, "landing_sigma_m": 0.4},
}  # fmt: skip


WITH_CAMERA = "none, pad camera"  # the row without a fault in which a pad camera leads the landing
CAMERA_OF = "approach"  # the scenario whose pad camera, and autopilot for it, that row has


class FlightScores(NamedTuple):
    """One flight: time of the first refusals and of the first warning [s after the fault began], the largest horizontal
    error of the estimate used by the autopilot, ever and before any warning [m], the outcome, and the distance from the
    pad at rest [m].
    """

    noticed_s: float | None
    warned_s: float | None
    largest_m: float
    unwarned_m: float
    verdict: str
    off_pad_m: float | None


class Row(NamedTuple):
    """A fault at a height, over its flights; NO_FAULT: the same flights without, WITH_CAMERA: and with a camera."""

    fault: str
    height_m: float
    duration_s: float
    flights: tuple[FlightScores, ...]

    def entry(self) -> dict[str, Any]:
        """The row as JSON has it."""
        became = Counter(flight.verdict if flight.verdict in VERDICTS else "unfinished" for flight in self.flights)
        off = [flight.off_pad_m for flight in self.flights if flight.off_pad_m is not None]
        return {
            "fault": self.fault,
            "height_m": self.height_m,
            "duration_s": self.duration_s,
            "flights": len(self.flights),
            "noticed": _when([flight.noticed_s for flight in self.flights]),
            "said": _when([flight.warned_s for flight in self.flights]),
            "largest_error_unsaid_m": max(flight.unwarned_m for flight in self.flights),
            "largest_error_m": max(flight.largest_m for flight in self.flights),
            **{verdict.replace(" ", "_"): became[verdict] for verdict in VERDICTS},
            "off_pad_m": {"median": float(np.median(off)), "worst": max(off)} if off else None,
        }


def flown_table(
    faults: Sequence[Fault],
    heights_m: Sequence[float] = HEIGHTS_M,
    durations_s: Sequence[float] = DURATIONS_S,
    *,
    flights: int = len(LANES),
    seed: int = 1,
    vehicle: str | None = None,
    matched: bool = False,
    on_progress: Callable[[int], None] = lambda done: None,
) -> list[Row]:
    """Fly every fault at every height for every duration: rows by height, without a fault first, with a camera before.

    matched: vehicle and sensors as in their datasheets; else each flight has a truth of its own.
    """
    rows = []
    for height_m in heights_m:
        setup, begins_s = assemble(scenario_flown(height_m, vehicle)), window_start(height_m)
        seen = assemble(with_camera(scenario_flown(height_m, vehicle)))
        led = tuple(_fly(seen, None, (begins_s, begins_s), flights, seed, matched))
        rows.append(Row(WITH_CAMERA, height_m, 0.0, led))
        on_progress(1)
        tried: list[tuple[Fault | None, float]] = [(None, 0.0)]
        tried += [(fault, duration) for fault in faults for duration in durations_of(fault, durations_s)]
        for fault, duration_s in tried:
            t0_s = begins_s + DESCENDS_AFTER_S if fault is not None and fault.in_descent else begins_s
            scores = tuple(_fly(setup, fault, (t0_s, t0_s + duration_s), flights, seed, matched))
            rows.append(Row(NO_FAULT if fault is None else fault.name, height_m, duration_s, scores))
            on_progress(1)
    return rows


def scenario_flown(height_m: float, vehicle: str | None = None) -> Scenario:
    """Up from the pad at 1 m/s, 15 s of hover, down at 0.3 m/s, with time for a go-around; the autopilot uses the
    estimate.
    """
    words = f"faults_{height_m:g}_m", "landing on the same pad, go-arounds"
    return hovering(words, height_m, window_start(height_m) + DESCENDS_AFTER_S, AUTOPILOT, vehicle, AROUND_S)


def with_camera(scenario: Scenario) -> Scenario:
    """The scenario with the pad camera of CAMERA_OF, and landed as its autopilot lands."""
    of = load_scenario(CAMERA_OF)
    autopilot = of.autopilot.model_copy(update={"home": scenario.autopilot.home})
    return scenario.model_copy(update={"pad_fix": of.pad_fix, "autopilot": autopilot})


def _fly(
    setup: Setup, fault: Fault | None, window_s: tuple[float, float], flights: int, seed: int, matched: bool
) -> Iterator[FlightScores]:
    """The scores of each flight."""
    ensemble = None if matched else setup.ensemble()
    flight = setup.flight._replace(fails=True)
    assert setup.fitted is not None  # `BASE` uses the navigator
    assert flight.onboard is not None
    horizon_s, period_s = setup.fitted.schedule.horizon_s, flight.onboard.carried.flow_camera.clock.every * EPOCH_S
    for first in range(0, flights, len(LANES)):
        laws = [law_of_flight(fault, window_s, seed, first + lane, period_s) for lane in range(len(LANES))]
        flown = fly_written(flight, seed, first, LANES, ensemble, laws)
        landings = touchdown_history(flight, flown.history)
        for lane in range(min(len(LANES), flights - first)):
            yield scores_of(flown, landings[lane], lane, fault.sensors if fault else (), window_s[0], horizon_s)


def law_of_flight(
    fault: Fault | None, window_s: tuple[float, float], seed: int, number: int, flow_period_s: float
) -> SensorFault:
    """One flight's fault; a position moves off in a direction of its own."""
    if fault is None:
        return SOUND
    course_rad = float(np.random.default_rng([seed, number]).uniform(0.0, 2.0 * np.pi))
    return law_of(fault, *window_s, course_rad, flow_period_s)


# -- one flight ---------------------------------------------------------------------------------------------
def scores_of(
    flown: Flown, landing: Array, lane: int, sensors: tuple[Sensor, ...], t0_s: float, horizon_s: float
) -> FlightScores:
    """The scores of one lane's flight from t0 on; landing: its row of touchdowns; horizon_s: of the navigator."""
    t_s = np.arange(len(flown.history)) * EPOCH_S
    error_m = flown_error(flown.history, lane)
    down_s = touched_s(flown.history, landing, lane, t0_s)  # a later warning is no help
    warned_s = first_warning(flown.tape.events(lane), t0_s, down_s, horizon_s)
    from_fault = (t_s >= t0_s) & np.isfinite(error_m)
    unwarned = from_fault & (t_s < (np.inf if warned_s is None else warned_s))
    off = float(landing[REST_DISTANCE])
    return FlightScores(
        _since(first_refusals(flown.tape.offers(lane), sensors, (t0_s, down_s), horizon_s, warned_s), t0_s),
        _since(warned_s, t0_s),
        float(error_m[from_fault].max(initial=0.0)),
        float(error_m[unwarned].max(initial=0.0)),
        verdict_of(landing),
        finite_or_none(off),
    )


def flown_error(history: Array, lane: int) -> Array:
    """Horizontal error of the estimate used by the autopilot, relative to the believed place of the pad (epochs,) [m];
    in flight.
    """
    stated, true = (history[:, columns(table, POSITION_NED), lane][:, :2] for table in ("estimate", "truth"))
    airborne = history[:, column("truth", "contact_n"), lane] <= 0.0
    return np.where(airborne, np.hypot(*(stated - true).T), np.nan)


def touched_s(history: Array, landing: Array, lane: int, t0_s: float) -> float:
    """When the flight touched down, or else first touched anything from t0 on; infinite where it never did."""
    if np.isfinite(landing[CONTACT_S]):
        return float(landing[CONTACT_S])
    touching = np.flatnonzero(history[:, column("truth", "contact_n"), lane] > 0.0) * EPOCH_S
    return float(min(touching[touching >= t0_s], default=np.inf))


def first_warning(events: Array, t0_s: float, t1_s: float, horizon_s: float) -> float | None:
    """Time of the navigator's first warning in [t0, t1); rows of its tape, a horizon behind."""
    warnings = [t_s + horizon_s for t_s, kind, _ in events.tolist() if EVENT_NAMES[int(kind)][:2] in WARNINGS]
    return min((t_s for t_s in warnings if t0_s <= t_s < t1_s), default=None)


def first_refusals(
    offers: Array, sensors: tuple[Sensor, ...], window_s: tuple[float, float], horizon_s: float, warned_s: float | None
) -> float | None:
    """Time at which more readings of the struck sensors than ever before had been refused within a second, or of a
    warning. A component within its own gate that is held back, or refused with another, does not count.
    """
    t0_s, t1_s = window_s
    offered = InnovationRow.of(offers)
    refused = np.isin(offered.sensor, [int(sensor) for sensor in sensors]) & (offered.reason != Reason.FUSED)
    refused &= ~np.isin(offered.reason, (Reason.DATUM, Reason.BEFORE_START))
    refused &= (offered.reason != Reason.INNOVATION_GATE) | (offered.test_ratio > 1.0)
    times = offered.t_s[refused] + horizon_s
    count = np.arange(len(times)) - np.searchsorted(times, times - WITHIN_S, side="right") + 1
    usual = count[times < t0_s].max(initial=0)
    after = times[(times >= t0_s) & (times < t1_s) & (count > usual)]
    found = [t_s for t_s in (after[0] if len(after) else None, warned_s) if t_s is not None]
    return float(min(found)) if found else None


def _since(t_s: float | None, t0_s: float) -> float | None:
    return None if t_s is None else t_s - t0_s


def _when(times: list[float | None]) -> dict[str, Any]:
    """In how many flights, and after how long in the median of these."""
    known: NDArray[np.float64] = np.array([t_s for t_s in times if t_s is not None])
    return {"flights": len(known), "median_s": float(np.median(known)) if len(known) else None}
