"""Limits of the landing filter's bias states: the last resort against a wrong measurement that passed its gate."""

from __future__ import annotations

from flownav.compile import clamp, equation
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.landing.settings import LandingSettings
from flownav.estimation.landing.states import ACCEL_BIAS, GYRO_BIAS, LandingRows


@equation
def hold(work: Work, lanes: Lanes, rows: LandingRows, state: int, limit: float) -> None:
    """One state held between -limit and limit."""
    for lane in range(len(lanes)):
        value = work[(rows.state + state) * len(lanes) + lane]
        work[(rows.state + state) * len(lanes) + lane] = clamp(value, -limit, limit)


@equation
def limit_biases(work: Work, lanes: Lanes, rows: LandingRows, settings: LandingSettings) -> None:
    """Hold gyro and accelerometer biases to what such a sensor can have."""
    for i in range(3):
        hold(work, lanes, rows, GYRO_BIAS + i, settings.gyro_bias_limit_rad_s)
        hold(work, lanes, rows, ACCEL_BIAS + i, settings.accel_bias_limit_m_s2)
