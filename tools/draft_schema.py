"""Drafts the schema of a command's JSON object from objects that it printed, to be read and mended by hand.

python tools/draft_schema.py NAME "WHAT THE COMMAND DOES" OBJECT.json [OBJECT.json...]
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flownav.core.schemas import DRAFT

FOLDER = Path(__file__).resolve().parents[1] / "src" / "flownav" / "data" / "schemas"
COUNTS = (
    "seed",
    "flights",
    "flight",
    "count",
    "runs",
    "rows",
    "schema",
    "bytes",
    "crashed",
    "index",
    "offered",
    "fused",
)
# objects whose keys are names of sensors, reasons, figures or files
KEYED = ("rejected", "readings", "consistency", "coverage", "sources", "paper_percentile", "rmse_over_bound", "drawn",
         "error_over_stated", "states", "limits", "vehicle_numbers", "told", "hashes", "inputs", "settings", "heard",
         "verdicts")  # fmt: skip


def kind_of(value: Any) -> str:
    """JSON's name of a value's type."""
    names = {type(None): "null", bool: "boolean", int: "integer", float: "number", str: "string", list: "array"}
    return names.get(type(value), "object")


def joined(values: Sequence[Any], name: str = "") -> dict[str, Any]:
    """The schema that all of these fit; anything but the object itself may be null."""
    kinds = {kind_of(value) for value in values}
    if "integer" in kinds and ("number" in kinds or not name.endswith(COUNTS)):
        kinds = kinds - {"integer"} | {"number"}
    kinds |= {"null"} if name else set()
    found: dict[str, Any] = {"type": sorted(kinds) if len(kinds) > 1 else next(iter(kinds))}
    objects = [value for value in values if isinstance(value, dict)]
    if objects and name in KEYED:
        inner = [each for one in objects for each in one.values()]
        found |= {"additionalProperties": joined(inner, "value")} if inner else {}
    elif objects:
        keys = dict.fromkeys(key for one in objects for key in one)
        found["properties"] = {key: joined([one[key] for one in objects if key in one], key) for key in keys}
    listed = [each for value in values if isinstance(value, list) for each in value]
    return found | ({"items": joined(listed, name.rstrip("s"))} if listed else {})


def draft(name: str, what: str, values: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The schema of a command's object. Keys that every object has are required."""
    body = joined(values)
    body["properties"] = {"schema": {"const": 1}} | {k: v for k, v in body["properties"].items() if k != "schema"}
    body["required"] = [
        "schema",
        *(key for key in body["properties"] if key != "schema" and all(key in v for v in values)),
    ]
    about = {"$schema": DRAFT, "$id": f"urn:flownav:schema:{name}:1", "title": f"flownav {name} --json"}
    return {**about, "description": what, **body}


if __name__ == "__main__":
    name, what, *paths = sys.argv[1:]
    objects = [json.loads(Path(path).read_text(encoding="utf-8")) for path in paths]
    (FOLDER / f"{name}.json").write_text(json.dumps(draft(name, what, objects), indent=1) + "\n", encoding="utf-8")
