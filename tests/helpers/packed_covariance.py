"""A lane's covariance as a matrix and back."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import Lanes
from flownav.estimation.covariance import at


@cache
def _packed(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Columns and rows of P, (n, n), in the order in which a lane has them."""
    column, row = np.tril_indices(n)
    return column, row


def unpack(work: NDArray[np.float64], lanes: Lanes, lane: int, n: int) -> NDArray[np.float64]:
    """P of a lane, (n, n)."""
    column, row = _packed(n)
    packed = work[at(0, 0) * len(lanes) + lane :: len(lanes)][: len(row)]
    full = np.zeros((n, n), work.dtype)
    full[row, column] = full[column, row] = packed
    return full


def pack(work: NDArray[np.float64], lanes: Lanes, lane: int, n: int, covariance: NDArray[np.float64]) -> None:
    """Put a symmetric P, (n, n), into a lane."""
    column, row = _packed(n)
    work[at(0, 0) * len(lanes) + lane :: len(lanes)][: len(row)] = covariance[row, column]
