"""Signs of the flow sensor's settings: its axes, scale, delay, clock and gyro.

Two witnesses that no reference is needed for: flow turns as the vehicle turns, at once and by the same angle, and its
quick part is that of the accelerometer's integral over the range. Where GPS gives a velocity, that is a third.
"""

import itertools

import numpy as np

from flownav.core.frames import within_half_turn
from flownav.core.measurement import Array
from flownav.lab.identification.output_error import Z_95
from flownav.lab.identification.quantities import Interval
from flownav.studies.explain.case import FLOW_XY, QUICK_S, Case
from flownav.studies.explain.sign import Found, Lack, Picture, Sign, Trace, Window, nothing
from flownav.studies.explain.signals import Fit, at, high_pass, spread, turn_of

NO_FLOW, NO_RATES = Lack("no optical flow"), Lack("no inertial readings and no attitude to hold the flow against")
TURN_RAD, SCALE_OFF, LATE_S, EARLY_S, CLOCK_S = 0.45, 0.22, 0.06, 0.15, 0.33
UNSTATED_LATE_S = 0.25  # a delay that nobody states is no mistake until it is larger than any default
SIGNIFICANT = 4.0  # standard errors
LEAST_RELIABLE, LEAST_LIKENESS, KNOWN_TO = 0.8, 0.9, 0.15
MODEL_SIGMA = 0.05  # of a gain: what the expectation itself may be off by
PARTS, LEAST_IN_PART = 3, 60
UNEVEN, UNEVEN_SIGMA = 1.2, 3.0  # of one axis over the other, and by how many standard errors
SURE = 5.0  # as strong as any sign needs to be
GYRO_OFF, GYRO_BIAS_RAD_S, LEAST_GYRO_SHARE, TURNING_RAD_S = 0.40, 0.045, 0.3, 0.02


def _significance(fit: Fit | None, of: int = 1) -> float:
    """How many standard errors the lesser gain of a fit has; of the larger one where `of` is 0."""
    if fit is None:
        return 0.0
    sigma = max(float(np.sqrt(np.mean(fit.sigma**2))), 1e-9)
    return float(np.linalg.svd(fit.matrix, compute_uv=False)[of] / sigma)


# -- axes ----------------------------------------------------------------------------------------------------------
def turned(case: Case) -> tuple[float, bool, float]:
    """The flow's turn [rad], whether it mirrors, and its significance in standard errors: by the surest of all
    witnesses.
    """
    if _significance(case.flow_fit) > SIGNIFICANT and case.flow_fit is not None:
        angle, _, mirrored = turn_of(case.flow_fit.matrix)
        return angle, mirrored, _significance(case.flow_fit)
    tie, heading = case.flow_tie, case.heading_tie
    if tie is None or tie.significance < SIGNIFICANT:
        return 0.0, False, 0.0
    if heading is None:  # a heading that is off looks the same: half as sure
        return tie.turn_rad, tie.mirrored, 0.5 * tie.significance
    return within_half_turn(tie.turn_rad - heading.turn_rad), tie.mirrored, min(tie.significance, heading.significance)


def axes(case: Case) -> Found:
    """Turned, swapped or inverted against the vehicle's."""
    if case.flow is None:
        return NO_FLOW
    if case.rates is None:
        return NO_RATES
    angle, mirrored, sure = turned(case)
    if sure == 0.0:
        return Lack("too little motion to hold the flow's axes against the inertial readings")
    off = max(abs(angle) / TURN_RAD, SURE if mirrored else 0.0)
    strength = off * min(1.0, sure / (2.0 * SIGNIFICANT))
    fit = case.flow_fit if _significance(case.flow_fit) > SIGNIFICANT else None
    figures: dict[str, float | str] = {
        "turn_deg": float(np.degrees(angle)), "mirrored": "mirrored" if mirrored else "", "sure": sure,
        "axes": axes_words(angle, mirrored, None if fit is None else fit.matrix),
    }  # fmt: skip
    return Sign(strength, case.flight_s, figures, (expected_picture(case),))


def axes_words(angle: float, mirrored: bool, matrix: Array | None) -> str:
    """The error of the axes, in words; matrix: the response (2, 2), where it is known."""
    if mirrored:
        if matrix is None:
            return "they are mirrored: one is inverted, or the two are swapped"
        if abs(matrix[0, 1]) + abs(matrix[1, 0]) > abs(matrix[0, 0]) + abs(matrix[1, 1]):
            return "the two are swapped"
        return f"the sign of the {'x' if matrix[0, 0] < 0.0 else 'y'} axis is inverted"
    return f"they are turned by {abs(np.degrees(angle)):.0f} degrees {'clockwise' if angle < 0.0 else 'anticlockwise'}"


def expected_picture(case: Case) -> Picture:
    """The flow's quick part beside what turning and translation expect, about x, in the liveliest ten seconds."""
    assert case.flow is not None
    if case.expected_flow is None or case.flow_fit is None:
        return Picture("flow (rad/s)", (Trace("flow", "flow x", case.flow.t_s, case.flow.value[:, 0], dots=True),))
    t_s, expected = case.expected_flow
    begin = _liveliest(t_s, expected, case.flight_s)
    inside = (t_s >= begin) & (t_s < begin + 10.0)
    shown = (case.flow.t_s >= begin) & (case.flow.t_s < begin + 10.0) & (case.flow.quality > 0.0)
    quick = high_pass(case.flow.t_s, case.flow.value[:, :2], QUICK_S)
    return Picture("quick part of the flow about x (rad/s)", (
        Trace("estimate", "expected by the inertial readings", t_s[inside] + case.flow_fit.lag_s, expected[inside, 0]),
        Trace("flow", "flow x", case.flow.t_s[shown], quick[shown, 0], dots=True),
        Trace("gps", "flow y", case.flow.t_s[shown], quick[shown, 1], dots=True),
    ), "Flow that sees what the vehicle does lies on the line.")  # fmt: skip


def _liveliest(t_s: Array, values: Array, window: Window) -> float:
    starts = np.arange(window[0], max(window[1] - 10.0, window[0] + 0.1), 2.5)
    power = [float(np.sum(values[(t_s >= s) & (t_s < s + 10.0)] ** 2)) for s in starts]
    return float(starts[int(np.argmax(power))])


# -- scale ---------------------------------------------------------------------------------------------------------
def referenced(case: Case) -> tuple[Interval, Interval] | None:
    """The flow's gains about x and about y against a position reference; None without one that knows them to a tenth.

    Velocity to the right is flow about x, forward velocity is flow about y.
    """
    if case.log.truth is None or case.measured is None:
        return None
    forward, right = case.measured.gains
    known = all(gain.low > 0.0 and sigma_of(gain) < KNOWN_TO * max(gain.value, 0.5) for gain in (forward, right))
    return (right, forward) if known else None


def sigma_of(interval: Interval) -> float:
    """The standard error of a 95 % interval."""
    return 0.5 * (interval.high - interval.low) / Z_95


def gains(case: Case) -> list[tuple[float, float]]:
    """The flow's gain and its standard error by each witness that knows it to a tenth: reference, IMU, GPS."""
    found = []
    reference = referenced(case)
    if reference is not None:
        found.append((0.5 * sum(gain.value for gain in reference), max(map(sigma_of, reference))))
    if case.flow_fit is not None and case.expectation_reliability > LEAST_RELIABLE:
        gain, sigma = gain_of(case.flow_fit, uneven=_uneven(case) != 1.0)
        found.append((gain / case.expectation_reliability, float(np.hypot(sigma, MODEL_SIGMA))))
    if case.flow_tie is not None and case.flow_tie.likeness > LEAST_LIKENESS:
        found.append((case.flow_tie.gain, case.flow_tie.gain_sigma))
    return [(gain, sigma) for gain, sigma in found if sigma < KNOWN_TO * max(gain, 0.5)]


def gain_of(fit: Fit, *, uneven: bool = False) -> tuple[float, float]:
    """The gain of a response and its standard error: of its two axes, the turn taken off, by how well each is known.

    Where the response is no gain and turn within its errors, the error is larger by as much. uneven: the axes differ.
    """
    angle, _, mirrored = turn_of(fit.matrix)
    back = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    straight = back @ fit.matrix @ np.diag([1.0, -1.0 if mirrored else 1.0])
    errors = np.maximum(np.mean(fit.sigma, axis=0), 1e-6)  # by column: what is regressed on
    weights, apart = 1.0 / errors**2, float(np.hypot(*errors))
    left = ((straight[0, 0] - straight[1, 1]) * (not uneven) / apart, (straight[0, 1] + straight[1, 0]) / apart)
    wider = max(1.0, float(np.sqrt(0.5 * np.sum(np.square(left)))))
    return float(np.diag(straight) @ weights / weights.sum()), wider / float(np.sqrt(weights.sum()))


def scale(case: Case) -> Found:
    """Too large or too small by a factor."""
    if case.flow is None:
        return NO_FLOW
    if case.ranges is None:
        return Lack("no range to make a velocity of the flow")
    found = gains(case)
    if not found:
        return Lack("too little motion against a reference to know the flow's scale to a tenth")
    gain, sigma = _agreed(found)
    uneven = _uneven(case)
    x, y = gain * uneven**0.5, gain / uneven**0.5
    off = max(*(abs(np.log(one)) - sigma / one for one in (gain, x, y)), 0.0)
    off = min(off, *_lasting(case))
    figures: dict[str, float | str] = {"gain": gain, "x": x, "y": y, "sigma": sigma, "read": _read(gain, x, y)}
    return Sign(off / SCALE_OFF, case.flight_s, figures, (expected_picture(case),))


def _lasting(case: Case) -> list[float]:
    """At most how far off the gains are, in logarithms, third by third of the flight: a wrong factor lasts."""
    edges = np.linspace(*case.flight_s, PARTS + 1)
    found = [np.inf]
    for begin, end in itertools.pairwise(edges):
        fit = case.quick_flow(FLOW_XY, case.expected_flow, (float(begin), float(end)), LEAST_IN_PART)
        if fit is None or _significance(fit) < SIGNIFICANT or case.expectation_reliability < LEAST_RELIABLE:
            continue
        straight = np.linalg.svd(fit.matrix, compute_uv=False) / case.expectation_reliability
        error = float(np.sqrt(np.mean(fit.sigma**2))) / float(straight.min())
        found.append(float(np.abs(np.log(straight)).max()) + 2.0 * error)
    return found


def _agreed(found: list[tuple[float, float]]) -> tuple[float, float]:
    """The mean gain of the witnesses and its standard error; of two that contradict each other the one nearer to 1."""
    logs = np.log([max(gain, 0.05) for gain, _ in found])
    errors = np.array([sigma / max(gain, 0.05) for gain, sigma in found])
    if np.ptp(logs) > SIGNIFICANT * float(np.sqrt(np.sum(errors**2))):
        return found[int(np.argmin(np.abs(logs)))]
    weights = 1.0 / errors**2
    gain = float(np.exp(np.sum(weights * logs) / weights.sum()))
    return gain, float(gain / np.sqrt(weights.sum()))


def _uneven(case: Case) -> float:
    """The gain of x over that of y; 1 where they do not differ, or are not known apart.

    By a position reference and by the inertial readings, each by how well it knows it.
    """
    reference, inertial, beyond = _ratio_by_reference(case), _ratio_by_inertial(case), float(np.log(UNEVEN))
    if reference is None:
        return 1.0 if inertial is None else _if_certain(*inertial, beyond)
    if inertial is None:
        return _if_certain(*reference)
    by_inertial = float(np.hypot(inertial[1], 0.5 * beyond))  # with what the expectation itself may be off by
    ratio, sigma = _agreed([(one, one * error) for one, error in (reference, (inertial[0], by_inertial))])
    return _if_certain(ratio, sigma / ratio)


def _if_certain(ratio: float, sigma: float, beyond: float = 0.0) -> float:
    """A ratio, with its logarithm's standard error, where that is known to differ from 1 by over `beyond`; else 1."""
    return ratio if abs(float(np.log(ratio))) > beyond + UNEVEN_SIGMA * sigma else 1.0


def _ratio_by_reference(case: Case) -> tuple[float, float] | None:
    """The gain of x over that of y and the standard error of its logarithm, by a position reference."""
    reference = referenced(case)
    if reference is None:
        return None
    sigma = float(np.sqrt(sum((sigma_of(gain) / gain.value) ** 2 for gain in reference)))
    return reference[0].value / reference[1].value, sigma


def _ratio_by_inertial(case: Case) -> tuple[float, float] | None:
    """The same by the inertial readings, of a flow that is neither turned nor mirrored."""
    fit = case.flow_fit
    if fit is None or _significance(fit) < 2.0 * SIGNIFICANT or case.expectation_reliability < LEAST_RELIABLE:
        return None
    angle, _, mirrored = turn_of(fit.matrix)
    x, y = np.abs(np.diag(fit.matrix))
    if mirrored or abs(angle) > TURN_RAD or min(x, y) < 0.05:
        return None
    return float(x / y), float(np.hypot(fit.sigma[0, 0] / x, fit.sigma[1, 1] / y))


def _read(gain: float, x: float, y: float) -> str:
    """The gain in words, axis by axis where they differ."""
    return f"{gain:.2f} of what it should" if x == y else f"{x:.2f} of what it should about x and {y:.2f} about y"


# -- time ----------------------------------------------------------------------------------------------------------
def found_lag(case: Case) -> float | None:
    """How old a flow reading is when it arrives [s]: by its own gyro, which is the surest, else by the flow."""
    gyro, flow = case.gyro_fit, case.flow_fit
    if gyro is not None and gyro.share > LEAST_GYRO_SHARE and _significance(gyro) > SIGNIFICANT:
        return gyro.lag_s
    if flow is not None and _significance(flow) > 2.0 * SIGNIFICANT:
        return flow.lag_s
    return None


def delay(case: Case) -> Found:
    """Finds flow that is older on arrival than the autopilot's parameter states."""
    if case.flow is None:
        return NO_FLOW
    lag = found_lag(case)
    if lag is None:
        return Lack("too little turning to know how old the flow is")
    stated_s = case.own_settings.flow_delay_s
    if lag > CLOCK_S or lag < -EARLY_S:  # that is a clock
        return nothing(case.flight_s, lag_s=lag)
    late = (lag - stated_s) / LATE_S if stated_s is not None else lag / UNSTATED_LATE_S
    early = (stated_s - lag) / (2.0 * EARLY_S) if stated_s is not None else 0.0
    was = "no value" if stated_s is None else f"{1e3 * stated_s:.0f} ms"
    figures: dict[str, float | str] = {"lag_ms": 1e3 * lag, "told": was}
    return Sign(max(late, early, 0.0), case.flight_s, figures, (expected_picture(case),))


def clock(case: Case) -> Found:
    """Stamped by a clock that is not the vehicle's."""
    if case.flow is None:
        return NO_FLOW
    lag = found_lag(case)
    if lag is None:
        return Lack("too little turning to hold the flow's clock against the IMU's")
    strength = max(lag / CLOCK_S, -lag / EARLY_S)
    return Sign(max(strength, 0.0), case.flight_s, {"lag_ms": 1e3 * lag}, (expected_picture(case),))


# -- the sensor's own gyro -----------------------------------------------------------------------------------------
def _beyond(fit: Fit, expected: Array) -> float:
    """How far the nearest response that the readings allow is from the one expected. Noise of what is regressed on
    makes a response too small, noise of what is regressed too large the other way round: it lies between the two.
    """
    other = fit.matrix / max(fit.share, 1e-3)
    low, high = np.minimum(fit.matrix, other), np.maximum(fit.matrix, other)
    return float(np.maximum(np.maximum(low - expected, expected - high), 0.0).max())


def gyro(case: Case) -> Found:
    """The flow sensor's own gyro turns otherwise than the vehicle does."""
    if case.flow is None:
        return NO_FLOW
    fit = case.gyro_fit
    if fit is None or case.rates is None:
        return Lack("no gyro in the flow sensor")
    flow = case.flow
    good = flow.lifted & np.isfinite(flow.value[:, 2:4]).all(axis=1) & (flow.quality > 0.0)
    off = 0.0
    if fit.share > LEAST_GYRO_SHARE and _significance(fit, of=0) > SIGNIFICANT:
        angle, mirrored, sure = turned(case)
        same = sure > 0.0 and abs(angle) > TURN_RAD and not mirrored
        expected = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) if same else np.eye(2)
        off = max(_beyond(fit, expected) - 2.0 * float(fit.sigma.max()), 0.0)
    elif fit.share < 0.1 and good.any() and max(map(spread, flow.value[good, 2:4].T)) > TURNING_RAD_S:
        off = GYRO_OFF  # it turns, but not with the vehicle
    rates = at(case.rates[0], case.rates[1][:, :2], flow.t_s - fit.lag_s)
    difference = flow.value[good, 2:4] - rates[good]
    bias = np.median(difference, axis=0) if good.any() else np.zeros(2)
    strength = max(off / GYRO_OFF, float(np.abs(bias).max()) / GYRO_BIAS_RAD_S)
    figures: dict[str, float | str] = {
        "x": float(fit.matrix[0, 0]), "y": float(fit.matrix[1, 1]), "bias_deg_s": float(np.degrees(np.abs(bias).max()))
    }  # fmt: skip
    worst = int(np.argmax(np.abs(np.diag(fit.matrix) - 1.0) + np.abs(bias) / 0.1))
    return Sign(strength, case.flight_s, figures, (gyros_picture(case, worst, fit.lag_s),))


def gyros_picture(case: Case, axis: int, lag_s: float) -> Picture:
    """The vehicle's gyro and the flow sensor's about one axis, 0 or 1, at the flow's instants [rad/s]."""
    assert case.flow is not None
    assert case.rates is not None
    flow = case.flow
    rates = np.interp(flow.t_s - lag_s, case.rates[0], case.rates[1][:, axis])
    return Picture("turning (rad/s)", (
        Trace("estimate", "the vehicle's", flow.t_s, rates),
        Trace("flow", "the flow sensor's gyro", flow.t_s, flow.value[:, 2 + axis]),
    ), f"About {'xy'[axis]}: both see the same vehicle.")  # fmt: skip
