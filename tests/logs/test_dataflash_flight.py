"""A DataFlash log as a Log: as the same flight's CSV folder, signs by a simulator's truth, every refusal."""

from __future__ import annotations

import struct
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pytest

from dataflash_files import DataFlashWriter, as_text, dataflash_of, define_flight, old_dataflash_of
from flownav.core.errors import InputError
from flownav.core.frames import euler_from_quaternion, rotation_from_quaternion, to_earth
from flownav.core.measurement import Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY
from flownav.logs.csv_folder import read_csv_folder
from flownav.logs.dataflash import read_dataflash
from flownav.logs.log import Log, attitude_at
from replay_logs import ORIGIN, SyntheticLog, log_of_flight

REAL = Path("dataflash") / "heli_sitl_takeoff_square_land.bin"
SIM_GPS_LAG_S = 0.1  # the simulator's own parameter SIM_GPS_LAG_MS in that log
# rounding of the format: centidegrees, 1e-7 degrees (11 mm) and centimetres, single precision
TOLERANCE = {Sensor.ATTITUDE: 1.6e-4, Sensor.GPS_POSITION: 0.012, Sensor.RANGE: 0.006, Sensor.MAG: 1.01e-3}


@pytest.fixture(scope="module")
def flight() -> SyntheticLog:
    return log_of_flight(20.0)


@pytest.fixture(scope="module")
def real(data_folder) -> Log:
    return read_dataflash(data_folder / REAL)


def read(tmp_path: Path, writer: DataFlashWriter | bytes, **options: int) -> Log:
    path = tmp_path / "flight.bin"
    path.write_bytes(writer if isinstance(writer, bytes) else writer.content())
    return read_dataflash(path, **options)


def without(flight: SyntheticLog, *names: str) -> SyntheticLog:
    """The flight less some sensors."""
    return SyntheticLog({name: table for name, table in flight.tables.items() if name not in names})


def complaint(tmp_path: Path, writer: DataFlashWriter | bytes, **options: int) -> str:
    """The reader's one line."""
    with pytest.raises(InputError) as caught:
        read(tmp_path, writer, **options)
    text = str(caught.value)
    assert "\n" not in text
    assert "flight.bin" in text
    return text


def assert_same(ours: Stream, theirs: Stream) -> None:
    assert ours.t_s == pytest.approx(theirs.t_s, abs=1e-6)
    limit = TOLERANCE.get(ours.sensor, 1e-5)
    assert np.abs(ours.value - theirs.value).max() < limit, ours.sensor


# -- what is read ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("units", [True, False], ids=["with FMTU", "without FMTU"])
def test_the_same_flight_is_the_same_log_as_a_csv_folder(tmp_path, flight, units):
    log = read(tmp_path, dataflash_of(flight, DataFlashWriter(units=units)))
    theirs = read_csv_folder(flight.write(tmp_path / "folder"))
    assert set(log.streams) == set(theirs.streams)
    for sensor, stream in theirs.streams.items():
        assert_same(log.streams[sensor], stream)
    assert log.origin_deg_m == pytest.approx(theirs.origin_deg_m, abs=0.006)
    assert log.limits == {"range_m": (0.1, 40.0)}
    assert (log.absences, log.notes, log.autopilot, log.truth) == ((), (), None, None)
    assert [len(digest) for digest in log.inputs.values()] == [64]


def test_accuracies_become_variances_and_unstated_ones_are_none(tmp_path, flight):
    log = read(tmp_path, dataflash_of(flight))
    assert log.streams[Sensor.GPS_POSITION].variance[0] == pytest.approx([0.25, 0.25, 0.64])
    assert log.streams[Sensor.GPS_VELOCITY].variance[0] == pytest.approx([0.04] * 3)
    bare = dataflash_of(flight)
    bare.parts = [part for part in bare.parts if part[2] != bare.types["GPA"][0]]
    assert np.isnan(read(tmp_path, bare).streams[Sensor.GPS_POSITION].variance).all()


def test_a_receiver_without_vertical_velocity_has_none(tmp_path, flight):
    writer = dataflash_of(flight)
    kind = writer.types["GPA"][0]
    writer.parts = [part[:-1] + b"\0" if part[2] == kind else part for part in writer.parts]
    velocity = read(tmp_path, writer).streams[Sensor.GPS_VELOCITY].value
    assert np.isnan(velocity[:, 2]).all()
    assert np.isfinite(velocity[:, :2]).all()


def test_the_delays_that_the_vehicle_was_told_of_are_the_streams(tmp_path, flight):
    writer = dataflash_of(flight)
    writer.put("PARM", 40e6, "GPS1_DELAY_MS", 180.0)
    assert read(tmp_path, writer).streams[Sensor.GPS_POSITION].delay_s == pytest.approx(0.18)


def test_a_setting_that_is_no_number_is_read_without_a_warning(tmp_path, flight):
    """A flipped bit makes a NaN that signals, and NumPy warns where it is made a double (real log, seed 24)."""
    writer = dataflash_of(flight)
    writer.put("PARM", 40e6, "GPS1_DELAY_MS", 12345.0)
    writer.parts[-1] = writer.parts[-1].replace(struct.pack("<f", 12345.0), struct.pack("<I", 0x7FA00000))
    assert np.isfinite(read(tmp_path, writer).streams[Sensor.GPS_POSITION].delay_s)


def test_landings_and_take_offs_are_a_stream(tmp_path, flight):
    writer = dataflash_of(flight)
    for at, event in ((42.0, 10), (43.0, 28), (55.0, 17), (56.0, 18), (57.0, 11)):
        writer.put("EV", at * 1e6, event)
    landed = read(tmp_path, writer).streams[Sensor.LANDED]
    assert landed.t_s == pytest.approx([0.0, 3.0, 16.0])
    assert landed.value[:, 0].tolist() == [1.0, 0.0, 1.0]


def test_pad_sightings_are_turned_into_the_body(tmp_path, flight):
    writer = dataflash_of(flight)
    writer.define("PL", "QBBfffI", "TimeUS,Heal,TAcq,mX,mY,mZ,LastMeasMS")
    writer.put("PARM", 40e6, "PLND_LAG", 0.02)
    seen = [(50.0, 1, 1), (50.02, 1, 1), (50.1, 2, 1), (50.2, 3, 0)]  # time, sighting, acquired
    for at, sighting, acquired in seen:
        writer.put("PL", at * 1e6, 1, acquired, 0.5, -0.3, 2.0, sighting)
    log = read(tmp_path, writer)
    pad = log.streams[Sensor.PAD]
    assert pad.t_s == pytest.approx([10.0, 10.1])
    assert pad.delay_s == pytest.approx(0.02)
    assert pad.rejected == {"no_target": 1, "repeated": 1}
    quaternion = attitude_at(log.streams[Sensor.ATTITUDE], pad.t_s - 0.02)[0]
    forward, right, size = pad.value[0]
    body = np.array([forward, right, 1.0]) * size / np.sqrt(forward**2 + right**2 + 1.0)
    assert to_earth(rotation_from_quaternion(*quaternion), *body) == pytest.approx([0.5, -0.3, 2.0], abs=1e-6)


def test_the_flow_sensor_asked_for_is_read(tmp_path, flight):
    writer = DataFlashWriter()
    writer.define("OF", "QBBffff", "TimeUS,I,Qual,flowX,flowY,bodyX,bodyY", "s#-EEEE", "F--0000")
    layout = writer.types["OF"]
    dataflash_of(without(flight, "flow"), writer)
    writer.types["OF"] = layout
    for i in range(400):
        for instance in (1, 3):
            quality = 100 + instance if instance == 3 or i < 300 else 0
            writer.put("OF", 40e6 + 5e4 * i, instance, quality, 0.01 * instance, 0.0, 0.0, 0.0)
    for asked, expected in ((None, 3), (1, 1), (3, 3)):
        log = read(tmp_path, writer, flow_instance=asked)
        assert log.streams[Sensor.FLOW_RATE].quality[0] == 100.0 + expected
        assert any(note.startswith(f"OF: instance {expected} is read; ") for note in log.notes)
    assert "no flow sensor 2; the log has 1, 3" in complaint(tmp_path, writer, flow_instance=2)


def test_a_flow_sensor_that_is_not_there_is_refused(tmp_path, flight):
    assert "no flow sensor 1; the log has 0" in complaint(tmp_path, dataflash_of(flight), flow_instance=1)
    assert read(tmp_path, dataflash_of(flight), flow_instance=0).streams[Sensor.FLOW_RATE].quality[0] == 255.0
    blind = dataflash_of(without(flight, "flow"))
    assert "no flow sensor 0; the log has none" in complaint(tmp_path, blind, flow_instance=0)


def test_the_gps_in_use_and_the_rangefinder_that_looks_down_are_read(tmp_path, flight):
    writer = dataflash_of(flight)
    for i in range(100):
        time_us = 40e6 + 2e5 * i
        writer.put("GPS", time_us, 1, 3, 0, 0, ORIGIN[0] + 0.001, ORIGIN[1], 500.0, 0.0, 0.0, 0.0, 0)
        writer.put("RFND", time_us, 1, 9.0, 4, 0)
    log = read(tmp_path, writer)
    assert np.abs(log.streams[Sensor.GPS_POSITION].value).max() < 15.0
    assert log.streams[Sensor.RANGE].value.max() < 9.0
    assert {note.split(":")[0] for note in log.notes} == {"GPS", "RFND"}


def test_what_a_log_lacks_is_said(tmp_path, flight):
    for absent, said in (
        ("attitude", "no attitude"),
        ("gps", "no GPS fix"),
        ("flow", "no optical flow (OF)"),
        ("range", "no downward rangefinder (RFND)"),
        ("imu", "no inertial readings"),
        ("baro", "no barometer"),
    ):
        log = read(tmp_path, dataflash_of(without(flight, absent)))
        assert [absence.what for absence in log.absences] == [said]
        assert (log.origin_deg_m is None) == (absent == "gps")


# -- what is thrown away and counted -----------------------------------------------------------------------
BAD_ROWS = [
    ("RFND", (0, 3.0, 2, 25), Sensor.RANGE, "invalid"),
    ("RFND", (0, 3.0, 4, 0), Sensor.RANGE, "not_downward"),
    ("OF", (255, float("nan"), 0.0, 0.0, 0.0), Sensor.FLOW_RATE, "not_finite"),
    ("OF", (255, 1e9, 0.0, 0.0, 0.0), Sensor.FLOW_RATE, "out_of_range"),
    ("GPS", (0, 1, 0, 0, 47.0, 8.5, 400.0, 0.0, 0.0, 0.0, 1), Sensor.GPS_POSITION, "no_fix"),
    ("GPS", (0, 3, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1), Sensor.GPS_VELOCITY, "out_of_range"),
    ("IMU", (0, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8, 0, 1), Sensor.IMU, "invalid"),
    ("MAG", (0, 200, 0, 400, 0), Sensor.MAG, "invalid"),
    ("BARO", (0, float("inf")), Sensor.BARO, "not_finite"),
    ("ATT", (0.0, 100.0, 0.0), Sensor.ATTITUDE, "out_of_range"),
]


@pytest.mark.parametrize(("name", "values", "sensor", "reason"), BAD_ROWS)
def test_a_bad_row_is_thrown_away_and_counted(tmp_path, flight, name, values, sensor, reason):
    whole = len(read(tmp_path, dataflash_of(flight)).streams[sensor])
    writer = dataflash_of(flight)
    writer.put(name, 60.1e6, *values)
    stream = read(tmp_path, writer).streams[sensor]
    assert stream.rejected == {reason: 1}
    assert len(stream) == whole


def test_rows_whose_time_runs_back_or_stands_are_counted(tmp_path, flight):
    writer = dataflash_of(flight)
    writer.put("BARO", 45.0e6, 0, 3.0)
    last = [part for part in writer.parts if part[2] == writer.types["RFND"][0]][-1]
    writer.parts.append(last)
    log = read(tmp_path, writer)
    assert log.streams[Sensor.BARO].rejected == {"out_of_order": 1}
    assert log.streams[Sensor.RANGE].rejected == {"duplicate": 1}


def test_unreadable_bytes_are_told(tmp_path, flight):
    content = dataflash_of(flight).content()
    middle = content.index(b"\xa3\x95", len(content) // 2)
    log = read(tmp_path, content[:middle] + b"#" * 100 + content[middle:] + b"\xff" * 20)
    size = len(content) + 120
    assert log.notes == (f"flight.bin: 120 of {size} bytes are no message (2 places); skipped",)


def test_a_redefined_message_is_told(tmp_path, flight):
    writer = dataflash_of(flight)
    writer.put("FMT", writer.types["BARO"][0], 12, "BARO", "Qb", "TimeUS,Alt")
    assert read(tmp_path, writer).notes == ("flight.bin: 1 FMT messages contradict earlier ones; the first stand",)


def test_a_sensor_without_a_usable_row_and_one_without_a_needed_field_are_told(tmp_path, flight):
    writer = DataFlashWriter()
    writer.define("MAG", "Qh", "TimeUS,MagX")
    writer.put("MAG", 41e6, 3)
    dataflash_of(without(flight, "range", "mag"), writer)
    writer.put("RFND", 41e6, 0, 3.0, 2, 25)
    log = read(tmp_path, writer)
    assert "RFND: no usable row (1 invalid)" in log.notes
    assert "MAG lacks a field that is needed (MagX, MagY, MagZ)" in log.notes
    assert [absence.what for absence in log.absences] == ["no downward rangefinder (RFND)"]


# -- logs of years before --------------------------------------------------------------------------------------
@pytest.mark.parametrize("written", [lambda w: w.content(), lambda w: as_text(w.content()).encode()],
                         ids=["binary", "text"])  # fmt: skip
def test_a_log_of_milliseconds_is_the_same_log_as_a_csv_folder(tmp_path, flight, written):
    """ATT in milliseconds since boot, GPS in its week's with the vehicle's time beside it, RFND with its first name."""
    log = read(tmp_path, written(old_dataflash_of(flight)))
    theirs = read_csv_folder(flight.write(tmp_path / "folder"))
    assert set(log.streams) == set(theirs.streams)
    assert log.clock_start_s == pytest.approx(40.0)
    for sensor, stream in theirs.streams.items():
        assert log.streams[sensor].t_s == pytest.approx(stream.t_s, abs=6e-4)
        limit = max(TOLERANCE.get(sensor, 1e-5), 6e-3 if sensor in (Sensor.GPS_VELOCITY, Sensor.BARO) else 0.0)
        assert np.abs(log.streams[sensor].value - stream.value).max() < limit, sensor
    assert log.notes == ()


def test_events_without_a_time_have_that_of_the_message_before(tmp_path, flight):
    writer = old_dataflash_of(flight)
    kind, imu = writer.types["EV"][0], writer.types["IMU"][0]
    rows = [k for k, part in enumerate(writer.parts) if part[2] == imu]
    for place, event in sorted({rows[800]: 18, rows[150]: 28}.items(), reverse=True):
        writer.parts.insert(place + 1, bytes((0xA3, 0x95, kind, event)))
    landed = read(tmp_path, writer).streams[Sensor.LANDED]
    assert landed.t_s == pytest.approx([0.0, 3.0, 16.0], abs=0.021)  # of an IMU of 50 Hz
    assert landed.value[:, 0].tolist() == [1.0, 0.0, 1.0]


def test_the_first_ekf_of_all_is_the_autopilots_estimate(tmp_path, flight):
    writer = old_dataflash_of(flight)
    for k in range(100):
        writer.put("EKF1", 41_000 + 100 * k, 1.0, 2.0, 30.0, 0.5, 0.0, 0.0, 0.05 * k, 0.0, -3.0, 0, 0, 0)
    log = read(tmp_path, writer)
    assert log.autopilot_name == "EKF1"
    assert log.autopilot["pos_n_m"] == pytest.approx(0.05 * np.arange(100), abs=1e-5)


def test_a_log_without_any_time_is_refused_for_that(tmp_path):
    """ArduCopter 3.1 wrote ATT without one; that its LOG_BITMASK decides what it writes does not help there."""
    writer = DataFlashWriter(units=False)
    writer.define("ATT", "cccccCC", "RollIn,Roll,PitchIn,Pitch,YawIn,Yaw,NavYaw")
    writer.put("ATT", 0, 1, 0, 2, 0, 3, 4)
    said = complaint(tmp_path, writer)
    assert said.endswith("ATT lacks a time (TimeUS or TimeMS): ArduPilot before 3.2 wrote none, give a later log")
    assert "LOG_BITMASK" not in said


def test_lines_of_a_text_that_are_no_messages_are_left_out(tmp_path, flight):
    lines = as_text(old_dataflash_of(flight).content()).splitlines()
    torn = [line for k, line in enumerate(lines) if k < 20 or k % 500]
    broken = [f"{line[: len(line) // 3]}" for k, line in enumerate(lines) if k >= 20 and k % 500 == 0]
    whole, part = (read(tmp_path, "\n".join(each).encode()) for each in (torn, [*torn, *broken, "ATT, 1, x, y", "?"]))
    for sensor, stream in whole.streams.items():
        assert np.array_equal(part.streams[sensor].t_s, stream.t_s), sensor


# -- what is refused -----------------------------------------------------------------------------------------
def test_a_clock_that_restarts_is_refused(tmp_path, flight):
    content = dataflash_of(flight).content()
    assert "ATT: the clock runs back from 59.98 s to 40 s" in complaint(tmp_path, content + content)


def test_messages_of_another_time_are_refused(tmp_path, flight):
    writer = dataflash_of(without(flight, "range"))
    for i in range(50):
        writer.put("RFND", 90e6 + i * 5e4, 0, 3.0, 4, 25)
    assert "RFND covers 50 to 52.45 s and ATT 0 to 19.98 s; one flight's log is needed" in complaint(tmp_path, writer)


def test_sensors_that_cannot_be_right_together_are_refused(tmp_path, flight):
    flight = SyntheticLog(dict(flight.tables))
    flight.tables["imu"] = flight.tables["imu"] | {"accel_z_m_s2": -flight.tables["imu"]["accel_z_m_s2"]}
    assert "attitude and imu accel disagree about down" in complaint(tmp_path, dataflash_of(flight))


def test_a_log_with_formats_only_is_refused(tmp_path):
    writer = DataFlashWriter()
    define_flight(writer)
    said = complaint(tmp_path, writer)
    assert "no usable GPS, ATT, IMU, OF, RFND, BARO, MAG in the log; LOG_BITMASK decides" in said


# -- the simulated helicopter --------------------------------------------------------------------------------
def columns(table: dict, names: tuple[str, ...], at: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(at, table["t_s"], table[name]) for name in names])


def test_the_real_log_reads_whole(real):
    assert {sensor.name: len(stream) for sensor, stream in real.streams.items()} == {
        "ATTITUDE": 772, "IMU": 1929, "FLOW_RATE": 1544, "RANGE": 725, "BARO": 772, "MAG": 772, "GPS_VELOCITY": 386,
        "GPS_POSITION": 386, "LANDED": 3,
    }  # fmt: skip
    assert real.streams[Sensor.RANGE].rejected == {"invalid": 819}
    assert real.autopilot_name == "EKF3"
    assert real.absences == ()


def test_positions_share_one_origin(real):
    """GPS is the truth of 0.1 s ago, and the autopilot's own estimate lies about the truth."""
    gps = real.streams[Sensor.GPS_POSITION]
    late = columns(real.truth, POSITION_NED, gps.t_s - SIM_GPS_LAG_S) - gps.value
    assert np.sqrt(np.mean(late**2, axis=0)).max() < 0.02
    said = columns(real.autopilot, POSITION_NED + VELOCITY_BODY, real.truth["t_s"])
    true = np.column_stack([real.truth[name] for name in POSITION_NED + VELOCITY_BODY])
    assert np.sqrt(np.mean((said - true) ** 2, axis=0)).max() < 0.2


def test_truth_velocity_and_attitude_are_those_of_its_motion(real):
    attitude = np.column_stack([real.truth[name] for name in QUATERNION])
    earth = to_earth(rotation_from_quaternion(*attitude.T), *(real.truth[name] for name in VELOCITY_BODY))
    moved = np.gradient(np.column_stack([real.truth[name] for name in POSITION_NED]), real.truth["t_s"], axis=0)
    assert np.sqrt(np.mean((np.column_stack(earth) - moved) ** 2)) < 0.05
    logged = attitude_at(real.streams[Sensor.ATTITUDE], real.truth["t_s"])
    tilt = [np.column_stack(euler_from_quaternion_rows(rows))[:, :2] for rows in (logged, attitude)]
    assert np.degrees(np.abs(tilt[0] - tilt[1])).max() < 3.0


def euler_from_quaternion_rows(rows: np.ndarray) -> tuple[np.ndarray, ...]:
    return tuple(np.array([euler_from_quaternion(*row) for row in rows]).T)


def test_ardupilots_flow_has_the_convention_of_measurement(real):
    """Regressed on the truth: flow_x = w_x - v_y / r, flow_y = w_y + v_x / r; the gyro columns are w alone."""
    flow, distance, imu = (real.streams[sensor] for sensor in (Sensor.FLOW_RATE, Sensor.RANGE, Sensor.IMU))
    flown = (flow.t_s > distance.t_s[0]) & (flow.t_s < distance.t_s[-1])
    t_s, value = flow.t_s[flown], flow.value[flown]
    range_m = np.interp(t_s, distance.t_s, distance.value[:, 0])
    velocity = columns(real.truth, VELOCITY_BODY[:2], t_s)
    rates = np.column_stack([np.interp(t_s, imu.t_s, column) for column in imu.value[:, :2].T])
    causes = np.column_stack([velocity / range_m[:, None], rates])[range_m > 1.0]
    found, *_ = np.linalg.lstsq(causes, value[range_m > 1.0], rcond=None)
    expected = [[0, 1, 0, 0], [-1, 0, 0, 0], [1, 0, 1, 0], [0, 1, 0, 1]]  # v_x/r, v_y/r, w_x, w_y by column of value
    assert np.abs(found - expected).max() < 0.15


def test_pymavlink_reads_the_sample_without_a_bad_message_and_dates_it(tmp_path, capfd):
    from pymavlink.DFReader import DFReader_binary

    path = tmp_path / "flight.bin"
    path.write_bytes(dataflash_of(log_of_flight(5.0)).content())
    log, dated, times = DFReader_binary(str(path)), [], []
    while (message := log.recv_msg()) is not None:
        if message.get_type() == "GPS":
            dated.append(message._timestamp)
            times.append(1e-6 * message.TimeUS)
    log.close()
    assert len(dated) > 10
    np.testing.assert_allclose(np.array(dated) - np.array(times), dated[0] - times[0], atol=2e-3)
    assert datetime.fromtimestamp(dated[0], UTC).date() == date(2026, 1, 4)
    assert "bad msg" not in "".join(capfd.readouterr())
