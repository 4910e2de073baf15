"""The common look of the documentation's pictures: size, colours, how they are kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

DPI = 110
COLOURS = ("#2563b0", "#d1601f", "#2a8a57", "#8a4fa3", "#6b7280")
STYLE = {
    "axes.prop_cycle": plt.cycler(color=COLOURS), "axes.grid": True, "grid.alpha": 0.25, "axes.spines.top": False,
    "axes.spines.right": False, "font.size": 9, "axes.titlesize": 9, "legend.frameon": False, "lines.linewidth": 1.4,
}  # fmt: skip


class Picture(NamedTuple):
    """A picture of the documentation: its file in docs/pictures, the page that shows it, what it shows, its maker."""

    name: str
    page: str
    shows: str
    draw: Callable[[], Figure]

    @property
    def made_by(self) -> str:
        """The function that draws it, as the gallery names it."""
        return f"tools/docs/{self.draw.__module__}.py, `{self.draw.__name__}`"


def save(picture: Picture, folder: Path) -> Path:
    """Draw a picture and write it as PNG without a date in it; where it lies."""
    with plt.rc_context(STYLE):
        figure = picture.draw()
        path = folder / f"{picture.name}.png"
        figure.savefig(path, dpi=DPI, metadata={"Software": None})
        plt.close(figure)
    return path


def axes(rows: int = 1, columns: int = 1, height: float = 3.0, **options: object) -> tuple[Figure, object]:
    """A figure of the width of a page and its axes."""
    figure, found = plt.subplots(rows, columns, figsize=(7.2, height), layout="constrained", **options)  # type: ignore[arg-type]
    return figure, found
