"""A .tlog as a Log: synthetic flights, damage of every kind, and the simulator's real one."""

from __future__ import annotations

import math
import random
import struct
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.logs.log import INSTEAD, attitude_rates
from flownav.logs.mavlink.framing import coder
from flownav.logs.mavlink.signing import sign_outgoing
from flownav.logs.mavlink_log import WANTED, read_tlog
from flownav.logs.open_log import open_flight
from flownav.logs.plausible import check_plausible
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from mavlink_logs import PX4, START_US, Tlog, arbitrary_payload, flight_log, made, packed_payload

STEPS = 80


@pytest.fixture
def path(tmp_path):
    return tmp_path / "flight.tlog"


def complaint(path, **options) -> str:
    with pytest.raises(InputError) as caught:
        read_tlog(path, **options)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return str(caught.value)


def notes(log) -> str:
    return " | ".join(log.notes)


# -- a whole flight ----------------------------------------------------------------------------------------
def test_a_flight(path):
    log = read_tlog(flight_log().write(path))
    counts = {sensor: len(stream) for sensor, stream in log.streams.items()}
    assert counts == {
        Sensor.ATTITUDE: STEPS, Sensor.IMU: STEPS, Sensor.FLOW_RATE: STEPS, Sensor.RANGE: STEPS,
        Sensor.GPS_POSITION: 20, Sensor.GPS_VELOCITY: 20, Sensor.LANDED: 20,
    }  # fmt: skip
    assert all(stream.rejected == {} for stream in log.streams.values())
    expected_t = 20.0 + 0.05 * np.arange(STEPS)
    flow = log.streams[Sensor.FLOW_RATE]
    assert flow.t_s == pytest.approx(expected_t)
    assert flow.value[:, 2] == pytest.approx(0.05 * np.cos(0.05 * np.arange(STEPS)), abs=1e-7)
    assert log.streams[Sensor.RANGE].value == pytest.approx(2.0)
    assert log.streams[Sensor.GPS_POSITION].value[0] == pytest.approx((3.0, 4.0, -2.0), abs=0.02)
    assert log.origin_deg_m == (47.0, 8.5, 400.0)
    assert (log.autopilot_name, log.limits) == ("ArduPilot", {"range_m": (0.1, 40.0)})
    assert [absence.what for absence in log.absences] == ["no barometer (SCALED_PRESSURE, HIGHRES_IMU)"]
    assert log.notes == ()
    assert len(log.inputs["flight.tlog"]) == 64


def test_the_autopilots_estimate_and_the_truth(path):
    log = read_tlog(flight_log().write(path))
    assert log.autopilot["t_s"] == pytest.approx(20.0 + 0.05 * np.arange(STEPS))
    assert log.autopilot["pos_e_m"] == pytest.approx(4.0)
    assert log.autopilot["vel_u_m_s"] == pytest.approx(0.1 * math.cos(0.5), abs=1e-4)  # north, at a yaw of 0.5 rad
    assert log.truth["pos_d_m"] == pytest.approx(-2.0, abs=1e-3)
    assert log.truth["vel_u_m_s"] == pytest.approx(0.1)
    assert log.truth["t_s"] == pytest.approx(20.0 + 0.05 * np.arange(STEPS))


def test_without_a_local_position_the_global_one_serves(path):
    log = flight_log()
    log.frames = [f for f in log.frames if f[1][7] not in (32, 49)]  # LOCAL_POSITION_NED, GPS_GLOBAL_ORIGIN
    for step in range(5):
        log.add(1.0 + step, made("GLOBAL_POSITION_INT", time_boot_ms=21000 + 1000 * step, lat=470000270, lon=85000526,
                                 alt=403000, vx=100))  # fmt: skip
    found = read_tlog(log.write(path))
    assert found.origin_deg_m == pytest.approx((47.000027, 8.5000526, 402.0))  # the first fix
    assert found.autopilot["pos_d_m"] == pytest.approx(-1.0)
    assert found.autopilot["pos_n_m"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("global_too", [False, True])
def test_an_origin_that_moves_is_told_by_the_global_position_and_a_reset_is_the_autopilots_own(path, global_too):
    log = flight_log()
    log.frames = [f for f in log.frames if f[1][7] != 32]  # LOCAL_POSITION_NED
    for step in range(STEPS):
        boot_ms, late = 20000 + 50 * step, step >= STEPS // 2
        arrival_s, east_m = 0.05 * step + 0.02, 0.2 * step
        local = {"x": 3.0 - 30.0 * late, "y": 4.0 + east_m, "z": -2.0 + 5.0 * late}
        log.add(arrival_s, made("LOCAL_POSITION_NED", time_boot_ms=boot_ms, vy=4.0, **local))
        north_m = 3.0 - 30.0 * (late and global_too)
        lat, lon = round(470000000 + 89.93 * north_m), round(85000000 + 131.7 * (4.0 + east_m))
        alt = 402000 - 5000 * (late and global_too)
        log.add(arrival_s, made("GLOBAL_POSITION_INT", time_boot_ms=boot_ms, lat=lat, lon=lon, alt=alt))
    log.frames.sort(key=lambda frame: frame[0])
    found = read_tlog(log.write(path))
    moved = "LOCAL_POSITION_NED: its origin moved by 30.4 m at 22.00 s, as GLOBAL_POSITION_INT shows"
    assert (moved in notes(found)) != global_too
    t_s = found.autopilot["t_s"]
    expected = np.where(t_s >= 22.0 - 1e-6, -27.0 if global_too else 3.0, 3.0)
    assert found.autopilot["pos_n_m"] == pytest.approx(expected, abs=0.1)
    assert found.autopilot["pos_e_m"] == pytest.approx(4.0 + 4.0 * (t_s - 20.0), abs=0.1)


def test_an_origin_that_is_not_in_the_log_is_said(path):
    log = flight_log()
    log.frames = [f for f in log.frames if f[1][7] != 49]
    assert "no GPS_GLOBAL_ORIGIN" in notes(read_tlog(log.write(path)))


def test_mavlink_1_frames(path):
    log = flight_log()
    before = read_tlog(log.write(path))
    old = Tlog()
    for arrival, frame in log.frames:
        old.add((arrival - START_US) * 1e-6, coder().decode(bytearray(frame)), v1=True)
    assert {frame[0] for _, frame in old.frames} == {0xFE}
    after = read_tlog(old.write(path))
    assert np.array_equal(before.streams[Sensor.ATTITUDE].value, after.streams[Sensor.ATTITUDE].value)


def test_px4s_angles_and_limits(path):
    log = Tlog()
    log.add(0.0, made("HEARTBEAT", autopilot=PX4))
    for name, value in (("SENS_FLOW_MAXR", 7.4), ("SENS_FLOW_MINHGT", 0.08), ("SENS_FLOW_MAXHGT", 30.0)):
        log.add(0.0, made("PARAM_VALUE", param_id=name.encode(), param_value=value, param_type=9))
    for step in range(20):
        boot_us = 5_000_000 + 20_000 * step
        log.add(0.02 * step, made("ATTITUDE_QUATERNION", time_boot_ms=boot_us // 1000, q1=1.0))
        log.add(0.02 * step, made("HIGHRES_IMU", time_usec=boot_us, zacc=-9.8, xgyro=0.5, fields_updated=0x3F))
        flow = {"integration_time_us": 20000, "integrated_x": 0.01, "quality": 200, "distance": 1.2}
        no_gyro = {"integrated_xgyro": math.nan, "integrated_ygyro": math.nan}
        log.add(0.02 * step, made("OPTICAL_FLOW_RAD", time_usec=boot_us, **flow, **no_gyro))
    found = read_tlog(log.write(path))
    assert found.autopilot_name == "PX4"
    assert found.limits["flow_rad_s"] == pytest.approx((0.0, 7.4))
    assert found.limits["flow_height_m"] == pytest.approx((0.08, 30.0))
    assert found.streams[Sensor.FLOW_RATE].value[:, 0] == pytest.approx(0.5)
    assert found.streams[Sensor.FLOW_RATE].delay_s == pytest.approx(0.01)
    assert found.streams[Sensor.RANGE].value == pytest.approx(1.2)
    said = {absence.what: absence.instead for absence in found.absences}
    assert said == {
        "no GPS fix (GPS_RAW_INT)": INSTEAD[Sensor.GPS_POSITION].instead,
        "no barometer (SCALED_PRESSURE, HIGHRES_IMU)": INSTEAD[Sensor.BARO].instead,
        "no gyro in the flow sensor": "rotation is taken out of the flow with the IMU or the turning of the attitude",
    }
    assert found.origin_deg_m is None
    assert found.autopilot is None


# -- whose log ---------------------------------------------------------------------------------------------
def test_the_autopilot_is_who_says_so(path):
    log = flight_log()
    for step in range(3000):
        log.add(0.001 * step, made("HEARTBEAT", type=6, autopilot=8), system=255, component=190)
    found = read_tlog(log.write(path))
    assert (found.autopilot_name, len(found.streams[Sensor.ATTITUDE])) == ("ArduPilot", STEPS)
    assert found.notes == ()


def test_of_two_vehicles_the_one_that_said_more(path):
    log = flight_log()
    log.add(0.0, made("HEARTBEAT", autopilot=PX4), system=2)
    log.add(0.1, made("ATTITUDE", time_boot_ms=500, roll=1.0), system=2)
    found = read_tlog(log.write(path))
    assert len(found.streams[Sensor.ATTITUDE]) == STEPS
    assert "several vehicles; system 1 (ArduPilot) sent the most; left out: system 2" in notes(found)


def test_without_a_heartbeat_who_sent_the_most(path):
    log = flight_log()
    log.frames = [f for f in log.frames if f[1][7] != 0]
    found = read_tlog(log.write(path))
    assert "no autopilot's HEARTBEAT; system 1, component 1" in notes(found)
    assert "raw_counts" in notes(found)  # RAW_IMU is in known units of ArduPilot only


def test_a_sensor_with_its_own_clock_and_a_companion(path):
    log = flight_log()
    sensor = Tlog()
    for step in range(STEPS):
        message = made("VISION_POSITION_ESTIMATE", usec=900_000_000 + 50_000 * step, x=float(step))
        sensor.add(0.05 * step + 0.02, message, component=197)
    log.frames = sorted(log.frames + sensor.frames, key=lambda f: f[0])
    pose = read_tlog(log.write(path)).streams[Sensor.POSE]
    assert pose.t_s == pytest.approx(20.0 + 0.05 * np.arange(STEPS) + 0.01, abs=0.002)
    assert pose.value[:, 0] == pytest.approx(np.arange(STEPS))


# -- which flow sensor -------------------------------------------------------------------------------------
def two_flows():
    log = flight_log()
    for step in range(STEPS * 2):
        fields = {"sensor_id": 3, "quality": 9, "flow_rate_x": 0.7, "flow_comp_m_x": 0.2}
        log.add(0.5 + 0.01 * step, made("OPTICAL_FLOW", time_usec=20_500 + 10 * step, **fields))
    log.frames.sort(key=lambda f: f[0])
    return log


def test_the_flow_sensor_with_the_most_readings(path):
    found = read_tlog(two_flows().write(path))
    assert len(found.streams[Sensor.FLOW_RATE]) == 2 * STEPS
    assert f"left out: OPTICAL_FLOW 0 of component 1 ({STEPS})" in notes(found)


@pytest.mark.parametrize(("instance", "count"), [(0, STEPS), (3, 2 * STEPS)])
def test_the_flow_sensor_that_is_asked_for(path, instance, count):
    assert len(read_tlog(two_flows().write(path), flow_instance=instance).streams[Sensor.FLOW_RATE]) == count


def test_a_flow_sensor_that_is_not_there(path):
    text = complaint(two_flows().write(path), flow_instance=1)
    assert "flow instance 1: the log has no such flow sensor; its flow instances: 0, 3" in text


def test_flow_velocity_beside_flow_rate_is_left_out(path):
    log = flight_log(autopilot=PX4)
    found = read_tlog(log.write(path))
    assert Sensor.FLOW_VELOCITY not in found.streams
    assert "flow_velocity is left out: flow_rate is of the same flow" in notes(found)


# -- clocks ------------------------------------------------------------------------------------------------
def test_times_through_the_wrap(path):
    log = read_tlog(flight_log(boot_s=2**32 * 1e-3 - 2.0).write(path))
    t_s = log.streams[Sensor.ATTITUDE].t_s
    assert np.diff(t_s) == pytest.approx(0.05, abs=1e-6)


def test_a_reboot_in_the_log(path):
    first, second = flight_log(), flight_log(boot_s=1.0)
    first.frames += [(arrival + 60_000_000, frame) for arrival, frame in second.frames]
    found = read_tlog(first.write(path))
    t_s = found.streams[Sensor.ATTITUDE].t_s
    assert np.all(np.diff(t_s) > 0)
    assert t_s[-1] - t_s[0] == pytest.approx(63.95, abs=0.1)
    lost = sum(stream.rejected.get("stale_time", 0) for stream in found.streams.values())
    assert lost == 10  # the readings of the reboot's first two instants: a third confirms it
    assert "1 jumps of a clock" in notes(found)


def test_arrival_times_that_are_garbage(path):
    log = flight_log()
    random.seed(1)
    log.frames = [(random.choice([0, 2**64 - 1, arrival]), frame) for arrival, frame in log.frames]
    found = read_tlog(log.write(path))
    assert found.streams[Sensor.ATTITUDE].t_s == pytest.approx(20.0 + 0.05 * np.arange(STEPS))
    assert np.all((found.truth["t_s"] >= 20.0) & (found.truth["t_s"] < 30.0))


def test_a_repeated_fix_is_counted(path):
    log = flight_log()
    log.frames = [f for frame in log.frames for f in ([frame, frame] if frame[1][7] == 24 else [frame])]
    assert read_tlog(log.write(path)).streams[Sensor.GPS_POSITION].rejected == {"duplicate": 20}


# -- damage ------------------------------------------------------------------------------------------------
def test_bytes_between_frames_cost_nothing_else(path):
    log = flight_log()
    parts = [struct.pack(">Q", arrival) + frame for arrival, frame in log.frames]
    parts.insert(100, b"\xfd\xfe" + bytes(range(200)) + b"\xfe\xfd\xff")
    path.write_bytes(b"".join(parts))
    found = read_tlog(path)
    assert len(found.streams[Sensor.ATTITUDE]) == STEPS
    assert "damage: 205 bytes belong to no whole frame" in notes(found)


def test_a_flipped_bit_costs_one_frame(path):
    log = flight_log()
    arrival, frame = log.frames[62]
    assert frame[7] == 30  # ATTITUDE
    log.frames[62] = (arrival, frame[:14] + bytes([frame[14] ^ 0x10]) + frame[15:])
    found = read_tlog(log.write(path))
    assert len(found.streams[Sensor.ATTITUDE]) == STEPS - 1
    assert f"damage: {len(frame) + 8} bytes belong to no whole frame (1 bad checksum)" in notes(found)


def test_a_cut_off_end(path):
    content = flight_log().content
    path.write_bytes(content[:-5])
    assert "1 truncated" in notes(read_tlog(path))


def test_a_length_that_claims_beyond_the_file(path):
    content = flight_log().content
    path.write_bytes(content + struct.pack(">Q", START_US) + b"\xfd\xff\x00\x00\x00\x01\x01\x1e\x00\x00" + b"x" * 30)
    found = read_tlog(path)
    assert len(found.streams[Sensor.ATTITUDE]) == STEPS
    assert "damage: 48 bytes" in notes(found)


def test_messages_that_pymavlink_does_not_know(path):
    log = flight_log()
    unknown = b"\xfd\x03\x00\x00\x07\x01\x01\xfe\xff\x7fabc\x12\x34"
    log.frames[50:50] = [(START_US, unknown)] * 4
    found = read_tlog(log.write(path))
    assert len(found.streams[Sensor.ATTITUDE]) == STEPS
    assert found.notes == ("4 frames are of messages that pymavlink does not know",)


def test_signed_frames_are_read_and_said(path):
    signer = coder(1, 1)
    sign_outgoing(signer, bytes(32), 1.8e9)
    log = flight_log()
    log.frames = [(arrival, bytes(coder().decode(bytearray(f)).pack(signer))) for arrival, f in log.frames]
    found = read_tlog(log.write(path))
    assert len(found.streams[Sensor.ATTITUDE]) == STEPS
    assert f"{len(log.frames)} frames are signed; a log's signatures are not verified" in notes(found)


def test_readings_that_cannot_be_are_counted(path):
    log = flight_log()
    for place in range(3):
        log.add(4.1 + place, made("ATTITUDE", time_boot_ms=24100 + 100 * place, roll=math.nan))
    assert read_tlog(log.write(path)).streams[Sensor.ATTITUDE].rejected == {"not_finite": 3}


def test_a_sensor_without_any_good_reading_is_said(path):
    log = flight_log()
    log.frames = [f for f in log.frames if f[1][7:9] != b"\x84\x00"]  # DISTANCE_SENSOR
    log.add(4.0, made("DISTANCE_SENSOR", time_boot_ms=24000, orientation=25, current_distance=0))
    found = read_tlog(log.write(path))
    assert "range: no reading of DISTANCE_SENSOR 0 of component 1 is usable (1 outside_limits)" in notes(found)
    assert "no range downwards (DISTANCE_SENSOR, RANGEFINDER)" in [absence.what for absence in found.absences]


# -- refused -----------------------------------------------------------------------------------------------
def test_what_is_no_tlog(path, tmp_path):
    assert "cannot be read" in complaint(path)
    for content in (b"", b"hello", bytes(5000), b"\xfd" * 5000, b"\xfe" * 5000):
        path.write_bytes(content)
        assert f"no MAVLink frame in {len(content)} bytes; a .tlog" in complaint(path)


def test_what_a_log_must_hold(path):
    log = flight_log()
    everything = log.frames
    log.frames = [f for f in everything if f[1][7] in (0, 49)]  # HEARTBEAT, GPS_GLOBAL_ORIGIN
    assert "no usable reading of any sensor; have the autopilot send ATTITUDE" in complaint(log.write(path))
    log.frames = [f for f in everything if f[1][7] not in (24, 100)]
    read = read_tlog(log.write(path))
    assert Sensor.IMU in read.streams
    with pytest.raises(InputError, match="lacks GPS or optical flow"):
        open_flight(path)


def test_a_log_without_attitude_has_its_imu_to_find_one(path):
    log = flight_log()
    log.frames = [f for f in log.frames if f[1][7] != 30]
    read = open_flight(log.write(path))
    assert Sensor.ATTITUDE not in read.streams
    said = {absence.what: absence.instead for absence in read.absences}
    assert said["no attitude (ATTITUDE_QUATERNION, ATTITUDE)"].startswith("it is found from the IMU")
    assert set(read.autopilot) == {"t_s", "pos_n_m", "pos_e_m", "pos_d_m"}  # body velocity needs an attitude


def test_without_pymavlink_the_extra_is_named(path, monkeypatch):
    flight_log().write(path)
    for name in [name for name in sys.modules if name.startswith("pymavlink")]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(InputError, match=r"MAVLink needs pymavlink; install it with `pip install 'flownav\[live\]'`"):
        read_tlog(path)


# -- anything at all ---------------------------------------------------------------------------------------
CONTENT = flight_log(1.0).content
PIECES = [b"\xfd", b"\xfe", b"\x00", b"\x01", b"\x1e\x00\x00", bytes(8), b"\xff" * 8, CONTENT[:90]]


@settings(max_examples=75, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_damage_is_counted_or_refused_in_one_line(path, data):
    content = bytearray(CONTENT)
    for _ in range(data.draw(st.integers(1, 12))):
        place = data.draw(st.integers(0, max(0, len(content) - 1)))
        length = data.draw(st.integers(0, 60))
        content[place : place + length] = data.draw(st.binary(max_size=60))
    path.write_bytes(bytes(content))
    said = ""
    try:
        log = read_tlog(path)
    except InputError as error:
        said = str(error)
    if said:
        assert "\n" not in said
        return
    for stream in log.streams.values():
        assert np.isfinite(stream.t_s).all()
        assert np.all(np.diff(stream.t_s) >= 0)
    for table in (log.truth, log.autopilot):
        assert table is None or all(np.isfinite(column).all() for column in table.values())


@settings(max_examples=75, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_payload_with_a_right_checksum_is_read_or_refused(path, data):
    log = flight_log(0.5)
    for _ in range(data.draw(st.integers(1, 12))):
        name = data.draw(st.sampled_from(sorted({*WANTED, "HEARTBEAT", "GPS_GLOBAL_ORIGIN"})))
        frame = packed_payload(name, data.draw(arbitrary_payload(name)))
        log.frames.insert(data.draw(st.integers(0, len(log.frames))), (START_US, frame))
    log.write(path)
    said, found = "", None
    try:
        found = read_tlog(path)
    except InputError as error:
        said = str(error)
    assert "\n" not in said
    if found:
        assert all(np.isfinite(stream.t_s).all() for stream in found.streams.values())
        for table in (found.truth, found.autopilot):
            assert table is None or all(np.isfinite(column).all() for column in table.values())


def test_a_pad_in_the_earth_is_seen_from_where_the_vehicle_was(path):
    log = flight_log()
    pad = made("LANDING_TARGET", time_usec=24_000_000, position_valid=1, frame=1, x=3.0, y=4.0)
    log.add(4.0, pad, component=191)
    found = read_tlog(log.write(path)).streams[Sensor.PAD]
    roll = 0.05 * math.sin(3.95)
    assert found.value[0] == pytest.approx((0.0, math.tan(roll), 2.0), abs=1e-6)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.sampled_from(PIECES), max_size=200))
def test_any_bytes_are_read_or_refused(path, parts):
    path.write_bytes(b"".join(parts))
    with pytest.raises(InputError) as caught:
        read_tlog(path)
    assert "\n" not in str(caught.value)


# -- the real one ------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def helicopter(data_folder):
    return read_tlog(data_folder / "mavlink" / "heli_sitl.tlog")


def test_the_helicopters_log_reads_whole(helicopter):
    counts = {sensor.name: (len(stream), stream.rejected) for sensor, stream in helicopter.streams.items()}
    assert counts == {
        "GPS_POSITION": (536, {"no_fix": 33}), "GPS_VELOCITY": (536, {}), "FLOW_RATE": (2279, {}),
        "RANGE": (725, {"outside_limits": 1554}), "IMU": (5699, {}), "ATTITUDE": (2279, {}), "BARO": (1139, {}),
        "MAG": (5699, {}), "LANDED": (569, {}),
    }  # fmt: skip
    assert helicopter.autopilot_name == "ArduPilot"
    assert helicopter.limits == {"range_m": (0.1, 40.0)}
    check_plausible(helicopter.path, helicopter.streams)


def test_the_helicopters_autopilot_knew_where_it_was(helicopter):
    """Its filter against the simulator's truth in flight: clocks, origin, axes and units of both must be right."""
    auto, truth = helicopter.autopilot, helicopter.truth
    flying = (auto["t_s"] > 70.0) & (auto["t_s"] < 104.0)
    t_s = auto["t_s"][flying]
    for names, bound in ((("pos_n_m", "pos_e_m"), 0.1), (("vel_u_m_s", "vel_v_m_s", "vel_w_m_s"), 0.06)):
        for name in names:
            error = auto[name][flying] - np.interp(t_s, truth["t_s"], truth[name])
            assert np.sqrt(np.mean(error**2)) < bound, name


def test_the_helicopters_truth_is_that_of_its_dataflash_log(helicopter, data_folder):
    """The same flight as the autopilot logged it: position within a beat of the truth's 0.05 s at 2 m/s."""
    import pymap3d
    from pymavlink.DFReader import DFReader_binary

    log = DFReader_binary(str(data_folder / "dataflash" / "heli_sitl_takeoff_square_land.bin"))
    rows = []
    while (row := log.recv_match(type="SIM")) is not None:
        rows.append((row.TimeUS * 1e-6, row.Lat, row.Lng, row.Alt))
    log.data_map.close()
    log.filehandle.close()
    t_s, *position = np.array(rows).T
    logged = pymap3d.geodetic2ned(*position, *helicopter.origin_deg_m)
    truth = helicopter.truth
    flying = (truth["t_s"] > 60.0) & (truth["t_s"] < 110.0)
    for name, values in zip(("pos_n_m", "pos_e_m", "pos_d_m"), logged, strict=True):
        assert np.interp(truth["t_s"][flying], t_s, values) == pytest.approx(truth[name][flying], abs=0.05), name


def test_the_helicopters_flow_is_truths_flow(helicopter):
    """flow_x = p - v/r and flow_y = q + u/r of the simulator's state: signs, gyro and scale."""
    flow, truth, distance = helicopter.streams[Sensor.FLOW_RATE], helicopter.truth, helicopter.streams[Sensor.RANGE]
    high = (flow.t_s > 72.0) & (flow.t_s < 100.0)
    t_s = flow.t_s[high]
    r = np.interp(t_s, distance.t_s, distance.value[:, 0])
    state = {name: np.interp(t_s, truth["t_s"], truth[name]) for name in ("vel_u_m_s", "vel_v_m_s")}
    seen = flow.value[high, :2] - flow.value[high, 2:]
    for column, expected in ((0, -state["vel_v_m_s"] / r), (1, state["vel_u_m_s"] / r)):
        assert np.sum(seen[:, column] * expected) / np.sum(expected**2) == pytest.approx(1.0, abs=0.08)
        assert np.std(seen[:, column] - expected) < 0.05  # the simulated sensor's noise
    turned = attitude_rates(helicopter.streams[Sensor.ATTITUDE], t_s - 0.05, t_s)
    for column in (0, 1):
        assert np.corrcoef(flow.value[high, 2 + column], turned[:, column])[0, 1] > 0.95


def test_the_helicopters_log_replays(helicopter):
    result = replay(helicopter, ReplayOptions(), NavigatorSettingsFile())
    scores = result.scores()["truth"]
    assert scores["horizontal_rms_m"] < 1.0
    assert scores["vertical_rms_m"] < 1.0


def test_a_damaged_copy_of_the_helicopters_log_is_read(helicopter, tmp_path):
    content = bytearray(helicopter.path.read_bytes())
    places = random.Random(3).sample(range(len(content)), 2000)
    for place in places:
        content[place] ^= 0xFF
    (tmp_path / "damaged.tlog").write_bytes(bytes(content))
    found = read_tlog(tmp_path / "damaged.tlog")
    left = len(found.streams[Sensor.ATTITUDE]) / len(helicopter.streams[Sensor.ATTITUDE])
    assert 0.85 < left < 1.0
