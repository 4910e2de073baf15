"""How far off the position may be, and which fault is suspected: levels over all that a sensor may do unseen.

The level of one hypothesis is what is left of the filter's own error, and what such a fault may have done: the effect
of one unit (`estimation.hypotheses`) times the size that innovations leave possible. The level is the largest of them.
After Brenner, Integrated GPS/Inertial Fault Detection Availability (Navigation 43(2), 1996), with effects that are
followed instead of one filter for each hypothesis. Unlike there no probability is promised:
docs/explanation/integrity.md measures how often the error is beyond the level.
"""

import numpy as np

from flownav.core.compile import Lanes, Work, equation, exp, larger, procedure, replacing, row_of, smaller
from flownav.core.frames import angular_flow, to_body
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
    followed,
    larger_axis,
    sign,
    sign_all,
    size_told,
)
from flownav.estimation.motion import rotation_of
from flownav.estimation.named import PositionNed, VelocityNed
from flownav.estimation.states import POSITION
from flownav.navigation.flow_noise import LONGEST_STEP_S
from flownav.navigation.memory import (
    DRIFT_SINCE,
    MEMORY,
    SCALE_DOUBT,
    held_by_gps,
    load_flow,
    load_gps,
    load_look,
    load_sign,
    load_suspicion,
    share,
    shared,
    store_levels,
    store_sign,
    store_suspicion,
)
from flownav.navigation.records import FlowSignMemory, Levels, SuspicionMemory
from flownav.navigation.rows import position_variance
from flownav.navigation.tape import FAULT_CLEARED, FAULT_SUSPECTED, Output, write_event

# What these make together is measured (make integrity, integrity.md), none of them alone: in 10125 flights with a fault
# 1.18 of 1000 steps lie above the level unsaid, the level is 4.9 errors in the median; no clean one of 1002 suspects.
OWN_ERROR_SIGMAS = 4.0  # of the filter's own error, where nothing fails: no step of the clean flights lies above
SIGMAS_BESIDE = 2.0  # of it, beside a fault
SIZE_SIGMAS = 2.2  # of a fault's size: 2.8 % of a normal one lies beyond
MEMORY_S = 20.0  # of what was told of faults
EXCLUDED_SIGMAS = 8.0  # from a fault that is there or is not; never excluded, its effect has no bound (test_protection)
PUZZLING_EVIDENCE = 9.0  # 3 sigma, for a fault that is there or is not, after which it may be there for long
DRIFT_S = 20.0  # a drift of GPS is sought from the start of such a window; one of a minute goes 1.15 m beyond the level
# evidence that says so (4.9 sigma), and that says so no more (2.2); at 0 none is cleared (test_protection_by_hand)
SUSPECT_EVIDENCE, CLEAR_EVIDENCE = 24.0, 5.0
load_position, _ = MEMORY.access(PositionNed)
load_velocity, _ = MEMORY.access(VelocityNed)
with_x, with_y = replacing(FlowSignMemory, "read_x"), replacing(FlowSignMemory, "read_y")
with_turning = replacing(FlowSignMemory, "turning_x", "turning_y", "speed_m_s")
with_left_over = replacing(SuspicionMemory, "left_over_m")

HELD_S = 10.0  # so long a suspicion lasts at least: what the fault did is still there; chosen, not measured


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
    """Effects of faults on a component of flow [rad/s] or body velocity [m/s]: a share, other channel, older motion.

    Of what the sensor itself reads: an angular rate still holds the vehicle's turning. That is taken from the reading
    before, so that the gyro's noise, which is in the innovation too, does not pass for a fault (an instrumental
    variable: Young, Recursive Estimation and Time-Series Analysis, 2011, chapter 6).
    """
    if followed(work, lanes) == 0:
        return
    for lane in range(len(lanes)):
        look, m = load_look(work, lanes, lane), load_sign(work, lanes, lane)
        own, other = read_by(seen_by(work, lanes, lane, look.range_m, m, angular), component)
        since_s = t_s - load_flow(work, lanes, lane).taken_s
        slope = (own - (m.read_x if component == 0 else m.read_y)) / since_s
        lately = since_s > 0.0 and since_s < LONGEST_STEP_S
        level = component < 2 and bool(np.isfinite(own + other))
        sign(work, lanes, FLOW_SCALE, lane, own if level else 0.0)
        sign(work, lanes, FLOW_SWAPPED, lane, other - own if level else 0.0, -1.0)
        sign(work, lanes, FLOW_REVERSED, lane, -2.0 * own if level else 0.0, -1.0)
        sign(work, lanes, FLOW_AGE, lane, -slope if level and lately else 0.0)
        m = with_x(m, read_x=own) if level and component == 0 else m
        m = with_y(m, read_y=own) if level and component != 0 else m
        per = look.range_m if angular else 1.0
        m = followed_sign(m, own, other, level, per, look.turning_x, look.turning_y) if component == 1 else m
        store_sign(work, lanes, lane, m)


@equation
def seen_by(
    work: Work, lanes: Lanes, lane: int, range_m: float, m: FlowSignMemory, angular: bool
) -> tuple[float, float]:
    """What the sensor's two channels are to read by the filter [rad/s or m/s]."""
    v = load_velocity(work, lanes, lane)
    u, v, _ = to_body(rotation_of(work, lanes, lane), v.vel_n, v.vel_e, v.vel_d)
    return angular_flow(u, v, m.turning_x, m.turning_y, range_m) if angular else (u, v)


@equation
def read_by(read: tuple[float, float], component: int) -> tuple[float, float]:
    """The component's own channel, and the other."""
    return (read[0], read[1]) if component == 0 else (read[1], read[0])


@equation
def followed_sign(
    m: FlowSignMemory, own: float, other: float, level: bool, range_m: float, turned_x: float, turned_y: float
) -> FlowSignMemory:
    """Speed and turning of the reading at hand, for the next."""
    speed = np.sqrt(own * own + other * other) * range_m
    return with_turning(
        m,
        turning_x=turned_x if np.isfinite(turned_x) else 0.0,
        turning_y=turned_y if np.isfinite(turned_y) else 0.0,
        speed_m_s=speed if level else 0.0,
    )


@equation
def size_in(work: Work, lanes: Lanes, fault: int, lane: int) -> Size:
    """What is known of a fault's size in a lane."""
    return size_told(work, lanes, fault, lane, prior_sigma(fault))


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
    m = load_suspicion(work, lanes, lane)
    left_m = np.sqrt(m.left_over_m * m.left_over_m + done_m * done_m)
    store_suspicion(work, lanes, lane, with_left_over(m, left_over_m=left_m))


@procedure
def sign_drift(work: Work, lanes: Lanes, t_s: float, axis: int) -> None:
    """Effect of a fault on an axis of a GPS position: the time since the drift began."""
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
    doubt, position = row_of(work, lanes, SCALE_DOUBT, lane), load_position(work, lanes, lane)
    north_m, east_m = doubt * position.pos_n, doubt * position.pos_e
    own_m = larger_axis(
        position_variance(work, lanes, 0, lane),
        position_variance(work, lanes, 1, lane),
        covariance_of(work, lanes, POSITION, POSITION + 1, lane) + north_m * east_m,
    )
    down_m = np.sqrt(larger(position_variance(work, lanes, 2, lane), 0.0))
    horizontal_m, vertical_m = OWN_ERROR_SIGMAS * own_m, OWN_ERROR_SIGMAS * down_m
    for k in range(followed(work, lanes)):
        largest = largest_size(k, size_in(work, lanes, k, lane))
        down = effect_of(work, lanes, states_of(lanes), k, POSITION + 2, lane)
        horizontal_m = larger(horizontal_m, SIGMAS_BESIDE * own_m + level_effect(work, lanes, k, lane) * largest)
        vertical_m = larger(vertical_m, SIGMAS_BESIDE * down_m + abs(down) * largest)
    gps = load_gps(work, lanes, lane)
    moved_m = np.sqrt(gps.moved_n_m * gps.moved_n_m + gps.moved_e_m * gps.moved_e_m)
    left_m = SIGMAS_BESIDE * own_m + load_suspicion(work, lanes, lane).left_over_m + moved_m
    return Levels(larger(horizontal_m, left_m), vertical_m)


@procedure
def set_levels(work: Work, lanes: Lanes) -> None:
    """The levels of every lane at this instant."""
    if followed(work, lanes) == 0:
        return
    for lane in range(len(lanes)):
        store_levels(work, lanes, lane, levels(work, lanes, lane))


@equation
def exclude(work: Work, lanes: Lanes, lane: int, fault: int) -> None:
    """A fault that is there or is not, and that innovations exclude since the instant from which it was sought: it is
    sought from now on. What it may have done until it was excluded, had it begun in between, is remembered.
    """
    found = size_in(work, lanes, fault, lane)
    if 1.0 - found.size > EXCLUDED_SIGMAS * found.sigma:
        leave_over(work, lanes, lane, fault)
        begin_lane_anew(work, lanes, states_of(lanes), fault, lane)


@equation
def judge_suspicion(
    m: SuspicionMemory, worst: float, which: int, puzzled: bool, travel_m: float, kept: float, t_s: float
) -> SuspicionMemory:
    """What is suspected, by the evidence of the worst fault; what was left over fades, and grows while flow puzzles."""
    suspects = m.suspected == 0.0 and worst > SUSPECT_EVIDENCE
    clears = m.suspected > 0.0 and worst < CLEAR_EVIDENCE and t_s - m.suspected_s > HELD_S
    puzzled_s = t_s if puzzled else m.puzzled_s
    left_over_m = m.left_over_m * kept
    return SuspicionMemory(
        which + 1.0 if suspects else (0.0 if clears else m.suspected),
        t_s if suspects else m.suspected_s,
        puzzled_s,
        left_over_m + travel_m if t_s - puzzled_s < HELD_S else left_over_m,
    )


@procedure
def mind_faults(work: Work, lanes: Lanes, t_s: float, dt_s: float, o: Output) -> None:
    """Say which fault is suspected, and when none is any more; what was told of them fades."""
    if followed(work, lanes) == 0:
        return
    kept = exp(-dt_s / MEMORY_S)
    fade(work, lanes, kept)
    for lane in range(len(lanes)):
        worst, which, worst_flow = 0.0, 0, 0.0
        for k in range(followed(work, lanes)):
            found = size_in(work, lanes, k, lane)
            evidence = found.evidence if abs(found.size) > least_size(k) else 0.0
            which = k if evidence > worst else which
            worst = larger(worst, evidence)
            worst_flow = larger(worst_flow, found.evidence if k >= FLOW_SWAPPED else 0.0)
        before = load_suspicion(work, lanes, lane)
        unheld = not held_by_gps(work, lanes, lane, t_s)
        puzzled = worst_flow > PUZZLING_EVIDENCE or (unheld and load_flow(work, lanes, lane).doubted > 0.0)
        speed_m_s = load_sign(work, lanes, lane).speed_m_s
        after = judge_suspicion(before, worst, which, puzzled, 2.0 * dt_s * speed_m_s, kept, t_s)
        store_suspicion(work, lanes, lane, after)
        if before.suspected == 0.0 and after.suspected > 0.0:
            write_event(lanes, lane, t_s, FAULT_SUSPECTED, which, o)
        elif before.suspected > 0.0 and after.suspected == 0.0:
            write_event(lanes, lane, t_s, FAULT_CLEARED, before.suspected - 1.0, o)
        for k in range(FLOW_SWAPPED, followed(work, lanes)):
            exclude(work, lanes, lane, k)


assert FLOW_REVERSED + 1 == COUNT
