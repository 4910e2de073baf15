"""Detection of a wrong heading by two witnesses that do not use the compass and contradict it alike.

The flow's velocity by the filter's own heading, and what the accelerometer integrates to by it, are both turned against
GPS velocity and its changes by the heading's error. Where both show the same large angle, the compass is wrong: it is
no longer used, and the heading is sought from the course. Where only the flow shows it, the flow's axes may be wrong,
and nothing is done.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation, exp, replacing, smaller
from flownav.core.frames import within_half_turn
from flownav.estimation.named import Attitude
from flownav.estimation.states import ACCEL_BIAS, ATTITUDE
from flownav.navigation import calls
from flownav.navigation.course import LEAST_TRAVEL_M, is_velocity, judge_course, turn_between, turn_heading, with_gps
from flownav.navigation.motion_records import CourseMemory, PushMemory
from flownav.navigation.records import HeadingMemory, Reading
from flownav.navigation.tape import COMPASS_REFUTED
from flownav.navigation.verdicts import Event, Force, Reset, on_lanes

# Chosen together: a compass 90 deg wrong is refuted at each of 36 headings within 3.5 m, a sound one at none of three
# (replays/test_unknown_heading.py). Alone, only LARGE_RAD has been varied.
BLOCK_S = 0.8  # a push of 1 m/s2 makes 0.8 m/s in it, GPS velocity errs by 0.4 (gps_velocity_white_m_s)
LARGE_RAD = 0.8  # 46 deg; at 0.5 plausible compasses, 30 deg off, were refuted in simulated flights (make validate)
ALIKE_RAD = 0.6  # between the two witnesses: 34 deg
LEAST_PUSH_M_S = 0.6  # root sum square of the changes; the difference of two GPS velocities has 0.57 of noise
LEAST_LIKENESS = 0.6  # not measured
FADING_S = 20.0  # not measured
ONCE_MORE_M = 1.0  # of travel determines the heading again: within 8 deg in the same test
FREED_TILT_RAD = 0.1  # what a compass that pulled may have done; not measured
FREED_ACCEL_M_S2 = 0.5  # not measured

with_push = replacing(PushMemory, "push_n", "push_e")
with_sums = replacing(CourseMemory, "along", "across", "gps", "flow")
dismissed = replacing(HeadingMemory, "refuted", "sought")


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
    """The sums of the course, with less weight on older ones."""
    kept = exp(-smaller(t_s - m.gps_s, FADING_S) / FADING_S)
    return with_sums(m, along=kept * m.along, across=kept * m.across, gps=kept * m.gps, flow=kept * m.flow)


@equation
def judge_push(m: PushMemory) -> tuple[bool, float]:
    """Whether the accelerometer shows an error of the heading, and how large: true less own [rad]."""
    likeness, error_rad = turn_between(m.along, m.across, m.gps * m.own)
    return m.gps >= LEAST_PUSH_M_S * LEAST_PUSH_M_S and likeness >= LEAST_LIKENESS, error_rad


@equation
def refuted(course: CourseMemory, push: PushMemory) -> tuple[bool, float]:
    """Whether both witnesses show that the heading is wrong by a large angle, and the angle by the flow [rad]."""
    flow_knows, by_flow = judge_course(course)
    own_knows, by_own = judge_push(push)
    apart = within_half_turn(by_flow - by_own)
    return flow_knows and own_knows and abs(by_flow) > LARGE_RAD and abs(apart) < ALIKE_RAD, by_flow


# -- on lanes -----------------------------------------------------------------------------------------------
@on_lanes(calls.note_push)
def note_push(force: Force, m: PushMemory, *, dt_s: float) -> PushMemory:
    """The block's memory with the velocity that the step just made adds, by the filter's own heading."""
    return with_push(m, push_n=m.push_n + dt_s * force.north_m_s2, push_e=m.push_e + dt_s * force.east_m_s2)


class CompassVerdict(NamedTuple):
    """Verdict of the two witnesses on the compass, with the resets that free heading and states where it is refuted."""

    course: CourseMemory
    push: PushMemory
    heading: HeadingMemory
    attitude: Attitude
    freed: tuple[Reset, Reset, Reset, Reset, Reset]
    refuted: Event


@on_lanes(calls.check_compass)
def check_compass(
    reading: Reading, heading: HeadingMemory, own: Attitude, course: CourseMemory, push: PushMemory, *, t_s: float
) -> CompassVerdict:
    """At a GPS velocity: where both witnesses refute the compass, the heading is turned and the compass dismissed.

    What was summed up while the compass pulled is not exact: the heading is sought once more, over ONCE_MORE_M.
    """
    counts = is_velocity(reading) and heading.refuted == 0.0
    followed = with_gps(reading, t_s, faded(t_s, course))
    pushed = with_change(reading, t_s, push)
    refutes, error_rad = refuted(followed, pushed)
    wrong = counts and refutes
    begun = CourseMemory(0.0, 0.0, 0.0, 0.0, LEAST_TRAVEL_M - ONCE_MORE_M, t_s, -np.inf, 0.0, 0.0)
    turned, turned_reset = turn_heading(own, error_rad, wrong)
    return CompassVerdict(
        begun if wrong else (followed if counts else course),
        pushed if counts else push,
        dismissed(heading, refuted=1.0 if wrong else heading.refuted, sought=1.0 if wrong else heading.sought),
        turned,
        (
            turned_reset,
            Reset(ATTITUDE if wrong else -1, np.nan, FREED_TILT_RAD * FREED_TILT_RAD),
            Reset(ACCEL_BIAS if wrong else -1, 0.0, FREED_ACCEL_M_S2 * FREED_ACCEL_M_S2),
            Reset(ATTITUDE + 1 if wrong else -1, np.nan, FREED_TILT_RAD * FREED_TILT_RAD),
            Reset(ACCEL_BIAS + 1 if wrong else -1, 0.0, FREED_ACCEL_M_S2 * FREED_ACCEL_M_S2),
        ),
        Event(COMPASS_REFUTED if wrong else -1, error_rad),
    )
