"""The landing filter's numbers for a scenario: what datasheets state of each sensor, and nothing of the flight."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flownav.estimation.landing.settings import FlowLag, LandingSettings
from flownav.estimation.landing.states import (
    ACCEL_BIAS,
    ATTITUDE,
    FLOW_LAG,
    FLOW_SCALE,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GYRO_BIAS,
    INS_ERROR,
    POSITION,
    STATES,
    VELOCITY,
)
from flownav.sensors.datasheet import FlowSensor
from flownav.sensors.flow import PERIOD_S, FlowParameters
from flownav.sensors.imu import ImuParameters
from flownav.sensors.second_order import second_order_hold
from flownav.sensors.settings import GpsInsSettings
from flownav.simulation.landing_filtering import START_ATTITUDE_RAD, START_POSITION_M, LandingSetup
from flownav.simulation.scenario import Scenario
from flownav.simulation.sensing import EPOCH_S

# a known start on the pad, and one in hover, which stands for a vehicle that has hovered before (the landing filter's
# own figures after 35 s of the shipped take-off)
PAD_SIGMA_M = (0.01, 0.01, 0.01)
PAD_SPEED_M_S = 1e-3
HOVER_SIGMA_M = (0.025, 0.025, 0.002)
HOVER_SPEED_M_S = 0.006
HOVER_ACCEL_BIAS_M_S2 = 0.003
START_SPEED_M_S = 0.5  # where nothing is known
START_LAG = 1e-4  # the flow sensor's dynamics at rest
EXACT_RAD = 1e-5  # an attitude that a scenario makes exact
LATE_RAD = 1e-4  # what the gyro's noise adds to an attitude of one epoch ago
NEVER_S = 1e9


def landing_setup(
    scenario: Scenario, sensor: FlowSensor, flow: FlowParameters, imu: ImuParameters, lens_below_cg_m: float
) -> LandingSetup:
    """The landing filter for a scenario's sensors."""
    gps = scenario.gps
    settings = landing_settings(gps, imu, scenario.flow.gain_sigma)
    known = scenario.filter.start == "known" or (scenario.filter.start is None and gps.model == "white")
    pad = scenario.pad_fix
    return LandingSetup(
        settings=settings,
        lag=flow_lag(sensor, flow, lens_below_cg_m),
        flow=flow,
        start_variance=start_variance(settings, imu, known, scenario),
        bias_known=known and scenario.flight.start == "hover",
        gps_position_variance=white_position_variance(gps),
        gps_velocity_variance=white_velocity_variance(gps),
        ins_variance=(EXACT_RAD if gps.model == "white" else LATE_RAD) ** 2,
        reading_age_s=gps.delay_s,
        range_variance=scenario.rangefinder.sigma_m**2 + scenario.rangefinder.resolution_m**2 / 12.0,
        sonar_floor_m=scenario.rangefinder.floor_m,
        lens_below_cg_m=lens_below_cg_m,
        flow_min_height_m=scenario.filter.flow_min_height_m,
        pad_angle_sigma_rad=pad.angle_sigma_rad if pad else 1.0,
        pad_distance_sigma=pad.distance_sigma if pad else 1.0,
        fuse_flow=1.0,
        along_truth=False,
    )


def landing_settings(gps: GpsInsSettings, imu: ImuParameters, flow_scale_sigma: float) -> LandingSettings:
    """Error models of GPS/INS and IMU as their settings state them."""
    midg = gps.model == "midg"
    white = imu.drive / (1.0 - imu.decay) * math.sqrt(EPOCH_S)  # density of the noise once the lag is undone
    step = 1.0 / math.sqrt(EPOCH_S)
    return LandingSettings(
        accel_noise_m_s2_rt_hz=white * imu.accel_sigma_m_s2,
        gyro_noise_rad_s_rt_hz=white * imu.gyro_sigma_rad_s,
        accel_walk_m_s2_rt_s=step * imu.accel_walk_m_s2,
        gyro_walk_rad_s_rt_s=step * imu.gyro_walk_rad_s,
        imu_lag=imu.decay,
        position_walk_m_rt_s=1e-4,
        gps_slow_sigma_m=gps.slow_sigma_m if midg else 0.0,
        gps_slow_sigma_down_m=gps.slow_sigma_down_m if midg else 0.0,
        gps_slow_tau_s=gps.slow_tau_s or EPOCH_S,
        gps_fast_sigma_m=gps.fast_sigma_m if midg else 0.0,
        gps_fast_sigma_down_m=gps.fast_sigma_down_m if midg else 0.0,
        gps_fast_tau_s=gps.fast_tau_s or EPOCH_S,
        gps_velocity_sigma_m_s=gps.velocity_sigma_m_s if midg else 0.0,
        gps_velocity_tau_s=gps.velocity_tau_s or EPOCH_S,
        ins_tilt_sigma_rad=math.radians(gps.tilt_sigma_deg) if midg else 0.0,
        ins_tilt_tau_s=gps.tilt_tau_s or EPOCH_S,
        ins_heading_sigma_rad=math.radians(gps.heading_sigma_deg) if midg else 0.0,
        ins_heading_tau_s=gps.heading_tau_s or EPOCH_S,
        ground_walk_m_rt_s=0.0,
        baro_walk_m_rt_s=0.0,
        flow_scale_sigma=flow_scale_sigma,
        gate_sigma=5.0,
        accel_bias_limit_m_s2=20.0 * imu.accel_bias_m_s2 + 0.1,
        gyro_bias_limit_rad_s=20.0 * imu.gyro_bias_rad_s + 0.01,
    )


def white_position_variance(gps: GpsInsSettings) -> NDArray[np.float64]:
    """The white part of the position noise, and jitter of a short time constant as if it were: 2 sigma^2 tau/dt."""
    if gps.model == "white":
        return np.full(3, gps.white_sigma_m**2)
    jitter = gps.jitter_sigma_m**2 * max(1.0, 2.0 * gps.jitter_tau_s / EPOCH_S)
    return np.full(3, jitter + gps.position_quantum_m**2 / 12.0)


def white_velocity_variance(gps: GpsInsSettings) -> float:
    """The white part of the velocity noise; infinite where the unit offers no velocity."""
    if gps.model == "white":
        return math.inf
    return gps.velocity_white_m_s**2 + gps.velocity_quantum_m_s**2 / 12.0


def start_variance(
    settings: LandingSettings, imu: ImuParameters, known: bool, scenario: Scenario
) -> NDArray[np.float64]:
    """P before the first reading."""
    sigma = np.zeros(STATES)
    hovering = scenario.flight.start == "hover"
    known_position, known_speed = (HOVER_SIGMA_M, HOVER_SPEED_M_S) if hovering else (PAD_SIGMA_M, PAD_SPEED_M_S)
    sigma[POSITION : POSITION + 3] = known_position if known else START_POSITION_M
    sigma[VELOCITY : VELOCITY + 3] = known_speed if known or not hovering else START_SPEED_M_S
    sigma[ATTITUDE : ATTITUDE + 3] = EXACT_RAD if scenario.gps.model == "white" else START_ATTITUDE_RAD
    sigma[GYRO_BIAS : GYRO_BIAS + 3] = imu.gyro_bias_rad_s
    sigma[ACCEL_BIAS : ACCEL_BIAS + 3] = HOVER_ACCEL_BIAS_M_S2 if known and hovering else imu.accel_bias_m_s2
    horizontal, down = slice(0, 2), 2
    for first, level, vertical in (
        (GPS_SLOW, settings.gps_slow_sigma_m, settings.gps_slow_sigma_down_m),
        (GPS_FAST, settings.gps_fast_sigma_m, settings.gps_fast_sigma_down_m),
        (GPS_VELOCITY, settings.gps_velocity_sigma_m_s, settings.gps_velocity_sigma_m_s),
        (INS_ERROR, settings.ins_tilt_sigma_rad, settings.ins_heading_sigma_rad),
    ):
        sigma[first : first + 3][horizontal] = level
        sigma[first + down] = vertical
    sigma[FLOW_SCALE] = settings.flow_scale_sigma
    sigma[FLOW_LAG : FLOW_LAG + 4] = START_LAG
    return np.square(sigma)


def flow_lag(sensor: FlowSensor, flow: FlowParameters, lens_below_cg_m: float) -> FlowLag:
    """The sensor's dynamics over an epoch: its 250 Hz steps with a velocity that goes in a straight line."""
    f11, f12, f21, f22, g1, g2 = second_order_hold(sensor.dynamics.b_1_s, sensor.dynamics.c_1_s2, PERIOD_S)
    step, inlet = np.array([[f11, f12], [f21, f22]]), np.array([g1, g2])
    steps = round(EPOCH_S / PERIOD_S)
    powers = [np.linalg.matrix_power(step, steps - 1 - i) for i in range(steps)]
    start = np.sum([power @ inlet * (1.0 - i / steps) for i, power in enumerate(powers)], axis=0)
    end = np.sum([power @ inlet * (i / steps) for i, power in enumerate(powers)], axis=0)
    whole = np.linalg.matrix_power(step, steps)
    return FlowLag(
        float(whole[0, 0]), float(whole[0, 1]), float(whole[1, 0]), float(whole[1, 1]),
        float(start[0]), float(start[1]), float(end[0]), float(end[1]),
        sensor.dynamics.a_1_s2, flow.sonar_floor_m, lens_below_cg_m,
    )  # fmt: skip
