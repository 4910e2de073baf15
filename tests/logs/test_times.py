"""Times that no flight has, rows out of order, numbers that are none: refused in one line, or counted, or put right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fed_records import queue_of_flight, record_of
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.core.record import Record
from flownav.core.text import number
from flownav.logs.open_log import open_log
from mavlink_logs import flight_log
from replay_logs import SyntheticLog, log_of_flight
from ulog_files import ulog_of_flight


def complaint(path: Path) -> str:
    with pytest.raises(InputError) as said:
        open_log(path)
    assert "\n" not in str(said.value)
    return str(said.value)


@pytest.fixture
def flown() -> SyntheticLog:
    return log_of_flight(6.0)


def test_a_folder_of_microseconds_since_1970_is_refused(flown, tmp_path):
    for table in flown.tables.values():
        table["t_s"] = table["t_s"] + 1.8e13
    assert "no clock shows that in seconds" in complaint(flown.write(tmp_path / "log"))


def test_a_folder_of_unix_seconds_is_a_log(flown, tmp_path):
    for table in flown.tables.values():
        table["t_s"] = table["t_s"] + 1.7e9
    log = open_log(flown.write(tmp_path / "log"))
    assert log.span_s[1] - log.span_s[0] == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize("shift_s", [1e6, 1.8e13])
def test_a_topic_of_another_clock_is_left_out_and_said(flown, tmp_path, shift_s):
    flown.tables["baro"]["t_s"] = flown.tables["baro"]["t_s"] + shift_s
    (tmp_path / "x.ulg").write_bytes(ulog_of_flight(flown.tables).bytes())
    log = open_log(tmp_path / "x.ulg")
    assert log.span_s[1] - log.span_s[0] < 7.0
    assert Sensor.BARO not in log.streams
    assert any(note.startswith("baro is left out: its clock shows") for note in log.notes)


def test_a_ulog_whose_clock_leaps_is_refused(flown, tmp_path):
    for table in flown.tables.values():
        table["t_s"] = table["t_s"] + 1e12 * (table["t_s"] > table["t_s"][len(table["t_s"]) // 2])
    (tmp_path / "x.ulg").write_bytes(ulog_of_flight(flown.tables).bytes())
    assert "the clock has leapt" in complaint(tmp_path / "x.ulg")


@pytest.mark.parametrize(("change", "words"), [
    (lambda t: t * 1e13, "which no clock shows"),
    (lambda t: np.where(t > 6.0, t + 1.8e13, t), "which no clock shows"),
    (lambda t: np.where(t > 6.0, np.nan, t), "has the time nan s"),
])  # fmt: skip
def test_a_record_of_absurd_times_is_refused(tmp_path, change, words):
    record = record_of(queue_of_flight())
    for name in ("t_s", "arrival_s"):
        record.tables["fed"][name] = change(record.tables["fed"][name])
    record.save(tmp_path / "x.fnr")
    with pytest.raises(InputError, match=words):
        open_log(tmp_path / "x.fnr")


def test_readings_that_arrive_in_another_order_than_they_are_fed_are_a_stream_in_order(tmp_path):
    record = record_of(queue_of_flight(), kind="live")
    fed = record.tables["fed"]
    late = np.flatnonzero(fed["sensor"] == Sensor.RANGE)[::5]
    fed["arrival_s"] = fed["arrival_s"].copy()
    fed["arrival_s"][late] += 0.3
    record.save(tmp_path / "x.fnr")
    log = open_log(tmp_path / "x.fnr")
    for stream in log.streams.values():
        assert np.all(np.diff(stream.t_s) >= 0.0)
    assert np.array_equal(log.fed[0].queue.t_s, Record.load(tmp_path / "x.fnr").tables["fed"]["t_s"])


@pytest.mark.parametrize("text", ["1_000", "1_0.5", "\u0661", "1\u00a0000", "one", "0x10"])
def test_what_only_python_takes_for_a_number_is_none(text, flown, tmp_path):
    with pytest.raises(ValueError, match=r"."):
        number(text)
    folder = flown.write(tmp_path / "log")
    rows = (folder / "range.csv").read_text().splitlines()
    time, *others = rows[5].split(",")
    rows[5] = ",".join([time, text, *others[1:]])
    (folder / "range.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    stream = open_log(folder).streams[Sensor.RANGE]
    assert stream.rejected == {"not_finite": 1}


@pytest.mark.parametrize(("text", "value"), [("1", 1.0), (" -1.5e3 ", -1500.0), ("+.5", 0.5), ("5.", 5.0)])
def test_decimal_numbers_are_numbers(text, value):
    assert number(text) == value


def test_a_telemetry_log_with_one_absurd_time_still_has_its_span(tmp_path):
    path = flight_log(6.0).write(tmp_path / "x.tlog")
    log = open_log(path)
    assert log.span_s[1] - log.span_s[0] < 10.0
