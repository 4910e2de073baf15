"""Autopilot parameters from an identified sensor, in the files that ground stations load.

PX4: QGroundControl's tab-separated .params (vehicle, component, name, value, MAVLink type: 6 a 32-bit integer, 9 a
float). ArduPilot: Mission Planner's and MAVProxy's NAME,VALUE .param. In both, a line that starts with # is a
comment; each value has one above it with the figure that it comes from. Names that older firmware used are given
in the comments: a ground station would refuse them on a newer one.

What a log does not identify is not written: the file says so, and the vehicle keeps what it has. The latency counts as
identified where the verdict on the excitation says it, a gain where its own does and the model holds on unseen data.

PX4's noise is an angular rate that runs from N_MIN at quality 255 to N_MAX at QMIN; ArduPilot's is one number.
Neither knows height: the figure taken is the noise over height where it is worst, so the filter is never told less.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from flownav.core.errors import InputError, arg
from flownav.lab.identification.findings import Findings, Response
from flownav.lab.identification.quantities import Interval
from flownav.lab.identification.sensor_file import write_whole
from flownav.sensors.datasheet import FlowSensor

INTEGER, FLOAT = 6, 9
AUTOPILOTS = {"px4": ".params", "ardupilot": ".param"}
LEAST_NOISE_RAD_S = 0.05  # the floor of both autopilots
EKF3_AVERAGING_MS = 50.0  # half of EKF3's flowTimeDeltaAvg_ms, which it subtracts beside EK3_FLOW_DELAY
DELAYS = {"px4": "EKF2_OF_DELAY", "ardupilot": "EK3_FLOW_DELAY"}
SCALERS = (("FLOW_FXSCALER", "y", "x"), ("FLOW_FYSCALER", "x", "y"))  # ArduPilot's, velocity's axis, flow's axis
# chosen: recorded flights have 30 to 70; one of 1.3 had explained 80 % of what it was fitted to
LEAST_UNSEEN_PERCENT = 20.0


class Parameter(NamedTuple):
    """A name, its value in the autopilot's unit, its MAVLink type and where it comes from."""

    name: str
    value: float
    kind: int
    reason: str

    @property
    def text(self) -> str:
        """The value as the file holds it."""
        return str(round(self.value)) if self.kind == INTEGER else f"{self.value:.4g}"


def parameters(autopilot: str, findings: Findings, sensor: FlowSensor) -> list[Parameter]:
    """The parameters for `px4` or `ardupilot`. InputError for another."""
    if autopilot not in AUTOPILOTS:
        raise InputError(f"{arg('autopilot')} {autopilot}: px4 or ardupilot are possible")
    return _px4(findings, sensor) if autopilot == "px4" else _ardupilot(findings)


def file_text(autopilot: str, found: list[Parameter], remarks: tuple[str, ...]) -> str:
    """The file."""
    lines = [f"# flownav identify, for {autopilot}", *(f"# {_one_line(remark)}" for remark in remarks)]
    if autopilot == "px4":
        lines.append("# Vehicle-Id Component-Id Name Value Type")
    for parameter in found:
        lines.append(f"# {_one_line(parameter.reason)}")
        lines.append(
            f"1\t1\t{parameter.name}\t{parameter.text}\t{parameter.kind}"
            if autopilot == "px4"
            else f"{parameter.name},{parameter.text}"
        )
    return "\n".join(lines) + "\n"


def write_parameters(path: Path, autopilot: str, findings: Findings, sensor: FlowSensor) -> list[Parameter]:
    """Write the file, whole or not at all."""
    found = parameters(autopilot, findings, sensor)
    unwritten = (f"{name} is not written: {why}" for name, why in left_out(autopilot, findings))
    remarks = (sensor.name, f"axes: {findings.axes.verdict}", *_turn(autopilot, findings), *unwritten)
    write_whole(path, file_text(autopilot, found, remarks))
    return found


def left_out(autopilot: str, findings: Findings) -> list[tuple[str, str]]:
    """The parameters that the log does not identify, each with the reason."""
    found = [] if _knows_latency(findings) else [(DELAYS[autopilot], f"latency: {findings.excitation.verdict}")]
    if autopilot == "ardupilot":
        found += [(name, why) for name, axis, _ in SCALERS for why in _doubts(findings, axis)]
    return found


def _knows_latency(findings: Findings) -> bool:
    """Whether the verdict reports the latency, which a slow input shows after the gain."""
    return findings.excitation.identifiable >= 2


def _doubts(findings: Findings, axis: str) -> Iterator[str]:
    """Why the gain of velocity along an axis is not identified, if it is not; nothing of an axis that was not seen."""
    response = _response_along(findings, axis)
    if response is None:
        return
    told, known = f"gain of velocity {axis} {_shown(response.gain, 1.0, '')}", response.validation_percent
    unseen = [value for value in known if math.isfinite(value)]
    if response.choice.excitation.identifiable < 1:
        yield f"{told}: {response.choice.excitation.verdict}"
    elif unseen and sum(unseen) / len(unseen) < LEAST_UNSEEN_PERCENT:
        share = sum(unseen) / len(unseen)
        needed = f"{LEAST_UNSEEN_PERCENT:g} % are needed"
        yield f"{told}: its model fits {share:.1f} % of what it was not fitted to, {needed}"


def _response_along(findings: Findings, axis: str) -> Response | None:
    """What shows an axis's gain: of a rig, which moves along one axis, the best of all heights."""
    along = [response for response in findings.responses if response.axis == axis]
    if not along:
        return None
    return along[-1] if findings.kind == "flight" else findings.best


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _turn(autopilot: str, findings: Findings) -> list[str]:
    """What to do about axes that are not the vehicle's: turned by 180 degrees can be set, other faults are wiring."""
    if findings.axes.right or findings.kind == "rig":
        return []
    if "180" in findings.axes.verdict:
        name = "SENS_FLOW_ROT to 4 (180 deg)" if autopilot == "px4" else "FLOW_ORIENT_YAW to 18000 (180 deg)"
        return [f"set {name} if the log was not corrected for the mounting already"]
    return ["set the sensor's rotation, or mend the driver's axes, before this file is used"]


def _px4(findings: Findings, sensor: FlowSensor) -> list[Parameter]:
    best, worst, why_best, why_worst = _angular_noise(findings)
    limits, lowest, highest = sensor.limits, *findings.heights_m
    delay = Parameter(
        DELAYS["px4"], _bounded(1e3 * findings.latency_s.value, 0.0, 300.0), FLOAT,
        f"ms: latency {_shown(findings.latency_s, 1e3, 'ms')} when a reading arrives",
    )  # fmt: skip
    return [
        Parameter("EKF2_OF_CTRL", 1, INTEGER, "flow fused; before PX4 1.14 bit 1 of EKF2_AID_MASK"),
        *([delay] if _knows_latency(findings) else []),
        Parameter("EKF2_OF_N_MIN", best, FLOAT, f"rad/s at quality 255: {why_best}"),
        Parameter("EKF2_OF_N_MAX", worst, FLOAT, f"rad/s at EKF2_OF_QMIN: {why_worst}"),
        Parameter("EKF2_OF_QMIN", findings.least_quality, INTEGER,
                  f"least quality among the readings identified from: {findings.least_quality}"),
        Parameter("SENS_FLOW_MINHGT", _bounded(limits.min_height_m, 0.0, 1.0), FLOAT,
                  f"m: sensor file's limit; identified from {lowest:.2f} m up (before PX4 1.9 SENS_FLOW_MINRNG)"),
        Parameter("SENS_FLOW_MAXHGT", _bounded(limits.max_height_m, 1.0, 100.0), FLOAT,
                  f"m: sensor file's limit; identified up to {highest:.2f} m"),
        Parameter("SENS_FLOW_MAXR", max(1.0, limits.max_flow_rad_s), FLOAT,
                  f"rad/s: sensor file's limit; up to {findings.max_flow_rad_s:.2f} rad/s was seen "
                  "(before PX4 1.9 EKF2_OF_RMAX)"),
    ]  # fmt: skip


def _ardupilot(findings: Findings) -> list[Parameter]:
    _, worst, _, why = _angular_noise(findings, by_quality=False)
    gate = 25.0 * math.ceil(4.0 * max(3.0, findings.noise.tail))
    delay = Parameter(
        DELAYS["ardupilot"], _bounded(1e3 * findings.latency_s.value - EKF3_AVERAGING_MS, 0.0, 250.0), INTEGER,
        f"ms: latency {_shown(findings.latency_s, 1e3, 'ms')} when a reading arrives, less the "
        f"{EKF3_AVERAGING_MS:.0f} ms that EKF3 takes off by itself for averaging",
    )  # fmt: skip
    found = [
        *([delay] if _knows_latency(findings) else []),
        Parameter("EK3_FLOW_M_NSE", min(worst, 1.0), FLOAT, f"rad/s: {why}"),
        Parameter("EK3_FLOW_I_GATE", _bounded(gate, 100.0, 1000.0), INTEGER,
                  f"hundredths of a sigma: 99.7 % of the readings lie within {findings.noise.tail:.1f} sigma"),
    ]  # fmt: skip
    for name, axis, rate in SCALERS:
        response = _response_along(findings, axis)
        if response is None or any(_doubts(findings, axis)):
            continue
        gain = response.gain
        same = gain.low <= 1.0 <= gain.high
        per_mille = 0.0 if same else 1e3 * (1.0 / max(abs(gain.value), 1e-3) - 1.0)
        found.append(Parameter(
            name, _bounded(per_mille, -800.0, 800.0), INTEGER,
            f"per mille: 1/gain - 1 of velocity {axis}, which is flow about {rate}; gain {_shown(gain, 1.0, '')}"
            f"{' may be 1, left alone' if same else ''} (firmware before 4.5 takes -200 to 200)",
        ))  # fmt: skip
    return found


def _angular_noise(findings: Findings, by_quality: bool = True) -> tuple[float, float, str, str]:
    """Noise at the best and at the worst quality [rad/s], and the figures behind them."""
    points = findings.noise.points
    worst = max(points, key=lambda point: point.sigma_rad_s)
    sigma, why = worst.sigma_rad_s, f"{worst.sigma_m_s:.3f} m/s at {worst.height_m:.2f} m, the worst height"
    classes = findings.noise.quality
    if not by_quality or len(classes) < 2:
        held = max(LEAST_NOISE_RAD_S, sigma)
        return held, held, why, why
    ratio = math.sqrt(max(c.variance_m2_s2 for c in classes) / classes[-1].variance_m2_s2)
    best = max(LEAST_NOISE_RAD_S, sigma)
    return best, best * max(1.0, ratio), why, f"{why}, times {ratio:.2f} of the worst quality against the best"


def _bounded(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


def _shown(interval: Interval, factor: float, unit: str) -> str:
    value, low, high = (factor * number for number in interval)
    return f"{value:.3g} {unit}".strip() + f" [{low:.3g}, {high:.3g}]"
