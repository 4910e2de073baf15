"""First-order Gauss-Markov processes: errors that forget themselves with a time constant.

A process of standard deviation `sigma` and time constant `tau` has the autocorrelation
sigma^2 exp(-|t|/tau). Sampled every `period_s` it is, exactly,

    e[k+1] = decay e[k] + drive sigma n[k],   decay = exp(-period/tau),   drive = sqrt(1 - decay^2),

with n standard normal, so it is stationary from a first value sigma n on. With tau = 0 it is white.
"""

from __future__ import annotations

import math

from flownav.core.compile import equation


@equation
def gauss_markov(value: float, decay: float, drive: float, normal: float) -> float:
    """The next value: `decay * value + drive * normal`; `drive` carries the unit of `value`."""
    return decay * value + drive * normal


def gauss_markov_coefficients(tau_s: float, period_s: float) -> tuple[float, float]:
    """`(decay, drive)` of a process of unit variance sampled every `period_s`; tau 0 gives white noise (0, 1).

    `drive` multiplies the process's standard deviation. ValueError where tau < 0 or the period is not positive.
    """
    if tau_s < 0.0 or period_s <= 0.0:
        raise ValueError(f"a time constant >= 0 and a period > 0 are needed, got {tau_s} s and {period_s} s")
    if tau_s == 0.0:
        return 0.0, 1.0
    return math.exp(-period_s / tau_s), math.sqrt(-math.expm1(-2.0 * period_s / tau_s))
