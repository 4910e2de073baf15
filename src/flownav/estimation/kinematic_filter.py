"""The kinematic filter: position and velocity of any vehicle, driven by attitude and accelerometer.

State [p_n p_e p_d v_n v_e v_d]: earth NED, metres and metres per second. Between measurements the specific
force, rotated by the attitude, moves the state; every measurement corrects it when it comes, a component
at a time, with Joseph's covariance form and an innovation gate. All steps work on lanes (`kalman.py`): a
replay runs them on `ONE_LANE`, the batch simulator on `LANES`.

A step takes row numbers of the lane buffer: where its readings lie (`measured`), their variances
(`variance`) and a 1.0 where this lane has one now (`offered`). docs/kinematic-filter.md tells the reasons.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.compile import clamp, equation
from flownav.estimation.kalman import (
    KalmanRows,
    Lanes,
    Work,
    correct_covariance_joseph,
    correct_state,
    kalman_row_count,
    kalman_rows,
    test_innovation,
)
from flownav.estimation.kinematic_settings import KinematicSettings
from flownav.frames import (
    GRAVITY_M_S2,
    Rotation,
    Vector,
    quaternion_rate,
    rotation_from_quaternion,
    to_body,
    to_earth,
)

STATES = 6
LARGEST_VARIANCE = 1e30


class KinematicRows(NamedTuple):
    """Where the filter's scalars lie in the lane buffer (row numbers)."""

    kalman: KalmanRows
    attitude: int  # 4 rows: quaternion body to earth
    force: int  # 3 rows: specific force, body FRD [m/s2]
    trim: int  # 3 rows: what is taken off the specific force, body FRD [m/s2]


def kinematic_rows(first: int) -> KinematicRows:
    """Rows of the filter from row `first` on; `KINEMATIC_ROW_COUNT` rows."""
    after = first + kalman_row_count(STATES)
    return KinematicRows(kalman_rows(first, STATES), after, after + 4, after + 7)


KINEMATIC_ROW_COUNT = kalman_row_count(STATES) + 10


# -- prediction --------------------------------------------------------------------------------------------
@equation
def propagate_kinematic_covariance(
    work: Work, lanes: Lanes, kalman: KalmanRows, dt_s: float, accel_psd: float, path_rate: int
) -> None:
    """P <- F P F' + Q for F = [I, dt I; 0, I], block by block; exactly symmetric.

    Q is white acceleration of spectral density `accel_psd` [m2/s4/Hz] over dt (Bar-Shalom, Li, Kirubarajan,
    Estimation with Applications to Tracking and Navigation, 2001, eq. 6.2.2-12), plus a random walk of
    position whose variance grows by row `path_rate` [m2/s].
    """
    first = kalman.covariance
    for i in range(3):
        for j in range(3):
            noise = accel_psd * dt_s * dt_s * dt_s / 3.0 if i == j else 0.0
            walk = dt_s if i == j else 0.0
            for lane in range(len(lanes)):
                work[(first + i * STATES + j) * len(lanes) + lane] += (
                    dt_s
                    * (
                        work[(first + i * STATES + 3 + j) * len(lanes) + lane]
                        + work[(first + j * STATES + 3 + i) * len(lanes) + lane]
                    )
                    + dt_s * dt_s * work[(first + (3 + i) * STATES + 3 + j) * len(lanes) + lane]
                    + walk * work[path_rate * len(lanes) + lane]
                    + noise
                )
    for i in range(3):
        for j in range(3):
            noise = 0.5 * accel_psd * dt_s * dt_s if i == j else 0.0
            for lane in range(len(lanes)):
                grown = (
                    work[(first + i * STATES + 3 + j) * len(lanes) + lane]
                    + dt_s * work[(first + (3 + i) * STATES + 3 + j) * len(lanes) + lane]
                    + noise
                )
                work[(first + i * STATES + 3 + j) * len(lanes) + lane] = grown
                work[(first + (3 + j) * STATES + i) * len(lanes) + lane] = grown
    for i in range(3):
        for lane in range(len(lanes)):
            work[(first + (3 + i) * STATES + 3 + i) * len(lanes) + lane] += accel_psd * dt_s


@equation
def path_noise_rate(vel_n_m_s: float, vel_e_m_s: float, path_noise_m_rt_m: float) -> float:
    """How fast odometry's position variance grows [m2/s]: a random walk over the distance flown."""
    speed: float = np.sqrt(vel_n_m_s * vel_n_m_s + vel_e_m_s * vel_e_m_s)
    return path_noise_m_rt_m * path_noise_m_rt_m * speed


@equation
def predict(work: Work, lanes: Lanes, rows: KinematicRows, dt_s: float, settings: KinematicSettings) -> None:
    """Move the state by dt with the specific force of the rows `force`, less `trim`, and grow the covariance.

    a_ned = R_EB (f - trim) + [0 0 g]; p += v dt + a dt^2/2; v += a dt.
    """
    state = rows.kalman.state
    for lane in range(len(lanes)):
        rotation = rotation_of(work, lanes, rows, lane)
        accel = to_earth(
            rotation,
            work[(rows.force + 0) * len(lanes) + lane] - work[(rows.trim + 0) * len(lanes) + lane],
            work[(rows.force + 1) * len(lanes) + lane] - work[(rows.trim + 1) * len(lanes) + lane],
            work[(rows.force + 2) * len(lanes) + lane] - work[(rows.trim + 2) * len(lanes) + lane],
        )
        vel_n = work[(state + 3) * len(lanes) + lane]
        vel_e = work[(state + 4) * len(lanes) + lane]
        vel_d = work[(state + 5) * len(lanes) + lane]
        down = accel[2] + GRAVITY_M_S2
        work[rows.kalman.scratch * len(lanes) + lane] = path_noise_rate(vel_n, vel_e, settings.path_noise_m_rt_m)
        work[(state + 0) * len(lanes) + lane] += dt_s * (vel_n + 0.5 * dt_s * accel[0])
        work[(state + 1) * len(lanes) + lane] += dt_s * (vel_e + 0.5 * dt_s * accel[1])
        work[(state + 2) * len(lanes) + lane] += dt_s * (vel_d + 0.5 * dt_s * down)
        work[(state + 3) * len(lanes) + lane] = vel_n + dt_s * accel[0]
        work[(state + 4) * len(lanes) + lane] = vel_e + dt_s * accel[1]
        work[(state + 5) * len(lanes) + lane] = vel_d + dt_s * down
    psd = settings.accel_noise_m_s2_rt_hz * settings.accel_noise_m_s2_rt_hz
    propagate_kinematic_covariance(work, lanes, rows.kalman, dt_s, psd, rows.kalman.scratch)


@equation
def coast(work: Work, lanes: Lanes, rows: KinematicRows, dt_s: float, settings: KinematicSettings) -> None:
    """Move the state by dt at constant velocity: what is left where no accelerometer has been heard."""
    state = rows.kalman.state
    for lane in range(len(lanes)):
        vel_n = work[(state + 3) * len(lanes) + lane]
        vel_e = work[(state + 4) * len(lanes) + lane]
        work[rows.kalman.scratch * len(lanes) + lane] = path_noise_rate(vel_n, vel_e, settings.path_noise_m_rt_m)
        work[(state + 0) * len(lanes) + lane] += dt_s * vel_n
        work[(state + 1) * len(lanes) + lane] += dt_s * vel_e
        work[(state + 2) * len(lanes) + lane] += dt_s * work[(state + 5) * len(lanes) + lane]
    psd = settings.coast_noise_m_s2_rt_hz * settings.coast_noise_m_s2_rt_hz
    propagate_kinematic_covariance(work, lanes, rows.kalman, dt_s, psd, rows.kalman.scratch)


@equation
def turn_attitude(work: Work, lanes: Lanes, rows: KinematicRows, gyro: int, dt_s: float) -> None:
    """Carry the attitude on by dt with the body rates of the three rows `gyro` [rad/s], until the next one comes."""
    for lane in range(len(lanes)):
        w = work[(rows.attitude + 0) * len(lanes) + lane]
        x = work[(rows.attitude + 1) * len(lanes) + lane]
        y = work[(rows.attitude + 2) * len(lanes) + lane]
        z = work[(rows.attitude + 3) * len(lanes) + lane]
        rate = quaternion_rate(
            w, x, y, z,
            work[(gyro + 0) * len(lanes) + lane],
            work[(gyro + 1) * len(lanes) + lane],
            work[(gyro + 2) * len(lanes) + lane],
        )  # fmt: skip
        w, x, y, z = w + dt_s * rate[0], x + dt_s * rate[1], y + dt_s * rate[2], z + dt_s * rate[3]
        scale = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
        work[(rows.attitude + 0) * len(lanes) + lane] = scale * w
        work[(rows.attitude + 1) * len(lanes) + lane] = scale * x
        work[(rows.attitude + 2) * len(lanes) + lane] = scale * y
        work[(rows.attitude + 3) * len(lanes) + lane] = scale * z


# -- measurement laws --------------------------------------------------------------------------------------
@equation
def flow_velocity_variance(
    range_m: float, range_variance: float, speed_m_s: float, quality: float, settings: KinematicSettings
) -> float:
    """Variance of a body-velocity component from flow [m2/s2], scheduled with height and quality.

    (sigma_flow r)^2 + (v sigma_r / r)^2 + floor^2. sigma_flow goes from its low-quality figure at quality 0 to
    its good one at 255 (as PX4's EKF2 does between its OF_N_MAX and OF_N_MIN).
    """
    low, good = settings.flow_low_quality_sigma_rad_s, settings.flow_sigma_rad_s
    sigma = low + (good - low) * quality / 255.0
    return (
        sigma * sigma * range_m * range_m
        + speed_m_s * speed_m_s * range_variance / (range_m * range_m)
        + settings.flow_floor_m_s * settings.flow_floor_m_s
    )


@equation
def range_variance(range_m: float, settings: KinematicSettings) -> float:
    """Variance of a range reading [m2]: a floor and a share of the range."""
    share = settings.range_relative_sigma * range_m
    return settings.range_sigma_m * settings.range_sigma_m + share * share


# -- correction --------------------------------------------------------------------------------------------
@equation
def observe_state(
    work: Work, lanes: Lanes, rows: KinematicRows, index: int, measured: int, variance: int, offered: int
) -> None:
    """Set up a component that reads state `index` (0-2 position NED, 3-5 velocity NED)."""
    kalman = rows.kalman
    for i in range(STATES):
        for lane in range(len(lanes)):
            work[(kalman.observation + i) * len(lanes) + lane] = 1.0 if i == index else 0.0
    for lane in range(len(lanes)):
        predicted = work[(kalman.state + index) * len(lanes) + lane]
        work[kalman.innovation * len(lanes) + lane] = work[measured * len(lanes) + lane] - predicted
    take_noise(work, lanes, rows, variance, offered)


@equation
def observe_body_velocity(
    work: Work, lanes: Lanes, rows: KinematicRows, component: int, measured: int, variance: int, offered: int
) -> None:
    """Set up a component (0 forward, 1 right, 2 down) of the body velocity R_BE v_ned [m/s]."""
    kalman = rows.kalman
    for lane in range(len(lanes)):
        axis = body_axis(rotation_of(work, lanes, rows, lane), component)
        work[(kalman.observation + 0) * len(lanes) + lane] = 0.0
        work[(kalman.observation + 1) * len(lanes) + lane] = 0.0
        work[(kalman.observation + 2) * len(lanes) + lane] = 0.0
        work[(kalman.observation + 3) * len(lanes) + lane] = axis[0]
        work[(kalman.observation + 4) * len(lanes) + lane] = axis[1]
        work[(kalman.observation + 5) * len(lanes) + lane] = axis[2]
        predicted = (
            axis[0] * work[(kalman.state + 3) * len(lanes) + lane]
            + axis[1] * work[(kalman.state + 4) * len(lanes) + lane]
            + axis[2] * work[(kalman.state + 5) * len(lanes) + lane]
        )
        work[kalman.innovation * len(lanes) + lane] = work[measured * len(lanes) + lane] - predicted
    take_noise(work, lanes, rows, variance, offered)


@equation
def take_noise(work: Work, lanes: Lanes, rows: KinematicRows, variance: int, offered: int) -> None:
    """The component's variance; one that is no finite number of 0 or more is not offered, and leaves no NaN."""
    for lane in range(len(lanes)):
        noise = work[variance * len(lanes) + lane]
        sound = noise >= 0.0 and noise < LARGEST_VARIANCE
        work[rows.kalman.noise * len(lanes) + lane] = noise if sound else 1.0
        work[rows.kalman.offered * len(lanes) + lane] = work[offered * len(lanes) + lane] if sound else 0.0


@equation
def correct(work: Work, lanes: Lanes, rows: KinematicRows, settings: KinematicSettings, trim_rate_1_s: float) -> None:
    """Test and fuse the component that `observe_*` set up: gate, state, accelerometer trim, Joseph covariance.

    rows.kalman.accepted, test_ratio and innovation_variance tell what happened. `trim_rate_1_s` is
    1 / settings.trim_time_s, or 0 to leave the trim alone.
    """
    test_innovation(work, lanes, rows.kalman, STATES, settings.gate_sigma)
    correct_state(work, lanes, rows.kalman, STATES)
    learn_trim(work, lanes, rows, trim_rate_1_s, settings.trim_limit_m_s2)
    correct_covariance_joseph(work, lanes, rows.kalman, STATES)


@equation
def learn_trim(work: Work, lanes: Lanes, rows: KinematicRows, rate_1_s: float, limit: float) -> None:
    """Lead the corrections of velocity back to the specific force: trim -= R_BE (K_v nu) rate.

    Velocity that must be corrected again and again the same way is a tilted or biased accelerometer. With the
    trim fed back, it follows that error with the time constant 1/rate, and levels the dead reckoning to come.
    """
    kalman = rows.kalman
    for lane in range(len(lanes)):
        rotation = rotation_of(work, lanes, rows, lane)
        fused = work[kalman.accepted * len(lanes) + lane] > 0.0
        step = rate_1_s * work[kalman.innovation * len(lanes) + lane] if fused else 0.0
        error = to_body(
            rotation,
            step * work[(kalman.gain + 3) * len(lanes) + lane],
            step * work[(kalman.gain + 4) * len(lanes) + lane],
            step * work[(kalman.gain + 5) * len(lanes) + lane],
        )
        trim_x = work[(rows.trim + 0) * len(lanes) + lane] - error[0]
        trim_y = work[(rows.trim + 1) * len(lanes) + lane] - error[1]
        trim_z = work[(rows.trim + 2) * len(lanes) + lane] - error[2]
        work[(rows.trim + 0) * len(lanes) + lane] = clamp(trim_x, -limit, limit)
        work[(rows.trim + 1) * len(lanes) + lane] = clamp(trim_y, -limit, limit)
        work[(rows.trim + 2) * len(lanes) + lane] = clamp(trim_z, -limit, limit)


@equation
def body_axis(rotation: Rotation, component: int) -> Vector:
    """Column `component` of R_EB: the body's forward, right or down axis in earth NED."""
    return (
        rotation[0] if component == 0 else (rotation[1] if component == 1 else rotation[2]),
        rotation[3] if component == 0 else (rotation[4] if component == 1 else rotation[5]),
        rotation[6] if component == 0 else (rotation[7] if component == 1 else rotation[8]),
    )


@equation
def rotation_of(work: Work, lanes: Lanes, rows: KinematicRows, lane: int) -> Rotation:
    """R_EB of a lane's attitude."""
    return rotation_from_quaternion(
        work[(rows.attitude + 0) * len(lanes) + lane],
        work[(rows.attitude + 1) * len(lanes) + lane],
        work[(rows.attitude + 2) * len(lanes) + lane],
        work[(rows.attitude + 3) * len(lanes) + lane],
    )
