"""A campaign flown, cell by cell, until all flights are there or are enough; and one flight of it again."""

import ctypes
import math
import os
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from flownav.campaigns.chain import DamagedError, root_of
from flownav.campaigns.engines import Engine, Local, Part, RayCluster
from flownav.campaigns.local import fly_recorded
from flownav.campaigns.measures import ROW_COLUMNS, Interval, enough, figure_of, looks, stop_of, values_of
from flownav.campaigns.plan import Plan, Ready
from flownav.campaigns.store import PART, Dataset, Kept, Store, table_of
from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array
from flownav.core.record import Record
from flownav.simulation.assemble import Setup
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.sensing import EPOCH_S
from flownav.simulation.truth import SensorFault

ENGINES = ("local", "ray", "cuda")
LANDING, TAKEOFF = "r95_m", "p95_axis_m"  # what is followed while a campaign flies
# parameters of glibc's mallopt (malloc.h)
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8
SAVE_S = 1.0  # pieces that arrive in less than this after a save wait for the next one
LARGE_BYTES = 1 << 20  # a piece of this size is asked of the system, and goes back to it when it is free


class Progress(NamedTuple):
    """How far a campaign is: flights flown now, in all (those found in the folder, too) and at most, and of a cell.

    damaged: the files that were not as they were written, each with what was wrong; they are flown again.
    """

    flown: int
    have: int
    most: int
    cell: str
    figure: str
    interval: Interval | None
    damaged: tuple[str, ...] = ()


Watch = Callable[[Progress], object]


def run_campaign(plan: Plan, engine: Engine, store: Store, watch: Watch = lambda progress: None) -> Dataset:
    """Fly what the folder lacks of the plan; the store is open. InputError where a cell cannot be flown."""
    done = Counted(plan, watch)
    for cell in range(len(plan.cells)):
        flights = _fly_cell(plan, cell, engine, store, done)
        store.require_no_more(cell, -(-flights // PART))
    return Dataset(store.folder)


class Counted:
    """Counts the flights of a campaign and tells who watches."""

    def __init__(self, plan: Plan, watch: Watch) -> None:
        self._plan, self._watch = plan, watch
        self._flown = self._have = 0
        self._cell, self._figure = 0, LANDING
        self._interval: Interval | None = None
        self._damaged: dict[Path, str] = {}

    def begin(self, cell: int, figure: str) -> None:
        """The next cell, and what is followed of it."""
        self._cell, self._figure, self._interval = cell, figure, None

    def found(self, flights: int) -> None:
        """Flights that the folder held already."""
        self._have += flights
        self._tell()

    def flown(self, flights: int) -> None:
        """Flights flown just now."""
        self._flown += flights
        self._have += flights
        self._tell()

    def estimate(self, values: Array) -> None:
        """Update the figure that is followed, from the flights of the cell so far."""
        self._interval = figure_of(self._figure, values)
        self._tell()

    def damaged(self, path: Path, what: str) -> None:
        """A file of the folder that is not as it was written."""
        if path not in self._damaged:
            self._damaged[path] = what
            self._tell()

    def _tell(self) -> None:
        label, most = self._plan.cells[self._cell].label, self._plan.flights * len(self._plan.cells)
        damaged = tuple(f"{path}: is damaged ({what})" for path, what in self._damaged.items())
        self._watch(Progress(self._flown, self._have, most, label, self._figure, self._interval, damaged))


@dataclass
class Link:
    """How far the chain of a cell's digests has come."""

    digest: bytes


def _fly_cell(plan: Plan, cell: int, engine: Engine, store: Store, done: Counted) -> int:
    """One cell, look by look: the parts that are missing, and whether the flights are enough; how many they are."""
    ready = plan.ready(cell)
    stop = stop_of(plan.until) if plan.until else None
    figure = stop.figure if stop else followed(ready)
    done.begin(cell, figure)
    values: list[Array] = []
    link = Link(root_of(plan.as_json, cell))
    for look in looks(plan.flights) if stop else [plan.flights]:
        known = sum(map(len, values))
        for part, rows in _parts_until(plan, cell, range(known, look), ready, engine, store, link, done):
            values.append(values_of(figure, rows))
            if part.number % 8 == 0:
                done.estimate(np.concatenate(values))
        values = [np.concatenate(values)]
        done.estimate(values[0])
        if stop and enough(stop, values[0], plan.flights) is not None:
            break
    return len(values[0])


def _parts_until(
    plan: Plan, cell: int, flights: range, ready: Ready, engine: Engine, store: Store, link: Link, done: Counted
) -> Iterator[tuple[Part, Array]]:
    """The parts of a cell's flights in their order: those of the folder, and those that it lacks, flown."""
    own, end = plan.cells[cell].first, flights.stop
    waiting = [Part(start // PART, own + start, min(PART, end - start)) for start in range(flights.start, end, PART)]
    while waiting:
        found = _found(store, cell, waiting[0], link.digest, done)
        if found is not None:
            link.digest = found.last
            done.found(waiting[0].flights)
            store.forget_begun(cell, waiting[0].number)
            yield waiting.pop(0), found.rows
            continue
        missing = [waiting.pop(0)]
        while waiting and _found(store, cell, waiting[0], None, done) is None:
            missing.append(waiting.pop(0))
        for part, rows in _flown(plan, cell, missing, ready, engine, store, link, done):
            drawn = ready.ensemble.values(plan.seed, part.first, part.flights) if ready.ensemble else {}
            table = table_of(cell, plan.cells[cell].values, part.first, rows, drawn)
            link.digest = store.write(cell, part.number, table, link.digest)
            store.forget_begun(cell, part.number)
            yield part, rows


def _flown(
    plan: Plan, cell: int, missing: list[Part], ready: Ready, engine: Engine, store: Store, link: Link, done: Counted
) -> Iterator[tuple[Part, Array]]:
    """The parts that are missing, flown in pieces, which are saved as they arrive: the first one at once, and then no
    more often than every SAVE_S. The next piece may be long in coming, so that none waits for one.

    The first part goes on behind the flights that were saved of it.
    """
    begun = _begun(store, cell, missing[0], link.digest, done)
    done.found(len(begun))
    rows, have, saved_s = [begun], len(begun), -math.inf
    waiting = deque(missing)
    for piece, more in engine.fly(ready, plan.seed, list(_pieces(missing, have, engine.piece)), done.flown):
        part = waiting[0]
        rows.append(more)
        have += piece.flights
        if have == part.flights:
            yield waiting.popleft(), np.concatenate(rows)
            rows, have, saved_s = [], 0, time.monotonic()
        elif time.monotonic() - saved_s >= SAVE_S:
            store.write_begun(cell, part.number, np.concatenate(rows), link.digest)
            saved_s = time.monotonic()


def _pieces(parts: list[Part], have: int, most: int) -> Iterator[Part]:
    """Yield parts cut into pieces of at most `most` flights, without the first `have` flights of the first part."""
    for part in parts:
        for start in range(have, part.flights, most):
            yield Part(part.number, part.first + start, min(most, part.flights - start))
        have = 0


def _begun(store: Store, cell: int, part: Part, before: bytes, done: Counted) -> Array:
    """The saved rows of a part that follows this digest, (flights, len(ROW_COLUMNS)); of no flight where none were
    saved.

    A damaged file is reported and its flights are flown again.
    """
    try:
        kept = store.begun(cell, part.number)
    except DamagedError as error:
        done.damaged(store.begun_path(cell, part.number), str(error))
        kept = None
    whole = kept is not None and kept.before == before and len(kept.rows) < part.flights
    return kept.rows if kept is not None and whole else np.zeros((0, len(ROW_COLUMNS)))


def _found(store: Store, cell: int, part: Part, before: bytes | None, done: Counted) -> Kept | None:
    """A part that the folder has as it was written; None where it has none. before: the digest that it must follow.

    A damaged one is reported, once.
    """
    try:
        kept = store.kept(cell, part.number, part.flights)
        if kept is not None and before is not None and kept.before != before:
            raise DamagedError("it does not follow the part before it")
    except DamagedError as error:
        done.damaged(store.path_of(cell, part.number), str(error))
        return None
    return kept


def followed(ready: Ready) -> str:
    """The figure that is followed of a cell: of those that land R95 at contact."""
    plan = ready.flight.plan
    lands = plan.may_land_after_s < plan.epochs * EPOCH_S
    return LANDING if lands else TAKEOFF


# -- a flight again, to the bit ----------------------------------------------------------------------------------
class Recording(Protocol):
    """Flies one flight as a scored record."""

    def __call__(
        self, setup: Setup, seed: int, index: int, ensemble: Ensemble | None, fault: SensorFault | None, /
    ) -> Record:
        """Fly one flight, as `campaigns.local.fly_recorded` does."""


def record_again(plan: Plan, cell: int, flight: int, recording: Recording = fly_recorded) -> Record:
    """The record of a flight; it says what was drawn, and is the same bytes whenever it is made.

    recording: what flies it, with parts that are not ours.
    """
    ready = plan.ready(cell)
    injects = ready.faults(plan.seed)
    record = recording(
        replace(ready.setup, flight=ready.flight), plan.seed, flight, ready.ensemble, injects and injects(flight)
    )
    record.manifest["command"] = f"flownav campaign ... --flight {place_of(cell, flight)}"
    record.manifest["campaign"] = {"cell": plan.cells[cell].label, "flight": flight, "sampling": plan.sampling}
    record.manifest["provenance"].pop("written_utc")
    return record


def place_of(cell: int, flight: int) -> str:
    """How a flight is named on the command line."""
    return f"{cell}:{flight}"


def record_path(folder: Path, cell: int, flight: int) -> Path:
    """Where the record of a flight is written."""
    return folder / f"cell-{cell:03d}-flight-{flight:06d}.fnr"


# -- engines by name ----------------------------------------------------------------------------------------------
def require_engine(name: str) -> None:
    """InputError where there is no engine of that name."""
    if name not in ENGINES:
        raise InputError(f"{arg('engine')} {name}: must be {', '.join(ENGINES[:-1])} or {ENGINES[-1]}")


def engine_named(name: str) -> Engine:
    """The engine of that name. InputError where what it needs is not there."""
    require_engine(name)
    if name == "cuda":
        from flownav.campaigns.cuda import Cuda

        return Cuda(processes=os.cpu_count() or 1)
    return RayCluster() if name == "ray" else Local()


# -- the process's memory ---------------------------------------------------------------------------------------
def give_back_early() -> None:
    """From now on, in this process: large pieces do not stay in the heap, threads share one, Arrow keeps none.

    By itself glibc keeps pieces of up to 32 MB once one of that size was freed, in a heap for each thread. Another C
    library does what it does.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            mallopt = ctypes.CDLL(None).mallopt
            for parameter, value in (
                (M_MMAP_THRESHOLD, LARGE_BYTES),
                (M_TRIM_THRESHOLD, LARGE_BYTES),
                (M_ARENA_MAX, 1),
            ):
                mallopt(parameter, value)
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")  # read when Arrow is loaded
