"""A record's tables as ULog topics: PX4's own names where a table fits one, `flownav_...` for the rest.

Of PX4's topics those fields are written that the record can fill (ULog describes itself, and readers look
fields up by name); frames and units are PX4's, which are ours: NED, FRD, metres, radians.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import heading_from_quaternion
from flownav.core.record import POSITION_NED, VELOCITY_BODY, Record, Table
from flownav.export.stamps import Stamps, finite_rows, stamps
from flownav.export.tables import is_text
from flownav.export.trajectory import Trajectory
from flownav.export.ulog_messages import Field, Stamped, Topic, logged

US = 1e6
STD = tuple(f"std_{name}" for name in (*POSITION_NED, *VELOCITY_BODY))
NUMBERS = ("observation", "observation_variance", "innovation", "innovation_variance", "test_ratio")
DOWNWARD = 25  # MAV_SENSOR_ROTATION_PITCH_270
Array = NDArray[Any]


def our_topic(record: Record, path: Trajectory, shift_s: float) -> Topic:
    """A path as `flownav_estimate`, `flownav_truth` or `flownav_autopilot`: NED, q body to earth, body std."""
    table = record.tables[path.name]
    velocity = path.velocity_m_s if path.velocity_m_s is not None else np.full((len(path.t_s), 3), np.nan)
    fields = [Field("double", name, column) for name, column in zip("xyz", path.position_m.T, strict=True)]
    fields += [Field("double", name, column) for name, column in zip(("vx", "vy", "vz"), velocity.T, strict=True)]
    if path.oriented:
        fields.append(Field("double", "q", path.quaternion))
    fields += [Field("double", name, np.asarray(table[name], float)[path.row]) for name in STD if name in table]
    return Topic(f"flownav_{path.name}", stamps(path.t_s, US, shift_s), fields)


def position_topic(record: Record, path: Trajectory, name: str, shift_s: float) -> Topic:
    """A path as PX4's VehicleLocalPosition; its velocity is not valid where no attitude was recorded to turn it by."""
    table = record.tables[path.name]
    time_us = stamps(path.t_s, US, shift_s)
    count = len(time_us)
    velocity = path.velocity_m_s if path.velocity_m_s is not None else np.full((count, 3), np.nan)
    moving = np.isfinite(velocity)
    fields = [
        Field("uint64_t", "timestamp_sample", time_us),
        Field("bool", "xy_valid", np.ones(count)),
        Field("bool", "z_valid", np.ones(count)),
        Field("bool", "v_xy_valid", moving[:, 0] & moving[:, 1]),
        Field("bool", "v_z_valid", moving[:, 2]),
        *(Field("float", axis, path.position_m[:, k]) for k, axis in enumerate("xyz")),
        *(Field("float", f"v{axis}", velocity[:, k]) for k, axis in enumerate("xyz")),
    ]
    if path.oriented:
        w, x, y, z = path.quaternion.T
        fields.append(Field("float", "heading", np.asarray(heading_from_quaternion(w, x, y, z))))
    if set(STD[:3]) <= table.keys():
        north, east, down = (np.asarray(table[name], float)[path.row] for name in STD[:3])
        fields += [Field("float", "eph", np.hypot(north, east)), Field("float", "epv", down)]
    return Topic(name, time_us, fields)


def attitude_topic(path: Trajectory, name: str, shift_s: float) -> Topic:
    """A path as PX4's VehicleAttitude."""
    time_us = stamps(path.t_s, US, shift_s)
    return Topic(name, time_us, [Field("uint64_t", "timestamp_sample", time_us), Field("float", "q", path.quaternion)])


def table_topic(name: str, table: Table, shift_s: float) -> Topic:
    """A measurement table as PX4's topic where there is one, else its numbers under their own names."""
    rows = finite_rows(np.asarray(table["t_s"], float))
    kept = {key: np.asarray(column)[rows] for key, column in table.items()}
    time_us = stamps(kept["t_s"], US, shift_s)
    if name in PX4 and set(PX4_NEEDS[name]) <= kept.keys():
        topic, fields = PX4[name](kept)
        return Topic(topic, time_us, fields)
    numbers = {key: column for key, column in kept.items() if key != "t_s" and not is_text(column)}
    fields = [Field("double", _spelled(key), column.astype(float)) for key, column in numbers.items()]
    return Topic(f"flownav_{_spelled(name)}", time_us, fields)


def innovation_topics(table: Table, shift_s: float) -> tuple[list[Topic], list[str]]:
    """A topic for each sensor and component, and the reasons by the code that `reason` carries in them."""
    rows = finite_rows(np.asarray(table["t_s"], float))
    kept = {key: np.asarray(column)[rows] for key, column in table.items()}
    reasons: list[str] = []
    columns = [Field("double", key, kept[key].astype(float)) for key in NUMBERS if key in kept]
    if "fused" in kept:
        columns.append(Field("bool", "fused", kept["fused"].astype(float) > 0.0))
    if "reason" in kept:
        reasons = sorted({str(reason) for reason in kept["reason"]})
        codes = np.array([reasons.index(str(reason)) for reason in kept["reason"]], np.uint8)
        columns.append(Field("uint8_t", "reason", codes))
    whose = np.array([f"{s}_{c}" for s, c in zip(kept["sensor"], kept["component"], strict=True)], str)
    topics = []
    for name in dict.fromkeys(whose.tolist()):
        of = whose == name
        fields = [column._replace(values=column.values[of]) for column in columns]
        topics.append(Topic(f"flownav_innovation_{_spelled(name)}", stamps(kept["t_s"][of], US, shift_s), fields))
    return topics, reasons


def event_strings(table: Table, shift_s: float) -> list[Stamped]:
    """Events as logged strings, warnings at their level."""
    rows = finite_rows(np.asarray(table["t_s"], float))
    times: Stamps = stamps(np.asarray(table["t_s"], float)[rows], US, shift_s)
    strings = []
    for row, time_us in zip(rows, times.tolist(), strict=True):
        source, kind, detail = (str(table[key][row]) if key in table else "" for key in ("source", "kind", "detail"))
        value = float(table["value"][row]) if "value" in table else np.nan
        words = f"[flownav] {source} {kind}" + (f": {detail}" if detail else "")
        text = words + (f" {value:g}" if np.isfinite(value) else "")
        strings.append(logged(time_us, text, "4" if kind == "warning" else "6"))
    return strings


def _distance_sensor(table: Table) -> tuple[str, list[Field]]:
    quality = np.clip(np.rint(np.nan_to_num(table["quality"]) / 2.55), 0, 100)
    count = len(quality)
    return "distance_sensor", [
        Field("float", "current_distance", table["range_m"]),
        Field("int8_t", "signal_quality", quality),
        Field("uint8_t", "orientation", np.full(count, DOWNWARD)),
    ]


def _optical_flow(table: Table) -> tuple[str, list[Field]]:
    """Rates times one timespan, the median interval between readings: PX4 states angles over a timespan."""
    intervals = np.diff(table["t_s"])
    span_us = float(np.rint(US * np.median(intervals))) if len(intervals) else US
    span_s = max(span_us, 1.0) / US
    flow, gyro = ([table[f"{what}_{axis}_rad_s"] * span_s for axis in "xy"] for what in ("flow", "gyro"))
    count = len(table["t_s"])
    return "vehicle_optical_flow", [
        Field("float", "pixel_flow", np.column_stack(flow)),
        Field("float", "delta_angle", np.column_stack([*gyro, np.full(count, np.nan)])),
        Field("uint32_t", "integration_timespan_us", np.full(count, max(span_us, 1.0))),
        Field("uint8_t", "quality", np.clip(np.nan_to_num(table["quality"]), 0, 255)),
    ]


def _air_data(table: Table) -> tuple[str, list[Field]]:
    return "vehicle_air_data", [Field("float", "baro_alt_meter", table["alt_m"])]


PX4 = {"range": _distance_sensor, "flow_rate": _optical_flow, "baro": _air_data}
PX4_NEEDS = {
    "range": ("range_m", "quality"),
    "flow_rate": ("flow_x_rad_s", "flow_y_rad_s", "gyro_x_rad_s", "gyro_y_rad_s", "quality"),
    "baro": ("alt_m",),
}


def _spelled(name: str) -> str:
    """A name in the letters that ULog allows."""
    return re.sub(r"[^A-Za-z0-9_]", "_", name)
