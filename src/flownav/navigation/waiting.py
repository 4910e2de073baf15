"""Readings that wait until everything of their instant must be here, on rings of fixed size: for a link and on board.

Inertial readings lie in a ring by themselves, in the order of their instants. They stay there when they have been fed,
as far as there is room: for the turning over a flow reading's exposure, and for the way from the filter's instant to
now (`now`), from both of which a `spikes` judge of its own keeps spikes out. Of other sensors' readings each lies in
a table until it is due; attitudes are kept, too, for the flow's turning where no inertial unit serves.

The buffer is flat: records (`RINGS`), then the ring, the table and the attitudes, whose sizes the first record states.
"""

import numpy as np

from flownav.core.compile import ONE_LANE, Layout, Work, equation, lane_access, procedure, replacing, row_of
from flownav.core.measurement import Array
from flownav.navigation.motion_records import ImuMemory, SpikeMemory
from flownav.navigation.records import Reading
from flownav.navigation.spikes import judge_spike
from flownav.navigation.waiting_records import (
    AS_IS,
    ATTITUDE,
    IMU,
    Arrival,
    Inertial,
    Kept,
    OwnGyro,
    Queue,
    Sizes,
    StatedAttitude,
    Stored,
    arrived,
    order_of,
    stored,
)

TAKEN, LATE, OVERFLOW, NOT_FINITE = 0, 1, 2, 3  # what becomes of a reading that is to wait
NOTHING_DUE, FROM_RING = -1, -2  # places of the table are counted from 0


RINGS = Layout()
RINGS.keep(Sizes)
RINGS.keep(Queue)
RINGS.keep(Kept)
RINGS.keep(SpikeMemory)
RINGS.keep(OwnGyro)
FIRST_ROW = RINGS.next
load_sizes, store_sizes = RINGS.access(Sizes)
load_queue, store_queue = RINGS.access(Queue)
_load_kept, _store_kept = RINGS.access(Kept)
_load_spike, _store_spike = RINGS.access(SpikeMemory)
load_own_gyro, store_own_gyro = RINGS.access(OwnGyro)
load_inertial, _store_inertial = lane_access(Inertial, None)
_load_stored, _store_stored = lane_access(Stored, None)
load_stated_attitude, _store_stated_attitude = lane_access(StatedAttitude, None)
INERTIAL, STORED, ATTITUDE_FIELDS = len(Inertial._fields), len(Stored._fields), len(StatedAttitude._fields)
NO_MEMORY, NOTHING_KEPT, NO_SPIKE, NO_GYRO = ImuMemory(), Kept(), SpikeMemory(), OwnGyro()

with_ring = replacing(Queue, "first", "count", "fed", "order")
with_fed = replacing(Queue, "fed")
with_table = replacing(Queue, "table", "order")
with_attitudes = replacing(Queue, "attitude_first", "attitudes")
with_released = replacing(Queue, "released_s")
with_newest = replacing(Queue, "newest_s")
_with_kept = replacing(ImuMemory, *Kept._fields)


def rows_of(sizes: Sizes) -> int:
    """How many numbers the rings take."""
    return FIRST_ROW + int(sizes.ring * INERTIAL + sizes.table * STORED + sizes.attitudes * ATTITUDE_FIELDS)


def new_rings(sizes: Sizes) -> Array:
    """Rings in which nothing waits."""
    fresh = np.zeros((rows_of(sizes), 1))
    RINGS.put_fresh(fresh)
    rings = fresh.ravel()
    rings[: len(Sizes._fields)] = sizes
    return rings


@procedure
def empty(r: Work) -> None:
    """Forget all readings; instants before the newest that was fed stay gone."""
    q = load_queue(r, ONE_LANE, 0)
    store_queue(r, ONE_LANE, 0, Queue(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, q.order, q.released_s, -np.inf))
    _forget_witness(r)
    store_own_gyro(r, ONE_LANE, 0, NO_GYRO)


@equation
def _forget_witness(r: Work) -> None:
    """The judge of spikes has seen nothing."""
    _store_kept(r, ONE_LANE, 0, NOTHING_KEPT)
    _store_spike(r, ONE_LANE, 0, NO_SPIKE)


# -- where rows begin ---------------------------------------------------------------------------------------
@equation
def ring_row(s: Sizes, first: float, place: int) -> int:
    """The row of the inertial reading that is `place` after the first."""
    at = int(first) + place
    around = int(s.ring)
    return FIRST_ROW + (at - around if at >= around else at) * INERTIAL


@equation
def table_row(s: Sizes, place: int) -> int:
    """The row of a reading of the table."""
    return FIRST_ROW + int(s.ring) * INERTIAL + place * STORED


@equation
def attitude_row(s: Sizes, first: float, place: int) -> int:
    """The row of the attitude that is `place` after the first."""
    at = int(first) + place
    around = int(s.attitudes)
    begin = FIRST_ROW + int(s.ring) * INERTIAL + int(s.table) * STORED
    return begin + (at - around if at >= around else at) * ATTITUDE_FIELDS


# -- in -----------------------------------------------------------------------------------------------------
@procedure
def wait(r: Work, a: Arrival) -> int:
    """Let a reading wait; TAKEN, or why not. Its order is counted here."""
    s, q = load_sizes(r, ONE_LANE, 0), load_queue(r, ONE_LANE, 0)
    if not np.isfinite(a.t_s):
        return NOT_FINITE
    if a.t_s < q.released_s:
        return LATE
    waiting = q.count - q.fed + q.table
    if waiting >= s.most:
        return OVERFLOW
    order = q.order + 1.0
    if a.sensor == IMU and a.withheld == AS_IS and _follows(r, s, q, a.t_s):
        return _join_ring(r, s, q, a, order)
    if q.table >= s.table:
        return OVERFLOW
    _store_stored(r, ONE_LANE, table_row(s, int(q.table)), 0, stored(a, order))
    q = with_table(q, table=q.table + 1.0, order=order)
    if a.sensor == ATTITUDE and s.attitudes > 0.0:
        q = _keep_attitude(r, s, q, a)
    store_queue(r, ONE_LANE, 0, q)
    return TAKEN


@equation
def _follows(r: Work, s: Sizes, q: Queue, t_s: float) -> bool:
    """Whether an inertial reading is the newest of the ring."""
    return q.count == 0.0 or t_s > row_of(r, ONE_LANE, ring_row(s, q.first, int(q.count) - 1), 0)


@equation
def _join_ring(r: Work, s: Sizes, q: Queue, a: Arrival, order: float) -> int:
    """At the ring's end, in place of its first where that was fed."""
    full = q.count >= s.ring
    if full and q.fed == 0.0:
        return OVERFLOW
    after = q.first + 1.0
    first = (0.0 if after >= s.ring else after) if full else q.first
    left = 1.0 if full else 0.0
    signed = -order if _is_spike(r, a) else order
    store = Inertial(a.t_s, signed, a.value_0, a.value_1, a.value_2, a.value_3, a.value_4, a.value_5)
    _store_inertial(r, ONE_LANE, ring_row(s, first, int(q.count - left)), 0, store)
    store_queue(r, ONE_LANE, 0, with_ring(q, first=first, count=q.count - left + 1.0, fed=q.fed - left, order=order))
    return TAKEN


@equation
def _is_spike(r: Work, a: Arrival) -> bool:
    """Whether an inertial reading is a spike after those before it; the first is none."""
    unstated = np.nan
    reading = Reading(
        a.value_0, a.value_1, a.value_2, a.value_3, a.value_4, a.value_5, unstated, unstated, unstated, 255.0, 1.0, 0.0
    )
    kept, spike = _load_kept(r, ONE_LANE, 0), False
    if np.isfinite(kept.read_s):
        m = _with_kept(
            NO_MEMORY, read_s=kept.read_s, gyro_x=kept.gyro_x, gyro_y=kept.gyro_y, gyro_z=kept.gyro_z,
            accel_x=kept.accel_x, accel_y=kept.accel_y, accel_z=kept.accel_z,
        )  # fmt: skip
        spike, after = judge_spike(reading, a.t_s - kept.read_s, m, _load_spike(r, ONE_LANE, 0))
        _store_spike(r, ONE_LANE, 0, after)
    if not spike:
        now = Kept(a.t_s, a.value_0, a.value_1, a.value_2, a.value_3, a.value_4, a.value_5)
        _store_kept(r, ONE_LANE, 0, now)
    return spike


@equation
def _keep_attitude(r: Work, s: Sizes, q: Queue, a: Arrival) -> Queue:
    """The newest attitude in place of the oldest."""
    last = attitude_row(s, q.attitude_first, int(q.attitudes) - 1)
    if q.attitudes > 0.0 and not a.t_s > row_of(r, ONE_LANE, last, 0):
        return q
    full = q.attitudes >= s.attitudes
    after = q.attitude_first + 1.0
    first = (0.0 if after >= s.attitudes else after) if full else q.attitude_first
    count = q.attitudes if full else q.attitudes + 1.0
    attitude = StatedAttitude(a.t_s, a.value_0, a.value_1, a.value_2, a.value_3)
    _store_stated_attitude(r, ONE_LANE, attitude_row(s, first, int(count) - 1), 0, attitude)
    return with_attitudes(q, attitude_first=first, attitudes=count)


# -- out ----------------------------------------------------------------------------------------------------
@procedure
def due(r: Work, until_s: float) -> int:
    """Where the next reading of an instant up to `until_s` lies; NOTHING_DUE where none does.

    Of one instant, who arrived first comes first.
    """
    s, q = load_sizes(r, ONE_LANE, 0), load_queue(r, ONE_LANE, 0)
    best_s, best_order, best = until_s, np.inf, NOTHING_DUE
    if q.fed < q.count:
        one = load_inertial(r, ONE_LANE, ring_row(s, q.first, int(q.fed)), 0)
        if one.t_s <= until_s:
            best_s, best_order, best = one.t_s, abs(one.order), FROM_RING
    for place in range(int(q.table)):
        row = table_row(s, place)
        t_s, order = row_of(r, ONE_LANE, row, 0), order_of(row_of(r, ONE_LANE, row + 1, 0))
        if t_s < best_s or (t_s == best_s and order < best_order):
            best_s, best_order, best = t_s, order, place
    return best


@procedure
def taken_out(r: Work, place: int) -> Arrival:
    """The reading that lies at a place of `due`; it waits no more."""
    s, q = load_sizes(r, ONE_LANE, 0), load_queue(r, ONE_LANE, 0)
    unstated = np.nan
    if place == FROM_RING:
        m = load_inertial(r, ONE_LANE, ring_row(s, q.first, int(q.fed)), 0)
        store_queue(r, ONE_LANE, 0, with_fed(q, fed=q.fed + 1.0))
        return Arrival(
            m.t_s, abs(m.order), IMU, m.gyro_x, m.gyro_y, m.gyro_z, m.accel_x, m.accel_y, m.accel_z,
            unstated, unstated, unstated, 255.0, m.t_s, 0.0, AS_IS,
        )  # fmt: skip
    row = table_row(s, place)
    a = _load_stored(r, ONE_LANE, row, 0)
    last = int(q.table) - 1
    if place != last:
        _store_stored(r, ONE_LANE, row, 0, _load_stored(r, ONE_LANE, table_row(s, last), 0))
    store_queue(r, ONE_LANE, 0, with_table(q, table=q.table - 1.0, order=q.order))
    return arrived(a)


@procedure
def take_back(r: Work, since_s: float) -> int:
    """Inertial readings of instants from since_s on were of a sensor that errs; how many of them still waited."""
    s, q = load_sizes(r, ONE_LANE, 0), load_queue(r, ONE_LANE, 0)
    kept = int(q.count)
    while kept > 0 and row_of(r, ONE_LANE, ring_row(s, q.first, kept - 1), 0) >= since_s:
        kept -= 1
    back, left = int(q.count) - max(kept, int(q.fed)), int(q.table)
    for place in range(left - 1, -1, -1):
        row = table_row(s, place)
        a = arrived(_load_stored(r, ONE_LANE, row, 0))
        if a.sensor == IMU and a.t_s >= since_s:
            left, back = left - 1, back + 1
            _store_stored(r, ONE_LANE, row, 0, _load_stored(r, ONE_LANE, table_row(s, left), 0))
    fewer = with_ring(q, first=q.first, count=float(kept), fed=float(min(int(q.fed), kept)), order=q.order)
    store_queue(r, ONE_LANE, 0, with_table(fewer, table=float(left), order=q.order))
    _forget_witness(r)  # it has seen what is later than what comes now
    return back


@procedure
def note_released(r: Work, until_s: float, newest_s: float, more: bool) -> None:
    """Up to where readings were fed: everything up to until_s, or, where more is due, up to the newest that was fed."""
    q = load_queue(r, ONE_LANE, 0)
    reached_s = newest_s if more else until_s
    if reached_s > q.released_s:
        store_queue(r, ONE_LANE, 0, with_released(q, released_s=reached_s))
