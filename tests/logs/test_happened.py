"""A log's content besides its sensors: parameters, modes, source sets, messages, clipping, from three formats."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from dataflash_files import DataFlashWriter, dataflash_of
from flownav.logs.dataflash import read_dataflash
from flownav.logs.happened import (
    CLIPPING,
    FUSES_FLOW,
    MESSAGE,
    MODE,
    MOST_ROWS,
    PARAMETER,
    SOURCE_SET,
    changes,
    messages,
)
from flownav.logs.mavlink_log import read_tlog
from flownav.logs.ulog import read_ulog
from mavlink_logs import ARDUPILOT, PX4, flight_log, made
from replay_logs import log_of_flight
from ulog_files import START_US, message, ulog_of_flight


def test_a_state_stands_where_it_is_first_told_and_where_it_changes():
    rows = list(changes(MODE, np.arange(6.0), np.array([1.0, 1.0, 2.0, 2.0, 1.0, 1.0]), "mode {}".format))
    assert [(row.t_s, row.text, row.value) for row in rows] == [
        (0.0, "mode 1", 1.0),
        (2.0, "mode 2", 2.0),
        (4.0, "mode 1", 1.0),
    ]
    assert list(changes(MODE, np.zeros(0), np.zeros(0))) == []
    many = list(changes(CLIPPING, np.arange(5000.0), np.arange(5000.0)))
    assert len(many) == MOST_ROWS
    assert [row.t_s for row in changes(CLIPPING, np.arange(0.0, 3.0, 0.1), np.arange(30.0), least_s=1.0)][:2] == [
        0.0,
        1.0,
    ]


def test_a_message_that_is_repeated_at_once_stands_once():
    assert [row.text for row in messages([(0.0, "a"), (1.0, "a"), (2.0, "b"), (3.0, ""), (4.0, "a")])] == [
        "a",
        "b",
        "a",
    ]


def test_ulog_has_parameters_modes_messages_and_whether_flow_is_fused(tmp_path):
    writer = ulog_of_flight(log_of_flight(8.0).tables)
    writer.parameters = {"EKF2_OF_CTRL": 1, "EKF2_OF_QMIN": 3, "SENS_FLOW_SCALE": 1.25}
    writer.add("vehicle_status", [0.5, 2.0, 4.0], uint8_t__nav_state=[2, 2, 4])
    writer.add("estimator_status_flags", [0.5, 3.0], bool__cs_opt_flow=[False, True])
    writer.add("vehicle_imu_status", [1.0, 5.0], uint32_t__accel_clipping=np.array([[0, 0, 0], [3, 0, 4]]))
    logged = message("L", b"4" + struct.pack("<Q", START_US + 3_500_000) + b"[commander] Landing detected")
    path = tmp_path / "flight.ulg"
    path.write_bytes(writer.bytes() + logged)
    log = read_ulog(path)
    assert log.parameters == {"EKF2_OF_CTRL": 1.0, "EKF2_OF_QMIN": 3.0, "SENS_FLOW_SCALE": 1.25}
    by_kind = {
        kind: [row for row in log.happened if row.kind == kind] for kind in (MODE, FUSES_FLOW, CLIPPING, MESSAGE)
    }
    assert [row.text for row in by_kind[MODE]] == ["Position", "Hold"]
    assert [row.value for row in by_kind[FUSES_FLOW]] == [0.0, 1.0]
    assert [row.value for row in by_kind[CLIPPING]] == [0.0, 7.0]
    assert [row.text for row in by_kind[MESSAGE]] == ["[commander] Landing detected"]
    assert [row.t_s for row in log.happened] == sorted(row.t_s for row in log.happened)


def test_what_a_ulog_says_moves_no_time_of_its_sensors(tmp_path):
    plain = read_ulog(ulog_of_flight(log_of_flight(8.0).tables).write(tmp_path / "plain.ulg"))
    writer = ulog_of_flight(log_of_flight(8.0).tables).add("vehicle_status", [-2.0, 1.0], uint8_t__nav_state=[2, 4])
    told = read_ulog(writer.write(tmp_path / "told.ulg"))
    assert told.span_s == plain.span_s
    assert told.clock_start_s == plain.clock_start_s


def test_dataflash_has_modes_sets_messages_and_what_was_set_in_flight(tmp_path):
    writer = DataFlashWriter()
    writer.define("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn")
    writer.define("VIBE", "QBfffI", "TimeUS,IMU,VibeX,VibeY,VibeZ,Clip")
    dataflash_of(log_of_flight(8.0), writer)
    start = 40.0
    for t_s, mode in ((0.1, 0), (2.0, 5), (3.0, 5), (5.0, 9)):
        writer.put("MODE", round((start + t_s) * 1e6), mode, mode, 1)
    for t_s, event in ((2.5, 86), (6.0, 85)):
        writer.put("EV", round((start + t_s) * 1e6), event)
    writer.put("MSG", round((start + 1.0) * 1e6), "EKF3 IMU0 fusing optical flow")
    for t_s, clip in ((1.0, 0), (3.0, 5), (4.5, 9)):
        writer.put("VIBE", round((start + t_s) * 1e6), 0, 1.0, 1.0, 1.0, clip)
    writer.put("PARM", round((start + 4.0) * 1e6), "RNGFND1_MAX_CM", 900.0)
    path = tmp_path / "flight.bin"
    path.write_bytes(writer.content())
    log = read_dataflash(path)
    assert log.parameters["RNGFND1_MAX_CM"] == 900.0
    found = {
        kind: [(row.text, row.value) for row in log.happened if row.kind == kind]
        for kind in (MODE, SOURCE_SET, PARAMETER, CLIPPING, MESSAGE)
    }
    assert [text for text, _ in found[MODE]] == ["Stabilize", "Loiter", "Land"]
    assert [value for _, value in found[SOURCE_SET]] == [2.0, 1.0]
    assert found[PARAMETER] == [("RNGFND1_MAX_CM", 900.0)]
    assert [value for _, value in found[CLIPPING]] == [0.0, 5.0, 9.0]
    assert [text for text, _ in found[MESSAGE]] == ["EKF3 IMU0 fusing optical flow"]


def test_mavlink_has_parameters_as_their_autopilot_encodes_them(tmp_path):
    as_bits = struct.unpack("<f", struct.pack("<i", 7))[0]
    for make, sent, value in ((PX4, as_bits, 7.0), (ARDUPILOT, 7.0, 7.0)):
        log = flight_log(autopilot=make)
        for arrival_s, number in ((1.0, sent), (2.0, sent)):
            log.add(
                arrival_s,
                made("PARAM_VALUE", param_id=b"EKF2_GPS_CTRL", param_value=number, param_type=6, param_count=1),
            )
        log.add(2.5, made("STATUSTEXT", severity=6, text=b"EKF3 IMU0 stopped aiding"))
        read = read_tlog(log.write(tmp_path / f"{make}.tlog"))
        assert read.parameters == {"EKF2_GPS_CTRL": value}
        assert [row.text for row in read.happened if row.kind == MESSAGE] == ["EKF3 IMU0 stopped aiding"]
        assert not [row for row in read.happened if row.kind == PARAMETER]
        assert [row.kind for row in read.happened].count(MODE) == 1


def test_set_points_and_battery_of_a_ulog_stand_at_their_times(tmp_path):
    writer = ulog_of_flight(log_of_flight(8.0).tables)
    nan = float("nan")
    asked = {"float__x": [1.0, 2.0], "float__y": [nan, 3.0], "float__z": [-4.0, -5.0]}
    writer.add("vehicle_local_position_setpoint", [1.0, 2.0], **asked)
    writer.add("vehicle_attitude_setpoint", [1.5], float__q_d=np.array([[0.8, 0.0, 0.6, 0.0]]))
    writer.add("battery_status", [0.5, 6.0], float__voltage_v=[16.0, 15.0], float__current_a=[-1.0, 12.0])
    log = read_ulog(writer.write(tmp_path / "flight.ulg"))
    place, attitude = log.setpoints
    assert np.diff(place["t_s"]) == pytest.approx(1.0)
    assert place["pos_n_m"].tolist() == [1.0, 2.0]
    assert np.isnan(place["pos_e_m"][0])
    assert place["pos_d_m"].tolist() == [-4.0, -5.0]
    assert [attitude[name][0] for name in ("qw", "qx", "qy", "qz")] == pytest.approx([0.8, 0.0, 0.6, 0.0])
    assert log.battery["voltage_v"].tolist() == [16.0, 15.0]
    assert np.isnan(log.battery["current_a"][0])  # PX4's -1: not measured
    assert log.battery["current_a"][1] == 12.0
    plain = read_ulog(ulog_of_flight(log_of_flight(8.0).tables).write(tmp_path / "plain.ulg"))
    assert (plain.setpoints, plain.battery) == ((), None)
    assert plain.span_s == log.span_s


def test_set_points_and_battery_of_dataflash(tmp_path):
    writer = DataFlashWriter()
    writer.define("BAT", "QBff", "TimeUS,Inst,Volt,Curr")
    dataflash_of(log_of_flight(8.0), writer)
    for t_s, volt in ((1.0, 12.5), (4.0, 12.0)):
        writer.put("BAT", round((40.0 + t_s) * 1e6), 0, volt, 20.0)
    path = tmp_path / "flight.bin"
    path.write_bytes(writer.content())
    log = read_dataflash(path)
    assert log.battery["voltage_v"].tolist() == [12.5, 12.0]
    assert np.diff(log.battery["t_s"]) == pytest.approx(3.0)
    assert log.battery["current_a"].tolist() == [20.0, 20.0]


def test_the_position_that_ardupilot_asked_for_stands_beside_its_attitude(tmp_path):
    writer = DataFlashWriter()
    for axis in "NED":
        writer.define(f"PSC{axis}", "Qfff", f"TimeUS,DP{axis},TP{axis},P{axis}")
    dataflash_of(log_of_flight(8.0), writer)
    for k, t_s in enumerate((1.0, 2.0, 3.0)):
        for late_us, (axis, asked) in enumerate((("N", 1.0 + k), ("E", -2.0 - k), ("D", -5.0))):
            if (axis, k) != ("D", 0):
                writer.put(f"PSC{axis}", round((40.0 + t_s) * 1e6) + late_us, 0.0, asked, 0.5)
    path = tmp_path / "flight.bin"
    path.write_bytes(writer.content())
    place = read_dataflash(path).setpoints[0]
    assert np.diff(place["t_s"]) == pytest.approx([1.0, 1.0])
    assert place["pos_n_m"].tolist() == [1.0, 2.0, 3.0]
    assert place["pos_e_m"].tolist() == [-2.0, -3.0, -4.0]
    assert np.isnan(place["pos_d_m"][0])
    assert place["pos_d_m"][1:].tolist() == [-5.0, -5.0]


def test_the_position_that_an_old_ardupilot_asked_for_has_no_height(tmp_path):
    writer = DataFlashWriter()
    writer.define("PSC", "Qff", "TimeUS,TPX,TPY")
    dataflash_of(log_of_flight(8.0), writer)
    writer.put("PSC", 41_000_000, 3.0, 4.0)
    path = tmp_path / "flight.bin"
    path.write_bytes(writer.content())
    place = read_dataflash(path).setpoints[0]
    assert (place["pos_n_m"].tolist(), place["pos_e_m"].tolist()) == ([3.0], [4.0])
    assert np.isnan(place["pos_d_m"]).all()


def target(boot_s, mask, *place, frame=1):
    named = dict(zip("xyz", place, strict=True)) | dict.fromkeys(("vx", "vy", "vz", "afx", "afy", "afz"), 0.0)
    told = {"time_boot_ms": round(1e3 * boot_s) + 20_000, "coordinate_frame": frame, "type_mask": mask}
    return made("POSITION_TARGET_LOCAL_NED", **told, **named, yaw=0.0, yaw_rate=0.0)


def test_set_points_and_battery_of_a_tlog(tmp_path):
    log = flight_log(autopilot=PX4)
    log.add(1.0, target(1.0, 0, 1.0, 2.0, -3.0))
    log.add(2.0, target(2.0, 4, 1.5, 2.5, 9.0))
    log.add(2.1, target(2.1, 0, 7.0, 7.0, 7.0, frame=8))  # about the body
    log.add(2.2, target(2.2, 7, 7.0, 7.0, 7.0))
    turned = {"q": [0.8, 0.0, 0.6, 0.0], **dict.fromkeys(("body_roll_rate", "body_pitch_rate", "body_yaw_rate"), 0.0)}
    log.add(3.0, made("ATTITUDE_TARGET", time_boot_ms=23_000, type_mask=0, thrust=0.5, **turned))
    log.add(3.1, made("ATTITUDE_TARGET", time_boot_ms=23_100, type_mask=128, thrust=0.5, **turned))
    for arrival_s, millivolts in ((4.0, 15_200), (5.0, 65_535)):
        log.add(arrival_s, made("SYS_STATUS", voltage_battery=millivolts, current_battery=-1, battery_remaining=80))
    log.frames.sort(key=lambda frame: frame[0])
    read = read_tlog(log.write(tmp_path / "flight.tlog"))
    place, attitude = read.setpoints
    assert np.diff([*place["t_s"], *attitude["t_s"]]) == pytest.approx([1.0, 1.0], abs=0.03)
    assert place["pos_n_m"].tolist() == [1.0, 1.5]
    assert place["pos_d_m"][0] == -3.0
    assert np.isnan(place["pos_d_m"][1])
    assert attitude["qy"] == pytest.approx([0.6], abs=1e-6)
    assert read.battery["voltage_v"] == pytest.approx([15.2])
    assert np.isnan(read.battery["current_a"]).all()
    assert read.battery["remaining_percent"].tolist() == [80.0]


@pytest.mark.parametrize(("make", "tables"), [(ARDUPILOT, 1), (PX4, 0)])
def test_arducopters_target_attitude_stands_in_nav_controller_output(tmp_path, make, tables):
    log = flight_log(autopilot=make)
    others = {"target_bearing": 0, "wp_dist": 0, "alt_error": 0.0, "aspd_error": 0.0, "xtrack_error": 0.0}
    log.add(2.0, made("NAV_CONTROLLER_OUTPUT", nav_roll=0.0, nav_pitch=0.0, nav_bearing=90, **others))
    read = read_tlog(log.write(tmp_path / "flight.tlog"))
    assert len(read.setpoints) == tables
    for attitude in read.setpoints:
        assert attitude["qw"] == pytest.approx([np.sqrt(0.5)])
        assert attitude["qz"] == pytest.approx([np.sqrt(0.5)])
