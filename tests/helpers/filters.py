"""The filter called as plain Python: one lane of rows, its error parametrisation, derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st

from flownav.core.compile import ONE_LANE
from flownav.core.frames import quaternion_from_euler
from flownav.estimation.covariance import fuse
from flownav.estimation.error_models import FilterSettings
from flownav.estimation.lag import FlowLag
from flownav.estimation.states import (
    ACCEL_BIAS,
    ACCEL_NOISE,
    ACCEPTED,
    ATTITUDE,
    BARO,
    COEFFICIENT,
    CONSIDERS,
    COVARIANCE,
    FILTER_ROWS,
    FLOW_LAG,
    FLOW_SCALE,
    FORCE,
    GPS_FAST,
    GROUND,
    GYRO_BIAS,
    GYRO_NOISE,
    IMU,
    INNOVATION,
    INS_ERROR,
    MEASURED,
    NOISE,
    OBSERVED,
    OFFERED,
    POSITION,
    QUATERNION,
    RATE,
    STATE,
    STATES_WITH_LAG,
    VELOCITY,
    VELOCITY_LAG,
)
from flownav.sensors.processes import second_order_hold
from packed_covariance import pack, unpack

N = STATES_WITH_LAG
ELEMENTS = N * (N + 1) // 2
STEP = 1e-30  # complex step: no cancellation, so as small as one likes
KEPT = (*range(STATE, STATE + N), *range(QUATERNION, QUATERNION + 4), *range(COVARIANCE, COVARIANCE + ELEMENTS))

# every error model its own figure, so that a swapped one shows
SETTINGS = FilterSettings(
    accel_noise_m_s2_rt_hz=0.03, gyro_noise_rad_s_rt_hz=0.002, accel_walk_m_s2_rt_s=0.001, gyro_walk_rad_s_rt_s=1e-4,
    position_walk_m_rt_s=0.01,
    gps_slow_sigma_m=1.5, gps_slow_sigma_down_m=2.5, gps_slow_tau_s=300.0,
    gps_fast_sigma_m=0.4, gps_fast_sigma_down_m=0.7, gps_fast_tau_s=8.0,
    gps_velocity_sigma_m_s=0.1, gps_velocity_sigma_down_m_s=0.16, gps_velocity_tau_s=3.0,
    ins_tilt_sigma_rad=0.01, ins_tilt_tau_s=60.0, ins_heading_sigma_rad=0.03, ins_heading_tau_s=120.0,
    baro_walk_m_rt_s=0.05, pad_walk_m_rt_s=0.007, flow_scale_sigma=0.02,
    gate_sigma=5.0, accel_bias_limit_m_s2=1.0, gyro_bias_limit_rad_s=0.1,
)  # fmt: skip
SILENT = SETTINGS._replace(
    accel_noise_m_s2_rt_hz=0.0, gyro_noise_rad_s_rt_hz=0.0, accel_walk_m_s2_rt_s=0.0, gyro_walk_rad_s_rt_s=0.0,
    position_walk_m_rt_s=0.0, gps_slow_sigma_m=0.0, gps_slow_sigma_down_m=0.0, gps_fast_sigma_m=0.0,
    gps_fast_sigma_down_m=0.0, gps_velocity_sigma_m_s=0.0, gps_velocity_sigma_down_m_s=0.0,
    ins_tilt_sigma_rad=0.0, ins_heading_sigma_rad=0.0,
    baro_walk_m_rt_s=0.0, pad_walk_m_rt_s=0.0,
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


class Filter:
    """One vehicle's filter, all its 40 states, in a buffer of float64 or complex numbers."""

    lanes = ONE_LANE

    def __init__(self, dtype: type = np.float64) -> None:
        self.work = np.zeros(FILTER_ROWS, dtype)
        self.work[QUATERNION] = 1.0
        self.work[[OFFERED, CONSIDERS]] = 1.0

    def copy(self, dtype: type = np.float64) -> Filter:
        other = Filter(dtype)
        other.work[:] = self.work
        return other

    def rows(self, first: int, count: int) -> np.ndarray:
        return self.work[first : first + count]

    @property
    def x(self) -> np.ndarray:
        return self.rows(STATE, N)

    @property
    def q(self) -> np.ndarray:
        return self.rows(QUATERNION, 4)

    @property
    def p(self) -> np.ndarray:
        """P (N, N), a copy; set it to put one in."""
        return unpack(self.work, ONE_LANE, 0, N)

    @p.setter
    def p(self, covariance: np.ndarray) -> None:
        pack(self.work, ONE_LANE, 0, N, covariance)

    @property
    def reading(self) -> np.ndarray:
        return self.rows(MEASURED, 8)

    @property
    def rotation(self) -> np.ndarray:
        return rotation_of(self.q)

    @property
    def kept(self) -> bytes:
        """Every bit of state, attitude and covariance."""
        return self.work[list(KEPT)].tobytes()

    def err(self, error: np.ndarray) -> Filter:
        """The state that is truth where this one is wrong by `error`: additive, and (1, theta/2) q."""
        true = self.copy(np.result_type(error, self.work).type)
        true.x[:] += error
        true.x[ATTITUDE : ATTITUDE + 3] = self.x[ATTITUDE : ATTITUDE + 3]
        true.q[:] = product(np.concatenate([[1.0], 0.5 * error[ATTITUDE : ATTITUDE + 3]]), self.q)
        return true

    def error_of(self, true: Filter) -> np.ndarray:
        """The error of this state, where `true` is the truth, first order."""
        error = true.x - self.x
        turn = product(true.q, self.q * [1.0, -1.0, -1.0, -1.0])
        error[ATTITUDE : ATTITUDE + 3] = 2.0 * turn[1:] / turn[0]
        return error

    def observe(self, index: Sequence[int], coefficients: Sequence[float] | np.ndarray) -> None:
        """An observation of some states, whatever its law."""
        self.work[OBSERVED] = len(index)
        self.rows(OBSERVED + 1, len(index))[:] = index
        self.rows(COEFFICIENT, len(index))[:] = coefficients

    def offer(self, innovation: float, variance: float, offered: float = 1.0) -> None:
        self.work[[INNOVATION, NOISE, OFFERED]] = innovation, variance, offered

    def fuse(self, gate: float = 1e6) -> bool:
        fuse(self.work, ONE_LANE, N, gate)
        return bool(self.work[ACCEPTED] > 0.0)

    @property
    def jacobian(self) -> np.ndarray:
        """Dense h of the law just observed."""
        h = np.zeros(N)
        count = int(self.work[OBSERVED].real)
        np.add.at(h, self.rows(OBSERVED + 1, count).real.astype(int), self.rows(COEFFICIENT, count).real)
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
def innovation_gradient(filter_: Filter, observe: Callable[[Filter], None], complex_step: bool = True) -> np.ndarray:
    """-d innovation / d error: the Jacobian of what a law predicts, by complex step or fourth-order differences."""
    gradient = np.zeros(N)
    for i, unit in enumerate(np.eye(N)):
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


def _innovation(filter_: Filter, observe: Callable[[Filter], None]) -> Any:
    observe(filter_)
    return filter_.work[INNOVATION]


def step_jacobian(filter_: Filter, advance: Callable[[Filter], None], states: Iterable[int] = range(N)) -> np.ndarray:
    """d(error after)/d(error before) of a nonlinear step, by complex step; a column for each of `states`."""
    columns = []
    after = filter_.copy(np.complex128)
    advance(after)
    for state in states:
        true = filter_.err(1j * STEP * np.eye(N)[state])
        advance(true)
        columns.append(after.error_of(true).imag / STEP)
    return np.column_stack(columns)


def transition_of(filter_: Filter, advance: Callable[[Filter], None]) -> np.ndarray:
    """F of a covariance step P -> F P F' without noise: P = e e' comes out as f f', f the column of F."""
    columns = []
    for i, unit in enumerate(np.eye(N)):
        run = filter_.copy()
        run.p = np.outer(unit, unit)
        advance(run)
        columns.append(run.p[:, i] / np.sqrt(run.p[i, i]))
    return np.column_stack(columns)


# -- random filters ------------------------------------------------------------------------------------------
def random_covariance(random: np.random.Generator, scale: float = 1.0) -> np.ndarray:
    """A dense positive definite covariance, exactly symmetric."""
    root = random.normal(size=(N, N))
    p = scale * (root @ root.T / N + 0.1 * np.eye(N))
    return np.tril(p) + np.tril(p, -1).T


SPREAD = np.ones(N)
SPREAD[POSITION : POSITION + 3] = 5.0
SPREAD[VELOCITY : VELOCITY + 3] = 3.0
SPREAD[ATTITUDE : ATTITUDE + 3] = 0.0  # the nominal error of attitude is zero between corrections
SPREAD[GYRO_BIAS : GYRO_BIAS + 3] = 0.01
SPREAD[ACCEL_BIAS : ACCEL_BIAS + 3] = 0.1
SPREAD[GPS_FAST:INS_ERROR] = 0.5
SPREAD[INS_ERROR : INS_ERROR + 3] = 0.02
SPREAD[GROUND] = SPREAD[BARO] = 0.5
SPREAD[FLOW_SCALE] = 0.05
SPREAD[VELOCITY_LAG] = 0.1
SPREAD[FLOW_LAG : FLOW_LAG + 4] = 0.01


def filter_at(seed: int, roll: float, pitch: float, yaw: float, height_m: float) -> Filter:
    """A filter at an attitude and a height above its ground, everything else drawn by the seed."""
    random = np.random.default_rng(seed)
    filter_ = Filter()
    filter_.x[:] = SPREAD * random.normal(size=N)
    filter_.x[POSITION + 2] = filter_.x[GROUND] - height_m
    filter_.q[:] = quaternion_from_euler(roll, pitch, yaw)
    filter_.rows(IMU, 6)[:] = random.normal([0, 0, 0, 0, 0, -9.8], [0.5, 0.5, 0.5, 2, 2, 2])
    filter_.rows(RATE, 3)[:] = random.normal(0.0, 0.5, 3)
    filter_.rows(FORCE, 3)[:] = random.normal([0, 0, -9.8], 2.0)
    filter_.work[ACCEL_NOISE : ACCEL_NOISE + 2] = SETTINGS.accel_noise_m_s2_rt_hz**2
    filter_.work[GYRO_NOISE] = SETTINGS.gyro_noise_rad_s_rt_hz**2
    filter_.reading[:] = random.normal(size=8)
    return filter_


def filters(least_m: float = 0.6, most_m: float = 40.0) -> st.SearchStrategy[Filter]:
    """Filters at random states: any heading, tilts up to 34 degrees."""
    tilt = st.floats(-0.6, 0.6)
    return st.builds(
        filter_at, st.integers(0, 2**32 - 1), tilt, tilt, st.floats(-3.14, 3.14), st.floats(least_m, most_m)
    )
