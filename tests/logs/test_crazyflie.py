"""Logs of the Crazyflie's micro SD deck: both versions, units, signs, scale of the flow, and what is damaged."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from crazyflie_logs import RAD_PER_COUNT, DeckLog, deck_log, quantised
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.logs.crazyflie import read_crazyflie
from flownav.logs.open_log import log_kind, open_log
from replay_logs import SyntheticLog, log_of_flight
from replayed_alike import apart, largest_difference

CLOSE = {Sensor.IMU: 2e-6, Sensor.ATTITUDE: 1e-3, Sensor.FLOW_RATE: 1e-9, Sensor.RANGE: 1e-9, Sensor.BARO: 1e-5,
         Sensor.MAG: 1e-6}  # fmt: skip


@pytest.fixture(scope="module")
def flown():
    return log_of_flight(20.0, flow_hz=100.0)


@pytest.fixture(scope="module")
def tables(flown):
    return quantised(flown.tables)


@pytest.fixture(scope="module")
def folder(tables, tmp_path_factory):
    return SyntheticLog(tables).write(tmp_path_factory.mktemp("csv") / "flight")


def written(path, log: DeckLog):
    path.write_bytes(log.content())
    return path


@pytest.mark.parametrize("version", [1, 2])
def test_every_sensor_reads_as_in_the_csv_folder(tables, folder, tmp_path, version):
    path = written(tmp_path / "log00", deck_log(tables, version))
    assert log_kind(path) == "crazyflie"
    log, known = open_log(path), open_log(folder)
    assert set(log.streams) == set(known.streams)
    for sensor in log.streams:
        assert largest_difference(log, known, sensor) < CLOSE[sensor], sensor
        assert np.allclose(log.streams[sensor].t_s, known.streams[sensor].t_s, atol=6e-4 if version == 1 else 1e-6)
    assert log.clock_start_s == pytest.approx(30.0)
    assert log.notes == (f"flow: {RAD_PER_COUNT:.6f} rad a count of the PMW3901, read every 10 ms",)
    assert [absence.what for absence in log.absences] == ["no GPS: a Crazyflie has none", "no gyro in the flow sensor"]


@pytest.mark.parametrize("version", [1, 2])
def test_the_replay_comes_out_as_that_of_the_csv_folder(tables, folder, tmp_path, version):
    """Dead reckoning on counts of 0.2 rad/s, over 20 s and 40 m: single precision moves what the gates take."""
    distance_m, speed_m_s = apart(folder, written(tmp_path / "log00", deck_log(tables, version)))
    assert distance_m < 0.1
    assert speed_m_s < 0.05


def test_the_counts_are_the_flow_of_the_flight(flown, tables):
    """The deck's whole counts add up to the flow that was seen, a count at most apart."""
    for axis in "xy":
        name = f"flow_{axis}_rad_s"
        apart_rad = np.cumsum(0.01 * (tables["flow"][name] - flown.tables["flow"][name]))
        assert np.abs(apart_rad).max() < RAD_PER_COUNT


def test_the_signs_of_the_flow_are_those_of_the_firmwares_own_model(tmp_path):
    """mm_flow.c: N_x = dt Npix/thetapix (v_x/z - w_y), N_y = dt Npix/thetapix (v_y/z + w_x) with FLU's v and w."""
    dt, forward, left, height, roll_rate, pitch_rate = 0.01, 3.0, 1.0, 0.5, 0.3, -0.2  # pitch rate of FLU: nose down
    pixels = 35.0 / 0.71674 * dt
    n_x, n_y = pixels * (forward / height - pitch_rate), pixels * (left / height + roll_rate)
    delta_x, delta_y = -10.0 * n_y, -10.0 * n_x  # flowdeck_v1v2.c: accpx = -deltaY, accpy = -deltaX, ten a pixel
    t = np.arange(50) * dt
    log = DeckLog().add("fixedFrequency", ["motion.deltaX(h)", "motion.deltaY(h)"], t, 0 * t + delta_x, 0 * t + delta_y)
    flow = read_crazyflie(written(tmp_path / "log", log)).streams[Sensor.FLOW_RATE].value[0]
    right, turn_x, turn_y = -left, roll_rate, -pitch_rate  # FRD
    assert flow[0] == pytest.approx(turn_x - right / height, abs=0.11)
    assert flow[1] == pytest.approx(turn_y + forward / height, abs=0.11)


def test_a_log_that_is_faster_than_the_sensor_has_each_reading_once(tmp_path):
    t = np.arange(500) * 0.002
    counts = np.repeat(np.arange(100.0) % 7, 5)
    log = DeckLog().add("fixedFrequency", ["motion.deltaX(h)", "motion.deltaY(h)"], t, counts, counts)
    flow = read_crazyflie(written(tmp_path / "log", log)).streams[Sensor.FLOW_RATE]
    assert len(flow) == 100
    assert flow.rejected == {"repeated": 400}
    assert np.allclose(flow.value[:, 0], -(np.arange(100.0) % 7) * RAD_PER_COUNT / 0.01)


def test_readings_that_the_firmware_leaves_out_are_left_out_and_counted(tmp_path):
    t = np.arange(20) * 0.01
    counts, mm = np.where(t > 0.15, 150.0, 3.0), np.where(t > 0.1, 8190.0, 700.0)
    log = DeckLog().add("a", ["motion.deltaX(h)", "motion.deltaY(h)", "range.zrange(H)"], t, counts, counts, mm)
    streams = read_crazyflie(written(tmp_path / "log", log)).streams
    assert streams[Sensor.FLOW_RATE].rejected["outlier"] == np.count_nonzero(counts > 100)
    assert streams[Sensor.RANGE].rejected["invalid"] == np.count_nonzero(mm > 5000)


def test_motion_capture_is_the_reference_and_the_estimators_state_the_autopilots(flown, tables, tmp_path):
    part = slice(1000, -1000, 20)
    truth = {"t_s": flown.t_s[part], **dict(zip("ned", flown.position[part].T, strict=True))}
    made = deck_log(tables, truth=truth)
    speed = flown.velocity[part]
    names = ("x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz")
    made.add("state", [f"stateEstimate.{name}(f)" for name in names],
             truth["t_s"] + 30.0, truth["n"], -truth["e"], -truth["d"], speed[:, 0], -speed[:, 1], -speed[:, 2],
             *(np.full(len(speed), value) for value in (np.cos(0.1), 0.0, 0.0, np.sin(0.1))))  # fmt: skip
    log = read_crazyflie(written(tmp_path / "log", made))
    assert log.truth_name == "motion capture (locSrv)"
    so = [np.interp(log.truth["t_s"], truth["t_s"], truth[axis]) for axis in "ned"]
    for name, known in zip(("pos_n_m", "pos_e_m", "pos_d_m"), so, strict=True):
        assert np.allclose(log.truth[name], known, atol=1e-3)
        assert np.allclose(log.autopilot[name], known, atol=1e-3)
    heading = 2.0 * np.arctan2(log.autopilot["qz"], log.autopilot["qw"])
    assert np.allclose(heading, -0.2, atol=1e-6)  # 0.2 rad to the left
    c, s = np.cos(-0.2), np.sin(-0.2)
    forward = c * speed[:, 0] + s * speed[:, 1]
    assert np.allclose(log.autopilot["vel_u_m_s"], forward, atol=1e-5)


def test_a_log_that_was_not_closed_is_read_as_far_as_it_goes(tables, tmp_path):
    content = deck_log(tables).content()
    (tmp_path / "log").write_bytes(content[: len(content) // 2])
    log = read_crazyflie(tmp_path / "log")
    assert 300 < len(log.streams[Sensor.IMU]) < 700
    assert log.notes[0] == "the checksum does not fit: the log was not closed, or is damaged"


@pytest.mark.parametrize(("content", "why"), [
    (b"\xbc\x03\x00\x01\x00", "version 3 of the micro SD deck's log; 1 and 2 are known"),
    (b"\xbc\x02\x00\xff\xff", "a damaged head (65535 kinds of blocks)"),
    (b"\xbc\x02\x00\x01\x00\x00\x00" + b"a" * 200, "a name without an end"),
    (b"\xbc\x02\x00\x01\x00\x00\x00fixed\0" + struct.pack("<H", 1) + b"acc.x(s)\0", "variable 'acc.x(s)'"),
    (DeckLog().add("fixed", ["pm.vbat(f)"], [1.0], [3.7]).content(), "it holds pm.vbat; log acc, gyro"),
])  # fmt: skip
def test_what_cannot_be_read_is_one_line(tmp_path, content, why):
    (tmp_path / "log").write_bytes(content)
    with pytest.raises(InputError) as error:
        read_crazyflie(tmp_path / "log")
    assert why in str(error.value)
    assert "\n" not in str(error.value)


def test_a_flow_instance_is_refused(tables, tmp_path):
    with pytest.raises(InputError, match="is of a Crazyflie, with one flow deck"):
        open_log(written(tmp_path / "log", deck_log(tables)), flow_instance=1)
