"""Samples of a series: which of them to draw, and means over a sliding window."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LINE_POINTS = 3000  # a drawn line has at most so many points
DOT_POINTS = 900  # a cloud of readings so many dots
CROSS_POINTS = 250  # and the exceptional ones so many crosses


def thin(budget: int, *columns: Array) -> NDArray[np.int64]:
    """Rows to draw, at most `budget`: of each stretch those with the smallest and largest value of every column."""
    count = len(columns[0])
    if count <= budget:
        return np.arange(count)
    stretches = (budget - 2) // (2 * len(columns))
    edges = np.linspace(0, count, stretches + 1).astype(int)
    width = int(np.diff(edges).max())
    rows = np.minimum(edges[:-1, None] + np.arange(width), edges[1:, None] - 1)
    kept = [np.array([0, count - 1])]
    for column in columns:
        values = np.asarray(column, float)[rows]
        here = np.arange(stretches)
        kept.append(rows[here, np.where(np.isnan(values), np.inf, values).argmin(axis=1)])
        kept.append(rows[here, np.where(np.isnan(values), -np.inf, values).argmax(axis=1)])
    return np.unique(np.concatenate(kept))


def thin_dots(budget: int, *columns: Array) -> NDArray[np.int64]:
    """Rows of a cloud of dots to draw, at most `budget`: an even sample, and the extremes of each stretch.

    Extremes alone would hollow the cloud out and widen it: they get one part of the budget in twenty.
    """
    count = len(columns[0])
    if count <= budget:
        return np.arange(count)
    extremes = max(budget // 20, 2 + 2 * len(columns))
    sample = np.linspace(0, count - 1, budget - extremes).astype(int)
    return np.unique(np.concatenate([sample, thin(extremes, *columns)]))


def drawn(values: Array) -> NDArray[np.float32]:
    """Values as Plotly's pages carry them: single precision halves their size."""
    with np.errstate(over="ignore"):
        return np.asarray(values, np.float32)


def gap_before(t_s: Array, kept: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether a kept sample follows a pause since the one kept before: half a second, and twenty usual intervals.

    A pause lies between two neighbours of the whole series, so thinning makes none.
    """
    interval = np.diff(t_s, prepend=t_s[:1])
    pauses = np.cumsum(interval > max(0.5, 20.0 * float(np.median(interval)) if len(interval) else 0.0))
    return np.asarray(np.diff(pauses[kept], prepend=pauses[kept[:1]]) > 0)


def sliding_rms(t_s: Array, squares: Array, width_s: float) -> Array:
    """Root of the mean of squares over a window of time centred on each instant."""
    total = np.concatenate([[0.0], np.cumsum(squares)])
    first = np.searchsorted(t_s, t_s - width_s / 2, side="left")
    last = np.searchsorted(t_s, t_s + width_s / 2, side="right")
    return np.asarray(np.sqrt(np.maximum(total[last] - total[first], 0.0) / (last - first)))


def sliding_mean(t_s: Array, values: Array, width_s: float) -> Array:
    """Mean of values (n,) over a window of time centred on each instant; NaN counts for nothing."""
    known = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(known)])
    first = np.searchsorted(t_s, t_s - width_s / 2, side="left")
    last = np.searchsorted(t_s, t_s + width_s / 2, side="right")
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((total[last] - total[first]) / (count[last] - count[first]))
