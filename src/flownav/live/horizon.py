"""The delayed horizon: readings wait until everything of their instant must have arrived, then go on in its order."""

from __future__ import annotations

import heapq
from collections import Counter
from typing import NamedTuple

from flownav.core.measurement import Measurement

MOST_WAITING = 8192


class Waiting(NamedTuple):
    """A reading in the queue: the instant it describes [s], its place among equals, and itself.

    exposure_s: for how long a flow reading looked, 0 for others.
    """

    t_s: float
    order: int
    reading: Measurement
    exposure_s: float = 0.0


class Horizon:
    """Readings in the order of the instants they describe, released when these are old enough.

    dropped counts by sensor and reason: `late`, of an instant that was already released; `overflow`, where too many
    wait.
    """

    def __init__(self) -> None:
        self.dropped: Counter[str] = Counter()
        self._waiting: list[Waiting] = []
        self._order = 0
        self._released_s = float("-inf")

    def __len__(self) -> int:
        return len(self._waiting)

    def take(self, reading: Measurement, exposure_s: float = 0.0) -> bool:
        """Queue a reading; False where it was dropped and counted."""
        t_s = reading.t_s - reading.delay_s
        if t_s < self._released_s:
            self.dropped[f"{reading.sensor.name.lower()}: late"] += 1
            return False
        if len(self._waiting) >= MOST_WAITING:
            self.dropped[f"{reading.sensor.name.lower()}: overflow"] += 1
            return False
        self._order += 1
        heapq.heappush(self._waiting, Waiting(t_s, self._order, reading, exposure_s))
        return True

    def release(self, until_s: float, most: int) -> list[Waiting]:
        """The readings of instants up to `until_s`, in order, `most` at a time."""
        released: list[Waiting] = []
        while self._waiting and self._waiting[0].t_s <= until_s and len(released) < most:
            released.append(heapq.heappop(self._waiting))
        if not self._waiting or self._waiting[0].t_s > until_s:
            self._released_s = max(self._released_s, until_s)
        elif released:
            self._released_s = max(self._released_s, released[-1].t_s)
        return released

    def waiting(self) -> list[Waiting]:
        """What waits, in order."""
        return sorted(self._waiting)

    def clear(self) -> None:
        """Forget what waits; instants before the newest released stay gone."""
        self._waiting.clear()
