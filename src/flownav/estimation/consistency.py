"""A lane's covariance as a matrix and back, for Python's callers; how far the truth lies, in stated units."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import Lanes, Work, equation
from flownav.estimation.covariance import at, covariance_of
from flownav.estimation.states import SCRATCH, STATE


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


SCORED = 6
Six = tuple[float, float, float, float, float, float]


@equation
def normalised_error(work: Work, lanes: Lanes, lane: int, truth: Six) -> float:
    """e' P^-1 e of one lane's position and velocity NED, by elimination in the filter's scratch."""
    error, square = SCRATCH, SCRATCH + SCORED
    for i in range(SCORED):
        work[(error + i) * len(lanes) + lane] = work[(STATE + i) * len(lanes) + lane] - truth[i]
        for j in range(SCORED):
            work[(square + i * SCORED + j) * len(lanes) + lane] = covariance_of(work, lanes, i, j, lane)
    total = 0.0
    for k in range(SCORED):
        pivot = work[(square + k * (SCORED + 1)) * len(lanes) + lane]
        e = work[(error + k) * len(lanes) + lane]
        total += e * e / pivot
        for i in range(k + 1, SCORED):
            share = work[(square + i * SCORED + k) * len(lanes) + lane] / pivot
            work[(error + i) * len(lanes) + lane] -= share * e
            for j in range(k + 1, SCORED):
                taken = share * work[(square + k * SCORED + j) * len(lanes) + lane]
                work[(square + i * SCORED + j) * len(lanes) + lane] -= taken
    return total
