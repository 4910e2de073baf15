"""The flow sensor's dynamics inside the filter, against SciPy, python-control and complex step."""

from __future__ import annotations

from functools import partial

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal
from test_filter_motion import EPOCH_S, GYRO_COLUMNS, OTHER_COLUMNS, gyro_column_bound, read_imu, step_apart

from filters import (
    SETTINGS,
    SILENT,
    Filter,
    N,
    filters,
    innovation_gradient,
    paper_lag,
    random_covariance,
    rotation_of,
    step_jacobian,
    transition_of,
)
from flownav.core.compile import ONE_LANE
from flownav.core.frames import GRAVITY_M_S2
from flownav.estimation.error_models import FilterSettings
from flownav.estimation.lag import FlowLag, lag_ends, lag_over, lag_starts, seen_velocity
from flownav.estimation.motion import predict
from flownav.estimation.named import VelocityNed
from flownav.estimation.states import (
    ACCEL_NOISE,
    FLOW_LAG,
    GROUND,
    GYRO_NOISE,
    INNOVATION,
    POSITION,
    STATES_WITH_LAG,
    VELOCITY,
)

A, B, C = 196.9, 14.8, 191.9
EXAMPLES = settings(max_examples=4, deadline=None)


def advance(filter_: Filter, numbers: FilterSettings, lag: FlowLag) -> None:
    """One step of a filter that carries the dynamics."""
    filter_.work[ACCEL_NOISE : ACCEL_NOISE + 2] = numbers.accel_noise_m_s2_rt_hz**2
    filter_.work[GYRO_NOISE] = numbers.gyro_noise_rad_s_rt_hz**2
    lag_starts(filter_.work, ONE_LANE, lag)
    predict(filter_.work, ONE_LANE, STATES_WITH_LAG, EPOCH_S, numbers)
    lag_ends(filter_.work, ONE_LANE, lag)


def seen_apart(filter_: Filter, lag: FlowLag) -> np.ndarray:
    """Body velocity forward and right as the flow sensor sees it."""
    rotation = rotation_of(filter_.q)
    range_m = (filter_.x[GROUND] - filter_.x[POSITION + 2]) / rotation[2, 2] - lag.lens_below_m
    over = lag.sonar_floor_m / range_m if range_m.real < lag.sonar_floor_m else 1.0
    return over * (rotation.T @ filter_.x[VELOCITY : VELOCITY + 3])[:2]


def lagged_step_apart(filter_: Filter, lag: FlowLag) -> None:
    """The nonlinear step of motion and of both channels."""
    channels, start = filter_.x[FLOW_LAG : FLOW_LAG + 4].reshape(2, 2), seen_apart(filter_, lag)
    step_apart(filter_, EPOCH_S)
    own, end = np.array([[lag.f11, lag.f12], [lag.f21, lag.f22]]), seen_apart(filter_, lag)
    for channel in range(2):
        channels[channel] = (
            own @ channels[channel]
            + np.array([lag.start_1, lag.start_2]) * start[channel]
            + np.array([lag.end_1, lag.end_2]) * end[channel]
        )


@EXAMPLES
@given(
    filters(0.5, 5.0), st.sampled_from([paper_lag(EPOCH_S, sonar_floor_m=1.0), paper_lag(EPOCH_S, sonar_floor_m=0.0)])
)
def test_the_transition_is_the_derivative_of_the_nonlinear_step(filter_, lag):
    ours = transition_of(filter_, lambda run: advance(run, SILENT, lag))
    theirs = step_jacobian(filter_, lambda run: lagged_step_apart(run, lag))
    size = np.abs(theirs).max(axis=1, keepdims=True)
    assert np.all(np.abs(ours - theirs)[:, OTHER_COLUMNS] <= 2e-8 * size)
    speed = np.linalg.norm(filter_.x[VELOCITY : VELOCITY + 3])
    bound = gyro_column_bound(filter_, EPOCH_S) * (1.0 + (1.0 + speed) * size)
    assert np.all(np.abs(ours - theirs)[:, GYRO_COLUMNS] <= 1.1 * bound + 2e-8 * size)


@EXAMPLES
@given(filters(0.15, 5.0))
def test_the_covariance_is_f_p_f_transposed_plus_q(filter_):
    """With white noise of a step at its end, and so driving the sensor's dynamics through the end velocity."""
    lag = paper_lag(EPOCH_S)
    p = random_covariance(np.random.default_rng(1))
    f = transition_of(filter_, lambda run: advance(run, SILENT, lag))
    alone = filter_.copy()
    alone.p = np.zeros((N, N))
    advance(alone, SETTINGS, lag)
    filter_.p = p
    advance(filter_, SETTINGS, lag)
    assert np.allclose(filter_.p, f @ p @ f.T + alone.p, rtol=1e-7, atol=1e-9)


@EXAMPLES
@given(filters(least_m=0.2, most_m=0.5))
def test_what_the_sensor_sees_has_its_derivative_above_and_below_its_floor(filter_):
    lag = paper_lag(EPOCH_S, sonar_floor_m=0.3, lens_below_m=0.1)

    def seen(run: Filter, channel: int):
        rotation = tuple(rotation_of(run.q).ravel())
        height = run.x[GROUND] - run.x[POSITION + 2]
        found = seen_velocity(rotation, VelocityNed(*run.x[3:6]), height, channel, lag.sonar_floor_m, lag.lens_below_m)
        run.work[INNOVATION] = -found.value
        return found

    for channel in range(2):
        found, h = seen(filter_, channel), np.zeros(N)
        h[3:6], h[6:9] = found.vel, found.turn
        h[GROUND], h[POSITION + 2] = found.height, -found.height
        theirs = innovation_gradient(filter_, partial(seen, channel=channel))
        assert np.allclose(h, theirs, rtol=1e-11, atol=1e-11)


def test_the_lag_over_a_step_is_the_ramps_integral():
    for dt_s in (0.004, EPOCH_S, 0.1):
        assert lag_over(A, B, C, dt_s, 0.3, 0.1) == pytest.approx(paper_lag(dt_s), rel=1e-11, abs=1e-15)


def flight_with_steps_of_acceleration(lag: FlowLag, epochs: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and flow (epochs, 2) in level flight with a new horizontal acceleration every epoch."""
    random = np.random.default_rng(4)
    filter_ = Filter()
    filter_.x[POSITION + 2] = -50.0
    velocity, flow = [np.zeros(2)], [np.zeros(2)]
    for _ in range(epochs):
        read_imu(filter_, 0.0, [*random.normal(size=2), -GRAVITY_M_S2])
        advance(filter_, SILENT, lag)
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


def test_a_steady_velocity_comes_through_with_the_dc_gain():
    lag = paper_lag(EPOCH_S)
    filter_ = Filter()
    filter_.x[POSITION + 2] = -50.0
    filter_.x[VELOCITY : VELOCITY + 2] = 2.0, -1.0
    for _ in range(150):
        read_imu(filter_, 0.0, [0.0, 0.0, -GRAVITY_M_S2])
        advance(filter_, SILENT, lag)
    assert lag.gain * filter_.x[[FLOW_LAG, FLOW_LAG + 2]] == pytest.approx([2.0 * A / C, -A / C], rel=1e-8)


def test_below_the_sonars_floor_the_sensor_sees_too_much():
    """At a range of a third of the floor, three times the velocity."""
    lag = paper_lag(EPOCH_S, sonar_floor_m=0.3, lens_below_m=0.1)
    filter_ = Filter()
    filter_.x[POSITION + 2], filter_.x[VELOCITY] = -0.2, 1.0
    for _ in range(150):
        read_imu(filter_, 0.0, [0.0, 0.0, -GRAVITY_M_S2])
        advance(filter_, SILENT, lag)
    assert lag.gain * filter_.x[FLOW_LAG] == pytest.approx(3.0 * A / C, rel=1e-8)
