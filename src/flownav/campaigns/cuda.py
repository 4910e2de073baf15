"""Flights on a CUDA device (extra `gpu`): a thread a flight, float64, from the same equations as on the CPU.

A truth of its own costs Python more than a millisecond; a device that flies a thousand times as fast would wait.

A fixed number of flights is flown at once; only their scores come back. Of an ensemble the truths are drawn on the
CPU, as everywhere, while the device flies the flights before.
"""

import multiprocessing
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import numpy as np

from flownav.campaigns.device_flight import TAPE_COUNTS, fly_navigated_flight, fly_paper_flight, take_here
from flownav.campaigns.engines import Part, into_parts, neighbours
from flownav.campaigns.local import home_epoch
from flownav.campaigns.plan import Ready, ready_of
from flownav.core.compile import ONE_LANE, WARP, NoDeviceError, Runner, announce_compilation, device_runner
from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array
from flownav.estimation.covariance import with_lag
from flownav.navigation.kernel_settings import carries_lag
from flownav.navigation.memory import new_work
from flownav.navigation.packed import load_flow_settings
from flownav.navigation.take import navigator_unit
from flownav.scoring.running import RUNNING_COLUMNS, RUNNING_ROWS
from flownav.simulation.block import plain_noise
from flownav.simulation.engine import buffers_of
from flownav.simulation.ensemble import Ensemble, believed
from flownav.simulation.plan import Flight
from flownav.simulation.truth import TRUTH_ROWS, SensorFault, packed_truth

Truths = Callable[
    [int, int], Array
]  # called with the first flight's number and the number of flights: (TRUTH_ROWS, flights); of one, for all

SLICE_FLIGHTS = 512  # flights that a process draws at a time
WORTH_IT = 4096  # flights: fewer are drawn before other processes have started


def truths_of(
    flight: Flight, seed: int, ensemble: Ensemble | None, faults: Callable[[int], SensorFault] | None = None
) -> Truths:
    """Truths for `simulation.engine.fly_into`: the sheets' values or the ensemble's draws, and each flight's fault."""

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
    """The truths of a cell of which `flights` flights will be requested."""
    if cell.ensemble is None or cell.failure is not None or processes < 2 or flights < WORTH_IT:
        yield truths_of(cell.flight, seed, cell.ensemble, cell.faults(seed))
        return
    pickled = pickle.dumps((cell.setup, cell.truth_model, cell.sampling, cell.flights))
    pool = ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _begin, (pickled, seed))

    def packed(first: int, count: int) -> Array:
        ends = [*range(first, first + count, SLICE_FLIGHTS), first + count]
        return np.concatenate(list(pool.map(_draw, ends[:-1], np.diff(ends).tolist())), axis=1)

    try:
        yield packed
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


_drawing: list[Truths] = []  # of a process that draws


def _begin(pickled: bytes, seed: int) -> None:
    cell = ready_of(*pickle.loads(pickled))
    _drawing[:] = [truths_of(cell.flight, seed, cell.ensemble)]


def _draw(first: int, count: int) -> Array:
    return _drawing[0](first, count)


# -- the engine --------------------------------------------------------------------------------------------------
AT_ONCE = 32768  # flights: eight warps on each of an H200's 132 multiprocessors
MEMORY_SHARE = 0.8  # of what is free


class Cuda:
    """The CUDA device of this machine, or Numba's simulator of one. InputError where there is neither.

    at_once: flights. processes: that draw truths; more than one start as `multiprocessing` starts them, so that a
    script's main module must be guarded.
    """

    piece = 256

    def __init__(self, runner: Runner | None = None, at_once: int = AT_ONCE, processes: int = 1) -> None:
        self._runner = runner or _runner()
        self._at_once, self._processes = at_once, processes

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object] = lambda flown: None
    ) -> Iterator[tuple[Part, Array]]:
        """The rows of each part; parts that follow each other are flown together."""
        asked = sum(part.flights for part in parts)
        with truths_of_cell(cell, seed, asked, self._processes) as truths:
            for together in neighbours(parts):
                total = sum(part.flights for part in together)
                rows = self.rows(cell.flight, seed, together[0].first, total, truths)
                yield from into_parts(together, rows, on_progress)

    def rows(self, flight: Flight, seed: int, first: int, flights: int, truths: Truths) -> Iterator[Array]:
        """Yield the rows of `flights` flights from number `first` on, (flights, RUNNING_COLUMNS), as many as fit at a
        time.
        """
        at_once = min(self._at_once, flights, most_that_fit(self._runner.free_bytes(), flight))
        if at_once < 1:
            raise InputError(
                f"{arg('engine')} cuda: the device has no memory left for a flight; use {arg('engine')} local"
            )
        room = Room(self._runner, flight, at_once)
        starts = range(first, first + flights, at_once)
        counts = [min(at_once, first + flights - start) for start in starts]
        with ThreadPoolExecutor(1) as beside, announce_compilation("device"):
            coming = beside.submit(truths, starts[0], counts[0])
            for k, (start, count) in enumerate(zip(starts, counts, strict=True)):
                truth = coming.result()
                if k + 1 < len(starts):
                    coming = beside.submit(truths, starts[k + 1], counts[k + 1])
                yield room.fly(seed, start, count, truth.reshape(-1))


def rows_of_flight(flight: Flight) -> int:
    """Rows of the lane buffer of one flight on a device: the simulator's, and those of its scores."""
    return len(buffers_of(flight, ONE_LANE, 0, written=False).work) + RUNNING_ROWS


def most_that_fit(free_bytes: int, flight: Flight) -> int:
    """How many flights a device has memory for, in whole warps where there are any."""
    navigator = len(new_work(ONE_LANE)) + TAPE_COUNTS if flight.onboard is not None else 0
    each = 8 * (rows_of_flight(flight) + navigator + TRUTH_ROWS + 2 * RUNNING_COLUMNS)
    return int(MEMORY_SHARE * free_bytes) // (each * WARP) * WARP


class Room:
    """A device's memory for `at_once` flights of one kind."""

    def __init__(self, runner: Runner, flight: Flight, at_once: int) -> None:
        self._runner, self._flight = runner, flight
        whole = -(-at_once // WARP) * WARP
        self._rows = rows_of_flight(flight)
        self._arguments = {
            "flight": runner.put(flight), "noise": runner.put(plain_noise(1)), "rows": self._rows,
            "work": runner.new((whole * self._rows,), np.float64),
        }  # fmt: skip
        self._constants: dict[str, Any] = {}
        self._function: Callable[..., None] = fly_paper_flight
        if flight.onboard is None:
            home = home_epoch(flight)
            self._arguments["home"] = -1 if home is None else home
        else:
            self._function = fly_navigated_flight
            fresh = new_work(ONE_LANE, faults=flight.plan.minds_faults)
            self._arguments |= {
                "fresh": runner.put(fresh), "nav": runner.new((whole * len(fresh),), np.float64),
                "nothing": runner.put(np.zeros(1)), "room": runner.put(np.zeros(TAPE_COUNTS, np.int64)),
                "used": runner.new((whole * TAPE_COUNTS,), np.int64),
            }  # fmt: skip
            lag = carries_lag(load_flow_settings(flight.settings))
            self._constants = {"take": _navigator(runner, lag)}

    def fly(self, seed: int, first: int, flights: int, truth: Array) -> Array:
        """The rows of flights from number `first` on; truth: `packed_truth` of each, or of one for all."""
        put = self._runner.put
        scores = self._runner.new((RUNNING_COLUMNS, flights), np.float64)
        arguments = self._arguments | {"seed": seed, "first": first, "truth": put(truth), "scores": scores}
        self._runner.run(self._function, flights, arguments, self._constants)
        return np.ascontiguousarray(self._runner.fetch(scores).T)


def _navigator(runner: Runner, lag: bool) -> Any:
    """How a flight calls its navigator: in Python a callable; on a device the marker of its build (`take_here`)."""
    if runner.in_python:
        return navigator_unit(ONE_LANE, lag).python
    return with_lag(ONE_LANE) if lag else ONE_LANE


def _runner() -> Runner:
    """The device of this machine. InputError where there is none."""
    try:
        return device_runner(take_here)
    except NoDeviceError as error:
        raise InputError(f"{arg('engine')} cuda: {error}; use {arg('engine')} local") from error
