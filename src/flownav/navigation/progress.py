"""A navigator on board beyond its filter: its settings, its progress, its beginning, and the instant that it gives to a
reading.

Waiting readings stand in `waiting`, and `onboard` processes them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import ONE_LANE, Layout, Work, equation, procedure, replacing
from flownav.core.measurement import Array, Sensor
from flownav.estimation.states import HYPOTHESES
from flownav.navigation import waiting, waiting_records
from flownav.navigation.kernel_settings import Equipment
from flownav.navigation.memory import OWN_FILTER, WORK_ROWS, new_work
from flownav.navigation.packed import START_SIGMA, load_equipment
from flownav.navigation.waiting import load_queue, store_queue, wait
from flownav.navigation.waiting_records import Arrival

# what is returned of a reading, and of the state of now
TAKEN, LATE, OVERFLOW, NOT_FINITE = waiting.TAKEN, waiting.LATE, waiting.OVERFLOW, waiting.NOT_FINITE
NOT_BELIEVED, BEGUN_ANEW, NO_SENSOR = 4, 5, 6
STATE_GIVEN, NOT_STARTED, BEHIND, STALE = 0, 1, 2, 3
STATUSES = {
    "TAKEN": (TAKEN, "it was fed, or waits until everything of its instant must be here"),
    "LATE": (LATE, "readings of later instants were fed already: it was dropped"),
    "OVERFLOW": (OVERFLOW, "too many wait: it was dropped"),
    "NOT_FINITE": (NOT_FINITE, "its time is no number: it was dropped"),
    "NOT_BELIEVED": (NOT_BELIEVED, "its time leaps, which no other reading has confirmed: it was dropped"),
    "BEGUN_ANEW": (BEGUN_ANEW, "the clock leapt too far: the navigator began anew with this reading"),
    "NO_SENSOR": (NO_SENSOR, "there is no sensor of this number: it was dropped"),
}
NOW_STATUSES = {
    "TOLD": (STATE_GIVEN, "the state is that of this instant"),
    "NOT_STARTED": (NOT_STARTED, "the filter waits for an attitude and a fix, or for its deadline"),
    "BEHIND": (BEHIND, "the filter is on its way through a gap: ask again after the next readings"),
    "STALE": (STALE, "the filter's instant is more than 2 s before this one, or after it"),
}
LEAP_S = 0.5  # a time so much later than any before is believed when CONFIRMATIONS readings agree on it: chosen
CONFIRMATIONS = 3.0  # as `logs.mavlink.clock` has it
LONGEST_AHEAD_S = 2.0  # chosen: twice the longest horizon, within the inertial readings that are kept
NOT_BY_WAIT = np.nan  # a deadline that the equipment states itself
# parts of a reading's way
IDLE, ADVANCING, TAKING, LEAVING, CLOSING = 0.0, 1.0, 2.0, 3.0, 4.0


class Pace(NamedTuple):
    """Settings of a navigator on board beyond those of its filter: how far behind the newest reading an instant is when
    it is fed [s]; a leap of time that is not believed at once [s]; one after which the navigator begins anew [s]; how
    long it waits for a fix from its first reading on [s], NaN where the equipment's deadline states it. protects: 1, or
    0 for one that follows no faults and keeps no protection levels, which changes nothing of its state.
    """

    horizon_s: float = 0.27
    leap_s: float = LEAP_S
    anew_s: float = 10.0
    start_wait_s: float = 10.0
    protects: float = 1.0


class Progress(NamedTuple):
    """How far the reading at hand has come: its part, instant and sensor; steps that are left to its instant, and how
    long each is [s]. leaps: how many readings in a row agree on a time that leaps,
    and the newest of them [s]. deadline_s: until when it waits for a fix. ended: of a window of standing (`still`).
    """

    part: float = IDLE
    t_s: float = 0.0
    sensor: float = 0.0
    steps: float = 0.0
    step_s: float = 0.0
    leaps: float = 0.0
    leap_s: float = 0.0
    deadline_s: float = np.nan
    ended: float = 0.0


BOARD = Layout(OWN_FILTER)  # where `parts.equations` has another filter's rows
BOARD.keep(Progress)
load_progress, store_progress = BOARD.access(Progress)
BOARD_ROWS = BOARD.next
assert BOARD_ROWS <= WORK_ROWS
PACE = START_SIGMA + 36  # packed settings, and then a `Pace`
with_part = replacing(Progress, "part")
with_ended = replacing(Progress, "part", "ended")
with_steps = replacing(Progress, "steps")
with_leaps = replacing(Progress, "leaps", "leap_s")
with_deadline = replacing(Progress, "deadline_s")
with_withheld = replacing(Arrival, "withheld")
waiting_until = replacing(Equipment, "deadline_s")


def fresh_rows() -> tuple[NDArray[np.uint16], NDArray[np.uint8], Array]:
    """The rows of a new navigator that are not 0, which of the distinct values each has, and these values, bit by bit:
    in numbers as short as a small board likes.
    """
    work = new_work(ONE_LANE)[:BOARD_ROWS].reshape(-1, 1)
    BOARD.put_fresh(work)
    rows = np.flatnonzero(work[:, 0] != 0.0)
    bits, kinds = np.unique(np.ascontiguousarray(work[rows, 0]).view(np.uint64), return_inverse=True)
    return rows.astype(np.uint16), kinds.astype(np.uint8), bits.view(np.float64)


FRESH_ROWS, FRESH_KINDS, FRESH_VALUES = fresh_rows()


# -- the beginning ------------------------------------------------------------------------------------------
@procedure
def begin_anew(work: Work, r: Work, p: Work) -> None:
    """Begin a new navigator, with rings in which nothing waits."""
    for i in range(BOARD_ROWS):
        work[i] = 0.0
    for i in range(len(FRESH_ROWS)):
        work[FRESH_ROWS[i]] = FRESH_VALUES[FRESH_KINDS[i]]
    if load_pace(p).protects == 0.0:
        work[HYPOTHESES] = 0.0
    waiting.empty(r)
    q = load_queue(r, ONE_LANE, 0)
    store_queue(r, ONE_LANE, 0, waiting.with_released(q, released_s=-np.inf))


@equation
def load_pace(p: Work) -> Pace:
    """The pace, behind the packed settings."""
    return Pace(p[PACE], p[PACE + 1], p[PACE + 2], p[PACE + 3], p[PACE + 4])


# -- a reading's time ---------------------------------------------------------------------------------------
@procedure
def believe(work: Work, r: Work, p: Work, t_s: float) -> int:
    """Whether a reading's time can be: TAKEN, NOT_BELIEVED, or BEGUN_ANEW where several in a row have leapt too far."""
    pace, m, q = load_pace(p), load_progress(work, ONE_LANE, 0), load_queue(r, ONE_LANE, 0)
    if not np.isfinite(q.newest_s) or (t_s - q.newest_s <= pace.leap_s and q.newest_s - t_s <= pace.anew_s):
        if m.leaps > 0.0:
            store_progress(work, ONE_LANE, 0, with_leaps(m, leaps=0.0, leap_s=0.0))
        return TAKEN
    agrees = m.leaps > 0.0 and abs(t_s - m.leap_s) <= pace.leap_s
    leaps = m.leaps + 1.0 if agrees else 1.0
    if leaps < CONFIRMATIONS:
        store_progress(work, ONE_LANE, 0, with_leaps(m, leaps=leaps, leap_s=t_s))
        return NOT_BELIEVED
    if abs(t_s - q.newest_s) > pace.anew_s:
        begin_anew(work, r, p)
        return BEGUN_ANEW
    store_progress(work, ONE_LANE, 0, with_leaps(m, leaps=0.0, leap_s=0.0))
    return TAKEN


@procedure
def hear(work: Work, r: Work, p: Work, a: Arrival) -> int:
    """A reading arrives: its status."""
    if not np.isfinite(a.t_s):
        return NOT_FINITE
    if not (a.sensor >= 1.0 and a.sensor <= MOST_SENSOR):
        return NO_SENSOR
    believed = believe(work, r, p, a.t_s)
    if believed == NOT_BELIEVED:
        return believed
    m = load_progress(work, ONE_LANE, 0)
    if np.isnan(m.deadline_s):
        wait_s, stated_s = load_pace(p).start_wait_s, load_equipment(p).deadline_s
        by_wait = np.isfinite(stated_s) and np.isfinite(wait_s)
        store_progress(work, ONE_LANE, 0, with_deadline(m, deadline_s=a.t_s + wait_s if by_wait else stated_s))
    known = a.withheld == waiting_records.WITHHELD or a.withheld == waiting_records.SILENT
    status = wait(r, with_withheld(a, withheld=a.withheld if known else waiting_records.AS_IS))
    if status == TAKEN:
        q = load_queue(r, ONE_LANE, 0)
        if a.t_s > q.newest_s or not np.isfinite(q.newest_s):
            store_queue(r, ONE_LANE, 0, waiting.with_newest(q, newest_s=a.t_s))
    return believed if status == TAKEN else status


MOST_SENSOR = float(max(Sensor))
