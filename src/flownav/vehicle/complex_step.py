"""Exact derivatives and Newton's method for plain equations, by the complex step.

A real-analytic function has f(x + i·h) = f(x) + i·h·f'(x) + O(h²): with h = 1e-30 the derivative is exact to
rounding, without the cancellation of differences.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array

PlainEquation = Callable[[Sequence[Any]], Sequence[Any]]

STEP = 1e-30
ITERATIONS = 50
HALVINGS = 12


def jacobian(function: PlainEquation, point: Array) -> Array:
    """The Jacobian (m, n) of an equation of n numbers with m values, at a point (n,)."""
    columns = []
    for i in range(len(point)):
        moved = [complex(x) for x in point]
        moved[i] += 1j * STEP
        columns.append([complex(y).imag / STEP for y in function(moved)])
    return np.array(columns).T


def value(function: PlainEquation, point: Array) -> Array:
    """The values (m,) of an equation at a real point (n,)."""
    return np.array([complex(y).real for y in function([complex(x) for x in point])])


def solve(function: PlainEquation, start: Array, tolerance: float, failure: str) -> Array:
    """The point (n,) at which n values are all below the tolerance. InputError(failure) where Newton finds none."""
    point = np.array(start, float)
    residual = value(function, point)
    for _ in range(ITERATIONS):
        if np.abs(residual).max() < tolerance:
            return point
        try:
            move = np.linalg.solve(jacobian(function, point), -residual)
        except np.linalg.LinAlgError:
            break
        for halvings in range(HALVINGS):
            candidate = point + move * 0.5**halvings
            there = value(function, candidate)
            if np.linalg.norm(there) < np.linalg.norm(residual):
                break
        point, residual = candidate, there
    raise InputError(failure)
