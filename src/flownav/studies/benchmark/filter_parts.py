"""The parts of a step of the landing filter, each in a bare loop, for timing."""

from __future__ import annotations

import numpy as np

from flownav.core.compile import Lanes, Work, kernel, pointer
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import Array
from flownav.estimation.covariance import at, correct, expect, settle
from flownav.estimation.error_models import FilterSettings, propagate_gauss_markov, propagate_walks
from flownav.estimation.laws.flow import flow_rate
from flownav.estimation.motion import errors_in_motion, predict
from flownav.estimation.states import (
    ACCEL_NOISE,
    ACCEPTED,
    COEFFICIENT,
    CROSS,
    GYRO_NOISE,
    IMU,
    INNOVATION_VARIANCE,
    NOISE,
    OBSERVED,
    OFFERED,
    POSITION,
    QUATERNION,
    STATE,
    STATES,
)
from flownav.studies.benchmark.landing_loop import ARRIVED, ATTITUDE_READ, POSITION_READ, RANGE_READ, ROWS

SETTINGS = FilterSettings(
    accel_noise_m_s2_rt_hz=0.05, gyro_noise_rad_s_rt_hz=0.004, accel_walk_m_s2_rt_s=0.003, gyro_walk_rad_s_rt_s=1e-4,
    position_walk_m_rt_s=0.01,
    gps_slow_sigma_m=1.5, gps_slow_sigma_down_m=2.5, gps_slow_tau_s=300.0,
    gps_fast_sigma_m=0.5, gps_fast_sigma_down_m=1.0, gps_fast_tau_s=20.0,
    gps_velocity_sigma_m_s=0.1, gps_velocity_sigma_down_m_s=0.1, gps_velocity_tau_s=5.0,
    ins_tilt_sigma_rad=0.01, ins_tilt_tau_s=30.0, ins_heading_sigma_rad=0.15, ins_heading_tau_s=3e4,
    ground_walk_m_rt_s=0.05, baro_walk_m_rt_s=0.1, pad_walk_m_rt_s=0.0, flow_scale_sigma=0.03,
    gate_sigma=5.0, accel_bias_limit_m_s2=0.6, gyro_bias_limit_rad_s=0.15,
)  # fmt: skip


def standing(lanes: Lanes, n: int = STATES) -> Array:
    """A buffer of filters that hover 5 m above the ground, with readings that agree."""
    rows = np.zeros((ROWS, len(lanes)))
    rows[QUATERNION] = rows[ATTITUDE_READ] = rows[ARRIVED] = rows[OFFERED] = rows[INNOVATION_VARIANCE] = 1.0
    rows[IMU + 5] = -GRAVITY_M_S2
    rows[STATE + POSITION + 2] = rows[POSITION_READ + 2] = -5.0
    rows[RANGE_READ] = 4.9
    rows[ACCEL_NOISE], rows[GYRO_NOISE] = SETTINGS.accel_noise_m_s2_rt_hz**2, SETTINGS.gyro_noise_rad_s_rt_hz**2
    for i in range(n):
        rows[at(i, i)] = 0.01
    rows[OBSERVED : OBSERVED + 11] = np.array([10, 3, 4, 5, 6, 7, 8, 29, 2, 27, 9])[:, None]  # as a flow rate
    rows[COEFFICIENT : COEFFICIENT + 9], rows[CROSS : CROSS + n], rows[NOISE] = 0.1, 1e-8, 1.0
    return rows.reshape(-1)


@kernel
def expect_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """P h' and S of a law that reads nine states."""
    work = pointer(buffer)
    for _ in range(steps):
        expect(work, lanes, STATES, True)


@kernel
def correct_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """State and covariance corrected."""
    work = pointer(buffer)
    for _ in range(steps):
        for lane in range(len(lanes)):
            work[ACCEPTED * len(lanes) + lane] = 1.0
        correct(work, lanes, STATES)


@kernel
def offer_nothing(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """A reading that no lane offers."""
    work = pointer(buffer)
    for lane in range(len(lanes)):
        work[OFFERED * len(lanes) + lane] = 0.0
    for _ in range(steps):
        expect(work, lanes, STATES, False)
        settle(work, lanes, STATES, 5.0)


@kernel
def observe_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """The law of a flow rate."""
    work = pointer(buffer)
    for step in range(steps):
        flow_rate(work, lanes, step % 2, 0.1, 0.0, 0.1, 0.1)


@kernel
def move_covariance(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """The covariance of one prediction."""
    work = pointer(buffer)
    for _ in range(steps):
        errors_in_motion(work, lanes, STATES, 1e-4)


@kernel
def predict_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """A prediction with its random walks."""
    work = pointer(buffer)
    for _ in range(steps):
        predict(work, lanes, STATES, 1e-4, settings)
        propagate_walks(work, lanes, 1e-4, settings)


@kernel
def decay_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """The Gauss-Markov errors, of which one step serves for several predictions."""
    work = pointer(buffer)
    for _ in range(steps):
        propagate_gauss_markov(work, lanes, STATES, 1e-4, settings)
