"""A vehicle that stands: detected from the readings of its IMU, range, flow and GPS over a window, and the biases
learnt while it stands.

With its motors off an IMU is quieter than in any flight, and its gyro then reads nothing but its bias. With them
running it is not, but a vehicle whose range reads what it reads on the ground, and does not change, while the flow
shows no motion, has no velocity worth the name; nor does it turn much over the whole of the stand, so that the mean of
its gyro is the bias to within SLIP_RAD or SETTLE_RAD over its length, and what its shaking leaves in a mean. Nothing is
taught above the height of contact. Where a range gives no data any more, as some do on the ground, its last value
decides whether the ground is there.
"""

from typing import NamedTuple

from flownav.core.compile import Lanes, Work, equation, larger, procedure, smaller, squared
from flownav.estimation.covariance import consider_none
from flownav.estimation.laws.still import gyro_at_rest, velocity_itself
from flownav.estimation.states import ACCEL_BIAS, GYRO_BIAS, VELOCITY
from flownav.navigation import calls
from flownav.navigation.kernel_settings import PlaceSettings
from flownav.navigation.memory import HOLD_CLOCK, STILL_CLOCK, share, shared
from flownav.navigation.motion_records import ImuMemory, ImuWindow, SeenWindow, StandMemory
from flownav.navigation.offers import CLOCK_SLACK_S, fuse_offered, note_aid
from flownav.navigation.packed import load_place_settings
from flownav.navigation.reasons import FUSED, SILENT
from flownav.navigation.records import StartMemory
from flownav.navigation.tape import STOOD, Output
from flownav.navigation.usual import assume_usual
from flownav.navigation.verdicts import Anywhere, AxisBias, AxisVelocity, Doubt, Event, Offer, on_lanes
from flownav.navigation.vibration import DOUBT_M_S2, with_doubt
from flownav.navigation.windows import (
    MOVES,
    RESTING_GPS_M_S,
    RESTS,
    SHAKEN,
    STEADY_RANGE_M,
    contact_range,
    is_steady,
    judge_standing,
    open_windows,
    turning_of,
)

# Figures are of windows of half a second in the logs of ../shared/data; test_still holds each verdict at its limits.
WINDOW_S = 0.5  # chosen: what stands for 2 s is known within 2 s (test_hard_flights)
# A stand is held to be one so often: an accelerometer that rotors make read 3 m/s2 too much as they spin up is 0.8 m/s
# of velocity, and 0.2 m, in a window
HOLD_S = 0.1
# On the ground ranges read 0.02 (indoor-made), 0.05 (voxl) and 0.13 (outdoor); a hover at 0.3 m
# must teach no gyro (test_hard_flights).
NEAR_M = 0.15
SHAKEN_SIGMA_M_S, TOUCHING_SIGMA_M_S = 0.1, 0.03  # chosen; the first is the flow that passes for standing
SLIDING_SIGMA_M_S = 0.2  # of a vehicle that has the ground below it and slides: 0.1 to 0.3 m/s in made flights
GYRO_FLOOR_RAD_S = 3e-4  # chosen: 6 s of rest leave 0.0002 rad/s of bias (navigator.md)
# What a vehicle whose motors run turns over the whole of a stand: about down it slips as the rotors spin up (0.4 to 2.8
# deg in logs of small drones), and it settles on what carries it.
SLIP_RAD, SETTLE_RAD = 0.05, 0.02
# What one turns about down over the whole of a quiet stand: a helicopter whose rotor spools up turns by 0.2 deg/s on
# its skids, as quietly as one at rest (heli_sitl), and one such window is no bias of 0.2 deg/s
REST_RAD = 0.002
BELIEVED_SIGMAS = 2.0  # a bias that rest contradicts by more is opened: chosen, half a usual gate


# -- the end of a window, and on the way ---------------------------------------------------------------------
class Stand(NamedTuple):
    """State of motion of a vehicle with its event; any: whether it stands, in any lane."""

    stand: StandMemory
    event: Event
    any: bool


@on_lanes(calls.judge_stand)
def judge_stand(start: StartMemory, gyro: ImuWindow, seen: SeenWindow, m: StandMemory) -> Stand:
    """State of motion in the window, and the range where the vehicle rests."""
    does = judge_standing(gyro, seen, m.contact_m, m.last_m)
    lower = (
        does == SHAKEN
        and seen.range_high_m >= 0.0
        and seen.range_high_m < NEAR_M
        and not m.contact_m <= seen.range_high_m
    )
    touched = seen.range_high_m >= 0.0 and (does == RESTS or lower)
    news = start.started > 0.0 and (does > MOVES) != (m.does > MOVES)
    return Stand(
        StandMemory(
            does,
            seen.range_high_m if touched else m.contact_m,
            seen.range_high_m if seen.range_high_m >= 0.0 else m.last_m,
            m.windows + 1.0 if does == m.does else 1.0,
            1.0 if does > MOVES else 0.0,
            seen.gps_m_s,
        ),
        Event(STOOD if news else -1, does),
        does > MOVES or is_down(m, seen),
    )


@equation
def touches(m: StandMemory, seen: SeenWindow) -> bool:
    """Whether a vehicle whose motors run has the ground below it: its range is the lowest that was seen."""
    return m.does == SHAKEN and is_down(m, seen)


@equation
def contradicted(m: StandMemory, seen: SeenWindow) -> bool:
    """Whether the readings since the last window show that a vehicle which stood then does no longer."""
    ranged = seen.range_high_m >= 0.0
    return (
        ranged and (seen.range_high_m > contact_range(m.contact_m) or not is_steady(seen))
    ) or seen.gps_m_s >= RESTING_GPS_M_S


@equation
def is_down(m: StandMemory, seen: SeenWindow) -> bool:
    """Whether the ground is as near as it was when the vehicle stood on it, as far as ranges since the window show."""
    return seen.range_high_m >= 0.0 and seen.range_high_m <= m.contact_m + STEADY_RANGE_M


class Rest(NamedTuple):
    """A velocity of 0, the doubts before it is offered, and whether the accelerometer is doubted."""

    velocity: Doubt
    accel: tuple[Doubt, Doubt, Doubt]
    imu: ImuMemory
    offer: Offer


@on_lanes(calls.offer_rest)
def offer_rest(
    start: StartMemory, seen: SeenWindow, m: StandMemory, velocity: AxisVelocity, imu: ImuMemory, *, axis: int,
    s: PlaceSettings,
) -> Rest:  # fmt: skip
    """No velocity along an axis, for the next HOLD_S of a stand, and little of one that slides on the ground. A
    velocity that the gate would not allow of a vehicle that touches the ground is wrong, and so is the accelerometer
    that made it.
    """
    touching = touches(m, seen)
    level = axis < 2 and touching  # a range that is stuck in descent looks like standing
    least = TOUCHING_SIGMA_M_S if level else SHAKEN_SIGMA_M_S
    standing = m.does > MOVES and not contradicted(m, seen)
    sigma = (s.still_sigma_m_s if m.does == RESTS else least) if standing else SLIDING_SIGMA_M_S
    variance = sigma * sigma * (WINDOW_S / HOLD_S)
    stands = start.started > 0.0 and (standing or is_down(m, seen))
    square = velocity.speed_m_s * velocity.speed_m_s
    beyond = square > 0.5 * s.gate_sigma * s.gate_sigma * (velocity.variance + variance)
    freed = stands and (m.does == RESTS or touching or not standing) and beyond
    accel_m_s2 = abs(velocity.speed_m_s) / HOLD_S if freed else 0.0
    accel = squared(accel_m_s2)
    return Rest(
        Doubt(VELOCITY + axis, square if freed else 0.0),
        (Doubt(ACCEL_BIAS, accel), Doubt(ACCEL_BIAS + 1, accel), Doubt(ACCEL_BIAS + 2, accel)),
        with_doubt(imu, doubt_m_s2=larger(imu.doubt_m_s2, smaller(accel_m_s2, DOUBT_M_S2))),
        Offer(0.0, variance, FUSED if stands else SILENT),
    )


@equation
def stand_turning(windows: float, bound_rad: float) -> float:
    """The variance of a window's mean turning about its gyro's bias [(rad/s)^2], of a vehicle that has stood for that
    number of windows: what it turns over the whole stand is bounded, not what it turns in each window.

    A stand of n windows determines the rate to within the bound over its time T = n WINDOW_S, which is an information
    of T^2 / bound^2; a window's is what T^2 grew by.
    """
    rate = bound_rad / WINDOW_S
    return rate * rate / (2.0 * windows - 1.0)


class Learnt(NamedTuple):
    """A gyro's bias that is opened, and its offer."""

    opened: Doubt
    offer: Offer


@on_lanes(calls.offer_bias)
def offer_bias(
    start: StartMemory, gyro: ImuWindow, seen: SeenWindow, m: StandMemory, bias: AxisBias, *, axis: int
) -> Learnt:
    """The gyro's mean is its bias: of one whose motors run only where it touches the ground for certain.

    At rest nothing else turns a gyro: a bias that the gate would not let be it, is opened to it.
    """
    mean, square = turning_of(gyro, axis)
    resting = m.does == RESTS
    slip_rad, settle_rad = (REST_RAD, 0.0) if resting else (SLIP_RAD, SETTLE_RAD)
    least = GYRO_FLOOR_RAD_S * GYRO_FLOOR_RAD_S + stand_turning(m.windows, slip_rad if axis == 2 else settle_rad)
    teaches = start.started > 0.0 and (resting or touches(m, seen))
    variance = square / larger(gyro.readings, 1.0) + least
    off = squared(mean - bias.rad_s)
    beyond = off > squared(BELIEVED_SIGMAS) * (bias.variance + variance)
    return Learnt(
        Doubt(GYRO_BIAS + axis, off if teaches and resting and beyond else 0.0),
        Offer(mean, variance, FUSED if teaches else SILENT),
    )


@on_lanes(calls.stands_still)
def stands_still(start: StartMemory, seen: SeenWindow, m: StandMemory) -> Anywhere:
    """Whether any lane stood at the last window's end, or has the ground below it."""
    return Anywhere((m.does > MOVES or is_down(m, seen)) and start.started > 0.0)


@procedure
def stand_still(work: Work, lanes: Lanes, t_s: float, p: Work, o: Output) -> None:
    """At the end of a window, judge the state of motion and learn from it; within the window a stand is held to be
    one.
    """
    ended = hold_stand(work, lanes, t_s, p, o)
    if ended > 0.0:
        close_window(work, lanes, ended, t_s, p, o)


ENDED, ENDED_STANDING = 1.0, 2.0  # a window has ended, and in it the vehicle stood


@equation
def is_hold_due(work: Work, lanes: Lanes, t_s: float) -> bool:
    """Whether a stand is to be held to be one again."""
    return t_s - shared(work, lanes, HOLD_CLOCK) >= HOLD_S - CLOCK_SLACK_S


@procedure
def hold_stand(work: Work, lanes: Lanes, t_s: float, p: Work, o: Output) -> float:
    """A vehicle that stands has no velocity. Whether a window has ended: 0, ENDED or ENDED_STANDING, and it is to be
    closed.
    """
    if not is_hold_due(work, lanes, t_s):
        return 0.0
    share(work, lanes, HOLD_CLOCK, t_s)
    ends = t_s - shared(work, lanes, STILL_CLOCK) >= WINDOW_S - CLOCK_SLACK_S
    stands = judge_stand(work, lanes, t_s, o) if ends else stands_still(work, lanes)
    if stands:
        hold(work, lanes, t_s, load_place_settings(p), o)
    return (ENDED_STANDING if stands else ENDED) if ends else 0.0


@procedure
def close_window(work: Work, lanes: Lanes, ended: float, t_s: float, p: Work, o: Output) -> None:
    """Learn from a window that has ended; the next begins."""
    s = load_place_settings(p)
    if ended == ENDED_STANDING:
        learn_bias(work, lanes, s.gate_sigma, o)
    assume_usual(work, lanes, s.gate_sigma, o)
    share(work, lanes, STILL_CLOCK, t_s)
    open_windows(work, lanes)


@procedure
def hold(work: Work, lanes: Lanes, t_s: float, s: PlaceSettings, o: Output) -> None:
    """No velocity, which is an aid."""
    for axis in range(3):
        offer_rest(work, lanes, axis, s)
        velocity_itself(work, lanes, axis)
        fuse_offered(work, lanes, s.gate_sigma, o)
        if axis < 2:
            note_aid(work, lanes, t_s, o)


@procedure
def learn_bias(work: Work, lanes: Lanes, gate_sigma: float, o: Output) -> None:
    """The gyro's bias."""
    consider_none(work, lanes)
    for axis in range(3):
        offer_bias(work, lanes, axis)
        gyro_at_rest(work, lanes, axis)
        fuse_offered(work, lanes, gate_sigma, o)
