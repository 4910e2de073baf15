"""The landing filter's error states, and where its scalars lie in a lane buffer.

The nominal state is position and velocity in earth NED relative to the pad, an attitude quaternion, and the
sensors' own errors. Its error is additive but for the attitude, which errs by a small rotation in the earth frame:

    q_true = (1, theta/2) q,   R_true = (I + [theta]x) R

so theta does not turn with the vehicle, and its third component is the heading error, the one that
gravity does not show.
"""

from __future__ import annotations

from typing import NamedTuple

POSITION = 0  # 3, NED from the pad [m]
VELOCITY = 3  # 3, NED [m/s]
ATTITUDE = 6  # 3, rotation error, earth NED [rad]
GYRO_BIAS = 9  # 3, body FRD [rad/s]
ACCEL_BIAS = 12  # 3, body FRD [m/s2]
GPS_SLOW = 15  # 3, NED: slow Gauss-Markov error of GPS position (ionosphere, ephemeris) [m]
GPS_FAST = 18  # 3, NED: fast Gauss-Markov error of GPS position (multipath) [m]
GPS_VELOCITY = 21  # 3, NED: Gauss-Markov error of GPS velocity [m/s]
INS_ERROR = 24  # 3: Gauss-Markov tilt of an external attitude about body x and y, and its heading error [rad]
GROUND = 27  # 1, down coordinate of the ground below [m]
BARO = 28  # 1, pressure altitude less true altitude [m]
FLOW_SCALE = 29  # 1, flow reported over flow by its datasheet, less 1
FLOW_LAG = 30  # 4, the flow sensor's identified dynamics: x1, x2 forward, x1, x2 right
COMPASS = 34  # 2, deviation of a compass: coefficients of sin and cos of the heading (hard iron) [rad]
VELOCITY_LAG = 36  # 1, how much older GPS velocity is than its time says (receivers smooth it) [s]
STATES = 37

STATE_NAMES = (
    "pos_n_m", "pos_e_m", "pos_d_m", "vel_n_m_s", "vel_e_m_s", "vel_d_m_s",
    "tilt_n_rad", "tilt_e_rad", "heading_rad",
    "gyro_bias_x_rad_s", "gyro_bias_y_rad_s", "gyro_bias_z_rad_s",
    "accel_bias_x_m_s2", "accel_bias_y_m_s2", "accel_bias_z_m_s2",
    "gps_slow_n_m", "gps_slow_e_m", "gps_slow_d_m", "gps_fast_n_m", "gps_fast_e_m", "gps_fast_d_m",
    "gps_velocity_n_m_s", "gps_velocity_e_m_s", "gps_velocity_d_m_s",
    "ins_roll_rad", "ins_pitch_rad", "ins_heading_rad",
    "ground_d_m", "baro_m", "flow_scale", "lag_u1", "lag_u2", "lag_v1", "lag_v2",
    "compass_sin_rad", "compass_cos_rad", "velocity_lag_s",
)  # fmt: skip

LARGEST_TRANSFORM = 27  # coefficients: three states from nine


class LandingRows(NamedTuple):
    """Row numbers of the filter's scalars in the lane buffer."""

    state: int  # STATES, nominal; the three of ATTITUDE stay 0 but within a correction
    covariance: int  # STATES * STATES, row by row
    attitude: int  # quaternion body to earth
    change: int  # 10: what the last prediction changed; a late reading describes the state without it
    imu: int  # gyro [rad/s] and specific force [m/s2], body FRD, as read
    imu_before: int  # the reading before
    rate: int  # body rate: gyro without its lag and bias
    force: int  # specific force likewise, turned to earth NED
    middle: int  # 9: R_EB in the middle of the last prediction
    seen: int  # 2: velocity that each flow channel sees, for the lag
    cross: int  # STATES: P h'
    gain: int  # STATES
    root: int  # STATES: gain times sqrt(S)
    scratch: int  # 3 * STATES
    coefficient: int  # of a transform or of an observation
    innovation: int
    innovation_variance: int
    noise: int
    test_ratio: int
    offered: int
    accepted: int


_SIZES = (STATES, STATES * STATES, 4, 10, 6, 6, 3, 3, 9, 2, STATES, STATES, STATES, 3 * STATES, LARGEST_TRANSFORM,
          1, 1, 1, 1, 1, 1)  # fmt: skip
LANDING_ROW_COUNT = sum(_SIZES)


def landing_rows(first: int) -> LandingRows:
    """Rows of the filter from row `first` on; LANDING_ROW_COUNT rows."""
    starts = [first]
    for size in _SIZES[:-1]:
        starts.append(starts[-1] + size)
    return LandingRows(*starts)
