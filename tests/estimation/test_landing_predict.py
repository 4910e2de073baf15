"""The landing filter's prediction: strapdown axioms, its transition against complex step, the flow sensor's dynamics.

What the discretisation promises: the transition is the derivative of the filter's own nonlinear step, but for the gyro
bias, whose columns are right to second order in the turn of a step; against the continuous motion every element is
right to second order in the step, so the error of one step falls eightfold when the step is halved. Process noise is
white noise added at the end of a step, first order.
"""

from __future__ import annotations

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal
from scipy.linalg import expm

from flownav.compile import LANES, ONE_LANE
from flownav.estimation.landing import observe
from flownav.estimation.landing.algebra import forget, fuse
from flownav.estimation.landing.bias_limits import limit_biases
from flownav.estimation.landing.observe_pad import PAD_STATES, observe_pad
from flownav.estimation.landing.predict import predict, take_imu, turned
from flownav.estimation.landing.settings import FlowLag, LandingSettings
from flownav.estimation.landing.states import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO,
    FLOW_LAG,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GROUND,
    GYRO_BIAS,
    INS_ERROR,
    LANDING_ROW_COUNT,
    POSITION,
    VELOCITY,
)
from flownav.frames import GRAVITY_M_S2, quaternion_from_euler
from flownav.sensors.datasheet import FlowSettings, load_sensor
from flownav.simulation.landing_setup import flow_lag
from landing_filter import (
    ROWS,
    SETTINGS,
    SILENT,
    STATES,
    Landing,
    cross_matrix,
    filters,
    landing,
    paper_lag,
    product,
    random_covariance,
    rotation_of,
    step_jacobian,
    transition_of,
)

GRAVITY = np.array([0.0, 0.0, GRAVITY_M_S2])
EPOCH_S = 0.02
GYRO, ACCEL = slice(ROWS.imu, ROWS.imu + 3), slice(ROWS.imu + 3, ROWS.imu + 6)
GYRO_COLUMNS = range(GYRO_BIAS, GYRO_BIAS + 3)
OTHER_COLUMNS = [i for i in range(STATES) if i not in GYRO_COLUMNS]
EXAMPLES = settings(max_examples=8, deadline=None)


def advance(filter_: Landing, dt_s: float, numbers: LandingSettings = SILENT, lag: FlowLag | None = None) -> None:
    predict(filter_.work, ONE_LANE, ROWS, dt_s, numbers, lag)


def read_imu(filter_: Landing, gyro, accel) -> None:
    filter_.work[GYRO], filter_.work[ACCEL] = gyro, accel


# -- the same motion, written apart -----------------------------------------------------------------------------
def half_turn(phi: np.ndarray) -> np.ndarray:
    """The quaternion of a rotation vector, for complex numbers too."""
    angle = np.sqrt(phi @ phi)
    return np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) / angle * phi])


def seen_velocity(filter_: Landing, lag: FlowLag) -> np.ndarray:
    """Body velocity forward and right as the flow sensor sees it."""
    rotation = rotation_of(filter_.q)
    range_m = (filter_.x[GROUND] - filter_.x[POSITION + 2]) / rotation[2, 2] - lag.lens_below_m
    over = lag.sonar_floor_m / range_m if range_m.real < lag.sonar_floor_m else 1.0
    return over * (rotation.T @ filter_.x[VELOCITY : VELOCITY + 3])[:2]


def step_apart(filter_: Landing, dt_s: float, numbers: LandingSettings, lag: FlowLag | None) -> None:
    """The filter's nonlinear step with exact rotations and dense matrices."""
    x, channels = filter_.x, filter_.x[FLOW_LAG : FLOW_LAG + 4].reshape(2, 2)
    start = seen_velocity(filter_, lag) if lag else None
    rate = filter_.work[GYRO] - x[GYRO_BIAS : GYRO_BIAS + 3]
    force = filter_.work[ACCEL] - x[ACCEL_BIAS : ACCEL_BIAS + 3]
    middle = rotation_of(product(filter_.q, half_turn(0.5 * dt_s * rate)))
    accel = middle @ force + GRAVITY
    x[POSITION : POSITION + 3] += dt_s * x[VELOCITY : VELOCITY + 3] + 0.5 * dt_s**2 * accel
    x[VELOCITY : VELOCITY + 3] += dt_s * accel
    filter_.q[:] = product(filter_.q, half_turn(dt_s * rate))
    for first, count, tau_s in (
        (GPS_SLOW, 3, numbers.gps_slow_tau_s),
        (GPS_FAST, 3, numbers.gps_fast_tau_s),
        (GPS_VELOCITY, 3, numbers.gps_velocity_tau_s),
        (INS_ERROR, 2, numbers.ins_tilt_tau_s),
        (INS_ERROR + 2, 1, numbers.ins_heading_tau_s),
    ):
        x[first : first + count] *= np.exp(-dt_s / tau_s)
    if lag:
        own = np.array([[lag.f11, lag.f12], [lag.f21, lag.f22]])
        end = seen_velocity(filter_, lag)
        for channel in range(2):
            channels[channel] = (
                own @ channels[channel]
                + np.array([lag.start_1, lag.start_2]) * start[channel]
                + np.array([lag.end_1, lag.end_2]) * end[channel]
            )


def flow_of_motion(filter_: Landing, duration_s: float, steps: int = 12) -> None:
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
def gyro_column_bound(filter_: Landing, dt_s: float) -> float:
    """dt phi^2 of attitude and dt^2 f phi of velocity, what the middle of the step stands for."""
    phi = dt_s * np.linalg.norm(filter_.work[GYRO] - filter_.x[GYRO_BIAS : GYRO_BIAS + 3])
    force = np.linalg.norm(filter_.work[ACCEL] - filter_.x[ACCEL_BIAS : ACCEL_BIAS + 3])
    return dt_s * phi * (phi / 24.0 + dt_s * force / 8.0)


@EXAMPLES
@given(filters(0.15, 5.0), st.sampled_from([None, paper_lag(EPOCH_S), paper_lag(EPOCH_S, sonar_floor_m=0.0)]))
def test_the_transition_is_the_derivative_of_the_nonlinear_step(filter_, lag):
    ours = transition_of(filter_, lambda run: advance(run, EPOCH_S, SILENT, lag))
    theirs = step_jacobian(filter_, lambda run: step_apart(run, EPOCH_S, SILENT, lag))
    size = np.abs(theirs).max(axis=1, keepdims=True)
    assert np.all(np.abs(ours - theirs)[:, OTHER_COLUMNS] <= 2e-8 * size)
    speed = np.linalg.norm(filter_.x[VELOCITY : VELOCITY + 3])
    bound = gyro_column_bound(filter_, EPOCH_S) * (1.0 + (1.0 + speed) * (size if lag else 0.0))
    assert np.all(np.abs(ours - theirs)[:, GYRO_COLUMNS] <= 1.1 * bound + 2e-8 * size)


@settings(max_examples=3, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_against_the_continuous_motion_the_transition_is_of_second_order(seed):
    """Half the step, an eighth of the error of one step, in every block that has one."""
    filter_ = landing(seed, 0.3, -0.2, 1.0, 5.0)
    errors = []
    for dt_s in (0.04, 0.02):
        ours = transition_of(filter_, lambda run, dt_s=dt_s: advance(run, dt_s))[:9, :15]
        theirs = step_jacobian(filter_, lambda run, dt_s=dt_s: flow_of_motion(run, dt_s), range(15))[:9]
        errors.append([np.abs(ours - theirs)[i : i + 3, j : j + 3].max() for i in (0, 3, 6) for j in (6, 9, 12)])
    wide, slim = np.array(errors)
    seen = wide > 1e-7
    assert seen.sum() >= 5
    assert np.all(wide[seen] / slim[seen] > 6.5)
    assert np.all(slim < 1e-4)


@EXAMPLES
@given(filters(0.15, 5.0), st.sampled_from([None, paper_lag(EPOCH_S)]))
def test_the_covariance_is_f_p_f_transposed_plus_q(filter_, lag):
    """With white noise of a step at its end, and so driving the flow sensor's dynamics through the end velocity."""
    numbers = SETTINGS
    filter_.p[:] = random_covariance(np.random.default_rng(1))
    f = transition_of(filter_, lambda run: advance(run, EPOCH_S, SILENT, lag))
    p = filter_.p.copy()
    noise_alone = filter_.copy()
    noise_alone.p[:] = 0.0
    advance(noise_alone, EPOCH_S, numbers, lag)
    advance(filter_, EPOCH_S, numbers, lag)
    assert np.allclose(filter_.p, f @ p @ f.T + noise_alone.p, rtol=1e-7, atol=1e-9)
    assert np.array_equal(filter_.p, filter_.p.T)
    if lag is None:
        assert np.allclose(noise_alone.p, np.diag(expected_noise(numbers, EPOCH_S)), rtol=1e-10, atol=0)


def expected_noise(numbers: LandingSettings, dt_s: float) -> np.ndarray:
    """Variance that one step adds to each state."""
    q = np.zeros(STATES)
    for first, walk in (
        (POSITION, numbers.position_walk_m_rt_s),
        (VELOCITY, numbers.accel_noise_m_s2_rt_hz),
        (ATTITUDE, numbers.gyro_noise_rad_s_rt_hz),
        (GYRO_BIAS, numbers.gyro_walk_rad_s_rt_s),
        (ACCEL_BIAS, numbers.accel_walk_m_s2_rt_s),
    ):
        q[first : first + 3] = walk**2 * dt_s
    q[GROUND], q[BARO] = numbers.ground_walk_m_rt_s**2 * dt_s, numbers.baro_walk_m_rt_s**2 * dt_s
    sigma, tau_s = stationary(numbers)
    markov = tau_s > 0.0
    q[markov] = sigma[markov] ** 2 * -np.expm1(-2.0 * dt_s / tau_s[markov])
    return q


def stationary(numbers: LandingSettings) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviation and time constant of every Gauss-Markov state; 0 elsewhere."""
    sigma, tau_s = np.zeros(STATES), np.zeros(STATES)
    n = numbers
    level_and_down = (
        (GPS_SLOW, n.gps_slow_sigma_m, n.gps_slow_sigma_down_m, n.gps_slow_tau_s, n.gps_slow_tau_s),
        (GPS_FAST, n.gps_fast_sigma_m, n.gps_fast_sigma_down_m, n.gps_fast_tau_s, n.gps_fast_tau_s),
        (GPS_VELOCITY, n.gps_velocity_sigma_m_s, n.gps_velocity_sigma_m_s, n.gps_velocity_tau_s, n.gps_velocity_tau_s),
        (INS_ERROR, n.ins_tilt_sigma_rad, n.ins_heading_sigma_rad, n.ins_tilt_tau_s, n.ins_heading_tau_s),
    )
    for first, level, down, tau_level, tau_down in level_and_down:
        sigma[first : first + 3], tau_s[first : first + 3] = (level, level, down), (tau_level, tau_level, tau_down)
    return sigma, tau_s


def test_gauss_markov_errors_stay_at_their_stated_size_and_forget_at_their_stated_pace():
    sigma, tau_s = stationary(SETTINGS)
    markov = tau_s > 0.0
    filter_ = landing(1, 0.1, 0.1, 0.0, 3.0)
    filter_.p[:] = np.diag(sigma**2)
    x = filter_.x[markov].copy()
    for _ in range(50):
        advance(filter_, 0.1, SETTINGS)
    assert np.diag(filter_.p)[markov] == pytest.approx(sigma[markov] ** 2, rel=1e-12)
    assert filter_.x[markov] == pytest.approx(x * np.exp(-5.0 / tau_s[markov]), rel=1e-12)


def test_process_noise_is_right_to_first_order_of_the_step():
    """A second at rest from P = 0 against Van Loan's covariance of the continuous model: half step, half error."""
    n = SETTINGS._replace(gyro_noise_rad_s_rt_hz=0.02)
    a, q = np.zeros((15, 15)), np.zeros((15, 15))
    a[0:3, 3:6], a[6:9, 9:12], a[3:6, 12:15] = np.eye(3), -np.eye(3), -np.eye(3)
    a[3:6, 6:9] = cross_matrix(GRAVITY)  # theta x f with f = -g
    for first, walk in zip(range(0, 15, 3), (
        n.position_walk_m_rt_s, n.accel_noise_m_s2_rt_hz, n.gyro_noise_rad_s_rt_hz,
        n.gyro_walk_rad_s_rt_s, n.accel_walk_m_s2_rt_s,
    ), strict=True):  # fmt: skip
        q[first : first + 3, first : first + 3] = walk**2 * np.eye(3)
    loan = expm(np.block([[-a, q], [np.zeros((15, 15)), a.T]]))
    exact = loan[15:, 15:].T @ loan[:15, 15:]
    sigma = np.sqrt(np.diag(exact))
    errors = []
    for steps in (25, 50):
        filter_ = Landing()
        for _ in range(steps):
            read_imu(filter_, 0.0, -GRAVITY)
            advance(filter_, 1.0 / steps, n)
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
    filter_ = Landing()
    filter_.q[:] = 1.0, 0.0, 0.0, 0.0
    for _ in range(500):
        read_imu(filter_, 0.0, -GRAVITY)
        advance(filter_, EPOCH_S)
    assert np.array_equal(filter_.x, np.zeros(STATES))
    assert np.array_equal(filter_.q, [1.0, 0.0, 0.0, 0.0])


@EXAMPLES
@given(filters())
def test_at_rest_in_any_attitude_nothing_moves(filter_):
    filter_.x[:] = 0.0
    filter_.work[ROWS.imu_before : ROWS.imu_before + 6] = 0.0
    for _ in range(50):
        read_imu(filter_, 0.0, -filter_.rotation.T @ GRAVITY)
        advance(filter_, EPOCH_S)
    assert np.abs(filter_.x[:6]).max() < 1e-12


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
        filter_ = Landing()
        filter_.q[:] = quaternion_from_euler(0.0, -0.1, yaw)
        read_imu(filter_, 0.0, [0.0, 0.0, -GRAVITY_M_S2 / np.cos(0.1)])
        advance(filter_, 0.5)
        assert filter_.x[VELOCITY : VELOCITY + 3] == pytest.approx(
            0.5 * GRAVITY_M_S2 * np.tan(0.1) * np.array(toward), abs=1e-14
        )


def test_a_turn_about_body_down_is_clockwise_from_above():
    filter_ = Landing()
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
        filter_ = Landing()
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
    filter_ = Landing()
    filter_.q[:] = quaternion_from_euler(0.0, 0.0, 0.5 * np.pi)
    filter_.x[ACCEL_BIAS : ACCEL_BIAS + 3] = 0.1, -0.2, 0.3
    filter_.x[GYRO_BIAS : GYRO_BIAS + 3] = 0.01, 0.02, -0.03
    read_imu(filter_, [0.01, 0.02, -0.03], np.array([0.1, -0.2, 0.3]) - GRAVITY)
    q = filter_.q.copy()
    advance(filter_, EPOCH_S)
    assert np.abs(filter_.x[:6]).max() < 1e-15
    assert filter_.q == pytest.approx(q, abs=1e-15)


def test_biases_are_held_to_what_such_a_sensor_can_have():
    filter_ = Landing()
    filter_.x[GYRO_BIAS : GYRO_BIAS + 3] = 0.5, -0.5, 0.05
    filter_.x[ACCEL_BIAS : ACCEL_BIAS + 3] = 3.0, -3.0, 0.4
    limit_biases(filter_.work, ONE_LANE, ROWS, SETTINGS)
    assert filter_.x[GYRO_BIAS : GYRO_BIAS + 3] == pytest.approx([0.1, -0.1, 0.05])
    assert filter_.x[ACCEL_BIAS : ACCEL_BIAS + 3] == pytest.approx([1.0, -1.0, 0.4])


# -- the IMU's own lag ----------------------------------------------------------------------------------------------
@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.95))
def test_take_imu_undoes_a_first_order_lag_exactly(seed, decay):
    """Truth through y_k = d y_{k-1} + (1 - d) u_k, then taken: u_k again, to the rounding that 1/(1 - d) magnifies."""
    random = np.random.default_rng(seed)
    filter_ = Landing()
    reading = random.normal(size=6)
    filter_.work[ROWS.imu_before : ROWS.imu_before + 6] = reading
    bias = np.concatenate([filter_.x[GYRO_BIAS : GYRO_BIAS + 3], filter_.x[ACCEL_BIAS : ACCEL_BIAS + 3]])
    for _ in range(30):
        truth = 10.0 * random.normal(size=6)
        reading = decay * reading + (1.0 - decay) * truth
        filter_.work[ROWS.imu : ROWS.imu + 6] = reading
        take_imu(filter_.work, ONE_LANE, ROWS, decay)
        found = np.concatenate([filter_.rows(ROWS.rate, 3), filter_.rows(ROWS.force, 3)])
        assert found == pytest.approx(truth - bias, abs=1e-14 * 60.0 / (1.0 - decay))


# -- the flow sensor's dynamics --------------------------------------------------------------------------------------
A, B, C = 196.9, 14.8, 191.9


def flight_with_steps_of_acceleration(lag: FlowLag, epochs: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and flow (epochs, 2) in level flight with a new horizontal acceleration every epoch."""
    random = np.random.default_rng(4)
    filter_ = Landing()
    filter_.x[POSITION + 2] = -50.0
    velocity, flow = [np.zeros(2)], [np.zeros(2)]
    for _ in range(epochs):
        read_imu(filter_, 0.0, [*random.normal(size=2), -GRAVITY_M_S2])
        advance(filter_, EPOCH_S, SILENT, lag)
        velocity.append(filter_.x[VELOCITY : VELOCITY + 2].copy())
        flow.append(lag.gain * filter_.x[[FLOW_LAG, FLOW_LAG + 2]])
    return np.array(velocity), np.array(flow)


def test_the_lag_answers_straight_lines_as_scipy_and_python_control_do():
    velocity, flow = flight_with_steps_of_acceleration(paper_lag(EPOCH_S))
    t_s = EPOCH_S * np.arange(len(velocity))
    plant = control.ss(control.tf([A], [1.0, B, C]))
    for channel in range(2):
        scipys = signal.lsim(([A], [1.0, B, C]), velocity[:, channel], t_s, interp=True)[1]
        theirs = control.forced_response(plant, t_s, velocity[:, channel]).outputs
        assert flow[:, channel] == pytest.approx(scipys, abs=1e-12)
        assert flow[:, channel] == pytest.approx(theirs, abs=1e-12)
    assert np.abs(flow).max() > 0.05


def test_the_scenarios_lag_is_the_simulated_sensors_own_250_hz():
    """Its velocity is held over each 4 ms, which is what the simulated sensor does; and so 2 ms late on a ramp."""
    sensor = load_sensor()
    lag = flow_lag(sensor, FlowSettings().parameters(sensor), 0.1)
    assert (sensor.dynamics.a_1_s2, sensor.dynamics.b_1_s, sensor.dynamics.c_1_s2) == (A, B, C)
    velocity, flow = flight_with_steps_of_acceleration(lag)
    epochs_s, fine_s = EPOCH_S * np.arange(len(velocity)), 0.004 * np.arange(5 * (len(velocity) - 1) + 1)
    for channel in range(2):
        fine = np.interp(fine_s, epochs_s, velocity[:, channel])
        held = signal.lsim(([A], [1.0, B, C]), fine, fine_s, interp=False)[1]
        assert flow[:, channel] == pytest.approx(held[::5], abs=1e-12)
        straight = signal.lsim(([A], [1.0, B, C]), fine, fine_s, interp=True)[1]
        steepest = np.abs(np.diff(fine)).max() / 0.004
        assert np.abs(held - straight).max() <= 0.002 * steepest * A / C * 1.2


def test_a_steady_velocity_comes_through_with_the_dc_gain():
    lag = paper_lag(EPOCH_S)
    filter_ = Landing()
    filter_.x[POSITION + 2] = -50.0
    filter_.x[VELOCITY : VELOCITY + 2] = 2.0, -1.0
    for _ in range(150):
        read_imu(filter_, 0.0, -GRAVITY)
        advance(filter_, EPOCH_S, SILENT, lag)
    assert lag.gain * filter_.x[[FLOW_LAG, FLOW_LAG + 2]] == pytest.approx([2.0 * A / C, -A / C], rel=1e-8)


def test_below_the_sonars_floor_the_sensor_sees_too_much():
    """At a range of a third of the floor, three times the velocity."""
    lag = paper_lag(EPOCH_S, sonar_floor_m=0.3, lens_below_m=0.1)
    filter_ = Landing()
    filter_.x[POSITION + 2], filter_.x[VELOCITY] = -0.2, 1.0
    for _ in range(150):
        read_imu(filter_, 0.0, -GRAVITY)
        advance(filter_, EPOCH_S, SILENT, lag)
    assert lag.gain * filter_.x[FLOW_LAG] == pytest.approx(3.0 * A / C, rel=1e-8)


# -- lanes -----------------------------------------------------------------------------------------------------------
def every_law(work, lanes, reading, lag) -> None:
    """A prediction, then each law once, some lanes without a reading."""
    predict(work, lanes, ROWS, EPOCH_S, SETTINGS, lag)
    here = reading + 7
    laws = (
        (observe.observe_attitude, (2, reading, EPOCH_S), observe.ATTITUDE_STATES[2]),
        (observe.observe_gps_position, (0, reading, EPOCH_S), observe.GPS_POSITION_STATES[0]),
        (observe.observe_gps_velocity, (1, reading, 0.0), observe.GPS_VELOCITY_STATES[1]),
        (observe.observe_state, (2, reading), observe.STATE_ITSELF[2]),
        (observe.observe_heading, (reading,), observe.HEADING_STATES),
        (observe.observe_range, (reading + 1, 0.1), observe.RANGE_STATES),
        (observe.observe_baro, (reading + 2,), observe.BARO_STATES),
        (observe.observe_lagged_flow, (1, reading + 3, 196.9), observe.LAGGED_FLOW_STATES[1]),
        (observe.observe_body_velocity, (0, reading + 4, reading + 5), observe.BODY_VELOCITY_STATES),
        (observe.observe_flow_rate, (1, reading + 6, reading + 5, 0.1), observe.FLOW_RATE_STATES),
        (observe_pad, (1, reading, 0.1), PAD_STATES),
    )
    for law, arguments, index in laws:
        observe.offer(work, lanes, ROWS, 0.5, here)
        law(work, lanes, ROWS, *arguments)
        fuse(work, lanes, ROWS, index, 3.0)
    forget(work, lanes, ROWS, GROUND, 1.0, reading)
    limit_biases(work, lanes, ROWS, SETTINGS)


def test_sixteen_vehicles_side_by_side_are_each_as_alone():
    lag, wide = paper_lag(EPOCH_S), len(LANES)
    alone = [landing(seed, 0.2, -0.1, 0.3 * seed, 0.5 + seed) for seed in range(wide)]
    together = np.zeros(alone[0].work.size * wide)
    for lane, filter_ in enumerate(alone):
        filter_.p[:] = random_covariance(np.random.default_rng(lane), 0.05)
        filter_.reading[7] = float(lane % 4 > 0)
        together.reshape(-1, wide)[:, lane] = filter_.work
    every_law(together, LANES, LANDING_ROW_COUNT, lag)
    for lane, filter_ in enumerate(alone):
        start = filter_.p.copy()
        every_law(filter_.work, ONE_LANE, LANDING_ROW_COUNT, lag)
        assert filter_.work.tobytes() == together.reshape(-1, wide)[:, lane].tobytes()
        assert not np.array_equal(filter_.p, start)
