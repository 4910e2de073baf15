"""What many flights' figures are: percentiles with their intervals, medians with their spread."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def percentile_with_interval(values: Array, share: float, confidence: float = 0.95) -> tuple[float, float, float]:
    """The smallest value that this share of the values does not exceed, and its confidence interval.

    The interval is between order statistics, whatever the distribution (David and Nagaraja, Order Statistics, 2003,
    section 7.1); infinite where there are too few values for an end. Infinite values count as large ones.
    ValueError without a value.
    """
    from scipy.special import bdtr

    count = len(values)
    if count == 0:
        raise ValueError("no values")
    ordered = np.append(np.sort(values), np.inf)
    tail = 0.5 * (1.0 - confidence)
    below = bdtr(
        np.arange(count, dtype=float), count, share
    )  # probability that at most k values lie below the quantile
    low = int(np.searchsorted(below, tail, side="left"))  # binomial quantiles
    high = int(np.searchsorted(below, 1.0 - tail, side="left"))
    place = max(int(np.ceil(share * count - 1e-9)) - 1, 0)
    return float(ordered[place]), float(ordered[low - 1]) if low else -np.inf, float(ordered[min(high, count)])


def spread(values: Array) -> dict[str, float] | None:
    """Median, 5th and 95th percentile of the values that are numbers; None where none is."""
    values = values[~np.isnan(values)]
    if not len(values):
        return None
    low, median, high = np.percentile(values, [5, 50, 95])
    return {"median": float(median), "p05": float(low), "p95": float(high)}


def share_with_interval(count: int, of: int, confidence: float = 0.95) -> tuple[float, float, float]:
    """A share and its confidence interval after Clopper and Pearson (Biometrika 26, 1934). ValueError of nothing."""
    from scipy.special import betaincinv

    if of == 0:
        raise ValueError("a share of nothing")
    tail = 0.5 * (1.0 - confidence)
    low = float(betaincinv(count, of - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, of - count, 1.0 - tail)) if count < of else 1.0
    return count / of, low, high
