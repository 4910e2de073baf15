"""The landing filter called as plain Python: one lane of rows, its error parametrisation, derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st

from flownav.compile import ONE_LANE
from flownav.estimation.landing.algebra import fuse
from flownav.estimation.landing.settings import FlowLag, LandingSettings
from flownav.estimation.landing.states import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO,
    FLOW_LAG,
    FLOW_SCALE,
    GPS_FAST,
    GROUND,
    GYRO_BIAS,
    INS_ERROR,
    LANDING_ROW_COUNT,
    POSITION,
    STATES,
    VELOCITY,
    landing_rows,
)
from flownav.frames import quaternion_from_euler
from flownav.sensors.second_order import second_order_hold

ROWS = landing_rows(0)
READING = LANDING_ROW_COUNT  # eight rows for what is read
ROW_COUNT = READING + 8
STEP = 1e-30  # complex step: no cancellation, so as small as one likes

# every error model its own figure, so that a swapped one shows
SETTINGS = LandingSettings(
    accel_noise_m_s2_rt_hz=0.03, gyro_noise_rad_s_rt_hz=0.002, accel_walk_m_s2_rt_s=0.001, gyro_walk_rad_s_rt_s=1e-4,
    imu_lag=0.0, position_walk_m_rt_s=0.01,
    gps_slow_sigma_m=1.5, gps_slow_sigma_down_m=2.5, gps_slow_tau_s=300.0,
    gps_fast_sigma_m=0.4, gps_fast_sigma_down_m=0.7, gps_fast_tau_s=8.0,
    gps_velocity_sigma_m_s=0.1, gps_velocity_tau_s=3.0,
    ins_tilt_sigma_rad=0.01, ins_tilt_tau_s=60.0, ins_heading_sigma_rad=0.03, ins_heading_tau_s=120.0,
    ground_walk_m_rt_s=0.02, baro_walk_m_rt_s=0.05, flow_scale_sigma=0.02,
    gate_sigma=5.0, accel_bias_limit_m_s2=1.0, gyro_bias_limit_rad_s=0.1,
)  # fmt: skip
SILENT = SETTINGS._replace(
    accel_noise_m_s2_rt_hz=0.0, gyro_noise_rad_s_rt_hz=0.0, accel_walk_m_s2_rt_s=0.0, gyro_walk_rad_s_rt_s=0.0,
    position_walk_m_rt_s=0.0, gps_slow_sigma_m=0.0, gps_slow_sigma_down_m=0.0, gps_fast_sigma_m=0.0,
    gps_fast_sigma_down_m=0.0, gps_velocity_sigma_m_s=0.0, ins_tilt_sigma_rad=0.0, ins_heading_sigma_rad=0.0,
    ground_walk_m_rt_s=0.0, baro_walk_m_rt_s=0.0,
)  # fmt: skip


def paper_lag(dt_s: float, sonar_floor_m: float = 0.3, lens_below_m: float = 0.1) -> FlowLag:
    """The paper's G(s) = 196.9/(s^2 + 14.8 s + 191.9) over dt with a velocity that goes in a straight line.

    From the zero-order hold alone: the integral of the step response, by the rest state of a ramp.
    """
    a, b, c = 196.9, 14.8, 191.9
    f11, f12, f21, f22, g1, g2 = second_order_hold(b, c, dt_s)
    f, hold = np.array([[f11, f12], [f21, f22]]), np.array([g1, g2])
    ramp = np.array([-b / c**2, 1.0 / c])  # x of a ramp t: (t/c, 0) + ramp
    end = (np.array([dt_s / c, 0.0]) + ramp - f @ ramp) / dt_s
    return FlowLag(*f.ravel(), *(hold - end), *end, a, sonar_floor_m, lens_below_m)


class Landing:
    """One vehicle's filter in a buffer of float64 or complex numbers."""

    lanes = ONE_LANE

    def __init__(self, dtype: type = np.float64) -> None:
        self.work = np.zeros(ROW_COUNT, dtype)
        self.work[ROWS.attitude] = 1.0
        self.work[ROWS.offered] = 1.0

    def copy(self, dtype: type = np.float64) -> Landing:
        other = Landing(dtype)
        other.work[:] = self.work
        return other

    def rows(self, first: int, count: int) -> np.ndarray:
        return self.work[first : first + count]

    @property
    def x(self) -> np.ndarray:
        return self.rows(ROWS.state, STATES)

    @property
    def q(self) -> np.ndarray:
        return self.rows(ROWS.attitude, 4)

    @property
    def p(self) -> np.ndarray:
        return self.rows(ROWS.covariance, STATES**2).reshape(STATES, STATES)

    @property
    def reading(self) -> np.ndarray:
        return self.rows(READING, 8)

    @property
    def rotation(self) -> np.ndarray:
        return rotation_of(self.q)

    def err(self, error: np.ndarray) -> Landing:
        """The state that is truth where this one is wrong by `error`: additive, and (1, theta/2) q."""
        true = self.copy(np.result_type(error, self.work).type)
        true.x[:] += error
        true.x[ATTITUDE : ATTITUDE + 3] = self.x[ATTITUDE : ATTITUDE + 3]
        true.q[:] = product(np.concatenate([[1.0], 0.5 * error[ATTITUDE : ATTITUDE + 3]]), self.q)
        return true

    def error_of(self, true: Landing) -> np.ndarray:
        """The error of this state, where `true` is the truth, first order."""
        error = true.x - self.x
        turn = product(true.q, self.q * [1.0, -1.0, -1.0, -1.0])
        error[ATTITUDE : ATTITUDE + 3] = 2.0 * turn[1:] / turn[0]
        return error

    def set_coefficients(self, values: Sequence[float] | np.ndarray) -> None:
        self.rows(ROWS.coefficient, np.size(values))[:] = np.ravel(values)

    def offer(self, innovation: float, variance: float, offered: float = 1.0) -> None:
        self.work[[ROWS.innovation, ROWS.noise, ROWS.offered]] = innovation, variance, offered

    def fuse(self, index: tuple[int, ...], gate: float = 1e6) -> bool:
        fuse(self.work, self.lanes, ROWS, index, gate)
        return bool(self.work[ROWS.accepted] > 0.0)

    def jacobian_row(self, index: tuple[int, ...]) -> np.ndarray:
        """Dense h of the law just observed."""
        h = np.zeros(STATES)
        h[list(index)] = self.rows(ROWS.coefficient, len(index)).real
        return h


# -- rotations, written out apart from the package's ---------------------------------------------------------
def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product."""
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], vector])


def rotation_of(q: np.ndarray) -> np.ndarray:
    """R of a unit quaternion: the columns are q e q*."""
    conjugate = q * np.array([1.0, -1.0, -1.0, -1.0])
    return np.column_stack([product(product(q, np.concatenate([[0.0], e])), conjugate)[1:] for e in np.eye(3)])


def cross_matrix(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


# -- derivatives ---------------------------------------------------------------------------------------------
def innovation_gradient(filter_: Landing, observe: Callable[[Landing], None], complex_step: bool = True) -> np.ndarray:
    """-d innovation / d error: the Jacobian of what a law predicts, by complex step or fourth-order differences."""
    gradient = np.zeros(STATES)
    for i, unit in enumerate(np.eye(STATES)):
        if complex_step:
            gradient[i] = -_innovation(filter_.err(1j * STEP * unit), observe).imag / STEP
        else:
            far, near = 2e-4, 1e-4
            wide = (_innovation(filter_.err(far * unit), observe) - _innovation(filter_.err(-far * unit), observe)) / (
                2.0 * far
            )
            slim = (
                _innovation(filter_.err(near * unit), observe) - _innovation(filter_.err(-near * unit), observe)
            ) / (2.0 * near)
            gradient[i] = -(4.0 * slim - wide) / 3.0
    return gradient


def _innovation(filter_: Landing, observe: Callable[[Landing], None]) -> Any:
    observe(filter_)
    return filter_.work[ROWS.innovation]


def step_jacobian(
    filter_: Landing, advance: Callable[[Landing], None], states: Iterable[int] = range(STATES)
) -> np.ndarray:
    """d(error after)/d(error before) of a nonlinear step, by complex step; a column for each of `states`."""
    columns = []
    after = filter_.copy(np.complex128)
    advance(after)
    for state in states:
        true = filter_.err(1j * STEP * np.eye(STATES)[state])
        advance(true)
        columns.append(after.error_of(true).imag / STEP)
    return np.column_stack(columns)


def transition_of(filter_: Landing, advance: Callable[[Landing], None]) -> np.ndarray:
    """F of a covariance step P -> F P F' without noise: P = e e' comes out as f f', f the column of F."""
    columns = []
    for i, unit in enumerate(np.eye(STATES)):
        run = filter_.copy()
        run.p[:] = np.outer(unit, unit)
        advance(run)
        columns.append(run.p[:, i] / np.sqrt(run.p[i, i]))
    return np.column_stack(columns)


# -- random filters ------------------------------------------------------------------------------------------
def random_covariance(random: np.random.Generator, scale: float = 1.0) -> np.ndarray:
    """A dense positive definite covariance, exactly symmetric."""
    root = random.normal(size=(STATES, STATES))
    p = scale * (root @ root.T / STATES + 0.1 * np.eye(STATES))
    return np.tril(p) + np.tril(p, -1).T


SPREAD = np.ones(STATES)
SPREAD[POSITION : POSITION + 3] = 5.0
SPREAD[VELOCITY : VELOCITY + 3] = 3.0
SPREAD[ATTITUDE : ATTITUDE + 3] = 0.0  # the nominal error of attitude is zero between corrections
SPREAD[GYRO_BIAS : GYRO_BIAS + 3] = 0.01
SPREAD[ACCEL_BIAS : ACCEL_BIAS + 3] = 0.1
SPREAD[GPS_FAST:INS_ERROR] = 0.5
SPREAD[INS_ERROR : INS_ERROR + 3] = 0.02
SPREAD[GROUND] = SPREAD[BARO] = 0.5
SPREAD[FLOW_SCALE] = 0.05
SPREAD[FLOW_LAG : FLOW_LAG + 4] = 0.01


def landing(seed: int, roll: float, pitch: float, yaw: float, height_m: float) -> Landing:
    """A filter at an attitude and a height above its ground, everything else drawn by the seed."""
    random = np.random.default_rng(seed)
    filter_ = Landing()
    filter_.x[:] = SPREAD * random.normal(size=STATES)
    filter_.x[POSITION + 2] = filter_.x[GROUND] - height_m
    filter_.q[:] = quaternion_from_euler(roll, pitch, yaw)
    filter_.rows(ROWS.change, 6)[:] = 0.01 * random.normal(size=6)
    filter_.work[ROWS.change + 6] = 1.0
    filter_.rows(ROWS.imu, 6)[:] = random.normal([0, 0, 0, 0, 0, -9.8], [0.5, 0.5, 0.5, 2, 2, 2])
    filter_.rows(ROWS.imu_before, 6)[:] = filter_.rows(ROWS.imu, 6) + 0.1 * random.normal(size=6)
    filter_.reading[:] = random.normal(size=8)
    return filter_


def filters(least_m: float = 0.6, most_m: float = 40.0) -> st.SearchStrategy[Landing]:
    """Filters at random states: any heading, tilts up to 34 degrees."""
    tilt = st.floats(-0.6, 0.6)
    return st.builds(landing, st.integers(0, 2**32 - 1), tilt, tilt, st.floats(-3.14, 3.14), st.floats(least_m, most_m))
