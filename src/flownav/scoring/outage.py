"""Errors of a replay against the log's own GPS: through an outage, and of the velocity.

The outage error is defined once, here: horizontal position of the estimate minus the GPS position, taken at the
instant that the GPS sample describes (its time less the GPS delay), less its mean over the first five GPS
samples of the window; rms and maximum over the window. GPS noise puts a floor under it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array

ANCHOR_SAMPLES = 5


class OutageError(NamedTuple):
    """Horizontal error over [t0, t1); NaN where the window holds too few GPS samples or no estimate."""

    t0: float
    t1: float
    horizontal_rms_m: float
    horizontal_max_m: float


def outage_error(
    estimate_t_s: Array, estimate_ne_m: Array, gps_t_s: Array, gps_ne_m: Array, delay_s: float, t0: float, t1: float
) -> OutageError:
    """The outage error of one window.

    estimate_t_s (n,), estimate_ne_m (n, 2): the estimate; gps_t_s (m,), gps_ne_m (m, 2): all GPS samples at
    their arrival, withheld or not.
    """
    inside = (gps_t_s >= t0) & (gps_t_s < t1)
    error = difference_at(estimate_t_s, estimate_ne_m, gps_t_s[inside] - delay_s, gps_ne_m[inside])
    if len(error) <= ANCHOR_SAMPLES:
        return OutageError(t0, t1, np.nan, np.nan)
    squares = np.sum((error - error[:ANCHOR_SAMPLES].mean(axis=0)) ** 2, axis=1)
    return OutageError(t0, t1, float(np.sqrt(squares.mean())), float(np.sqrt(squares.max())))


def horizontal_rms(estimate_t_s: Array, estimate: Array, reference_t_s: Array, reference: Array) -> float:
    """Root mean square of the length of estimate minus reference, (n, 2) and (m, 2); NaN without common time."""
    error = difference_at(estimate_t_s, estimate, reference_t_s, reference)
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1)))) if len(error) else float("nan")


def difference_at(estimate_t_s: Array, estimate: Array, reference_t_s: Array, reference: Array) -> Array:
    """Estimate minus reference at the reference's instants that the estimate covers, linear between estimates."""
    if not len(estimate_t_s):
        return np.zeros((0, reference.shape[1]))
    covered = (reference_t_s >= estimate_t_s[0]) & (reference_t_s <= estimate_t_s[-1])
    instants = reference_t_s[covered]
    at_instants = np.column_stack([np.interp(instants, estimate_t_s, column) for column in estimate.T])
    return np.asarray(at_instants - reference[covered])
