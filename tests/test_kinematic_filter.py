"""The kinematic filter against FilterPy, its laws against their definitions, its lanes against one another."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from flownav.compile import LANES, ONE_LANE, kernel
from flownav.estimation import kinematic_filter as kf
from flownav.estimation.kinematic_settings import KinematicSettings, KinematicSettingsFile, default_settings
from flownav.frames import quaternion_from_euler, rotation_from_quaternion
from flownav.sensors.angular_flow import metric_flow

ROWS = kf.kinematic_rows(0)
GYRO = kf.KINEMATIC_ROW_COUNT
OFFERED = GYRO + 3
END = OFFERED + 3
SETTINGS = default_settings()._replace(path_noise_m_rt_m=0.0, trim_limit_m_s2=0.0, gate_sigma=1e6)
STATE = slice(ROWS.kalman.state, ROWS.kalman.state + 6)
COVARIANCE = slice(ROWS.kalman.covariance, ROWS.kalman.covariance + 36)


@kernel
def predict(work, lanes, dt_s, numbers):
    kf.predict(work, lanes, ROWS, dt_s, numbers)


@kernel
def coast(work, lanes, dt_s, numbers):
    kf.coast(work, lanes, ROWS, dt_s, numbers)


@kernel
def turn(work, lanes, dt_s):
    kf.turn_attitude(work, lanes, ROWS, GYRO, dt_s)


@kernel
def fuse_state(work, lanes, index, numbers, trim_rate):
    kf.observe_state(work, lanes, ROWS, index, OFFERED, OFFERED + 1, OFFERED + 2)
    kf.correct(work, lanes, ROWS, numbers, trim_rate)


@kernel
def fuse_body_velocity(work, lanes, component, numbers, trim_rate):
    kf.observe_body_velocity(work, lanes, ROWS, component, OFFERED, OFFERED + 1, OFFERED + 2)
    kf.correct(work, lanes, ROWS, numbers, trim_rate)


class Filter:
    """The filter under test, all lanes alike unless told otherwise."""

    def __init__(self, numbers: KinematicSettings = SETTINGS, lanes: tuple[int, ...] = ONE_LANE) -> None:
        self.numbers, self.lanes = numbers, lanes
        self.work = np.zeros(END * len(lanes))
        self.rows = self.work.reshape(END, len(lanes))
        self.rows[ROWS.attitude] = 1.0
        self.rows[COVARIANCE] = np.diag([4.0, 4.0, 9.0, 1.0, 1.0, 2.0]).reshape(36, 1)

    def level_force(self) -> None:
        self.rows[ROWS.force : ROWS.force + 3] = np.array([0.0, 0.0, -kf.GRAVITY_M_S2])[:, None]

    def point(self, roll: float, pitch: float, yaw: float) -> None:
        self.rows[ROWS.attitude : ROWS.attitude + 4] = np.array(quaternion_from_euler(roll, pitch, yaw))[:, None]

    def offer(self, value: float, variance: float, offered: float = 1.0) -> None:
        self.rows[OFFERED], self.rows[OFFERED + 1], self.rows[OFFERED + 2] = value, variance, offered

    def predict(self, dt_s: float) -> None:
        predict(self.work, self.lanes, dt_s, self.numbers)

    def fuse_state(
        self, index: int, value: float, variance: float, offered: float = 1.0, trim_rate: float = 0.0
    ) -> None:
        self.offer(value, variance, offered)
        fuse_state(self.work, self.lanes, index, self.numbers, trim_rate)

    def fuse_body(self, component: int, value: float, variance: float, trim_rate: float = 0.0) -> None:
        self.offer(value, variance)
        fuse_body_velocity(self.work, self.lanes, component, self.numbers, trim_rate)

    @property
    def x(self) -> np.ndarray:
        return self.rows[STATE, -1].copy()

    @property
    def p(self) -> np.ndarray:
        return self.rows[COVARIANCE, -1].reshape(6, 6).copy()


def oracle() -> KalmanFilter:
    filter_ = KalmanFilter(dim_x=6, dim_z=1, dim_u=3)
    filter_.P = np.diag([4.0, 4.0, 9.0, 1.0, 1.0, 2.0])
    return filter_


def oracle_predict(filter_: KalmanFilter, dt: float, accel: np.ndarray, noise: float) -> None:
    eye, q = np.eye(3), noise * noise
    filter_.F = np.block([[eye, dt * eye], [0 * eye, eye]])
    filter_.B = np.vstack([0.5 * dt * dt * eye, dt * eye])
    filter_.Q = q * np.block([[eye * dt**3 / 3, eye * dt**2 / 2], [eye * dt**2 / 2, eye * dt]])
    filter_.predict(u=accel[:, None])


def test_hundreds_of_steps_match_filterpy():
    random = np.random.default_rng(3)
    ours, theirs = Filter(), oracle()
    for step in range(400):
        angles = [*random.uniform(-0.4, 0.4, 2), random.uniform(-3, 3)]
        ours.point(*angles)
        rotation = np.array(rotation_from_quaternion(*quaternion_from_euler(*angles))).reshape(3, 3)
        force = random.normal([0, 0, -9.8], 1.0)
        ours.rows[ROWS.force : ROWS.force + 3, 0] = force
        dt = random.uniform(0.005, 0.05)
        ours.predict(dt)
        oracle_predict(theirs, dt, rotation @ force + [0, 0, kf.GRAVITY_M_S2], SETTINGS.accel_noise_m_s2_rt_hz)
        index, value, variance = step % 6, random.normal(), random.uniform(0.01, 4.0)
        ours.fuse_state(index, value, variance)
        theirs.update(np.array([[value]]), R=np.array([[variance]]), H=np.eye(6)[index : index + 1])
        component = step % 3
        ours.fuse_body(component, value, variance)
        row = np.concatenate([np.zeros(3), rotation[:, component]])[None, :]
        theirs.update(np.array([[value]]), R=np.array([[variance]]), H=row)
    assert np.allclose(ours.x, theirs.x[:, 0], rtol=0, atol=1e-10)
    assert np.allclose(ours.p, theirs.P, rtol=0, atol=1e-10)


def test_covariance_stays_symmetric_and_positive_through_a_hundred_thousand_updates():
    random = np.random.default_rng(4)
    ours = Filter()
    ours.level_force()
    for step in range(25_000):
        ours.predict(0.02)
        ours.fuse_state(step % 6, 0.0, float(10.0 ** random.uniform(-6, 2)))
        for component in range(3):
            ours.fuse_body(component, 0.0, float(10.0 ** random.uniform(-6, 2)))
    p = ours.p
    assert np.array_equal(p, p.T)
    assert np.linalg.eigvalsh(p).min() > 0


def test_sixteen_lanes_are_bitwise_the_one_lane():
    def fly(lanes):
        ours = Filter(default_settings(), lanes)
        random = np.random.default_rng(5)
        for step in range(200):
            ours.point(*random.uniform(-0.3, 0.3, 3))
            ours.rows[ROWS.force : ROWS.force + 3] = random.normal([0, 0, -9.8], 0.5)[:, None]
            ours.predict(0.02)
            ours.fuse_state(step % 6, random.normal(), 1.0, trim_rate=0.02)
            ours.fuse_body(step % 3, random.normal(), 0.1, trim_rate=0.02)
        return ours.rows[:, -1]

    one, many = fly(ONE_LANE), fly(LANES)
    assert np.array_equal(one[: kf.KINEMATIC_ROW_COUNT], many[: kf.KINEMATIC_ROW_COUNT])


def test_a_lane_that_is_not_offered_keeps_its_state():
    ours = Filter(lanes=LANES)
    ours.offer(5.0, 1.0)
    ours.rows[OFFERED + 2, 3] = 0.0
    fuse_state(ours.work, LANES, 0, SETTINGS, 0.0)
    assert ours.rows[ROWS.kalman.state, 3] == 0.0
    assert ours.rows[ROWS.kalman.covariance, 3] == 4.0
    assert np.all(np.delete(ours.rows[ROWS.kalman.state], 3) == 4.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_never_fused(bad):
    ours = Filter(default_settings())
    before, spread = ours.x, ours.p
    for value, variance in ((bad, 1.0), (1.0, bad)):
        ours.fuse_state(0, value, variance, trim_rate=0.1)
        ours.fuse_body(1, value, variance, trim_rate=0.1)
        assert ours.rows[ROWS.kalman.accepted, 0] == 0.0
    assert np.array_equal(ours.x, before)
    assert np.array_equal(ours.p, spread)
    assert np.array_equal(ours.rows[ROWS.trim : ROWS.trim + 3, 0], np.zeros(3))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_gate_opens_at_its_sigma_and_not_before(sign):
    for share, accepted in ((0.999, 1.0), (1.001, 0.0)):
        ours = Filter(default_settings())
        sigma = np.sqrt(4.0 + 1.0)
        ours.fuse_state(0, sign * share * ours.numbers.gate_sigma * sigma, 1.0)
        assert ours.rows[ROWS.kalman.accepted, 0] == accepted
        assert ours.rows[ROWS.kalman.test_ratio, 0] == pytest.approx(share**2)
        assert (ours.x[0] != 0.0) == bool(accepted)


def test_level_and_at_rest_the_state_stays():
    ours = Filter()
    ours.level_force()
    for _ in range(100):
        ours.predict(0.05)
    assert np.abs(ours.x).max() == 0.0


def test_nose_down_accelerates_north():
    ours = Filter()
    ours.point(0.0, -0.1, 0.0)
    ours.rows[ROWS.force : ROWS.force + 3, 0] = 0.0, 0.0, -kf.GRAVITY_M_S2 / np.cos(0.1)
    ours.predict(1.0)
    accel = kf.GRAVITY_M_S2 * np.tan(0.1)
    assert ours.x == pytest.approx([0.5 * accel, 0, 0, accel, 0, 0], abs=1e-12)


def test_coasting_keeps_velocity_and_grows_faster():
    driven, coasting = Filter(), Filter()
    driven.level_force()
    for ours in (driven, coasting):
        ours.rows[STATE, 0] = 1, 2, 3, 4, 5, 6
    driven.predict(0.5)
    coast(coasting.work, ONE_LANE, 0.5, SETTINGS)
    assert coasting.x == pytest.approx([3, 4.5, 6, 4, 5, 6])
    assert np.all(np.diag(coasting.p) > np.diag(driven.p))


def test_position_noise_grows_with_the_distance_flown():
    numbers = SETTINGS._replace(path_noise_m_rt_m=0.1)
    slow, fast = Filter(numbers), Filter(numbers)
    for ours, speed in ((slow, 0.0), (fast, 3.0)):
        ours.level_force()
        ours.rows[ROWS.kalman.state + 3, 0] = speed
        ours.predict(0.1)
    assert fast.p[0, 0] - slow.p[0, 0] == pytest.approx(0.1**2 * 3.0 * 0.1)
    assert np.array_equal(fast.p[3:, 3:], slow.p[3:, 3:])


def test_attitude_is_carried_on_by_the_gyro():
    ours = Filter()
    ours.rows[GYRO : GYRO + 3, 0] = 0.0, 0.0, 0.5
    for _ in range(1000):
        turn(ours.work, ONE_LANE, 0.001)
    w, x, y, z = ours.rows[ROWS.attitude : ROWS.attitude + 4, 0]
    assert 2 * np.arctan2(z, w) == pytest.approx(0.5, abs=1e-6)
    assert np.hypot(np.hypot(w, x), np.hypot(y, z)) == pytest.approx(1.0, abs=1e-12)


def test_a_tilted_accelerometer_is_trimmed_away():
    """A roll error shows as a sideways specific force; velocity corrections lead it into the trim."""
    numbers = default_settings()
    ours = Filter(numbers)
    ours.point(0.0, 0.0, 1.0)
    bias = np.array([0.1, -0.2, 0.05])
    ours.rows[ROWS.force : ROWS.force + 3, 0] = np.add(bias, [0, 0, -kf.GRAVITY_M_S2])
    for step in range(6 * 60 * 50):
        ours.predict(0.02)
        if step % 5 == 0:
            for component in range(3):
                ours.fuse_body(component, 0.0, 0.01, trim_rate=1.0 / numbers.trim_time_s)
    assert ours.rows[ROWS.trim : ROWS.trim + 3, 0] == pytest.approx(bias, abs=0.002)


def test_the_trim_keeps_to_its_limit():
    numbers = default_settings()._replace(trim_limit_m_s2=0.3)
    ours = Filter(numbers)
    ours.rows[ROWS.force : ROWS.force + 3, 0] = 2.0, 0.0, -kf.GRAVITY_M_S2
    for _ in range(3000):
        ours.predict(0.02)
        ours.fuse_body(0, 0.0, 0.01, trim_rate=1.0)
    assert ours.rows[ROWS.trim, 0] == 0.3


# -- measurement laws --------------------------------------------------------------------------------------
@settings(deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-1, 1), st.floats(-1, 1), st.floats(0.1, 30))
def test_flow_gives_back_the_velocity_that_made_it(u, v, p, q, r):
    """PX4: flow_x = p - v/r, flow_y = q + u/r."""
    found = metric_flow(p - v / r, q + u / r, p, q, r)
    assert found == pytest.approx((u, v), abs=1e-9)


def test_pure_rotation_is_no_velocity():
    assert metric_flow(0.7, -0.4, 0.7, -0.4, 5.0) == (0.0, 0.0)


@settings(max_examples=50, deadline=None)
@given(st.floats(0.1, 20), st.floats(0, 5), st.floats(1, 255))
def test_flow_noise_grows_with_height_and_falls_with_quality(range_m, speed, quality):
    variance = kf.flow_velocity_variance
    numbers = default_settings()
    here = variance(range_m, 0.01, speed, quality, numbers)
    assert variance(range_m * 1.5, 0.01 * 1.5**2, speed, quality, numbers) > here
    assert variance(range_m, 0.01, speed, quality / 2, numbers) > here
    assert here >= numbers.flow_floor_m_s**2


def test_flow_noise_at_full_quality_is_the_stated_one():
    numbers = default_settings()
    found = kf.flow_velocity_variance(3.0, 0.0, 2.0, 255.0, numbers)
    assert found == pytest.approx((3.0 * numbers.flow_sigma_rad_s) ** 2 + numbers.flow_floor_m_s**2)


# -- settings ----------------------------------------------------------------------------------------------
def test_the_file_schema_and_the_kernel_tuple_name_the_same_settings_in_order():
    assert tuple(KinematicSettingsFile.model_fields) == KinematicSettings._fields


def test_every_setting_says_why():
    for name, field in KinematicSettingsFile.model_fields.items():
        assert field.description, name
        assert len(field.description) > 10, name


def test_the_documentation_states_the_shipped_defaults():
    page = (Path(__file__).parents[1] / "docs" / "kinematic-filter.md").read_text(encoding="utf-8")
    for name, field in KinematicSettingsFile.model_fields.items():
        assert f"| `{name}` | {field.default:g} | {field.description} |" in page, name
