"""An MCAP file that `flownav export --to mcap` wrote: the record's own tables again, and its manifest.

A flown or live record's navigator is fed again exactly as it was; of a replayed log the streams are read.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import COLUMNS, Sensor, Stream
from flownav.core.provenance import hash_of
from flownav.core.record import Record, Table
from flownav.logs.absences import absences_of
from flownav.logs.live_record import KINDS, log_of_record
from flownav.logs.log import SIMULATOR, TRUTH_FILE, Log
from flownav.logs.plausible import check_times, check_values
from flownav.logs.ros.bag import MCAP_MAGIC, Bag, Channel
from flownav.logs.ros.containers import messages

LIBRARY = b"flownav "
TITLE = "flownav."
HEAD_BYTES = 256
MOST_COLUMNS = 256


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
        raise InputError(f"--flow-instance: {path} is a record of flownav's, of one flow sensor; leave it out")
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
    record = Record(_manifest(bag))
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
        path, streams, _origin(stated), _path(record, "truth"), {path.name: hash_of(path)},
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


def _manifest(bag: Bag) -> dict[str, Any]:
    found = _row(bag.attachments.get("manifest.json", b"{}"))
    return found or {}


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


def _origin(stated: Any) -> tuple[float, float, float] | None:
    if not isinstance(stated, list) or len(stated) != 3 or not all(np.isfinite(_number(each)) for each in stated):
        return None
    latitude, longitude, altitude = map(float, stated)
    return (latitude, longitude, altitude) if abs(latitude) <= 90.0 and abs(longitude) <= 360.0 else None
