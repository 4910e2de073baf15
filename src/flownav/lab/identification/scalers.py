"""The factor that makes a flow right, as each autopilot has it, and why it is not written where it is not.

The log's readings hold the factor that the vehicle had in flight, where the log states it: the new one is that over the
gain. PX4 (1.16) and INAV have one factor for both axes, ArduPilot one for each.
"""

import math
from collections.abc import Callable, Iterator

from flownav.lab.identification.findings import Findings, Response
from flownav.lab.identification.parameter_file import FLOAT, INTEGER, Parameter, shown, within
from flownav.lab.identification.quantities import Interval

ARDUPILOT = (("FLOW_FXSCALER", "y", "x"), ("FLOW_FYSCALER", "x", "y"))  # velocity's axis, flow's axis
PX4, INAV, INAV_DEFAULT = "SENS_FLOW_SCALE", "opflow_scale", 10.5
# chosen: recorded flights have 30 to 70; one of 1.3 had explained 80 % of what it was fitted to
LEAST_UNSEEN_PERCENT = 20.0
APART = 0.1  # of a gain: its axes and heights may differ by so much where one factor is to serve them all


def scalers(autopilot: str, findings: Findings) -> list[Parameter]:
    """The factors that the log shows."""
    found = []
    for _, gain, parameter_of, doubts in _wanted(autopilot, findings):
        if gain is not None and not doubts:
            found.append(parameter_of(gain))
    return found


def scalers_left_out(autopilot: str, findings: Findings) -> list[tuple[str, str]]:
    """The factors that are not written, each with the reason."""
    return [(name, doubts[0]) for name, _, _, doubts in _wanted(autopilot, findings) if doubts]


_Wanted = tuple[str, Interval | None, Callable[[Interval], Parameter], list[str]]


def _wanted(autopilot: str, findings: Findings) -> Iterator[_Wanted]:
    """Each factor: its name, the gain that it undoes, what is written of that, and what speaks against it."""
    if autopilot == "ardupilot":
        for name, axis, rate in ARDUPILOT:
            response = _response_along(findings, axis)
            doubts = list(_doubts(findings, axis))
            yield name, None if response is None else response.gain, _ardupilots(findings, name, axis, rate), doubts
        return
    name = PX4 if autopilot == "px4" else INAV
    doubts = [why for axis in "xy" for why in _doubts(findings, axis)]
    gain = findings.gain
    if not doubts and gain.high - gain.low > 2.0 * APART * abs(gain.value):
        doubts = [f"gain {shown(gain, 1.0, '')} over all axes and heights: one factor does not serve them all"]
    yield name, gain, _px4s(findings) if autopilot == "px4" else _inavs(findings), doubts


def _ardupilots(findings: Findings, name: str, axis: str, rate: str) -> Callable[[Interval], Parameter]:
    def parameter(gain: Interval) -> Parameter:
        set_to = findings.parameters.get(name, 0.0)
        low, value, high = (1e3 * (one - 1.0) for one in _factors(gain, 1.0 + 1e-3 * set_to))
        reason = (
            f"per mille: {_given(name, set_to, 0.0)}1/gain - 1 of velocity {axis}, which is flow about {rate}; gain "
            f"{shown(gain, 1.0, '')}{_alone(gain)}; {value:.0f} [{low:.0f}, {high:.0f}] (firmware before 4.5 takes "
            "-200 to 200)"
        )
        return within(name, value, -800.0, 800.0, INTEGER, reason)

    return parameter


def _px4s(findings: Findings) -> Callable[[Interval], Parameter]:
    def parameter(gain: Interval) -> Parameter:
        set_to = findings.parameters.get(PX4, 1.0)
        low, value, high = _factors(gain, set_to)
        reason = (
            f"{_given(PX4, set_to, 1.0)}1/gain of both axes; gain {shown(gain, 1.0, '')}{_alone(gain)}; {value:.3f} "
            f"[{low:.3f}, {high:.3f}] (PX4 1.16 and later)"
        )
        return within(PX4, value, 0.5, 1.5, FLOAT, reason)

    return parameter


def _inavs(findings: Findings) -> Callable[[Interval], Parameter]:
    def parameter(gain: Interval) -> Parameter:
        known = INAV in findings.parameters
        set_to = findings.parameters.get(INAV, INAV_DEFAULT)
        low, value, high = (1.0 / one for one in _factors(gain, 1.0 / set_to)[::-1])
        was = f"{INAV} {set_to:g} of the log" if known else f"INAV's own {set_to:g}, as the log does not state it"
        reason = (
            f"counts a degree: {was}, times gain {shown(gain, 1.0, '')}{_alone(gain)}; "
            f"{value:.2f} [{low:.2f}, {high:.2f}]"
            f"{'' if known else '; where yours is another, set yours times the gain'}"
        )
        return within(INAV, value, 0.0, 10_000.0, FLOAT, reason)

    return parameter


def _given(name: str, set_to: float, default: float) -> str:
    return "" if set_to == default else f"{name} was {set_to:g} in this log, and counts; "


def _may_be_one(gain: Interval) -> bool:
    return gain.low <= 1.0 <= gain.high


def _alone(gain: Interval) -> str:
    return " may be 1, left alone" if _may_be_one(gain) else ""


def _factors(gain: Interval, was: float) -> tuple[float, float, float]:
    """Least, best and greatest factor that undo a gain, where the readings already hold one."""
    low, high = sorted(was / max(abs(end), 1e-3) for end in (gain.low, gain.high))
    return low, was if _may_be_one(gain) else was / max(abs(gain.value), 1e-3), high


def _doubts(findings: Findings, axis: str) -> Iterator[str]:
    """Why the gain of velocity along an axis is not identified, if it is not; nothing of an axis that was not seen."""
    response = _response_along(findings, axis)
    if response is None:
        return
    if findings.no_scaler_mends:
        yield findings.no_scaler_mends
    shown_gain, known = f"gain of velocity {axis} {shown(response.gain, 1.0, '')}", response.validation_percent
    unseen = [value for value in known if math.isfinite(value)]
    if response.choice.excitation.identifiable < 1:
        yield f"{shown_gain}: {response.choice.excitation.verdict}"
    elif unseen and sum(unseen) / len(unseen) < LEAST_UNSEEN_PERCENT:
        share = sum(unseen) / len(unseen)
        needed = f"{LEAST_UNSEEN_PERCENT:g} % are needed"
        yield f"{shown_gain}: its model fits {share:.1f} % of what it was not fitted to, {needed}"


def _response_along(findings: Findings, axis: str) -> Response | None:
    """Response that shows an axis's gain: of a rig, which moves along one axis, the best of all heights."""
    along = [response for response in findings.responses if response.axis == axis]
    if not along:
        return None
    return along[-1] if findings.kind == "flight" else findings.best
