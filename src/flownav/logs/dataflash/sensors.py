"""Converts each sensor's messages to streams in the units, frames and signs of `measurement`.

ArduPilot's OF message has PX4's convention already: flowX is the rate about body x with a still scene,
flow_x = w_x - v_y / r, flow_y = w_y + v_x / r, bodyX and bodyY the gyro's rates over the same time
(a simulated flight's truth confirms it: tests/logs/test_dataflash_flight.py).
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion, to_body
from flownav.core.measurement import Array, Sensor, Stream
from flownav.logs.assembly import Origin, local_ned, near_the_rest
from flownav.logs.csv_table import CsvTable
from flownav.logs.dataflash.columns import DataFlash, Field, check_rows, lacking, message_rows
from flownav.logs.log import attitude_at

GYRO_LIMIT_RAD_S = 70.0  # twice the range of a 2000 deg/s gyro
RANGE_GOOD, FACING_DOWN = 4, 25  # RangeFinder::Status::Good, ROTATION_PITCH_270
LEAST_FIX = 3  # GPS_OK_FIX_3D
LANDED_BY_EVENT = {11: 1.0, 18: 1.0, 28: 0.0}  # disarmed, land complete, not landed (AP_Logger's LogEvent)
GAUSS_PER_MILLIGAUSS = 1e-3
TIMELESS = ("EV",)  # without a time before 2015: that of the message before is near enough

# of several sensors the one with the most rows of this kind: a GPS in use, flow with data, range downward
PREFERRED: dict[str, tuple[str, Callable[[NDArray[Any]], NDArray[np.bool_]]]] = {
    "GPS": ("U", lambda used: used == 1),
    "OF": ("Qual", lambda quality: quality > 0),
    "RFND": ("Orient", lambda orientation: orientation == FACING_DOWN),
}

FIELDS: dict[str, tuple[Field, ...]] = {
    "ATT": (Field("Roll", -181, 181), Field("Pitch", -91, 91), Field("Yaw", -361, 361)),
    "IMU": (
        *(Field(f"Gyr{axis}", -GYRO_LIMIT_RAD_S, GYRO_LIMIT_RAD_S) for axis in "XYZ"),
        *(Field(f"Acc{axis}", -400, 400) for axis in "XYZ"),
        *(Field(label, 0, 255, required=False) for label in ("GH", "AH")),
    ),
    "GPS": (
        *(Field("Status", 0, 8), Field("Lat", -90, 90), Field("Lng", -180, 180), Field("Alt", -1000, 20000)),
        *(Field("Spd", 0, 150, may_be_nan=True), Field("GCrs", -361, 361, may_be_nan=True)),
        *(Field("VZ", -150, 150, may_be_nan=True), Field("U", 0, 1, required=False)),
    ),
    "GPA": (
        *(Field(label, 0, 1e4, may_be_nan=True) for label in ("HAcc", "VAcc", "SAcc")),
        Field("VV", 0, 1, required=False),
    ),
    "OF": (
        Field("Qual", 0, 255),
        *(Field(f"flow{axis}", -GYRO_LIMIT_RAD_S, GYRO_LIMIT_RAD_S) for axis in "XY"),
        *(Field(f"body{axis}", -GYRO_LIMIT_RAD_S, GYRO_LIMIT_RAD_S, may_be_nan=True) for axis in "XY"),
    ),
    "RFND": (
        Field("Dist", -1, 1000, older="Dist1"),
        *(Field(label, 0, 255, required=False, older=older) for label, older in (("Stat", ""), ("Orient", "Orient1"))),
    ),
    "BARO": (Field("Alt", -1000, 20000), Field("Health", 0, 255, required=False)),
    "MAG": (
        *(Field(f"Mag{axis}", -20, 20, factor=GAUSS_PER_MILLIGAUSS) for axis in "XYZ"),
        Field("Health", 0, 255, required=False),
    ),
    "EV": (Field("Id", 0, 255),),
    "PL": (
        *(Field("TAcq", 0, 1), Field("LastMeasMS", 0, 2**32)),
        *(Field(f"m{axis}", -1000, 1000) for axis in "XYZ"),
    ),
}


def sensor_rows(log: DataFlash, flow_instance: int | None, notes: list[str]) -> dict[str, CsvTable]:
    """Good rows of every sensor that the log has, of one instance each, with a note where there are several."""
    tables = {}
    for name, fields in FIELDS.items():
        instance = _chosen(log, name, flow_instance)
        table = message_rows(log, name, fields, instance, timeless=name in TIMELESS)
        if table is None:
            if log.count(name):
                notes.append(f"{name} lacks {lacking(log, name, fields)}")
            continue
        others = [other for other in log.instances(name) if other != instance]
        if others:
            notes.append(f"{name}: instance {instance} is read; {', '.join(map(str, others))} also there")
        _keep_healthy(name, table)
        check_rows(table, fields)
        if len(table.t_s):
            tables[name] = table
        else:
            reasons = ", ".join(f"{count} {reason}" for reason, count in table.rejected.items())
            notes.append(f"{name}: no usable row ({reasons})")
    return tables


def _chosen(log: DataFlash, name: str, flow_instance: int | None) -> int | None:
    """The instance to read: the flow sensor asked for, or by what PREFERRED counts; else the first.

    InputError where the flow sensor asked for is not there.
    """
    there = log.instances(name)
    if name == "OF" and flow_instance is not None:
        if flow_instance not in (there or [0]) or not log.count("OF"):
            listed = ", ".join(map(str, there or [0])) if log.count("OF") else "none"
            raise InputError(f"{log.path}: no flow sensor {flow_instance}; the log has {listed}")
        return flow_instance if there else None
    if len(there) < 2:
        return there[0] if there else None
    if name == "GPA" and log.count("GPS"):
        return _chosen(log, "GPS", None)
    label, wanted = PREFERRED.get(name, ("", np.isfinite))
    if label not in log.formats[name].numbers:
        return there[0]
    says = {each: np.count_nonzero(wanted(log.table(name, [label], instance=each)[label])) for each in there}
    return max(there, key=lambda each: (says[each], -each))


def _keep_healthy(name: str, table: CsvTable) -> None:
    """Leave out what the vehicle itself calls bad."""
    for label in ("GH", "AH", "Health"):
        if label in table.columns:
            table.keep(table.columns[label] > 0, "invalid")
    if name == "RFND" and "Orient" in table.columns:
        table.keep(table.columns["Orient"] == FACING_DOWN, "not_downward")
    if name == "RFND" and "Stat" in table.columns:
        table.keep(table.columns["Stat"] == RANGE_GOOD, "invalid")
    if name == "GPS":
        table.keep(table.columns["Status"] >= LEAST_FIX, "no_fix")
        if len(table.t_s):
            table.keep(near_the_rest(table.columns["Lat"], table.columns["Lng"]), "out_of_range")
    if name == "EV":
        table.keep(np.isin(table.columns["Id"], list(LANDED_BY_EVENT)), "another_event")
    if name == "PL":
        table.keep(table.columns["TAcq"] > 0, "no_target")


def attitude(table: CsvTable) -> Stream:
    """ATT: Z-Y-X Euler angles [deg]."""
    angles = np.radians(table.matrix("Roll", "Pitch", "Yaw"))
    quaternion = np.column_stack(quaternion_from_euler(*angles.T))
    return Stream.of(Sensor.ATTITUDE, table.t_s, quaternion, rejected=table.rejected)


def gps(table: CsvTable, accuracy: CsvTable | None, origin: Origin, delay_s: float) -> list[Stream]:
    """GPS and, at the same TimeUS, GPA: velocity first, so that a filter that starts at a fix knows how fast."""
    speed, course, down = table.matrix("Spd", "GCrs", "VZ").T
    stated = _at_same_time(table.t_s, accuracy)
    down = np.where(stated[:, 3] == 0, np.nan, down)  # a receiver without a vertical velocity
    velocity = np.column_stack([speed * np.cos(np.radians(course)), speed * np.sin(np.radians(course)), down])
    variance = np.where(stated[:, :3] > 0, stated[:, :3] ** 2, np.nan)
    position = local_ned(table.matrix("Lat", "Lng", "Alt"), origin)
    return [
        Stream.of(Sensor.GPS_VELOCITY, table.t_s, velocity, variance=variance[:, [2, 2, 2]], delay_s=delay_s,
                  rejected=table.rejected),
        Stream.of(Sensor.GPS_POSITION, table.t_s, position, variance=variance[:, [0, 0, 1]], delay_s=delay_s,
                  rejected=table.rejected),
    ]  # fmt: skip


def _at_same_time(t_s: Array, accuracy: CsvTable | None) -> Array:
    """HAcc, VAcc, SAcc, VV of the rows of one instant, NaN where there are none; shape (n, 4)."""
    if accuracy is None:
        return np.full((len(t_s), 4), np.nan)
    at = np.minimum(np.searchsorted(accuracy.t_s, t_s), len(accuracy.t_s) - 1)
    values = accuracy.matrix("HAcc", "VAcc", "SAcc", "VV")[at]
    return np.where((accuracy.t_s[at] == t_s)[:, None], values, np.nan)


def landed(table: CsvTable, start_s: float) -> Stream:
    """EV: each change, and at the log's start the state that the first change ends."""
    state = np.array([LANDED_BY_EVENT[int(event)] for event in table.columns["Id"]])
    t_s, state = np.append(min(start_s, table.t_s[0]), table.t_s), np.append(1.0 - state[0], state)
    changes = np.append(True, np.diff(state) != 0)
    return Stream.of(Sensor.LANDED, t_s[changes], state[changes, None])


def pad(table: CsvTable, vehicle: Stream, delay_s: float) -> Stream:
    """PL: the target as the precision-landing sensor saw it, from vehicle to target in NED [m], turned into the body.

    A message repeats the last sighting until there is another; only the first of each is a reading.
    """
    fresh = np.append(True, np.diff(table.columns["LastMeasMS"]) != 0)
    table.keep(fresh, "repeated")
    ned = table.matrix("mX", "mY", "mZ")
    rotation = rotation_from_quaternion(*attitude_at(vehicle, table.t_s - delay_s).T)
    forward, right, down = to_body(rotation, *ned.T)
    ahead = np.asarray(down) > 0
    table.keep(ahead, "out_of_range")
    seen = np.column_stack([forward, right, down, np.linalg.norm(ned, axis=1)])[ahead]
    value = np.column_stack([seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2], seen[:, 3]])
    return Stream.of(Sensor.PAD, table.t_s, value, delay_s=delay_s, rejected=table.rejected)


def rangefinder_instance(log: DataFlash) -> int:
    """The rangefinder that is read, counted from 0."""
    return _chosen(log, "RFND", None) or 0


STREAMS: dict[str, Callable[[CsvTable], Stream]] = {
    "ATT": attitude,
    # rad/s and m/s2, body FRD
    "IMU": lambda table: table.stream(Sensor.IMU, "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"),
    # mean angular rates since the last reading, and the gyro's [rad/s]
    "OF": lambda table: table.stream(Sensor.FLOW_RATE, "flowX", "flowY", "bodyX", "bodyY", quality="Qual"),
    "RFND": lambda table: table.stream(Sensor.RANGE, "Dist"),
    "BARO": lambda table: table.stream(Sensor.BARO, "Alt"),  # height above where it was started
    "MAG": lambda table: table.stream(
        Sensor.MAG, "MagX", "MagY", "MagZ"
    ),  # the vehicle's offsets are taken off [gauss]
}
