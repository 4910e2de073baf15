"""A flight of a campaign as a row: its place, what became of it, its scores, and the numbers that were drawn for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.arrow import numbers, words
from flownav.campaigns.local import counted_steps, home_epoch, score_history
from flownav.campaigns.measures import ROW_COLUMNS, measured
from flownav.core.record import POSITION_NED
from flownav.scoring.consistency import largest_horizontal_error
from flownav.scoring.errors import SCORE_COLUMNS, touchdown_rows
from flownav.scoring.landings import BROKEN, verdict_of
from flownav.scoring.touchdown import LIMITED_BY, names_of
from flownav.simulation.history import column, columns
from flownav.simulation.plan import Flight

Array = NDArray[np.float64]

INPUT = "input."  # before the name of a dispersed number
SWEPT = "set."  # before the name of what the campaign sweeps


def rows_of(flight: Flight, history: Array) -> Array:
    """The rows of a block's flights, (lanes, len(ROW_COLUMNS)); history (epochs, len(HISTORY), lanes)."""
    return np.column_stack([score_history(flight, history), largest_horizontal_m(flight, history)])


def largest_horizontal_m(flight: Flight, history: Array) -> Array:
    """The largest horizontal error in flight of what each flight was flown on [m], (lanes,).

    It is relative to where the vehicle takes its pad to be, and counted from there on.
    """
    home, epoch = home_epoch(flight), np.arange(len(history))[:, None]
    aloft = (history[:, column("truth", "contact_n")] <= 0.0) & (epoch >= (home or 0))
    counted = counted_steps(flight, history) * aloft
    estimate, truth = history[:, columns("estimate", POSITION_NED)], history[:, columns("truth", POSITION_NED)]
    return largest_horizontal_error(estimate, truth, home, counted)


def limited_by(row: Array) -> str:
    """What limited a flight: what broke it, or the largest part of how far off it touched."""
    landing = touchdown_rows(row[None, : len(SCORE_COLUMNS)])[0]
    if broken := names_of(landing[BROKEN]):
        return ", ".join(broken)
    parts = {name: float(measured(f"touchdown.{name}", row[None, :])[0]) for name in LIMITED_BY}
    if not np.isfinite(list(parts.values())).all():
        return verdict_of(landing)
    return max(parts, key=lambda name: parts[name]).removesuffix("_m")


def table_of(cell: int, values: dict[str, Any], first: int, rows: Array, inputs: Mapping[str, Sequence[float]]) -> Any:
    """The rows of flights from number `first` on as an Arrow table."""
    import pyarrow as pa

    landings = touchdown_rows(rows[:, : len(SCORE_COLUMNS)])
    count = len(rows)
    swept = {
        name: words([value] * count) if isinstance(value, str) else numbers(np.full(count, float(value)))
        for name, value in values.items()
    }
    names = {
        "cell": numbers(np.full(count, cell, np.int32)),
        "flight": numbers(np.arange(first, first + count, dtype=np.int64)),
        **{f"{SWEPT}{name}": column for name, column in swept.items()},
        "verdict": words([verdict_of(row) for row in landings]),
        "limited_by": words([limited_by(row) for row in rows]),
        **{name: numbers(rows[:, i]) for i, name in enumerate(ROW_COLUMNS)},
        **{f"{INPUT}{name}": numbers(np.asarray(drawn, float)) for name, drawn in inputs.items()},
    }
    return pa.table(names)
