"""Whole numbers of time: nanoseconds and microseconds of formats that know no fraction and no negative time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.core.record import Record

Stamps = NDArray[np.int64]


def stamps(t_s: NDArray[np.float64], per_second: float, shift_s: float = 0.0) -> Stamps:
    """Finite times [s], `shift_s` later, in units of 1/per_second, rounded to the nearest."""
    return np.rint((t_s + shift_s) * per_second).astype(np.int64)


def finite_rows(t_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """The rows with a finite time, in order of time; ties keep their order."""
    rows = np.flatnonzero(np.isfinite(t_s))
    return rows[np.argsort(t_s[rows], kind="stable")]


def shift_needed_s(record: Record) -> float:
    """Whole seconds to add so that no time is negative; 0 where none is.

    A record's innovations stand at the instant that a delayed reading describes, which may lie before time 0.
    """
    times = [np.asarray(table["t_s"], float) for table in record.tables.values()]
    earliest = min((float(t[np.isfinite(t)].min()) for t in times if np.isfinite(t).any()), default=0.0)
    return float(np.ceil(max(-earliest, 0.0)))
