"""How much better or worse one estimate is than another over the same stretch of time, with an interval.

Errors of a filter are alike from one instant to the next, so that the instants of a flight are no independent samples.
The stretch is cut into BATCHES of equal length and the mean difference of each is taken as one sample (the method of
batch means; Law, Simulation Modeling and Analysis, 5th edition, section 9.5.3): the interval is Student's t of these.
It says what this flight would show again under the same conditions, not what other flights would.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BATCHES = 20
LEAST_ROWS = 5  # of a batch: with fewer in any the difference has no interval
CONFIDENCE = 0.95


class Difference(NamedTuple):
    """Mean of the second less the first, and the ends of its interval; NaN where there is no interval."""

    mean: float
    low: float
    high: float


def mean_difference(t_s: Array, first: Array, second: Array, confidence: float = CONFIDENCE) -> Difference | None:
    """Of two series (n,) at the same instants; None where they share no instant at which both are numbers."""
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
