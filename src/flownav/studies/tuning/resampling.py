"""The bootstrap over windows: how much a mean over windows would differ had other windows been flown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flownav.core.measurement import Array

DRAWS = 10_000
MEASURED = 20260  # a seed each, so that the same logs give the same answer
JUDGED = 20261
CONFIDENCE = 0.95


def resampled(by_log: Sequence[Array], seed: int) -> Array:
    """Means of drawn windows, (DRAWS, k): of each log's (w, k) or (w,) as many as it has, with replacement.

    Windows are drawn log by log, and logs count alike.
    """
    draw = np.random.default_rng(seed)
    total: Array = np.zeros(())
    for values in by_log:
        columns = values.reshape(len(values), -1)
        weights = draw.multinomial(len(columns), np.full(len(columns), 1.0 / len(columns)), DRAWS) / len(columns)
        total = total + weights @ columns
    return np.asarray(total / len(by_log))


def interval_of(drawn: Array, windows: int) -> tuple[float, float]:
    """CONFIDENCE interval of a mean of so many windows from its draws (DRAWS,): expanded percentiles.

    Plain percentiles of few windows are too near to each other, by what Student's t is wider than the normal and the
    root of n / (n - 1) (Hesterberg, What Teachers Should Know About the Bootstrap, The American Statistician 69, 2015).
    """
    from scipy.special import ndtr, stdtrit

    wider = np.sqrt(windows / (windows - 1.0)) * stdtrit(windows - 1.0, 0.5 * (1.0 + CONFIDENCE))
    low, high = np.percentile(drawn, [100.0 * ndtr(-wider), 100.0 * ndtr(wider)])
    return float(low), float(high)
