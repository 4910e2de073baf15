"""Dense matrices of the filter's error state, written apart from it, for tests of the smoother."""

from __future__ import annotations

import numpy as np

from flownav.estimation.error_models import FilterSettings
from flownav.estimation.states import (
    ACCEL_BIAS,
    ATTITUDE,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GYRO_BIAS,
    INS_ERROR,
    POSITION,
    STATES,
    VELOCITY,
)


def dense_transition(dt_s: float, middle: np.ndarray, force: np.ndarray) -> np.ndarray:
    """F (STATES, STATES) of docs/explanation/landing-filter.md: half of a step before the velocity's, half after it."""
    p, v, a = (slice(first, first + 3) for first in (POSITION, VELOCITY, ATTITUDE))
    gyro, accel = slice(GYRO_BIAS, GYRO_BIAS + 3), slice(ACCEL_BIAS, ACCEL_BIAS + 3)
    rotation = np.asarray(middle).reshape(3, 3)
    x, y, z = force
    position, turn, velocity = np.eye(STATES), np.eye(STATES), np.eye(STATES)
    position[p, v] = 0.5 * dt_s * np.eye(3)
    turn[a, gyro] = -0.5 * dt_s * rotation
    velocity[v, a] = -dt_s * np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    velocity[v, accel] = -dt_s * rotation
    return position @ turn @ velocity @ turn @ position


def dense_decay(dt_s: float, settings: FilterSettings) -> np.ndarray:
    """The diagonal transition (STATES, STATES) of the Gauss-Markov errors."""
    errors = np.ones(STATES)
    tau_s = {GPS_SLOW: settings.gps_slow_tau_s, GPS_FAST: settings.gps_fast_tau_s,
             GPS_VELOCITY: settings.gps_velocity_tau_s, INS_ERROR: settings.ins_tilt_tau_s}  # fmt: skip
    for first, tau in tau_s.items():
        errors[first : first + 3] = np.exp(-dt_s / tau)
    errors[INS_ERROR + 2] = np.exp(-dt_s / settings.ins_heading_tau_s)
    return np.diag(errors)


def smoother_gain(covariance: np.ndarray, transition: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """C = P F' P_predicted^-1 on the states that have a variance, in units of their standard deviations."""
    known = np.flatnonzero(np.diag(predicted) > 0.0)
    scale = 1.0 / np.sqrt(np.diag(predicted)[known])
    unit = predicted[np.ix_(known, known)] * np.outer(scale, scale)
    gain = np.zeros((STATES, STATES))
    gain[:, known] = np.linalg.solve(unit, scale[:, None] * (transition @ covariance)[known]).T * scale
    return gain
