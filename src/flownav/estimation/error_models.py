"""How the sensors' errors, the ground and the pad change with time: random walks, Gauss-Markov errors, linear models.

A random walk of w per square root of a second gains the variance w^2 dt in dt. A Gauss-Markov error of standard
deviation sigma and time constant tau obeys x <- exp(-dt/tau) x and gains sigma^2 (1 - exp(-2 dt/tau)), which keeps it
at sigma for any dt (Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2013,
section 3.2 and appendix B.4). Motion neither reads nor drives the Gauss-Markov errors, so their steps may be taken
together, later, for as long as no law has read them in between.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, exp, procedure, squared
from flownav.core.measurement import Array
from flownav.estimation.covariance import add_noise, decay
from flownav.estimation.states import (
    ACCEL_BIAS,
    BARO,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GYRO_BIAS,
    INS_ERROR,
    PAD,
)


class FilterSettings(NamedTuple):
    """Noise densities (per square root of hertz), random walks (per square root of a second), standard deviations and
    time constants of Gauss-Markov errors, limits. docs/explanation/landing-filter.md says how to choose each.
    """

    accel_noise_m_s2_rt_hz: float
    gyro_noise_rad_s_rt_hz: float
    accel_walk_m_s2_rt_s: float
    gyro_walk_rad_s_rt_s: float
    position_walk_m_rt_s: float
    gps_slow_sigma_m: float
    gps_slow_sigma_down_m: float
    gps_slow_tau_s: float
    gps_fast_sigma_m: float
    gps_fast_sigma_down_m: float
    gps_fast_tau_s: float
    gps_velocity_sigma_m_s: float
    gps_velocity_sigma_down_m_s: float
    gps_velocity_tau_s: float
    ins_tilt_sigma_rad: float
    ins_tilt_tau_s: float
    ins_heading_sigma_rad: float
    ins_heading_tau_s: float
    baro_walk_m_rt_s: float
    pad_walk_m_rt_s: float
    flow_scale_sigma: float
    gate_sigma: float
    accel_bias_limit_m_s2: float
    gyro_bias_limit_rad_s: float


@procedure
def propagate_walks(work: Work, lanes: Lanes, dt_s: float, settings: FilterSettings) -> None:
    """Random walks, dt on. They must not lag behind the motion, which reads the biases."""
    for axis in range(3):
        add_noise(work, lanes, GYRO_BIAS + axis, squared(settings.gyro_walk_rad_s_rt_s) * dt_s)
        add_noise(work, lanes, ACCEL_BIAS + axis, squared(settings.accel_walk_m_s2_rt_s) * dt_s)
        add_noise(work, lanes, PAD + axis, squared(settings.pad_walk_m_rt_s) * dt_s)
    add_noise(work, lanes, BARO, squared(settings.baro_walk_m_rt_s) * dt_s)


@procedure
def propagate_gauss_markov(work: Work, lanes: Lanes, n: int, dt_s: float, settings: FilterSettings) -> None:
    """Gauss-Markov errors, dt on."""
    slowly, fast = exp(-dt_s / settings.gps_slow_tau_s), exp(-dt_s / settings.gps_fast_tau_s)
    speed = exp(-dt_s / settings.gps_velocity_tau_s)
    tilt, heading = exp(-dt_s / settings.ins_tilt_tau_s), exp(-dt_s / settings.ins_heading_tau_s)
    for axis in range(3):
        down = axis == 2
        sigma = settings.gps_slow_sigma_down_m if down else settings.gps_slow_sigma_m
        forget(work, lanes, n, GPS_SLOW + axis, sigma, slowly)
        sigma = settings.gps_fast_sigma_down_m if down else settings.gps_fast_sigma_m
        forget(work, lanes, n, GPS_FAST + axis, sigma, fast)
        sigma = settings.gps_velocity_sigma_down_m_s if down else settings.gps_velocity_sigma_m_s
        forget(work, lanes, n, GPS_VELOCITY + axis, sigma, speed)
        sigma = settings.ins_heading_sigma_rad if down else settings.ins_tilt_sigma_rad
        forget(work, lanes, n, INS_ERROR + axis, sigma, heading if down else tilt)


@equation
def forget(work: Work, lanes: Lanes, n: int, state: int, sigma: float, factor: float) -> None:
    """x <- factor x, factor = exp(-dt/tau), with the noise that keeps its standard deviation at sigma."""
    decay(work, lanes, n, state, factor)
    add_noise(work, lanes, state, sigma * sigma * (1.0 - factor * factor))


TAYLOR_ORDER = 12  # of a norm of 1/16 at most, whose next term is 4e-26: exact to rounding (test_discretise)


def discretised(a: Array, b: Array, dt_s: float) -> tuple[Array, Array]:
    """Transition (n, n) and input matrix (n, m) of x' = A x + B u over dt: the exponential of [[A, B], [0, 0]] dt.

    Scaling and squaring of the Taylor series, exact to rounding for moderate norms (scipy's expm is the oracle
    in the tests; its import costs more than a whole flight).
    """
    n, inputs = b.shape
    generator = np.zeros((n + inputs, n + inputs))
    generator[:n, :n], generator[:n, n:] = a * dt_s, b * dt_s
    norm = float(np.abs(generator).sum(axis=1).max())
    squarings = max(0, int(np.ceil(np.log2(norm))) + 4) if norm > 0.0 else 0
    step = generator / 2.0**squarings
    term = result = np.eye(n + inputs)
    for order in range(1, TAYLOR_ORDER + 1):
        term = term @ step / order
        result = result + term
    for _ in range(squarings):
        result = result @ result
    return np.ascontiguousarray(result[:n, :n]), np.ascontiguousarray(result[:n, n:])
