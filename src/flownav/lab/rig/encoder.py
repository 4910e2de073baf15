"""The incremental encoder at the pivot: counts, and the angle and rate that are read from them.

A Baumer encoder of 10 000 lines, four counts a line (paper section III.C), is sampled by the dSPACE board at 1 kHz.
Its rate is the slope of a local cubic through 25 ms on either side, fitted afterwards, so that the reference has
no delay of its own; a difference of neighbouring counts would carry 0.16 rad/s of quantisation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LINES_PER_REVOLUTION = 10_000
COUNTS_PER_REVOLUTION = 4 * LINES_PER_REVOLUTION
SAMPLE_S = 1e-3
HALF_WINDOW = 25


def counts_of(angle_rad: Array) -> NDArray[np.int64]:
    """Encoder counts of an angle, 0 at the zero of the angle; a count is passed at its edge."""
    return np.floor(angle_rad / (2.0 * np.pi) * COUNTS_PER_REVOLUTION).astype(np.int64)


def angle_and_rate(counts: NDArray[np.int64]) -> tuple[Array, Array]:
    """Angle [rad] and rate [rad/s] from counts sampled every SAMPLE_S: value and slope of a local cubic.

    The ends are fitted with the windows nearest to them, which assumes a rod at rest there or a longer record.
    """
    angle = (counts + 0.5) * (2.0 * np.pi / COUNTS_PER_REVOLUTION)
    offsets = np.arange(-HALF_WINDOW, HALF_WINDOW + 1)
    basis = np.vander(offsets * SAMPLE_S, 4, increasing=True)
    value_weights, slope_weights = np.linalg.pinv(basis)[:2]
    padded = np.pad(angle, HALF_WINDOW, mode="edge")
    return np.correlate(padded, value_weights, "valid"), np.correlate(padded, slope_weights, "valid")
