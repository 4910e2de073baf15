"""Panels and tiles of a page, and numbers as pages write them."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from flownav.report.chart import Chart
from flownav.report.style import figure

NONE, MINUS = "\N{EN DASH}", "\N{MINUS SIGN}"


@dataclass(frozen=True)
class Part:
    """What a large figure is made of: its name, its value as text, its length as a share of the longest part."""

    name: str
    value: str
    share: float


@dataclass(frozen=True)
class Tile:
    """A large figure of the headline."""

    label: str
    value: str
    unit: str = ""
    note: str = ""
    parts: tuple[Part, ...] = ()


def number(value: Any, digits: int = 4) -> str:
    """A number with a true minus sign and fixed decimals; a dash where there is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return NONE
    return f"{value:z.{digits}f}".replace("-", MINUS)


def metres(value: Any) -> str:
    """A length with as many decimals as it deserves."""
    size = abs(value) if isinstance(value, (int, float)) else 0.0
    return number(value, 3 if size < 1 else 2 if size < 100 else 0)


@dataclass(frozen=True)
class Panel:
    """One figure of a page, or in `absent` the words that say why it is not there.

    caption: what to look for (shown); alt: what is drawn (for screen readers); drawing: a chart over time, or a
    Plotly figure where it is something else.
    """

    key: str
    title: str
    caption: str = ""
    alt: str = ""
    drawing: Any = None
    absent: str = ""
    wide: bool = False

    @cached_property
    def figure(self) -> Any:
        """What is drawn, as a Plotly figure; a chart is turned into one, any other drawing is given as it is."""
        return figure(self.drawing) if isinstance(self.drawing, Chart) else self.drawing


@dataclass(frozen=True)
class Section:
    """A heading and its panels."""

    key: str
    title: str
    panels: tuple[Panel, ...]


def listed(names: Iterable[str]) -> str:
    """Names as a sentence has them: "a, b and c"."""
    names = list(names)
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else "nothing"
