"""A vehicle that stands: found from what its IMU, range, flow and GPS read over a window, and what standing teaches.

With its motors off an IMU is quieter than in any flight, and its gyro then reads nothing but its bias. With them
running it is not, but a vehicle whose range reads what it reads on the ground, and does not change, while the flow
shows no motion, has no velocity worth the name; nor does it turn much, so that the mean of its gyro is the bias to
within SHAKEN_TURN_RAD_S and what its shaking leaves in a mean. Nothing is taught above the height of contact.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, larger, procedure, smaller
from flownav.estimation.covariance import add_noise_lane, consider_none, variance_of
from flownav.estimation.laws.geometry import component
from flownav.estimation.laws.still import gyro_at_rest, velocity_itself
from flownav.estimation.states import ACCEL_BIAS, STATE, VELOCITY
from flownav.navigation.inertial import sound
from flownav.navigation.memory import (
    CONTACT,
    LENS_RANGE,
    STANDS,
    STILL_CLOCK,
    TURNING,
    load_imu_window,
    load_reading,
    load_seen_window,
    load_start,
    share,
    shared,
    store_imu_window,
    store_seen_window,
)
from flownav.navigation.offers import fuse_offered, is_heard, put
from flownav.navigation.packed import load_place_settings
from flownav.navigation.reasons import FUSED, SILENT
from flownav.navigation.records import ImuWindow, Reading, SeenWindow
from flownav.navigation.tape import STOOD, Output, write_event
from flownav.navigation.told import PlaceSettings

WINDOW_S = 0.5
LEAST_READINGS = 5.0
QUIET_GYRO_RAD_S, QUIET_ACCEL_M_S2 = 0.01, 0.12  # rms of all axes about the mean; in flight it is twice as much
RESTING_TURN_RAD_S = 0.04  # 2 deg/s: the bias of a gyro that its autopilot calibrated is smaller, turning is larger
STEADY_RANGE_M = 0.03
NEAR_M = 0.15  # nobody hovers so low and steady: what a range reads on the ground, though the motors run
CONTACT_M = 0.35  # a range on the ground, where none was seen there yet
RESTING_FLOW_M_S, SHAKEN_FLOW_M_S = 0.3, 0.1
RESTING_GPS_M_S = 1.0
SHAKEN_SIGMA_M_S, TOUCHING_SIGMA_M_S = 0.1, 0.03
GYRO_FLOOR_RAD_S = 3e-4
SHAKEN_TURN_RAD_S = 0.003  # on skids that give, in gusts
MOVES, SHAKEN, RESTS = 0.0, 1.0, 2.0  # what a vehicle does: it moves, stands with its motors on, or off


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
    accel = m.accel_square / n - (m.sum_x**2 + m.sum_y**2 + m.sum_z**2) / (n * n)
    return np.sqrt(gyro), np.sqrt(larger(accel, 0.0))


@equation
def with_range(range_m: float, m: SeenWindow) -> SeenWindow:
    """The span of the ranges with one more."""
    return SeenWindow(
        smaller(m.range_low_m, range_m), larger(m.range_high_m, range_m), m.flow_u_m_s, m.flow_v_m_s, m.flows, m.gps_m_s
    )


@equation
def judge_standing(gyro: ImuWindow, seen: SeenWindow, contact_m: float) -> float:
    """What a vehicle does that read this over a window: MOVES, SHAKEN, RESTS.

    contact_m: the range when it rested before; NaN where that is not known.
    """
    turning, shaking = spreads(gyro)
    turn = np.sqrt(turning_of(gyro, 0)[0] ** 2 + turning_of(gyro, 1)[0] ** 2 + turning_of(gyro, 2)[0] ** 2)
    left = 3.0 * turning / np.sqrt(larger(gyro.readings, 1.0))  # of shaking in a mean, at most
    enough = gyro.readings >= LEAST_READINGS and turn < RESTING_TURN_RAD_S + left
    ranged = seen.range_high_m >= 0.0
    touching = seen.range_high_m <= larger(CONTACT_M, contact_m + STEADY_RANGE_M if np.isfinite(contact_m) else 0.0)
    steady = seen.range_high_m - seen.range_low_m <= STEADY_RANGE_M
    flows = larger(seen.flows, 1.0)
    flow_m_s = np.sqrt(seen.flow_u_m_s**2 + seen.flow_v_m_s**2) / flows
    unmoved = seen.gps_m_s < RESTING_GPS_M_S
    quiet = turning < QUIET_GYRO_RAD_S and shaking < QUIET_ACCEL_M_S2
    rests = enough and quiet and unmoved and flow_m_s < RESTING_FLOW_M_S and ((touching and steady) or not ranged)
    shaken = enough and unmoved and ranged and touching and steady and seen.flows > 0.0 and flow_m_s < SHAKEN_FLOW_M_S
    return RESTS if rests else (SHAKEN if shaken else MOVES)


# -- on lanes -----------------------------------------------------------------------------------------------
@procedure
def open_windows(work: Work, lanes: Lanes, lane: int) -> None:
    """Nothing has been read in the windows of a lane."""
    nothing = ImuWindow(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    store_imu_window(work, lanes, lane, nothing)
    store_seen_window(work, lanes, lane, SeenWindow(1e9, -1.0, 0.0, 0.0, 0.0, 0.0))


@procedure
def watch_imu(work: Work, lanes: Lanes) -> None:
    """The inertial reading at hand goes into the window."""
    for lane in range(len(lanes)):
        reading = load_reading(work, lanes, lane)
        if sound(reading):
            store_imu_window(work, lanes, lane, with_imu(reading, load_imu_window(work, lanes, lane)))


@procedure
def watch_range(work: Work, lanes: Lanes) -> None:
    """And a range, whatever the filter makes of it; many sensors say 0 for nothing."""
    for lane in range(len(lanes)):
        reading = load_reading(work, lanes, lane)
        if is_heard(reading) and reading.value_0 > 0.0 and np.isfinite(reading.value_0):
            store_seen_window(work, lanes, lane, with_range(reading.value_0, load_seen_window(work, lanes, lane)))


@procedure
def watch_gps_velocity(work: Work, lanes: Lanes) -> None:
    """And the fastest level velocity of a receiver."""
    for lane in range(len(lanes)):
        reading, m = load_reading(work, lanes, lane), load_seen_window(work, lanes, lane)
        speed_m_s = np.sqrt(reading.value_0**2 + reading.value_1**2)
        if is_heard(reading) and np.isfinite(speed_m_s):
            fastest = larger(m.gps_m_s, speed_m_s)
            after = SeenWindow(m.range_low_m, m.range_high_m, m.flow_u_m_s, m.flow_v_m_s, m.flows, fastest)
            store_seen_window(work, lanes, lane, after)


@procedure
def watch_flow(work: Work, lanes: Lanes, angular: bool) -> None:
    """And the flow's velocity by the latest range (TURNING says what turning it saw)."""
    for lane in range(len(lanes)):
        reading, m = load_reading(work, lanes, lane), load_seen_window(work, lanes, lane)
        x = reading.value_0 - (work[TURNING * len(lanes) + lane] if angular else 0.0)
        y = reading.value_1 - (work[(TURNING + 1) * len(lanes) + lane] if angular else 0.0)
        ranged = m.range_high_m if m.range_high_m >= 0.0 else work[LENS_RANGE * len(lanes) + lane]
        per = ranged if angular else 1.0
        if is_heard(reading) and np.isfinite(x + y):
            after = SeenWindow(
                m.range_low_m, m.range_high_m, m.flow_u_m_s + x * per, m.flow_v_m_s + y * per, m.flows + 1.0, m.gps_m_s
            )
            store_seen_window(work, lanes, lane, after)


@procedure
def stand_still(work: Work, lanes: Lanes, t_s: float, p: Work, o: Output) -> None:
    """At the end of a window: what the vehicle does, and what that teaches."""
    if t_s - shared(work, lanes, STILL_CLOCK) < WINDOW_S:
        return
    share(work, lanes, STILL_CLOCK, t_s)
    s = load_place_settings(p)
    any_stands = False
    for lane in range(len(lanes)):
        gyro, seen = load_imu_window(work, lanes, lane), load_seen_window(work, lanes, lane)
        contact_m = work[CONTACT * len(lanes) + lane]
        does = judge_standing(gyro, seen, contact_m)
        before = work[STANDS * len(lanes) + lane]
        if load_start(work, lanes, lane).started > 0.0 and (does > MOVES) != (before > MOVES):
            write_event(lanes, lane, t_s, STOOD, does, o)
        work[STANDS * len(lanes) + lane] = does
        lower = does == SHAKEN and seen.range_high_m < NEAR_M and not contact_m <= seen.range_high_m
        if seen.range_high_m >= 0.0 and (does == RESTS or lower):
            work[CONTACT * len(lanes) + lane] = seen.range_high_m
        any_stands = any_stands or does > MOVES
    if any_stands:
        learn_standing(work, lanes, s, o)
    for lane in range(len(lanes)):
        open_windows(work, lanes, lane)


@equation
def touches(work: Work, lanes: Lanes, lane: int) -> bool:
    """Whether a vehicle whose motors run has the ground below it: its range is the lowest that was seen."""
    seen = load_seen_window(work, lanes, lane)
    shaken: bool = work[STANDS * len(lanes) + lane] == SHAKEN
    return shaken and seen.range_high_m <= work[CONTACT * len(lanes) + lane] + STEADY_RANGE_M


@equation
def free_resting(work: Work, lanes: Lanes, axis: int, lane: int, gate_sigma: float, variance: float) -> None:
    """A velocity that the gate would not let go at rest is what is wrong, and so is the accelerometer that made it."""
    speed_m_s = work[(STATE + VELOCITY + axis) * len(lanes) + lane]
    known = variance_of(work, lanes, VELOCITY + axis, lane) + variance
    if speed_m_s * speed_m_s > 0.5 * gate_sigma * gate_sigma * known:
        add_noise_lane(work, lanes, VELOCITY + axis, lane, speed_m_s * speed_m_s)
        for i in range(3):
            add_noise_lane(work, lanes, ACCEL_BIAS + i, lane, (speed_m_s / WINDOW_S) ** 2)


@procedure
def learn_standing(work: Work, lanes: Lanes, s: PlaceSettings, o: Output) -> None:
    """No velocity, and the gyro's bias: of one whose motors run only where it touches the ground for certain."""
    for axis in range(3):
        for lane in range(len(lanes)):
            does, started = work[STANDS * len(lanes) + lane], load_start(work, lanes, lane).started
            level = axis < 2 and touches(work, lanes, lane)  # a range that is stuck in descent looks like standing
            least = TOUCHING_SIGMA_M_S if level else SHAKEN_SIGMA_M_S
            sigma = s.still_sigma_m_s if does == RESTS else least
            stands = started > 0.0 and does > MOVES
            if stands and does == RESTS:
                free_resting(work, lanes, axis, lane, s.gate_sigma, sigma * sigma)
            put(work, lanes, lane, 0.0, sigma * sigma, FUSED if stands else SILENT)
        velocity_itself(work, lanes, axis)
        fuse_offered(work, lanes, s.gate_sigma, o)
    consider_none(work, lanes)
    for axis in range(3):
        for lane in range(len(lanes)):
            does, started = work[STANDS * len(lanes) + lane], load_start(work, lanes, lane).started
            m = load_imu_window(work, lanes, lane)
            mean, square = turning_of(m, axis)
            least = GYRO_FLOOR_RAD_S if does == RESTS else SHAKEN_TURN_RAD_S
            teaches = started > 0.0 and (does == RESTS or touches(work, lanes, lane))
            put(work, lanes, lane, mean, square / larger(m.readings, 1.0) + least * least, FUSED if teaches else SILENT)
        gyro_at_rest(work, lanes, axis)
        fuse_offered(work, lanes, s.gate_sigma, o)
