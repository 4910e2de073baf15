"""JSON schemas of an MCAP file: Foxglove's well-known poses and transforms, and one a table.

Foxglove recognises a well-known schema by its name; field names as its message schema reference gives them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flownav.core.record import Column

Schema = dict[str, Any]

NUMBER: Schema = {"type": "number"}
TEXT: Schema = {"type": "string"}


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
FRAME_TRANSFORM = _object(
    {
        "timestamp": TIME,
        "parent_frame_id": TEXT,
        "child_frame_id": TEXT,
        "translation": VECTOR,
        "rotation": QUATERNION,
    },
    "foxglove.FrameTransform",
)
_TYPES = {"f": "number", "i": "integer", "u": "integer", "b": "boolean"}


def table_schema(name: str, table: Mapping[str, Column]) -> Schema:
    """The schema of a table's rows. No column is required: JSON has no NaN, so such a value is left out of its row."""
    properties = {column: {"type": _TYPES.get(values.dtype.kind, "string")} for column, values in table.items()}
    return {"title": f"flownav.{name}", "type": "object", "properties": properties}
