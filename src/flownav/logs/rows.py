"""Rows of one sensor's table: times and columns, what was thrown away and why, and the order of their clock."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array

LATE_SHARE = 0.05  # more rows than this out of time order: not a late row here and there
LONGEST_GAP_S = 600.0  # a few rows further away than this carry a wrong time


@dataclass
class Rows:
    """t_s (n,), columns by name (n,) each, counts of thrown-away rows by reason."""

    t_s: Array
    columns: dict[str, Array]
    rejected: dict[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.t_s)

    def column(self, name: str) -> Array:
        """A column; NaN where the table lacks it, which cannot be written to."""
        return self.columns.get(name, np.broadcast_to(np.nan, len(self.t_s)))

    def matrix(self, *names: str) -> Array:
        """Columns side by side, shape (n, len(names)); a column that the table lacks is NaN."""
        return np.column_stack([self.column(name) for name in names])

    def keep(self, good: NDArray[np.bool_] | np.bool_, reason: str) -> None:
        """Throw the other rows away and count them."""
        bad = int(np.count_nonzero(~good))
        if bad:
            self.rejected[reason] = self.rejected.get(reason, 0) + bad
            self.t_s = self.t_s[good]
            self.columns = {name: values[good] for name, values in self.columns.items()}


def drop_strays(rows: Rows) -> None:
    """Throw away the few rows at either end that a gap of many minutes parts from all others."""
    gaps = np.flatnonzero(np.diff(rows.t_s) > LONGEST_GAP_S) + 1
    few = max(1, int(LATE_SHARE * len(rows)))
    near = np.ones(len(rows), bool)
    for gap in gaps:
        if len(near) - gap <= few:
            near[gap:] = False
        elif gap <= few:
            near[:gap] = False
    rows.keep(near, "clock_jump")


def drop_duplicates(rows: Rows) -> None:
    """Throw away rows that say the same at the same time as the row before; two readings at one time both stay."""
    again = np.zeros(len(rows), bool)
    again[1:] = np.diff(rows.t_s) == 0
    for values in rows.columns.values():
        again[1:] &= (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    rows.keep(~again, "duplicate")


def longest_ordered(t_s: Array) -> NDArray[np.bool_]:
    """The largest set of rows whose times never run back (patience sorting), as a mask."""
    keep = np.zeros(len(t_s), bool)
    tails: list[float] = []
    tail_rows: list[int] = []
    before = np.full(len(t_s), -1)
    for row, t in enumerate(t_s.tolist()):
        place = bisect_right(tails, t)
        before[row] = tail_rows[place - 1] if place else -1
        if place == len(tails):
            tails.append(t)
            tail_rows.append(row)
        else:
            tails[place], tail_rows[place] = t, row
    row = tail_rows[-1] if tail_rows else -1
    while row >= 0:
        keep[row] = True
        row = int(before[row])
    return keep
