"""Errors that only look like a scale: a wrong interval, and an offset that is fixed in the body's axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_identification_flight import GAIN_X, GAIN_Y, written

from flownav.core.measurement import Sensor, Stream
from flownav.core.parameter_files import check
from flownav.lab.identification.findings import facts_of
from flownav.lab.identification.flight_identification import identify_flight
from flownav.lab.identification.own_gyro import OwnGyro, own_gyro
from flownav.lab.identification.quantities import CANDIDATES, Interval
from flownav.lab.identification.sensor_file import sensor_entries
from flownav.logs.log import Log
from flownav.logs.open_log import open_log
from flownav.replays.prepare import ReplayOptions, prepare
from flownav.sensors.datasheet import (
    FlowSensor,
    IdentifiedFlow,
    certain_offset,
    identified_flow,
    in_vehicle_axes,
    load_sensor,
)


def turning(path, slope=1.0, noise=0.01, turn_rad=0.0, imu_hz=200.0, flow_hz=50.0):
    """A vehicle that turns about x and y, seen by its IMU and by a flow sensor's gyro of a slope, 40 ms late."""
    rng = np.random.default_rng(7)

    def rates(t):
        return np.column_stack([0.4 * np.sin(2.1 * t) + 0.2 * np.sin(5.3 * t), 0.3 * np.cos(1.7 * t + 0.4)])

    t_s = np.arange(0.0, 60.0, 1.0 / imu_hz)
    imu = np.column_stack([rates(t_s), np.zeros((len(t_s), 4))]) + noise * rng.normal(size=(len(t_s), 6))
    seen = np.arange(1.0, 59.0, 1.0 / flow_hz)
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    gyro = slope * rates(seen) @ np.array([[c, s], [-s, c]]) + noise * rng.normal(size=(len(seen), 2))
    flow = np.column_stack([np.zeros((len(seen), 2)), gyro])
    streams = [Stream.of(Sensor.IMU, t_s, imu), Stream.of(Sensor.FLOW_RATE, seen + 0.04, flow)]
    return Log(path, {stream.sensor: stream for stream in streams}, None, None, {}, ())


@pytest.mark.parametrize(("slope", "factor"), [(0.5, "2 (stated too long)"), (2.0, "2 (stated too short)"),
                                               (1.5, "1.5 (stated too short)")])  # fmt: skip
def test_the_slope_of_the_two_gyros_tells_a_wrong_interval_without_a_reference(tmp_path, slope, factor):
    found = own_gyro(turning(tmp_path, slope))
    assert found.slope.low < slope < found.slope.high
    assert found.slope.high - found.slope.low < 0.05 * slope
    assert found.lag_s == pytest.approx(0.04, abs=0.011)
    assert found.is_off
    assert f"integration time wrong by {factor}" in found.sentence(None)
    assert f"integration time wrong by {factor}" in found.sentence(0.9 * slope)
    assert "the gyro's own scale is wrong" in found.sentence(1.0)


def test_a_sound_gyro_a_noisy_one_and_a_turned_one_are_no_wrong_interval(tmp_path):
    for log in (turning(tmp_path), turning(tmp_path, 0.5, noise=1.0), turning(tmp_path, 0.5, turn_rad=1.6)):
        found = own_gyro(log)
        assert found is None or not found.is_off
        assert found is None or not found.sentence(None)


def test_a_slow_imu_makes_the_interval_wide_and_no_fault(tmp_path):
    """Rates that are sampled too slowly pull the slope down; the other regression's is the interval's other end."""
    found = own_gyro(turning(tmp_path, 1.0, noise=0.4))
    assert found.slope.value < 0.97
    assert found.slope.high > 1.0
    assert not found.is_off


def test_without_two_gyros_there_is_no_slope(tmp_path):
    log = turning(tmp_path)
    alone = replace(log, streams={Sensor.FLOW_RATE: log.streams[Sensor.FLOW_RATE]})
    assert own_gyro(alone) is None
    assert OwnGyro(Interval(0.5, 0.3, 0.9), 0.0, 0.99, 0.0).sentence(None) == ""


def test_an_offset_is_taken_out_in_the_vehicles_axes_and_no_offset_changes_no_bit():
    value = np.random.default_rng(1).normal(size=(50, 4))
    plain = IdentifiedFlow(1.0, 1.0, 0.02)
    assert in_vehicle_axes(value, plain, angular=True).tobytes() == value.tobytes()
    off = plain._replace(offset_rad_s=(0.01, -0.03))
    taken = value - in_vehicle_axes(value, off, angular=True)
    np.testing.assert_allclose(taken, [[0.01, -0.03, 0.0, 0.0]] * 50, atol=1e-12)
    half_turn = off._replace(axes=((-1.0, 0.0), (0.0, -1.0)))
    taken = -value[:, :2] - in_vehicle_axes(value, half_turn, angular=True)[:, :2]
    np.testing.assert_allclose(taken, [[0.01, -0.03]] * 50, atol=1e-12)
    np.testing.assert_array_equal(in_vehicle_axes(value[:, :2], off, angular=False), value[:, :2])


@pytest.fixture(scope="module")
def drifting(tmp_path_factory):
    """A flight with 0.03 rad/s on flow_y, against motion capture, and what was identified of it."""
    folder = written(tmp_path_factory.mktemp("drift"), turned_rad=0.0)
    flow = np.genfromtxt(folder / "flow.csv", delimiter=",", names=True)
    flow["flow_y_rad_s"] += 0.03
    names = flow.dtype.names
    np.savetxt(
        folder / "flow.csv", flow.view(float).reshape(len(flow), -1), delimiter=",", header=",".join(names), comments=""
    )
    return folder, identify_flight(folder, CANDIDATES)


def test_a_drift_fixed_in_the_body_is_an_offset_with_its_interval_and_no_scale(drifting):
    x, y = drifting[1].offset
    assert x.low < 0.0 < x.high
    assert y.low < 0.03 < y.high
    assert y.high - y.low < 0.015
    assert drifting[1].offset.certain == (0.0, y.value)
    along_x, along_y = drifting[1].responses
    assert along_x.gain.low < GAIN_X < along_x.gain.high
    assert along_y.gain.low < GAIN_Y < along_y.gain.high
    assert facts_of(drifting[1])["flow_offset_rad_s"]["y"] == y._asdict()


def test_the_sensor_file_holds_the_offset_and_the_navigator_is_given_flow_without_it(drifting):
    folder, found = drifting
    sensor = check(sensor_entries(found, load_sensor(), "drifting", "a test"), FlowSensor, "drifting")
    known = identified_flow(sensor)
    assert known.offset_rad_s == pytest.approx((0.0, found.offset.y.value), rel=1e-6)
    log = open_log(folder)
    plain = prepare(log, ReplayOptions(identified=known._replace(offset_rad_s=(0.0, 0.0))))
    without = prepare(log, ReplayOptions(identified=known))
    change = plain.streams[Sensor.FLOW_RATE].value[:, :2] - without.streams[Sensor.FLOW_RATE].value[:, :2]
    np.testing.assert_allclose(change, [known.offset_rad_s] * len(change), atol=1e-9)


def test_an_offset_that_is_not_certain_is_left_alone():
    assert certain_offset(0.03, 0.02, 0.04) == 0.03
    assert certain_offset(-0.03, -0.04, -0.02) == -0.03
    assert certain_offset(0.03, 0.005, 0.055) == 0.0
