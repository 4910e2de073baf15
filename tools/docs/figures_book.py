"""docs/figures.json: the figures that pages name, each with its unit and the run that printed it.

`runs` has the commands: what was typed, on which commit of the code, when, on how many cores, which files its figures
depend on, and the page that it writes as a whole, if it writes one. `figures` has values, by the names that pages use.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

BOOK = Path(__file__).parents[2] / "docs" / "figures.json"
FORMS = ("", "interval", "bare", "size")


@dataclass(frozen=True)
class Run:
    """A command as typed, the commit of the code that it ran on, and what its figures depend on.

    `page` is the page of docs/ that it writes, None where it prints figures. `machine` is None where it was not noted.
    """

    command: str
    commit: str
    date: str
    machine: str | None
    depends: tuple[str, ...]
    page: str | None = None


@dataclass(frozen=True)
class Figure:
    """A value with its interval [same unit], the unit, the decimals that pages show, and the name of its run."""

    value: float
    unit: str
    decimals: int
    run: str
    interval: tuple[float, float] | None = None

    def text(self, form: str = "") -> str:
        """`0.740 m`; `interval`: `0.740 m (0.701-0.790)` where there is one; `bare`: `0.740`; `size`: `0.74 m`."""
        value = f"{self.value:.2g}" if form == "size" else f"{self.value:.{self.decimals}f}"
        shown = value if form == "bare" or not self.unit else f"{value} {self.unit}"
        if form == "interval" and self.interval is not None:
            low, high = self.interval
            shown += f" ({low:.{self.decimals}f}-{high:.{self.decimals}f})"
        return shown


@dataclass
class Book:
    """The content of docs/figures.json."""

    runs: dict[str, Run] = field(default_factory=dict)
    figures: dict[str, Figure] = field(default_factory=dict)


def read(path: Path = BOOK) -> Book:
    """The book of a file; empty where there is none."""
    if not path.is_file():
        return Book()
    noted = json.loads(path.read_text(encoding="utf-8"))
    runs = {name: Run(**{**run, "depends": tuple(run["depends"])}) for name, run in noted["runs"].items()}
    return Book(runs, {name: _figure(each) for name, each in noted["figures"].items()})


def write(book: Book, path: Path = BOOK) -> None:
    """Write the book, a line for each run and each figure, by name."""
    parts = {"runs": book.runs, "figures": book.figures}
    text = ",\n".join(f'"{part}": {{\n{_lines(held)}\n}}' for part, held in parts.items())
    path.write_text(f"{{\n{text}\n}}\n", encoding="utf-8")


def _lines(held: Mapping[str, Any]) -> str:
    return ",\n".join(f" {json.dumps(name)}: {json.dumps(asdict(each))}" for name, each in sorted(held.items()))


def _figure(noted: dict[str, Any]) -> Figure:
    interval = noted.get("interval")
    return Figure(**{**noted, "interval": None if interval is None else (interval[0], interval[1])})
