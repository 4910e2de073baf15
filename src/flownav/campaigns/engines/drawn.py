"""The truths of a cell's flights, packed as kernels take them, drawn by as many processes as are allowed.

A truth of its own costs Python more than a millisecond; a device that flies a thousand times as fast would wait.
"""

from __future__ import annotations

import multiprocessing
import pickle
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.plan import Ready, ready_of
from flownav.simulation.ensemble import Ensemble, believed
from flownav.simulation.plan import Flight
from flownav.simulation.truth import TRUTH_ROWS, SensorFault, packed_truth

Array = NDArray[np.float64]
Truths = Callable[[int, int], Array]  # of so many flights from a number on: (TRUTH_ROWS, flights); of one, for all

SLICE = 512  # flights that a process draws at a time
WORTH_IT = 4096  # flights: fewer are drawn before other processes have started


def truths_of(
    flight: Flight, seed: int, ensemble: Ensemble | None, faults: Callable[[int], SensorFault] | None = None
) -> Truths:
    """As `simulation.engine.fly_into` has them: what the sheets say or the ensemble draws, and each flight's fault."""

    def packed(first: int, count: int) -> Array:
        if ensemble is not None:
            truths = ensemble.truths(seed, first, count)
        else:
            truths = [believed(flight)] * (1 if faults is None else count)
        if faults is not None:
            truths = [truth._replace(fault=faults(first + k)) for k, truth in enumerate(truths)]
        return packed_truth(truths).reshape(TRUTH_ROWS, -1)

    return packed


@contextmanager
def truths_of_cell(cell: Ready, seed: int, flights: int, processes: int) -> Iterator[Truths]:
    """The truths of a cell of which so many flights will be asked for."""
    if cell.ensemble is None or cell.failure is not None or processes < 2 or flights < WORTH_IT:
        yield truths_of(cell.flight, seed, cell.ensemble, cell.faults(seed))
        return
    told = pickle.dumps((cell.setup, cell.truth_model, cell.sampling, cell.flights))
    pool = ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _begin, (told, seed))

    def packed(first: int, count: int) -> Array:
        ends = [*range(first, first + count, SLICE), first + count]
        return np.concatenate(list(pool.map(_draw, ends[:-1], np.diff(ends).tolist())), axis=1)

    try:
        yield packed
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


_drawing: list[Truths] = []  # of a process that draws


def _begin(told: bytes, seed: int) -> None:
    cell = ready_of(*pickle.loads(told))
    _drawing[:] = [truths_of(cell.flight, seed, cell.ensemble)]


def _draw(first: int, count: int) -> Array:
    return _drawing[0](first, count)
