"""Natural frequency and damping of a fitted second-order model, each with its interval."""

from __future__ import annotations

import numpy as np

from flownav.lab.identification.output_error import Fit
from flownav.lab.identification.quantities import Interval


def natural_frequency(fit: Fit) -> Interval | None:
    """sqrt(a_2) [rad/s] of a second-order model."""
    if fit.structure.order != 2:
        return None
    return Interval.of_log(float(np.exp(0.5 * fit.point.log_a[1])), 0.5 * float(np.sqrt(fit.covariance[1, 1])))


def damping(fit: Fit) -> Interval | None:
    """a_1/(2 sqrt(a_2)) of a second-order model."""
    if fit.structure.order != 2:
        return None
    weights = np.array([1.0, -0.5])
    sigma = float(np.sqrt(weights @ fit.covariance[:2, :2] @ weights))
    log_a = fit.point.log_a
    return Interval.of_log(0.5 * float(np.exp(log_a[0] - 0.5 * log_a[1])), sigma)
