"""Running flights: one as a block of one lane, many as blocks of lanes on a pool of threads."""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from flownav.control.learning import Learnt
from flownav.control.learnt_gains import LoopGains
from flownav.core.compile import LANES, ONE_LANE, announce_compilation, compile_in_parallel
from flownav.core.measurement import Array, Sensor
from flownav.navigation.kernel_settings import carries_lag
from flownav.navigation.memory import new_work
from flownav.navigation.packed import load_flow_settings
from flownav.navigation.take import navigator_unit
from flownav.navigation.tape import COMPONENTS, Tape, empty_tape, room_of
from flownav.simulation import layout
from flownav.simulation.block import Block, Buffers, Noise, plain_noise
from flownav.simulation.ensemble import Ensemble, believed
from flownav.simulation.flight import fly_block
from flownav.simulation.history import HISTORY
from flownav.simulation.navigating import first_inertial, kept_inertials
from flownav.simulation.plan import PHYSICS_S, Flight
from flownav.simulation.truth import SensorFault, Truth, packed_truth

Result = TypeVar("Result")

COMPILING_ONE = "the simulator, once, about 30 s"
COMPILING_MANY = "the simulator of many flights, once, about 40 s"
BLOCKS_AHEAD = 4  # blocks that each thread may be ahead of who takes their results


class Flown(NamedTuple):
    """A block of flights with everything that was written: history (epochs, len(HISTORY), lanes), the navigator's tape,
    what it was fed (readings, fields of navigation.memory.Reading, lanes), and what each lane learnt of its vehicle.
    """

    history: Array
    tape: Tape
    fed: Array
    learnt: Sequence[tuple[Learnt, LoopGains]] = ()


class Branches(NamedTuple):
    """Truth and noise that each lane of a block flies in place of those of the flight with its number."""

    truths: Sequence[Truth]
    noise: Noise


class Instead(NamedTuple):
    """Replacements for a block beyond the numbers of its flights.

    faults: of each lane's sensors, for a flight that `fails`. take: the address of what takes readings in place of the
    navigator, with a unit's interface (`navigation.take.UNIT_SIGNATURE`), of as many lanes.
    """

    branches: Branches | None = None
    faults: Sequence[SensorFault] | None = None
    take: int | None = None


NOTHING_ELSE = Instead()


def buffers_of(flight: Flight, lanes: tuple[int, ...], epochs: int, *, written: bool) -> Buffers:
    """Scratch for one block after the other; written: the navigator's tape and what it is fed are kept."""
    table = flight.table
    rows, nav, tape, fed = (
        layout.ROWS,
        np.zeros(0),
        empty_tape(0, 0, 0, len(lanes)),
        np.zeros((0, layout.FIELDS, len(lanes))),
    )
    if table is not None and flight.onboard is not None:
        rows = first_inertial(table)
        rows += 6 * kept_inertials(table, flight.onboard.inertial_steps * PHYSICS_S)
        nav = new_work(lanes)
        if written:
            components = int(sum(COMPONENTS.get(Sensor(kind), 0) for kind in table.sensor))
            tape = empty_tape(epochs + 2, components, 4 * epochs + 8, len(lanes))
            fed = np.zeros((table.readings, layout.FIELDS, len(lanes)))
    room = np.array([*room_of(tape), len(fed)])
    return Buffers(np.empty(rows * len(lanes)), nav, tape, fed, room, np.empty((epochs, len(HISTORY), len(lanes))))


def fly_into(
    flight: Flight, seed: int, first: int, lanes: tuple[int, ...], b: Buffers, ensemble: Ensemble | None = None,
    instead: Instead = NOTHING_ELSE, *, compiled: bool = True,
) -> None:  # fmt: skip
    """Fly a block into its buffers, each lane by the flight's sheets, as the ensemble draws it or as its branch is.

    compiled False: in plain Python (tests; it is a thousand times slower). InputError as `Ensemble.truths`.
    """
    truths = truths_of(flight, seed, first, len(lanes), ensemble, instead)
    noise = plain_noise(len(lanes)) if instead.branches is None else instead.branches.noise
    if len(b.nav):
        followed = len(b.tape.estimate) > 0 or flight.plan.minds_faults  # nobody else reads levels or suspicions
        b.nav[:] = new_work(lanes, faults=followed)
    b.tape.used[:] = 0
    arguments = flight, packed_truth(truths), Block(b.work, lanes, seed, first, noise), b
    take: Any = 0
    if instead.take is not None:
        take = instead.take
    elif flight.onboard is not None:
        unit = navigator_unit(lanes, carries_lag(load_flow_settings(flight.settings)))
        if compiled:
            compile_in_parallel(
                unit, fly_block, *arguments, take, whole=COMPILING_ONE if len(lanes) == 1 else COMPILING_MANY
            )
        take = unit.address if compiled else unit.python
    fly: Any = fly_block if compiled else cast(Any, fly_block).py_func
    fly(*arguments, take)


def truths_of(
    flight: Flight, seed: int, first: int, lanes: int, ensemble: Ensemble | None, instead: Instead
) -> Sequence[Truth]:
    """Truth of each lane's vehicle, wind and sensors. InputError as `Ensemble.truths`."""
    truths: Sequence[Truth] = [believed(flight)] * lanes
    if instead.branches is not None:
        truths = instead.branches.truths
    elif ensemble is not None:
        truths = ensemble.truths(seed, first, lanes)
    if instead.faults is not None:
        truths = [truth._replace(fault=fault) for truth, fault in zip(truths, instead.faults, strict=True)]
    return truths


def fly_written(
    flight: Flight, seed: int, first: int = 0, lanes: tuple[int, ...] = ONE_LANE, ensemble: Ensemble | None = None,
    faults: Sequence[SensorFault] | None = None, branches: Branches | None = None,
) -> Flown:  # fmt: skip
    """A block of `len(lanes)` flights from number `first` on, with everything that the navigator was fed and wrote."""
    buffers = buffers_of(flight, lanes, flight.plan.epochs, written=True)
    with announce_compilation("single-flight" if len(lanes) == 1 else "batch"):
        fly_into(flight, seed, first, lanes, buffers, ensemble, Instead(branches, faults))
    return Flown(buffers.history, buffers.tape, buffers.fed, learnt_in(buffers.work, lanes))


def learnt_in(work: Array, lanes: tuple[int, ...]) -> list[tuple[Learnt, LoopGains]]:
    """Result of learning in each lane of a block that was flown, and the gains that it ended with."""
    rows = work.reshape(-1, len(lanes))
    learnt, gains = (
        rows[first : first + len(record._fields)]
        for first, record in ((layout.LEARNT, Learnt), (layout.LOOP_GAINS, LoopGains))
    )
    return [
        (Learnt(*map(float, learnt[:, lane])), LoopGains(*map(float, gains[:, lane]))) for lane in range(len(lanes))
    ]


def fly_one(flight: Flight, seed: int, index: int = 0, ensemble: Ensemble | None = None) -> Array:
    """The history of flight `index` of a campaign, (epochs, len(HISTORY), 1): the same bytes as in any batch."""
    buffers = buffers_of(flight, ONE_LANE, flight.plan.epochs, written=False)
    with announce_compilation("single-flight"):
        fly_into(flight, seed, index, ONE_LANE, buffers, ensemble)
    return buffers.history


def fly_blocks(
    flight: Flight, seed: int, first: int, flights: int, judge: Callable[[Array], Result], threads: int | None = None,
    ensemble: Ensemble | None = None, instead: Callable[[int], Instead] = lambda start: NOTHING_ELSE,
) -> Iterator[tuple[int, Result]]:  # fmt: skip
    """Fly `flights` flights from number `first` on; yields (flights in the block, judge(its history)) in order.

    `judge` takes a block's history (epochs, len(HISTORY), flights in the block), which is overwritten afterwards:
    memory does not grow with the number of flights. instead: of a place in the order of flights, what the `len(LANES)`
    flights from there on meet; branches count their streams from `first`.
    """
    own = threading.local()

    def fly(start: int) -> tuple[int, Result]:
        if not hasattr(own, "buffers"):
            own.buffers = buffers_of(flight, LANES, flight.plan.epochs, written=False)
        met = instead(start)
        number = first if met.branches is not None else first + start
        fly_into(flight, seed, number, LANES, own.buffers, ensemble, met)
        left = min(len(LANES), flights - start)
        return left, judge(own.buffers.history[:, :, :left])

    with announce_compilation("batch"):
        nothing = flight._replace(plan=flight.plan._replace(epochs=0))
        fly_into(nothing, seed, first, LANES, buffers_of(nothing, LANES, 0, written=False))
    count = threads or os.cpu_count() or 1
    with ThreadPoolExecutor(count) as pool:
        try:
            yield from in_order(pool, fly, range(0, flights, len(LANES)), BLOCKS_AHEAD * count)
        except BaseException:  # Ctrl-C drops what has not begun
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def in_order(
    pool: ThreadPoolExecutor, do: Callable[[int], Result], each: Iterable[int], ahead: int
) -> Iterator[Result]:
    """Results of `do` for each, in order; at most `ahead` are under way before the first is taken."""
    waiting: deque[Future[Result]] = deque()
    for one in each:
        waiting.append(pool.submit(do, one))
        if len(waiting) >= ahead:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()
