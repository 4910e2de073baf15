"""Simulated sensors on a path: the log's instants and kinds, the shipped equations, drawn by seed and flight."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.replay_logs import log_of_flight

from flownav.core.measurement import Sensor
from flownav.logs.csv_folder import read_csv_folder
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.sensors import flow, inertial
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.inertial import ImuReading
from flownav.sensors.settings import FlowSettings
from flownav.sensors.sheets import InertialSheet
from flownav.studies.validation.drawn import Flight, drawn_sheets, kept_of, load_flights, sheets_of
from flownav.studies.validation.path import path_of
from flownav.studies.validation.sensed import every_nth, field_of, seen_velocity, simulated_log, step_of, stepped

VEHICLE = load_flights().vehicle


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    made = log_of_flight(60.0, flow_hz=10.0, range_hz=10.0, sensor_gyro=False)
    return read_csv_folder(made.write(tmp_path_factory.mktemp("sensed") / "made"))


@pytest.fixture(scope="module")
def path(log):
    return path_of(replay(log, ReplayOptions(), NavigatorSettingsFile(), smoothed=True), VEHICLE)


@pytest.fixture(scope="module")
def simulated(log, path):
    return simulated_log(log, path, Flight(1, 0), VEHICLE)


def test_streams_have_the_logs_kinds_and_instants(log, simulated):
    assert list(simulated.streams) == list(log.streams)
    for sensor, stream in simulated.streams.items():
        assert np.isin(stream.t_s, log.streams[sensor].t_s).all()
        assert len(stream) > 0.8 * len(log.streams[sensor])
    assert np.isnan(simulated.streams[Sensor.FLOW_RATE].value[:, 2:]).all()  # the log's flow has no gyro
    assert simulated.truth is None
    assert "flight 0" in simulated.notes[-1]


def test_every_sensor_reads_the_path_with_an_error(log, simulated):
    """Differences from the log, which has no error, are there and no larger than sensors of this class have."""
    for sensor, least, most in (
        (Sensor.GPS_POSITION, 0.05, 12.0), (Sensor.GPS_VELOCITY, 0.01, 1.0), (Sensor.IMU, 0.005, 2.0),
        (Sensor.BARO, 0.02, 15.0), (Sensor.MAG, 0.001, 0.1), (Sensor.RANGE, 0.001, 0.3),
    ):  # fmt: skip
        recorded, again = log.streams[sensor], simulated.streams[sensor]
        same = np.isin(recorded.t_s, again.t_s) & (recorded.t_s > 8.0)
        off = np.abs(again.value[again.t_s > 8.0] - recorded.value[same])
        assert least < np.median(off.max(axis=1)) < most, sensor.name


def test_a_flight_is_a_function_of_seed_and_number(log, path, simulated):
    again, other = (simulated_log(log, path, Flight(1, number), VEHICLE) for number in (0, 1))
    for sensor, stream in simulated.streams.items():
        assert np.array_equal(again.streams[sensor].value, stream.value, equal_nan=True)
    first, second = simulated.streams[Sensor.GPS_POSITION].value, other.streams[Sensor.GPS_POSITION].value
    assert not np.array_equal(first, second)


def test_normals_are_normal_and_of_their_name():
    one, two = Flight(3, 4).normals("one", 4000, 3), Flight(3, 4).normals("two", 4000, 3)
    assert abs(one.mean()) < 0.05
    assert one.std() == pytest.approx(1.0, abs=0.03)
    assert abs(np.corrcoef(one[:, 0], two[:, 0])[0, 1]) < 0.06
    assert np.array_equal(one[:100], Flight(3, 4).normals("one", 100, 3))


def test_sheets_follow_the_log(log):
    sheets = sheets_of(log, VEHICLE)
    assert sheets.range_sensor.name.startswith("single-beam lidar")  # the made range stands at 0.2 m
    assert sheets.flow_camera.rate_hz == pytest.approx(10.0)
    assert sheets.inertial.rate_hz == pytest.approx(100.0)
    assert kept_of(log.streams[Sensor.IMU]) == 2
    drawn = [drawn_sheets(sheets, Flight(1, number)).gps_receiver.position.slow_sigma_m for number in (0, 0, 1)]
    assert drawn[0] == drawn[1] != drawn[2]


def test_a_sonar_serves_where_nothing_nearer_than_its_floor_is_logged(log):
    far = log.streams[Sensor.RANGE]
    raised = type(far).of(Sensor.RANGE, far.t_s, far.value + 0.2)
    streams = log.streams | {Sensor.RANGE: raised}
    sheets = sheets_of(type(log)(log.path, streams, log.origin_deg_m), VEHICLE)
    assert sheets.range_sensor.name.startswith("HRLV-MaxSonar")


def test_the_lag_is_that_of_the_flying_sensor(path):
    """The filter form of the identified dynamics against the equation that the simulator steps, 4 ms at a time."""
    dynamics = FlowSettings(shake=False).parameters(load_sensor())._replace(sonar_floor_m=0.0)
    grid_s = np.arange(path.span_s[0], 20.0, flow.PERIOD_S)
    state, seen = flow.start_flow(0.0, 0.0, 0.0, 0.0, dynamics), []
    for u, v, w in path.body_velocity_m_s(grid_s).tolist():
        seen.append((dynamics.gain * state.u1, dynamics.gain * state.v1, dynamics.gain * state.w1))
        state = flow.step_flow(state, u, v, w, 2.0, 0.0, dynamics)
    assert seen_velocity(path, dynamics, grid_s[500:]) == pytest.approx(np.array(seen)[500:], abs=1e-9)


def test_one_reading_of_three_is_three_steps_on():
    p = InertialSheet.read().parameters(600.0, 2.0)._replace(gyro_sigma_rad_s=0.0, accel_sigma_m_s2=0.0)
    quiet, truth = inertial.InertialNormals(*[0.0] * 12), ImuReading(0.1, 0.2, 0.3, 1.0, 2.0, -9.8)
    unit = inertial.InertialUnit(*[0.0] * 27, 1.0, 0.0)
    begun = inertial.start_inertial(inertial.InertialStartNormals(*[0.3] * 10), p)
    state = begun
    for _ in range(3):
        state, third = inertial.step_inertial(state, unit, truth, quiet, p)
    _, at_once = inertial.step_inertial(begun, unit, truth, quiet, every_nth(p, 3))
    assert tuple(at_once) == pytest.approx(tuple(third), abs=1e-12)
    assert every_nth(p, 4).gyro_walk_rad_s == pytest.approx(2.0 * p.gyro_walk_rad_s)


def test_positions_come_in_the_steps_of_the_recording():
    recorded = np.column_stack([0.88 * np.arange(-5, 6), np.linspace(0.0, 1.0, 11) * 0.13, np.zeros(11)])
    assert step_of(recorded[:, 0]) == pytest.approx(0.88)
    found = stepped(np.array([[1.0, 0.034, 5.4321]]), recorded)
    assert found == pytest.approx(np.array([[0.88, 0.034, 5.4321]]))


def test_the_field_is_that_of_the_logs_compass(log):
    assert field_of(log).strength_gauss == pytest.approx(np.hypot(0.21, 0.43), rel=1e-3)
    assert field_of(log).inclination_deg == pytest.approx(np.degrees(np.arctan2(0.43, 0.21)), abs=0.1)
    bare = type(log)(log.path, {}, log.origin_deg_m)
    assert field_of(bare).declination_deg == pytest.approx(3.5, abs=0.5)
