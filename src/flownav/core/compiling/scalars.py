"""Scalar helpers that work on floats, on complex numbers (complex step) and inside lanes; the bits of a float; the
classical Runge-Kutta method of fourth order, stage by stage and as a whole step.

Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, 1993, table II.1.2.
"""

import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from flownav.core.compiling.engine import equation


@equation
def larger(a: float, b: float) -> float:
    """max(a, b) by real part; a select, so lanes stay vectorised and complex steps pass."""
    return a if a.real > b.real else b


@equation
def smaller(a: float, b: float) -> float:
    """min(a, b) by real part."""
    return a if a.real < b.real else b


@equation
def squared(a: float) -> float:
    """a·a: on a CUDA device a power is computed by a library, to other bits."""
    return a * a


@equation
def magnitude(a: float) -> float:
    """|a| as an analytic function of a: -a where the real part is negative."""
    return a if a.real >= 0.0 else -a


@equation
def clamp(a: float, low: float, high: float) -> float:
    """a held between low and high."""
    return larger(low, smaller(a, high))


# -- the bits of a float, and back: for polynomial logarithms and exponentials ----------------------------
def float_from_bits(bits: Any) -> float:
    """The float64 that these 64 bits (uint64) spell."""
    return float(struct.unpack("<d", struct.pack("<Q", int(bits)))[0])


def bits_from_float(value: float) -> Any:
    """The 64 bits (uint64) of a float64."""
    return np.uint64(struct.unpack("<Q", struct.pack("<d", value))[0])


STAGES = 4


@equation
def share(stage: int, dt: float) -> float:
    """How long a stage's rate counts in a step of dt: a sixth of it at its ends, a third for each of the two within."""
    return dt / 3.0 if stage == 1 or stage == 2 else dt / 6.0


@equation
def reach(stage: int, dt: float) -> float:
    """How long a stage's rate is followed from the start of a step of dt to the stage after it."""
    return 0.5 * dt if stage < 2 else dt


def runge_kutta(moved: Callable[[Any, Any, float], Any]) -> tuple[Callable[..., tuple[Any, Any]], Callable[..., Any]]:
    """Two equations, `(after, step)`, for states that `moved(state, rate, dt)` carries on: state + rate·dt.

    after(stage, start, total, rate, dt): the step's sum with the rate of a stage (0 to 3), and the next stage's state;
    the sum begins as the start, and with all four it is the state after the step. step(rate, start, dt, *held): the
    state after dt by `rate(state, *held)`.
    """

    @equation
    def after(stage: int, start: Any, total: Any, rate: Any, dt: float) -> tuple[Any, Any]:
        return moved(total, rate, share(stage, dt)), moved(start, rate, reach(stage, dt))

    @equation
    def step(rate: Callable[..., Any], start: Any, dt: float, *held: Any) -> Any:
        total = state = start
        for stage in range(STAGES):
            total, state = after(stage, start, total, rate(state, *held), dt)
        return total

    return after, step
