"""A record as an MCAP file for Foxglove: poses, a tree of frames, and every table as JSON.

Frames: `enu` (z up, what a 3-D view should be fixed to) > `ned` > `estimate`, `truth`, `autopilot` (body FRD).
Times are nanoseconds of the record's clock.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from heapq import merge
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.guard import written_whole
from flownav.core.record import Record, Table
from flownav.core.version import __version__
from flownav.export.errors import error_table
from flownav.export.mcap_schemas import FRAME_TRANSFORM, POSE_IN_FRAME, Schema, table_schema
from flownav.export.stamps import Stamps, finite_rows, shift_needed_s, stamps
from flownav.export.tables import is_text, manifest_json, texts
from flownav.export.trajectory import ENU_FROM_NED, Trajectory, trajectories

NS = 1_000_000_000
Row = dict[str, Any]


class Channel(NamedTuple):
    """One topic: its schema, and its messages in order of time."""

    topic: str
    schema: Schema
    time_ns: Stamps
    rows: Iterator[Row]


def write_mcap(record: Record, path: Path) -> tuple[list[Path], list[str]]:
    """Write the record as one MCAP file, whole or not at all; the file and notes.

    InputError where the package `mcap` is not installed or the record holds no path.
    """
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise InputError("--to mcap needs the package mcap: pip install 'flownav[mcap]'") from error
    shift_s = shift_needed_s(record)
    paths = trajectories(record)
    channels, notes = [], [note for one in paths for note in one.notes]
    if shift_s:
        notes.append(f"all times are {shift_s:g} s later than in the record: the format has no negative time")
    for one in paths:
        channels += _pose_channels(one, stamps(one.t_s, NS, shift_s))
    channels.append(_earth(channels[0].time_ns[:1]))
    errors = error_table(record, paths)
    for name, table in {**record.tables, **({} if errors is None else {"error": errors})}.items():
        rows = finite_rows(np.asarray(table["t_s"], float))
        if len(rows) < len(table["t_s"]):
            notes.append(f"{name}: rows without a time left out: {len(table['t_s']) - len(rows)}")
        kept = {column: np.asarray(values)[rows] for column, values in table.items()}
        time_ns = stamps(kept["t_s"], NS, shift_s)
        channels.append(Channel(f"/{name}", table_schema(name, kept), time_ns, _rows(kept)))
    with written_whole(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library=f"flownav {__version__}")
        writer.add_attachment(0, 0, "manifest.json", "application/json", manifest_json(record).encode())
        _write(writer, channels)
        writer.finish()
    return [path], notes


def _write(writer: Any, channels: list[Channel]) -> None:
    """All channels' messages in one order of time."""
    schemas: dict[str, int] = {}
    topics: dict[str, int] = {}

    def messages(channel: Channel) -> Iterator[tuple[int, int, Row]]:
        title = channel.schema["title"]
        if title not in schemas:
            schemas[title] = writer.register_schema(title, "jsonschema", json.dumps(channel.schema).encode())
        if channel.topic not in topics:
            topics[channel.topic] = writer.register_channel(channel.topic, "json", schemas[title])
        number = topics[channel.topic]
        return ((time, number, row) for time, row in zip(channel.time_ns.tolist(), channel.rows, strict=True))

    for time, number, row in merge(*map(messages, channels), key=lambda message: message[0]):
        writer.add_message(number, time, json.dumps(row, allow_nan=False).encode(), publish_time=time)


def _pose_channels(path: Trajectory, time_ns: Stamps) -> list[Channel]:
    """A path as poses of its own topic and as transforms of /tf."""

    def poses() -> Iterator[Row]:
        for time, position, rotation in _placed(path, time_ns):
            yield {"timestamp": time, "frame_id": "ned", "pose": {"position": position, "orientation": rotation}}

    def transforms() -> Iterator[Row]:
        for time, position, rotation in _placed(path, time_ns):
            yield _transform(time, "ned", path.name, position, rotation)

    return [
        Channel(f"/{path.name}/pose", POSE_IN_FRAME, time_ns, poses()),
        Channel("/tf", FRAME_TRANSFORM, time_ns, transforms()),
    ]


def _placed(path: Trajectory, time_ns: Stamps) -> Iterator[tuple[Row, Row, Row]]:
    """Time, position and orientation of each pose as Foxglove spells them."""
    rows = zip(time_ns.tolist(), path.position_m.tolist(), path.quaternion.tolist(), strict=True)
    for time, position, (w, x, y, z) in rows:
        yield _time(time), dict(zip("xyz", position, strict=True)), {"x": x, "y": y, "z": z, "w": w}


def _earth(time_ns: Stamps) -> Channel:
    """How NED lies in ENU: once, at the first pose; it holds from then on."""
    rotation = dict(zip("wxyz", map(float, ENU_FROM_NED), strict=True))
    rows = [_transform(_time(int(time)), "enu", "ned", dict.fromkeys("xyz", 0.0), rotation) for time in time_ns]
    return Channel("/tf", FRAME_TRANSFORM, time_ns, iter(rows))


def _transform(time: Row, parent: str, child: str, translation: Row, rotation: Row) -> Row:
    return {
        "timestamp": time,
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": translation,
        "rotation": rotation,
    }


def _time(time_ns: int) -> Row:
    return {"sec": time_ns // NS, "nsec": time_ns % NS}


def _rows(table: Table) -> Iterator[Row]:
    """A table's rows as JSON objects without the values that JSON cannot say: those not finite, and texts not there."""
    columns = [texts(values) if is_text(values) else values.tolist() for values in table.values()]
    for row in zip(*columns, strict=True):
        yield {name: value for name, value in zip(table, row, strict=True) if _can_be_said(value)}


def _can_be_said(value: Any) -> bool:
    return value is not None and not (isinstance(value, float) and not math.isfinite(value))
