"""DataFlash as columns: every format character, units, instances, slices, damage; pymavlink is the oracle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.DFReader import DFReader_binary, DFReader_text

from dataflash_files import HEAD, DataFlashWriter, as_text
from flownav.core.errors import InputError
from flownav.logs.dataflash import DataFlash, read_columns
from flownav.logs.dataflash.columns import text
from flownav.logs.dataflash.formats import CODES, DIVISORS

REAL = Path("dataflash") / "heli_sitl_takeoff_square_land.bin"
MOST_COMPARED = 1500
LIMITS = {
    "b": (-128, 127), "B": (0, 255), "h": (-(2**15), 2**15 - 1), "H": (0, 2**16 - 1), "i": (-(2**31), 2**31 - 1),
    "I": (0, 2**32 - 1), "q": (-(2**63), 2**63 - 1), "Q": (0, 2**64 - 1), "M": (0, 127), "c": (-327.68, 327.67),
    "C": (0, 655.35), "e": (-21474836.48, 21474836.47), "E": (0, 42949672.95), "L": (-180.0, 180.0),
    "f": (-1e30, 1e30), "d": (-1e300, 1e300), "g": (-65504.0, 65504.0),
}  # fmt: skip


def opened(tmp_path: Path, content: bytes) -> DataFlash:
    path = tmp_path / "log.bin"
    path.write_bytes(content)
    return DataFlash(path)


def ticks(count: int, writer: DataFlashWriter | None = None) -> DataFlashWriter:
    """Messages whose fields tell which they are."""
    writer = writer or DataFlashWriter()
    writer.define("TICK", "QBfI", "TimeUS,I,Half,N", "s#m-", "F-B-")
    for i in range(count):
        writer.put("TICK", i * 1000, i % 3, 0.5 * i, i)
    return writer


def assert_as_pymavlink(path: Path) -> None:
    """Every kind, number, field, unit factor and instance field as ArduPilot's own reader gives them."""
    log, theirs, messages = DataFlash(path), DFReader_binary(str(path)), {}
    while (message := theirs.recv_msg()) is not None:
        messages.setdefault(message.get_type(), []).append(message)
    theirs.close()
    assert set(log.names()) == set(messages)
    for name, of_kind in messages.items():
        known, table = log.formats[name], log.table(name)
        assert known.instance == of_kind[0].fmt.instance_field, name
        assert log.count(name) == len(of_kind), name
        some = range(0, len(of_kind), 1 + len(of_kind) // MOST_COMPARED)
        for label, code in zip(known.labels, known.codes, strict=True):
            expected = [getattr(of_kind[i], label) for i in some]
            ours = table[label][some.start : some.stop : some.step]
            if name == "FILE" and label == "Data":
                assert ours.tolist() == [value.rstrip(b"\0") for value in expected]
            elif code in "nNZ":
                assert text(ours) == expected, (name, label)
            else:
                assert (ours.dtype == float) == (code in DIVISORS or code == "d")
                assert np.array_equal(ours, np.array(expected, ours.dtype), equal_nan=code in "fdg"), (name, label)


def test_the_real_log_equals_pymavlink_in_every_kind_of_message(data_folder):
    assert_as_pymavlink(data_folder / REAL)


def test_every_format_character_equals_pymavlink(tmp_path):
    writer = DataFlashWriter()
    random = np.random.default_rng(5)
    cases: dict[str, list[object]] = {
        code: [low, high, 0, 1, low / 3 if code in "fdgcCeEL" else low // 3] for code, (low, high) in LIMITS.items()
    }
    cases |= {code: ["", "abc", "a\u00e9", b"ab\0c", b"\xff\xfe"] for code in "nNZ"}
    cases["a"] = [random.integers(-(2**15), 2**15, 32).tolist() for _ in range(5)]
    cases["g"] += [float("nan"), float("inf")]
    assert set(cases) == set(CODES)
    for code in cases:
        writer.define(f"X{ord(code)}", f"Q{code}", "TimeUS,Value", "s-", "F-")
    for code, values in cases.items():
        for i, value in enumerate(values):
            writer.put(f"X{ord(code)}", i, value)
    path = tmp_path / "all.bin"
    path.write_bytes(writer.content())
    assert_as_pymavlink(path)


def test_the_text_form_equals_pymavlinks(tmp_path):
    limits = {code: ends for code, ends in LIMITS.items() if code != "M"}
    writer = DataFlashWriter(units=False)
    writer.define("KIND", "".join(limits), ",".join(f"F{k}" for k in range(len(limits))))
    writer.define("MODE", "Mh", "Mode,ThrCrs")
    for share in (0.0, 0.1, 0.4, 0.9):
        values = [low + share * (high - low) for low, high in limits.values()]
        writer.put("KIND", *values)
        writer.put("MODE", 5, 3)
    path = tmp_path / "log.log"
    path.write_text(as_text(writer.content()))
    log, theirs = DataFlash(path), DFReader_text(str(path))
    table = log.table("KIND")
    for row in range(4):
        message = theirs.recv_match(type="KIND")
        for label in log.formats["KIND"].labels:
            assert table[label][row] == pytest.approx(float(getattr(message, label)), rel=1e-6), label
    theirs.close()
    assert log.table("MODE")["ThrCrs"].tolist() == [3] * 4  # the mode itself is a name, which a number field has not


def test_units_factors_and_instances_are_what_the_file_says(tmp_path):
    log = opened(tmp_path, ticks(9).content())
    known = log.formats["TICK"]
    assert known.units == {"TimeUS": "s", "I": "instance", "Half": "m", "N": ""}
    assert known.multipliers == {"TimeUS": 1e-6, "Half": 0.01}
    assert known.instance == "I"
    assert log.instances("TICK") == [0, 1, 2]
    assert log.table("TICK", ["N"], instance=1)["N"].tolist() == [1, 4, 7]
    assert log.instances("FMT") == log.instances("NONE") == []


def test_a_log_without_units_has_its_instances_by_their_customary_name(tmp_path):
    log = opened(tmp_path, ticks(9, DataFlashWriter(units=False)).content())
    assert log.instances("TICK") == [0, 1, 2]
    assert log.formats["TICK"].multipliers == {}


def test_a_time_slice_and_some_kinds_are_the_whole_cut_to_size(tmp_path):
    path = tmp_path / "log.bin"
    path.write_bytes(ticks(1000).content())
    whole = DataFlash(path).table("TICK")
    part = read_columns(path, {"TICK", "ABSENT"}, t0_s=0.25, t1_s=0.5)
    assert set(part) == {"TICK"}
    for label, values in whole.items():
        assert np.array_equal(part["TICK"][label], values[250:500])
    assert set(read_columns(path)) == {"FMT", "UNIT", "MULT", "FMTU", "TICK"}


def test_unknown_kinds_fields_and_instances_are_key_errors(tmp_path):
    writer = ticks(3)
    writer.define("BARE", "B", "Value")
    writer.put("BARE", 1)
    log = opened(tmp_path, writer.content())
    for asked in (
        lambda: log.table("NONE"),
        lambda: log.table("TICK", ["None"]),
        lambda: log.table("BARE", instance=0),
        lambda: log.table("BARE", t0_s=0.0),
    ):
        with pytest.raises(KeyError):
            asked()


# -- damage --------------------------------------------------------------------------------------------------
def test_header_bytes_inside_bodies_are_no_messages(tmp_path):
    writer = ticks(1)
    writer.define("TEXT", "QZ", "TimeUS,Message")
    kind = writer.types["TICK"][0]
    for i in range(50):
        writer.put("TEXT", i, (HEAD + bytes([kind])) * 21)
        writer.put("TICK", i, 0, 0.0, i)
    log = opened(tmp_path, writer.content())
    assert (log.count("TEXT"), log.count("TICK"), log.skipped_bytes) == (50, 51, 0)
    assert log.table("TICK", ["N"])["N"].tolist() == [0, *range(50)]


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_damage_costs_the_messages_it_touches_and_no_others(tmp_path_factory, data):
    """Bytes cut out or put in anywhere: every message not touched is still read, and every byte counts."""
    folder = tmp_path_factory.mktemp("damage")
    content = ticks(60).content()
    size = 3 + 17
    start = len(content) - 60 * size
    at = data.draw(st.integers(start, len(content) - 1))
    cut = data.draw(st.integers(0, 45))
    added = data.draw(st.binary(max_size=30)) if cut else data.draw(st.binary(min_size=1, max_size=30))
    damaged = content[:at] + added + content[at + cut :]
    log = opened(folder, damaged)
    first, last = (at - start) // size, (at + cut - start + size - 1) // size
    whole = [i for i in range(60) if i < first or i >= last]
    found = log.table("TICK", ["N"])["N"].tolist()
    if HEAD not in added and added[-1:] != HEAD[:1]:
        assert set(whole) <= set(found)
        assert len(found) <= len(whole) + 2
    known = {name: log.formats[name].dtype.itemsize * log.count(name) for name in log.names()}
    assert log.skipped_bytes == len(damaged) - sum(known.values())


def test_a_message_that_lost_bytes_is_thrown_away_not_read_askew(tmp_path):
    content = ticks(10).content()
    at = len(content) - 5 * 20 + 12  # inside the body of number 5
    log = opened(tmp_path, content[:at] + content[at + 2 :])
    assert log.table("TICK", ["N"])["N"].tolist() == [0, 1, 2, 3, 4, 6, 7, 8, 9]
    assert (log.skipped_bytes, log.gaps) == (18, 1)


def test_messages_of_an_unknown_type_are_counted_and_their_neighbours_kept(tmp_path):
    writer = DataFlashWriter()
    writer.define("TICK", "QI", "TimeUS,N")
    for i in range(20):
        writer.put("TICK", i, i)
        writer.parts.append(HEAD + bytes([250]) + bytes(11))
    log = opened(tmp_path, writer.content())
    assert log.table("TICK", ["N"])["N"].tolist() == list(range(20))
    assert (log.skipped_bytes, log.gaps) == (20 * 14, 20)


def test_a_log_cut_off_anywhere_yields_its_whole_messages(tmp_path):
    content = ticks(10).content()
    for lost in range(1, 60):
        log = opened(tmp_path, content[:-lost])
        assert log.table("TICK", ["N"])["N"].tolist() == list(range(10 - (lost + 19) // 20))
        assert log.skipped_bytes == -lost % 20


LIES = {
    "a length that is not its characters'": ("length", 99),
    "an unknown character": ("codes", "QBfX"),
    "fewer labels than characters": ("labels", "TimeUS,I,Half"),
    "a label twice": ("labels", "TimeUS,I,I,N"),
    "an empty label": ("labels", "TimeUS,,Half,N"),
    "a name that is none": ("name", "\x01\x02"),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_format_that_cannot_be_is_passed_over(tmp_path, lie):
    field, value = LIES[lie]
    entry = {"length": 20, "name": "LIE", "codes": "QBfI", "labels": "TimeUS,I,Half,N"} | {field: value}
    writer = ticks(5)
    writer.put("FMT", 240, entry["length"], entry["name"], entry["codes"], entry["labels"])
    writer.parts.append(HEAD + bytes([240]) + bytes(17))
    writer.put("TICK", 6000, 0, 0.0, 5)
    log = opened(tmp_path, writer.content())
    assert log.table("TICK", ["N"])["N"].tolist() == [0, 1, 2, 3, 4, 5]
    assert "LIE" not in log.names()
    assert log.skipped_bytes == 20


def test_a_format_that_contradicts_an_earlier_one_is_counted_and_passed_over(tmp_path):
    writer = ticks(5)
    kind = writer.types["TICK"][0]
    writer.put("FMT", kind, 12, "OTHR", "Qb", "TimeUS,N")
    writer.put("FMT", 241, 12, "TICK", "Qb", "TimeUS,N")
    log = opened(tmp_path, writer.content())
    assert log.contradictions == 2
    assert log.formats["TICK"].labels == ("TimeUS", "I", "Half", "N")
    assert log.count("TICK") == 5


@pytest.mark.parametrize(
    "content",
    [
        b"\0" * 5000,
        b"name,value\n1,2\n" * 50,
        HEAD * 1000,
        b"\xa3",
        DataFlashWriter().parts[0],
        DataFlashWriter().parts[0] + b"#",
    ],
)
def test_what_is_no_dataflash_log_is_refused_in_one_line(tmp_path, content):
    with pytest.raises(InputError, match=r"log\.bin: no ArduPilot DataFlash message in it; a \.bin log"):
        opened(tmp_path, content)


def test_files_that_cannot_be_read_are_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match=r"log\.bin: the file is empty"):
        opened(tmp_path, b"")
    with pytest.raises(InputError, match=r"none\.bin: cannot be read \(No such file"):
        DataFlash(tmp_path / "none.bin")
    with pytest.raises(InputError, match=r"cannot be read \(Is a directory\)"):
        DataFlash(tmp_path)
