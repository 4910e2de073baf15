"""Panels and tiles of a page, and numbers as pages write them."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from flownav.core.errors import InputError
from flownav.report.chart import Chart
from flownav.report.style import Drawing, figure

NONE, MINUS = "\N{EN DASH}", "\N{MINUS SIGN}"
MOST = 1e300  # of a number that is written; a larger integer may be none that a float holds


def plotly() -> Any:
    """Plotly's graph objects. InputError where the package is not installed."""
    try:
        import plotly.graph_objects
    except ImportError:
        raise InputError("plots in Python need the package plotly: pip install 'flownav[plots]'") from None
    return plotly.graph_objects


@dataclass(frozen=True)
class Part:
    """A part of a large figure: its name, its value as text, its length as a share of the longest part."""

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
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < MOST:
        return NONE
    return f"{value:z.{digits}f}".replace("-", MINUS)


def metres(value: Any) -> str:
    """A length with as many decimals as it deserves."""
    size = abs(value) if isinstance(value, (int, float)) else 0.0
    return number(value, 3 if size < 1 else 2 if size < 100 else 0)


@dataclass(frozen=True)
class Still:
    """A picture that stands in the page as it is, in its colours (SVG)."""

    svg: str


@dataclass(frozen=True)
class Panel:
    """One figure of a page, or in `absent` the words that say why it is not there.

    caption: what to look for (shown); alt: what is drawn (for screen readers); drawing: a chart over time, a
    picture that stands still, or what Plotly's script draws where it is something else.
    """

    key: str
    title: str
    caption: str = ""
    alt: str = ""
    drawing: Any = None
    absent: str = ""
    wide: bool = False

    @property
    def still(self) -> Any:
        """A still drawing, marked as safe for the page; None of other drawings."""
        from markupsafe import Markup

        return Markup(self.drawing.svg) if isinstance(self.drawing, Still) else None

    @cached_property
    def drawn(self) -> Drawing | None:
        """A drawing for Plotly's script; a chart is turned into one. None of any other drawing, and of none."""
        if isinstance(self.drawing, Chart):
            return figure(self.drawing)
        return self.drawing if isinstance(self.drawing, Drawing) else None

    @property
    def figure(self) -> Any:
        """The same as a figure of Plotly's Python package, for who goes on with it. InputError without the package."""
        return None if self.drawn is None else plotly().Figure(self.drawn._asdict())


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
