"""A simulated flight's log says what its vehicle's sensors saw, when, and how well they knew it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flownav.campaign.local import fly_recorded
from flownav.faults.flight_log import log_of
from flownav.frames import rotation_from_quaternion
from flownav.measurement import Sensor
from flownav.parameter_files import check
from flownav.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import Scenario, load_scenario

ERRORLESS = {
    "model": "midg",
    **dict.fromkeys(
        ("slow_sigma_m", "slow_sigma_down_m", "fast_sigma_m", "fast_sigma_down_m", "jitter_sigma_m",
         "position_quantum_m", "velocity_sigma_m_s", "velocity_white_m_s", "velocity_quantum_m_s", "tilt_sigma_deg",
         "heading_sigma_deg"), 0.0),
}  # fmt: skip


def flown(gps=None, latency_s=0.02):
    """A setup and its record: down from 4 m beside the middle of the pad, with pad fixes, on the truth."""
    entries = load_scenario("approach").model_dump(exclude_unset=True)
    entries["autopilot"] = {"feedback": "truth"}
    entries["flight"] = {
        "duration_s": 20.0, "start": "hover", "may_land_after_s": 5.0,
        "path": [
            {"t_s": 0.0, "height_m": 4.0, "north_m": 0.6, "east_m": -0.4},
            {"t_s": 5.0, "height_m": 2.5},
            {"t_s": 20.0, "height_m": -2.0},
        ],
    }  # fmt: skip
    if gps is not None:
        entries["gps"] = gps | {"latency_s": latency_s}
    setup = assemble(check(entries, Scenario, "test"))
    return setup, fly_recorded(setup, 3)


@pytest.fixture(scope="module")
def flight():
    return flown()


def true(record, columns):
    return record.matrix("truth", columns)


def lens_range(setup, record):
    cosine = rotation_from_quaternion(*true(record, QUATERNION).T)[8]
    return (-true(record, POSITION_NED)[:, 2] - setup.flight.sensors.lens_below_cg_m * cosine) / cosine


def test_the_log_holds_every_sensor_of_the_vehicle_and_the_truth(flight):
    setup, record = flight
    log = log_of(record, setup)
    assert set(log.streams) == {
        Sensor.IMU, Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.FLOW_VELOCITY, Sensor.RANGE, Sensor.PAD,
        Sensor.LANDED,
    }  # fmt: skip
    assert all(sensor == stream.sensor for sensor, stream in log.streams.items())
    assert log.truth is record.tables["truth"]
    rates = {sensor: 1.0 / np.median(np.diff(stream.t_s)) for sensor, stream in log.streams.items()}
    assert rates[Sensor.IMU] == pytest.approx(50.0)
    assert rates[Sensor.RANGE] == rates[Sensor.PAD] == pytest.approx(10.0)
    assert log.limits["range_m"] == (0.3, 5.0)
    with_attitude = log_of(record, setup, attitude=True)
    assert set(with_attitude.streams) - set(log.streams) == {Sensor.ATTITUDE}


@pytest.mark.parametrize("latency_s", [0.0, 0.02])
def test_gps_describes_the_instant_that_its_delay_says(latency_s):
    setup, record = flown(ERRORLESS, latency_s)
    log = log_of(record, setup, attitude=True)
    truth = record.tables["truth"]["t_s"]
    rotation = np.array(rotation_from_quaternion(*true(record, QUATERNION).T)).T.reshape(-1, 3, 3)
    velocity = np.einsum("nij,nj->ni", rotation, true(record, VELOCITY_BODY))
    for sensor, expected in (
        (Sensor.GPS_POSITION, true(record, POSITION_NED)),
        (Sensor.GPS_VELOCITY, velocity),
        (Sensor.ATTITUDE, true(record, QUATERNION)),
    ):
        stream = log.streams[sensor]
        assert stream.delay_s == latency_s
        assert len(stream) == len(truth) - (latency_s > 0.0)
        rows = np.searchsorted(truth, stream.t_s - stream.delay_s - 1e-6)
        np.testing.assert_allclose(stream.value, expected[rows], atol=1e-9)


def test_gps_states_the_sigma_of_its_whole_error(flight):
    setup, record = flight
    log = log_of(record, setup)
    gps = setup.scenario.gps
    np.testing.assert_allclose(np.sqrt(log.streams[Sensor.GPS_POSITION].variance[7]), gps.position_sigma_m)
    np.testing.assert_allclose(np.sqrt(log.streams[Sensor.GPS_VELOCITY].variance[7]), gps.velocity_sigma_total_m_s)


def test_ranges_are_what_they_state_above_the_floor(flight):
    setup, record = flight
    stream = log_of(record, setup).streams[Sensor.RANGE]
    expected = lens_range(setup, record)[::5]
    clear = (expected > 0.35) & (stream.quality > 0)
    normal = (stream.value[clear, 0] - expected[clear]) / np.sqrt(stream.variance[clear, 0])
    assert np.count_nonzero(clear) > 50
    assert normal.std() == pytest.approx(1.0, abs=0.25)
    assert abs(normal.mean()) < 0.4


def test_pad_fixes_are_what_they_state_off_the_vertical_too(flight):
    setup, record = flight
    stream = log_of(record, setup).streams[Sensor.PAD]
    rotation = np.array(rotation_from_quaternion(*true(record, QUATERNION).T)).T.reshape(-1, 3, 3)
    lens = true(record, POSITION_NED) + rotation[:, :, 2] * setup.flight.sensors.lens_below_cg_m
    sight = np.einsum("nji,nj->ni", rotation, -lens)[::5]
    seen = stream.quality > 0
    distance = np.linalg.norm(sight, axis=1)
    expected = np.column_stack([sight[:, 0] / sight[:, 2], sight[:, 1] / sight[:, 2], distance])[seen]
    normal = (stream.value[seen] - expected) / np.sqrt(stream.variance[seen])
    assert np.count_nonzero(seen) > 80
    np.testing.assert_allclose(normal.std(axis=0), 1.0, atol=0.25)


def test_flow_without_quality_says_nothing_and_a_velocity_has_no_vertical(flight):
    setup, record = flight
    stream = log_of(record, setup).streams[Sensor.FLOW_VELOCITY]
    assert np.isnan(stream.value[:, 2]).all()
    silent = stream.quality == 0
    assert 0 < np.count_nonzero(silent) < len(stream)
    assert (stream.value[silent, :2] == 0.0).all()
    seen = record.matrix("flow_velocity", ("vel_u_m_s", "vel_v_m_s"))
    np.testing.assert_array_equal(stream.value[~silent, :2], seen[~silent])


def test_flow_rates_times_the_range_less_the_gyro_are_the_velocities(flight):
    setup, record = flight
    rate = log_of(record, setup, flow=Sensor.FLOW_RATE)
    assert Sensor.FLOW_VELOCITY not in rate.streams
    flow, velocity = rate.streams[Sensor.FLOW_RATE], log_of(record, setup).streams[Sensor.FLOW_VELOCITY]
    seen = flow.quality > 0
    np.testing.assert_array_equal(flow.quality, velocity.quality)
    np.testing.assert_array_equal(flow.value[:, 2:], rate.streams[Sensor.IMU].value[:, :2])
    scaled_by = np.maximum(lens_range(setup, record), 0.3)
    forward = (flow.value[:, 1] - flow.value[:, 3]) * scaled_by
    right = -(flow.value[:, 0] - flow.value[:, 2]) * scaled_by
    np.testing.assert_allclose(np.column_stack([forward, right])[seen], velocity.value[seen, :2], atol=1e-12)
    assert (flow.value[~seen, :2] == 0.0).all()


def test_the_skid_switch_tells_when_the_vehicle_stands(flight):
    setup, record = flight
    landed = log_of(record, setup).streams[Sensor.LANDED]
    np.testing.assert_array_equal(landed.value[:, 0], record.tables["truth"]["on_ground"])
    assert landed.value[0, 0] == 0.0
    assert landed.value[-1, 0] == 1.0


def test_a_flight_without_imu_and_a_flow_that_is_none_are_refused(flight):
    setup, record = flight
    without = Record(record.manifest, {name: table for name, table in record.tables.items() if name != "imu"})
    with pytest.raises(ValueError, match="the flight has no IMU; fly it with the landing filter"):
        log_of(without, setup)
    with pytest.raises(ValueError, match="RANGE is no flow"):
        log_of(record, setup, flow=Sensor.RANGE)


def test_the_record_keeps_pad_fixes_through_its_file(flight, tmp_path: Path):
    _, record = flight
    record.save(tmp_path / "flight.fnr")
    again = Record.load(tmp_path / "flight.fnr").tables["pad"]
    assert {name: list(column) for name, column in again.items()} == {
        name: list(column) for name, column in record.tables["pad"].items()
    }
    assert set(again) == {"t_s", "tan_forward", "tan_right", "distance_m", "quality"}
