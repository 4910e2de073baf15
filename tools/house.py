"""The house as its imports draw it: rooms on floors, and what runs in a circle. `make weigh` prints it.

A room is an entry of `src/flownav`; it stands one floor above the highest room that it imports. Imports inside
functions and those for types count like all others.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

SOURCE = Path(__file__).resolve().parent.parent / "src" / "flownav"


class Arrow(NamedTuple):
    """A module imports another: names as Python has them."""

    importer: str
    imported: str


def modules(source: Path = SOURCE) -> dict[str, Path]:
    """Every module of the package, by its full name."""
    parts = {path: path.relative_to(source.parent).with_suffix("").parts for path in sorted(source.rglob("*.py"))}
    return {".".join(names[:-1] if names[-1] == "__init__" else names): path for path, names in parts.items()}


GENERATED = "calls"  # how loops are called (tools/calls.py): it imports for a type checker alone, and runs nothing


def arrows(source: Path = SOURCE) -> set[Arrow]:
    """Every import of one module of the package by another."""
    known = modules(source)
    return {
        Arrow(module, imported if imported in known else imported.rpartition(".")[0])
        for module, path in known.items()
        for imported in _imported(ast.parse(path.read_text(encoding="utf-8")))
        if imported.split(".")[0] == source.name and module.rpartition(".")[2] != GENERATED
    }


def _imported(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def room(module: str) -> str:
    """The entry of the package that a module lies in; the package itself is its face."""
    return module.split(".")[1] if "." in module else "__init__"


def between_rooms(drawn: set[Arrow]) -> set[Arrow]:
    """The arrows from room to room."""
    pairs = {Arrow(room(arrow.importer), room(arrow.imported)) for arrow in drawn}
    return {arrow for arrow in pairs if arrow.importer != arrow.imported}


def circles(drawn: set[Arrow]) -> list[list[str]]:
    """The groups, of modules or of rooms, that import one another in a circle."""
    names = sorted({name for arrow in drawn for name in arrow})
    places = {name: place for place, name in enumerate(names)}
    pairs = np.array([(places[arrow.importer], places[arrow.imported]) for arrow in drawn if len(set(arrow)) == 2])
    graph = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(names), len(names)))
    count, labels = connected_components(graph, connection="strong")
    groups = ([name for name, label in zip(names, labels, strict=True) if label == group] for group in range(count))
    return [group for group in groups if len(group) > 1]


def floors(rooms: set[Arrow]) -> dict[str, int]:
    """The floor of each room, 1 the ground. graphlib.CycleError where rooms import one another in a circle."""
    below: dict[str, set[str]] = defaultdict(set)
    for arrow in rooms:
        below[arrow.importer].add(arrow.imported)
    found: dict[str, int] = {}
    for name in TopologicalSorter(below).static_order():
        found[name] = 1 + max((found[other] for other in below[name]), default=0)
    return found


def drawing(rooms: set[Arrow]) -> str:
    """The rooms floor by floor, the highest first."""
    placed = floors(rooms)
    return "\n".join(
        f"{floor:2d}  {'  '.join(sorted(name for name, its in placed.items() if its == floor))}"
        for floor in sorted(set(placed.values()), reverse=True)
    )
