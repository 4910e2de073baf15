"""A record's tables as ULog topics, and ULog's messages as bytes.

PX4's ULog file format: header, definitions (flag bits, formats, information), data (subscriptions, data,
logged strings). Little endian; a message is its size (uint16, without this header), its type and its body. A table has
PX4's own name where one fits, `flownav_...` else. Of PX4's topics those fields are written that the record can fill
(ULog describes itself, and readers look fields up by name); frames and units are PX4's, which are ours.
"""

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import heading_from_quaternion
from flownav.core.record import STANDARD_DEVIATIONS as STD
from flownav.core.record import Record, Table
from flownav.export.trajectory import Stamps, Trajectory, finite_rows, is_text, stamps

MAGIC = b"ULog\x01\x12\x35"
HEADER_SIZE = 16
SYNC = b"\x08\x00S\x2f\x73\x13\x20\x25\x0c\xbb\x12"
KNOWN = frozenset(b"BFIMPQARDLCSO")
LARGEST_UINT16 = 0xFFFF
_TYPES = {"float": "<f4", "double": "<f8", "uint64_t": "<u8", "uint32_t": "<u4", "uint8_t": "u1", "int8_t": "i1"}
_TYPES["bool"] = "u1"
US_PER_S = 1e6
NUMBERS = ("observation", "observation_variance", "innovation", "innovation_variance", "test_ratio")
DOWNWARD_ROTATION = 25  # MAV_SENSOR_ROTATION_PITCH_270
Array = NDArray[Any]


class Field(NamedTuple):
    """One field of a topic: its ULog type, its name and its values, (n,) or, as an array field, (n, k)."""

    kind: str
    name: str
    values: NDArray[Any]


class Topic(NamedTuple):
    """A topic's messages: times [microseconds] in ascending order, and fields of as many rows each."""

    name: str
    time_us: Stamps
    fields: list[Field]


class Stamped(NamedTuple):
    """A message of the data section and the time [microseconds] that it is put in order by."""

    time_us: int
    body: bytes


class Found(NamedTuple):
    """A message of a log: its type, and where it begins (its own header) and ends."""

    kind: int
    begin: int
    end: int


def message(kind: str, body: bytes) -> bytes:
    """A message of a type with its header. ValueError where the body is too long for one."""
    if len(body) > LARGEST_UINT16:
        raise ValueError(f"a ULog message holds {LARGEST_UINT16} bytes, not {len(body)}")
    return struct.pack("<HB", len(body), ord(kind)) + body


def header(start_us: int) -> bytes:
    """The file's first 16 bytes and the flag bits, none of them set, that must follow."""
    return MAGIC + struct.pack("<BQ", 1, start_us) + message("B", bytes(40))


def information(name: str, text: str) -> bytes:
    """A text that belongs to the whole log."""
    value = text.encode(errors="backslashreplace")
    key = f"char[{len(value)}] {name}".encode()
    return message("I", bytes([len(key)]) + key + value)


def parameter(name: str, value: float) -> bytes:
    """A setting of the vehicle as it was when the log began; a whole number is written as one."""
    kind, code = ("int32_t", "<i") if float(value).is_integer() and abs(value) < 2**31 else ("float", "<f")
    key = f"{kind} {name}".encode()
    return message("P", bytes([len(key)]) + key + struct.pack(code, int(value) if code == "<i" else value))


def definition(topic: Topic) -> bytes:
    """A topic's format message."""
    fields = ["uint64_t timestamp"]
    for field in topic.fields:
        length = f"[{field.values.shape[1]}]" if field.values.ndim == 2 else ""
        fields.append(f"{field.kind}{length} {field.name}")
    return message("F", (f"{topic.name}:" + "".join(f"{field};" for field in fields)).encode())


def subscription(name: str, number: int) -> bytes:
    """A topic's first instance under its number."""
    return message("A", struct.pack("<BH", 0, number) + name.encode())


def data(topic: Topic, number: int) -> list[Stamped]:
    """A topic's rows as data messages."""
    layout = [("size", "<u2"), ("kind", "u1"), ("number", "<u2"), ("timestamp", "<u8")]
    layout += [(f.name, _TYPES[f.kind], f.values.shape[1:]) for f in topic.fields]  # type: ignore[misc]
    rows = np.zeros(len(topic.time_us), np.dtype(layout))
    size = rows.dtype.itemsize
    rows["size"], rows["kind"], rows["number"], rows["timestamp"] = size - 3, ord("D"), number, topic.time_us
    for field in topic.fields:
        rows[field.name] = field.values
    packed = rows.tobytes()
    return [Stamped(t, packed[k * size : (k + 1) * size]) for k, t in enumerate(topic.time_us.tolist())]


def logged(time_us: int, text: str, level: str = "6") -> Stamped:
    """A logged string; level as the Linux kernel's, "4" a warning, "6" information."""
    return Stamped(
        time_us, message("L", level.encode() + struct.pack("<q", time_us) + text.encode(errors="backslashreplace"))
    )


def assembled(
    topics: Sequence[Topic], strings: Sequence[Stamped], texts: dict[str, str],
    parameters: Mapping[str, float] | None = None,
) -> bytes:  # fmt: skip
    """A log of these topics, logged strings, and texts and parameters of the whole of it, in order of time."""
    rows = [row for number, topic in enumerate(topics) for row in data(topic, number)]
    rows = sorted([*rows, *strings], key=lambda row: row.time_us)
    return b"".join(
        [
            header(rows[0].time_us),
            *(definition(topic) for topic in topics),
            *(information(name, text) for name, text in texts.items() if text),
            *(parameter(name, value) for name, value in (parameters or {}).items()),
            *(subscription(topic.name, number) for number, topic in enumerate(topics)),
            *(row.body for row in rows),
        ]
    )


def walk(log: bytes, begin: int, end: int) -> Iterator[Found]:
    """The messages between two offsets; damage is skipped up to the next synchronisation message, or ends the walk."""
    at = begin
    while at + 3 <= end:
        stop = at + 3 + (log[at] | log[at + 1] << 8)
        if log[at + 2] in KNOWN and stop <= end:
            yield Found(log[at + 2], at, stop)
            at = stop
        else:
            at = log.find(SYNC, at + 1, end)
            if at < 0:
                return


# -- a record's tables --------------------------------------------------------------------------------------
def our_topic(record: Record, path: Trajectory, shift_s: float) -> Topic:
    """A path as `flownav_estimate`, `flownav_truth` or `flownav_autopilot`: NED, q body to earth, body std."""
    table = record.tables[path.name]
    velocity = path.velocity_m_s if path.velocity_m_s is not None else np.full((len(path.t_s), 3), np.nan)
    fields = [Field("double", name, column) for name, column in zip("xyz", path.position_m.T, strict=True)]
    fields += [Field("double", name, column) for name, column in zip(("vx", "vy", "vz"), velocity.T, strict=True)]
    if path.oriented:
        fields.append(Field("double", "q", path.quaternion))
    fields += [Field("double", name, np.asarray(table[name], float)[path.row]) for name in STD if name in table]
    return Topic(f"flownav_{path.name}", stamps(path.t_s, US_PER_S, shift_s), fields)


def position_topic(record: Record, path: Trajectory, name: str, shift_s: float) -> Topic:
    """A path as PX4's VehicleLocalPosition; its velocity is not valid where no attitude was recorded to turn it by."""
    table = record.tables[path.name]
    time_us = stamps(path.t_s, US_PER_S, shift_s)
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
    time_us = stamps(path.t_s, US_PER_S, shift_s)
    return Topic(name, time_us, [Field("uint64_t", "timestamp_sample", time_us), Field("float", "q", path.quaternion)])


def table_topic(name: str, table: Table, shift_s: float) -> Topic:
    """A measurement table as PX4's topic where there is one, else its numbers under their own names."""
    rows = finite_rows(np.asarray(table["t_s"], float))
    kept = {key: np.asarray(column)[rows] for key, column in table.items()}
    time_us = stamps(kept["t_s"], US_PER_S, shift_s)
    if name in PX4 and set(PX4_NEEDS[name]) <= kept.keys():
        topic, fields = PX4[name](kept)
        return Topic(topic, time_us, fields)
    numbers = {key: column for key, column in kept.items() if key != "t_s" and not is_text(column)}
    fields = [Field("double", _ulog_name(key), column.astype(float)) for key, column in numbers.items()]
    return Topic(f"flownav_{_ulog_name(name)}", time_us, fields)


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
        topics.append(
            Topic(f"flownav_innovation_{_ulog_name(name)}", stamps(kept["t_s"][of], US_PER_S, shift_s), fields)
        )
    return topics, reasons


def event_strings(table: Table, shift_s: float) -> list[Stamped]:
    """Events as logged strings, warnings at their level."""
    rows = finite_rows(np.asarray(table["t_s"], float))
    times: Stamps = stamps(np.asarray(table["t_s"], float)[rows], US_PER_S, shift_s)
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
        Field("uint8_t", "orientation", np.full(count, DOWNWARD_ROTATION)),
    ]


def _optical_flow(table: Table) -> tuple[str, list[Field]]:
    """Rates times one timespan, the median interval between readings: PX4 states angles over a timespan."""
    intervals = np.diff(table["t_s"])
    span_us = float(np.rint(US_PER_S * np.median(intervals))) if len(intervals) else US_PER_S
    span_s = max(span_us, 1.0) / US_PER_S
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


def _ulog_name(name: str) -> str:
    """A name in the letters that ULog allows."""
    return re.sub(r"[^A-Za-z0-9_]", "_", name)
