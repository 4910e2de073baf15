"""Limits of the landing filter's bias states: the last resort against a wrong measurement that passed its gate."""

from __future__ import annotations

from flownav.compile import clamp, equation
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.landing.settings import LandingSettings
from flownav.estimation.landing.states import ACCEL_BIAS, GYRO_BIAS, LandingRows


@equation
def limit_biases(work: Work, lanes: Lanes, rows: LandingRows, settings: LandingSettings) -> None:
    """Hold gyro and accelerometer biases to what such a sensor can have."""
    for i in range(3):
        for lane in range(len(lanes)):
            gyro = work[(rows.state + GYRO_BIAS + i) * len(lanes) + lane]
            limit = settings.gyro_bias_limit_rad_s
            work[(rows.state + GYRO_BIAS + i) * len(lanes) + lane] = clamp(gyro, -limit, limit)
            accel = work[(rows.state + ACCEL_BIAS + i) * len(lanes) + lane]
            limit = settings.accel_bias_limit_m_s2
            work[(rows.state + ACCEL_BIAS + i) * len(lanes) + lane] = clamp(accel, -limit, limit)
