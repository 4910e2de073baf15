"""A second-order lag advanced exactly while its input is held.

    x1' = x2,   x2' = -c x1 - b x2 + u

is the state of 1/(s^2 + b s + c): x1 the output, x2 its rate. Over one period with u held constant (zero-order
hold) the solution is linear, x[k+1] = F x[k] + G u[k], and F, G are computed once, in closed form.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

from flownav.core.compile import equation


class SecondOrderHold(NamedTuple):
    """F (row by row) and G of one period."""

    f11: float
    f12: float
    f21: float
    f22: float
    g1: float
    g2: float


@equation
def hold_step(x1: float, x2: float, u: float, hold: SecondOrderHold) -> tuple[float, float]:
    """x[k+1] = F x[k] + G u[k]."""
    return hold.f11 * x1 + hold.f12 * x2 + hold.g1 * u, hold.f21 * x1 + hold.f22 * x2 + hold.g2 * u


def second_order_hold(b: float, c: float, period_s: float) -> SecondOrderHold:
    """F and G of 1/(s^2 + b s + c) over one period; b in 1/s, c in 1/s^2, c > 0.

    F = exp(-b T/2) [[C + b S/2, S], [-c S, C - b S/2]] with C = cos(w T), S = sin(w T)/w, w^2 = c - b^2/4:
    one formula for the oscillating, the critically damped and the overdamped lag. G follows from the rest
    state x1 = u/c, x2 = 0, which F and G must keep. ValueError where c or the period is not positive.
    """
    if c <= 0.0 or period_s <= 0.0:
        raise ValueError(f"c > 0 and a period > 0 are needed, got {c} 1/s2 and {period_s} s")
    angle = cmath.sqrt(c - 0.25 * b * b) * period_s
    cosine = cmath.cos(angle).real
    sine_over_w = period_s * ((cmath.sin(angle) / angle).real if angle != 0.0 else 1.0)
    shrink = math.exp(-0.5 * b * period_s)
    f11 = shrink * (cosine + 0.5 * b * sine_over_w)
    f12 = shrink * sine_over_w
    f21 = -shrink * c * sine_over_w
    f22 = shrink * (cosine - 0.5 * b * sine_over_w)
    return SecondOrderHold(f11, f12, f21, f22, (1.0 - f11) / c, -f21 / c)
