"""A heading that no sensor reads, found from the course: the flow's velocity turned onto that of GPS.

As complex numbers, north + i east, the flow's velocity w by the filter's own heading and GPS velocity v differ by the
heading's error: v = w exp(i error). The sum of v conj(w) over the way has the error as its angle, whatever it is;
a Kalman filter, which takes errors for small, would lose itself where it is large. Until it is found nothing corrects
the heading (`take.consider_datum`), and the flow, by whose variance so large a doubt counts, tells little.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, arctan2, cos, equation, procedure, sin
from flownav.estimation.motion import rotation_of
from flownav.estimation.states import ATTITUDE, QUATERNION
from flownav.frames import heading_cosine_sine, quaternion_product, velocity_from_flow
from flownav.navigation.journal import reset_state
from flownav.navigation.memory import LENS_RANGE, SOUGHT, TURNING, load_course, load_reading, store_course
from flownav.navigation.offers import is_heard
from flownav.navigation.records import CourseMemory, Reading
from flownav.navigation.tape import HEADING_FOUND, Output, write_event

LEAST_TRAVEL_M = 2.0
LEAST_SPEED_M_S = 0.3
LEAST_LIKENESS = 0.85
LATEST_S = 0.25  # a flow older than this is of another motion
FOUND_RAD = 0.1
SLOWLY_S = 0.3  # the flow's velocity is smoothed as a receiver smooths its own


@equation
def with_flow(north_m_s: float, east_m_s: float, t_s: float, m: CourseMemory) -> CourseMemory:
    """The flow's velocity by the filter's own heading, smoothed."""
    step_s = t_s - m.flow_s
    share = step_s / (SLOWLY_S + step_s) if step_s < 1.0 else 1.0
    return CourseMemory(
        m.along, m.across, m.gps, m.flow, m.travel_m, m.gps_s, t_s,
        m.north_m_s + share * (north_m_s - m.north_m_s), m.east_m_s + share * (east_m_s - m.east_m_s),
    )  # fmt: skip


@equation
def with_gps(reading: Reading, t_s: float, m: CourseMemory) -> CourseMemory:
    """The sums with one GPS velocity more, where the flow tells of the same motion."""
    v_n, v_e, w_n, w_e = reading.value_0, reading.value_1, m.north_m_s, m.east_m_s
    speed_m_s = np.sqrt(v_n * v_n + v_e * v_e)
    step_s = t_s - m.gps_s
    counts = t_s - m.flow_s <= LATEST_S and speed_m_s > LEAST_SPEED_M_S and step_s < 1.0
    weight = step_s if counts else 0.0
    return CourseMemory(
        m.along + weight * (v_n * w_n + v_e * w_e), m.across + weight * (v_e * w_n - v_n * w_e),
        m.gps + weight * speed_m_s * speed_m_s, m.flow + weight * (w_n * w_n + w_e * w_e),
        m.travel_m + weight * speed_m_s, t_s, m.flow_s, m.north_m_s, m.east_m_s,
    )  # fmt: skip


@equation
def turn_between(along: float, across: float, power: float) -> tuple[float, float]:
    """How alike two velocities are but for a turn (1: wholly), and that turn [rad], by the sums of v.w, v x w and the
    product of those of their squares.
    """
    likeness = np.sqrt((along * along + across * across) / power) if power > 0.0 else 0.0
    return likeness, arctan2(across, along)


@equation
def judge_course(m: CourseMemory) -> tuple[bool, float]:
    """Whether the way says how the heading errs, and by how much: true less own [rad]."""
    likeness, error_rad = turn_between(m.along, m.across, m.gps * m.flow)
    return m.travel_m >= LEAST_TRAVEL_M and likeness >= LEAST_LIKENESS, error_rad


@procedure
def note_flow_course(work: Work, lanes: Lanes, t_s: float, angular: bool, sought: bool) -> None:
    """The flow reading at hand, whose turning and range stand in their rows. sought: only where a heading is."""
    for lane in range(len(lanes)):
        if sought and work[SOUGHT * len(lanes) + lane] == 0.0:
            continue
        reading = load_reading(work, lanes, lane)
        range_m = work[LENS_RANGE * len(lanes) + lane]
        x = reading.value_0 - (work[TURNING * len(lanes) + lane] if angular else 0.0)
        y = reading.value_1 - (work[(TURNING + 1) * len(lanes) + lane] if angular else 0.0)
        u, v = velocity_from_flow(x, y, range_m) if angular else (x, y)
        rotation = rotation_of(work, lanes, lane)
        cosine, sine = heading_cosine_sine(rotation)
        if is_heard(reading) and np.isfinite(u + v):
            after = with_flow(cosine * u - sine * v, sine * u + cosine * v, t_s, load_course(work, lanes, lane))
            store_course(work, lanes, lane, after)


@procedure
def find_heading(work: Work, lanes: Lanes, t_s: float, o: Output) -> None:
    """At a GPS velocity: where the way says how the heading errs, the heading and the velocity are turned by it."""
    for lane in range(len(lanes)):
        reading = load_reading(work, lanes, lane)
        unknown = work[SOUGHT * len(lanes) + lane] > 0.0
        heard = is_heard(reading)
        if not unknown or not heard or not np.isfinite(reading.value_0 + reading.value_1):
            continue
        m = with_gps(reading, t_s, load_course(work, lanes, lane))
        store_course(work, lanes, lane, m)
        found, error_rad = judge_course(m)
        if found:
            turn_heading(work, lanes, lane, error_rad, o)
            work[SOUGHT * len(lanes) + lane] = 0.0
            write_event(lanes, lane, t_s, HEADING_FOUND, error_rad, o)


@procedure
def turn_heading(work: Work, lanes: Lanes, lane: int, by_rad: float, o: Output) -> None:
    """The heading of one lane turned, and sure to FOUND_RAD; what was correlated with it is not any more."""
    turn = (cos(0.5 * by_rad), 0.0, 0.0, sin(0.5 * by_rad))
    before = (
        work[QUATERNION * len(lanes) + lane], work[(QUATERNION + 1) * len(lanes) + lane],
        work[(QUATERNION + 2) * len(lanes) + lane], work[(QUATERNION + 3) * len(lanes) + lane],
    )  # fmt: skip
    after = quaternion_product(turn, before)
    for i in range(4):
        work[(QUATERNION + i) * len(lanes) + lane] = after[i]
    reset_state(work, lanes, lane, ATTITUDE + 2, FOUND_RAD * FOUND_RAD, o)
