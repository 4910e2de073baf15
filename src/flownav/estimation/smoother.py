"""The filter's steps run backwards: a modified Bryson-Frazier smoother (docs/explanation/smoother.md).

The information of later readings on the error state at an instant is a vector lambda (STATES,) and a matrix Lambda
(STATES, STATES), both 0 at the end; the smoothed error is -P lambda, its covariance P - P Lambda P (Bierman, Fixed
interval smoothing with discrete measurements, International Journal of Control 18, 1973). Nothing is inverted, so
states without variance and states that were reset do no harm. Process noise has no part in it: it is in the filter's
covariances.
"""

import numpy as np

from flownav.core.compile import equation, exp, kernel
from flownav.core.measurement import Array
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


@equation
def back_along_motion(x: Array, dt_s: float, middle: Array, force: Array) -> None:
    """x <- F' x for the transition F of `motion.errors_in_motion`, whose lines it transposes, the last first.

    u . (theta x f) = theta . (f x u).
    """
    half_s = 0.5 * dt_s
    for i in range(3):
        x[VELOCITY + i] += half_s * x[POSITION + i]  # the adjoint of the velocity after the step
    north, east, down = x[VELOCITY], x[VELOCITY + 1], x[VELOCITY + 2]
    asked = (
        dt_s * (force[1] * down - force[2] * east),
        dt_s * (force[2] * north - force[0] * down),
        dt_s * (force[0] * east - force[1] * north),
    )
    for j in range(3):
        for i in range(3):
            x[GYRO_BIAS + j] -= middle[3 * i + j] * (dt_s * x[ATTITUDE + i] + half_s * asked[i])
            x[ACCEL_BIAS + j] -= middle[3 * i + j] * dt_s * x[VELOCITY + i]
    for i in range(3):
        x[ATTITUDE + i] += asked[i]
        x[VELOCITY + i] += half_s * x[POSITION + i]


@kernel
def back_over_prediction(vector: Array, matrix: Array, dt_s: float, middle: Array, force: Array) -> None:
    """lambda <- F' lambda and Lambda <- F' Lambda F of one `motion.predict`.

    middle (9,) is R_EB in the middle of the prediction, row by row; force (3,) the specific force, earth NED [m/s2].
    """
    back_along_motion(vector, dt_s, middle, force)
    for _ in range(2):  # by rows, transposed, by rows again
        for i in range(STATES):
            back_along_motion(matrix[i], dt_s, middle, force)
        for i in range(STATES):
            for j in range(i):
                matrix[i, j], matrix[j, i] = matrix[j, i], matrix[i, j]
    for i in range(STATES):
        for j in range(i):
            matrix[i, j] = matrix[j, i] = 0.5 * (matrix[i, j] + matrix[j, i])


@kernel
def decay_factors(dt_s: float, settings: FilterSettings) -> Array:
    """Factors by which `error_models.propagate_gauss_markov` multiplies each state, (STATES,): less than 1 for such
    errors.
    """
    factor = np.ones(STATES)
    for i in range(3):
        factor[GPS_SLOW + i] = exp(-dt_s / settings.gps_slow_tau_s)
        factor[GPS_FAST + i] = exp(-dt_s / settings.gps_fast_tau_s)
        factor[GPS_VELOCITY + i] = exp(-dt_s / settings.gps_velocity_tau_s)
        tau_s = settings.ins_heading_tau_s if i == 2 else settings.ins_tilt_tau_s
        factor[INS_ERROR + i] = exp(-dt_s / tau_s)
    return factor


@kernel
def back_over_decay(vector: Array, matrix: Array, dt_s: float, settings: FilterSettings) -> None:
    """lambda <- D lambda and Lambda <- D Lambda D of one `error_models.propagate_gauss_markov`."""
    factor = decay_factors(dt_s, settings)
    for i in range(STATES):
        vector[i] *= factor[i]
        for j in range(STATES):
            matrix[i, j] *= factor[i] * factor[j]


@kernel
def back_over_correction(
    vector: Array, matrix: Array, jacobian: Array, gain: Array, innovation: float, variance: float
) -> None:
    """One scalar correction with h and K (STATES,), nu and S = h P h' + R, undone.

    lambda <- (I - K h)' lambda - h' nu/S;  Lambda <- (I - K h)' Lambda (I - K h) + h' h/S, written out.
    """
    seen = np.zeros(STATES)  # Lambda K
    along, total = 0.0, 1.0 / variance
    for i in range(STATES):
        for j in range(STATES):
            seen[i] += matrix[i, j] * gain[j]
        along += gain[i] * vector[i]
        total += gain[i] * seen[i]
    for i in range(STATES):
        vector[i] -= jacobian[i] * (along + innovation / variance)
        for j in range(STATES):
            crossed = jacobian[i] * seen[j] + seen[i] * jacobian[j]
            matrix[i, j] += jacobian[i] * jacobian[j] * total - crossed


@kernel
def back_over_reset(vector: Array, matrix: Array, state: int) -> None:
    """A state that was forgotten: later readings carry no information on its value before."""
    vector[state] = 0.0
    for i in range(STATES):
        matrix[state, i] = matrix[i, state] = 0.0


@kernel
def smoothed_covariance(covariance: Array, matrix: Array) -> Array:
    """P - P Lambda P, symmetric to the last bit.

    Written out: Numba puts the path of this file into an expression of whole arrays, and a wheel would carry it.
    """
    product = covariance @ matrix @ covariance
    found = np.empty_like(product)
    for i in range(len(product)):
        for j in range(len(product)):
            ahead, across = covariance[i, j] - product[i, j], covariance[j, i] - product[j, i]
            found[i, j] = 0.5 * (ahead + across)
    return found
