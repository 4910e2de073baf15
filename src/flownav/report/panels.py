"""A panel: one figure with its words, or the words that say why it is not there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from flownav.report.chart import Chart
from flownav.report.plotly_chart import figure


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
