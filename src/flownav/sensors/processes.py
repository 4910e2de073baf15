"""Processes that sensors share: chance, errors that forget themselves, lags that are advanced exactly, whole steps.

**Chance.** An event at one reading, a spell of many, and a factor that is somewhat off.

Every draw is a standard normal that the caller passes. An event of probability P happens where the normal exceeds the
level q with 1 - Phi(q) = P, so that no uniform draw is needed and masks stay selects.

A spell (no fix, no texture, a value that sticks) is a two-state chain that is advanced once a reading (Gilbert, Bell
System Technical Journal 39, 1960, who modelled bursts of errors so): it ends with probability T/mean at each reading,
hence lasts `mean` on average, and begins with the probability that gives it its share of the time.

**First-order Gauss-Markov.** A process of standard deviation `sigma` and time constant `tau` has the autocorrelation
sigma^2 exp(-|t|/tau). Sampled every `period_s` it is, exactly,

    e[k+1] = decay e[k] + drive sigma n[k],   decay = exp(-period/tau),   drive = sqrt(1 - decay^2),

with n standard normal, so it is stationary from a first value sigma n on. With tau = 0 it is white.

**A first-order lag**, advanced exactly while its input moves in a straight line between two readings.

    tau y' = u - y,   u(t) = u0 + (u1 - u0) t/T

gives y1 = k y0 + (m - k) u0 + (1 - m) u1 with k = exp(-T/tau) and m = (tau/T)(1 - k): a ramp is late by exactly tau,
whatever the period. With tau = 0 the output is the input.

**A second-order lag**, advanced exactly while its input is held:

    x1' = x2,   x2' = -c x1 - b x2 + u

is the state of 1/(s^2 + b s + c): x1 the output, x2 its rate. Over one period with u held constant (zero-order
hold) the solution is linear, x[k+1] = F x[k] + G u[k], and F, G are computed once, in closed form.
"""

import cmath
import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation

BEYOND_ANY_NORMAL = 1e3  # the generator's normals end at 8.5


@equation
def spell(now: float, normal: float, begins_above: float, ends_above: float) -> float:
    """1 while the spell lasts, else 0, one reading on."""
    ended = 0.0 if normal > ends_above else 1.0
    begun = 1.0 if normal > begins_above else 0.0
    return ended if now > 0.5 else begun


@equation
def factor(share: float, normal: float) -> float:
    """A positive factor of median 1: 1 + share n upwards, and its reciprocal as far downwards."""
    above = 1.0 + share * normal
    below = 1.0 / (1.0 - share * normal if normal < 0.0 else 1.0)
    return above if normal >= 0.0 else below


def level_of(probability: float) -> float:
    """Level that a standard normal exceeds with this probability: for 0 it never does, for 1 always.

    ValueError where the probability is not between 0 and 1.
    """
    if not 0.0 <= probability <= 1.0:
        raise ValueError(f"a probability from 0 to 1 is needed, got {probability}")
    if probability in (0.0, 1.0):
        return BEYOND_ANY_NORMAL if probability == 0.0 else -BEYOND_ANY_NORMAL
    return -NormalDist().inv_cdf(probability)


def spell_levels(share: float, mean_s: float, period_s: float) -> tuple[float, float]:
    """`(begins_above, ends_above)` of spells that fill `share` of the time and last `mean_s` (one reading at least).

    ValueError where the share is not between 0 and 0.5.
    """
    if not 0.0 <= share <= 0.5:
        raise ValueError(f"a share from 0 to 0.5 is needed, got {share}")
    ending = min(1.0, period_s / mean_s) if mean_s > 0.0 else 1.0
    return level_of(ending * share / (1.0 - share)), level_of(ending)


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


@equation
def quantised(value: float, quantum: float, steps_per_unit: float) -> float:
    """`value` to the nearest whole multiple of `quantum` (halves to even); unchanged where `quantum` is 0.

    `steps_per_unit` is 1/quantum (0 where quantum is 0). `np.rint` is one processor instruction in scalar and
    in vector code, so lanes keep their speed and their bits.
    """
    return np.rint(value * steps_per_unit) * quantum if quantum > 0.0 else value


def steps_per_unit(quantum: float) -> float:
    """1/quantum, or 0 where there is no quantisation."""
    return 1.0 / quantum if quantum > 0.0 else 0.0
