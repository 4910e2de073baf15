"""A heading that no sensor reads, found from the course: the flow's velocity turned onto that of GPS.

As complex numbers, north + i east, the flow's velocity w by the filter's own heading and GPS velocity v differ by the
heading's error: v = w exp(i error). The sum of v conj(w) over the way has the error as its angle, whatever it is; a
Kalman filter, which takes errors for small, would lose itself where it is large. Until it is found nothing corrects the
heading (`take.consider_datum`), and the flow, by whose variance so large a doubt counts, gives little information.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import arctan2, cos, equation, replacing, sin
from flownav.core.frames import heading_cosine_sine, quaternion_product, turned_level, velocity_from_flow
from flownav.estimation.named import Attitude, rotation_by
from flownav.estimation.states import ATTITUDE
from flownav.navigation import calls
from flownav.navigation.motion_records import CourseMemory
from flownav.navigation.reasons import is_received
from flownav.navigation.records import HeadingMemory, Look, Reading
from flownav.navigation.tape import HEADING_FOUND
from flownav.navigation.verdicts import Event, Reset, on_lanes

# Chosen together: each of 36 headings is found within 3 m and 2 deg (replays/test_unknown_heading.py); none was varied.
LEAST_TRAVEL_M = 2.0  # all 36 were found after 2.1 m, within 1.1 deg
LEAST_SPEED_M_S = 0.3  # below it GPS velocity is mostly noise (gps_velocity_white_m_s 0.4)
LEAST_LIKENESS = 0.85  # not measured
LATEST_S = 0.25  # two periods of a PX4FLOW at 9.5 Hz; an older flow is of another motion
FOUND_RAD = 0.1  # 5.7 deg, where that test's worst is 1.1; not measured on real flow
SLOWLY_S = 0.3  # the flow's velocity is smoothed as a receiver smooths its own; not measured

with_sought = replacing(HeadingMemory, "sought")
with_velocity = replacing(CourseMemory, "flow_s", "north_m_s", "east_m_s")


@equation
def with_flow(north_m_s: float, east_m_s: float, t_s: float, m: CourseMemory) -> CourseMemory:
    """The flow's velocity by the filter's own heading, smoothed."""
    step_s = t_s - m.flow_s
    share = step_s / (SLOWLY_S + step_s) if step_s < 1.0 else 1.0
    return with_velocity(
        m,
        flow_s=t_s,
        north_m_s=m.north_m_s + share * (north_m_s - m.north_m_s),
        east_m_s=m.east_m_s + share * (east_m_s - m.east_m_s),
    )


@equation
def with_gps(reading: Reading, t_s: float, m: CourseMemory) -> CourseMemory:
    """The sums with one more GPS velocity, where the flow has measured the same motion."""
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
    """Whether the course shows an error of the heading, and how large: true less own [rad]."""
    likeness, error_rad = turn_between(m.along, m.across, m.gps * m.flow)
    return m.travel_m >= LEAST_TRAVEL_M and likeness >= LEAST_LIKENESS, error_rad


@equation
def is_velocity(reading: Reading) -> bool:
    """Whether a GPS velocity was received, with finite north and east components."""
    return is_received(reading) and bool(np.isfinite(reading.value_0 + reading.value_1))


@equation
def turn_heading(own: Attitude, by_rad: float, turns: bool) -> tuple[Attitude, Reset]:
    """The attitude with its heading turned, and that sure to FOUND_RAD; its correlations are lost."""
    turn = (cos(0.5 * by_rad), 0.0, 0.0, sin(0.5 * by_rad))
    w, x, y, z = quaternion_product(turn, (own.qw, own.qx, own.qy, own.qz))
    return (
        Attitude(w if turns else own.qw, x if turns else own.qx, y if turns else own.qy, z if turns else own.qz),
        Reset(ATTITUDE + 2 if turns else -1, np.nan, FOUND_RAD * FOUND_RAD),
    )


@on_lanes(calls.seeks)
def seeks(m: HeadingMemory) -> bool:
    """Whether a heading is sought in any lane."""
    return m.sought > 0.0


# -- on lanes -----------------------------------------------------------------------------------------------
@on_lanes(calls.note_flow_course)
def note_flow_course(
    reading: Reading, heading: HeadingMemory, look: Look, own: Attitude, m: CourseMemory, *, t_s: float,
    angular: bool, sought: bool,
) -> CourseMemory:  # fmt: skip
    """The flow's velocity by a reading whose turning and range are known. sought: only where a heading is."""
    x = reading.value_0 - (look.turning_x if angular else 0.0)
    y = reading.value_1 - (look.turning_y if angular else 0.0)
    u, v = velocity_from_flow(x, y, look.range_m) if angular else (x, y)
    cosine, sine = heading_cosine_sine(rotation_by(own))
    counts = (not sought or heading.sought > 0.0) and is_received(reading) and bool(np.isfinite(u + v))
    north, east = turned_level(u, v, cosine, sine)
    return with_flow(north, east, t_s, m) if counts else m


class FoundHeading(NamedTuple):
    """Result of the search for the heading in the course: memories, attitude, reset and event."""

    course: CourseMemory
    heading: HeadingMemory
    attitude: Attitude
    reset: Reset
    found: Event


@on_lanes(calls.find_heading)
def find_heading(
    reading: Reading, heading: HeadingMemory, own: Attitude, m: CourseMemory, *, t_s: float
) -> FoundHeading:
    """At a GPS velocity: where the course shows an error of the heading, the heading and the velocity are turned by
    it.
    """
    counts = heading.sought > 0.0 and is_velocity(reading)
    after = with_gps(reading, t_s, m)
    knows, error_rad = judge_course(after)
    found = counts and knows
    turned, reset = turn_heading(own, error_rad, found)
    return FoundHeading(
        after if counts else m,
        with_sought(heading, sought=0.0 if found else heading.sought),
        turned,
        reset,
        Event(HEADING_FOUND if found else -1, error_rad),
    )
