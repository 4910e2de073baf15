"""Normalised innovations squared: does each sensor disagree with the prediction as much as the filter expects?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CHI_SQUARE_95 = 3.841458820694124  # one degree of freedom


class Nis(NamedTuple):
    """Of one sensor's scalar components: how many were tested, the mean (1 where the filter is right), and the share
    inside the 95 % band of chi-square with one degree of freedom (0.95 where it is right)."""

    tested: int
    mean: float
    inside_fraction: float


def nis_of(innovation: Array, innovation_variance: Array) -> Nis | None:
    """The NIS of tested components, rejected ones among them, (n,) each; None where there is none."""
    known = np.isfinite(innovation) & np.isfinite(innovation_variance) & (innovation_variance > 0.0)
    if not known.any():
        return None
    squares = innovation[known] ** 2 / innovation_variance[known]
    return Nis(int(known.sum()), float(squares.mean()), float(np.mean(squares <= CHI_SQUARE_95)))
