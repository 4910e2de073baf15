"""Notes the keys of the files' schemas as published, `make schemas`: a test holds that none of them is taken back.

tests/schemas/published_keys.json has one line a key: what it may be, its range, and whether a file must have it.
New keys are added; one that is gone, or takes less than it took, stops this with one line a key, for its schema then
needs a new number.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from flownav.cli.schemas import MODELS, schema_of

PUBLISHED = Path(__file__).resolve().parents[1] / "tests" / "schemas" / "published_keys.json"
INFINITE = float("inf")
LINE = re.compile(r"(.*?)(?: from (\S+) to (\S+))?( required)?")  # types, range, must it be there
PROVENANCE = {"value", "uncertainty", "source"}  # of a number written as a table


class Key(NamedTuple):
    """A key that a file may have: types, range (of numbers), and whether the key must be there."""

    types: list[str]
    low: float
    high: float
    required: bool


def keys_of(schema: dict[str, Any]) -> dict[str, Key]:
    """The keys of a schema by their dotted path; those of a list's tables behind `[]`, of a free name behind `*`."""
    found: dict[str, Key] = {}
    for path, node, required in _inside("", schema, schema.get("$defs", {}), ()):
        choices = list(_choices(node, schema.get("$defs", {})))
        types = {kind for each in choices for kind in _types(each)}
        numbers = [each for each in choices if {"number", "integer"} & set(_types(each))]
        low = min((_bound(each, "inimum", -INFINITE) for each in numbers), default=-INFINITE)
        high = max((_bound(each, "aximum", INFINITE) for each in numbers), default=INFINITE)
        known = found.get(path, Key([], low, high, required))
        found[path] = Key(sorted({*known.types, *types}), min(known.low, low), max(known.high, high),
                          known.required and required)  # fmt: skip
    return found


def broken(published: dict[str, Key], now: dict[str, Key]) -> Iterator[str]:
    """One line for each published key that a file could have and may no longer, or now must have."""
    for path, was in published.items():
        if path not in now:
            yield f"{path}: is gone"
            continue
        key = now[path]
        if lost := sorted(set(was.types) - set(key.types)):
            yield f"{path}: may no longer be {', '.join(lost)}"
        if key.low > was.low or key.high < was.high:
            yield f"{path}: takes {key.low:g} to {key.high:g}, and took {was.low:g} to {was.high:g}"
        if key.required and not was.required:
            yield f"{path}: must be there now"
    for path in sorted(path for path, key in now.items() if key.required and path not in published):
        if _above(path) in published or not _above(path):
            yield f"{path}: is new and must be there"


def read(path: Path = PUBLISHED) -> dict[str, dict[str, Key]]:
    """The published keys by schema."""
    noted = json.loads(path.read_text(encoding="utf-8"))
    return {name: {at: _read(text) for at, text in keys.items()} for name, keys in noted.items()}


def written(keys: dict[str, dict[str, Key]]) -> str:
    """The published keys as the file has them."""
    noted = {name: {at: _written(key) for at, key in sorted(each.items())} for name, each in sorted(keys.items())}
    return json.dumps(noted, indent=1) + "\n"


def _written(key: Key) -> str:
    bounds = "" if (key.low, key.high) == (-INFINITE, INFINITE) else f" from {key.low} to {key.high}"
    return f"{'|'.join(key.types)}{bounds}{' required' if key.required else ''}"


def _read(text: str) -> Key:
    types, low, high, required = LINE.fullmatch(text).groups()  # type: ignore[union-attr]
    return Key(types.split("|"), float(low or -INFINITE), float(high or INFINITE), required is not None)


def _inside(
    path: str, node: dict[str, Any], shared: dict[str, Any], above: tuple[str, ...]
) -> Iterator[tuple[str, dict[str, Any], bool]]:
    """The keys inside a node, and inside those, each with its path. A table inside itself is followed once."""
    for each in _choices(node, shared, above):
        seen = (*above, each["title"]) if "title" in each else above
        if "items" in each:
            yield from _inside(f"{path}[]", each["items"], shared, seen)
        for name, inner in _properties(each):
            at = f"{path}.{name}".removeprefix(".")
            yield at, inner, name in each.get("required", [])
            yield from _inside(at, inner, shared, seen)
        if isinstance(free := each.get("additionalProperties"), dict):
            yield f"{path}.*", free, False
            yield from _inside(f"{path}.*", free, shared, seen)


def _choices(node: dict[str, Any], shared: dict[str, Any], above: tuple[str, ...] = ()) -> Iterator[dict[str, Any]]:
    """The alternatives of a node without references."""
    if "$ref" in node:
        name = node["$ref"].rsplit("/", 1)[1]
        if name not in above:
            yield from _choices(shared[name], shared, above)
    for each in (*node.get("anyOf", ()), *node.get("oneOf", ()), *node.get("allOf", ())):
        yield from _choices(each, shared, above)
    if not {"$ref", "anyOf", "oneOf", "allOf"} & node.keys():
        yield node


def _properties(node: dict[str, Any]) -> Iterable[tuple[str, Any]]:
    """The keys of a table; a number with its provenance has none of its own."""
    found = node.get("properties", {})
    return () if found.keys() == PROVENANCE else found.items()


def _types(node: dict[str, Any]) -> list[str]:
    """The types of a node, and the values of a choice in place of its type."""
    if node.get("properties", {}).keys() == PROVENANCE:
        return ["provenance"]
    if "enum" in node or "const" in node:
        return [f"={value}" for value in node.get("enum", [node.get("const")])]
    kinds = node.get("type", "any")
    return kinds if isinstance(kinds, list) else [kinds]


def _bound(node: dict[str, Any], which: str, otherwise: float) -> float:
    return float(node.get(f"m{which}", node.get(f"exclusiveM{which}", otherwise)))


def _above(path: str) -> str:
    return path.rpartition(".")[0].removesuffix("[]").removesuffix(".*")


def main() -> None:
    """Add what is new. SystemExit with a line for each key that was published and is broken."""
    now = {name: keys_of(schema_of(name)) for name in MODELS}
    before = read() if PUBLISHED.is_file() else {}
    if lines := [f"{name}: {line}" for name in before for line in broken(before[name], now[name])]:
        sys.exit("\n".join(lines))
    PUBLISHED.write_text(written(now), encoding="utf-8")
    print(f"{PUBLISHED.name}: {sum(map(len, now.values()))} keys of {len(now)} schemas")


if __name__ == "__main__":
    main()
