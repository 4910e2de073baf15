"""Speed, measured as a user would feel it: what `flownav bench` prints."""

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One measured figure: what it is, its value and unit, what was asked, and whether more or less is better.

    asked None: it stands beside the others and nothing was asked of it.
    """

    name: str
    value: float
    unit: str
    asked: float | None
    more_is_better: bool
    note: str = ""

    @property
    def reached(self) -> bool | None:
        """Whether the figure is at least as good as asked."""
        if self.asked is None:
            return None
        return self.value >= self.asked if self.more_is_better else self.value <= self.asked


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
