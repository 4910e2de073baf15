"""The filter's motion: strapdown axioms, its transition against complex step, its noise against Van Loan.

What the discretisation promises: the transition is the derivative of the filter's own nonlinear step, but for the gyro
bias, whose columns are right to second order in the turn of a step; against the continuous motion every element is
right to second order in the step, so the error of one step falls eightfold when the step is halved. Process noise is
white noise added at the end of a step, first order.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from filters import (
    SETTINGS,
    SILENT,
    Filter,
    N,
    cross_matrix,
    filter_at,
    filters,
    product,
    random_covariance,
    rotation_of,
    step_jacobian,
    transition_of,
)
from flownav.core.compile import ONE_LANE
from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler
from flownav.estimation.error_models import FilterSettings, propagate_walks
from flownav.estimation.motion import add_motion_noise, hold_still, predict, turned
from flownav.estimation.states import (
    ACCEL_BIAS,
    ACCEL_NOISE,
    ATTITUDE,
    FORCE,
    GYRO_BIAS,
    GYRO_NOISE,
    IMU,
    MIDDLE,
    POSITION,
    RATE,
    STATES,
    VELOCITY,
)

GRAVITY = np.array([0.0, 0.0, GRAVITY_M_S2])
EPOCH_S = 0.02
GYRO, ACCEL = slice(IMU, IMU + 3), slice(IMU + 3, IMU + 6)
GYRO_COLUMNS = range(GYRO_BIAS, GYRO_BIAS + 3)
OTHER_COLUMNS = [i for i in range(N) if i not in GYRO_COLUMNS]
EXAMPLES = settings(max_examples=8, deadline=None)


def advance(filter_: Filter, dt_s: float, numbers: FilterSettings = SILENT, n: int = N) -> None:
    filter_.work[ACCEL_NOISE : ACCEL_NOISE + 2] = numbers.accel_noise_m_s2_rt_hz**2
    filter_.work[GYRO_NOISE] = numbers.gyro_noise_rad_s_rt_hz**2
    predict(filter_.work, ONE_LANE, n, dt_s, numbers)


def read_imu(filter_: Filter, gyro, accel) -> None:
    filter_.work[GYRO], filter_.work[ACCEL] = gyro, accel


# -- the same motion, written apart -----------------------------------------------------------------------------
def half_turn(phi: np.ndarray) -> np.ndarray:
    """The quaternion of a rotation vector, for complex numbers too."""
    angle = np.sqrt(phi @ phi)
    return np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) / angle * phi])


def step_apart(filter_: Filter, dt_s: float) -> None:
    """The filter's nonlinear step with exact rotations and dense matrices."""
    x = filter_.x
    rate = filter_.work[GYRO] - x[GYRO_BIAS : GYRO_BIAS + 3]
    force = filter_.work[ACCEL] - x[ACCEL_BIAS : ACCEL_BIAS + 3]
    middle = rotation_of(product(filter_.q, half_turn(0.5 * dt_s * rate)))
    accel = middle @ force + GRAVITY
    x[POSITION : POSITION + 3] += dt_s * x[VELOCITY : VELOCITY + 3] + 0.5 * dt_s**2 * accel
    x[VELOCITY : VELOCITY + 3] += dt_s * accel
    filter_.q[:] = product(filter_.q, half_turn(dt_s * rate))


def flow_of_motion(filter_: Filter, duration_s: float, steps: int = 12) -> None:
    """The continuous motion by Runge-Kutta: p' = v, v' = R f + g, q' = q w/2."""
    rate = filter_.work[GYRO] - filter_.x[GYRO_BIAS : GYRO_BIAS + 3]
    force = filter_.work[ACCEL] - filter_.x[ACCEL_BIAS : ACCEL_BIAS + 3]
    spin = np.concatenate([[0.0], 0.5 * rate])

    def slope(y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[3:6], rotation_of(y[6:]) @ force + GRAVITY, product(y[6:], spin)])

    y, h = np.concatenate([filter_.x[:6], filter_.q]), duration_s / steps
    for _ in range(steps):
        k1 = slope(y)
        k2 = slope(y + 0.5 * h * k1)
        k3 = slope(y + 0.5 * h * k2)
        y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + slope(y + h * k3))
    filter_.x[:6], filter_.q[:] = y[:6], y[6:]


# -- the transition ----------------------------------------------------------------------------------------------
def gyro_column_bound(filter_: Filter, dt_s: float) -> float:
    """dt phi^2 of attitude and dt^2 f phi of velocity, what the middle of the step stands for."""
    phi = dt_s * np.linalg.norm(filter_.work[GYRO] - filter_.x[GYRO_BIAS : GYRO_BIAS + 3])
    force = np.linalg.norm(filter_.work[ACCEL] - filter_.x[ACCEL_BIAS : ACCEL_BIAS + 3])
    return dt_s * phi * (phi / 24.0 + dt_s * force / 8.0)


@EXAMPLES
@given(filters(0.15, 5.0))
def test_the_step_is_the_nonlinear_one(filter_):
    apart = filter_.copy()
    step_apart(apart, EPOCH_S)
    rate = filter_.work[GYRO] - filter_.x[GYRO_BIAS : GYRO_BIAS + 3]
    force = filter_.work[ACCEL] - filter_.x[ACCEL_BIAS : ACCEL_BIAS + 3]
    middle = rotation_of(product(filter_.q, half_turn(0.5 * EPOCH_S * rate)))
    advance(filter_, EPOCH_S)
    assert np.allclose(filter_.x, apart.x, rtol=0, atol=1e-9)
    assert np.allclose(filter_.q, apart.q, rtol=0, atol=1e-9)
    assert filter_.rows(RATE, 3) == pytest.approx(rate)
    assert filter_.rows(MIDDLE, 9) == pytest.approx(middle.ravel(), abs=1e-9)
    assert filter_.rows(FORCE, 3) == pytest.approx(middle @ force, abs=1e-7)


@EXAMPLES
@given(filters(0.15, 5.0))
def test_the_transition_is_the_derivative_of_the_nonlinear_step(filter_):
    ours = transition_of(filter_, lambda run: advance(run, EPOCH_S))
    theirs = step_jacobian(filter_, lambda run: step_apart(run, EPOCH_S))
    size = np.abs(theirs).max(axis=1, keepdims=True)
    assert np.all(np.abs(ours - theirs)[:, OTHER_COLUMNS] <= 2e-8 * size)
    bound = gyro_column_bound(filter_, EPOCH_S)
    assert np.all(np.abs(ours - theirs)[:, GYRO_COLUMNS] <= 1.1 * bound + 2e-8 * size)


@settings(max_examples=3, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_against_the_continuous_motion_the_transition_is_of_second_order(seed):
    """Half the step, an eighth of the error of one step, in every block that has one."""
    filter_ = filter_at(seed, 0.3, -0.2, 1.0, 5.0)
    errors = []
    for dt_s in (0.04, 0.02):
        ours = transition_of(filter_, lambda run, dt_s=dt_s: advance(run, dt_s))[:9, :15]
        theirs = step_jacobian(filter_, lambda run, dt_s=dt_s: flow_of_motion(run, dt_s), range(15))[:9]
        errors.append([np.abs(ours - theirs)[i : i + 3, j : j + 3].max() for i in (0, 3, 6) for j in (6, 9, 12)])
    wide, slim = np.array(errors)
    seen = wide > 1e-7
    assert seen.sum() >= 4  # blocks whose error of one step is above rounding: how many depends on the motion drawn
    assert np.all(wide[seen] / slim[seen] > 6.5)
    assert np.all(slim < 1e-4)


@pytest.mark.parametrize("n", [STATES, N])
def test_the_covariance_is_f_p_f_transposed_plus_the_noise_of_motion(n):
    filter_ = filter_at(5, 0.3, -0.1, 2.0, 3.0)
    filter_.p = random_covariance(np.random.default_rng(1))
    f = transition_of(filter_, lambda run: advance(run, EPOCH_S))[:n, :n]
    expected = filter_.p
    noise = np.zeros(n)
    noise[POSITION : POSITION + 3] = SETTINGS.position_walk_m_rt_s**2 * EPOCH_S
    noise[VELOCITY : VELOCITY + 3] = SETTINGS.accel_noise_m_s2_rt_hz**2 * EPOCH_S
    noise[ATTITUDE : ATTITUDE + 3] = SETTINGS.gyro_noise_rad_s_rt_hz**2 * EPOCH_S
    expected[:n, :n] = f @ expected[:n, :n] @ f.T + np.diag(noise)
    advance(filter_, EPOCH_S, SETTINGS, n)
    assert np.allclose(filter_.p, expected, rtol=1e-7, atol=1e-9)


def test_white_noise_of_the_force_is_level_and_down():
    filter_ = filter_at(5, 0.3, -0.1, 2.0, 3.0)
    filter_.p = np.zeros((N, N))
    filter_.work[ACCEL_NOISE : ACCEL_NOISE + 2] = 0.4, 3.0
    add_motion_noise(filter_.work, ONE_LANE, 0.5, 0.0)
    assert np.diag(filter_.p)[VELOCITY : VELOCITY + 3] == pytest.approx([0.2, 0.2, 1.5])


def test_process_noise_is_right_to_first_order_of_the_step():
    """A second at rest from P = 0 against Van Loan's covariance of the continuous model: half step, half error."""
    numbers = SETTINGS._replace(gyro_noise_rad_s_rt_hz=0.02)
    a, q = np.zeros((15, 15)), np.zeros((15, 15))
    a[0:3, 3:6], a[6:9, 9:12], a[3:6, 12:15] = np.eye(3), -np.eye(3), -np.eye(3)
    a[3:6, 6:9] = cross_matrix(GRAVITY)  # theta x f with f = -g
    for first, walk in zip(range(0, 15, 3), (
        numbers.position_walk_m_rt_s, numbers.accel_noise_m_s2_rt_hz, numbers.gyro_noise_rad_s_rt_hz,
        numbers.gyro_walk_rad_s_rt_s, numbers.accel_walk_m_s2_rt_s,
    ), strict=True):  # fmt: skip
        q[first : first + 3, first : first + 3] = walk**2 * np.eye(3)
    loan = expm(np.block([[-a, q], [np.zeros((15, 15)), a.T]]))
    exact = loan[15:, 15:].T @ loan[:15, 15:]
    sigma = np.sqrt(np.diag(exact))
    errors = []
    for steps in (25, 50):
        filter_ = Filter()
        for _ in range(steps):
            read_imu(filter_, 0.0, -GRAVITY)
            advance(filter_, 1.0 / steps, numbers)
            propagate_walks(filter_.work, ONE_LANE, 1.0 / steps, numbers)
        errors.append(np.abs(filter_.p[:15, :15] - exact) / np.outer(sigma, sigma))
    assert errors[1].max() < 0.05
    large = errors[0] > 1e-3
    assert large.sum() > 10
    assert np.allclose((errors[0] / np.where(large, errors[1], 1.0))[large], 2.0, atol=0.15)


@EXAMPLES
@given(filters())
def test_an_earth_frame_attitude_error_does_not_turn_with_the_vehicle(filter_):
    """However it spins, theta keeps its axes: a heading error stays a heading error."""
    f = transition_of(filter_, lambda run: advance(run, EPOCH_S))
    assert np.allclose(f[ATTITUDE : ATTITUDE + 3, ATTITUDE : ATTITUDE + 3], np.eye(3), atol=1e-12)


# -- strapdown axioms ----------------------------------------------------------------------------------------------
def test_level_and_at_rest_nothing_moves():
    filter_ = Filter()
    for _ in range(500):
        read_imu(filter_, 0.0, -GRAVITY)
        advance(filter_, EPOCH_S)
    assert np.array_equal(filter_.x, np.zeros(N))
    assert np.array_equal(filter_.q, [1.0, 0.0, 0.0, 0.0])


@EXAMPLES
@given(filters())
def test_at_rest_in_any_attitude_nothing_moves(filter_):
    filter_.x[:] = 0.0
    for _ in range(50):
        read_imu(filter_, 0.0, -filter_.rotation.T @ GRAVITY)
        advance(filter_, EPOCH_S)
    assert np.abs(filter_.x[:6]).max() < 1e-12


@EXAMPLES
@given(filters())
def test_held_still_a_filter_flies_straight_on_and_turns_with_nothing(filter_):
    """Whatever its attitude and its biases."""
    x, q, others = filter_.x.copy(), filter_.q.copy(), filter_.work.copy()
    hold_still(filter_.work, ONE_LANE, 0)
    others[IMU : IMU + 6] = filter_.work[IMU : IMU + 6]
    assert np.array_equal(filter_.work, others)
    for _ in range(50):
        hold_still(filter_.work, ONE_LANE, 0)
        advance(filter_, EPOCH_S)
    assert filter_.x[:3] == pytest.approx(x[:3] + x[3:6], abs=1e-11)
    assert filter_.x[3:6] == pytest.approx(x[3:6], abs=1e-12)
    assert filter_.q == pytest.approx(q, abs=1e-14)


@EXAMPLES
@given(filters())
def test_free_fall_is_a_parabola_whatever_the_attitude(filter_):
    x = filter_.x[:6].copy()
    filter_.x[ACCEL_BIAS : ACCEL_BIAS + 3] = 0.0
    for _ in range(50):
        read_imu(filter_, [0.3, -0.2, 0.5], 0.0)
        advance(filter_, EPOCH_S)
    assert filter_.x[3:6] == pytest.approx(x[3:] + GRAVITY, abs=1e-12)
    assert filter_.x[:3] == pytest.approx(x[:3] + x[3:] + 0.5 * GRAVITY, abs=1e-12)


def test_nose_down_accelerates_to_where_the_nose_points():
    for yaw, toward in ((0.0, [1.0, 0.0, 0.0]), (0.5 * np.pi, [0.0, 1.0, 0.0])):
        filter_ = Filter()
        filter_.q[:] = quaternion_from_euler(0.0, -0.1, yaw)
        read_imu(filter_, 0.0, [0.0, 0.0, -GRAVITY_M_S2 / np.cos(0.1)])
        advance(filter_, 0.5)
        assert filter_.x[VELOCITY : VELOCITY + 3] == pytest.approx(
            0.5 * GRAVITY_M_S2 * np.tan(0.1) * np.array(toward), abs=1e-14
        )


def test_a_turn_about_body_down_is_clockwise_from_above():
    filter_ = Filter()
    for _ in range(100):
        read_imu(filter_, [0.0, 0.0, 0.5], -GRAVITY)
        advance(filter_, EPOCH_S)
    assert 2.0 * np.arctan2(filter_.q[3], filter_.q[0]) == pytest.approx(1.0, abs=1e-9)
    assert np.abs(filter_.x[:6]).max() < 1e-12


@EXAMPLES
@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3), st.floats(0.002, 0.05))
def test_a_constant_rate_is_followed_to_fourth_order(rate, dt_s):
    """No coning, so only the series of sine and cosine errs: phi^5/480 a step."""
    q, steps = np.array(quaternion_from_euler(0.2, -0.1, 0.4)), 40
    phi = dt_s * np.array(rate) + 1e-12
    ours = tuple(q)
    for _ in range(steps):
        ours = turned(ours, *phi)
    exact = product(q, half_turn(steps * phi))
    error = 2.0 * np.linalg.norm(product(exact, np.array(ours) * [1, -1, -1, -1])[1:])
    assert error <= 1.1 * steps * np.linalg.norm(phi) ** 5 / 480.0 + 1e-14
    assert np.linalg.norm(ours) == pytest.approx(1.0, abs=1e-15)


def test_velocity_and_position_converge_with_the_square_of_the_step():
    errors = []
    for steps in (25, 50, 100):
        filter_ = Filter()
        filter_.x[VELOCITY : VELOCITY + 3] = 1.0, 2.0, 3.0
        read_imu(filter_, [0.8, -0.5, 0.9], [1.0, -0.5, -9.0])
        exact = filter_.copy()
        flow_of_motion(exact, 1.0, 400)
        for _ in range(steps):
            advance(filter_, 1.0 / steps)
        errors.append(np.abs(filter_.x[:6] - exact.x[:6]).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.05)


def test_biases_are_taken_off_in_body_axes():
    filter_ = Filter()
    filter_.q[:] = quaternion_from_euler(0.0, 0.0, 0.5 * np.pi)
    filter_.x[ACCEL_BIAS : ACCEL_BIAS + 3] = 0.1, -0.2, 0.3
    filter_.x[GYRO_BIAS : GYRO_BIAS + 3] = 0.01, 0.02, -0.03
    read_imu(filter_, [0.01, 0.02, -0.03], np.array([0.1, -0.2, 0.3]) - GRAVITY)
    q = filter_.q.copy()
    advance(filter_, EPOCH_S)
    assert np.abs(filter_.x[:6]).max() < 1e-15
    assert filter_.q == pytest.approx(q, abs=1e-15)
    assert np.abs(filter_.rows(RATE, 3)).max() < 1e-15
