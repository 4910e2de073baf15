"""A program's link with a navigator: readings as they are passed to it, and the rings on which they wait.

Waiting readings, due readings and the state of now are the work of `waiting`, `turning` and `now`, as on board; here
they are called from Python. A `Rings` is what a live session has; `export.onboard.board.Board` is the library whole,
with its navigator.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import ONE_LANE, Work, equation, kernel, pointer
from flownav.core.measurement import MAX_VALUES, Array, EventQueue
from flownav.navigation import waiting_records
from flownav.navigation.now import NOW_NUMBERS, NowRow, now_row, tell_now
from flownav.navigation.turning import next_reading
from flownav.navigation.waiting import (
    FIRST_ROW,
    INERTIAL,
    NOTHING_DUE,
    TAKEN,
    due,
    empty,
    load_queue,
    new_rings,
    note_released,
    take_back,
    taken_out,
    wait,
)
from flownav.navigation.waiting_records import SILENT, WITHHELD, Arrival, Queue, Sizes, arrival_of

ORDERS = 1 << 15  # more than wait at any time
NOT_GIVEN = (np.nan,) * 6


class Given(NamedTuple):
    """A reading as it is passed in: when it arrived, its sensor, the numbers of `waiting_records.BoardReading`."""

    t_s: float
    sensor: int
    numbers: Array


def numbers_of(
    value: Iterable[float], variance: Iterable[float] = (), quality: float = 255.0, delay_s: float = 0.0,
    exposure_s: float = 0.0, withheld: float = waiting_records.AS_IS,
) -> Array:  # fmt: skip
    """The numbers of a reading; what is not given is NaN."""
    values, variances = (*value, *NOT_GIVEN)[:6], (*variance, *NOT_GIVEN)[:3]
    return np.array((*values, *variances, quality, delay_s, exposure_s, withheld), np.float64)


def given_of(queue: EventQueue) -> Iterator[Given]:
    """The readings that a navigator was fed, as readings that arrive without delay, with the turning already found."""
    for k in range(len(queue.t_s)):
        withheld = queue.withheld[k] if queue.arrived[k] > 0.0 else SILENT
        numbers = numbers_of(queue.value[k], queue.variance[k], queue.quality[k], withheld=withheld)
        yield Given(float(queue.t_s[k]), int(queue.sensor[k]), numbers)


class Due(NamedTuple):
    """Readings that were due, in the order of their instants, and when each arrived."""

    queue: EventQueue
    arrival_s: Array


class Rings:
    """Readings that wait for their instant; inertial ones stay, for the turning over an exposure and the way to now.

    most: how many `release` gives at a time.
    """

    def __init__(self, sizes: Sizes, most: int) -> None:
        self.rings = new_rings(sizes)
        self._sizes = sizes
        self._at, self._arrival_s = np.zeros(2), np.zeros(ORDERS)
        self._room, self._order = empty_queue(most), np.zeros(most)
        self._now = np.zeros(NOW_NUMBERS)
        self._released_s = -np.inf  # up to when all is released that has been taken
        assert sizes.ring + sizes.table < ORDERS
        self.clear()

    def __len__(self) -> int:
        """How many wait."""
        q = self._queue
        return int(q.count - q.fed + q.table)

    @property
    def _queue(self) -> Queue:
        found: Queue = load_queue(self.rings, ONE_LANE, 0)
        return found

    def clear(self) -> None:
        """Forget all; instants before the newest that was released stay gone."""
        empty(self.rings)
        self._released_s = -np.inf

    def take(self, given: Given) -> int:
        """Let a reading wait: TAKEN, or why not (`waiting`)."""
        self._at[:] = given.t_s, given.sensor
        self._released_s = -np.inf
        status = int(_take(self.rings, self._at, given.numbers))
        if status == TAKEN:
            self._arrival_s[int(self._queue.order) % ORDERS] = given.t_s
        return status

    def take_back(self, since_s: float) -> int:
        """Inertial readings from an instant on were of a sensor that errs; how many of them still waited."""
        self._released_s = -np.inf
        return int(_take_back(self.rings, since_s))

    def waiting(self) -> EventQueue:
        """The waiting readings as they were read; they stay on the rings."""
        queue = empty_queue(len(self))
        _release(self.rings.copy(), np.zeros(0), np.inf, True, queue, np.zeros(len(self)))
        return queue

    def release(self, settings: Array, until_s: float) -> Due:
        """Readings of instants up to until_s, flow with the turning over its exposure; they hold until the next call.

        settings: packed, of the navigator that takes them.
        """
        nothing_new = until_s <= self._released_s
        count = 0 if nothing_new else _release(self.rings, settings, until_s, False, self._room, self._order)
        if count < len(self._order):
            self._released_s = max(self._released_s, until_s)
        arrival_s = self._arrival_s[self._order[:count].astype(int) % ORDERS]
        return Due(EventQueue._make(column[:count] for column in self._room), arrival_s)

    def now(self, work: Array, settings: Array, t_s: float) -> NowRow[Array]:
        """The state of a navigator's work, carried on to an instant."""
        _fill_now(work, self.rings, settings, t_s, self._now)
        row: NowRow[Array] = now_row(self._now.copy())
        return row

    def inertial(self) -> Array:
        """The inertial readings that are here and no spikes, (n, 7): time, gyro, specific force; in order."""
        ring, q = self._ring, self._queue
        rows = ring[(int(q.first) + np.arange(int(q.count))) % len(ring)]
        return np.delete(rows[rows[:, 1] > 0.0], 1, axis=1)

    @property
    def newest_inertial_s(self) -> float:
        """When the newest of these was taken; NaN where there is none."""
        ring, q = self._ring, self._queue
        places = ((int(q.first) + place) % len(ring) for place in reversed(range(int(q.count))))
        return next((float(ring[place, 0]) for place in places if ring[place, 1] > 0.0), np.nan)

    @property
    def _ring(self) -> Array:
        return self.rings[FIRST_ROW : FIRST_ROW + int(self._sizes.ring) * INERTIAL].reshape(-1, INERTIAL)


def empty_queue(count: int) -> EventQueue:
    """An empty queue with room for count readings."""
    return EventQueue(
        np.zeros(count), np.zeros(count, np.int64), np.full((count, MAX_VALUES), np.nan),
        np.full((count, MAX_VALUES), np.nan), np.zeros(count), np.arange(count), np.zeros(count), np.ones(count),
    )  # fmt: skip


# -- what is compiled -------------------------------------------------------------------------------------------
@kernel
def _take(rings: Array, at: Array, reading: Array) -> int:
    """A reading waits."""
    return wait(pointer(rings), arrival_of(pointer(at), pointer(reading)))


@kernel
def _take_back(rings: Array, since_s: float) -> int:
    """Inertial readings wait no more."""
    return take_back(pointer(rings), since_s)


@kernel
def _release(
    rings: Array, settings: Array, until_s: float, raw: bool, queue: EventQueue, order: NDArray[np.float64]
) -> int:
    """Move due readings, as far as there is room, into a queue; write their order of arrival, and return their number.
    raw: flow as it was read.
    """
    r, p = pointer(rings), pointer(settings)
    count, newest_s = 0, until_s
    place = due(r, until_s)
    while place != NOTHING_DUE and count < len(order):
        a = taken_out(r, place) if raw else next_reading(r, p, place)
        put_row(queue, count, a)
        order[count] = a.order
        newest_s = a.t_s
        count += 1
        place = due(r, until_s)
    note_released(r, until_s, newest_s, place != NOTHING_DUE)
    return count


@equation
def put_row(queue: EventQueue, k: int, a: Arrival) -> None:
    """A reading as a row of a queue."""
    queue.t_s[k], queue.sensor[k], queue.quality[k] = a.t_s, int(a.sensor), a.quality
    queue.value[k, 0], queue.value[k, 1], queue.value[k, 2] = a.value_0, a.value_1, a.value_2
    queue.value[k, 3], queue.value[k, 4], queue.value[k, 5] = a.value_3, a.value_4, a.value_5
    queue.variance[k, 0], queue.variance[k, 1], queue.variance[k, 2] = a.variance_0, a.variance_1, a.variance_2
    queue.withheld[k] = 1.0 if a.withheld == WITHHELD else 0.0
    queue.arrived[k] = 0.0 if a.withheld == SILENT else 1.0


@kernel
def _fill_now(work: Work, rings: Array, settings: Array, t_s: float, out: Array) -> None:
    """The state of now."""
    tell_now(pointer(work), pointer(rings), pointer(settings), t_s, pointer(out))
