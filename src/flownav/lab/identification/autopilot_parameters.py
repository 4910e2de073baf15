"""Autopilot parameters from an identified sensor, in the files that ground stations load (`parameter_file`).

Names that older firmware used are given in the comments: a ground station would refuse them on a newer one.

A quantity that a log does not identify is not written: the file states this, and the vehicle keeps its own. The latency
counts as identified where the verdict on the excitation states it, a gain where its own does and the model holds on
unseen data. A limit follows from a datasheet alone (`--base`): the fastest flow, the greatest height and the least
quality of one flight are only those of that flight, and an autopilot refuses all flow beyond them.

PX4's noise is an angular rate that runs from N_MIN at quality 255 to N_MAX at QMIN; ArduPilot's is one number. Neither
depends on height: the figure taken is the noise over height where it is worst, so the filter is never given less.
"""

import math
from pathlib import Path

from flownav.core.errors import InputError, arg
from flownav.lab.identification.findings import Findings
from flownav.lab.identification.parameter_file import (
    AUTOPILOTS,
    FLOAT,
    INTEGER,
    Parameter,
    file_text,
    shown,
    within,
)
from flownav.lab.identification.scalers import scalers, scalers_left_out
from flownav.lab.identification.sensor_file import write_whole
from flownav.sensors.datasheet import FlowSensor

LEAST_NOISE_RAD_S = 0.05  # the floor of both autopilots
EKF3_AVERAGING_MS = 50.0  # half of EKF3's flowTimeDeltaAvg_ms, which it subtracts beside EK3_FLOW_DELAY
DELAYS = {"px4": "EKF2_OF_DELAY", "ardupilot": "EK3_FLOW_DELAY"}
LIMITS = ("SENS_FLOW_MINHGT", "SENS_FLOW_MAXHGT", "SENS_FLOW_MAXR")
NO_DATASHEET = "a log does not show a sensor's limits; give a file with its datasheet as the base (--base)"


def parameters(autopilot: str, findings: Findings) -> list[Parameter]:
    """The parameters for `px4`, `ardupilot` or `inav`. InputError for another."""
    if autopilot not in AUTOPILOTS:
        raise InputError(f"{arg('autopilot')} {autopilot}: px4, ardupilot or inav are possible")
    own = {"px4": _px4, "ardupilot": _ardupilot}.get(autopilot)
    return [*([] if own is None else own(findings)), *scalers(autopilot, findings)]


def write_parameters(path: Path, autopilot: str, findings: Findings, name: str) -> list[Parameter]:
    """Write the file, whole or not at all. name: the sensor's."""
    found = parameters(autopilot, findings)
    unwritten = (f"{name} is not written: {why}" for name, why in left_out(autopilot, findings))
    remarks = (name, f"axes: {findings.axes.verdict}", *_turn(autopilot, findings), *unwritten)
    write_whole(path, file_text(autopilot, found, remarks))
    return found


def left_out(autopilot: str, findings: Findings) -> list[tuple[str, str]]:
    """The parameters that the log does not identify, each with the reason."""
    found = []
    if autopilot in DELAYS and not _knows_latency(findings):
        found.append((DELAYS[autopilot], f"latency: {findings.excitation.verdict}"))
    found += scalers_left_out(autopilot, findings)
    if autopilot == "px4":
        found.append(("EKF2_OF_QMIN", "no reading of this log shows from which quality on the flow is bad"))
        found += [] if findings.datasheet is not None else [(name, NO_DATASHEET) for name in LIMITS]
    return found


def _knows_latency(findings: Findings) -> bool:
    """Whether the verdict reports the latency, which a slow input shows after the gain."""
    return findings.excitation.identifiable >= 2


def _turn(autopilot: str, findings: Findings) -> list[str]:
    """Advice on axes that are not the vehicle's: a turn by 180 degrees can be set, other faults are wiring."""
    if findings.axes.right or findings.kind == "rig":
        return []
    if "180" in findings.axes.verdict:
        name = {
            "px4": "SENS_FLOW_ROT to 4 (180 deg)",
            "ardupilot": "FLOW_ORIENT_YAW to 18000 (180 deg)",
            "inav": "align_opflow half a turn on",
        }[autopilot]
        return [f"set {name} if the log was not corrected for the mounting already"]
    return ["set the sensor's rotation, or mend the driver's axes, before this file is used"]


def _px4(findings: Findings) -> list[Parameter]:
    best, worst, why_best, why_worst = _angular_noise(findings)
    delay = within(
        DELAYS["px4"], 1e3 * findings.latency_s.value, 0.0, 300.0, FLOAT,
        f"ms: latency {shown(findings.latency_s, 1e3, 'ms')} when a reading arrives",
    )  # fmt: skip
    return [
        Parameter("EKF2_OF_CTRL", 1, INTEGER, "flow fused; before PX4 1.14 bit 1 of EKF2_AID_MASK"),
        *([delay] if _knows_latency(findings) else []),
        Parameter("EKF2_OF_N_MIN", best, FLOAT, f"rad/s at quality 255: {why_best}"),
        Parameter("EKF2_OF_N_MAX", worst, FLOAT, f"rad/s at EKF2_OF_QMIN: {why_worst}"),
        *([] if findings.datasheet is None else _limits(findings, findings.datasheet)),
    ]


def _limits(findings: Findings, datasheet: FlowSensor) -> list[Parameter]:
    """The datasheet's limits; what the log reached beside them."""
    limits, (lowest, highest) = datasheet.limits, findings.heights_m
    source = f"the datasheet's ({datasheet.name})"
    return [
        within(LIMITS[0], float(limits.min_height_m), 0.0, 1.0, FLOAT,
               f"m: {source}; identified from {lowest:.2f} m up (before PX4 1.9 SENS_FLOW_MINRNG)"),
        within(LIMITS[1], float(limits.max_height_m), 1.0, 100.0, FLOAT,
               f"m: {source}; identified up to {highest:.2f} m"),
        within(LIMITS[2], float(limits.max_flow_rad_s), 1.0, 100.0, FLOAT,
               f"rad/s: {source}; up to {findings.max_flow_rad_s:.2f} rad/s was seen (before PX4 1.9 EKF2_OF_RMAX)"),
    ]  # fmt: skip


def _ardupilot(findings: Findings) -> list[Parameter]:
    _, worst, _, why = _angular_noise(findings, by_quality=False)
    gate = 25.0 * math.ceil(4.0 * max(3.0, findings.noise.tail))
    delay = within(
        DELAYS["ardupilot"], 1e3 * findings.latency_s.value - EKF3_AVERAGING_MS, 0.0, 250.0, INTEGER,
        f"ms: latency {shown(findings.latency_s, 1e3, 'ms')} when a reading arrives, less the "
        f"{EKF3_AVERAGING_MS:.0f} ms that EKF3 takes off by itself for averaging",
    )  # fmt: skip
    return [
        *([delay] if _knows_latency(findings) else []),
        within("EK3_FLOW_M_NSE", worst, LEAST_NOISE_RAD_S, 1.0, FLOAT, f"rad/s: {why}"),
        within("EK3_FLOW_I_GATE", gate, 100.0, 1000.0, INTEGER,
               f"hundredths of a sigma: 99.7 % of the readings lie within {findings.noise.tail:.1f} sigma"),
    ]  # fmt: skip


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
