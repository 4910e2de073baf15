"""Logs of the Crazyflie's micro SD deck: both versions, units, signs, scale of the flow, and what is damaged."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from crazyflie_logs import RAD_PER_COUNT, DeckLog, deck_log, event_log, quantised
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.logs.crazyflie import read_crazyflie
from flownav.logs.open_log import log_kind, open_log
from replay_logs import SyntheticLog, log_of_flight
from replayed_alike import apart, estimate_of, largest_difference

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


# -- the estimator's events ------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def quick():
    """A flight with an IMU of 1 kHz, as the events have it; the first five seconds stand."""
    return log_of_flight(20.0, flow_hz=100.0, imu_hz=1000.0)


@pytest.fixture(scope="module")
def quick_tables(quick):
    return quantised(quick.tables)


@pytest.mark.parametrize("version", [1, 2])
def test_events_apart_are_the_readings_of_the_flight(quick, quick_tables, tmp_path, version):
    """Gyro and accelerometer of two blocks, a barometer at the gyro's rate, a flow without its still reads."""
    log = open_log(written(tmp_path / "log", event_log(quick_tables, version=version)))
    imu, known = log.streams[Sensor.IMU], quick_tables["imu"]
    assert np.allclose(imu.t_s, known["t_s"], atol=1e-3)
    for axis, name in enumerate("xyz"):
        assert np.allclose(imu.value[:, axis], known[f"gyro_{name}_rad_s"], atol=1e-5)
        assert np.allclose(imu.value[:, 3 + axis], known[f"accel_{name}_m_s2"], atol=0.02)  # 60 us, 1 ms in version 1
    baro, heights = log.streams[Sensor.BARO], quick_tables["baro"]["alt_m"]
    assert len(baro) < 250
    assert baro.rejected == {"repeated": 20_000 - len(baro)}
    assert np.array_equal(np.unique(baro.value), np.unique(heights.astype(np.float32)))
    assert np.allclose(log.streams[Sensor.RANGE].value[:, 0], quick_tables["range"]["range_m"], atol=1e-9)


def test_flow_has_its_reads_without_motion_again(quick_tables, tmp_path):
    log = open_log(written(tmp_path / "log", event_log(quick_tables)))
    flow, known = log.streams[Sensor.FLOW_RATE], quick_tables["flow"]
    row = np.rint(100.0 * (flow.t_s + log.clock_start_s - 30.0)).astype(int)
    for axis, name in enumerate("xy"):
        assert np.allclose(flow.value[:, axis], known[f"flow_{name}_rad_s"][row], atol=1e-9)
    moved = (known["flow_x_rad_s"] != 0) | (known["flow_y_rad_s"] != 0)
    assert len(row) == len(set(row))
    assert np.count_nonzero(~moved[row]) > 20
    assert set(range(np.flatnonzero(moved)[20], np.flatnonzero(moved)[-1])) <= set(row)  # in flight all
    assert f"; {np.count_nonzero(~moved[row])} reads without motion, which are no events, are put back" in log.notes[0]


@pytest.mark.parametrize("lost", [0.0, 0.05])
def test_a_log_of_events_replays_as_the_csv_folder_does(quick_tables, tmp_path, lost):
    """Also where the deck had no room for one block in twenty."""
    plain = {name: quick_tables[name] for name in ("imu", "flow", "range", "baro")}
    folder = SyntheticLog(plain).write(tmp_path / "csv")
    path = written(tmp_path / "log", event_log(quick_tables, lost=lost))
    later_s = 30.0 - open_log(path).clock_start_s
    ours, known = estimate_of(open_log(path)), estimate_of(open_log(folder))
    assert ours["t_s"][0] < 1.5  # on the ground, where the flow has no events
    for name, apart_m in (("pos_n_m", 1.0), ("pos_e_m", 1.0), ("pos_d_m", 0.05)):
        there = np.interp(ours["t_s"] - later_s, known["t_s"], known[name])
        assert np.abs(ours[name] - there).max() < apart_m  # of 40 m, on counts of 0.2 rad/s


def test_a_lost_block_of_a_fast_flow_is_no_standing(tmp_path):
    t = np.delete(np.arange(100) * 0.01, 50)
    fast, slow = np.full(99, 6.0), np.where(np.arange(99) % 2 == 0, 1.0, -1.0)
    for counts, rows in ((fast, 99), (slow, 100)):
        log = DeckLog().add("estFlow", ["motion.deltaX(h)", "motion.deltaY(h)"], t, counts, 0.0 * counts)
        flow = read_crazyflie(written(tmp_path / "log", log)).streams[Sensor.FLOW_RATE]
        assert len(flow) == rows
    assert flow.value[50, 0] == 0.0
    assert flow.t_s[50] == pytest.approx(0.5)


def test_of_a_long_silence_only_its_ends_are_reads_without_motion(tmp_path):
    """The sensor is silent as well where it sees nothing."""
    t = np.append(np.arange(50), 909 + np.arange(50)) * 0.011
    log = DeckLog().add("estFlow", ["motion.deltaX(h)", "motion.deltaY(h)"], t, np.ones(100), np.zeros(100))
    flow = read_crazyflie(written(tmp_path / "log", log)).streams[Sensor.FLOW_RATE]
    still = flow.t_s[flow.value[:, 0] == 0.0]
    assert np.allclose(still, np.append(49 + np.arange(1, 10), 909 - np.arange(9, 0, -1)) * 0.011, atol=1e-3)
    assert flow.value[0, 0] == pytest.approx(-RAD_PER_COUNT / 0.011)  # as often as the events follow each other
    assert (np.diff(flow.t_s) > 0).all()


def test_on_the_ground_all_reads_are_without_motion(tmp_path):
    """From the log's beginning on, so that the navigator starts where the vehicle stands and not at its take-off."""
    t = 5.0 + np.arange(50) * 0.01
    log = DeckLog().add("estFlow", ["motion.deltaX(h)", "motion.deltaY(h)"], t, np.ones(50), np.zeros(50))
    ranged = np.arange(0.0, 8.0, 0.025)
    log.add("estTOF", ["range.zrange(H)"], ranged, np.where(ranged < 4.0, 25.0, 400.0))
    flow = read_crazyflie(written(tmp_path / "log", log)).streams[Sensor.FLOW_RATE]
    still = flow.t_s[flow.value[:, 0] == 0.0]
    assert np.allclose(still[still < 3.99], np.arange(1, len(still[still < 3.99]) + 1) * 0.01)
    in_the_air = np.concatenate([np.arange(490, 500), np.arange(550, 560), np.arange(788, 798)])
    assert np.allclose(still[still > 4.0], 0.01 * in_the_air, atol=5e-3)  # the log ends at 7.975 s


def test_gyro_readings_without_an_accelerometer_near_by_are_left_out_and_counted(tmp_path):
    t = np.arange(2000) * 1e-3
    log = DeckLog().add("estGyroscope", [f"gyro.{axis}(f)" for axis in "xyz"], t, t, t, t)
    force = t[t < 1.0]
    log.add("estAcceleration", [f"acc.{axis}(f)" for axis in "xyz"], force, force, force, 1.0 + force)
    imu = read_crazyflie(written(tmp_path / "log", log)).streams[Sensor.IMU]
    assert imu.t_s[-1] == pytest.approx(1.0, abs=0.11)
    assert imu.rejected == {"no_accelerometer": 2000 - len(imu)}
    assert np.allclose(imu.value[:900, 5], -9.80665 * (1.0 + t[:900]), atol=1e-4)


def test_the_attitude_of_motion_capture_is_the_references(quick_tables, tmp_path):
    t = np.arange(0.0, 20.0, 0.01)
    yaw = 0.3 * t
    pose = {"t_s": t, "n": np.cos(t), "e": np.sin(t), "d": -0.1 * t, "qw": np.cos(0.5 * yaw), "qx": 0.0 * t,
            "qy": 0.0 * t, "qz": np.sin(0.5 * yaw)}  # fmt: skip
    log = open_log(written(tmp_path / "log", event_log(quick_tables, pose)))
    assert log.truth_name == "motion capture (locSrv)"
    assert np.allclose(log.truth["pos_e_m"], np.sin(t), atol=1e-6)
    heading = 2.0 * np.arctan2(log.truth["qz"], log.truth["qw"])
    assert np.allclose(np.unwrap(heading), yaw, atol=1e-5)


def test_the_short_form_of_the_estimators_state_is_in_millimetres(tmp_path):
    t = np.arange(100) * 0.01
    names = [f"stateEstimateZ.{name}(h)" for name in ("x", "y", "z", "vx", "vy", "vz")]
    log = DeckLog().add("fixedFrequency", ["baro.asl(f)", *names], t, 3.0 + t, *(1000.0 * k + 0 * t for k in range(6)))
    own = read_crazyflie(written(tmp_path / "log", log)).autopilot
    assert [own[name][0] for name in ("pos_n_m", "pos_e_m", "pos_d_m")] == [0.0, -1.0, -2.0]


def test_the_lighthouse_decks_position_is_a_reference_too(tmp_path):
    t = np.arange(100) * 0.01
    log = DeckLog().add("estBarometer", ["baro.asl(f)"], t, 3.0 + 0.1 * t)
    log.add("lhPosition", ["x(f)", "y(f)", "z(f)"], t, t, 2.0 * t, 3.0 * t)
    read = read_crazyflie(written(tmp_path / "log", log))
    assert read.truth_name == "the lighthouse deck"
    assert np.allclose(read.truth["pos_d_m"], -3.0 * t, atol=1e-6)


def test_a_range_at_the_rate_of_a_quick_block_is_each_reading_once(tmp_path):
    t = np.arange(1000) * 1e-3
    mm = 500.0 + np.floor(t / 0.025)
    log = DeckLog().add("fixedFrequency", ["range.zrange(H)"], t, mm)
    found = read_crazyflie(written(tmp_path / "log", log)).streams[Sensor.RANGE]
    assert np.allclose(found.value[:, 0], np.unique(mm) * 1e-3)


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
