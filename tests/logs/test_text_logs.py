"""Logs as text: DataFlash as ground stations save it, and the CSV files of PX4's ulog2csv."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from dataflash_files import as_text, dataflash_of
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.lab.identification.job import is_flight
from flownav.logs.open_log import open_log
from replay_logs import log_of_flight
from ulog_files import ulog_of_flight

FMT_LABELS = "Type,Length,Name,Format,Columns"


def same_streams(first, second):
    """Every sensor's times and values."""
    assert set(first.streams) == set(second.streams)
    for sensor, stream in first.streams.items():
        other = second.streams[sensor]
        np.testing.assert_allclose(stream.t_s, other.t_s, atol=1e-6)
        np.testing.assert_allclose(stream.value, other.value, rtol=1e-5, atol=1e-5)


def cut(line, blank):
    """A line with its commas as another tool writes them, and every message's length as 40."""
    if not line.startswith("FMT,"):
        return line.replace(",", blank)
    name, kind, _, *rest = line.split(",", 5)
    return blank.join([name, kind, "40", *rest])


@pytest.mark.parametrize("blank", [", ", ","])
def test_a_text_without_fmts_own_line_and_with_invented_lengths_is_read(tmp_path, blank):
    binary = tmp_path / "flight.bin"
    binary.write_bytes(dataflash_of(log_of_flight(5.0)).content())
    lines = as_text(binary.read_bytes()).replace(", ", ",").splitlines()
    kept = [line for line in lines if not line.startswith(("FMT,128,", "UNIT", "MULT", "FMTU"))]
    text = tmp_path / "flight.log"
    text.write_text("\r\n".join(cut(line, blank) for line in kept) + "\r\n")
    same_streams(open_log(text), open_log(binary))


def test_numbers_that_a_spreadsheet_wrote_are_read(tmp_path):
    text = tmp_path / "log.log"
    kinds = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 130, 14, ATT, Qccc, TimeUS,Roll,Pitch,Yaw",
    ]
    text.write_text("\n".join([*kinds, *(f"ATT, {k}0000.0, 1.5, -2, 9.5E+01" for k in range(1, 99))]) + "\n")
    stream = open_log(text).streams[Sensor.ATTITUDE]
    np.testing.assert_allclose(stream.t_s, 0.01 * np.arange(98), atol=1e-9)


def test_a_heading_that_its_stated_16_bits_do_not_hold_is_read(tmp_path):
    text = tmp_path / "log.log"
    kind = "FMT, 130, 40, ATT, Qccc, TimeUS,Roll,Pitch,Yaw"
    headings = [359.9, 0.1, -0.2, 327.68] * 25
    text.write_text("\n".join([kind, *(f"ATT, {k}0000, 1.5, -2, {yaw}" for k, yaw in enumerate(headings))]) + "\n")
    w, x, y, z = open_log(text).streams[Sensor.ATTITUDE].value.T
    yaw_deg = np.degrees(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2)))
    np.testing.assert_allclose((yaw_deg - headings + 180.0) % 360.0, 180.0, atol=1e-6)


def topic_folder(tmp_path, log, name="flight"):
    """The files of PX4's own tool."""
    file = ulog_of_flight(log.tables).write(tmp_path / f"{name}.ulg")
    folder = tmp_path / "topics"
    tool = "import sys; from pyulog.ulog2csv import main; sys.exit(main())"
    subprocess.run([sys.executable, "-c", tool, "-o", str(folder), str(file)], check=True, capture_output=True)
    return file, folder


def test_ulog2csvs_folder_opens_as_the_ulog_does(tmp_path):
    file, folder = topic_folder(tmp_path, log_of_flight(5.0))
    log = open_log(folder)
    same_streams(log, open_log(file))
    assert log.clock_start_s == open_log(file).clock_start_s
    assert set(log.inputs) == {path.name for path in folder.iterdir()} & set(log.inputs) != set()
    assert any("no parameters" in note for note in log.notes)
    assert is_flight(folder)
    with pytest.raises(InputError, match="flow_instance 3 is not in the log"):
        open_log(folder, flow_instance=3)


def test_two_logs_in_one_folder_and_a_file_without_a_time_are_one_line(tmp_path):
    _, folder = topic_folder(tmp_path, log_of_flight(5.0))
    attitude = next(folder.glob("*_vehicle_attitude_0.csv"))
    other = folder / "other_vehicle_attitude_0.csv"
    other.write_bytes(attitude.read_bytes())
    with pytest.raises(InputError, match=r"files of several logs \(flight, other\)"):
        open_log(folder)
    other.unlink()
    attitude.write_text("time,q[0]\n1,2\n")
    with pytest.raises(InputError, match=r"vehicle_attitude_0\.csv: no column timestamp"):
        open_log(folder)
