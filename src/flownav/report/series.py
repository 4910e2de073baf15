"""The data of the figures, taken from a record's tables: interpolation, rotation, moments."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import COLUMNS, Array, Sensor
from flownav.core.record import QUATERNION, Record, mapping
from flownav.scoring import errors
from flownav.scoring.phases import phases_of

Window = tuple[float, float]


ESTIMATES = (("autopilot", "autopilot"), ("smoothed", "smoothed"), ("flown", "autopilot's input"),
             ("estimate", "estimate"), ("truth", "truth"))  # tables and what they are called  # fmt: skip
TRUTHS = ("", "truth.csv", "the simulator")  # references that are one; any other is an estimate itself
LIFT_OFF_KINDS = ("lift-off", "lift_off", "takeoff")
AFTER_REST_S = 2.0
TOUCHDOWN_KINDS = ("touchdown",)


class Moment(NamedTuple):
    """An instant that figures mark: `name` is "lift-off" or "touchdown"."""

    t_s: float
    name: str


class Track(NamedTuple):
    """A vector in time: t_s (n,), value (n, 3); frame and unit are the caller's."""

    t_s: Array
    value: Array

    def within(self, window: Window | None) -> Track:
        """The part inside a window of time [s], or all of it."""
        if window is None:
            return self
        inside = (self.t_s >= window[0]) & (self.t_s <= window[1])
        return Track(self.t_s[inside], self.value[inside])


def has(record: Record, table: str, columns: tuple[str, ...] = ()) -> bool:
    """Whether a table is there, holds a row, and has all the columns."""
    there = record.tables.get(table, {})
    return len(there.get("t_s", ())) > 0 and all(name in there for name in columns)


def track(record: Record, table: str, columns: tuple[str, ...]) -> Track | None:
    """Columns of a table in time; None where the table, a row or a column is missing."""
    if not has(record, table, columns):
        return None
    return Track(np.asarray(record.tables[table]["t_s"], float), record.matrix(table, columns))


def estimates(record: Record, columns: tuple[str, ...]) -> list[tuple[str, str, Track]]:
    """All tables with these states, as (role, name, track), the truth last and so on top."""
    names = dict(ESTIMATES) | {"truth": truth_name(record)}
    found = [(role, name, track(record, role, columns)) for role, name in names.items()]
    return [(role, name, source) for role, name, source in found if source is not None]


def setpoints(record: Record, columns: tuple[str, ...]) -> Track | None:
    """The autopilot's set-points of these states, where it had any; None where it never did."""
    asked = track(record, "setpoint", columns)
    if asked is None:
        return None
    some = np.isfinite(asked.value).any(axis=1)
    return Track(asked.t_s[some], asked.value[some]) if some.any() else None


def truth_name(record: Record) -> str:
    """The name of the record's reference: "truth", or another estimate's name (visual odometry)."""
    stated = str(record.manifest.get("truth_name") or "")
    return "truth" if stated in TRUTHS else stated


def readings(record: Record, sensor: Sensor) -> Track | None:
    """A sensor's valid readings (quality above 0) at the instants they describe: arrival less delay."""
    name = sensor.name.lower()
    all_readings = track(record, name, COLUMNS[sensor])
    if all_readings is None:
        return None
    quality = np.asarray(record.tables[name].get("quality", np.full(len(all_readings.t_s), 255.0)), float)
    valid = (quality > 0) & ~np.isnan(all_readings.value).all(axis=1)
    if not valid.any():
        return None
    return Track(all_readings.t_s[valid] - delay_s(record, name), all_readings.value[valid])


def delay_s(record: Record, sensor_name: str) -> float:
    """The sensor's delay [s] that the record states in manifest["delays_s"]; 0 where it states none."""
    return float(mapping(record.manifest.get("delays_s")).get(sensor_name) or 0.0)


def at(t_s: Array, source: Track) -> Array:
    """A track's columns at other instants by linear interpolation, shape (len(t_s), k); NaN outside its time."""
    columns = [np.interp(t_s, source.t_s, column, left=np.nan, right=np.nan) for column in source.value.T]
    return np.column_stack(columns).astype(float)


def difference(source: Track, reference: Track) -> Track:
    """source minus reference at the source's instants, those inside the reference's time."""
    error = source.value - at(source.t_s, reference)
    known = ~np.isnan(error).all(axis=1)
    return Track(source.t_s[known], error[known])


def flow_readings(record: Record) -> Track | None:
    """The flow sensor's valid readings, be they velocities or angular rates."""
    velocity = readings(record, Sensor.FLOW_VELOCITY)
    return readings(record, Sensor.FLOW_RATE) if velocity is None else velocity


def flow_velocity(record: Record) -> Track | None:
    """Body velocity [m/s] that the flow sensor gave; of a raw flow sensor, its flow less its gyro, times the range.

    PX4 convention: flow_x = w_x - v_y/r, flow_y = w_y + v_x/r. The third column is NaN where there is none.
    """
    velocity = readings(record, Sensor.FLOW_VELOCITY)
    if velocity is not None:
        return velocity
    flow, distance = readings(record, Sensor.FLOW_RATE), readings(record, Sensor.RANGE)
    if flow is None or distance is None:
        return None
    from flownav.core.frames import velocity_from_flow

    range_m = at(flow.t_s, distance)[:, 0]
    flow_x, flow_y, gyro_x, gyro_y = flow.value.T
    body = np.column_stack(
        [*velocity_from_flow(flow_x - gyro_x, flow_y - gyro_y, range_m), np.full(len(range_m), np.nan)]
    )
    known = ~np.isnan(body[:, 0])
    return Track(flow.t_s[known], body[known]) if known.any() else None


def gps_velocity_body(record: Record) -> Track | None:
    """GPS velocity [m/s] turned into the body frame by the estimated attitude."""
    gps, attitude = readings(record, Sensor.GPS_VELOCITY), track(record, "estimate", QUATERNION)
    if gps is None or attitude is None:
        return None
    from flownav.core.frames import rotation_from_quaternion, to_body

    nearest = np.clip(np.searchsorted(attitude.t_s, gps.t_s), 0, len(attitude.t_s) - 1)
    rotation = rotation_from_quaternion(*attitude.value[nearest].T)
    return Track(gps.t_s, np.column_stack(to_body(rotation, *gps.value.T)))


def euler_deg(attitude: Track) -> Array:
    """Roll, pitch, yaw [deg] of a track of quaternions, shape (n, 3)."""
    return errors.euler_deg(*attitude.value.T).T


def first_pad_fix_s(record: Record) -> float | None:
    """When the pad's camera first gave a fix that was fused [s]; None where it never did."""
    return first_fused_s(record, Sensor.PAD)


def first_fused_s(record: Record, sensor: Sensor) -> float | None:
    """When the first reading of a sensor was fused [s]; None where none was."""
    table = record.tables.get("innovation", {})
    if "sensor" not in table or "fused" not in table:
        return None
    fused = _of(table["sensor"], sensor) & (np.asarray(table["fused"], float) > 0.5)
    return float(np.min(np.asarray(table["t_s"], float)[fused])) if fused.any() else None


def _of(named: Any, sensor: Sensor) -> NDArray[np.bool_]:
    """Which rows of a table are of a sensor, by its name or its number."""
    every = np.unique(named)
    return np.isin(named, every[[str(one).lower() in (sensor.name.lower(), str(int(sensor))) for one in every]])


TELLS_NORTH = (
    Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.ATTITUDE, Sensor.MAG, Sensor.POSE, Sensor.YAW,
)  # fmt: skip


def is_north_known(record: Record) -> bool:
    """Whether north on a picture is north on earth: of a simulated flight, or of a log with a sensor that tells it."""
    table = record.tables.get("innovation", {})
    if record.manifest.get("kind") == "fly" or "sensor" not in table:
        return True
    return any(bool(_of(table["sensor"], sensor).any()) for sensor in TELLS_NORTH)


def moments(record: Record) -> list[Moment]:
    """Lift-off and touchdown, in order of time.

    Lift-off is the first time the truth (or else an event) leaves the ground; a bounce after touchdown is
    none. Touchdown is the scored one; where there are no scores, the last one of truth or events.
    """
    scores = mapping(record.manifest.get("scores"))
    found = _ground_contacts(record)
    if "touchdown" in scores:
        found.pop("touchdown", None)
        t_s = mapping(mapping(scores["touchdown"]).get("contact")).get("t_s")
        if isinstance(t_s, (int, float)):
            found["touchdown"] = float(t_s)
    if found.get("lift-off", 0.0) > found.get("touchdown", np.inf):
        del found["lift-off"]
    return sorted(Moment(t_s, name) for name, t_s in found.items())


def _ground_contacts(record: Record) -> dict[str, float]:
    """First lift-off and last touchdown [s] in truth and events."""
    found: dict[str, float] = {}
    if has(record, "truth", ("on_ground",)):
        truth = record.tables["truth"]
        change = np.diff(np.asarray(truth["on_ground"], float) > 0.5)
        rows = np.flatnonzero(change) + 1  # the first row of each new state
        on_ground = np.asarray(truth["on_ground"], float)[rows] > 0.5
        if not on_ground.all():
            found["lift-off"] = float(truth["t_s"][rows[~on_ground][0]])
        if on_ground.any():
            found["touchdown"] = float(truth["t_s"][rows[on_ground][-1]])
    kinds = {kind.lower() for _, _, kind, _, _ in event_rows(record)}
    if not found and not kinds & {*LIFT_OFF_KINDS, *TOUCHDOWN_KINDS}:
        return _contacts_of_phases(record)
    for t_s, _, kind, _, _ in event_rows(record):
        if kind.lower() in LIFT_OFF_KINDS:
            found.setdefault("lift-off", t_s)
        if kind.lower() in TOUCHDOWN_KINDS:
            found.setdefault("touchdown", t_s)
    return found


def _contacts_of_phases(record: Record) -> dict[str, float]:
    """First lift-off and last touchdown [s] as the phases have them, which read the landed signal and the range."""
    phases = phases_of(record)
    lifted = [one.t1 for one, after in pairwise(phases) if one.name == "ground" and after.name != "ground"]
    touched = [one.t0 for one in phases if one.name == "touchdown"]
    return {name: times[k] for name, times, k in (("lift-off", lifted, 0), ("touchdown", touched, -1)) if times}


def event_rows(record: Record) -> list[tuple[float, str, str, str, str]]:
    """Events as (t_s, source, kind, detail, value), each text as the record has it, missing ones empty."""
    table = record.tables.get("events", {})
    t_s = np.asarray(table.get("t_s", ()), float)
    columns = [table.get(name, np.full(len(t_s), "")) for name in ("source", "kind", "detail", "value")]
    return [(float(t), *(_text(cell) for cell in row)) for t, *row in zip(t_s, *columns, strict=True)]  # type: ignore[misc]


def _text(cell: Any) -> str:
    if cell is None or (isinstance(cell, (float, np.floating)) and np.isnan(cell)):
        return ""
    return f"{cell:.4g}" if isinstance(cell, (float, np.floating)) else str(cell)


def start_end_s(record: Record) -> Window:
    """The time span of the axes [s]: the flight, to AFTER_REST_S after a scored landing came to rest."""
    start, end = whole_s(record)
    landing = mapping(mapping(record.manifest.get("scores")).get("touchdown"))
    rest_s = mapping(landing.get("rest")).get("t_s")
    return (start, min(end, rest_s + AFTER_REST_S)) if isinstance(rest_s, float) else (start, end)


def whole_s(record: Record) -> Window:
    """First and last instant [s] of the estimate, or of whatever the record holds; (0, 0) of an empty one."""
    tables = [record.tables["estimate"]] if has(record, "estimate") else list(record.tables.values())
    times = [np.asarray(table["t_s"], float) for table in tables if len(table["t_s"])]
    if not times:
        return (0.0, 0.0)
    return (float(min(t[0] for t in times)), float(max(t[-1] for t in times)))


def scored_outages(record: Record) -> list[Mapping[str, Any]]:
    """The GPS outages of the scores: {"t0", "t1" [s], "horizontal_rms_m", "horizontal_max_m"}."""
    listed = mapping(record.manifest.get("scores")).get("outages") or []
    return [outage for outage in listed if "t0" in mapping(outage) and "t1" in outage]


def rms_m(outage: Mapping[str, Any]) -> float:
    """An outage's rms drift [m]; 0 where it could not be scored."""
    return float(outage.get("horizontal_rms_m") or 0.0)


def outages(record: Record) -> list[Window]:
    """Windows [s] in which this record had no GPS: those of its parameters, or else those of its scores.

    The scores may list more: windows that were each cut in a replay of their own.
    """
    stated = mapping(record.manifest.get("parameters")).get("gps_outages_s")
    if stated is not None:
        return [(float(t0), float(t1)) for t0, t1 in stated]
    return [(float(outage["t0"]), float(outage["t1"])) for outage in scored_outages(record)]


def worst_outage(record: Record) -> Window | None:
    """The window without GPS in this record that has the largest rms drift."""
    drift = {(float(outage["t0"]), float(outage["t1"])): rms_m(outage) for outage in scored_outages(record)}
    return max(outages(record), key=lambda window: drift.get(window, 0.0), default=None)
