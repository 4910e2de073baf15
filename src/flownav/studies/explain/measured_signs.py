"""Signs that identification measures: the time that flow is divided by, and an offset fixed in the body's axes.

The first needs the sensor's own gyro and no reference; the second a position reference, or GPS.
"""

import numpy as np

from flownav.lab.identification.flight_identification import Measured
from flownav.lab.identification.quantities import Interval
from flownav.studies.explain.case import Case
from flownav.studies.explain.flow_signs import NO_FLOW, NO_RATES, gains, gyros_picture
from flownav.studies.explain.sign import Found, Lack, Picture, Sign, Trace, nothing

TIME_OFF = 0.22  # of the logarithm of a factor, beyond its interval: as of the flow's scale
OFFSET_RAD_S = 0.02  # chosen: 0.02 m/s at 1 m, 1.2 m in a minute


def interval(case: Case) -> Found:
    """Flow and its gyro are off by one factor: the time that both are divided by is stated wrong."""
    if case.flow is None:
        return NO_FLOW
    if case.rates is None:
        return NO_RATES
    turned = case.own_gyro
    if turned is None or not turned.is_known:
        return Lack("no gyro in the flow sensor that turns with the vehicle, about the same axes")
    slope = turned.slope
    known = gains(case)
    if not turned.is_off or (known and not all(turned.is_of_time(gain) for gain, _ in known)):
        return nothing(case.flight_s, slope=slope.value)
    figures: dict[str, float | str] = {
        "slope": slope.value, "low": slope.low, "high": slope.high, "factor": max(slope.value, 1.0 / slope.value),
        "stated": "long" if slope.value < 1.0 else "short",
    }  # fmt: skip
    strength = 1.0 + beyond_one(slope) / TIME_OFF
    return Sign(strength, case.flight_s, figures, (gyros_picture(case, 0, turned.lag_s),))


def beyond_one(slope: Interval) -> float:
    """How far the nearer end of an interval lies from 1, as a share of it; 0 where the interval holds 1."""
    return max(1.0 - slope.high, slope.low - 1.0, 0.0)


def offset(case: Case) -> Found:
    """A drift fixed in the body's axes: what the flow reads where nothing moves."""
    if case.flow is None:
        return NO_FLOW
    known = _known_offsets(case)
    if not known:
        return Lack("no reference and no GPS that moves enough to hold the flow's offset against")
    least = min(known, key=_surely_off) if _contradict(known) else known[0]
    assert least.offset is not None
    x, y = least.offset
    figures: dict[str, float | str] = {"x": x.value, "y": y.value, "reference": least.flown.reference_name}
    picture = offset_picture(case, x.value, y.value)
    return Sign(_surely_off(least) / OFFSET_RAD_S, case.flight_s, figures, (picture,))


def _known_offsets(case: Case) -> list[Measured]:
    """Measurements that have an offset: by the reference, and by GPS too where the first could be a sign."""
    first = case.measured
    if first is not None and first.offset is not None and _surely_off(first) < 0.5 * OFFSET_RAD_S:
        return [first]
    return [one for one in (first, case.measured_by_gps) if one is not None and one.offset is not None]


def _contradict(known: list[Measured]) -> bool:
    """Whether a reference and GPS state offsets beyond both their intervals; the one nearer to 0 counts then."""
    offsets = [one.offset for one in known if one.offset is not None]
    return len(offsets) == 2 and any(
        abs(mine.value - theirs.value) > 0.5 * float(np.hypot(mine.high - mine.low, theirs.high - theirs.low))
        for mine, theirs in zip(*offsets, strict=True)
    )


def _surely_off(one: Measured) -> float:
    """The larger offset of the two axes, by the nearer end of its interval [rad/s]."""
    assert one.offset is not None
    return max(max(abs(axis.value) - 0.5 * (axis.high - axis.low), 0.0) for axis in one.offset)


def offset_picture(case: Case, x: float, y: float) -> Picture:
    """The flow about both axes with its offset [rad/s]."""
    assert case.flow is not None
    t_s, value = case.flow.t_s, case.flow.value
    ends = t_s[[0, -1]]
    return Picture("flow (rad/s)", (
        Trace("flow", "flow about x", t_s, value[:, 0], dots=True),
        Trace("gps", "flow about y", t_s, value[:, 1], dots=True),
        Trace("estimate", "offset about x", ends, 0.0 * ends + x),
        Trace("truth", "offset about y", ends, 0.0 * ends + y),
    ), "What is left where the reference says that nothing moves.")  # fmt: skip
