"""Experiment: an input and a sensor's reading of it, each at its own times, and where readings lie among samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import kernel
from flownav.core.errors import InputError
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


# -- experiments -------------------------------------------------------------------------------------------------
LEAST_READINGS = 50
LEAST_MOTION = 1e-6


@dataclass(frozen=True)
class Experiment:
    """One run. t_u [s], u (n,): the reference's velocity; t_y [s], y (m,): the sensor's; both times increase.

    height_m is NaN where it is not known. Build with `experiment`, which checks.
    """

    name: str
    t_u: Array
    u: Array
    t_y: Array
    y: Array
    between: Steps
    height_m: float = float("nan")

    def within(self, delay_range_s: tuple[float, float]) -> Experiment:
        """The run without readings that a delay in this range takes outside the input's time.

        InputError where too few are left, or where these do not move.
        """
        inside = (self.t_y - delay_range_s[1] >= self.t_u[0]) & (self.t_y - delay_range_s[0] <= self.t_u[-1])
        if np.count_nonzero(inside) < LEAST_READINGS:
            raise InputError(
                f"{self.name}: {np.count_nonzero(inside)} sensor readings lie inside the reference's time; at least "
                f"{LEAST_READINGS} are needed, beyond the first {delay_range_s[1]:g} s"
            )
        _require_motion(self.name, "sensor", self.y[inside])
        return replace(self, t_y=self.t_y[inside], y=self.y[inside])

    def between_times(self, start_s: float, end_s: float) -> Experiment:
        """The readings from start to end with the input of all times; not checked for length."""
        inside = (self.t_y >= start_s) & (self.t_y < end_s)
        return replace(self, t_y=self.t_y[inside], y=self.y[inside])

    def from_input(self, first: int) -> Experiment:
        """The run with its input from a sample on; not checked for length."""
        t_u = self.t_u[first:]
        return replace(self, t_u=t_u, u=self.u[first:], between=distinct_steps(np.diff(t_u)))

    @property
    def longest_step_s(self) -> float:
        """Between two input samples."""
        steps = self.between.distinct_s if len(self.between.distinct_s) else self.between.length_s
        return float(steps.max())


def experiment(name: str, t_u: Array, u: Array, t_y: Array, y: Array, height_m: float = float("nan")) -> Experiment:
    """A checked run. InputError, one line, where it is too short, constant, not finite or not in time order."""
    t_u, u, t_y, y = (np.ascontiguousarray(column, float) for column in (t_u, u, t_y, y))
    for what, t_s, value in (("reference", t_u, u), ("sensor", t_y, y)):
        if len(t_s) != len(value):
            raise InputError(f"{name}: {what}: {len(t_s)} times and {len(value)} values; one time a value is needed")
        if len(t_s) < LEAST_READINGS:
            raise InputError(f"{name}: {len(t_s)} {what} readings; at least {LEAST_READINGS} are needed, some seconds")
        if not (np.isfinite(t_s).all() and np.isfinite(value).all()):
            raise InputError(f"{name}: {what}: a time or value is not a number; remove such rows")
        if np.any(np.diff(t_s) <= 0.0):
            row = int(np.argmax(np.diff(t_s) <= 0.0))
            raise InputError(f"{name}: {what}: time does not increase after {t_s[row]:g} s; sort and remove repeats")
        _require_motion(name, what, value)
    return Experiment(name, t_u, u, t_y, y, distinct_steps(np.diff(t_u)), height_m)


def _require_motion(name: str, what: str, velocity: Array) -> None:
    """InputError where a velocity is the same throughout [m/s]."""
    if np.ptp(velocity) < LEAST_MOTION:
        raise InputError(f"{name}: the {what}'s velocity is constant ({velocity[0]:g} m/s); a run that moves is needed")
