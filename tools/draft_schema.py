"""Drafts the schema of a command's JSON object from objects that it printed; it is then mended by hand.

python tools/draft_schema.py NAME "WHAT THE COMMAND DOES" OBJECT.json [OBJECT.json...]
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

COMMANDS = Path(__file__).resolve().parents[1] / "src" / "flownav" / "data" / "schemas" / "commands.json"
WIDTH = 120  # columns of a line of it
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


def joined(values: Sequence[Any], name: str = "") -> Any:
    """The schema that all of these fit, as commands.json has it; anything but the object itself may be null."""
    kinds = {kind_of(value) for value in values} - {"null"}
    if "integer" in kinds and ("number" in kinds or not name.endswith(COUNTS)):
        kinds = kinds - {"integer"} | {"number"}
    types = "|".join(sorted(kinds)) + ("?" if name and kinds else "") or "null"
    found: dict[str, Any] = {}
    objects = [value for value in values if isinstance(value, dict)]
    if objects and name in KEYED:
        inner = [each for one in objects for each in one.values()]
        found |= {"additionalProperties": joined(inner, "value")} if inner else {}
    elif objects:
        keys = dict.fromkeys(key for one in objects for key in one)
        found["properties"] = {key: joined([one[key] for one in objects if key in one], key) for key in keys}
    listed = [each for value in values if isinstance(value, list) for each in value]
    found |= {"items": joined(listed, name.rstrip("s"))} if listed else {}
    return {"type": types, **found} if found else types


def draft(name: str, what: str, values: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The schema of a command's object. Keys that every object has are required."""
    body = joined(values)
    keys = [key for key in body["properties"] if key != "schema"]
    body["properties"] = {"schema": {"const": 1}} | {key: body["properties"][key] for key in keys}
    body["required"] = ["schema", *(key for key in keys if all(key in value for value in values))]
    return {"title": f"flownav {name} --json", "description": what, **body}


def dense(node: Any, indent: int = 0, before: int = 0) -> str:
    """JSON whose lines are filled up to WIDTH. `before`: the columns that stand in front of the node."""
    flat = json.dumps(node, ensure_ascii=False)
    if before + len(flat) < WIDTH or not node or not isinstance(node, (dict, list)):
        return flat
    named = node.items() if isinstance(node, dict) else (("", each) for each in node)
    rows: list[str] = []
    for key, value in named:
        head = f"{json.dumps(key)}: " if isinstance(node, dict) else ""
        rows.append(head + dense(value, indent + 1, indent + 1 + len(head)))
    opened, closed = "{}" if isinstance(node, dict) else "[]"
    return f"{opened}\n{_filled(rows, ' ' * (indent + 1))}\n{' ' * indent}{closed}"


def _filled(rows: Sequence[str], margin: str) -> str:
    """Rows one after the other on a line while they fit on it; a row of several lines has lines of its own."""
    lines = [rows[0]]
    for row in rows[1:]:
        if "\n" in lines[-1] + row or len(margin + lines[-1] + row) + 2 >= WIDTH:
            lines.append(row)
        else:
            lines[-1] += f", {row}"
    return ",\n".join(margin + line for line in lines)


if __name__ == "__main__":
    name, what, *paths = sys.argv[1:]
    objects = [json.loads(Path(path).read_text(encoding="utf-8")) for path in paths]
    found = json.loads(COMMANDS.read_text(encoding="utf-8"))
    COMMANDS.write_text(dense(found | {name: draft(name, what, objects)}) + "\n", encoding="utf-8")
