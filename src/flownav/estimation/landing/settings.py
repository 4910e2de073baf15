"""The landing filter's settings as the kernels take them."""

from __future__ import annotations

from typing import NamedTuple


class FlowLag(NamedTuple):
    """A flow sensor's identified dynamics G(s) = a/(s^2 + b s + c) over one prediction of fixed length.

    x <- F x + g0 m0 + g1 m1, where the seen velocity goes in a straight line from m0 to m1; reading = gain x1.
    """

    f11: float
    f12: float
    f21: float
    f22: float
    start_1: float  # g0
    start_2: float
    end_1: float  # g1
    end_2: float
    gain: float
    sonar_floor_m: float  # below it the sensor multiplies its flow by this instead of the range; 0: it does not
    lens_below_m: float  # the lens below the vehicle's reference point, along body down


class LandingSettings(NamedTuple):
    """Noise densities (per square root of hertz), stationary sigmas and time constants of the error models, limits."""

    accel_noise_m_s2_rt_hz: float
    gyro_noise_rad_s_rt_hz: float
    accel_walk_m_s2_rt_s: float
    gyro_walk_rad_s_rt_s: float
    imu_lag: float  # exp(-period/tau) of the IMU's own low-pass; 0: none that the filter should undo
    position_walk_m_rt_s: float
    gps_slow_sigma_m: float
    gps_slow_sigma_down_m: float
    gps_slow_tau_s: float
    gps_fast_sigma_m: float
    gps_fast_sigma_down_m: float
    gps_fast_tau_s: float
    gps_velocity_sigma_m_s: float
    gps_velocity_tau_s: float
    ins_tilt_sigma_rad: float
    ins_tilt_tau_s: float
    ins_heading_sigma_rad: float
    ins_heading_tau_s: float
    ground_walk_m_rt_s: float
    baro_walk_m_rt_s: float
    flow_scale_sigma: float
    gate_sigma: float
    accel_bias_limit_m_s2: float
    gyro_bias_limit_rad_s: float
