"""Wall time of work."""

from __future__ import annotations

import time
from collections.abc import Callable

REPEATS = 5


def best_of(
    work: Callable[[], object], repeats: int = REPEATS, clock: Callable[[], float] = time.perf_counter
) -> float:
    """The shortest of several times [s], of the wall's clock; the first call, which may compile, is not counted."""
    work()
    times = []
    for _ in range(repeats):
        start = clock()
        work()
        times.append(clock() - start)
    return min(times)
