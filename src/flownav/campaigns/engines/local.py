"""Flights on the cores of this machine: blocks of lanes on a pool of threads."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.engines.engine import Part
from flownav.campaigns.plan import Ready
from flownav.campaigns.rows import rows_of
from flownav.core.compile import LANES
from flownav.simulation.engine import Instead, fly_blocks
from flownav.simulation.plan import Flight

Array = NDArray[np.float64]


class Local:
    """threads: how many fly at once; None: as many as there are cores. instead: as of `fly_blocks`.

    check: is given each block's flight and history, and raises where they cannot be judged.
    """

    def __init__(
        self, threads: int | None = None, instead: int | None = None,
        check: Callable[[Flight, Array], None] = lambda flight, history: None,
    ) -> None:  # fmt: skip
        self.threads, self.instead, self.check = threads, instead, check

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object] = lambda flown: None
    ) -> Iterator[tuple[Part, Array]]:
        """The rows of each part; parts that follow each other are flown without a pause between them."""
        for together in neighbours(parts):
            yield from self._without_pause(cell, seed, together, on_progress)

    def _without_pause(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object]
    ) -> Iterator[tuple[Part, Array]]:
        flight, waiting = cell.flight, list(parts)
        held: list[Array] = []
        total = sum(part.flights for part in parts)

        def judge(history: Array) -> Array:
            self.check(flight, history)
            return rows_of(flight, history)

        have = 0
        first, fault = parts[0].first, cell.faults(seed)

        def instead(start: int) -> Instead:
            numbers = range(first + start, first + start + len(LANES))
            return Instead(faults=fault and [fault(number) for number in numbers], take=self.instead)

        for flown, block in fly_blocks(flight, seed, first, total, judge, self.threads, cell.ensemble, instead):
            held.append(block)
            have += flown
            on_progress(flown)
            while waiting and have >= waiting[0].flights:
                part, rows = waiting.pop(0), np.concatenate(held)
                held, have = [rows[part.flights :]], have - part.flights
                yield part, rows[: part.flights]


def neighbours(parts: Sequence[Part]) -> Iterator[list[Part]]:
    """Parts in runs that follow each other without a gap."""
    if not parts:
        return
    run = [parts[0]]
    for before, after in pairwise(parts):
        if after.first != before.first + before.flights:
            yield run
            run = []
        run.append(after)
    yield run
