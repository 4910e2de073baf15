"""A layout for Foxglove beside the MCAP file: the flight in space, errors, paths, innovations, sensors, events.

`foxglove_layout.json` is the whole of it, as Foxglove exports a layout; of a record that lacks something the curves and
panels that would stay empty are left out.
"""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from flownav.core.guard import written_whole
from flownav.core.record import Record
from flownav.export.mcap_file import write_mcap

LAYOUT = "foxglove_layout.json"
Node = str | dict[str, Any]


def layout_path(mcap: Path) -> Path:
    """Where the layout lies: beside the MCAP file."""
    return mcap.with_name(f"{mcap.stem}_layout.json")


def write_foxglove(record: Record, path: Path) -> tuple[list[Path], list[str]]:
    """Write the MCAP file and the layout beside it; both files and notes. InputError as of `write_mcap`."""
    written, notes = write_mcap(record, path)
    layout = layout_for(topics_of(path))
    with written_whole(layout_path(path)) as temporary:
        temporary.write_text(json.dumps(layout, indent=1) + "\n", encoding="utf-8")
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
        paths = [each for each in config["paths"] if _there(each["value"], topics)]
        return config | {"paths": paths} if paths else None
    if "topicPath" in config:
        return config if config["topicPath"] in topics else None
    if "topics" in config:
        return config | {"topics": {name: how for name, how in config["topics"].items() if name in topics}}
    return config


def _there(value: str, topics: dict[str, dict[str, Any]]) -> bool:
    topic, field = topic_and_field(value)
    return field in topics.get(topic, {})


def _tree(node: Node, kept: dict[str, Any]) -> Node | None:
    """The arrangement without the panels that are left out; a side alone takes the whole place."""
    if isinstance(node, str):
        return node if node in kept else None
    first, second = _tree(node["first"], kept), _tree(node["second"], kept)
    if first is None or second is None:
        return first or second
    return node | {"first": first, "second": second}
