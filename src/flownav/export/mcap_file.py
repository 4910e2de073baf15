"""A record as an MCAP file for Foxglove: poses, a tree of frames, every table as JSON; and a layout beside it.

Frames: `enu` (z up, what a 3-D view should be fixed to) > `ned` > `estimate`, `truth`, `autopilot` (body FRD).
Times are nanoseconds of the record's clock. Foxglove recognises a well-known schema by its name; field names as its
message schema reference gives them. `foxglove_layout.json` is the whole layout, as Foxglove exports one; of a record
that lacks something the curves and panels that would stay empty are left out.
"""

import json
import math
from collections.abc import Iterator, Mapping
from heapq import merge
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.errors import InputError, arg
from flownav.core.guard import written_whole
from flownav.core.marks import marked_json
from flownav.core.record import Column, Record, Table
from flownav.core.version import __version__
from flownav.export.trajectory import (
    ENU_FROM_NED,
    Stamps,
    Trajectory,
    error_table,
    finite_rows,
    is_text,
    manifest_json,
    shift_needed_s,
    stamps,
    texts,
    trajectories,
)

Schema = dict[str, Any]

NUMBER: Schema = {"type": "number"}
TEXT: Schema = {"type": "string"}
NS_PER_S = 1_000_000_000
Row = dict[str, Any]
LAYOUT = "foxglove_layout.json"
Node = str | dict[str, Any]


def _object(properties: Mapping[str, Schema], title: str = "") -> Schema:
    named = {"title": title} if title else {}
    return {**named, "type": "object", "properties": dict(properties), "required": list(properties)}


TIME = _object({"sec": {"type": "integer"}, "nsec": {"type": "integer"}}, "time")
VECTOR = _object(dict.fromkeys("xyz", NUMBER))
QUATERNION = _object(dict.fromkeys("xyzw", NUMBER))
POSE_IN_FRAME = _object(
    {"timestamp": TIME, "frame_id": TEXT, "pose": _object({"position": VECTOR, "orientation": QUATERNION})},
    "foxglove.PoseInFrame",
)
TRANSFORM = ("timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation")
FRAME_TRANSFORM = _object(
    dict(zip(TRANSFORM, (TIME, TEXT, TEXT, VECTOR, QUATERNION), strict=True)), "foxglove.FrameTransform"
)
_TYPES = {"f": "number", "i": "integer", "u": "integer", "b": "boolean"}


def table_schema(name: str, table: Mapping[str, Column]) -> Schema:
    """The schema of a table's rows. No column is required: JSON has no NaN, so such a value is left out of its row."""
    properties = {column: {"type": _TYPES.get(values.dtype.kind, "string")} for column, values in table.items()}
    return {"title": f"flownav.{name}", "type": "object", "properties": properties}


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
        raise InputError(f"{arg('to')} mcap needs the package mcap: pip install 'flownav[mcap]'") from error
    shift_s = shift_needed_s(record)
    paths = trajectories(record)
    channels, notes = [], [note for one in paths for note in one.notes]
    if shift_s:
        notes.append(f"all times are {shift_s:g} s later than in the record: the format has no negative time")
    for one in paths:
        channels += _pose_channels(one, stamps(one.t_s, NS_PER_S, shift_s))
    channels.append(_earth(channels[0].time_ns[:1]))
    errors = error_table(record, paths)
    for name, table in {**record.tables, **({} if errors is None else {"error": errors})}.items():
        rows = finite_rows(np.asarray(table["t_s"], float))
        if len(rows) < len(table["t_s"]):
            notes.append(f"{name}: rows without a time left out: {len(table['t_s']) - len(rows)}")
        kept = {column: np.asarray(values)[rows] for column, values in table.items()}
        time_ns = stamps(kept["t_s"], NS_PER_S, shift_s)
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


def _transform(*values: Row | str) -> Row:
    return dict(zip(TRANSFORM, values, strict=True))


def _time(time_ns: int) -> Row:
    return {"sec": time_ns // NS_PER_S, "nsec": time_ns % NS_PER_S}


def _rows(table: Table) -> Iterator[Row]:
    """A table's rows as JSON objects without the values that JSON cannot hold: those not finite, and texts not
    there.
    """

    def is_stated(value: Any) -> bool:
        return value is not None and not (isinstance(value, float) and not math.isfinite(value))

    columns = [texts(values) if is_text(values) else values.tolist() for values in table.values()]
    for row in zip(*columns, strict=True):
        yield {name: value for name, value in zip(table, row, strict=True) if is_stated(value)}


# -- the layout ---------------------------------------------------------------------------------------------
def layout_path(mcap: Path) -> Path:
    """Where the layout lies: beside the MCAP file."""
    return mcap.with_name(f"{mcap.stem}_layout.json")


def write_foxglove(record: Record, path: Path) -> tuple[list[Path], list[str]]:
    """Write the MCAP file and the layout beside it; both files and notes. InputError as of `write_mcap`."""
    written, notes = write_mcap(record, path)
    layout = layout_for(topics_of(path))
    with written_whole(layout_path(path)) as temporary:
        temporary.write_bytes(marked_json(layout))
    return [*written, layout_path(path)], notes


def topics_of(path: Path) -> dict[str, dict[str, Any]]:
    """Topics of an MCAP file with the properties of their JSON schemas."""
    from mcap.reader import make_reader

    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    if summary is None:
        return {}
    schemas = {number: json.loads(schema.data).get("properties", {}) for number, schema in summary.schemas.items()}
    return {channel.topic: schemas.get(channel.schema_id, {}) for channel in summary.channels.values()}


def layout_for(topics: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The layout without the curves of topics and columns that a file lacks."""
    whole: dict[str, Any] = json.loads(files("flownav.export").joinpath(LAYOUT).read_text(encoding="utf-8"))
    kept = {
        name: panel for name, config in whole["configById"].items() if (panel := _panel(config, topics)) is not None
    }
    return whole | {"configById": kept, "layout": _tree(whole["layout"], kept)}


def topic_and_field(value: str) -> tuple[str, str]:
    """Topic and column of a message path: /innovation{sensor=="range"}.innovation, /error.error_n_m.@negative."""
    topic, _, rest = value.partition("{") if "{" in value else value.partition(".")
    field = rest.rsplit("}.", 1)[-1] if "{" in value else rest
    return topic, field.split(".")[0]


def _panel(config: dict[str, Any], topics: dict[str, dict[str, Any]]) -> dict[str, Any] | None:
    """A panel with what the file has; None where nothing is left."""
    if "paths" in config:
        named = [(each, *topic_and_field(each["value"])) for each in config["paths"]]
        paths = [each for each, topic, field in named if field in topics.get(topic, {})]
        return config | {"paths": paths} if paths else None
    if "topicPath" in config:
        return config if config["topicPath"] in topics else None
    if "topics" in config:
        return config | {"topics": {name: how for name, how in config["topics"].items() if name in topics}}
    return config


def _tree(node: Node, kept: dict[str, Any]) -> Node | None:
    """The arrangement without the panels that are left out; a side alone takes the whole place."""
    if isinstance(node, str):
        return node if node in kept else None
    first, second = _tree(node["first"], kept), _tree(node["second"], kept)
    if first is None or second is None:
        return first or second
    return node | {"first": first, "second": second}
