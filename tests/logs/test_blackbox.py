"""Blackbox logs of INAV and Betaflight: every packing, units, signs, GPS, several logs in a file, damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from blackbox_logs import (
    BlackboxLog,
    blackbox_log,
    packed,
    quantised,
    svb,
    tag2_3s32,
    tag2_3svariable,
    tag8_4s16,
    tag8_8svb,
    uvb,
)
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.logs.blackbox.format import packed as unpacked
from flownav.logs.blackbox.reader import read_blackbox
from flownav.logs.open_log import log_kind, open_log
from replay_logs import SyntheticLog, log_of_flight
from replayed_alike import apart, largest_difference

INAV, BETAFLIGHT = True, False
CLOSE = {Sensor.IMU: 1e-9, Sensor.ATTITUDE: 2e-3, Sensor.FLOW_RATE: 1e-9, Sensor.RANGE: 1e-9, Sensor.BARO: 1e-9,
         Sensor.GPS_POSITION: 1e-4, Sensor.GPS_VELOCITY: 1e-9}  # fmt: skip


@pytest.fixture(scope="module")
def flown():
    return log_of_flight(20.0, imu_hz=100.0)


@pytest.fixture(scope="module")
def folders(flown, tmp_path_factory) -> dict[bool, Path]:
    root = tmp_path_factory.mktemp("csv")
    return {inav: SyntheticLog(quantised(flown.tables, inav)).write(root / str(inav)) for inav in (INAV, BETAFLIGHT)}


@pytest.fixture(scope="module")
def contents(flown) -> dict[bool, bytes]:
    return {inav: blackbox_log(quantised(flown.tables, inav), inav).content() for inav in (INAV, BETAFLIGHT)}


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("inav", [INAV, BETAFLIGHT])
def test_fast_sensors_and_gps_read_as_in_the_csv_folder(contents, folders, tmp_path, inav):
    path = written(tmp_path / "LOG00001.TXT", contents[inav])
    assert log_kind(path) == "blackbox"
    log, known = open_log(path), open_log(folders[inav])
    assert set(log.streams) == set(known.streams)
    for sensor in (Sensor.IMU, Sensor.GPS_POSITION, Sensor.GPS_VELOCITY):
        assert largest_difference(log, known, sensor) < CLOSE[sensor], sensor
        assert np.allclose(log.streams[sensor].t_s, known.streams[sensor].t_s, atol=1e-6)
    assert log.clock_start_s == pytest.approx(20.0)
    assert log.origin_deg_m == pytest.approx(known.origin_deg_m, abs=1e-6)


@pytest.mark.parametrize("inav", [INAV, BETAFLIGHT])
def test_slow_sensors_stand_in_every_frame_and_are_read_when_they_change(contents, folders, tmp_path, inav):
    log, known = open_log(written(tmp_path / "a.bbl", contents[inav])), open_log(folders[inav])
    slow = (Sensor.ATTITUDE, Sensor.RANGE, Sensor.BARO, *((Sensor.FLOW_RATE,) if inav else ()))
    for sensor in slow:
        stream, so = log.streams[sensor], known.streams[sensor]
        assert len(stream) <= 1.1 * len(so)
        row = np.clip(np.searchsorted(so.t_s, stream.t_s + 1e-6, side="right") - 1, 0, len(so) - 1)
        if sensor == Sensor.ATTITUDE:
            apart_rad = 2 * np.arccos(np.clip(np.abs(np.sum(stream.value * so.value[row], axis=1)), 0, 1))
            assert apart_rad.max() < CLOSE[sensor]
        else:
            assert np.abs(stream.value - so.value[row]).max() < CLOSE[sensor], sensor


@pytest.mark.parametrize("inav", [INAV, BETAFLIGHT])
def test_the_replay_comes_out_as_that_of_the_csv_folder(contents, folders, tmp_path, inav):
    """Readings that did not change are fewer here, which weighs them otherwise."""
    distance_m, speed_m_s = apart(folders[inav], written(tmp_path / "a.bbl", contents[inav]))
    assert distance_m < 0.1
    assert speed_m_s < 0.05


def test_signs_are_those_of_the_firmware(tmp_path):
    """Nose down 10 deg and turning it down 20 deg/s, heading 90: INAV has pitch +, gyro y +; FRD pitch -, y -.

    Flying forward with 2 m/s 1 m above the ground and turning so, INAV's flow about y is -(2 rad/s) + body rate.
    """
    flow_y = round(np.degrees(-2.0) + 20)
    columns = {"time": 1, "gyroADC[0]": 0, "gyroADC[1]": 20, "gyroADC[2]": -30, "accSmooth[0]": -356,
               "accSmooth[1]": 0, "accSmooth[2]": 2017, "attitude[0]": 0, "attitude[1]": 100, "attitude[2]": 900,
               "debug[0]": 0, "debug[1]": flow_y, "debug[2]": 0, "debug[3]": 20, "navPos[0]": 100, "navPos[1]": 200,
               "navPos[2]": 300, "navVel[0]": 0, "navVel[1]": 200, "navVel[2]": 0}  # fmt: skip
    log = BlackboxLog({"Firmware revision": "INAV 7.1.0", "acc_1G": "2048", "debug_mode": "2"},
                      [(name, 0, 1, 0) for name in columns])  # fmt: skip
    log.rows = [[*columns.values()] for _ in range(40)]
    for k, row in enumerate(log.rows):
        row[0] = 10_000 * k
        row[11] += k % 2
        row[14] += k
    read = read_blackbox(written(tmp_path / "a.bbl", log.content()))
    imu = read.streams[Sensor.IMU].value[0]
    assert np.allclose(imu[:3], np.radians([0.0, -20.0, 30.0]))
    assert imu[3] < 0 < -imu[5]  # gravity's reaction is up, and backwards with the nose down
    from flownav.core.frames import euler_from_quaternion, velocity_from_flow

    angles = np.degrees(euler_from_quaternion(*read.streams[Sensor.ATTITUDE].value[0]))
    assert np.allclose(angles, [0.0, -10.0, 90.0])
    flow = read.streams[Sensor.FLOW_RATE].value[1]
    forward, right = velocity_from_flow(flow[0] - flow[2], flow[1] - flow[3], 1.0)
    assert forward == pytest.approx(2.0, abs=0.02)
    assert right == pytest.approx(0.0, abs=1e-9)
    assert read.autopilot["pos_d_m"][0] == -3.0
    assert read.autopilot["vel_u_m_s"][0] == pytest.approx(2.0 * np.cos(np.radians(10.0)), abs=1e-6)
    assert read.autopilot_name == "INAV 7.1.0"


def test_the_gyro_of_cleanflight_has_names_of_its_own(tmp_path):
    names = ("time", *(f"{name}[{k}]" for name in ("gyroData", "accSmooth") for k in range(3)))
    log = BlackboxLog({"Firmware type": "Cleanflight", "Firmware revision": "d72983e", "acc_1G": "4096",
                       "gyro.scale": "0x3d79c190"}, [(name, 0, 1, 0) for name in names])  # fmt: skip
    log.rows = [[10_000 * k, 164, 0, 0, 0, 0, 4096] for k in range(40)]
    read = read_blackbox(written(tmp_path / "a.TXT", log.content()))
    assert read.streams[Sensor.IMU].value[0] == pytest.approx([np.radians(10.0), 0, 0, 0, 0, -9.80665], rel=1e-3)
    assert read.notes[0].startswith("Cleanflight d72983e, frames of ")


@pytest.mark.parametrize(("write", "code", "count", "most"), [
    (tag2_3s32, 7, 3, (1, 7, 31, 127, 32767, 8_388_607, 2**31 - 1)),
    (tag2_3svariable, 10, 3, (1, 7, 63, 32767, 2**31 - 1)),
    (tag8_4s16, 8, 4, (0, 7, 127, 32767)),
    (tag8_8svb, 6, 8, (0, 1, 300, 2**30)),
    (lambda v: svb(v[0]), 0, 1, (0, 63, 10**6, 2**31 - 1)),
    (lambda v: uvb(v[0]), 1, 1, ()),
])  # fmt: skip
def test_every_packing_is_undone(write, code, count, most):
    random = np.random.default_rng(code)
    cases = [random.integers(-limit - 1, limit + 1, count) for limit in most for _ in range(200)]
    cases += [random.integers(0, 2**32, 1) for _ in range(200)] if not most else []
    for values in cases:
        content = np.frombuffer(write([int(v) for v in values]) + b"\x55", np.uint8)
        out = np.zeros(8, np.int64)
        got, place = unpacked(content, 0, len(content) - 1, code, count, out)
        assert (got, place) == (count, len(content) - 1)
        assert np.array_equal(out[:count], values)
        for cut in range(len(content) - 1):  # the bytes end before the value does
            assert unpacked(content, 0, cut, code, count, out)[1] == -1


def test_the_helper_packs_groups_as_the_firmware_does():
    """Eight and two fields of TAG8_8SVB in a row: a head for eight, a head for two."""
    assert packed([6] * 10, [0] * 7 + [1, 0, 2]) == bytes([0x80]) + svb(1) + bytes([0x02]) + svb(2)


def test_of_several_logs_in_a_file_the_longest_is_read(flown, contents, tmp_path):
    short = log_of_flight(4.0, imu_hz=100.0)
    first = blackbox_log(quantised(short.tables, INAV), INAV).content()
    log = open_log(written(tmp_path / "a.bbl", first + contents[INAV] + first))
    assert len(log.streams[Sensor.IMU]) == 2000
    assert "a.bbl holds 3 logs; the longest, number 2, is read" in log.notes


def test_a_clock_of_32_bits_that_turns_over_goes_on(flown, tmp_path):
    tables = quantised(flown.tables, INAV)
    log = read_blackbox(written(tmp_path / "a.bbl", blackbox_log(tables, INAV, boot_s=4294.967296 - 8.0).content()))
    assert np.allclose(log.streams[Sensor.IMU].t_s, tables["imu"]["t_s"], atol=1e-6)
    assert np.allclose(log.streams[Sensor.GPS_POSITION].t_s, tables["gps"]["t_s"], atol=1e-6)


@pytest.mark.parametrize("inav", [INAV, BETAFLIGHT])
def test_a_damaged_stretch_costs_the_frames_up_to_the_next_whole_one(contents, tmp_path, inav):
    """Frames of 100 Hz, a whole one (I) every 32: half a second is lost, and no reading is wrong."""
    content = bytearray(contents[inav])
    middle = len(content) // 2
    content[middle : middle + 40] = bytes(40)
    whole, log = (read_blackbox(written(tmp_path / "a.bbl", bytes(each))) for each in (contents[inav], content))
    imu, so = log.streams[Sensor.IMU], whole.streams[Sensor.IMU]
    assert 1950 < len(imu) < 2000
    row = np.searchsorted(so.t_s, imu.t_s - 1e-9)
    assert np.array_equal(imu.value, so.value[row])
    assert any(note.endswith("bytes belong to no whole frame and are left out") for note in log.notes)


def test_what_the_log_lacks_is_said(contents, tmp_path):
    lacks = {absence.what for absence in open_log(written(tmp_path / "b.bbl", contents[BETAFLIGHT])).absences}
    assert lacks == {"no optical flow (Betaflight logs none in a fixed unit)"}
    other = contents[INAV].replace(b"H debug_mode:2", b"H debug_mode:0")
    lacks = {absence.what for absence in open_log(written(tmp_path / "i.bbl", other)).absences}
    assert "no optical flow (set debug_mode = FLOW_RAW in INAV: it logs flow nowhere else)" in lacks


@pytest.mark.parametrize(("content", "why"), [
    (b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n", "whose header defines"),
    (b"H Product:Blackbox flight data recorder\nH Field I name:a,b\nH Field I predictor:0\n", "whose header defines"),
    (BlackboxLog({}, [("time", 1, 1, 0)]).content(), "no whole frame"),
    (BlackboxLog({}, [("time", 1, 1, 0)], [[k] for k in range(9)]).content(), "no usable reading of any sensor"),
])  # fmt: skip
def test_what_cannot_be_read_is_one_line(tmp_path, content, why):
    with pytest.raises(InputError) as error:
        read_blackbox(written(tmp_path / "a.bbl", content))
    assert why in str(error.value)
    assert "\n" not in str(error.value)


def test_a_flow_instance_is_refused(contents, tmp_path):
    with pytest.raises(InputError, match="with one flow sensor at most"):
        open_log(written(tmp_path / "a.bbl", contents[INAV]), flow_instance=0)


@pytest.mark.parametrize("value", ["9" * 400, "1e300", "nan", "-inf", "0x7f800000", "0x7fc00000"])
def test_a_setting_that_no_controller_holds_is_as_one_that_is_missing(contents, tmp_path, value):
    bad = contents[INAV].replace(b"minthrottle:1070", f"minthrottle:{value}".encode())
    missing = contents[INAV].replace(b"H minthrottle:1070\n", b"")
    logs = [read_blackbox(written(tmp_path / f"{k}.bbl", content)) for k, content in enumerate((bad, missing))]
    assert largest_difference(logs[0], logs[1], Sensor.IMU) == 0.0
