"""The landing filter's prediction: strapdown motion, error models, and the covariance of all of it.

Position, velocity and attitude follow the IMU (Groves, Principles of GNSS, Inertial, and Multisensor Integrated
Navigation Systems, 2013, section 5.4, on a flat, non-rotating earth); the errors of section 14.2.4 in the
earth frame. docs/landing-filter.md lists each Jacobian.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import equation
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.landing.algebra import add_noise, decay, set_coefficient, transform
from flownav.estimation.landing.lag import lag_ends, lag_starts
from flownav.estimation.landing.settings import FlowLag, LandingSettings
from flownav.estimation.landing.states import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GROUND,
    GYRO_BIAS,
    INS_ERROR,
    POSITION,
    VELOCITY,
    LandingRows,
)
from flownav.frames import GRAVITY_M_S2, Quaternion, rotation_from_quaternion, to_earth

MOTION = (POSITION, POSITION + 1, POSITION + 2)
SPEED = (VELOCITY, VELOCITY + 1, VELOCITY + 2)
TURN = (ATTITUDE, ATTITUDE + 1, ATTITUDE + 2)
MOTION_SOURCES = (*MOTION, *SPEED)
TURN_SOURCES = (*TURN, GYRO_BIAS, GYRO_BIAS + 1, GYRO_BIAS + 2)
SPEED_SOURCES = (*SPEED, *TURN, ACCEL_BIAS, ACCEL_BIAS + 1, ACCEL_BIAS + 2)


@equation
def turned(attitude: Quaternion, x_rad: float, y_rad: float, z_rad: float) -> Quaternion:
    """q exp(phi/2): the attitude after a rotation of the body by the small vector phi, third order; unit length."""
    w, x, y, z = attitude
    square = 0.25 * (x_rad * x_rad + y_rad * y_rad + z_rad * z_rad)
    half = 0.5 * (1.0 - square / 6.0)
    c, i, j, k = 1.0 - 0.5 * square, half * x_rad, half * y_rad, half * z_rad
    tw = w * c - x * i - y * j - z * k
    tx = w * i + x * c + y * k - z * j
    ty = w * j - x * k + y * c + z * i
    tz = w * k + x * j - y * i + z * c
    shrink = 1.0 / np.sqrt(tw * tw + tx * tx + ty * ty + tz * tz)
    return tw * shrink, tx * shrink, ty * shrink, tz * shrink


@equation
def attitude_of(work: Work, lanes: Lanes, rows: LandingRows, lane: int) -> Quaternion:
    """A lane's attitude, body to earth."""
    return (
        work[rows.attitude * len(lanes) + lane],
        work[(rows.attitude + 1) * len(lanes) + lane],
        work[(rows.attitude + 2) * len(lanes) + lane],
        work[(rows.attitude + 3) * len(lanes) + lane],
    )


@equation
def predict(
    work: Work, lanes: Lanes, rows: LandingRows, dt_s: float, settings: LandingSettings, lag: FlowLag | None
) -> None:
    """The filter moved on by dt with the IMU reading in its rows, which stands for that time."""
    keep_start(work, lanes, rows)
    if lag is not None:
        lag_starts(work, lanes, rows, lag)
    move(work, lanes, rows, dt_s, settings)
    propagate_motion(work, lanes, rows, dt_s)
    propagate_errors(work, lanes, rows, dt_s, settings)
    note_change(work, lanes, rows, dt_s)
    if lag is not None:
        lag_ends(work, lanes, rows, lag)


@equation
def keep_start(work: Work, lanes: Lanes, rows: LandingRows) -> None:
    """Position, velocity and attitude before the prediction, in the rows of `change`."""
    for i in range(6):
        for lane in range(len(lanes)):
            work[(rows.change + i) * len(lanes) + lane] = work[(rows.state + i) * len(lanes) + lane]
    for i in range(4):
        for lane in range(len(lanes)):
            work[(rows.change + 6 + i) * len(lanes) + lane] = work[(rows.attitude + i) * len(lanes) + lane]


@equation
def note_change(work: Work, lanes: Lanes, rows: LandingRows, dt_s: float) -> None:
    """What the prediction changed: position beyond its last velocity times dt, velocity, and the turn q0^-1 q.

    A reading of one prediction ago is of p - v dt - change, v - change and q turn^-1. Kept as changes, they move
    with every correction since, so that components fused one after the other are fused as if together.
    """
    for i in range(3):
        for lane in range(len(lanes)):
            vel = work[(rows.state + VELOCITY + i) * len(lanes) + lane]
            moved = work[(rows.state + POSITION + i) * len(lanes) + lane] - work[(rows.change + i) * len(lanes) + lane]
            work[(rows.change + i) * len(lanes) + lane] = moved - dt_s * vel
            work[(rows.change + 3 + i) * len(lanes) + lane] = vel - work[(rows.change + 3 + i) * len(lanes) + lane]
    for lane in range(len(lanes)):
        w, x, y, z = attitude_of(work, lanes, rows, lane)
        first = rows.change + 6
        sw, sx = work[first * len(lanes) + lane], work[(first + 1) * len(lanes) + lane]
        sy, sz = work[(first + 2) * len(lanes) + lane], work[(first + 3) * len(lanes) + lane]
        work[first * len(lanes) + lane] = sw * w + sx * x + sy * y + sz * z
        work[(first + 1) * len(lanes) + lane] = sw * x - sx * w - sy * z + sz * y
        work[(first + 2) * len(lanes) + lane] = sw * y + sx * z - sy * w - sz * x
        work[(first + 3) * len(lanes) + lane] = sw * z - sx * y + sy * x - sz * w


@equation
def attitude_before(work: Work, lanes: Lanes, rows: LandingRows, lane: int) -> Quaternion:
    """A lane's attitude one prediction ago, with what was learnt since: q turn^-1."""
    w, x, y, z = attitude_of(work, lanes, rows, lane)
    first = rows.change + 6
    tw, tx = work[first * len(lanes) + lane], work[(first + 1) * len(lanes) + lane]
    ty, tz = work[(first + 2) * len(lanes) + lane], work[(first + 3) * len(lanes) + lane]
    return (
        w * tw + x * tx + y * ty + z * tz,
        x * tw - w * tx - y * tz + z * ty,
        y * tw - w * ty - z * tx + x * tz,
        z * tw - w * tz - x * ty + y * tx,
    )


@equation
def take_imu(work: Work, lanes: Lanes, rows: LandingRows, lag: float) -> None:
    """rows.rate and rows.force (body): the reading without the IMU's own first-order lag and without its biases.

    y_k = d y_{k-1} + (1 - d) truth + noise, so (y_k - d y_{k-1})/(1 - d) is the truth with white noise.
    """
    for i in range(6):
        out = rows.rate + i if i < 3 else rows.force + i - 3
        bias = rows.state + (GYRO_BIAS + i if i < 3 else ACCEL_BIAS + i - 3)
        for lane in range(len(lanes)):
            reading = work[(rows.imu + i) * len(lanes) + lane]
            undone = (reading - lag * work[(rows.imu_before + i) * len(lanes) + lane]) / (1.0 - lag)
            work[(rows.imu_before + i) * len(lanes) + lane] = reading
            work[out * len(lanes) + lane] = undone - work[bias * len(lanes) + lane]


@equation
def move(work: Work, lanes: Lanes, rows: LandingRows, dt_s: float, settings: LandingSettings) -> None:
    """Strapdown: q <- q exp(w dt), v <- v + (R_mid f + g) dt, p <- p + mean v dt; the error states decay by the side.

    Leaves R_EB in the middle of the step in rows.middle and R_mid f in rows.force.
    """
    take_imu(work, lanes, rows, settings.imu_lag)
    for lane in range(len(lanes)):
        x = dt_s * work[rows.rate * len(lanes) + lane]
        y = dt_s * work[(rows.rate + 1) * len(lanes) + lane]
        z = dt_s * work[(rows.rate + 2) * len(lanes) + lane]
        before = attitude_of(work, lanes, rows, lane)
        middle = turned(before, 0.5 * x, 0.5 * y, 0.5 * z)
        after = turned(before, x, y, z)
        rotation = rotation_from_quaternion(middle[0], middle[1], middle[2], middle[3])
        force = to_earth(
            rotation,
            work[rows.force * len(lanes) + lane],
            work[(rows.force + 1) * len(lanes) + lane],
            work[(rows.force + 2) * len(lanes) + lane],
        )
        accel_d = force[2] + GRAVITY_M_S2
        vel_n = work[(rows.state + VELOCITY) * len(lanes) + lane]
        vel_e = work[(rows.state + VELOCITY + 1) * len(lanes) + lane]
        vel_d = work[(rows.state + VELOCITY + 2) * len(lanes) + lane]
        work[(rows.state + POSITION) * len(lanes) + lane] += dt_s * (vel_n + 0.5 * dt_s * force[0])
        work[(rows.state + POSITION + 1) * len(lanes) + lane] += dt_s * (vel_e + 0.5 * dt_s * force[1])
        work[(rows.state + POSITION + 2) * len(lanes) + lane] += dt_s * (vel_d + 0.5 * dt_s * accel_d)
        work[(rows.state + VELOCITY) * len(lanes) + lane] = vel_n + dt_s * force[0]
        work[(rows.state + VELOCITY + 1) * len(lanes) + lane] = vel_e + dt_s * force[1]
        work[(rows.state + VELOCITY + 2) * len(lanes) + lane] = vel_d + dt_s * accel_d
        work[rows.attitude * len(lanes) + lane] = after[0]
        work[(rows.attitude + 1) * len(lanes) + lane] = after[1]
        work[(rows.attitude + 2) * len(lanes) + lane] = after[2]
        work[(rows.attitude + 3) * len(lanes) + lane] = after[3]
        work[rows.middle * len(lanes) + lane] = rotation[0]
        work[(rows.middle + 1) * len(lanes) + lane] = rotation[1]
        work[(rows.middle + 2) * len(lanes) + lane] = rotation[2]
        work[(rows.middle + 3) * len(lanes) + lane] = rotation[3]
        work[(rows.middle + 4) * len(lanes) + lane] = rotation[4]
        work[(rows.middle + 5) * len(lanes) + lane] = rotation[5]
        work[(rows.middle + 6) * len(lanes) + lane] = rotation[6]
        work[(rows.middle + 7) * len(lanes) + lane] = rotation[7]
        work[(rows.middle + 8) * len(lanes) + lane] = rotation[8]
        work[rows.force * len(lanes) + lane] = force[0]
        work[(rows.force + 1) * len(lanes) + lane] = force[1]
        work[(rows.force + 2) * len(lanes) + lane] = force[2]


# -- covariance -------------------------------------------------------------------------------------------
@equation
def propagate_motion(work: Work, lanes: Lanes, rows: LandingRows, dt_s: float) -> None:
    """dp' = dv; theta' = -R dbg; dv' = theta x (R f) - R dba: each law half before and half after the next."""
    advance_position(work, lanes, rows, 0.5 * dt_s)
    turn_error(work, lanes, rows, 0.5 * dt_s)
    advance_velocity(work, lanes, rows, dt_s)
    turn_error(work, lanes, rows, 0.5 * dt_s)
    advance_position(work, lanes, rows, 0.5 * dt_s)


@equation
def identity_of(work: Work, lanes: Lanes, rows: LandingRows, sources: int) -> None:
    """Coefficients of three targets that keep their own value, the first three of `sources` sources."""
    for i in range(3):
        for s in range(sources):
            set_coefficient(work, lanes, rows, i * sources + s, 1.0 if i == s else 0.0)


@equation
def advance_position(work: Work, lanes: Lanes, rows: LandingRows, dt_s: float) -> None:
    """dp <- dp + dt dv."""
    identity_of(work, lanes, rows, len(MOTION_SOURCES))
    for i in range(3):
        set_coefficient(work, lanes, rows, i * len(MOTION_SOURCES) + 3 + i, dt_s)
    transform(work, lanes, rows, MOTION, MOTION_SOURCES)


@equation
def turn_error(work: Work, lanes: Lanes, rows: LandingRows, dt_s: float) -> None:
    """theta <- theta - R_mid dbg dt."""
    identity_of(work, lanes, rows, len(TURN_SOURCES))
    for i in range(3):
        for j in range(3):
            for lane in range(len(lanes)):
                element = -dt_s * work[(rows.middle + 3 * i + j) * len(lanes) + lane]
                work[(rows.coefficient + i * len(TURN_SOURCES) + 3 + j) * len(lanes) + lane] = element
    transform(work, lanes, rows, TURN, TURN_SOURCES)


@equation
def advance_velocity(work: Work, lanes: Lanes, rows: LandingRows, dt_s: float) -> None:
    """dv <- dv + theta x f_ned dt - R_mid dba dt."""
    identity_of(work, lanes, rows, len(SPEED_SOURCES))
    for lane in range(len(lanes)):
        north = dt_s * work[rows.force * len(lanes) + lane]
        east = dt_s * work[(rows.force + 1) * len(lanes) + lane]
        down = dt_s * work[(rows.force + 2) * len(lanes) + lane]
        work[(rows.coefficient + 4) * len(lanes) + lane] = down
        work[(rows.coefficient + 5) * len(lanes) + lane] = -east
        work[(rows.coefficient + 9 + 3) * len(lanes) + lane] = -down
        work[(rows.coefficient + 9 + 5) * len(lanes) + lane] = north
        work[(rows.coefficient + 18 + 3) * len(lanes) + lane] = east
        work[(rows.coefficient + 18 + 4) * len(lanes) + lane] = -north
    for i in range(3):
        for j in range(3):
            for lane in range(len(lanes)):
                element = -dt_s * work[(rows.middle + 3 * i + j) * len(lanes) + lane]
                work[(rows.coefficient + i * len(SPEED_SOURCES) + 6 + j) * len(lanes) + lane] = element
    transform(work, lanes, rows, SPEED, SPEED_SOURCES)


@equation
def gauss_markov_state(
    work: Work, lanes: Lanes, rows: LandingRows, state: int, sigma: float, tau_s: float, dt_s: float
) -> None:
    """x <- exp(-dt/tau) x with the noise that keeps its standard deviation at sigma."""
    factor = np.exp(-dt_s / tau_s)
    decay(work, lanes, rows, state, 1, factor)
    add_noise(work, lanes, rows, state, sigma * sigma * (1.0 - factor * factor))


@equation
def propagate_errors(work: Work, lanes: Lanes, rows: LandingRows, dt_s: float, settings: LandingSettings) -> None:
    """White noise of the IMU on velocity and attitude; random walks; Gauss-Markov errors."""
    for i in range(3):
        down = i == 2
        add_noise(work, lanes, rows, POSITION + i, settings.position_walk_m_rt_s**2 * dt_s)
        add_noise(work, lanes, rows, VELOCITY + i, settings.accel_noise_m_s2_rt_hz**2 * dt_s)
        add_noise(work, lanes, rows, ATTITUDE + i, settings.gyro_noise_rad_s_rt_hz**2 * dt_s)
        add_noise(work, lanes, rows, GYRO_BIAS + i, settings.gyro_walk_rad_s_rt_s**2 * dt_s)
        add_noise(work, lanes, rows, ACCEL_BIAS + i, settings.accel_walk_m_s2_rt_s**2 * dt_s)
        slow = settings.gps_slow_sigma_down_m if down else settings.gps_slow_sigma_m
        fast = settings.gps_fast_sigma_down_m if down else settings.gps_fast_sigma_m
        gauss_markov_state(work, lanes, rows, GPS_SLOW + i, slow, settings.gps_slow_tau_s, dt_s)
        gauss_markov_state(work, lanes, rows, GPS_FAST + i, fast, settings.gps_fast_tau_s, dt_s)
        velocity, tau_s = settings.gps_velocity_sigma_m_s, settings.gps_velocity_tau_s
        gauss_markov_state(work, lanes, rows, GPS_VELOCITY + i, velocity, tau_s, dt_s)
        angle = settings.ins_heading_sigma_rad if down else settings.ins_tilt_sigma_rad
        tau_s = settings.ins_heading_tau_s if down else settings.ins_tilt_tau_s
        gauss_markov_state(work, lanes, rows, INS_ERROR + i, angle, tau_s, dt_s)
    add_noise(work, lanes, rows, GROUND, settings.ground_walk_m_rt_s**2 * dt_s)
    add_noise(work, lanes, rows, BARO, settings.baro_walk_m_rt_s**2 * dt_s)
