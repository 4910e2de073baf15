"""A heading that is read and wrong: two witnesses that know nothing of it contradict it alike.

The flow's velocity by the filter's own heading, and what the accelerometer integrates to by it, are both turned against
GPS velocity and its changes by the heading's error. Where both say the same large angle, the compass is what errs: it
is no longer heard, and the heading is sought from the course. Where only the flow says so, its axes may be wrong, and
nothing is done.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, exp, procedure, smaller
from flownav.estimation.states import ACCEL_BIAS, ATTITUDE, FORCE, STATE
from flownav.frames import within_half_turn
from flownav.navigation.course import LEAST_TRAVEL_M, judge_course, turn_between, turn_heading, with_gps
from flownav.navigation.journal import reset_state
from flownav.navigation.memory import (
    COMPASS_OFF,
    PUSH,
    SOUGHT,
    load_course,
    load_push,
    load_reading,
    store_course,
    store_push,
)
from flownav.navigation.offers import is_heard
from flownav.navigation.records import CourseMemory, PushMemory, Reading
from flownav.navigation.tape import COMPASS_REFUTED, Output, write_event

BLOCK_S = 0.8  # over which a change of GPS velocity is more than its noise
LARGE_RAD = 0.8  # 46 degrees; less the deviation and the gate deal with, and less may be either witness
ALIKE_RAD = 0.6  # between the two witnesses
LEAST_PUSH_M_S = 0.6  # root sum square of the changes of velocity
LEAST_LIKENESS = 0.6
FADING_S = 20.0
ONCE_MORE_M = 1.0  # of travel tells the heading again, once the compass is not heard
FREED_TILT_RAD = 0.1
FREED_ACCEL_M_S2 = 0.5


@equation
def with_change(reading: Reading, t_s: float, m: PushMemory) -> PushMemory:
    """At a GPS velocity that ends a block: the sums with the change of velocity since it began."""
    v_n, v_e = reading.value_0, reading.value_1
    step_s = t_s - m.since_s
    begins = not step_s < 2.0 * BLOCK_S
    ends = step_s >= BLOCK_S and not begins
    kept = exp(-step_s / FADING_S) if ends else 1.0
    d_n, d_e = v_n - m.v_n, v_e - m.v_e
    weight = 1.0 if ends else 0.0
    anew = begins or ends
    return PushMemory(
        0.0 if anew else m.push_n, 0.0 if anew else m.push_e, v_n if anew else m.v_n, v_e if anew else m.v_e,
        t_s if anew else m.since_s,
        kept * m.along + weight * (d_n * m.push_n + d_e * m.push_e),
        kept * m.across + weight * (d_e * m.push_n - d_n * m.push_e),
        kept * m.gps + weight * (d_n * d_n + d_e * d_e),
        kept * m.own + weight * (m.push_n * m.push_n + m.push_e * m.push_e),
    )  # fmt: skip


@equation
def faded(t_s: float, m: CourseMemory) -> CourseMemory:
    """The sums of the course, of which what is long ago counts less."""
    kept = exp(-smaller(t_s - m.gps_s, FADING_S) / FADING_S)
    return CourseMemory(
        kept * m.along, kept * m.across, kept * m.gps, kept * m.flow, m.travel_m, m.gps_s, m.flow_s, m.north_m_s,
        m.east_m_s,
    )  # fmt: skip


@equation
def judge_push(m: PushMemory) -> tuple[bool, float]:
    """Whether the accelerometer says how the heading errs, and by how much: true less own [rad]."""
    likeness, error_rad = turn_between(m.along, m.across, m.gps * m.own)
    return m.gps >= LEAST_PUSH_M_S * LEAST_PUSH_M_S and likeness >= LEAST_LIKENESS, error_rad


@equation
def refuted(course: CourseMemory, push: PushMemory) -> tuple[bool, float]:
    """Whether both witnesses say that the heading is wrong by a large angle, and that by the flow [rad]."""
    flow_knows, by_flow = judge_course(course)
    own_knows, by_own = judge_push(push)
    apart = within_half_turn(by_flow - by_own)
    return flow_knows and own_knows and abs(by_flow) > LARGE_RAD and abs(apart) < ALIKE_RAD, by_flow


@procedure
def note_push(work: Work, lanes: Lanes, dt_s: float) -> None:
    """What the step that was just made adds to the velocity, by the filter's own heading."""
    for i in range(2):
        for lane in range(len(lanes)):
            work[(PUSH + i) * len(lanes) + lane] += dt_s * work[(FORCE + i) * len(lanes) + lane]


@procedure
def check_compass(work: Work, lanes: Lanes, t_s: float, o: Output) -> None:
    """At a GPS velocity: where both witnesses refute the compass, the heading is turned and the compass dismissed."""
    for lane in range(len(lanes)):
        reading = load_reading(work, lanes, lane)
        heard = is_heard(reading) and bool(np.isfinite(reading.value_0 + reading.value_1))
        if not heard or work[COMPASS_OFF * len(lanes) + lane] > 0.0:
            continue
        course = with_gps(reading, t_s, faded(t_s, load_course(work, lanes, lane)))
        push = with_change(reading, t_s, load_push(work, lanes, lane))
        store_course(work, lanes, lane, course)
        store_push(work, lanes, lane, push)
        wrong, error_rad = refuted(course, push)
        if wrong:
            turn_heading(work, lanes, lane, error_rad, o)
            for i in range(2):
                reset_state(work, lanes, lane, ATTITUDE + i, FREED_TILT_RAD * FREED_TILT_RAD, o)
                work[(STATE + ACCEL_BIAS + i) * len(lanes) + lane] = 0.0
                reset_state(work, lanes, lane, ACCEL_BIAS + i, FREED_ACCEL_M_S2 * FREED_ACCEL_M_S2, o)
            work[COMPASS_OFF * len(lanes) + lane] = 1.0
            work[SOUGHT * len(lanes) + lane] = 1.0  # what was summed up while the compass pulled is not exact
            store_course(
                work,
                lanes,
                lane,
                CourseMemory(0.0, 0.0, 0.0, 0.0, LEAST_TRAVEL_M - ONCE_MORE_M, t_s, -np.inf, 0.0, 0.0),
            )
            write_event(lanes, lane, t_s, COMPASS_REFUTED, error_rad, o)


assert PushMemory._fields[:2] == ("push_n", "push_e")
