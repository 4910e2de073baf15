"""A first-order lag advanced exactly while its input moves in a straight line between two readings.

    tau y' = u - y,   u(t) = u0 + (u1 - u0) t/T

gives y1 = k y0 + (m - k) u0 + (1 - m) u1 with k = exp(-T/tau) and m = (tau/T)(1 - k): a ramp is late by exactly tau,
whatever the period. With tau = 0 the output is the input.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flownav.core.compile import equation


class Lag(NamedTuple):
    """Weights of the output and the input one reading ago and of the input now; they sum to one."""

    keep: float
    before: float
    now: float


@equation
def lagged(output: float, input_before: float, input_now: float, keep: float, before: float, now: float) -> float:
    """The output one period on."""
    return keep * output + before * input_before + now * input_now


def lag_weights(tau_s: float, period_s: float) -> Lag:
    """The weights of one period. ValueError where tau < 0 or the period is not positive."""
    if tau_s < 0.0 or period_s <= 0.0:
        raise ValueError(f"a time constant >= 0 and a period > 0 are needed, got {tau_s} s and {period_s} s")
    if tau_s == 0.0:
        return Lag(0.0, 0.0, 1.0)
    keep = math.exp(-period_s / tau_s)
    mean = -math.expm1(-period_s / tau_s) * tau_s / period_s
    return Lag(keep, mean - keep, 1.0 - mean)
