"""The landing filter's measurement laws: each Jacobian is its own prediction's derivative, each sign the world's."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flownav.compile import ONE_LANE
from flownav.estimation.landing import observe
from flownav.estimation.landing.lag import LEAST_RANGE_M, SEEN, see
from flownav.estimation.landing.observe_pad import PAD_STATES, observe_pad, sight
from flownav.estimation.landing.predict import predict
from flownav.estimation.landing.states import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO,
    FLOW_LAG,
    FLOW_SCALE,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GROUND,
    GYRO_BIAS,
    INS_ERROR,
    POSITION,
    VELOCITY,
    VELOCITY_LAG,
)
from flownav.frames import GRAVITY_M_S2, quaternion_from_euler
from landing_filter import (
    READING,
    ROWS,
    SILENT,
    STATES,
    Landing,
    filters,
    innovation_gradient,
    landing,
    paper_lag,
    product,
    random_covariance,
)

LENS_M = 0.1
AGE_S = 0.02
AXES, CHANNELS, AGES = (0, 1, 2), (0, 1), (0.0, AGE_S)
EXAMPLES = settings(max_examples=15, deadline=None)


def law(function, *arguments):
    """A law as a function of the filter alone."""
    return lambda filter_: function(filter_.work, ONE_LANE, ROWS, *arguments)


def assert_jacobian(filter_: Landing, observed, index, complex_step: bool = True, tolerance: float = 1e-11) -> None:
    run = filter_.copy()
    observed(run)
    ours, theirs = run.jacobian_row(index), innovation_gradient(filter_, observed, complex_step)
    assert np.allclose(ours, theirs, rtol=tolerance, atol=tolerance), np.abs(ours - theirs).max()


# -- Jacobians -----------------------------------------------------------------------------------------------
@EXAMPLES
@given(filters())
def test_jacobians_of_gps_position_and_velocity(filter_):
    for axis in AXES:
        for age_s in AGES:
            position = law(observe.observe_gps_position, axis, READING, age_s)
            assert_jacobian(filter_, position, observe.GPS_POSITION_STATES[axis])
            velocity = law(observe.observe_gps_velocity, axis, READING, age_s)
            assert_jacobian(filter_, velocity, observe.GPS_VELOCITY_STATES[axis])


@EXAMPLES
@given(filters())
def test_jacobians_of_a_state_itself_and_of_pressure(filter_):
    for state in range(6):
        assert_jacobian(filter_, law(observe.observe_state, state, READING), observe.STATE_ITSELF[state])
    assert_jacobian(filter_, law(observe.observe_baro, READING), observe.BARO_STATES)


@EXAMPLES
@given(filters())
def test_jacobian_of_range(filter_):
    assert_jacobian(filter_, law(observe.observe_range, READING, LENS_M), observe.RANGE_STATES)


@EXAMPLES
@given(filters())
def test_jacobian_of_lagged_flow(filter_):
    for channel in CHANNELS:
        flow = law(observe.observe_lagged_flow, channel, READING, 196.9)
        assert_jacobian(filter_, flow, observe.LAGGED_FLOW_STATES[channel])


@EXAMPLES
@given(filters())
def test_jacobian_of_body_velocity(filter_):
    for component in AXES:
        velocity = law(observe.observe_body_velocity, component, READING, READING + 1)
        assert_jacobian(filter_, velocity, observe.BODY_VELOCITY_STATES)


@EXAMPLES
@given(filters())
def test_jacobian_of_flow_rate(filter_):
    for channel in CHANNELS:
        flow = law(observe.observe_flow_rate, channel, READING, READING + 1, LENS_M)
        assert_jacobian(filter_, flow, observe.FLOW_RATE_STATES)


@EXAMPLES
@given(filters(least_m=0.2, most_m=0.5))
def test_jacobian_of_what_the_lagged_sensor_sees_above_and_below_its_floor(filter_):
    def seen(run: Landing, channel: int) -> None:
        see(run.work, run.lanes, ROWS, channel, paper_lag(AGE_S, sonar_floor_m=0.3, lens_below_m=LENS_M), 0)
        run.work[ROWS.innovation] = -run.work[ROWS.seen + channel]

    for channel in CHANNELS:
        assert_jacobian(filter_, partial(seen, channel=channel), SEEN)


@EXAMPLES
@given(filters())
def test_jacobian_of_heading(filter_):
    """arctan2 takes no complex number: differences of fourth order."""
    assert_jacobian(filter_, law(observe.observe_heading, READING), observe.HEADING_STATES, False, 1e-9)


def read_attitude(filter_: Landing, age_s: float) -> None:
    """The attitude reading that this filter expects: its own of that time, turned by the INS's errors."""
    roll, pitch, heading = filter_.x[INS_ERROR : INS_ERROR + 3]
    q = product(filter_.q, filter_.rows(ROWS.change + 6, 4) * [1, -1, -1, -1]) if age_s else filter_.q
    error = filter_.rotation @ [roll, pitch, 0.0] + [0.0, 0.0, heading]
    read = product(np.concatenate([[1.0], 0.5 * error]), q)
    filter_.reading[:4] = read / np.linalg.norm(read)


@EXAMPLES
@given(filters(), st.sampled_from([1.0, -1.0]))
def test_jacobian_of_attitude(filter_, sign):
    """Exact about an INS without error; with errors e, to |e|: the law is that of small angles."""
    turn = np.array([1.0, 0.004, -0.003, 0.006])
    filter_.rows(ROWS.change + 6, 4)[:] = turn / np.linalg.norm(turn)
    for age_s in AGES:
        for size, tolerance in ((0.0, 1e-11), (1.0, 2.0)):
            run = filter_.copy()
            run.x[INS_ERROR : INS_ERROR + 3] *= size
            largest = np.abs(run.x[INS_ERROR : INS_ERROR + 3]).sum()
            read_attitude(run, age_s)
            run.reading[:4] *= sign  # a quaternion and its negative are one attitude
            for axis in AXES:
                attitude = law(observe.observe_attitude, axis, READING, age_s)
                bound = tolerance * (largest if size else 1.0)
                assert_jacobian(run, attitude, observe.ATTITUDE_STATES[axis], True, bound)


def read_pad(filter_: Landing) -> None:
    """The pad fix that this filter expects."""
    ahead, side, down = -filter_.rotation.T @ filter_.x[:3] - [0.0, 0.0, LENS_M]
    filter_.reading[:3] = ahead / down, side / down, np.sqrt(ahead**2 + side**2 + down**2)


@EXAMPLES
@given(filters(), st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.floats(0.3, 30.0))
def test_jacobian_of_a_pad_fix(filter_, forward, right, down_m):
    """The lever of the attitude is the measured one, so the state is put where that is the predicted one."""
    filter_.x[:3] = -filter_.rotation @ [forward * down_m, right * down_m, down_m + LENS_M]
    read_pad(filter_)
    for component in AXES:
        pad = law(observe_pad, component, READING, LENS_M)
        assert_jacobian(filter_, pad, PAD_STATES)
        run = filter_.copy()
        pad(run)
        assert abs(run.work[ROWS.innovation]) < 1e-12 * down_m + 1e-13


@EXAMPLES
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_the_sights_triad_is_orthonormal_and_right_handed(forward, right):
    triad = np.array([sight(forward, right, component) for component in AXES])
    assert np.allclose(triad @ triad.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(triad) == pytest.approx(1.0)
    assert np.allclose(triad[2] * np.sqrt(forward**2 + right**2 + 1.0), [forward, right, 1.0])


# -- signs and conventions, by hand ----------------------------------------------------------------------------
def predicted(filter_: Landing, observed) -> float:
    """What a law expects to read: the negative of its innovation where zero is read."""
    run = filter_.copy()
    run.reading[0] = 0.0
    observed(run)
    return float(-run.work[ROWS.innovation])


def still_life(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Landing:
    filter_ = Landing()
    filter_.q[:] = quaternion_from_euler(roll, pitch, yaw)
    return filter_


def test_range_is_measured_along_body_down_from_the_lens_to_level_ground():
    filter_ = still_life(roll=0.3, pitch=-0.4, yaw=2.0)
    filter_.x[POSITION + 2], filter_.x[GROUND] = -5.0, 1.0
    slant = 6.0 / (np.cos(0.3) * np.cos(0.4)) - LENS_M
    assert predicted(filter_, law(observe.observe_range, READING, LENS_M)) == pytest.approx(slant, rel=1e-14)
    assert observe.height_range(filter_.work, ONE_LANE, ROWS, 0, LENS_M) == pytest.approx(slant, rel=1e-14)


def test_altitude_is_up_and_position_is_down():
    filter_ = still_life()
    filter_.x[POSITION + 2], filter_.x[BARO] = -5.0, 0.7
    assert predicted(filter_, law(observe.observe_baro, READING)) == pytest.approx(5.7)


def test_flow_has_px4s_signs():
    """Forward flight moves the picture about +y, flight to the right about -x; both slower from higher."""
    filter_ = still_life(yaw=0.5 * np.pi)  # nose east
    filter_.x[VELOCITY : VELOCITY + 2] = -2.0, 3.0  # to the right is south: 3 m/s forward, 2 m/s right
    filter_.x[POSITION + 2] = -4.0 - LENS_M
    filter_.x[FLOW_SCALE] = 0.1
    flow = [predicted(filter_, law(observe.observe_flow_rate, c, READING, READING + 1, LENS_M)) for c in CHANNELS]
    assert flow == pytest.approx([-1.1 * 2.0 / 4.0, 1.1 * 3.0 / 4.0])
    body = [predicted(filter_, law(observe.observe_body_velocity, c, READING, READING + 1)) for c in CHANNELS]
    assert body == pytest.approx([3.3, 2.2])


def test_the_lens_moves_with_the_lever():
    filter_ = still_life()
    filter_.x[VELOCITY] = 1.0
    filter_.reading[1] = 0.25
    assert predicted(filter_, law(observe.observe_body_velocity, 0, READING, READING + 1)) == pytest.approx(1.25)


def test_flow_on_the_ground_says_nothing_of_height():
    """Where the range is held at its least, only velocity and attitude explain flow."""
    filter_ = still_life(roll=0.1)
    filter_.x[VELOCITY : VELOCITY + 3] = 0.3, 0.2, 0.0
    flow = law(observe.observe_flow_rate, 0, READING, READING + 1, LENS_M)
    assert_jacobian(filter_, flow, observe.FLOW_RATE_STATES)
    assert observe.height_range(filter_.work, ONE_LANE, ROWS, 0, LENS_M) == LEAST_RANGE_M
    assert filter_.jacobian_row((POSITION + 2, GROUND)) == pytest.approx(0.0)


def test_heading_is_clockwise_from_north_and_wraps():
    filter_ = still_life(roll=0.3, pitch=0.2, yaw=3.1)
    filter_.x[INS_ERROR + 2] = 0.02
    filter_.reading[0] = -3.1
    observe.observe_heading(filter_.work, ONE_LANE, ROWS, READING)
    assert filter_.work[ROWS.innovation] == pytest.approx(2.0 * np.pi - 6.2 - 0.02, abs=1e-12)


def test_a_heading_nose_up_still_has_a_jacobian():
    filter_ = still_life(pitch=0.5 * np.pi)
    observe.observe_heading(filter_.work, ONE_LANE, ROWS, READING)
    assert np.all(np.isfinite(filter_.rows(ROWS.coefficient, 4)))


def test_an_ins_error_in_roll_is_a_turn_about_the_nose():
    filter_ = still_life(yaw=0.5 * np.pi)  # nose east: roll is a turn about east
    filter_.x[INS_ERROR] = 0.01
    filter_.reading[:4] = quaternion_from_euler(0.01, 0.0, 0.5 * np.pi)
    for axis in AXES:
        observe.observe_attitude(filter_.work, ONE_LANE, ROWS, axis, READING, 0.0)
        assert filter_.work[ROWS.innovation] == pytest.approx(0.0, abs=1e-6)


def test_pad_ahead_means_vehicle_behind():
    """Level, nose north, 10 m up and 2 m south of the pad, the pad's tangent forward is +0.2."""
    filter_ = still_life()
    filter_.x[:3] = -2.0, 0.0, -10.0 - LENS_M
    filter_.reading[:3] = 0.2, 0.0, np.hypot(2.0, 10.0)
    for component in AXES:
        observe_pad(filter_.work, ONE_LANE, ROWS, component, READING, LENS_M)
        assert filter_.work[ROWS.innovation] == pytest.approx(0.0, abs=1e-14)


# -- late readings ---------------------------------------------------------------------------------------------
def after_a_step(seed: int) -> tuple[Landing, Landing]:
    """A filter and what it is one prediction later."""
    before = landing(seed, 0.2, -0.3, 1.0, 6.0)
    before.p[:] = random_covariance(np.random.default_rng(seed), 0.01)
    after = before.copy()
    predict(after.work, ONE_LANE, ROWS, AGE_S, SILENT, None)
    return before, after


@EXAMPLES
@given(st.integers(0, 2**32 - 1))
def test_a_late_reading_is_compared_with_the_state_of_its_time(seed):
    before, after = after_a_step(seed)
    for axis in AXES:
        slow_and_fast = after.x[GPS_SLOW + axis] + after.x[GPS_FAST + axis]
        position = predicted(after, law(observe.observe_gps_position, axis, READING, AGE_S))
        assert position == pytest.approx(before.x[POSITION + axis] + slow_and_fast, abs=1e-12)
        velocity = predicted(after, law(observe.observe_gps_velocity, axis, READING, AGE_S))
        lag_m_s = after.x[VELOCITY_LAG] * (after.work[ROWS.force + axis] + (GRAVITY_M_S2 if axis == 2 else 0.0))
        known = before.x[VELOCITY + axis] + after.x[GPS_VELOCITY + axis] - lag_m_s
        assert velocity == pytest.approx(known, abs=1e-12)
    after.x[INS_ERROR : INS_ERROR + 3] = 0.0
    after.reading[:4] = before.q
    for axis in AXES:
        observe.observe_attitude(after.work, ONE_LANE, ROWS, axis, READING, AGE_S)
        assert after.work[ROWS.innovation] == pytest.approx(0.0, abs=1e-14)


@EXAMPLES
@given(st.integers(0, 2**32 - 1))
def test_late_readings_one_after_the_other_are_the_joint_update(seed):
    """What the first component corrected is not corrected again by the second."""
    _, after = after_a_step(seed)
    random = np.random.default_rng(seed)
    laws = [
        (law(observe.observe_gps_position, axis, READING + axis, AGE_S), observe.GPS_POSITION_STATES[axis])
        for axis in AXES
    ] + [
        (law(observe.observe_gps_velocity, axis, READING + 3 + axis, AGE_S), observe.GPS_VELOCITY_STATES[axis])
        for axis in AXES
    ]
    noise = random.uniform(0.001, 0.1, 6)
    after.reading[:6] = 0.0
    for k, (observed, _) in enumerate(laws):
        observed(after)
        after.reading[k] = 0.003 * random.normal() - after.work[ROWS.innovation]
    h, nu = np.zeros((6, STATES)), np.zeros(6)
    for k, (observed, index) in enumerate(laws):
        run = after.copy()
        observed(run)
        h[k], nu[k] = run.jacobian_row(index), run.work[ROWS.innovation]
    gain = after.p @ h.T @ np.linalg.inv(h @ after.p @ h.T + np.diag(noise))
    correction = gain @ nu
    p = (np.eye(STATES) - gain @ h) @ after.p
    q = after.q.copy()
    x = after.x + correction
    for k, (observed, index) in enumerate(laws):
        observed(after)
        after.work[[ROWS.noise, ROWS.offered]] = noise[k], 1.0
        assert after.fuse(index)
    others = [i for i in range(STATES) if not ATTITUDE <= i < ATTITUDE + 3]
    assert np.allclose(after.x[others], x[others], rtol=0, atol=1e-11)
    assert np.allclose(after.p, p, rtol=0, atol=1e-10)
    turn = product(after.q, q * [1, -1, -1, -1])
    theta = correction[ATTITUDE : ATTITUDE + 3]
    assert np.allclose(2.0 * turn[1:] / turn[0], theta, rtol=0, atol=1e-5)


@EXAMPLES
@given(st.integers(0, 2**32 - 1), st.sampled_from(AGES))
def test_an_attitude_read_by_components_leaves_no_innovation_behind(seed, age_s):
    """A reading without noise is believed: afterwards every axis agrees with it, the first as well as the last."""
    _, filter_ = after_a_step(seed)
    filter_.x[INS_ERROR : INS_ERROR + 3] = 0.0
    filter_.p[INS_ERROR : INS_ERROR + 3], filter_.p[:, INS_ERROR : INS_ERROR + 3] = 0.0, 0.0
    read_attitude(filter_, age_s)
    small = np.array([1.0, 1e-4, -2e-4, 1.5e-4])
    filter_.reading[:4] = product(small / np.linalg.norm(small), filter_.reading[:4])
    for axis in AXES:
        observe.observe_attitude(filter_.work, ONE_LANE, ROWS, axis, READING, age_s)
        filter_.work[[ROWS.noise, ROWS.offered]] = 1e-16, 1.0
        assert filter_.fuse(observe.ATTITUDE_STATES[axis])
    for axis in AXES:
        observe.observe_attitude(filter_.work, ONE_LANE, ROWS, axis, READING, age_s)
        assert filter_.work[ROWS.innovation] == pytest.approx(0.0, abs=1e-6)


def test_what_no_law_reads_no_law_corrects_directly():
    """Biases and the lag's rates have no coefficient anywhere: they are learnt through the covariance alone."""
    read = {s for name in dir(observe) if name.endswith("_STATES") for s in np.ravel(getattr(observe, name))}
    unread = set(range(STATES)) - {int(s) for s in read}
    biases = {*range(GYRO_BIAS, GYRO_BIAS + 3), *range(ACCEL_BIAS, ACCEL_BIAS + 3)}
    assert unread == biases | {FLOW_LAG + 1, FLOW_LAG + 3}
