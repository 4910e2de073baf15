"""How far off the position may be, and which fault is suspected: levels over all that a sensor may do unseen.

The level of one hypothesis is what is left of the filter's own error, and what such a fault may have done: the effect
of one unit (`estimation.hypotheses`) times the size that innovations leave possible. The level is the largest of them.
After Brenner, Integrated GPS/Inertial Fault Detection Availability (Navigation 43(2), 1996), with effects that are
followed instead of one filter for each hypothesis. Unlike there no probability is promised:
docs/explanation/integrity.md measures how often the error is beyond the level.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.compile import Lanes, Work, equation, exp, larger, procedure, smaller
from flownav.estimation.covariance import covariance_of, states_of
from flownav.estimation.hypotheses import (
    COUNT,
    FLOW_AGE,
    FLOW_REVERSED,
    FLOW_SCALE,
    FLOW_SWAPPED,
    GPS_DRIFT,
    HEADING_OFF,
    RANGE_OFFSET,
    Size,
    begin_lane_anew,
    effect_of,
    fade,
    larger_axis,
    sign,
    sign_all,
    size_of,
)
from flownav.estimation.motion import rotation_of
from flownav.estimation.states import (
    HYPOTHESES,
    INFORMATION,
    POSITION,
    SCORE,
    STATE,
    VELOCITY,
)
from flownav.frames import to_body
from flownav.navigation.flow_noise import LONGEST_STEP_S
from flownav.navigation.memory import (
    DRIFT_SINCE,
    FLOW_BEFORE,
    FLOW_SPEED,
    GPS_MOVED,
    LEFT_OVER,
    LENS_RANGE,
    PROTECTION,
    PUZZLED_AT,
    SCALE_DOUBT,
    SUSPECTED,
    SUSPECTED_AT,
    TURNED_BEFORE,
    TURNING,
    held_by_gps,
    load_flow,
    of_lane,
    set_lane,
    share,
    shared,
)
from flownav.navigation.tape import FAULT_CLEARED, FAULT_SUSPECTED, Output, position_variance, write_event

SIGMAS = 4.0  # of the filter's own error, where nothing fails
SIGMAS_BESIDE = 2.0  # of it, beside a fault
SIZE_SIGMAS = 2.2  # of a fault's size
MEMORY_S = 20.0  # of what was told of faults
EXCLUDED = 8.0  # standard deviations from a fault that is there or is not
PUZZLING = 9.0  # evidence for a fault that is there or is not, after which it may be there for long
DRIFT_S = 20.0  # a drift of GPS is sought from the start of such a window
SUSPECT, CLEAR = 24.0, 5.0  # evidence that says so, and that says so no more
HELD_S = 10.0  # so long a suspicion lasts at least: what the fault did is still there


class Levels(NamedTuple):
    """Protection levels [m]."""

    horizontal_m: float
    vertical_m: float


@equation
def prior_sigma(fault: int) -> float:
    """What sizes such a fault has, in its unit."""
    if fault == FLOW_SCALE:
        return 0.3
    if fault == FLOW_AGE:
        return 0.05
    if fault == RANGE_OFFSET:
        return 0.1
    if fault <= HEADING_OFF:  # GPS drift [m/s], and heading [rad]
        return 0.2
    return 0.1 if fault < FLOW_SWAPPED else 1.0


@equation
def least_size(fault: int) -> float:
    """What is no fault yet."""
    return prior_sigma(fault) if fault < FLOW_SWAPPED else 0.5


# -- what a unit of each fault adds to a reading --------------------------------------------------------------
@procedure
def sign_flow(work: Work, lanes: Lanes, t_s: float, component: int, angular: bool) -> None:
    """Of a component of flow [rad/s] or of body velocity [m/s]: a share of it, the other channel, older motion.

    Of what the sensor itself reads: an angular rate still holds the vehicle's turning. That is taken from the reading
    before, so that the gyro's noise, which is in the innovation too, does not pass for a fault (an instrumental
    variable: Young, Recursive Estimation and Time-Series Analysis, 2011, chapter 6).
    """
    if work[HYPOTHESES * len(lanes)] == 0.0:
        return
    for lane in range(len(lanes)):
        u, v, _ = to_body(
            rotation_of(work, lanes, lane),
            work[(STATE + VELOCITY) * len(lanes) + lane],
            work[(STATE + VELOCITY + 1) * len(lanes) + lane],
            work[(STATE + VELOCITY + 2) * len(lanes) + lane],
        )
        range_m = work[LENS_RANGE * len(lanes) + lane]
        turning_x = work[TURNED_BEFORE * len(lanes) + lane]
        turning_y = work[(TURNED_BEFORE + 1) * len(lanes) + lane]
        read_x = turning_x - v / range_m if angular else u
        read_y = turning_y + u / range_m if angular else v
        own, other = (read_x, read_y) if component == 0 else (read_y, read_x)
        last = FLOW_BEFORE + min(component, 1)
        since_s = t_s - load_flow(work, lanes, lane).taken_s
        slope = (own - work[last * len(lanes) + lane]) / since_s
        lately = since_s > 0.0 and since_s < LONGEST_STEP_S
        level = component < 2 and np.isfinite(own + other)
        sign(work, lanes, FLOW_SCALE, lane, own if level else 0.0)
        sign(work, lanes, FLOW_SWAPPED, lane, other - own if level else 0.0, -1.0)
        sign(work, lanes, FLOW_REVERSED, lane, -2.0 * own if level else 0.0, -1.0)
        sign(work, lanes, FLOW_AGE, lane, -slope if level and lately else 0.0)
        work[last * len(lanes) + lane] = own if level else work[last * len(lanes) + lane]
        if component == 1:
            speed = np.sqrt(own * own + other * other) * (range_m if angular else 1.0)
            work[FLOW_SPEED * len(lanes) + lane] = speed if level else 0.0
            for i in range(2):
                turned = work[(TURNING + i) * len(lanes) + lane]
                work[(TURNED_BEFORE + i) * len(lanes) + lane] = turned if np.isfinite(turned) else 0.0


@equation
def size_in(work: Work, lanes: Lanes, fault: int, lane: int) -> Size:
    """What is known of a fault's size in a lane."""
    information, score = work[(INFORMATION + fault) * len(lanes) + lane], work[(SCORE + fault) * len(lanes) + lane]
    return size_of(information, score, prior_sigma(fault))


@equation
def largest_size(fault: int, found: Size) -> float:
    """What its innovations leave possible of a fault; one that is there or is not has a size of 1."""
    size = abs(found.size) + SIZE_SIGMAS * found.sigma
    return size if fault < FLOW_SWAPPED else smaller(size, 1.0)


@equation
def level_effect(work: Work, lanes: Lanes, fault: int, lane: int) -> float:
    """How far one unit of a fault has moved the position horizontally [m]."""
    north = effect_of(work, lanes, states_of(lanes), fault, POSITION, lane)
    east = effect_of(work, lanes, states_of(lanes), fault, POSITION + 1, lane)
    moved_m: float = np.sqrt(north * north + east * east)
    return moved_m


@equation
def leave_over(work: Work, lanes: Lanes, lane: int, fault: int) -> None:
    """What a fault may have done to the position, before it is sought anew: root sum square with what was."""
    done_m = level_effect(work, lanes, fault, lane) * largest_size(fault, size_in(work, lanes, fault, lane))
    before_m = of_lane(work, lanes, LEFT_OVER, lane)
    set_lane(work, lanes, LEFT_OVER, lane, np.sqrt(before_m * before_m + done_m * done_m))


@procedure
def sign_drift(work: Work, lanes: Lanes, t_s: float, axis: int) -> None:
    """Of an axis of a GPS position: the time since the drift began."""
    since_s = shared(work, lanes, DRIFT_SINCE)
    if t_s - since_s > DRIFT_S:
        share(work, lanes, DRIFT_SINCE, t_s)
        for i in range(3):
            for lane in range(len(lanes)):
                leave_over(work, lanes, lane, GPS_DRIFT + i)
                begin_lane_anew(work, lanes, states_of(lanes), GPS_DRIFT + i, lane)
    sign_all(work, lanes, GPS_DRIFT + axis, t_s - shared(work, lanes, DRIFT_SINCE))


# -- levels and suspicions --------------------------------------------------------------------------------------
@equation
def levels(work: Work, lanes: Lanes, lane: int) -> Levels:
    """The protection levels of a lane at its instant."""
    doubt = work[SCALE_DOUBT * len(lanes) + lane]
    north_m = doubt * work[(STATE + POSITION) * len(lanes) + lane]
    east_m = doubt * work[(STATE + POSITION + 1) * len(lanes) + lane]
    own_m = larger_axis(
        position_variance(work, lanes, 0, lane),
        position_variance(work, lanes, 1, lane),
        covariance_of(work, lanes, POSITION, POSITION + 1, lane) + north_m * east_m,
    )
    down_m = np.sqrt(larger(position_variance(work, lanes, 2, lane), 0.0))
    horizontal_m, vertical_m = SIGMAS * own_m, SIGMAS * down_m
    for k in range(int(work[HYPOTHESES * len(lanes)])):
        largest = largest_size(k, size_in(work, lanes, k, lane))
        down = effect_of(work, lanes, states_of(lanes), k, POSITION + 2, lane)
        horizontal_m = larger(horizontal_m, SIGMAS_BESIDE * own_m + level_effect(work, lanes, k, lane) * largest)
        vertical_m = larger(vertical_m, SIGMAS_BESIDE * down_m + abs(down) * largest)
    north_m, east_m = work[GPS_MOVED * len(lanes) + lane], work[(GPS_MOVED + 1) * len(lanes) + lane]
    moved_m = np.sqrt(north_m * north_m + east_m * east_m)
    left_m = SIGMAS_BESIDE * own_m + work[LEFT_OVER * len(lanes) + lane] + moved_m
    return Levels(larger(horizontal_m, left_m), vertical_m)


@procedure
def set_levels(work: Work, lanes: Lanes) -> None:
    """PROTECTION: the levels of every lane at this instant."""
    if work[HYPOTHESES * len(lanes)] == 0.0:
        return
    for lane in range(len(lanes)):
        found = levels(work, lanes, lane)
        set_lane(work, lanes, PROTECTION, lane, found.horizontal_m)
        set_lane(work, lanes, PROTECTION + 1, lane, found.vertical_m)


@equation
def exclude(work: Work, lanes: Lanes, lane: int, fault: int) -> None:
    """A fault that is there or is not, and that innovations exclude since the instant from which it was sought: it is
    sought from now on. What it may have done until it was excluded, had it begun in between, is remembered.
    """
    found = size_in(work, lanes, fault, lane)
    if 1.0 - found.size > EXCLUDED * found.sigma:
        leave_over(work, lanes, lane, fault)
        begin_lane_anew(work, lanes, states_of(lanes), fault, lane)


@procedure
def mind_faults(work: Work, lanes: Lanes, t_s: float, dt_s: float, o: Output) -> None:
    """Say which fault is suspected, and when none is any more; what was told of them fades."""
    if work[HYPOTHESES * len(lanes)] == 0.0:
        return
    kept = exp(-dt_s / MEMORY_S)
    fade(work, lanes, kept)
    for lane in range(len(lanes)):
        work[LEFT_OVER * len(lanes) + lane] *= kept
        worst, which, worst_flow = 0.0, 0, 0.0
        for k in range(int(work[HYPOTHESES * len(lanes)])):
            found = size_in(work, lanes, k, lane)
            evidence = found.evidence if abs(found.size) > least_size(k) else 0.0
            which = k if evidence > worst else which
            worst = larger(worst, evidence)
            worst_flow = larger(worst_flow, found.evidence if k >= FLOW_SWAPPED else 0.0)
        before = of_lane(work, lanes, SUSPECTED, lane)
        if before == 0.0 and worst > SUSPECT:
            set_lane(work, lanes, SUSPECTED, lane, which + 1.0)
            set_lane(work, lanes, SUSPECTED_AT, lane, t_s)
            write_event(lanes, lane, t_s, FAULT_SUSPECTED, which, o)
        elif before > 0.0 and worst < CLEAR and t_s - of_lane(work, lanes, SUSPECTED_AT, lane) > HELD_S:
            set_lane(work, lanes, SUSPECTED, lane, 0.0)
            write_event(lanes, lane, t_s, FAULT_CLEARED, before - 1.0, o)
        unheld = not held_by_gps(work, lanes, lane, t_s)
        if worst_flow > PUZZLING or (unheld and load_flow(work, lanes, lane).doubted > 0.0):
            set_lane(work, lanes, PUZZLED_AT, lane, t_s)
        if t_s - of_lane(work, lanes, PUZZLED_AT, lane) < HELD_S:
            work[LEFT_OVER * len(lanes) + lane] += 2.0 * dt_s * work[FLOW_SPEED * len(lanes) + lane]
        for k in range(FLOW_SWAPPED, int(work[HYPOTHESES * len(lanes)])):
            exclude(work, lanes, lane, k)


assert FLOW_REVERSED + 1 == COUNT
