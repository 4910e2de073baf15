"""Continuous linear models over a step with the inputs held (zero-order hold)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TAYLOR_ORDER = 12


def discretised(a: Array, b: Array, dt_s: float) -> tuple[Array, Array]:
    """Transition (n, n) and input matrix (n, m) of x' = A x + B u over dt: the exponential of [[A, B], [0, 0]] dt.

    Scaling and squaring of the Taylor series, exact to rounding for moderate norms (scipy's expm is the oracle
    in the tests; its import costs more than a whole flight).
    """
    n, inputs = b.shape
    generator = np.zeros((n + inputs, n + inputs))
    generator[:n, :n], generator[:n, n:] = a * dt_s, b * dt_s
    norm = float(np.abs(generator).sum(axis=1).max())
    squarings = max(0, int(np.ceil(np.log2(norm))) + 4) if norm > 0.0 else 0
    step = generator / 2.0**squarings
    term = result = np.eye(n + inputs)
    for order in range(1, TAYLOR_ORDER + 1):
        term = term @ step / order
        result = result + term
    for _ in range(squarings):
        result = result @ result
    return np.ascontiguousarray(result[:n, :n]), np.ascontiguousarray(result[:n, n:])
