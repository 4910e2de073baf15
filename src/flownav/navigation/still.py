"""A vehicle that stands: found from what its IMU, range, flow and GPS read over a window, and what standing teaches.

With its motors off an IMU is quieter than in any flight, and its gyro then reads nothing but its bias. With them
running it is not, but a vehicle whose range reads what it reads on the ground, and does not change, while the flow
shows no motion, has no velocity worth the name; nor does it turn much, so that the mean of its gyro is the bias to
within SHAKEN_TURN_RAD_S and what its shaking leaves in a mean. Nothing is taught above the height of contact.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, larger, procedure, replacing, smaller, squared
from flownav.estimation.covariance import consider_none
from flownav.estimation.laws import component
from flownav.estimation.laws.still import gyro_at_rest, velocity_itself
from flownav.estimation.states import ACCEL_BIAS, VELOCITY
from flownav.navigation.inertial import sound
from flownav.navigation.memory import STILL_CLOCK, share, shared
from flownav.navigation.motion_records import ImuWindow, SeenWindow, StandMemory
from flownav.navigation.offers import fuse_offered
from flownav.navigation.packed import load_place_settings
from flownav.navigation.reasons import FUSED, SILENT, is_heard
from flownav.navigation.records import Look, Reading, StartMemory
from flownav.navigation.tape import STOOD, Output
from flownav.navigation.told import PlaceSettings
from flownav.navigation.verdicts import AxisVelocity, Doubt, Event, Offer, on_lanes

# Figures are of windows of half a second in the logs of ../shared/data; test_still holds each verdict at its limits.
WINDOW_S = 0.5  # chosen: what stands for 2 s is known within 2 s (test_hard_flights)
LEAST_READINGS = 5.0  # chosen: four are too few to know a spread
# Rms of all axes about the mean: at rest 0.002 and 0.02 at most (indoor-made, mocap), in flight 0.020 and 0.17 at least
# (outdoor-3). A simulated helicopter hovers as quietly as one at rest (heli_sitl): its range shows that it flies.
QUIET_GYRO_RAD_S, QUIET_ACCEL_M_S2 = 0.01, 0.12
RESTING_TURN_RAD_S = 0.04  # 2 deg/s: at rest gyros read 0.002 to 0.018 (indoor-made/f-dropouts)
STEADY_RANGE_M = 0.03  # at rest ranges span 0.01 m at most (indoor-made), in flight 0.03 to 0.05 in the median
# On the ground ranges read 0.02 (indoor-made), 0.05 (voxl) and 0.13 (outdoor); a hover at 0.3 m
# must teach no gyro (test_hard_flights).
NEAR_M = 0.15
CONTACT_M = 0.35  # on the ground, where none was seen yet: sonars say 0.30 to all that is nearer (mocap, outdoor-2)
RESTING_FLOW_M_S, SHAKEN_FLOW_M_S = 0.3, 0.1  # on the ground 0 (indoor-made), 0.03 (outdoor), 0.17 (outdoor-2) at most
RESTING_GPS_M_S = 1.0  # on the ground receivers say 0.2 (outdoor) to 0.7 m/s (outdoor-3) at most
SHAKEN_SIGMA_M_S, TOUCHING_SIGMA_M_S = 0.1, 0.03  # chosen; the first is the flow that passes for standing
GYRO_FLOOR_RAD_S = 3e-4  # chosen: 6 s of rest leave 0.0002 rad/s of bias (navigator.md)
SHAKEN_TURN_RAD_S = 0.003  # on skids that give, in gusts: not measured; GYRO_FLOOR in its place fails test_hard_flights
MOVES, SHAKEN, RESTS = 0.0, 1.0, 2.0  # what a vehicle does: it moves, stands with its motors on, or off
NO_READINGS, NOTHING_SEEN = ImuWindow(), SeenWindow()

with_span = replacing(SeenWindow, "range_low_m", "range_high_m")
with_flow = replacing(SeenWindow, "flow_u_m_s", "flow_v_m_s", "flows")
with_gps = replacing(SeenWindow, "gps_m_s")


# -- windows ------------------------------------------------------------------------------------------------
@equation
def with_imu(r: Reading, m: ImuWindow) -> ImuWindow:
    """Sums with one inertial reading more: of differences from the window's first, so that small ones are not lost."""
    new = m.readings == 0.0
    p0, q0, r0 = r.value_0 if new else m.first_p, r.value_1 if new else m.first_q, r.value_2 if new else m.first_r
    x0, y0, z0 = r.value_3 if new else m.first_x, r.value_4 if new else m.first_y, r.value_5 if new else m.first_z
    p, q, r_ = r.value_0 - p0, r.value_1 - q0, r.value_2 - r0
    x, y, z = r.value_3 - x0, r.value_4 - y0, r.value_5 - z0
    return ImuWindow(
        m.readings + 1.0, p0, q0, r0, x0, y0, z0, m.sum_p + p, m.sum_q + q, m.sum_r + r_,
        m.sum_x + x, m.sum_y + y, m.sum_z + z,
        m.square_p + p * p, m.square_q + q * q, m.square_r + r_ * r_, m.accel_square + x * x + y * y + z * z,
    )  # fmt: skip


@equation
def turning_of(m: ImuWindow, axis: int) -> tuple[float, float]:
    """Mean [rad/s] and variance [(rad/s)^2] of the turning about one body axis over a window."""
    n = larger(m.readings, 1.0)
    first = component((m.first_p, m.first_q, m.first_r), axis)
    mean = component((m.sum_p, m.sum_q, m.sum_r), axis) / n
    return first + mean, larger(component((m.square_p, m.square_q, m.square_r), axis) / n - mean * mean, 0.0)


@equation
def spreads(m: ImuWindow) -> tuple[float, float]:
    """Rms of the turning [rad/s] and of the specific force [m/s2] about their means over a window, all axes."""
    n = larger(m.readings, 1.0)
    gyro = turning_of(m, 0)[1] + turning_of(m, 1)[1] + turning_of(m, 2)[1]
    accel = m.accel_square / n - (squared(m.sum_x) + squared(m.sum_y) + squared(m.sum_z)) / (n * n)
    return np.sqrt(gyro), np.sqrt(larger(accel, 0.0))


@equation
def with_range(range_m: float, m: SeenWindow) -> SeenWindow:
    """The span of the ranges with one more."""
    return with_span(m, range_low_m=smaller(m.range_low_m, range_m), range_high_m=larger(m.range_high_m, range_m))


@equation
def judge_standing(gyro: ImuWindow, seen: SeenWindow, contact_m: float) -> float:
    """What a vehicle does that read this over a window: MOVES, SHAKEN, RESTS.

    contact_m: the range when it rested before; NaN where that is not known.
    """
    turning, shaking = spreads(gyro)
    turn = np.sqrt(squared(turning_of(gyro, 0)[0]) + squared(turning_of(gyro, 1)[0]) + squared(turning_of(gyro, 2)[0]))
    left = 3.0 * turning / np.sqrt(larger(gyro.readings, 1.0))  # of shaking in a mean, at most
    enough = gyro.readings >= LEAST_READINGS and turn < RESTING_TURN_RAD_S + left
    ranged = seen.range_high_m >= 0.0
    touching = seen.range_high_m <= larger(CONTACT_M, contact_m + STEADY_RANGE_M if np.isfinite(contact_m) else 0.0)
    steady = seen.range_high_m - seen.range_low_m <= STEADY_RANGE_M
    flows = larger(seen.flows, 1.0)
    flow_m_s = np.sqrt(squared(seen.flow_u_m_s) + squared(seen.flow_v_m_s)) / flows
    unmoved = seen.gps_m_s < RESTING_GPS_M_S
    quiet = turning < QUIET_GYRO_RAD_S and shaking < QUIET_ACCEL_M_S2
    rests = enough and quiet and unmoved and flow_m_s < RESTING_FLOW_M_S and ((touching and steady) or not ranged)
    shaken = enough and unmoved and ranged and touching and steady and seen.flows > 0.0 and flow_m_s < SHAKEN_FLOW_M_S
    return RESTS if rests else (SHAKEN if shaken else MOVES)


# -- what is watched ----------------------------------------------------------------------------------------
class Windows(NamedTuple):
    """The windows of a lane."""

    imu: ImuWindow
    seen: SeenWindow


@on_lanes
def open_windows() -> Windows:
    """Windows in which nothing has been read."""
    return Windows(NO_READINGS, NOTHING_SEEN)


@on_lanes
def watch_imu(reading: Reading, m: ImuWindow) -> ImuWindow:
    """The inertial reading at hand goes into the window."""
    return with_imu(reading, m) if sound(reading) else m


@on_lanes
def watch_range(reading: Reading, m: SeenWindow) -> SeenWindow:
    """A range goes into the window, whatever the filter makes of it; many sensors say 0 for nothing."""
    ranged = is_heard(reading) and reading.value_0 > 0.0 and np.isfinite(reading.value_0)
    return with_range(reading.value_0, m) if ranged else m


@on_lanes
def watch_gps_velocity(reading: Reading, m: SeenWindow) -> SeenWindow:
    """The fastest level velocity of a receiver stays in the window."""
    speed_m_s = np.sqrt(squared(reading.value_0) + squared(reading.value_1))
    told = is_heard(reading) and np.isfinite(speed_m_s)
    return with_gps(m, gps_m_s=larger(m.gps_m_s, speed_m_s)) if told else m


@on_lanes
def watch_flow(reading: Reading, look: Look, m: SeenWindow, *, angular: bool) -> SeenWindow:
    """The flow's velocity by the latest range goes into the window."""
    x = reading.value_0 - (look.turning_x if angular else 0.0)
    y = reading.value_1 - (look.turning_y if angular else 0.0)
    ranged = m.range_high_m if m.range_high_m >= 0.0 else look.range_m
    per = ranged if angular else 1.0
    summed = with_flow(
        m, flow_u_m_s=m.flow_u_m_s + x * per, flow_v_m_s=m.flow_v_m_s + y * per, flows=m.flows + 1.0
    )  # fmt: skip
    return summed if is_heard(reading) and np.isfinite(x + y) else m


# -- the end of a window ------------------------------------------------------------------------------------
class Stand(NamedTuple):
    """What a vehicle does; whether it stands, in any lane."""

    stand: StandMemory
    event: Event
    any: bool


@on_lanes
def judge_stand(start: StartMemory, gyro: ImuWindow, seen: SeenWindow, m: StandMemory) -> Stand:
    """What the vehicle did in the window, and the range where it rests."""
    does = judge_standing(gyro, seen, m.contact_m)
    lower = does == SHAKEN and seen.range_high_m < NEAR_M and not m.contact_m <= seen.range_high_m
    touched = seen.range_high_m >= 0.0 and (does == RESTS or lower)
    news = start.started > 0.0 and (does > MOVES) != (m.does > MOVES)
    return Stand(
        StandMemory(does, seen.range_high_m if touched else m.contact_m),
        Event(STOOD if news else -1, does),
        does > MOVES,
    )


@equation
def touches(m: StandMemory, seen: SeenWindow) -> bool:
    """Whether a vehicle whose motors run has the ground below it: its range is the lowest that was seen."""
    return m.does == SHAKEN and seen.range_high_m <= m.contact_m + STEADY_RANGE_M


class Rest(NamedTuple):
    """A velocity of 0, and what is doubted before it is offered."""

    velocity: Doubt
    accel: tuple[Doubt, Doubt, Doubt]
    offer: Offer


@on_lanes
def offer_rest(
    start: StartMemory, seen: SeenWindow, m: StandMemory, velocity: AxisVelocity, *, axis: int, s: PlaceSettings
) -> Rest:
    """No velocity along an axis. One that the gate would not let go at rest is what is wrong, and so is the
    accelerometer that made it.
    """
    level = axis < 2 and touches(m, seen)  # a range that is stuck in descent looks like standing
    least = TOUCHING_SIGMA_M_S if level else SHAKEN_SIGMA_M_S
    sigma = s.still_sigma_m_s if m.does == RESTS else least
    stands = start.started > 0.0 and m.does > MOVES
    square = velocity.speed_m_s * velocity.speed_m_s
    beyond = square > 0.5 * s.gate_sigma * s.gate_sigma * (velocity.variance + sigma * sigma)
    freed = stands and m.does == RESTS and beyond
    accel = squared(velocity.speed_m_s / WINDOW_S) if freed else 0.0
    return Rest(
        Doubt(VELOCITY + axis, square if freed else 0.0),
        (Doubt(ACCEL_BIAS, accel), Doubt(ACCEL_BIAS + 1, accel), Doubt(ACCEL_BIAS + 2, accel)),
        Offer(0.0, sigma * sigma, FUSED if stands else SILENT),
    )


@on_lanes
def offer_bias(start: StartMemory, gyro: ImuWindow, seen: SeenWindow, m: StandMemory, *, axis: int) -> Offer:
    """The gyro's mean is its bias: of one whose motors run only where it touches the ground for certain."""
    mean, square = turning_of(gyro, axis)
    least = GYRO_FLOOR_RAD_S if m.does == RESTS else SHAKEN_TURN_RAD_S
    teaches = start.started > 0.0 and (m.does == RESTS or touches(m, seen))
    return Offer(mean, square / larger(gyro.readings, 1.0) + least * least, FUSED if teaches else SILENT)


@procedure
def stand_still(work: Work, lanes: Lanes, t_s: float, p: Work, o: Output) -> None:
    """At the end of a window: what the vehicle does, and what that teaches."""
    if t_s - shared(work, lanes, STILL_CLOCK) < WINDOW_S:
        return
    share(work, lanes, STILL_CLOCK, t_s)
    if judge_stand(work, lanes, t_s, o):
        learn_standing(work, lanes, load_place_settings(p), o)
    open_windows(work, lanes)


@procedure
def learn_standing(work: Work, lanes: Lanes, s: PlaceSettings, o: Output) -> None:
    """No velocity, and the gyro's bias."""
    for axis in range(3):
        offer_rest(work, lanes, axis, s)
        velocity_itself(work, lanes, axis)
        fuse_offered(work, lanes, s.gate_sigma, o)
    consider_none(work, lanes)
    for axis in range(3):
        offer_bias(work, lanes, axis)
        gyro_at_rest(work, lanes, axis)
        fuse_offered(work, lanes, s.gate_sigma, o)
