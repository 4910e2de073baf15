"""Running flights: one as a block of one lane, many as blocks of lanes on a pool of threads."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from flownav.compile import LANES, ONE_LANE, announce_compilation
from flownav.simulation import layout
from flownav.simulation.flight import Flight, fly_block
from flownav.simulation.history import HISTORY

Array = NDArray[np.float64]
Result = TypeVar("Result")


def fly_one(flight: Flight, seed: int, index: int = 0) -> Array:
    """The history of flight `index` of a campaign, (epochs, len(HISTORY), 1): the same bytes as in any batch."""
    history = np.empty((flight.plan.epochs, len(HISTORY), 1))
    with announce_compilation("single-flight"):
        fly_block(flight, seed, index, ONE_LANE, np.empty(layout.ROWS), history)
    return history


def fly_blocks(
    flight: Flight, seed: int, first: int, flights: int, judge: Callable[[Array], Result], threads: int | None = None
) -> Iterator[tuple[int, Result]]:
    """Fly `flights` flights from number `first` on; yields (flights in the block, judge(its history)) in order.

    `judge` takes a block's history (epochs, len(HISTORY), flights in the block), which is overwritten afterwards:
    memory does not grow with the number of flights.
    """
    own = threading.local()

    def fly(start: int) -> tuple[int, Result]:
        if not hasattr(own, "history"):
            own.work = np.empty(layout.ROWS * len(LANES))
            own.history = np.empty((flight.plan.epochs, len(HISTORY), len(LANES)))
        fly_block(flight, seed, first + start, LANES, own.work, own.history)
        left = min(len(LANES), flights - start)
        return left, judge(own.history[:, :, :left])

    with announce_compilation("batch"):
        nothing = flight._replace(plan=flight.plan._replace(epochs=0))
        fly_block(
            nothing, seed, first, LANES, np.empty(layout.ROWS * len(LANES)), np.empty((0, len(HISTORY), len(LANES)))
        )
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        try:
            yield from pool.map(fly, range(0, flights, len(LANES)))
        except BaseException:  # Ctrl-C drops what has not begun
            pool.shutdown(wait=False, cancel_futures=True)
            raise
