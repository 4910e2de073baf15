"""Where readings lie among input samples, and the few distinct steps that a log is made of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import kernel
from flownav.core.measurement import Array

MOST_STEPS = 64  # distinct steps that are worth a matrix each
STEP_GRAIN_S = 1e-10  # steps nearer to each other than this are the same


class Steps(NamedTuple):
    """Time steps: each one's length and its place among the distinct ones (`distinct` empty: too many)."""

    length_s: Array
    distinct_s: Array
    kind: NDArray[np.int64]


class Grid(NamedTuple):
    """Where readings lie among input samples for one delay.

    sample (m,): the input sample at or before each reading's instant; past: the step from there to it;
    between: the steps from each input sample to the next.
    """

    sample: NDArray[np.int64]
    past: Steps
    between: Steps


@kernel
def distinct_steps(length_s: Array) -> Steps:
    """The distinct values among step lengths, where there are at most MOST_STEPS of them."""
    distinct = np.empty(MOST_STEPS)
    kind = np.zeros(len(length_s), np.int64)
    count, last = 0, 0
    for i in range(len(length_s)):
        if count == 0 or abs(length_s[i] - distinct[last]) > STEP_GRAIN_S:
            last = 0
            while last < count and abs(length_s[i] - distinct[last]) > STEP_GRAIN_S:
                last += 1
            if last == MOST_STEPS:
                return Steps(length_s, distinct[:0].copy(), kind)
            if last == count:
                distinct[count] = length_s[i]
                count += 1
        kind[i] = last
    return Steps(length_s, distinct[:count].copy(), kind)


@kernel
def lay_grid(t_u: Array, t_y: Array, delay_s: float, between: Steps) -> Grid:
    """The grid of readings at t_y (m,), ordered, on input samples at t_u (n,), ordered, for a delay."""
    sample = np.zeros(len(t_y), np.int64)
    past = np.zeros(len(t_y))
    at = 0
    for row in range(len(t_y)):
        instant = t_y[row] - delay_s
        while at + 1 < len(t_u) and t_u[at + 1] <= instant + STEP_GRAIN_S:
            at += 1
        sample[row] = at
        past[row] = instant - t_u[at]
        if abs(past[row]) <= STEP_GRAIN_S:
            past[row] = 0.0
    return Grid(sample, distinct_steps(past), between)
