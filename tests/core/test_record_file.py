"""A record's file is read within limits: one line whatever it is, and no more memory than a record needs."""

from __future__ import annotations

import io
import json
import os
import random
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from command import run
from flownav.core.errors import InputError
from flownav.core.marks import manifest_of
from flownav.core.record import Record
from flownav.core.record_file import ALWAYS_BYTES, MOST_BYTES, MOST_GROWTH, MOST_MANIFEST, _allowed
from flownav.logs.open_log import open_flight

MOST_MB = 300  # the library and pyarrow take 140; 500 are asked for
T_S = np.arange(5.0)


def parquet(columns, **options):
    buffer = io.BytesIO()
    pq.write_table(columns if isinstance(columns, pa.Table) else pa.table(columns), buffer, **options)
    return buffer.getvalue()


def bundle(path, members, manifest=None, **options):
    with zipfile.ZipFile(path, "w", **options) as made:
        if manifest is not False:
            made.writestr("manifest.json", json.dumps({"schema": 1}) if manifest is None else manifest)
        for name, data in members.items():
            made.writestr(name, data)
    return path


def refusal(path):
    with pytest.raises(InputError) as caught:
        Record.load(path)
    said = str(caught.value)
    assert said.startswith(str(path))
    assert len(said.splitlines()) == 1
    return said


@pytest.mark.parametrize(
    ("manifest", "said"),
    [
        (b"", "Expecting value"),
        (b"[]", "is no object"),
        (b"\xff\xfe\x00", "decode"),
        (b"[" * 100_000, "nested too deep"),
        (b'{"schema": "one"}', "schema: Input should be a valid integer"),
        (b'{"schema": -1}', "schema: Input should be greater"),
        (b'{"schema": 1, "kind": 7}', "kind: Input should be a valid string"),
        (b'{"schema": 1, "duration_s": "long"}', "duration_s"),
        (b'{"schema": 1, "duration_s": 1e999}', "duration_s"),
        (b'{"schema": 1, "scores": []}', "scores: Input should be a valid dictionary"),
        (b'{"schema": 1, "parameters": 4}', "parameters"),
        (b'{"schema": 1, "segments": [3]}', "segments.0"),
        (b'{"schema": 1, "segments": [{"use_imu": "yes"}]}', "segments.0"),
        (b'{"schema": 1, "delays_s": {"range": null}}', "delays_s.range"),
        (b'{"schema": 1, "command": {}}', "command"),
        (b'{"schema": ' + b"9" * 5000 + b"}", "digits"),
        (b'{"a": "' + b"x" * MOST_MANIFEST + b'"}', "would be"),
        (False, "There is no item named 'manifest.json'"),
    ],
)
def test_a_manifest_that_is_wrong_says_where(tmp_path, manifest, said):
    assert said in refusal(bundle(tmp_path / "x.fnr", {}, manifest))


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"pos_n_m": T_S}, "no t_s"),
        ({"t_s": ["a"] * 5}, "column t_s of table truth is of type string"),
        ({"t_s": T_S, "pos_n_m": ["a"] * 5}, "column pos_n_m of table truth is of type string"),
        ({"t_s": T_S, "extra": [[1.0]] * 5}, "column extra of table truth is of type list"),
        ({"t_s": T_S, "extra": [{"a": 1}] * 5}, "column extra of table truth is of type struct"),
        ({"t_s": T_S, "extra": [b"a"] * 5}, "column extra of table truth is of type binary"),
        (
            {"t_s": T_S, "extra": np.arange(5).astype("datetime64[ns]")},
            "column extra of table truth is of type timestamp",
        ),
        ({"t_s": T_S, "extra": pa.nulls(5)}, "column extra of table truth is of type null"),
        ({"t_s": T_S, "extra": pa.array([1, None, 2, 3, 4])}, "column extra has 1 cells without a number"),
        ({"t_s": T_S, "on_ground": pa.array([True, None, True, True, True])}, "column on_ground has 1 cells"),
        ({"t_s": T_S} | {f"c{i}": T_S for i in range(1000)}, "1001 columns"),
        (pa.Table.from_arrays([pa.array(T_S)] * 3, names=["t_s", "a", "a"]), "a column twice"),
    ],
)
def test_a_table_that_is_wrong_says_where(tmp_path, columns, said):
    assert said in refusal(bundle(tmp_path / "x.fnr", {"truth.parquet": parquet(columns)}))


def test_text_stands_where_text_belongs(tmp_path):
    events = {"t_s": T_S, "source": T_S, "kind": ["a"] * 5, "detail": ["b"] * 5, "value": T_S}
    assert "column source of table events is of type double" in refusal(
        bundle(tmp_path / "x.fnr", {"events.parquet": parquet(events)})
    )


@pytest.mark.parametrize(
    "name",
    ["../truth.parquet", "/etc/truth.parquet", "a/truth.parquet", "a\\b.parquet", "notes.txt", "truth.PARQUET",
     "\u0442ruth.parquet", "a b.parquet", ".parquet", f"{'a' * 65}.parquet"],
)  # fmt: skip
def test_a_part_of_another_name_is_refused(tmp_path, name):
    assert "it holds" in refusal(bundle(tmp_path / "x.fnr", {name: parquet({"t_s": T_S})}))


def test_two_parts_of_one_name_are_refused(tmp_path):
    path = bundle(tmp_path / "x.fnr", {"truth.parquet": parquet({"t_s": T_S})})
    with zipfile.ZipFile(path, "a") as made, pytest.warns(UserWarning, match="Duplicate"):
        made.writestr("truth.parquet", parquet({"t_s": T_S[:2]}))
    assert "two have one name" in refusal(path)


def test_a_name_that_is_not_utf8_is_refused(tmp_path):
    path = bundle(tmp_path / "x.fnr", {"tr\u00fcth.parquet": parquet({"t_s": T_S})})
    path.write_bytes(path.read_bytes().replace("tr\u00fc".encode(), b"tr\xff\xfe"))
    refusal(path)
    table = parquet({"t_s": T_S, "\u00fcber": T_S}, store_schema=False)
    refusal(bundle(tmp_path / "y.fnr", {"truth.parquet": table.replace("\u00fcber".encode(), b"\xff\xfeber")}))


def test_an_integer_of_many_digits_is_one_line(tmp_path):
    path = tmp_path / "x.fnr"
    Record({"seed": 2**64 - 1}).save(path)
    assert Record.load(path).manifest["seed"] == 2**64 - 1
    Record({"seed": 10**400}).save(path)
    with pytest.raises(InputError, match=r"manifest.json: an integer of 401 digits"):
        Record.load(path)


@pytest.mark.parametrize("packed", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2])
@pytest.mark.parametrize("damage", [0, 1])
def test_a_record_that_is_packed_otherwise_is_refused_whatever_its_bytes(tmp_path, packed, damage):
    """A damaged part that LZMA has packed raised LZMAError, which is no error of zip files."""
    path = tmp_path / "x.fnr"
    Record({"kind": "fly"}, {"events": {"t_s": np.arange(2.0)}}).save(path)
    with zipfile.ZipFile(path) as written:
        parts = {name: written.read(name) for name in written.namelist()}
    with zipfile.ZipFile(path, "w", packed) as again:
        for name, content in parts.items():
            again.writestr(name, content)
    content = bytearray(path.read_bytes())
    place = content.index(b"manifest.json") + 40
    content[place : place + 20] = bytes(byte ^ (255 * damage) for byte in content[place : place + 20])
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"manifest.json is packed in a way that no record is"):
        Record.load(path)
    assert manifest_of(path) is None


def test_columns_whose_lengths_differ_are_refused(tmp_path):
    """The footer's number of rows, changed: the pages have another."""
    table = bytearray(parquet({"t_s": np.arange(1000.0)}, compression=None, use_dictionary=False))
    length = int.from_bytes(table[-8:-4], "little")
    footer = bytes(table[-8 - length : -8])
    rows = bytes([0xD0, 0x0F])  # 1000, zigzag
    assert footer.count(rows) >= 3
    refused = 0
    for place in [i for i in range(len(footer)) if footer.startswith(rows, i)]:
        spoilt = bytearray(table)
        spoilt[len(table) - 8 - length + place] = 0xD2
        path = bundle(tmp_path / f"{place}.fnr", {"truth.parquet": bytes(spoilt)})
        try:
            assert len(Record.load(path).tables["truth"]["t_s"]) == 1000  # the column's own count, which serves nobody
        except InputError:
            refused += 1
    assert refused >= 2


def zeros_zipped(path, name):
    """1 GB of zeros as a part of a deflated zip of 1 MB."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as made:
        with made.open(name, "w") as part:
            for _ in range(1 << 10):
                part.write(bytes(1 << 20))
        if name != "manifest.json":
            made.writestr("manifest.json", b"{}")
    return path


def zero_rows(batches, **options):
    """A Parquet table of 4 million zeros a batch."""
    buffer, zeros = io.BytesIO(), pa.table({"t_s": np.zeros(1 << 22)})
    with pq.ParquetWriter(buffer, zeros.schema, **options) as writer:
        for _ in range(batches):
            writer.write_table(zeros, row_group_size=1 << 22)
    return buffer.getvalue()


def made_zip_bomb(path):
    return zeros_zipped(path, "truth.parquet")


def made_lying_zip_bomb(path):
    """The same, and the directory says 1 kB."""
    zeros_zipped(path, "truth.parquet")
    path.write_bytes(path.read_bytes().replace(struct.pack("<I", 1 << 30), struct.pack("<I", 1 << 10)))
    return path


def made_manifest_bomb(path):
    return zeros_zipped(path, "manifest.json")


def made_parquet_bomb(path):
    """1 GB of zeros in a Parquet table of 50 kB, as its footer says."""
    return bundle(path, {"truth.parquet": zero_rows(32, compression="zstd", use_dictionary=False)})


def made_run_length_bomb(path):
    """134 million rows of one value are a few bytes, compressed or not."""
    return bundle(path, {"truth.parquet": zero_rows(32, compression=None)})


def made_page_bomb(path):
    """A page of 200 MB whose footer says 1 kB: the sizes in the footer, changed."""
    table = parquet(
        {"t_s": [0.0], "text": ["x" * 200_000_000]}, compression="zstd", use_dictionary=False, store_schema=False,
        write_statistics=False,
    )  # fmt: skip
    length = int.from_bytes(table[-8:-4], "little")
    footer, group = table[-8 - length : -8], pq.ParquetFile(io.BytesIO(table)).metadata.row_group(0)
    for number in {group.column(1).total_uncompressed_size, group.total_byte_size}:
        footer = footer.replace(varint(2 * number), varint(2 * 1000, len(varint(2 * number))))
    table = table[: -8 - length] + footer + table[-8:]
    assert pq.ParquetFile(io.BytesIO(table)).metadata.row_group(0).column(1).total_uncompressed_size == 1000
    return bundle(path, {"truth.parquet": table})


def varint(number, width=0):
    found = bytearray()
    while number >= 0x80 or len(found) < width - 1:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*found, number])


def made_prefix_bomb(path):
    """Each of 50 000 texts is the one before: 500 MB of text in some kB."""
    columns = {
        "t_s": np.arange(50_000.0),
        "text": pa.DictionaryArray.from_arrays(np.zeros(50_000, int), ["x" * 10_000]),
    }
    encoding = {"text": "DELTA_BYTE_ARRAY"}
    table = parquet(columns, use_dictionary=False, column_encoding=encoding, compression="zstd", store_schema=False)
    return bundle(path, {"flags.parquet": table})


def made_directory_bomb(path):
    """A million entries in the zip's directory, all of the same part."""
    part = bundle(path, {"t.parquet": b""}).read_bytes()
    start = part.rindex(b"PK\x01\x02")
    end = part.rindex(b"PK\x05\x06")
    entries = part[start:end] * 1_000_000
    path.write_bytes(part[:start] + entries + part[end : end + 12] + struct.pack("<II", len(entries), start) + b"\0\0")
    return path


LOAD = """
import sys
from pathlib import Path
from flownav.core.record import Record
from flownav.core.errors import InputError
try:
    Record.load(Path(sys.argv[1]))
    print("read")
except InputError as error:
    print(str(error))
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(int(peak.split()[1]) // 1024)
"""


@pytest.mark.parametrize(
    "made",
    [made_zip_bomb, made_lying_zip_bomb, made_manifest_bomb, made_parquet_bomb, made_run_length_bomb, made_page_bomb,
     made_prefix_bomb, made_directory_bomb],
)  # fmt: skip
def test_a_small_file_that_would_become_a_large_one_is_refused_with_little_memory(tmp_path, made):
    path = made(tmp_path / "bomb.fnr")
    assert path.stat().st_size < 60e6
    done = subprocess.run(
        [sys.executable, "-c", LOAD, str(path)], capture_output=True, text=True, timeout=120, check=True
    )
    *said, peak_mb = done.stdout.splitlines()
    assert len(said) == 1
    assert said[0].startswith(f"{path}: not a flownav record")
    assert int(peak_mb) < MOST_MB


def test_a_text_that_repeats_is_read_once(tmp_path):
    """A dictionary of one word, 150 000 times: 75 MB more where each has its own copy."""
    words = pa.DictionaryArray.from_arrays(np.zeros(150_000, int), ["x" * 400])
    table = parquet({"t_s": np.arange(150_000.0), "text": words}, compression="zstd", store_schema=False)
    path = bundle(tmp_path / "x.fnr", {"flags.parquet": table})
    done = subprocess.run(
        [sys.executable, "-c", LOAD, str(path)], capture_output=True, text=True, timeout=120, check=True
    )
    said, peak_mb = done.stdout.splitlines()
    assert said == "read"
    assert int(peak_mb) < MOST_MB


def test_a_long_text_that_repeats_is_refused_before_anybody_shows_it(tmp_path):
    """A file of some kilobytes whose 1000 rows say 1.1 MB each would be a page of 1.1 GB."""
    words = pa.DictionaryArray.from_arrays(np.zeros(1000, int), ["x" * 1_100_000])
    table = parquet({"t_s": np.arange(1000.0), "text": words}, compression="zstd", store_schema=False)
    assert "its texts are 1100000000 characters" in refusal(bundle(tmp_path / "x.fnr", {"flags.parquet": table}))
    half = parquet({"t_s": np.arange(30.0), "text": ["x" * 1_100_000] * 30}, store_schema=False)
    several = bundle(tmp_path / "y.fnr", {"flags.parquet": half, "flags2.parquet": half, "flags3.parquet": half})
    assert "its texts are 33000000 characters" in refusal(several)


def test_two_hours_at_a_kilohertz_are_within_the_limits():
    """fed has a row for each reading: IMU 1 kHz, the rest 500 a second; with the sensors' tables and the estimates."""
    seconds = 7200
    memory = 8 * seconds * (1500 * 19 + 1000 * 8 + 500 * 6 + 50 * (19 + 61) + 700 * 10)
    assert memory < 0.5 * MOST_BYTES
    assert memory < _allowed(
        memory // 8
    )  # a file eight times smaller than its tables; those of flights are 2 to 3 times
    assert ALWAYS_BYTES < MOST_GROWTH * (4 << 20)


def test_what_was_saved_is_loaded_to_the_bit(tmp_path):
    record = Record({"kind": "fly", "duration_s": 1.0, "scores": {}})
    record.add("truth", {"t_s": T_S, "pos_n_m": np.array([1.0, np.nan, np.inf, -0.0, 5e-324])})
    words = {"source": np.array(["a", "", "\u00e9"]), "kind": ["x"] * 3, "detail": ["y"] * 3}
    record.add("events", {"t_s": T_S[:3], **words, "value": [np.nan] * 3})
    record.add("flags", {"t_s": T_S[:0], "mode": np.array([], str), "n": np.array([], np.int32)})
    record.add("text", {"t_s": T_S, "word": np.array(["a", None, "a", "b", None], object), "yes": T_S > 2})
    record.save(tmp_path / "x.fnr")
    found = Record.load(tmp_path / "x.fnr")
    assert found.manifest == {"schema": 1, **record.manifest}
    assert found.tables["truth"]["pos_n_m"].tobytes() == record.tables["truth"]["pos_n_m"].tobytes()
    for name, table in record.tables.items():
        for column, values in table.items():
            assert found.tables[name][column].tolist() == values.tolist() or name in ("truth", "events")
    assert found.tables["events"]["source"].tolist() == ["a", "", "\u00e9"]
    assert found.tables["flags"]["n"].dtype == np.int32


def test_a_record_zipped_again_by_another_tool_is_read(tmp_path):
    path = bundle(tmp_path / "x.fnr", {"truth.parquet": parquet({"t_s": T_S})}, compression=zipfile.ZIP_DEFLATED)
    assert Record.load(path).tables["truth"]["t_s"].tolist() == T_S.tolist()


def test_damaged_records_are_one_line(tmp_path):
    """Bytes changed, cut or doubled anywhere: a line, or a record whose columns are of one length."""
    record = Record({"kind": "live", "segments": [], "parameters": {}})
    record.add("fed", {name: np.random.default_rng(1).normal(size=50) for name in ("t_s", "arrival_s", "sensor")})
    record.add("events", {"t_s": T_S, "source": ["a"] * 5, "kind": ["b"] * 5, "detail": ["c"] * 5, "value": T_S})
    record.save(tmp_path / "good.fnr")
    good, random_, path = (tmp_path / "good.fnr").read_bytes(), random.Random(3), tmp_path / "bad.fnr"
    read = 0
    for _ in range(int(os.environ.get("FLOWNAV_FUZZ", "600"))):
        spoilt = bytearray(good)
        for _ in range(random_.choice((1, 1, 2, 8))):
            at = random_.randrange(len(spoilt))
            match random_.randrange(4):
                case 0:
                    spoilt[at] = random_.randrange(256)
                case 1:
                    spoilt[at] ^= 1 << random_.randrange(8)
                case 2:
                    del spoilt[at : at + random_.randrange(1, 200)]
                case 3:
                    spoilt[at:at] = spoilt[at : at + random_.randrange(1, 200)]
            if not spoilt:
                break
        path.write_bytes(bytes(spoilt))
        try:
            found = Record.load(path)
        except InputError as error:
            assert "\n" not in str(error)  # noqa: PT017
            continue
        read += 1
        for table in found.tables.values():
            assert len({len(column) for column in table.values()}) == 1
        with pytest.raises(InputError):
            open_flight(path)
    assert read < 300


def test_damaged_tables_in_a_whole_zip_are_one_line(tmp_path):
    """The zip's sums hold, so that all depends on the tables: pyarrow ends the process at some of these footers."""
    record = Record({"kind": "live"})
    record.add("truth", {name: np.arange(60.0) for name in ("t_s", "pos_n_m", "pos_e_m", "pos_d_m")})
    record.add("events", {"t_s": T_S, "source": ["a"] * 5, "kind": ["b"] * 5, "detail": ["c"] * 5, "value": T_S})
    record.save(tmp_path / "good.fnr")
    with zipfile.ZipFile(tmp_path / "good.fnr") as good:
        parts = {name: good.read(name) for name in good.namelist() if name != "manifest.json"}
    random_, read = random.Random(5), 0
    for _ in range(count := int(os.environ.get("FLOWNAV_FUZZ", "600"))):
        name = random_.choice(list(parts))
        spoilt = bytearray(parts[name])
        for _ in range(random_.choice((1, 2, 4))):
            spoilt[random_.randrange(len(spoilt))] = random_.randrange(256)
        try:
            found = Record.load(bundle(tmp_path / "bad.fnr", {**parts, name: bytes(spoilt)}))
        except InputError as error:
            assert "\n" not in str(error)  # noqa: PT017
            continue
        read += 1
        for table in found.tables.values():
            assert len({len(column) for column in table.values()}) == 1
    assert 0 < read < count


def test_a_path_that_is_no_file_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "x.fnr")
    assert "a FIFO (a named pipe) is not read" in refusal(tmp_path / "x.fnr")
    assert "a device is not read" in refusal(Path("/dev/zero"))


# -- times ---------------------------------------------------------------------------------------------------------
def of_times(path, t_s, table="estimate"):
    return bundle(path, {f"{table}.parquet": parquet({"t_s": np.asarray(t_s, float), "pos_n_m": np.zeros(len(t_s))})})


@pytest.mark.parametrize(("t_s", "said"), [
    ([0.0, 1.0, float("nan")], "table estimate: row 3 has the time nan s, which no clock shows"),
    ([0.0, float("-inf")], "table estimate: row 2 has the time -inf s, which no clock shows"),
    ([0.0, 1e12], "table estimate: row 2 has the time 1e+12 s, which no clock shows"),
    ([0.0, 2.0, 1.0], "table estimate: row 3 is earlier than the row before it"),
    ([0.0, 200_000.0], "it covers 0 to 200000 s, more than two days"),
])  # fmt: skip
def test_times_that_no_flight_has_are_refused(tmp_path, t_s, said):
    assert said in refusal(of_times(tmp_path / "a.fnr", t_s))


def test_tables_far_from_each_other_are_refused(tmp_path):
    tables = {name: parquet({"t_s": T_S + at_s}) for name, at_s in (("truth.parquet", 0.0), ("events.parquet", 1e9))}
    assert "more than two days" in refusal(bundle(tmp_path / "a.fnr", tables))


def test_what_stands_as_it_came_need_not_be_in_order_and_a_clock_may_show_unix_seconds(tmp_path):
    for table in ("fed", "events", "gps_position"):
        t_s = [1.7e9 + 1.0, 1.7e9]
        of_times(tmp_path / "a.fnr", t_s, table)
        columns = {"source": ["a"] * 2, "kind": ["b"] * 2, "detail": ["c"] * 2} if table == "events" else {}
        bundle(tmp_path / "a.fnr", {f"{table}.parquet": parquet({"t_s": t_s, **columns})})
        assert Record.load(tmp_path / "a.fnr").tables[table]["t_s"].tolist() == t_s
    assert len(Record.load(of_times(tmp_path / "a.fnr", [])).tables["estimate"]["t_s"]) == 0


@pytest.mark.parametrize("command", [["report"], ["export", "--to", "mcap"], ["export", "--to", "kml"]])
def test_commands_say_so_in_one_line(tmp_path, command):
    path = of_times(tmp_path / "a.fnr", [0.0, 1.0, float("nan")])
    done = run(command[0], path, *command[1:])
    assert done.returncode == 2
    assert "row 3 has the time nan s" in done.stderr
    assert len(done.stderr.splitlines()) == 1
