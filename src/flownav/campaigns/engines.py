"""The engines of campaigns by their names: what every engine does, this machine's cores, a cluster of Ray's.

The cluster is the one that RAY_ADDRESS names, else one of this machine's cores. Every task flies its part on one thread
and gives its rows back. What it needs (vehicle, sensors, scenario) goes with it: workers read no file of the user's.
"""

import logging
import os
import secrets
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from flownav.campaigns.local import rows_of
from flownav.campaigns.plan import Ready, ready_of
from flownav.core.compile import LANES
from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array
from flownav.simulation.block import plain_noise
from flownav.simulation.engine import Branches, Instead, fly_blocks
from flownav.simulation.ensemble import believed
from flownav.simulation.plan import Flight


class Part(NamedTuple):
    """Flights of a cell: `flights` of them from number `first` on; number: of the file that they go to."""

    number: int
    first: int
    flights: int


class Engine(Protocol):
    """Flies flights; the same rows whichever engine does. piece: flights that it flies before it gives rows back."""

    @property
    def piece(self) -> int:
        """Flights of a piece: what is saved of a part that is being flown is whole pieces."""

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object]
    ) -> Iterator[tuple[Part, Array]]:
        """The rows of each part, (flights, len(measures.ROW_COLUMNS)), part by part."""


# -- this machine ------------------------------------------------------------------------------------------------
class Local:
    """threads: how many fly at once; None: as many as there are cores. instead: as of `fly_blocks`.

    check: is given each block's flight and history, and raises where they cannot be judged.
    """

    piece = len(LANES)

    def __init__(
        self, threads: int | None = None, instead: int | None = None,
        check: Callable[[Flight, Array], None] = lambda flight, history: None,
    ) -> None:  # fmt: skip
        self.threads, self.instead, self.check = threads, instead, check

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object] = lambda flown: None
    ) -> Iterator[tuple[Part, Array]]:
        """The rows of each part; parts that follow each other are flown without a pause between them.

        Where they are single flights from here and there, each block takes as many as it has lanes.
        """
        if len(parts) > 1 and sum(part.flights for part in parts) < len(LANES) * sum(1 for _ in neighbours(parts)):
            yield from self._from_anywhere(cell, seed, parts, on_progress)
            return
        for together in neighbours(parts):
            yield from self._without_pause(cell, seed, together, on_progress)

    def _from_anywhere(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object]
    ) -> Iterator[tuple[Part, Array]]:
        flight, fault = cell.flight, cell.faults(seed)
        numbers = [part.first + k for part in parts for k in range(part.flights)]

        def instead(start: int) -> Instead:
            lanes = [numbers[min(place, len(numbers) - 1)] for place in range(start, start + len(LANES))]
            if cell.ensemble is None:
                truths = [believed(flight)] * len(lanes)
            else:
                truths = [truth for number in lanes for truth in cell.ensemble.truths(seed, number, 1)]
            noise = plain_noise(len(lanes))._replace(streams=np.array([lanes], np.uint64))
            faults = fault and [fault(number) for number in lanes]
            return Instead(Branches(truths, noise), faults, self.instead)

        blocks = fly_blocks(flight, seed, 0, len(numbers), self._judge(flight), self.threads, instead=instead)
        yield from into_parts(parts, (block for _, block in blocks), on_progress)

    def _judge(self, flight: Flight) -> Callable[[Array], Array]:
        def judge(history: Array) -> Array:
            self.check(flight, history)
            return rows_of(flight, history)

        return judge

    def _without_pause(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object]
    ) -> Iterator[tuple[Part, Array]]:
        flight, total = cell.flight, sum(part.flights for part in parts)
        first, fault = parts[0].first, cell.faults(seed)

        def instead(start: int) -> Instead:
            numbers = range(first + start, first + start + len(LANES))
            return Instead(faults=fault and [fault(number) for number in numbers], take=self.instead)

        blocks = fly_blocks(flight, seed, first, total, self._judge(flight), self.threads, cell.ensemble, instead)
        yield from into_parts(parts, (block for _, block in blocks), on_progress)


def into_parts(
    parts: Sequence[Part], blocks: Iterable[Array], on_progress: Callable[[int], object]
) -> Iterator[tuple[Part, Array]]:
    """Yield the rows of each part, from blocks of rows in order; progress is reported as they come."""
    waiting, held, have = list(parts), list[Array](), 0
    for block in blocks:
        held.append(block)
        have += len(block)
        on_progress(len(block))
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


# -- a cluster ---------------------------------------------------------------------------------------------------
PARTS_AHEAD = 2  # parts that wait for each core of the cluster


class RayCluster:
    """address: of the cluster; None: RAY_ADDRESS, else a new one on this machine. InputError without Ray."""

    piece = 4 * len(LANES)  # a task

    def __init__(self, address: str | None = None) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            import ray
        except ImportError:
            raise InputError(f'{arg("engine")} ray: Ray is not installed; pip install "flownav[cluster]"') from None
        self._ray = ray
        if not ray.is_initialized():
            where = address or os.environ.get("RAY_ADDRESS")
            try:
                ray.init(
                    address=where,
                    include_dashboard=None if where else False,
                    log_to_driver=False,
                    logging_level=logging.ERROR,
                )
            except (ConnectionError, RuntimeError, ValueError) as error:
                raise InputError(f"{arg('engine')} ray: no cluster at {where}: {str(error).splitlines()[0]}") from None

    def close(self) -> None:
        """Leave the cluster; one of this machine alone ends."""
        self._ray.shutdown()

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object] = lambda flown: None
    ) -> Iterator[tuple[Part, Array]]:
        """The rows of each part, in order, whichever worker has flown it."""
        shared = self._ray.put((cell.setup, cell.truth_model, cell.sampling, cell.flights, cell.failure))
        key = secrets.token_hex(8)
        task = self._ray.remote(num_cpus=1, max_retries=-1)(fly_part)
        most = PARTS_AHEAD * max(1, int(self._ray.cluster_resources().get("CPU", 1)))
        waiting: deque[tuple[Part, Any]] = deque()
        for part in parts:
            waiting.append((part, task.remote([shared], key, seed, part)))
            if len(waiting) >= most:
                yield self._taken(*waiting.popleft(), on_progress)
        while waiting:
            yield self._taken(*waiting.popleft(), on_progress)

    def _taken(self, part: Part, result: Any, on_progress: Callable[[int], object]) -> tuple[Part, Array]:
        """The rows of a part, once it has been flown."""
        rows = np.array(self._ray.get(result))
        on_progress(part.flights)
        return part, rows


_cells: dict[str, Ready] = {}  # of a worker: the last cell that it has flown


def fly_part(shared: list[Any], key: str, seed: int, part: Part) -> Array:
    """A part's rows, flown by a worker on one thread. shared: the reference to the arguments from which
    `plan.ready_of` makes a cell.
    """
    if key not in _cells:
        import ray

        _cells.clear()
        _cells[key] = ready_of(*ray.get(shared[0]))
    ((_, rows),) = Local(threads=1).fly(_cells[key], seed, [part])
    return rows
