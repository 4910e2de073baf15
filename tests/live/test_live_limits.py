"""Limits of the estimate itself: of height and vertical velocity as well as of the level ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.live.answers import fault_of
from flownav.live.options import Limits
from flownav.logs.mavlink.outgoing import Estimate

LIMITS = Limits()


def estimate(pose=(), velocity=(), down_m=0.0):
    """An estimate whose standard deviations are small but for those that are named, by axis."""
    covariance = {"pose": np.diag([0.01] * 6), "velocity": np.diag([0.01] * 6)}
    for name, deviations in (("pose", pose), ("velocity", velocity)):
        for axis, sigma in dict(deviations).items():
            covariance[name][axis, axis] = sigma**2
    still = (0.0, 0.0, 0.0)
    return Estimate(
        1, (0.0, 0.0, down_m), still, (1.0, 0.0, 0.0, 0.0), still, covariance["pose"], covariance["velocity"], 1, 70
    )


@pytest.mark.parametrize(
    ("told", "fault"),
    [
        (estimate(), ""),
        (estimate(pose={2: 0.99 * LIMITS.sigma_down_m}), ""),
        (estimate(pose={2: 1.01 * LIMITS.sigma_down_m}), "uncertain_down"),
        (estimate(pose={1: 1.01 * LIMITS.sigma_m}), "uncertain"),
        (estimate(velocity={2: 0.99 * LIMITS.sigma_m_s}), ""),
        (estimate(velocity={2: 1.01 * LIMITS.sigma_m_s}), "too_fast"),
        (estimate(velocity={0: 1.01 * LIMITS.sigma_m_s}), "too_fast"),
        (estimate(down_m=math.nan), "not_finite"),
        (estimate(pose={2: math.inf}), "not_finite"),
    ],
)
def test_each_axis_has_its_limit(told, fault):
    """Only the level axes had one: 26.7 m down were sent within 2 s."""
    assert fault_of(told, LIMITS) == fault
