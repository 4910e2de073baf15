"""PX4 ULog files as logs: old topics and new, units, signs, frames, delays, choices between sensors, absences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.frames import quaternion_from_euler
from flownav.core.measurement import Sensor
from flownav.logs.csv_folder import read_csv_folder
from flownav.logs.log import Log
from flownav.logs.ulog import read_ulog
from replay_logs import log_of_flight
from ulog_files import UlogWriter, in_us, ulog_of_flight

LEVEL = (1.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def flown():
    return log_of_flight(20.0)


def times(hz: float, duration_s: float = 4.0) -> np.ndarray:
    return np.arange(round(hz * duration_s)) / hz


def alike(t_s: np.ndarray, *row: float) -> np.ndarray:
    return np.tile(row, (len(t_s), 1)) if len(row) > 1 else np.full(len(t_s), row[0])


def with_attitude(t_s=None, q=LEVEL) -> UlogWriter:
    """A log of a vehicle that keeps its attitude."""
    t_s = times(50) if t_s is None else t_s
    return UlogWriter().add("vehicle_attitude", t_s, float__q=alike(t_s, *q))


def new_flow(writer, t_s, flow, *, instance=0, name="vehicle_optical_flow", gyro=(0.0, 0.0, 0.0), dt_us=20000,
             quality=200, **more):  # fmt: skip
    return writer.add(
        name, t_s, instance, float__pixel_flow=alike(t_s, *flow), float__delta_angle=alike(t_s, *gyro),
        uint32_t__integration_timespan_us=alike(t_s, dt_us), uint8_t__quality=alike(t_s, quality), **more,
    )  # fmt: skip


def read(writer: UlogWriter, folder: Path, **options) -> Log:
    return read_ulog(writer.write(folder / "log.ulg"), **options)


def lacks(log: Log) -> str:
    return "; ".join(absence.what for absence in log.absences)


@pytest.mark.parametrize("old", [False, True])
def test_a_flight_says_the_same_in_topics_of_every_age_as_in_csv(flown, tmp_path, old):
    theirs = read_csv_folder(flown.write(tmp_path / "csv"))
    ours = read(ulog_of_flight(flown.tables, old=old), tmp_path)
    assert set(ours.streams) == set(theirs.streams)
    for sensor, stream in ours.streams.items():
        other = theirs.streams[sensor]
        np.testing.assert_allclose(stream.t_s, other.t_s, atol=1.1e-6, err_msg=sensor.name)
        coarse = 0.02 if sensor == Sensor.GPS_POSITION else 2e-5  # 1e-7 deg is a centimetre
        np.testing.assert_allclose(stream.value, other.value, rtol=2e-6, atol=coarse, err_msg=sensor.name)
        assert stream.rejected == {}
    assert ours.origin_deg_m == pytest.approx(theirs.origin_deg_m, abs=1e-3)
    assert ours.absences == ()
    assert list(ours.streams).index(Sensor.GPS_VELOCITY) < list(ours.streams).index(Sensor.GPS_POSITION)
    assert list(ours.inputs) == ["log.ulg"]
    assert len(ours.inputs["log.ulg"]) == 64


def test_an_attitude_that_says_nothing_gives_way_to_the_odometrys(tmp_path):
    t_s = times(30)
    columns = odometry(t_s, old=False, heading=0.2, velocity=(2.0, 0.0, 0.0), frame="NED")
    log = read(with_attitude(q=(0.0, 0.0, 0.0, 0.0)).add("vehicle_visual_odometry", t_s, **columns), tmp_path)
    assert len(log.streams[Sensor.ATTITUDE]) == len(t_s)
    assert "no vehicle_attitude" in lacks(log)
    poor = with_attitude()
    poor.topics[0].fields["float q"][:4] = [[2, 0, 0, 0], [np.nan, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0]]
    assert read(poor, tmp_path).streams[Sensor.ATTITUDE].rejected == {"not_finite": 1, "out_of_range": 2}


def test_a_parameter_that_is_no_number_is_not_believed(tmp_path):
    writer = local_position(with_attitude(), times(10))
    writer.parameters["SYS_MC_EST_GROUP"] = float("nan")
    assert read(writer, tmp_path).autopilot_name == "PX4 EKF2"


# -- flow --------------------------------------------------------------------------------------------------
def test_flow_is_what_was_accumulated_over_the_time_it_took(tmp_path):
    """2 m/s forward and 1 m/s to the right at 4 m, rolling by 0.3 rad/s: flow_x = 0.3 - 1/4, flow_y = 2/4."""
    t_s = times(50)
    writer = with_attitude()
    new_flow(writer, t_s, (0.02 * 0.05, 0.02 * 0.5), gyro=(0.02 * 0.3, 0.0, 0.0),
             uint64_t__timestamp_sample=in_us(t_s - 0.006))  # fmt: skip
    stream = read(writer, tmp_path).streams[Sensor.FLOW_RATE]
    np.testing.assert_allclose(stream.value, alike(t_s, 0.05, 0.5, 0.3, 0.0), atol=1e-6)
    assert set(stream.quality) == {200.0}
    assert stream.delay_s == pytest.approx(0.006 + 0.010, abs=1e-5)


def test_flow_without_an_integration_time_is_no_data_or_counted(tmp_path):
    t_s = times(50)
    quality, dt_us = alike(t_s, 200), alike(t_s, 20000)
    quality[:10], dt_us[:15] = 0, 0
    flow = alike(t_s, 0.01, 0.02)
    flow[20] = np.nan
    flow[21] = 5.0
    writer = with_attitude().add(
        "vehicle_optical_flow", t_s, float__pixel_flow=flow, float__delta_angle=alike(t_s, 0.0, 0.0, 0.0),
        uint32_t__integration_timespan_us=dt_us, uint8_t__quality=quality,
    )  # fmt: skip
    stream = read(writer, tmp_path).streams[Sensor.FLOW_RATE]
    assert stream.rejected == {"no_integration_time": 5, "not_finite": 1, "out_of_range": 1}
    assert np.all(stream.value[:10, :2] == 0.0)
    assert np.all(stream.quality[:10] == 0.0)
    np.testing.assert_allclose(stream.value[10:, :2], alike(stream.t_s[10:], 0.5, 1.0), atol=1e-6)


@pytest.mark.parametrize("how", ["nan", "unavailable"])
def test_a_flow_sensor_without_gyro_has_none_and_says_so(tmp_path, how):
    gyro = (np.nan, np.nan, 0.0) if how == "nan" else (0.0, 0.0, 0.0)
    t_s = times(50)
    more = {} if how == "nan" else {"bool__delta_angle_available": alike(t_s, 0)}
    log = read(new_flow(with_attitude(), t_s, (0.01, 0.0), gyro=gyro, **more), tmp_path)
    assert np.isnan(log.streams[Sensor.FLOW_RATE].value[:, 2:]).all()
    assert "no gyro in the flow sensor" in lacks(log)


def test_only_the_sensors_own_axes_are_turned_by_its_mounting(tmp_path):
    """Mounted at 90 deg, the sensor's x lies along body y: a pitch rate (about y) is seen about its x."""
    t_s = times(50)
    for name, seen in (("sensor_optical_flow", (0.02 * 0.7, 0.0)), ("vehicle_optical_flow", (0.0, 0.02 * 0.7))):
        writer = new_flow(with_attitude(), t_s, seen, name=name, gyro=(*seen, 0.0))
        writer.parameters["SENS_FLOW_ROT"] = 2
        value = read(writer, tmp_path).streams[Sensor.FLOW_RATE].value
        np.testing.assert_allclose(value, alike(t_s, 0.0, 0.7, 0.0, 0.7), atol=1e-6)


def test_of_several_flow_sensors_the_one_that_saw_most_is_read_unless_asked(tmp_path):
    writer = new_flow(with_attitude(), times(50), (0.02 * 0.1, 0.0), quality=60)
    new_flow(writer, times(40), (0.02 * 0.2, 0.0), instance=1, quality=250)
    flow = {None: 0.2, 0: 0.1, 1: 0.2}
    for instance, rate in flow.items():
        log = read(writer, tmp_path, flow_instance=instance)
        assert log.streams[Sensor.FLOW_RATE].value[0, 0] == pytest.approx(rate)
    assert (
        "flow is vehicle_optical_flow[1]; not used: vehicle_optical_flow[0] (200 readings)"
        in read(writer, tmp_path).notes
    )
    with pytest.raises(InputError, match=r"flow_instance 7 is not in the log; it has vehicle_optical_flow\[0\], "):
        read(writer, tmp_path, flow_instance=7)
    with pytest.raises(InputError, match="flow_instance 0 is not in the log; it has no optical flow at all"):
        read(with_attitude(), tmp_path, flow_instance=0)


def test_the_vehicles_flow_is_preferred_to_the_raw_sensor_where_it_saw_enough(tmp_path):
    writer = new_flow(with_attitude(), times(70), (0.002, 0.0), name="sensor_optical_flow")
    new_flow(writer, times(50), (0.004, 0.0), dt_us=20000)
    assert read(writer, tmp_path).streams[Sensor.FLOW_RATE].value[0, 0] == pytest.approx(0.2)
    writer = new_flow(with_attitude(), times(70), (0.002, 0.0), name="sensor_optical_flow")
    new_flow(writer, times(2), (0.004, 0.0), dt_us=20000)
    assert read(writer, tmp_path).streams[Sensor.FLOW_RATE].value[0, 0] == pytest.approx(0.1)


# -- range -------------------------------------------------------------------------------------------------
def distance(writer, t_s, metres, *, instance=0, orientation=25, low=0.1, high=10.0, **more):
    return writer.add(
        "distance_sensor", t_s, instance, float__current_distance=alike(t_s, metres) if np.isscalar(metres) else metres,
        float__min_distance=alike(t_s, low), float__max_distance=alike(t_s, high),
        uint8_t__orientation=alike(t_s, orientation), **more,
    )  # fmt: skip


def test_range_is_the_fullest_rangefinder_that_looks_down(tmp_path):
    writer = distance(with_attitude(), times(50), 1.0, orientation=0, float__variance=alike(times(50), 0.0))
    distance(writer, times(20), 2.0, instance=1, low=0.2, high=8.0, float__variance=alike(times(20), 0.04))
    distance(writer, times(10), 3.0, instance=2, low=0.0, high=0.0, float__variance=alike(times(10), 0.0))
    log = read(writer, tmp_path)
    stream = log.streams[Sensor.RANGE]
    assert set(stream.value[:, 0]) == {2.0}
    np.testing.assert_allclose(stream.variance, 0.04, rtol=1e-6)
    assert log.limits["range_m"] == pytest.approx((0.2, 8.0))
    assert "distance_sensor[0]: no usable row (200 not_downward)" in log.notes


def test_stated_limits_of_zero_are_no_statement(tmp_path):
    log = read(distance(with_attitude(), times(20), 3.0, low=0.0, high=0.0), tmp_path)
    assert "range_m" not in log.limits
    assert np.isnan(log.streams[Sensor.RANGE].variance).all()


def test_what_the_flow_sensor_states_of_itself(tmp_path):
    t_s = times(50)
    stated = {"max_flow_rate": 7.4, "min_ground_distance": 0.08, "max_ground_distance": 30.0}
    log = read(
        new_flow(with_attitude(), t_s, (0.0, 0.01), **{f"float__{k}": alike(t_s, v) for k, v in stated.items()}),
        tmp_path,
    )
    assert log.limits == {"flow_rad_s": (0.0, pytest.approx(7.4)), "flow_height_m": pytest.approx((0.08, 30.0))}


@pytest.mark.parametrize(("quality", "kept"), [((0, 90), 40), ((0, -1), 80), ((-1, -1), 80)])
def test_signal_quality_zero_is_invalid_only_of_a_sensor_that_states_one(tmp_path, quality, kept):
    t_s = times(20)
    signal = np.where(np.arange(len(t_s)) % 2, quality[0], quality[1])
    stream = read(distance(with_attitude(), t_s, 2.0, int8_t__signal_quality=signal), tmp_path).streams[Sensor.RANGE]
    assert len(stream) == kept
    assert stream.rejected == ({"invalid": 40} if kept == 40 else {})


def test_ranges_that_cannot_be_are_counted(tmp_path):
    metres = alike(times(20), 2.0)
    metres[:3], metres[3], metres[4] = 0.0, np.nan, 1e9
    stream = read(distance(with_attitude(), times(20), metres), tmp_path).streams[Sensor.RANGE]
    assert stream.rejected == {"not_finite": 1, "out_of_range": 4}


def test_without_a_rangefinder_the_flow_sensors_own_distance_serves(tmp_path):
    t_s = times(50)
    metres = alike(t_s, 1.5)
    metres[::2] = -1.0
    metres[1], metres[3], metres[5] = 2e36, np.inf, np.nan
    log = read(new_flow(with_attitude(), t_s, (0.0, 0.01), float__distance_m=metres), tmp_path)
    assert len(log.streams[Sensor.RANGE]) == 97
    assert set(log.streams[Sensor.RANGE].value[:, 0]) == {1.5}
    assert "no range" in lacks(read(new_flow(with_attitude(), t_s, (0.0, 0.01)), tmp_path))


# -- GPS ---------------------------------------------------------------------------------------------------
def test_gps_accuracies_are_variances_and_poor_fixes_are_counted(flown, tmp_path):
    writer = ulog_of_flight(flown.tables)
    fields = next(topic for topic in writer.topics if topic.name == "sensor_gps").fields
    fields["uint8_t fix_type"][:7] = 2
    fields["float eph"][20] = 0.0
    fields["bool vel_ned_valid"] = fields["bool vel_ned_valid"].copy()
    fields["bool vel_ned_valid"][30] = False
    fields["double latitude_deg"][40] = 0.0
    fields["double latitude_deg"][41] = np.nan
    log = read(writer, tmp_path)
    position, velocity = log.streams[Sensor.GPS_POSITION], log.streams[Sensor.GPS_VELOCITY]
    assert position.rejected == velocity.rejected == {"no_fix": 7, "out_of_range": 1, "not_finite": 1}
    np.testing.assert_allclose(position.variance[0], [0.64, 0.64, 2.25], rtol=1e-5)
    np.testing.assert_allclose(velocity.variance[0], [0.09, 0.09, 0.09], rtol=1e-5)
    assert np.isnan(position.variance[13, :2]).all()
    assert np.flatnonzero(np.isnan(velocity.value[:, 0])).tolist() == [23]


def test_gps_without_a_fix_is_an_absence_and_counted(tmp_path):
    t_s = times(5)
    log = read(with_attitude().add("vehicle_gps_position", t_s, int32_t__lat=alike(t_s, 1), int32_t__lon=alike(t_s, 1),
                                   int32_t__alt=alike(t_s, 1), uint8_t__fix_type=alike(t_s, 1)), tmp_path)  # fmt: skip
    assert Sensor.GPS_POSITION not in log.streams
    assert log.origin_deg_m is None
    assert "no GPS fix" in lacks(log)
    assert "vehicle_gps_position[0]: no usable row (20 no_fix)" in log.notes


# -- inertial ----------------------------------------------------------------------------------------------
def test_the_fastest_inertial_source_is_read(tmp_path):
    slow, fast, faster = times(30), times(100), times(200)
    writer = with_attitude().add("sensor_combined", slow, float__gyro_rad=alike(slow, 9, 9, 9),
                                 float__accelerometer_m_s2=alike(slow, 9, 9, 9))  # fmt: skip
    writer.add("vehicle_angular_velocity", fast, float__xyz=alike(fast, 0.1, 0.2, 0.3))
    force = np.column_stack([np.arange(len(faster)) / 200.0, 0.0 * faster, 0.0 * faster - 9.8])
    writer.add("vehicle_acceleration", faster, float__xyz=force)
    stream = read(writer, tmp_path).streams[Sensor.IMU]
    assert len(stream) == len(fast)
    np.testing.assert_allclose(stream.value[:, :3], alike(fast, 0.1, 0.2, 0.3), atol=1e-6)
    np.testing.assert_allclose(stream.value[:, 3], fast, atol=1e-5)


def test_an_imu_at_two_hertz_is_left_out_and_said(tmp_path):
    t_s = times(2, 20.0)
    writer = with_attitude(times(50, 20.0)).add(
        "vehicle_imu", t_s, float__delta_angle=alike(t_s, 0, 0, 0), float__delta_velocity=alike(t_s, 0, 0, -0.04),
        uint32_t__delta_angle_dt=alike(t_s, 4000), uint32_t__delta_velocity_dt=alike(t_s, 4000),
    )  # fmt: skip
    log = read(writer, tmp_path)
    assert Sensor.IMU not in log.streams
    assert "inertial readings at 2 Hz only (vehicle_imu[0], 40 readings, left out)" in lacks(log)


def test_barometer_and_magnetometer_of_an_old_sensor_combined_have_their_own_times(tmp_path):
    t_s = times(100)
    held = np.floor(t_s * 10) / 10  # the barometer is read ten times a second
    relative = np.round(1e6 * (held - t_s))
    relative[0] = 0x7FFFFFFF
    writer = with_attitude().add(
        "sensor_combined", t_s, float__gyro_rad=alike(t_s, 0, 0, 0), float__accelerometer_m_s2=alike(t_s, 0, 0, -9.8),
        float__baro_alt_meter=100 + held, int32_t__baro_timestamp_relative=relative,
        float__magnetometer_ga=alike(t_s, 0.2, 0.0, 0.4), int32_t__magnetometer_timestamp_relative=alike(t_s, 0),
    )  # fmt: skip
    log = read(writer, tmp_path)
    baro = log.streams[Sensor.BARO]
    assert len(baro) == 40
    np.testing.assert_allclose(baro.value[:, 0] - 100, baro.t_s, atol=1e-4)
    assert len(log.streams[Sensor.MAG]) == len(t_s)


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_pressure_becomes_height_whether_in_pascal_or_hectopascal(tmp_path, unit):
    t_s = times(10)
    pressure = alike(t_s, 89874.6 / (100.0 / unit))  # the standard atmosphere at 1000 m
    log = read(with_attitude().add("sensor_baro", t_s, float__pressure=pressure), tmp_path)
    assert log.streams[Sensor.BARO].value[0, 0] == pytest.approx(1000.0, abs=2.0)


# -- clock -------------------------------------------------------------------------------------------------
def test_time_starts_at_the_first_reading_and_states_of_before_hold_from_there(tmp_path):
    writer = with_attitude(times(50) + 3.0).add("vehicle_land_detected", [-4.0, 4.5], bool__landed=[True, False])
    log = read(writer, tmp_path)
    assert log.span_s == (0.0, pytest.approx(3.98, abs=1e-6))
    assert log.streams[Sensor.LANDED].t_s.tolist() == pytest.approx([0.0, 1.5])
    assert log.streams[Sensor.LANDED].value[:, 0].tolist() == [1.0, 0.0]


def test_a_clock_that_runs_back_stops_or_jumps_is_counted(tmp_path):
    t_s = times(50)
    stamps = np.concatenate([t_s[:100], [t_s[50]], t_s[100:], [t_s[-1]], [5e5], [-5.0]])
    heights = np.concatenate([t_s[:100], [7.0], t_s[100:], [t_s[-1]], [7.0], [7.0]])
    writer = with_attitude().add("vehicle_air_data", stamps, float__baro_alt_meter=heights)
    stream = read_ulog(writer.write(tmp_path / "clock.ulg", in_order=False)).streams[Sensor.BARO]
    assert stream.rejected == {"out_of_order": 1, "duplicate": 1, "clock_jump": 1, "no_time": 1}
    np.testing.assert_allclose(stream.t_s, t_s, atol=1e-6)


# -- references --------------------------------------------------------------------------------------------
def odometry(t_s, *, old: bool, heading: float, velocity, frame="FRD", velocity_frame="body"):
    """A vehicle that flies a line along x of the odometry's frame."""
    position = np.column_stack([2.0 * t_s, 0.0 * t_s, 0.0 * t_s - 1.0])
    q = alike(t_s, *quaternion_from_euler(0.0, 0.0, heading))
    numbers = {"NED": 0, "FRD": 1, "body": 3} if old else {"NED": 1, "FRD": 2, "body": 3}
    if old:
        columns = {f"float__{name}": position[:, k] for k, name in enumerate("xyz")}
        columns |= {f"float__v{name}": alike(t_s, velocity[k]) for k, name in enumerate("xyz")}
        covariance = np.full((len(t_s), 21), np.nan)
        covariance[:, [0, 6, 11]] = 0.01, 0.04, 0.09
        columns |= {"uint8_t__local_frame": alike(t_s, numbers[frame]), "float__pose_covariance": covariance}
    else:
        columns = {"float__position": position, "float__velocity": alike(t_s, *velocity),
                   "uint8_t__pose_frame": alike(t_s, numbers[frame]),
                   "float__position_variance": alike(t_s, 0.01, 0.04, 0.09)}  # fmt: skip
    return columns | {"float__q": q, "uint8_t__velocity_frame": alike(t_s, numbers[velocity_frame])}


@pytest.mark.parametrize("old", [True, False])
@pytest.mark.parametrize(("velocity_frame", "velocity"), [("body", (0.0, -2.0, 0.1)), ("FRD", (2.0, 0.0, 0.1))])
def test_visual_odometry_is_the_reference_of_a_flow_log(tmp_path, old, velocity_frame, velocity):
    """Heading east of its frame's x, it flies to its own left."""
    t_s = times(30)
    writer = new_flow(UlogWriter(), times(50), (0.0, 0.01))
    columns = odometry(t_s, old=old, heading=np.pi / 2, velocity=velocity, velocity_frame=velocity_frame)
    writer.add("vehicle_visual_odometry", t_s, **columns)
    log = read(writer, tmp_path)
    assert log.truth is not None
    np.testing.assert_allclose(log.truth["pos_n_m"], 2.0 * t_s, atol=1e-6)
    np.testing.assert_allclose(log.truth["vel_u_m_s"], 0.0, atol=1e-6)
    np.testing.assert_allclose(log.truth["vel_v_m_s"], -2.0, atol=1e-6)
    np.testing.assert_allclose(log.truth["vel_w_m_s"], 0.1, atol=1e-6)
    assert Sensor.POSE not in log.streams
    assert any("visual odometry" in note and "not the truth" in note for note in log.notes)
    assert len(log.streams[Sensor.ATTITUDE]) == len(t_s)
    assert "no vehicle_attitude" in lacks(log)


@pytest.mark.parametrize("old", [True, False])
@pytest.mark.parametrize(("frame", "turn"), [("FRD", 0.7), ("NED", 0.0)])
def test_without_flow_or_gps_it_is_a_position_turned_to_north(tmp_path, old, frame, turn):
    t_s = times(30)
    columns = odometry(t_s, old=old, heading=0.2, velocity=(2.0, 0.0, 0.0), frame=frame)
    q = quaternion_from_euler(0.0, 0.0, 0.9)
    log = read(with_attitude(q=q).add("vehicle_visual_odometry", t_s, **columns), tmp_path)
    pose = log.streams[Sensor.POSE]
    along = 2.0 * t_s
    expected = np.column_stack([np.cos(turn) * along, np.sin(turn) * along, alike(t_s, -1.0)])
    np.testing.assert_allclose(pose.value, expected, atol=1e-5)
    np.testing.assert_allclose(pose.variance[0], [0.01, 0.04, 0.09], rtol=1e-5)
    assert log.truth is None


def test_odometry_whose_heading_nothing_tells_is_left_out(tmp_path):
    t_s = times(30)
    columns = odometry(t_s, old=False, heading=0.2, velocity=(2.0, 0.0, 0.0))
    columns["float__q"] = alike(t_s, np.nan, 0, 0, 0)
    log = read(with_attitude().add("vehicle_visual_odometry", t_s, **columns), tmp_path)
    assert Sensor.POSE not in log.streams
    assert any("is left out: how its frame lies to north is unknown" in note for note in log.notes)


def local_position(writer, t_s, name="vehicle_local_position", **more):
    values = {"x": 3.0 * t_s, "y": 0.0 * t_s, "z": 0.0 * t_s - 2, "vx": alike(t_s, 3), "vy": alike(t_s, 0),
              "vz": alike(t_s, 0)}  # fmt: skip
    return writer.add(name, t_s, **{f"float__{key}": value for key, value in values.items()}, **more)


def test_the_autopilots_estimate_has_body_velocity_at_the_instants_it_describes(tmp_path):
    t_s = times(10)
    valid = np.arange(len(t_s)) >= 5
    q = quaternion_from_euler(0.0, 0.0, np.pi / 2)
    writer = local_position(with_attitude(q=q), t_s, bool__xy_valid=valid,
                            uint64_t__timestamp_sample=in_us(np.maximum(t_s - 0.02, 0)))  # fmt: skip
    log = read(writer, tmp_path)
    assert log.autopilot is not None
    assert log.autopilot_name == "PX4 EKF2"
    np.testing.assert_allclose(log.autopilot["t_s"], t_s[5:] - 0.02, atol=2e-6)
    np.testing.assert_allclose(log.autopilot["vel_u_m_s"], 0.0, atol=1e-6)
    np.testing.assert_allclose(log.autopilot["vel_v_m_s"], -3.0, atol=1e-6)
    assert "the autopilot marks 5 of its 40 estimates as invalid" in log.notes
    writer.parameters["SYS_MC_EST_GROUP"] = 1
    assert read(writer, tmp_path).autopilot_name == "PX4 LPE"


def test_the_autopilots_heading_is_its_own_where_the_attitude_is_not(tmp_path):
    t_s = times(30)
    columns = odometry(t_s, old=True, heading=0.4, velocity=(2.0, 0.0, 0.0))
    writer = new_flow(UlogWriter(), times(50), (0.0, 0.01)).add("vehicle_visual_odometry", t_s, **columns)
    log = read(local_position(writer, t_s, float__heading=alike(t_s, np.pi / 2)), tmp_path)
    np.testing.assert_allclose(log.autopilot["vel_v_m_s"], -3.0, atol=1e-5)


def test_a_simulators_ground_truth_goes_before_odometry(tmp_path):
    t_s = times(20)
    columns = odometry(t_s, old=False, heading=0.0, velocity=(2.0, 0.0, 0.0), frame="NED")
    writer = new_flow(with_attitude(), times(50), (0.0, 0.01)).add("vehicle_visual_odometry", t_s, **columns)
    local_position(writer, t_s, "vehicle_local_position_groundtruth")
    writer.add("vehicle_attitude_groundtruth", t_s, float__q=alike(t_s, *quaternion_from_euler(0.0, 0.0, np.pi)))
    log = read(writer, tmp_path)
    np.testing.assert_allclose(log.truth["pos_n_m"], 3.0 * t_s, atol=1e-5)
    np.testing.assert_allclose(log.truth["vel_u_m_s"], -3.0, atol=1e-5)
    np.testing.assert_allclose(log.streams[Sensor.POSE].value[:, 0], 2.0 * t_s, atol=1e-5)


# -- the pad -----------------------------------------------------------------------------------------------
def test_an_irlock_is_turned_into_body_axes(tmp_path):
    """PX4's default mounting turns the camera by 90 deg: its x looks to the right, its y backwards."""
    t_s = times(20)
    writer = with_attitude().add("irlock_report", t_s, float__pos_x=alike(t_s, 0.1), float__pos_y=alike(t_s, 0.3))
    pad = read(writer, tmp_path).streams[Sensor.PAD].value
    np.testing.assert_allclose(pad[:, :2], alike(t_s, -0.3, 0.1), atol=1e-6)
    assert np.isnan(pad[:, 2]).all()
    writer.parameters["LTEST_SENS_ROT"] = 0
    np.testing.assert_allclose(read(writer, tmp_path).streams[Sensor.PAD].value[0, :2], [0.1, 0.3], atol=1e-6)


def test_the_landing_target_is_seen_from_the_body(tmp_path):
    """3 m down, 1 m east of a vehicle that heads east: straight ahead."""
    t_s = times(20)
    writer = with_attitude(q=quaternion_from_euler(0.0, 0.0, np.pi / 2)).add(
        "landing_target_pose", t_s, float__x_rel=alike(t_s, 0), float__y_rel=alike(t_s, 1), float__z_rel=alike(t_s, 3),
        bool__rel_pos_valid=np.arange(len(t_s)) > 9,
    )  # fmt: skip
    stream = read(writer, tmp_path).streams[Sensor.PAD]
    assert stream.rejected == {"invalid": 10}
    np.testing.assert_allclose(stream.value, alike(stream.t_s, 1 / 3, 0.0, np.sqrt(10.0)), atol=1e-6)


# -- real logs ---------------------------------------------------------------------------------------------
def test_two_flow_sensors_without_gyro_beside_visual_odometry(data_folder):
    path = data_folder / "px4-voxl-indoor" / "voxl_two_flow_sensors.ulg"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    log = read_ulog(path)
    assert len(log.streams[Sensor.FLOW_RATE]) == 17666
    assert len(read_ulog(path, flow_instance=1).streams[Sensor.FLOW_RATE]) == 14438
    assert {"no gyro in the flow sensor", "no vehicle_attitude", "no GPS fix"} <= {a.what for a in log.absences}
    assert log.limits["range_m"] == pytest.approx((0.3, 200.0))
    flow, distance_m, truth = log.streams[Sensor.FLOW_RATE], log.streams[Sensor.RANGE], log.truth
    flying = (flow.t_s > 215) & (flow.t_s < 300)
    t_s = flow.t_s[flying] - flow.delay_s
    height = np.interp(t_s, distance_m.t_s, distance_m.value[:, 0])
    smooth = np.ones(31) / 31  # half a second: the rotation averages out
    seen = (flow.value[flying, 1] * height, -flow.value[flying, 0] * height)
    for ours, name in zip(seen, ("vel_u_m_s", "vel_v_m_s"), strict=True):
        odometry_velocity = np.interp(t_s, truth["t_s"], truth[name])
        ours, theirs = (np.convolve(v, smooth, "valid") for v in (ours, odometry_velocity))
        assert np.corrcoef(ours, theirs)[0, 1] > 0.8


@pytest.mark.parametrize(("name", "count"), [("sample_log_small.ulg", 1298), ("sample_appended_multiple.ulg", 306)])
def test_sample_logs_of_pyulog(data_folder, name, count):
    path = data_folder / "ulog" / name
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    log = read_ulog(path)
    assert len(log.streams[Sensor.ATTITUDE]) == count
    assert min(stream.t_s[0] for stream in log.streams.values()) == 0.0
    assert "no optical flow" in lacks(log)
