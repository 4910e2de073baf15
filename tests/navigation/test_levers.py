"""Sensors away from the IMU, and motion between its readings: stated, they do no harm; missing or reversed, they do."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from navigation_streams import Flown, circle, fly, navigate, still

AHEAD_M, RIGHT_M, TURN_RAD_S = 0.6, -0.3, 0.8


@pytest.fixture(scope="module")
def turning() -> Flown:
    """A hover that turns; its GPS goes away, so that flow alone tells the velocity."""
    flown = fly(still, 20.0, TURN_RAD_S)
    for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY):
        flown = flown.cut(sensor, 8.0, 99.0)
    return flown


def rate_of(flown: Flown, t_s: np.ndarray) -> np.ndarray:
    return np.where(t_s > 1.0, TURN_RAD_S, 0.0)


def with_lens_ahead(flown: Flown) -> Flown:
    """w x l of a lens ahead and to the left, seen in the flow: flow_x = -v/r, flow_y = u/r."""
    stream = flown.streams[Sensor.FLOW_RATE]
    rate, value = rate_of(flown, stream.t_s), stream.value.copy()
    value[:, 0] -= rate * AHEAD_M / 2.0
    value[:, 1] += -rate * RIGHT_M / 2.0
    return flown.changed(Sensor.FLOW_RATE, value=value)


def with_metric_lens_ahead(flown: Flown) -> Flown:
    """The same of a sensor that states velocities."""
    t_s = flown.streams[Sensor.FLOW_RATE].t_s
    rate = rate_of(flown, t_s)
    value = np.column_stack([-rate * RIGHT_M, rate * AHEAD_M, np.full(len(t_s), np.nan)])
    return flown.without(Sensor.FLOW_RATE).added(Stream.of(Sensor.FLOW_VELOCITY, t_s, value))


@pytest.mark.parametrize("seen_by", [with_lens_ahead, with_metric_lens_ahead])
def test_the_velocity_of_a_lens_away_from_the_imu_is_taken_off_its_flow(turning, seen_by):
    flown = seen_by(turning)
    told = navigate(flown, flow_forward_m=AHEAD_M, flow_right_m=RIGHT_M)
    reversed_ = navigate(flown, flow_forward_m=-AHEAD_M, flow_right_m=-RIGHT_M)
    late = told.t_s > 9.0
    assert np.abs(told.velocity_error[late, :2]).max() < 0.02
    assert np.abs(told.error[late, :2]).max() < 0.1
    assert np.abs(reversed_.velocity_error[reversed_.t_s > 9.0, :2]).max() > 0.3
    assert np.abs(navigate(flown).velocity_error[-100:, :2]).max() > 0.15


def test_the_place_of_a_lens_below_is_taken_off_its_range():
    """Flow over a range of 1.5 m, the IMU half a metre above the lens."""
    flown = fly(circle, 20.0)
    for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY):
        flown = flown.cut(sensor, 8.0, 99.0)
    ranges, flow = flown.streams[Sensor.RANGE], flown.streams[Sensor.FLOW_RATE]
    flown = flown.changed(Sensor.RANGE, value=ranges.value - 0.5)
    flown = flown.changed(Sensor.FLOW_RATE, value=flow.value * [2.0 / 1.5, 2.0 / 1.5, 1.0, 1.0, 1.0, 1.0])
    told = navigate(flown, flow_below_m=0.5, range_below_m=0.5)
    assert np.abs(told.error[told.t_s > 8.0]).max() < 0.01
    reversed_ = navigate(flown, flow_below_m=-0.5, range_below_m=0.5, flow_scale_sigma=0.0)  # GPS would teach it
    assert np.abs(reversed_.error[reversed_.t_s > 8.0, :2]).max() > 1.0


def test_the_antennas_place_and_velocity_are_taken_off_the_fixes():
    flown = fly(still, 20.0, TURN_RAD_S).without(Sensor.FLOW_RATE)
    position, velocity = flown.streams[Sensor.GPS_POSITION], flown.streams[Sensor.GPS_VELOCITY]
    yaw = np.interp(position.t_s, flown.t_s, flown.yaw)
    arm = np.column_stack([np.cos(yaw), np.sin(yaw), 0.0 * yaw])
    across = np.column_stack([-np.sin(yaw), np.cos(yaw), 0.0 * yaw])
    rate = rate_of(flown, position.t_s)[:, None]
    flown = flown.changed(Sensor.GPS_POSITION, value=position.value + 1.5 * arm)
    flown = flown.changed(Sensor.GPS_VELOCITY, value=velocity.value + 1.5 * rate * across)
    told, reversed_ = (navigate(flown, gps_forward_m=ahead_m) for ahead_m in (1.5, -1.5))
    assert np.abs(told.velocity_error[told.t_s > 5.0, :2]).max() < 0.02
    assert np.abs(reversed_.velocity_error[reversed_.t_s > 5.0, :2]).max() > 0.2


def test_between_readings_the_imu_is_taken_to_change_evenly():
    """A push that grows by 1 m/s3, read 25 times a second: held, each reading would be half a period late, 0.1 m/s."""

    def pushed(t_s: np.ndarray) -> np.ndarray:
        begun = np.clip(t_s - 3.0, 0.0, None)
        return np.column_stack([begun**3 / 6.0, 0.0 * t_s, 0.0 * t_s - 2.0])

    flown = fly(pushed, 8.0).only(Sensor.IMU, Sensor.ATTITUDE, Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
    for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY):
        flown = flown.cut(sensor, 3.0, 99.0)
    rows = slice(None, None, 4)
    imu = {name: getattr(flown.streams[Sensor.IMU], name)[rows] for name in ("t_s", "value", "variance", "quality")}
    shaken = np.where(np.arange(len(imu["t_s"])) % 2 == 0, 0.3, -0.3)[:, None]  # up and down: it flies
    imu["value"] = imu["value"] + shaken * [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    flown = flown.changed(Sensor.IMU, **imu)
    sampled, integrating = navigate(flown), navigate(flown, imu_integrates=1.0)
    assert np.abs(sampled.velocity_error[-1]).max() < 0.02
    assert integrating.velocity_error[-1, 0] == pytest.approx(0.1, abs=0.03)  # stated in another unit than it is
