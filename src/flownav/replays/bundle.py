"""A replay as a Record: estimates, measurements, innovations, events, scores and provenance; and an attitude for logs
without one."""

import platform
from dataclasses import replace
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import COLUMNS, Array, Sensor, Stream
from flownav.core.provenance import version_of
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record
from flownav.estimation.gating import Reason
from flownav.logs.log import Log, attitude_at
from flownav.navigation.flags import flagged, flags_of
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tables import estimate_table, happenings, innovation_table, states_table
from flownav.replays.judged import autopilot_path, placed_here, setpoints
from flownav.replays.prepare import FLOW, ReplayOptions, prepare
from flownav.replays.session import Replay, replay
from flownav.scoring.reference import velocity_of
from flownav.scoring.vibration import spectrum_of
from flownav.sensors.datasheet import IdentifiedFlow

KEPT_SENSORS = (
    Sensor.GPS_POSITION,
    Sensor.GPS_VELOCITY,
    Sensor.FLOW_RATE,
    Sensor.FLOW_VELOCITY,
    Sensor.RANGE,
    Sensor.BARO,
    Sensor.PAD,
    Sensor.LANDED,
)
LOST_AFTER_S = 1.0  # chosen: five fixes of a 5 Hz receiver; it writes events, and decides nothing
DOWN = "pos_d_m"
FOUND = "the log has no attitude: it is the navigator's own, from IMU and flow, its heading counted from its start"


def to_record(replay: Replay, scores: dict[str, Any], command: list[str] | str) -> Record:
    """The record of a replay. `scores` go into its manifest; `command` is what the user typed or called."""
    record = Record(_manifest(replay, scores, command))
    estimate, estimate_rows = replay.estimate, replay.estimate_rows
    record.add("estimate", estimate_table(estimate))
    record.add("states", states_table(estimate))
    if replay.smoothed is not None:
        record.add("smoothed", estimate_table(replay.smoothed))
    for sensor in KEPT_SENSORS:
        if sensor in replay.log.streams:
            stream = replay.log.streams[sensor]
            columns = dict(zip(COLUMNS[sensor], _with_turning(replay, sensor).T, strict=True))
            record.add(sensor.name.lower(), {"t_s": stream.t_s, **columns, "quality": stream.quality})
    if replay.truth_alignment is not None:
        record.add("truth", _truth(replay))
    for name, table in _references(replay).items():
        record.add(name, table)
    warned = flagged(estimate_rows.t_s, flags_of(replay.written.event))
    record.add("judging", {"t_s": estimate_rows.t_s, "flagged": warned.astype(float)})
    log, placed = (
        replay.log,
        placed_here(replay.log, replay.options.gps_delay_s, estimate_rows.t_s, estimate_rows.pos_ned_m),
    )
    own, asked = autopilot_path(log, placed), setpoints(log, placed)
    for name, beside in (("autopilot", own), ("setpoint", asked), ("battery", log.battery)):
        if beside is not None:
            record.add(name, beside)
    record.add("innovation", innovation_table(replay.innovation))
    record.add("events", _events(replay))
    return record


def _with_turning(replay: Replay, sensor: Sensor) -> Array:
    """A sensor's values as the log has them; of a flow sensor without a gyro, with the turning that was taken off."""
    value = replay.log.streams[sensor].value
    prepared = replay.prepared.streams[sensor].value
    if sensor != Sensor.FLOW_RATE or len(prepared) != len(value):
        return value
    width = value.shape[1]
    return np.where(np.isnan(value) & (np.arange(width) >= 2), prepared[:, :width], value)


def _manifest(replay: Replay, scores: dict[str, Any], command: list[str] | str) -> dict[str, Any]:
    log = replay.log
    found = {name: version_of(name) for name in ("flownav", "numpy", "numba", "pyarrow")}
    versions = {name: version for name, version in found.items() if version}
    return {
        "kind": "replay",
        "log": log.path.name,
        **({} if log.clock_start_s is None else {"clock_start_s": log.clock_start_s}),
        **({} if log.truth is None else {"truth_name": log.truth_name}),
        "filter": "landing",
        "duration_s": scores["duration_s"],
        "delays_s": {sensor.name.lower(): delay for sensor, delay in replay.prepared.delays_s.items() if delay},
        "parameters": {
            "filter": replay.settings.model_dump(),
            "gps_delay_s": replay.options.gps_delay_s,
            "gps_outages_s": [list(window) for window in replay.options.gps_outages_s],
            "use_flow": replay.options.use_flow,
            "flow_scale": list(replay.options.flow_scale),
            "flow_sensor": replay.options.identified._asdict() if replay.options.identified else None,
            **({"flow_noise": replay.options.flow_noise._asdict()} if replay.options.flow_noise.stated else {}),
            **({} if log.origin_deg_m is None else {"origin_lat_lon_deg_alt_m": list(log.origin_deg_m)}),
        },
        "provenance": {
            "versions": {"python": platform.python_version(), **versions},
            "inputs": {name: {"sha256": digest} for name, digest in log.inputs.items()},
        },
        "command": command,
        "findings": [
            {"label": found.label, "text": found.text, "bad": bool(found.flow_is_wrong or found.unfused)}
            for found in replay.findings
        ],
        "notes": list(replay.prepared.notes),
        **({} if (shaken := _vibration(log)) is None else {"vibration": shaken}),
        "judging": {"flight_s": None if replay.references.flight_s is None else list(replay.references.flight_s)},
        "scores": scores,
    }


def _vibration(log: Log) -> dict[str, Any] | None:
    """The spectrum of the log's inertial readings, which the record does not keep."""
    imu = log.streams.get(Sensor.IMU)
    return None if imu is None else spectrum_of(imu.t_s, imu.value)


def _references(replay: Replay) -> dict[str, dict[str, Array]]:
    """The log's truth as it stands there, so that another estimate can be scored against it from the record alone."""
    truth, heading = replay.log.truth, replay.log.heading_truth
    if truth is None:
        return {}
    kept = {name: np.asarray(truth[name], float) for name in ("t_s", *POSITION_NED, *QUATERNION) if name in truth}
    if heading is None:
        return {"reference": kept}
    turned = {name: np.asarray(heading[name], float) for name in ("t_s", "yaw_rad")}
    return {"reference": kept, "reference_heading": turned}


def _truth(replay: Replay) -> dict[str, Array]:
    """The truth in the estimate's frame; body velocity by differences, in the axes of the estimated attitude."""
    placed, truth = replay.truth_alignment, replay.log.truth
    assert placed is not None
    assert truth is not None
    position = placed.moved(replay.truth_position)
    velocity = placed.turned(velocity_of(truth["t_s"], replay.truth_position))
    rotation = rotation_from_quaternion(*attitude_at(replay.attitude, truth["t_s"]).T)
    body = {
        name: sum(rotation[3 * row + column] * velocity[:, row] for row in range(3))
        for column, name in enumerate(VELOCITY_BODY)
    }
    return {"t_s": truth["t_s"], **dict(zip(POSITION_NED, position.T, strict=True)), **body}


def _events(replay: Replay) -> dict[str, Any]:
    """The events of a replay, in order of time."""
    start, _ = replay.log.span_s
    events = [(start, "replay", "note", note, np.nan) for note in replay.prepared.notes]
    events += [(start, "replay", "warning", finding.text, np.nan) for finding in replay.findings]
    for name, counts in replay.rejected().items():
        events += [(start, name, "rejected", reason, float(count)) for reason, count in counts.items()]
    events += happenings(replay.written.event)
    events += [(row.t_s, "autopilot", row.kind, row.text, row.value) for row in replay.log.happened]
    for t0, t1 in replay.options.gps_outages_s:
        events += [(t0, "gps", "outage_start", "withheld on request", t1 - t0), (t1, "gps", "outage_end", "", np.nan)]
    for sensor in (Sensor.GPS_POSITION, Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY, Sensor.RANGE):
        events += _losses(replay, sensor)
    events.sort(key=lambda event: event[0])
    columns = zip(*events, strict=True)
    return dict(zip(("t_s", "source", "kind", "detail", "value"), map(np.array, columns), strict=True))


def _losses(replay: Replay, sensor: Sensor) -> list[tuple[float, str, str, str, float]]:
    """When nothing of a sensor was fused for long: lost, with how long, and back."""
    offered = replay.offered
    t_s = offered.t_s[(offered.sensor == sensor) & (offered.reason == Reason.FUSED)]
    events = []
    for row in np.flatnonzero(np.diff(t_s) > LOST_AFTER_S):
        length = float(t_s[row + 1] - t_s[row])
        events.append((float(t_s[row]), sensor.name.lower(), "lost", "nothing fused for this long [s]", length))
        events.append((float(t_s[row + 1]), sensor.name.lower(), "back", "", np.nan))
    return events


def with_attitude(log: Log, axes: Array | None = None) -> tuple[Log, str]:
    """The log with an attitude, and a note where that is the navigator's own estimate.

    axes (2, 2) of -1, 0, 1: how the flow sensor's lie, sensor = axes @ vehicle, where they are known to lie otherwise.
    InputError where the log has neither an attitude nor what a replay needs to find one.
    """
    if Sensor.ATTITUDE in log.streams:
        return log, ""
    if Sensor.IMU not in log.streams:
        raise InputError(
            f"{log.path}: neither attitude nor IMU; one of them turns the reference into the sensor's axes"
        )
    options = ReplayOptions() if axes is None else ReplayOptions(identified=turned_sensor(log, axes))
    found = replay(log, options, NavigatorSettingsFile()).estimate_rows
    known = np.isfinite(found.quaternion).all(axis=1)
    attitude = Stream.of(Sensor.ATTITUDE, found.t_s[known], found.quaternion[known])
    return replace(log, streams={**log.streams, Sensor.ATTITUDE: attitude}), FOUND


def turned_sensor(log: Log, axes: Array) -> IdentifiedFlow:
    """A sensor of gain 1 whose axes lie so, and whose readings are as old as the log makes them."""
    delays_s = prepare(log, ReplayOptions()).delays_s
    first, second = ((float(row[0]), float(row[1])) for row in axes)
    return IdentifiedFlow(1.0, 1.0, max(delays_s.get(sensor, 0.0) for sensor in FLOW), (first, second))
