"""The whole live path behind a C interface: readings wait, are fed when they are due, and the state of now is returned.

A call does a bounded amount of work. A reading's way through the navigator is done in parts (`take`), as many in a call
as its budget has room for; what is left is done in the next. Nothing raises: a status is returned. What is fed, and in
which order, does not hang on how the work is spread, so the bits are those of `take.navigate`.
"""

from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import (
    ONE_LANE,
    Lanes,
    Work,
    bits_from_float,
    equation,
    float_from_bits,
    procedure,
    unit,
)
from flownav.core.measurement import Sensor
from flownav.estimation.covariance import lagged, with_lag
from flownav.estimation.states import COVARIANCE, SCRATCH
from flownav.navigation.memory import (
    CLOCK,
    OWN_FILTER,
    shared,
    store_reading,
)
from flownav.navigation.now import tell_now
from flownav.navigation.offers import too_old
from flownav.navigation.packed import load_equipment
from flownav.navigation.progress import (
    ADVANCING,
    BEHIND,
    CLOSING,
    IDLE,
    LEAVING,
    LONGEST_AHEAD_S,
    NOT_STARTED,
    STALE,
    STATE_GIVEN,
    TAKEN,
    TAKING,
    Progress,
    begin_anew,
    hear,
    load_pace,
    load_progress,
    store_progress,
    waiting_until,
    with_ended,
    with_part,
    with_steps,
)
from flownav.navigation.records import Reading
from flownav.navigation.start import runs
from flownav.navigation.still import close_window, hold_stand, is_hold_due
from flownav.navigation.take import arrive, give_up, go_on, receive, step_once, steps_to, take
from flownav.navigation.tape import Output
from flownav.navigation.turning import next_reading
from flownav.navigation.waiting import NOTHING_DUE, due, load_queue, note_released, store_queue
from flownav.navigation.waiting_records import SILENT, WITHHELD, Queue, arrival_of

Value = TypeVar("Value")
STEPS_A_CALL = 4.0  # of 0.1 s through a gap
# What a part costs at most, in thousands of instructions of a Cortex-M7 (docs/explanation/onboard.md, tests/export/
# test_onboard_budgets.py); a call begins a part only where all that it has done so far and this part are within BUDGET,
# or it has done nothing.
BUDGET = 145.0
COST_OF_STEP, COST_OF_ARRIVING, COST_OF_LEAVING = 17.0, 11.0, 4.0
COST_OF_HOLDING, COST_OF_CLOSING = 70.0, 120.0
COST_OF_TAKING = np.zeros(max(Sensor) + 1)
for _sensor, _cost in (
    (Sensor.GPS_POSITION, 100.0), (Sensor.GPS_VELOCITY, 120.0), (Sensor.FLOW_RATE, 70.0), (Sensor.FLOW_VELOCITY, 70.0),
    (Sensor.RANGE, 45.0), (Sensor.BARO, 45.0), (Sensor.ATTITUDE, 115.0), (Sensor.MAG, 60.0), (Sensor.YAW, 60.0),
    (Sensor.POSE, 130.0), (Sensor.PAD, 130.0), (Sensor.LANDED, 130.0),
):  # fmt: skip
    COST_OF_TAKING[_sensor] = _cost


# -- a reading's way ----------------------------------------------------------------------------------------
@procedure
def do_parts(work: Work, lanes: Lanes, r: Work, p: Work, o: Output) -> int:
    """As many parts of the ways of due readings as the budget has room for; how many parts were done."""
    until_s = load_queue(r, ONE_LANE, 0).newest_s - load_pace(p).horizon_s
    spent, done = 0.0, 0
    while True:
        m = load_progress(work, ONE_LANE, 0)
        if m.part == IDLE:
            if spent > 0.0 and spent + COST_OF_ARRIVING > BUDGET:
                return done
            place = due(r, until_s)
            if place == NOTHING_DUE:
                note_released(r, until_s, until_s, False)
                return done
            begin_reading(work, lanes, r, p, o, place, until_s)
            m = load_progress(work, ONE_LANE, 0)
        cost = cost_of(work, m)
        if spent > 0.0 and spent + cost > BUDGET:
            return done
        spent += cost
        do_part(work, lanes, m, p, o)
        done += 1


@procedure
def begin_reading(work: Work, lanes: Lanes, r: Work, p: Work, o: Output, place: int, until_s: float) -> None:
    """The reading at a place becomes that at hand; it is passed over where its sensor repeats an instant."""
    a = next_reading(r, p, place)
    note_released(r, until_s, a.t_s, due(r, until_s) != NOTHING_DUE)
    store_reading(
        work, ONE_LANE, 0,
        Reading(
            a.value_0, a.value_1, a.value_2, a.value_3, a.value_4, a.value_5, a.variance_0, a.variance_1, a.variance_2,
            a.quality, 0.0 if a.withheld == SILENT else 1.0, 1.0 if a.withheld == WITHHELD else 0.0,
        ),
    )  # fmt: skip
    m, sensor = load_progress(work, ONE_LANE, 0), int(a.sensor)
    if too_old(work, lanes, a.t_s, sensor, o):
        return
    fitted = waiting_until(load_equipment(p), deadline_s=m.deadline_s)
    receive(work, lanes, a.t_s, sensor, fitted, p, o)
    steps, step_s = steps_to(work, lanes, a.t_s) if runs(work, lanes) else (0, 0.0)
    store_progress(
        work, ONE_LANE, 0,
        Progress(ADVANCING, a.t_s, a.sensor, float(steps), step_s, m.leaps, m.leap_s, m.deadline_s, 0.0),
    )  # fmt: skip


@equation
def cost_of(work: Work, m: Progress) -> float:
    """Cost of the next part, in units of the call's budget."""
    if m.part == ADVANCING:
        return COST_OF_STEP * min(m.steps, STEPS_A_CALL) + COST_OF_ARRIVING
    if m.part == TAKING:
        cost: float = COST_OF_TAKING[int(m.sensor)]
        return cost
    if m.part == CLOSING:
        return COST_OF_CLOSING
    return COST_OF_HOLDING if m.sensor == IMU and is_hold_due(work, ONE_LANE, m.t_s) else COST_OF_LEAVING


IMU = float(Sensor.IMU)


@equation
def do_part(work: Work, lanes: Lanes, m: Progress, p: Work, o: Output) -> None:
    """The next part of the reading at hand."""
    if m.part == ADVANCING:
        come_closer(work, lanes, m, p, o)
    elif m.part == TAKING:
        fitted = waiting_until(load_equipment(p), deadline_s=m.deadline_s)
        take(work, lanes, m.t_s, int(m.sensor), fitted, p, o)
        store_progress(work, ONE_LANE, 0, with_part(m, part=LEAVING))
    elif m.part == LEAVING:
        ended = hold_stand(work, lanes, m.t_s, p, o) if m.sensor == IMU else 0.0
        if ended > 0.0:
            store_progress(work, ONE_LANE, 0, with_ended(m, part=CLOSING, ended=ended))
        else:
            go_away(work, lanes, m, p, o)
    elif m.part == CLOSING:
        close_window(work, lanes, m.ended, m.t_s, p, o)
        go_away(work, lanes, m, p, o)


@procedure
def come_closer(work: Work, lanes: Lanes, m: Progress, p: Work, o: Output) -> None:
    """Some steps of the filter towards the reading's instant; there, the reading arrives."""
    left = m.steps
    for _ in range(int(min(left, STEPS_A_CALL))):
        step_once(work, lanes, lagged(lanes), m.step_s, p, o)
        left -= 1.0
    if left > 0.0:
        store_progress(work, ONE_LANE, 0, with_steps(m, steps=left))
        return
    if m.steps > 0.0:
        give_up(work, lanes, o)
    fitted = waiting_until(load_equipment(p), deadline_s=m.deadline_s)
    arrive(work, lanes, m.t_s, int(m.sensor), fitted, p, o)
    store_progress(work, ONE_LANE, 0, with_part(m, part=TAKING))


@procedure
def go_away(work: Work, lanes: Lanes, m: Progress, p: Work, o: Output) -> None:
    """Do the work that follows a reading; then the next may come."""
    go_on(work, lanes, m.t_s, p, o)
    store_progress(work, ONE_LANE, 0, with_part(m, part=IDLE))


# -- the digest ---------------------------------------------------------------------------------------------
MIXED = np.uint64(0x9E3779B97F4A7C15)  # 2^64 over the golden ratio
HALF = np.uint64(32)
NAN_BITS = np.uint64(0x7FF8000000000000)


@equation
def mixed(found: np.uint64, value: float) -> np.uint64:
    """One number more; NaN is one value, whatever its bits."""
    bits = bits_from_float(value) if value == value else NAN_BITS
    both = (found ^ bits) * MIXED
    return both ^ (both >> HALF)


@procedure
def digest_of(work: Work) -> float:
    """64 bits over the whole memory of a navigator, as the bits of a float; not over its scratch."""
    found = MIXED
    for i in range(SCRATCH):
        found = mixed(found, work[i])
    for i in range(COVARIANCE, OWN_FILTER):
        found = mixed(found, work[i])
    return float_from_bits(found)


# -- units --------------------------------------------------------------------------------------------------
class OutcomeHead(NamedTuple, Generic[Value]):
    """Outcome of a call. status: of the reading (`STATUSES`). parts: how many parts of readings' ways were done; 0:
    there is nothing to do. waiting: how many readings wait or are under way. innovations, events: how many rows follow.
    """

    status: Value
    parts: Value
    waiting: Value
    innovations: Value
    events: Value


NOTHING_WAITS = Queue()
# rows that an outcome has room for: of two readings in a call, and of what happens meanwhile
MOST_INNOVATIONS, MOST_EVENTS = 12, 8
ROOM = (0, MOST_INNOVATIONS, MOST_EVENTS, 0, 0)


def begin_board(work: Work, rings: Work, p: Work) -> None:
    """Begin a new navigator. The rings' sizes stand in their first numbers; all else may be anything."""
    store_queue(rings, ONE_LANE, 0, NOTHING_WAITS)
    begin_anew(work, rings, p)


def take_board(
    work: Work, rings: Work, p: Work, at: Work, reading: Work, out: Work, innovation: Work, event: Work,
    room: NDArray[np.int64], used: NDArray[np.int64], lanes: Lanes,
) -> None:  # fmt: skip
    """A reading in, and a bounded amount of work. at: its time, when it arrived, and its sensor; 0: none, but work.

    reading: the numbers of `waiting_records.BoardReading`.
    """
    o = Output(out, innovation, event, out, out, out, room, used)
    status = TAKEN
    if at[1] != 0.0:
        status = hear(work, rings, p, arrival_of(at, reading))
    done = do_parts(work, lanes, rings, p, o)
    q = load_queue(rings, ONE_LANE, 0)
    out[0] = status
    out[1] = done
    unfinished = 0.0 if load_progress(work, ONE_LANE, 0).part == IDLE else 1.0
    out[2] = q.count - q.fed + q.table + unfinished
    out[3] = used[1]
    out[4] = used[4]


def tell_board(work: Work, rings: Work, p: Work, at: Work, out: Work) -> None:
    """The state of now: its status, and then the numbers of `now.NowRow`."""
    m, ahead_s = load_progress(work, ONE_LANE, 0), at[0] - shared(work, ONE_LANE, CLOCK)
    if not runs(work, ONE_LANE):
        out[0] = NOT_STARTED
    elif m.part == ADVANCING and m.steps > 0.0 and m.steps < steps_to(work, ONE_LANE, m.t_s)[0]:
        out[0] = BEHIND
    elif not (ahead_s >= 0.0 and ahead_s <= LONGEST_AHEAD_S):
        out[0] = STALE
    else:
        out[0] = STATE_GIVEN
        tell_now(work, rings, p, at[0], out)


def digest_board(work: Work, out: Work) -> None:
    """The digest, as the bits of a float."""
    out[0] = digest_of(work)


begin_unit = unit(begin_board, "p p p")
take_unit = unit(take_board, "p p p p p p p p q q", lanes=ONE_LANE)
take_unit_with_lag = unit(take_board, "p p p p p p p p q q", lanes=with_lag(ONE_LANE))
tell_unit = unit(tell_board, "p p p p p")
digest_unit = unit(digest_board, "p p")
