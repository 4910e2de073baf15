"""The flights of a certificate: every cell's, each with a number of its own, so that all are independent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flownav.campaign.judged import largest_horizontal_of
from flownav.campaign.local import score_history
from flownav.campaign.measures import ROW_COLUMNS
from flownav.certification.cells import Cell
from flownav.simulation.engine import fly_blocks
from flownav.simulation.ensemble import Ensemble

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Flown:
    """All flights, one after the other: cell (flights,) and number of each, rows (flights, len(ROW_COLUMNS)).

    inputs: the dispersed numbers of each by name, (flights,); NaN in a cell that does not have one.
    """

    cell: NDArray[np.int64]
    number: NDArray[np.int64]
    rows: Array
    inputs: dict[str, Array]

    def __len__(self) -> int:
        return len(self.rows)


def fly_cells(
    cells: Sequence[Cell], seed: int, flights: int, on_progress: Callable[[int], object] = lambda flown: None
) -> Flown:
    """Fly so many flights, as many in each cell (flights is a multiple of the cells)."""
    each = flights // len(cells)
    names = sorted({name for cell in cells for name in cell.setup.ensemble().entries})
    inputs = {name: np.full(flights, np.nan) for name in names}
    rows = np.empty((flights, len(ROW_COLUMNS)))
    for place, cell in enumerate(cells):
        own, ensemble = slice(place * each, (place + 1) * each), cell.setup.ensemble()
        rows[own] = fly_cell(cell, seed, own.start, each, ensemble, on_progress)
        for name, values in ensemble.values(seed, own.start, each).items():
            inputs[name][own] = values
    return Flown(np.repeat(np.arange(len(cells)), each), np.arange(flights), rows, inputs)


def fly_cell(
    cell: Cell, seed: int, first: int, flights: int, ensemble: Ensemble,
    on_progress: Callable[[int], object] = lambda flown: None,
) -> Array:  # fmt: skip
    """The rows of flights `first` to `first + flights - 1` of one cell, (flights, len(ROW_COLUMNS))."""
    flight, done = cell.flight, 0

    def judge(history: Array) -> Array:
        return np.column_stack([score_history(flight, history), largest_horizontal_of(flight, history)])

    rows = np.empty((flights, len(ROW_COLUMNS)))
    for flown, block in fly_blocks(flight, seed, first, flights, judge, ensemble=ensemble, faults=cell.fault_of(seed)):
        rows[done : done + flown] = block
        done += flown
        on_progress(flown)
    return rows
