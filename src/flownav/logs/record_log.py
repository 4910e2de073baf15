"""A record as a Log, as it is and as `flownav export --to mcap` wrote it.

What the navigator of a live session or of a simulated flight was fed is fed again in the very order, so that a replay
is exact; of a replayed log the streams are read.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.errors import InputError, arg
from flownav.core.measurement import COLUMNS, MAX_VALUES, Array, EventQueue, Sensor, Stream
from flownav.core.provenance import hash_of
from flownav.core.record import FED, FED_FIRST, Record, Table
from flownav.logs.log import SIMULATOR, TRUTH_FILE, FedSegment, Log, absences_of
from flownav.logs.plausible import check_times, check_values
from flownav.logs.ros.bag import MCAP_MAGIC, Bag, Channel
from flownav.logs.ros.containers import messages

LATE = "late"
KINDS = {"live": "a live session", "fly": "a simulated flight"}
LIBRARY = b"flownav "
TITLE = "flownav."
HEAD_BYTES = 256
MOST_COLUMNS = 256


def read_live_record(path: Path, *, flow_instance: int | None = None) -> Log:
    """Read a record that `flownav live --record` or `flownav fly` wrote.

    InputError where it cannot be read, does not hold the input of a navigator, or a flow instance is asked for.
    """
    if flow_instance is not None:
        raise InputError(
            f"{arg('flow_instance')}: {path} holds what a navigator was fed, of one flow sensor; leave it out"
        )
    return log_of_record(path, Record.load(path))


def log_of_record(path: Path, record: Record) -> Log:
    """The log of a record that was read from `path`, in whatever format. InputError as of `read_live_record`."""
    kind = str(record.manifest.get("kind"))
    if kind not in KINDS or "fed" not in record.tables:
        raise InputError(
            f"{path}: a record of kind {kind!r} without the input of a navigator; `flownav live --record` "
            "and `flownav fly` write one that does"
        )
    try:
        fed = _fed_of(record)
        segments = [dict(segment) for segment in record.manifest["segments"]]
        parameters = dict(record.manifest["parameters"])
        if not len(fed):
            raise InputError(f"{path}: its navigator received nothing that it could use")
        _check(fed, len(segments))
        numbers = fed[:, FED.index("segment")].astype(int)
        streams_received = _streams(fed)
        if not streams_received:
            raise InputError(f"{path}: its navigator received nothing that it could use")
        streams = _with_late(streams_received, record.manifest.get("live"))
        parts = tuple(FedSegment(_floats(segments[i]), _queue(fed, numbers == i)) for i in range(len(segments)))
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a whole record of kind {kind!r} ({error}); write it again") from error
    check_times(path, streams)
    check_values(path, streams)
    return Log(
        path, streams, _origin(parameters), record.tables.get("truth"), {path.name: hash_of(path)},
        (f"{KINDS[kind]} of {len(parts)} navigator{'s' * (len(parts) != 1)}: fed again as it was fed",),
        fed=parts, fed_settings=parameters, truth_name=SIMULATOR,
    )  # fmt: skip


def _fed_of(record: Record) -> Array:
    """The rows of FED. Records from before a column was kept have nothing withheld, and every reading arrived."""
    rows = record.matrix("fed", FED_FIRST)
    usual = {"withheld": np.zeros(len(rows)), "arrived": np.ones(len(rows))}
    return np.column_stack([rows, *(record.tables["fed"].get(name, usual[name]) for name in FED[len(FED_FIRST) :])])


def _check(fed: Array, segments: int) -> None:
    """ValueError where a row is none that a navigator was ever fed; it takes them as they stand."""
    allowed = {
        "sensor": np.array([float(sensor) for sensor in Sensor]),
        "segment": np.arange(float(segments)),
        "withheld": np.array([0.0, 1.0]),
        "arrived": np.array([0.0, 1.0]),
    }
    for name, values in allowed.items():
        if not np.isin(fed[:, FED.index(name)], values).all():
            raise ValueError(f"in the table fed, a value of {name} that there is none")
    if not np.isfinite(fed[:, [0, FED.index("arrival_s")]]).all():
        raise ValueError("in the table fed, a reading without a time")


def _floats(equipment: dict[str, Any]) -> dict[str, Any]:
    """JSON writes infinity as a name that Python reads back; whatever wrote it, these are numbers."""
    return {name: value if isinstance(value, bool) else float(value) for name, value in equipment.items()}


def _origin(parameters: dict[str, Any]) -> tuple[float, float, float] | None:
    stated = parameters.get("origin_lat_lon_deg_alt_m")
    return None if stated is None else (float(stated[0]), float(stated[1]), float(stated[2]))


def _queue(fed: Array, rows: Any) -> EventQueue:
    """The rows as the navigator took them; `row` counts what arrived within each sensor's stream."""
    value, variance = FED.index("value_0"), FED.index("variance_0")
    sensor = fed[:, FED.index("sensor")].astype(np.int64)
    place = np.zeros(len(fed), np.int64)
    for kind in np.unique(sensor):
        arrived = np.cumsum(fed[sensor == kind, FED.index("arrived")] > 0.0)
        place[sensor == kind] = np.maximum(arrived - 1, 0)
    part = fed[rows]
    return EventQueue(
        np.ascontiguousarray(part[:, 0]),
        sensor[rows],
        np.ascontiguousarray(part[:, value : value + MAX_VALUES]),
        np.ascontiguousarray(part[:, variance : variance + MAX_VALUES]),
        np.ascontiguousarray(part[:, FED.index("quality")]),
        place[rows],
        np.ascontiguousarray(part[:, FED.index("withheld")]),
        np.ascontiguousarray(part[:, FED.index("arrived")]),
    )


def _streams(fed: Array) -> dict[Sensor, Stream]:
    """Each sensor's readings, for the scores and findings; flow with the two columns that the feeding added."""
    value, variance = FED.index("value_0"), FED.index("variance_0")
    streams = {}
    for sensor in Sensor:
        rows = fed[(fed[:, FED.index("sensor")] == sensor) & (fed[:, FED.index("arrived")] > 0.0)]
        if len(rows):
            width = len(COLUMNS[sensor])
            rows = rows[np.argsort(rows[:, FED.index("arrival_s")], kind="stable")]
            arrival = rows[:, FED.index("arrival_s")]
            streams[sensor] = Stream.of(
                sensor,
                arrival,
                rows[:, value : value + width],
                variance=rows[:, variance : variance + width],
                quality=rows[:, FED.index("quality")],
                delay_s=float(np.median(arrival - rows[:, 0])),
            )
    return streams


def _with_late(streams: dict[Sensor, Stream], facts: Any) -> dict[Sensor, Stream]:
    """Streams with the readings that a live session's horizon left out as late, as rejections, for every sensor."""
    dropped = facts.get("dropped") if isinstance(facts, dict) else None
    for sensor in Sensor:
        late = dropped.get(f"{sensor.name.lower()}: {LATE}") if isinstance(dropped, dict) else None
        if isinstance(late, int) and late > 0:
            none = np.zeros((0, len(COLUMNS[sensor])))
            stream = streams.get(sensor) or Stream.of(sensor, np.zeros(0), none)
            streams[sensor] = replace(stream, rejected={**stream.rejected, LATE: late})
    return streams


# -- exported as MCAP ---------------------------------------------------------------------------------------
def is_ours(path: Path) -> bool:
    """Whether a file is an MCAP that flownav wrote: its header names the library."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError:
        return False
    return head.startswith(MCAP_MAGIC) and LIBRARY in head[:64]


def log_of_export(path: Path, flow_instance: int | None) -> Log:
    """The log of an exported record. InputError where it holds no streams, or a flow instance is asked for."""
    if flow_instance is not None:
        raise InputError(f"{arg('flow_instance')}: {path} is a record of flownav's, of one flow sensor; leave it out")
    bag = Bag()
    rows: dict[str, list[dict[str, Any]]] = {}
    lost = 0
    for message in messages(path, bag, lambda channel: channel.kind.startswith(TITLE)):
        row = _row(message.data)
        lost += row is None
        if row is not None:
            rows.setdefault(message.channel.kind.removeprefix(TITLE), []).append(row)
    columns = {channel.kind.removeprefix(TITLE): _columns_of(channel) for channel in bag.channels}
    tables = {name: _table(found, columns.get(name, {})) for name, found in rows.items()}
    record = Record(_row(bag.attachments.get("manifest.json", b"{}")) or {})
    for name, table in tables.items():
        if "t_s" in table:
            record.add(name, table)
    notes = [*bag.notes, *([f"{lost} messages cannot be decoded"] if lost else [])]
    if str(record.manifest.get("kind")) in KINDS and "fed" in record.tables and not notes:
        return log_of_record(path, record)
    return _of_streams(path, record, notes)


def _of_streams(path: Path, record: Record, notes: list[str]) -> Log:
    delays = record.manifest.get("delays_s")
    streams: dict[Sensor, Stream] = {}
    for sensor in Sensor:
        stream = _stream(sensor, record, delays if isinstance(delays, dict) else {})
        if stream is not None:
            streams[sensor] = stream
    if not streams:
        raise InputError(f"{path}: the exported record holds no stream of a sensor; export a replay's, or give the log")
    check_times(path, streams)
    check_values(path, streams)
    parameters = record.manifest.get("parameters")
    stated = parameters.get("origin_lat_lon_deg_alt_m") if isinstance(parameters, dict) else None
    simulated = record.manifest.get("kind") == "fly"
    return Log(
        path, streams, _stated_origin(stated), _path(record, "truth"), {path.name: hash_of(path)},
        ("a record of flownav's, exported as MCAP", *notes), _path(record, "autopilot"),
        "the autopilot" if "autopilot" in record.tables else "", {}, tuple(absences_of(streams)),
        truth_name=SIMULATOR if simulated else TRUTH_FILE,
    )  # fmt: skip


def _row(data: bytes) -> dict[str, Any] | None:
    try:
        row = json.loads(data)
    except (ValueError, RecursionError):
        return None
    return row if isinstance(row, dict) else None


def _columns_of(channel: Channel) -> dict[str, str]:
    """Names and JSON types of a table's columns; a row lacks those that are NaN."""
    schema = _row(channel.definition.encode()) or {}
    properties = schema.get("properties")
    if not isinstance(properties, dict) or len(properties) > MOST_COLUMNS:
        return {}
    return {str(name): str(kind.get("type")) for name, kind in properties.items() if isinstance(kind, dict)}


def _table(rows: list[dict[str, Any]], columns: dict[str, str]) -> Table:
    return {
        name: np.array([str(row.get(name, "")) for row in rows], object)
        if kind == "string"
        else np.array([_number(row.get(name)) for row in rows])
        for name, kind in columns.items()
    }


def _number(value: Any) -> float:
    return float(value) if isinstance(value, (bool, int, float)) and abs(value) < 1e300 else np.nan


def _stream(sensor: Sensor, record: Record, delays: dict[str, Any]) -> Stream | None:
    name = sensor.name.lower()
    table = record.tables.get(name, {})
    if not {"t_s", *COLUMNS[sensor]} <= table.keys():
        return None
    order = np.argsort(table["t_s"], kind="stable")
    order = order[np.isfinite(np.asarray(table["t_s"], float)[order])]
    if not len(order):
        return None
    quality = np.nan_to_num(np.asarray(table.get("quality", np.full(len(table["t_s"]), 255.0)), float))
    delay = delays.get(name)
    return Stream.of(
        sensor, np.asarray(table["t_s"], float)[order], record.matrix(name, COLUMNS[sensor])[order],
        quality=np.clip(quality[order], 0.0, 255.0),
        delay_s=float(delay) if isinstance(delay, (int, float)) and 0.0 <= delay <= 5.0 else 0.0,
    )  # fmt: skip


def _path(record: Record, name: str) -> Table | None:
    table = record.tables.get(name)
    if table is None or len(table["t_s"]) < 2:
        return None
    t_s = np.asarray(table["t_s"], float)
    order = np.argsort(t_s, kind="stable")
    order = order[np.isfinite(t_s[order])]
    return {column: np.asarray(values)[order] for column, values in table.items()}


def _stated_origin(stated: Any) -> tuple[float, float, float] | None:
    if not isinstance(stated, list) or len(stated) != 3 or not all(np.isfinite(_number(each)) for each in stated):
        return None
    latitude, longitude, altitude = map(float, stated)
    return (latitude, longitude, altitude) if abs(latitude) <= 90.0 and abs(longitude) <= 360.0 else None
