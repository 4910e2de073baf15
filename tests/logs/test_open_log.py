"""The kind of a path is recognised from its first bytes; a path that is no log is refused with the kinds that are."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from dataflash_files import dataflash_of
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.logs.open_log import log_kind, open_flight, open_log
from mavlink_logs import flight_log
from replay_logs import log_of_flight
from ulog_files import UlogWriter, ulog_of_flight

IN_2024_US = 1_717_000_000_000_000


def test_a_folder_a_ulog_and_a_dataflash_log_open_as_the_same_streams(tmp_path):
    flown = log_of_flight(5.0)
    folder, file = flown.write(tmp_path / "csv"), ulog_of_flight(flown.tables).write(tmp_path / "flight.ulg")
    flash = tmp_path / "flight.bin"
    flash.write_bytes(dataflash_of(flown, boot_s=40.0).content())
    logs = [open_log(path) for path in (folder, file, flash)]
    assert set(logs[0].streams) == set(logs[1].streams) == set(logs[2].streams)
    assert open_flight(file).path == file
    starts = [min(float(stream.t_s[0]) for stream in log.streams.values()) for log in logs]
    assert starts[1:] == [0.0, 0.0]
    assert [log.clock_start_s for log in logs] == [
        None,
        pytest.approx(5.0 + starts[0]),
        pytest.approx(40.0 + starts[0]),
    ]
    with pytest.raises(InputError, match=r"flow_instance: .*csv is a folder of CSV files"):
        open_log(folder, flow_instance=0)
    with pytest.raises(InputError, match="flow_instance 3 is not in the log"):
        open_log(file, flow_instance=3)


def test_a_telemetry_log_opens_on_the_vehicles_clock(tmp_path):
    log = open_flight(flight_log(boot_s=20.0).write(tmp_path / "flight.tlog"), flow_instance=0)
    assert log.clock_start_s == 0.0
    assert log.streams[Sensor.ATTITUDE].t_s[0] == pytest.approx(20.0)
    with pytest.raises(InputError, match="flow instance 3: the log has no such flow sensor"):
        open_log(log.path, flow_instance=3)


@pytest.mark.parametrize(("name", "head", "kind"), [
    ("flight.ulg", b"", "ulog"),
    ("flight.data", b"ULog\x01\x12\x35\x01" + bytes(8), "ulog"),
    ("00000012.BIN", b"\xa3\x95\x80\x80", "dataflash"),
    ("flight.tlog", b"", "tlog"),
    ("flight.raw", struct.pack(">QB", IN_2024_US, 0xFD), "tlog"),
    ("flight.raw", struct.pack(">QB", IN_2024_US, 0xFE), "tlog"),
    ("flight.raw", struct.pack(">QB", 12, 0xFE), ""),
    ("flight.bin", b"\x00\x01\x02\x03", ""),
    ("flight.bin", b"\x00\x01\x02\x03" + b"\xa3\x95\x80\x80", "dataflash"),
    ("flight.txt", b"hello", ""),
    ("flight.csv", b"", ""),
])  # fmt: skip
def test_the_kind_of_a_file(tmp_path, name, head, kind):
    (tmp_path / name).write_bytes(head)
    assert log_kind(tmp_path / name) == kind


def test_what_is_no_log_is_said_with_what_would_be(tmp_path):
    (tmp_path / "notes.txt").write_text("hello")
    known = (
        r"CSV files \(flownav's, or ulog2csv's\), a PX4 ULog \(.ulg\), an ArduPilot DataFlash log \(.bin, or .log as "
        r"text\), a MAVLink telemetry log \(.tlog\), "
        r"a ROS bag \(a folder, .db3, .mcap, .bag\), a Crazyflie's log, a Betaflight or INAV blackbox, "
        r"or a live session's record \(.fnr\)"
    )
    with pytest.raises(InputError, match=rf"notes.txt: not a log that is known; give a folder of {known}"):
        open_log(tmp_path / "notes.txt")
    with pytest.raises(InputError, match=rf"absent.ulg: no such log; give a folder of {known}"):
        open_log(tmp_path / "absent.ulg")


@pytest.mark.parametrize(("topics", "lacking"), [
    (("vehicle_attitude",), "GPS or optical flow"),
    (("sensor_gps",), "an attitude or an IMU"),
    (("vehicle_imu",), "GPS or optical flow"),
    (("vehicle_air_data",), "an attitude or an IMU and GPS or optical flow"),
])  # fmt: skip
def test_a_flight_needs_an_attitude_and_something_that_moves(tmp_path, topics, lacking):
    writer = ulog_of_flight(log_of_flight(5.0).tables)
    path = UlogWriter([topic for topic in writer.topics if topic.name in topics]).write(tmp_path / "part.ulg")
    assert open_log(path).streams
    with pytest.raises(InputError, match=f"the log lacks {lacking}, which a replay needs; `flownav info` shows"):
        open_flight(path)


def test_the_columns_of_a_ulog_are_finite_where_the_log_is(tmp_path):
    log = open_log(ulog_of_flight(log_of_flight(5.0).tables).write(tmp_path / "flight.ulg"))
    assert all(np.isfinite(stream.value).all() for sensor, stream in log.streams.items() if sensor != Sensor.LANDED)
