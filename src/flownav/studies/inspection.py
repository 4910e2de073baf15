"""Inspection: a log in figures: its streams, clock, limits, agreement of its sensors, missing data."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import VELOCITY_BODY
from flownav.lab.identification.first_look import IN_PART, Look, first_look
from flownav.lab.identification.flight import jumps
from flownav.lab.identification.own_gyro import own_gyro
from flownav.lab.identification.range_truth import untrue
from flownav.logs.log import Log, attitude_at
from flownav.logs.plausible import check_plausible
from flownav.replays.judged import autopilot_scores, flying_at, obstacles
from flownav.replays.prepare import ReplayOptions, prepare
from flownav.replays.sentinel import Finding, findings
from flownav.scoring.coverage import silences
from flownav.studies.explain.judge import explain

CLOCK_REASONS = {
    "no_time": "without a time",
    "out_of_order": "out of time order",
    "clock_jump": "many minutes away from all others",
    "duplicate": "repeated",
}
LONG_GAP_S = 1.0
LONG_GAP_STEPS = 10.0  # times the usual step: a slow sensor has no gap in every step
LIMITED = {"range_m": Sensor.RANGE, "flow_rad_s": Sensor.FLOW_RATE}


def summarise(log: Log) -> dict[str, Any]:
    """The output of `flownav info --json`; None where a figure does not exist. Nothing here raises for a poor log."""
    start, end = log.span_s
    look, why_not = _look(log)
    checked, found = _findings(log)
    found += findings_of(log, look, found)
    found += [Finding(text) for text in silences(log.streams, log.span_s)]
    explained = explain(log)
    return {
        "log": log.path.name,
        "start_s": start,
        "end_s": end,
        "streams": [_stream(stream) for stream in log.streams.values()],
        "clock": [line for stream in log.streams.values() for line in _clock_trouble(stream)],
        "limits": {name: _limit(log, name) for name in log.limits},
        "verdict": _verdict(log, look, why_not),
        "explained": explained.verdict,
        "causes": [one.name for one in explained.findings],
        "agreement": None if look is None else {**look._asdict(), "agrees": look.agrees},
        "checked": checked,
        "warnings": [finding.text for finding in found],
        "flow_is_wrong": any(finding.flow_is_wrong for finding in found),
        "replayable": not obstacles(log),
        "obstacles": obstacles(log),
        "absences": [absence._asdict() for absence in log.absences],
        "origin_lat_lon_deg_alt_m": None if log.origin_deg_m is None else list(log.origin_deg_m),
        "truth": None if log.truth is None else _track(log.truth["t_s"]),
        "autopilot": _autopilot(log),
        "notes": list(log.notes),
        "inputs": {name: {"sha256": digest} for name, digest in log.inputs.items()},
    }


def _look(log: Log) -> tuple[Look | None, str]:
    """Flow against the best reference; None with the reason where the log lacks what that takes."""
    try:
        return first_look(log), ""
    except InputError as error:
        return None, f"flow is not compared with a reference: {str(error).removeprefix(f'{log.path}: ')}"


def _verdict(log: Log, look: Look | None, why_not: str) -> str:
    """Flow against its reference in words, and what the sensor's own gyro shows to be wrong, which needs none."""
    known = look is not None and look.correlation >= IN_PART
    gyro = own_gyro(log)
    wrong = "" if gyro is None else gyro.sentence(abs(look.scale) if look is not None and known else None)
    return "; ".join(filter(None, [why_not if look is None else look.verdict, wrong]))


def _stream(stream: Stream) -> dict[str, Any]:
    gap, at = _largest_gap(stream.t_s)
    no_data = float(np.mean(stream.quality <= 0))
    return {
        "sensor": stream.sensor.name.lower(),
        **_track(stream.t_s),
        "largest_gap_s": gap,
        "largest_gap_at_s": at,
        "delay_s": stream.delay_s,
        "no_data_share": no_data,
        "rejected": dict(stream.rejected),
    }


def _track(t_s: Array) -> dict[str, Any]:
    """Count, rate and span of rows."""
    span = float(t_s[-1] - t_s[0])
    rate = (len(t_s) - 1) / span if span > 0 else None
    return {"count": len(t_s), "rate_hz": rate, "start_s": float(t_s[0]), "end_s": float(t_s[-1])}


def _largest_gap(t_s: Array) -> tuple[float | None, float | None]:
    """The longest step and when it begins [s]; None without two readings."""
    if len(t_s) < 2:
        return None, None
    row = int(np.argmax(np.diff(t_s)))
    return float(t_s[row + 1] - t_s[row]), float(t_s[row])


def _clock_trouble(stream: Stream) -> list[str]:
    name = stream.sensor.name.lower()
    lines = [
        f"{name}: {stream.rejected[r]} readings {words}" for r, words in CLOCK_REASONS.items() if r in stream.rejected
    ]
    steps = np.diff(stream.t_s)
    if len(steps) and stream.sensor != Sensor.LANDED:
        long = steps > max(LONG_GAP_S, LONG_GAP_STEPS * float(np.median(steps)))
        if long.any():
            gap, at = _largest_gap(stream.t_s)
            lines.append(f"{name}: {np.count_nonzero(long)} gaps, {steps[long].sum():.1f} s together, the longest "
                         f"{gap:.1f} s at {at:.1f} s")  # fmt: skip
    return lines


def _limit(log: Log, name: str) -> dict[str, Any]:
    """A stated limit, and what share of the readings lies outside it."""
    low, high = log.limits[name]
    stream = log.streams.get(LIMITED[name]) if name in LIMITED else None
    outside = None
    if stream is not None:
        value = abs(stream.value[:, : 2 if name == "flow_rad_s" else 1])
        outside = float(np.mean(((value < low) | (value > high)).any(axis=1)))
    return {"low": low, "high": high, "outside_share": outside}


def _findings(log: Log) -> tuple[str, list[Finding]]:
    """The sensors that were compared with each other, and the findings."""
    if Sensor.ATTITUDE not in log.streams:
        return "no two sensors: the log has no attitude to compare the others with", []
    found = []
    try:
        check_plausible(log.path, log.streams)
    except InputError as error:
        found.append(Finding(str(error).removeprefix(f"{log.path}: "), label="Error"))
    compared = "gravity, rates and GPS with the attitude and each other"
    try:
        streams = dict(prepare(log, ReplayOptions()).streams)
    except InputError as error:
        return compared, [*found, Finding(str(error), label="Note")]
    if not streams.keys() & {Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY}:
        return compared, found + findings(streams, ())
    if Sensor.GPS_VELOCITY in streams:
        return f"{compared}; flow with GPS velocity", found + findings(streams, ())
    witness = _witness(log)
    if witness is None:
        return compared, found
    of_reference = findings({**streams, Sensor.GPS_VELOCITY: witness}, ())
    found += [finding._replace(text=finding.text.replace("GPS", "the reference")) for finding in of_reference]
    return f"{compared}; flow with the reference's velocity", found


def _witness(log: Log) -> Stream | None:
    """The reference's body velocity in the axes of the log's attitude, for want of GPS velocity; None without one."""
    if log.truth is None or Sensor.ATTITUDE not in log.streams or not set(VELOCITY_BODY) <= log.truth.keys():
        return None
    t_s = np.asarray(log.truth["t_s"], float)
    body = np.column_stack([np.asarray(log.truth[name], float) for name in VELOCITY_BODY])
    rotation = rotation_from_quaternion(*attitude_at(log.streams[Sensor.ATTITUDE], t_s).T)
    return Stream.of(Sensor.GPS_VELOCITY, t_s, np.column_stack(to_earth(rotation, *body.T)))


def _autopilot(log: Log) -> dict[str, Any] | None:
    if log.autopilot is None:
        return None
    return {**_track(log.autopilot["t_s"]), **(autopilot_scores(log, ReplayOptions().gps_delay_s) or {})}


# -- what a first look makes a warning ---------------------------------------------------------------------------
LEAST_JUMPING = 0.01  # of the steps in flight: of less, one echo is no trouble


def findings_of(log: Log, look: Look | None, found: Sequence[Finding]) -> list[Finding]:
    """Warnings next to those found: the flow's axes, unless they are reported already, and a range that jumps."""
    remarks = []
    if look is not None and look.clear and not look.right and not any(finding.flow_is_wrong for finding in found):
        sure = look.correlation >= IN_PART
        remarks += [Finding(f"flow: {look.axes}, against {look.against}; mend the log's flow columns", True)] * sure
    return [*remarks, *_of_range(log)]


def _of_range(log: Log) -> list[Finding]:
    if Sensor.RANGE not in log.streams:
        return []
    stream = log.streams[Sensor.RANGE]
    aloft = flying_at(log, stream.t_s - stream.delay_s) & (stream.value[:, 0] > 0.0)
    t_s, range_m = stream.t_s[aloft], stream.value[aloft, 0]
    share, doubt = jumps(t_s, range_m)
    remarks = [Finding(line) for line in untrue(log, aloft).notes]
    if share < LEAST_JUMPING:
        return remarks
    largest = float(np.abs(np.diff(range_m)).max())
    jumping = f"range jumps in {share:.0%} of its steps in flight, by up to {largest:.1f} m"
    return [*remarks, Finding(f"{jumping}: velocities from flow and range are off by {doubt:.0%} or so")]
