"""Requirements for tests, flown by the paper's filter (hundreds of flights a second), and flights made of numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from flownav.campaigns.engines import Part
from flownav.campaigns.measures import ROW_COLUMNS
from flownav.campaigns.plan import Ready

HEAD = 'schema_version = 1\nname = "small"\nscenario = "landing"\n[set.filter]\nname = "paper"\n'
WINDY = "[set.wind]\ngusts = true\n[conditions]\nwind.speed_20ft_m_s = [0, 8]\nwind.from_direction_deg = [0, 360]\n"
ASKED = '[[requirement]]\nmeasure = "touchdown.horizontal_m"\nat_most = 0.5\nprobability = 0.9\n'


def write(folder: Path, text: str = HEAD + WINDY + ASKED, name: str = "small.toml") -> str:
    """A requirement's file; its path."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


def rows_touching(distance_m: np.ndarray, crashed: np.ndarray | None = None) -> np.ndarray:
    """Rows of flights that touch and rest so far east of the pad, (flights, len(ROW_COLUMNS))."""
    rows = np.zeros((len(distance_m), len(ROW_COLUMNS)))
    rows[:, ROW_COLUMNS.index("touchdown.expected")] = 1.0
    for end in ("contact", "rest"):
        for name in ("east_m", "distance_m"):
            rows[:, ROW_COLUMNS.index(f"touchdown.{end}.{name}")] = distance_m
    if crashed is not None:
        rows[:, ROW_COLUMNS.index("touchdown.broken")] = 2.0 * crashed
    return rows


class StandIn:
    """An engine whose flights are numbers: outcome(cell, seed, first, flights), how far off the pad each touches."""

    piece = 256

    def __init__(self, outcome: Callable[[Ready, int, int, int], np.ndarray]) -> None:
        self.outcome, self.flown = outcome, 0

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object] = lambda flown: None
    ) -> Iterator[tuple[Part, np.ndarray]]:
        """As an engine does."""
        for part in parts:
            self.flown += part.flights
            on_progress(part.flights)
            yield part, rows_touching(self.outcome(cell, seed, part.first, part.flights))
