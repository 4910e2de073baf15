"""Figures of many flights: percentiles with their intervals, medians with their spread, differences.

Errors of a filter are alike from one instant to the next, so that the instants of a flight are no independent samples.
The stretch is cut into BATCHES of equal length and the mean difference of each is taken as one sample (the method of
batch means; Law, Simulation Modeling and Analysis, 5th edition, section 9.5.3): the interval is Student's t of these.
It holds for this flight flown again under the same conditions, not for other flights.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array


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


# -- one estimate less another, over the same stretch of time ----------------------------------------------------
BATCHES = 20
LEAST_ROWS = 5  # of a batch: with fewer in any the difference has no interval


class Difference(NamedTuple):
    """Mean of the second less the first, and the ends of its interval; NaN where there is no interval."""

    mean: float
    low: float
    high: float


def mean_difference(t_s: Array, first: Array, second: Array, confidence: float = 0.95) -> Difference | None:
    """Mean difference of two series (n,) at the same instants; None where at no instant both are numbers."""
    apart = np.asarray(second, float) - np.asarray(first, float)
    known = np.isfinite(apart) & np.isfinite(t_s)
    t_s, apart = np.asarray(t_s, float)[known], apart[known]
    if not len(apart):
        return None
    mean = float(apart.mean())
    edges = np.linspace(t_s[0], t_s[-1], BATCHES + 1)
    batch = np.clip(np.searchsorted(edges, t_s, side="right") - 1, 0, BATCHES - 1)
    counts = np.bincount(batch, minlength=BATCHES)
    if counts.min() < LEAST_ROWS:
        return Difference(mean, float("nan"), float("nan"))
    means = np.bincount(batch, weights=apart, minlength=BATCHES) / counts
    from scipy.special import stdtrit

    reach = float(stdtrit(BATCHES - 1, 0.5 * (1.0 + confidence)) * means.std(ddof=1) / np.sqrt(BATCHES))
    return Difference(mean, mean - reach, mean + reach)
