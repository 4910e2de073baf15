"""Damaged, hostile and foreign ULog files: one line or a part of the log with what was skipped, never anything else."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.logs.log import Log
from flownav.logs.ulog import read_ulog
from replay_logs import log_of_flight
from ulog_files import UlogWriter, message, ulog_of_flight

HEAD = UlogWriter().bytes()[:16]
ATTITUDE = "vehicle_attitude:uint64_t timestamp;float[4] q;"


@pytest.fixture(scope="module")
def sound() -> bytes:
    return ulog_of_flight(log_of_flight(6.0).tables).bytes()


def read(content: bytes, folder: Path) -> Log:
    path = folder / "log.ulg"
    path.write_bytes(content)
    return read_ulog(path)


def complaint(content: bytes, folder: Path) -> str:
    with pytest.raises(InputError) as error:
        read(content, folder)
    assert "\n" not in str(error.value)
    assert str(folder / "log.ulg") in str(error.value)
    return str(error.value)


def announced(number: int, name: str) -> bytes:
    return message("A", struct.pack("<BH", 0, number) + name.encode())


def attitude_rows(count: int, number: int = 0, start_s: float = 1.0) -> bytes:
    stamps = [round(1e6 * (start_s + 0.02 * k)) for k in range(count)]
    return b"".join(message("D", struct.pack("<HQ4f", number, stamp, 1.0, 0.0, 0.0, 0.0)) for stamp in stamps)


@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_damage_is_one_line_or_a_part_of_the_log(sound, tmp_path, data):
    content = bytearray(sound)
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(content) - 1) | st.integers(0, 1500))
        length = data.draw(st.integers(1, 40) | st.integers(1, 30000))
        kind = data.draw(st.sampled_from(["cut", "drop", "fill", "noise"]))
        if kind == "cut":
            del content[max(at, 1) :]
        elif kind == "drop":
            del content[at : at + min(length, len(content) - 1)]
        else:
            filling = data.draw(st.binary(min_size=1, max_size=8))
            noise = np.random.default_rng(at).bytes(length) if kind == "noise" else (filling * length)[:length]
            content[at : at + length] = noise
    try:
        log = read(bytes(content), tmp_path)
    except InputError:
        complaint(bytes(content), tmp_path)
        return
    for stream in log.streams.values():
        assert len(stream) > 0
        assert np.all(np.diff(stream.t_s) >= 0)
        assert stream.t_s[0] >= 0.0
        assert np.isfinite(stream.value[:, :2]).any()


def test_only_what_a_hole_swallows_is_lost(sound, tmp_path):
    whole = read(sound, tmp_path)
    at = len(sound) // 2
    hurt = read(sound[:at] + bytes(2000) + sound[at + 2000 :], tmp_path)
    said = re.fullmatch(r"the file is damaged: (\d+) bytes in 1 places were skipped", hurt.notes[0])
    assert said
    assert 1900 < int(said[1]) < 2100
    lost = {s: len(whole.streams[s]) - len(hurt.streams[s]) for s in whole.streams}
    assert 20 < sum(lost.values()) < 80  # of some 40 bytes each
    assert all(hurt.streams[s].t_s[-1] == pytest.approx(whole.streams[s].t_s[-1]) for s in whole.streams)


def test_a_lying_length_does_not_swallow_the_rest(sound, tmp_path):
    at = sound.index(message("D", b"\0\0")[2:], len(sound) // 2) - 2  # a header somewhere behind the middle
    hurt = bytearray(sound)
    hurt[at : at + 2] = b"\xff\xff"
    assert read(bytes(hurt), tmp_path).span_s[1] == pytest.approx(read(sound, tmp_path).span_s[1])


def test_a_file_cut_within_a_message_says_so(sound, tmp_path):
    assert read(sound[:-5], tmp_path).notes == ("1 messages cut off at the end left out",)


def test_messages_of_kinds_to_come_are_passed_over(tmp_path):
    writer = UlogWriter().add("vehicle_attitude", np.arange(5) / 10, float__q=np.tile([1.0, 0, 0, 0], (5, 1)))
    content = writer.bytes() + message("Z", bytes(50)) + message("L", b"6" + bytes(8) + b"armed")
    log = read(content + attitude_rows(3, start_s=100.0), tmp_path)
    assert len(log.streams[Sensor.ATTITUDE]) == 8
    assert log.notes == ()


def test_data_behind_an_offset_is_read_although_the_part_before_is_cut(tmp_path):
    """After a crash PX4 appends to a file whose last message was never finished."""
    first = message("F", ATTITUDE.encode()) + announced(0, "vehicle_attitude") + attitude_rows(10) + b"\x20\x00D\x00"
    flags = bytes(8) + b"\x01" + bytes(7)
    offset = 16 + 43 + len(first)
    content = HEAD + message("B", flags + struct.pack("<3Q", offset, 0, 0)) + first + attitude_rows(7, start_s=3.0)
    log = read(content, tmp_path)
    assert len(log.streams[Sensor.ATTITUDE]) == 17
    assert log.notes == ("1 messages cut off at the end left out",)


def test_the_loggers_dropouts_are_said(tmp_path):
    content = HEAD + message("F", ATTITUDE.encode()) + announced(0, "vehicle_attitude") + attitude_rows(10)
    content += message("O", struct.pack("<H", 120)) + message("O", struct.pack("<H", 30)) + attitude_rows(5, 0, 2.0)
    log = read(content, tmp_path)
    assert log.notes == ("the logger states 2 dropouts, 0.15 s together, the longest 0.12 s",)


def test_padding_behind_the_data_is_no_damage(tmp_path):
    definition = message("F", b"vehicle_attitude:uint64_t timestamp;float[4] q;uint8_t[4] _padding0;")
    rows = b"".join(message("D", struct.pack("<HQ4f4x", 0, 1000000 + k, 1, 0, 0, 0)) for k in range(4))
    log = read(HEAD + definition + announced(0, "vehicle_attitude") + rows + attitude_rows(4, start_s=2.0), tmp_path)
    assert len(log.streams[Sensor.ATTITUDE]) == 8
    assert log.notes == ()


def test_a_message_id_stays_with_its_first_topic(tmp_path):
    definitions = message("F", ATTITUDE.encode()) + message("F", b"sensor_baro:uint64_t timestamp;float[4] altitude;")
    content = HEAD + definitions + announced(0, "vehicle_attitude") + announced(0, "sensor_baro") + attitude_rows(5)
    log = read(content, tmp_path)
    assert set(log.streams) == {Sensor.ATTITUDE}
    assert log.notes == ("1 message ids announced again for another topic left out",)


@pytest.mark.parametrize("definitions", [
    (b"vehicle_attitude:uint64_t timestamp;vehicle_attitude inner;",),
    (b"vehicle_attitude:uint64_t timestamp;a[60000] x;", b"a:b[60000] x;", b"b:float[60000] x;"),
    (b"vehicle_attitude:uint64_t timestamp;nobody x;",),
    (b"vehicle_attitude:uint64_t timestamp;float q;float q;",),
    (b"vehicle_attitude:uint64_t timestamp;float[0] q;",),
    (b"vehicle_attitude:uint32_t timestamp;float[4] q;",),
    (b"vehicle_attitude:uint64_t[1] timestamp;float[4] q;",),
    (b"vehicle_attitude:float[4] q;",),
    (b"vehicle_attitude:uint64_t timestamp;char[65000] q;",),
])  # fmt: skip
def test_definitions_that_cannot_be_are_not_believed(tmp_path, definitions):
    content = HEAD + b"".join(message("F", d) for d in definitions)
    said = complaint(content + announced(0, "vehicle_attitude") + attitude_rows(50), tmp_path)
    assert "no reading of any sensor that is known here" in said


@pytest.mark.parametrize(("content", "said"), [
    (b"", "not a ULog file (it is empty)"),
    (b"ULog", "not a ULog file (it does not begin as one)"),
    (b"t_s,roll_rad\n0,0\n" * 5, "not a ULog file (it does not begin as one)"),
    (HEAD, "no reading of any sensor that is known here"),
    (HEAD + message("B", bytes(8) + b"\x02" + bytes(31)) + bytes(50), "features that are not known here"),
    (HEAD + message("F", b"esc_status:uint64_t timestamp;") + announced(3, "esc_status"), "it holds esc_status"),
    (HEAD + message("F", ATTITUDE.encode()) + announced(0, "vehicle_attitude")
     + b"".join(message("D", struct.pack("<HQ4f", 0, 10**6 + k, 0, 0, 0, 0)) for k in range(9)),
     "every row is invalid"),
])  # fmt: skip
def test_files_without_a_usable_reading_are_one_line(tmp_path, content, said):
    assert said in complaint(content, tmp_path)


def test_a_file_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_ulog(tmp_path / "absent.ulg")


def test_reading_prints_nothing(sound, tmp_path, capsys):
    read(sound[:30000] + sound[31000:], tmp_path)
    assert capsys.readouterr() == ("", "")
