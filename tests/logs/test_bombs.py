"""Small files that would become large ones: one line, soon, in little memory."""

from __future__ import annotations

import bz2
import os
import sqlite3
import time
from contextlib import closing

import pytest

from blackbox_logs import blackbox_log
from blackbox_logs import quantised as box_tables
from crazyflie_logs import deck_log
from crazyflie_logs import quantised as deck_tables
from dataflash_files import dataflash_of
from flownav.core.errors import InputError
from flownav.logs.assembly import MOST_BYTES, content_of
from flownav.logs.csv_table import MOST_COLUMNS, MOST_HEADER_BYTES
from flownav.logs.holes import MOST_HOLE_BYTES, require_written
from flownav.logs.open_log import open_log
from flownav.logs.ros.bag import MCAP_MAGIC, Bag, TooLargeError, _rows, _Unpacking
from flownav.logs.ros.containers import ATTACHMENT, CHANNEL, CHUNK, MESSAGE, SCHEMA, messages
from fuzzing import FLOOR_BYTES, peak_bytes
from mavlink_logs import flight_log
from replay_logs import log_of_flight
from ros_bags import BagMaker, StoragePlugin, ros_flight
from ulog_files import ulog_of_flight

SOON_S = 5.0


@pytest.fixture
def folder(tmp_path):
    return log_of_flight(4.0).write(tmp_path / "log")


def refused(path):
    """The one line of a refusal that took little memory."""
    before = peak_bytes(anew=True)
    with pytest.raises(InputError) as error:
        open_log(path)
    assert peak_bytes() - before < FLOOR_BYTES
    assert "\n" not in str(error.value)
    return str(error.value)


def lengthened(path, size=4 << 30):
    """The file with nothing after it, which takes no room on the disk."""
    with path.open("r+b") as file:
        file.truncate(size)
    return path


def logs_of(flown):
    """The contents of a log in each format that is read whole, by file name."""
    return {
        "x.tlog": flight_log(4.0).content,
        "x.bbl": blackbox_log(box_tables(flown.tables, inav=True), inav=True).content(),
        "x.log": deck_log(deck_tables(flown.tables)).content(),
        "x.bin": dataflash_of(flown).content(),
        "x.ulg": ulog_of_flight(flown.tables).bytes(),
    }


def test_a_log_of_four_gigabytes_of_nothing_is_refused(folder, tmp_path):
    for name, content in logs_of(log_of_flight(4.0)).items():
        (tmp_path / name).write_bytes(content)
        assert f"{name}: larger than 1024 MB; cut the log into pieces" in refused(lengthened(tmp_path / name))
    lengthened(folder / "gps.csv")
    assert "gps.csv: larger than 1024 MB; cut the log into pieces" in refused(folder)


def holed(path, content, place, size=4 << 30):
    """A file whose content has a hole of nothing from a place on, which takes no room on the disk."""
    with path.open("wb") as file:
        file.write(content[:place])
        file.seek(size, os.SEEK_CUR)
        file.write(content[place:])
    return lengthened(path, len(content) + size)


def test_a_hole_of_a_gigabyte_in_a_log_is_refused(tmp_path):
    """Of 4 GB in bags, which have no largest size; of less than that in the logs that have one."""
    flown = log_of_flight(4.0)
    bags = ros_flight(flown.tables)
    contents = {"x.bag": bags.write_ros_1(tmp_path / "made.bag").read_bytes()}
    for storage in StoragePlugin:
        (file,) = (made for made in bags.write(tmp_path / storage.name, storage).iterdir() if made.suffix != ".yaml")
        contents[f"x{file.suffix}"] = file.read_bytes()
    logs = logs_of(flown)
    assert set(contents) == {"x.bag", "x.mcap", "x.db3"}
    for name, content in (contents | logs).items():
        for place in (4096, len(content) // 2, len(content)):
            path = holed(tmp_path / name, content, place, (4 << 30) if name in contents else (1 << 30) - len(content))
            begun = time.perf_counter()
            assert f"{name}: more than 16 MB of it, from byte " in (said := refused(path))
            assert said.endswith("were never written; copy it again, or cut it there")
            assert time.perf_counter() - begun < SOON_S


def test_a_small_hole_is_read_over(tmp_path):
    """As a recorder that reserves room before it writes leaves one at the end."""
    content = ulog_of_flight(log_of_flight(4.0).tables).bytes()
    path = holed(tmp_path / "x.ulg", content, len(content), MOST_HOLE_BYTES - (64 << 10))
    (tmp_path / "y.ulg").write_bytes(content)
    assert set(open_log(path).streams) == set(open_log(tmp_path / "y.ulg").streams)


def test_holes_that_the_file_system_does_not_tell_are_none(tmp_path, monkeypatch):
    path = holed(tmp_path / "x.log", b"x", 1, MOST_HOLE_BYTES + (1 << 20))
    with pytest.raises(InputError, match="never written"):
        require_written(path, path.stat().st_size)
    monkeypatch.delattr("os.SEEK_HOLE")
    require_written(path, path.stat().st_size)


def test_what_the_memory_does_not_hold_is_said(folder, monkeypatch):
    def none_left(self, *given):
        raise MemoryError

    class File:
        __enter__, __exit__ = (lambda self: self), (lambda self, *error: None)
        read = none_left

    monkeypatch.setattr("pathlib.Path.open", lambda self, *given: File())
    with pytest.raises(InputError, match=r"gps.csv: 0 MB do not fit into the memory; cut the log into pieces"):
        content_of(folder / "gps.csv", "a log")
    assert MOST_BYTES == 1 << 30


def test_a_first_line_of_three_million_columns_is_refused(folder):
    (folder / "gps.csv").write_bytes(b"t_s," * 3_000_000 + b"\n0\n")
    assert f"gps.csv: its first line has more than {MOST_HEADER_BYTES} bytes; a CSV table is needed" in refused(folder)
    (folder / "gps.csv").write_bytes(b"a," * 100_000 + b"\n0\n")
    assert f"gps.csv: 100001 columns; at most {MOST_COLUMNS} are read" in refused(folder)
    (folder / "gps.csv").write_bytes(b"x" * (MOST_HEADER_BYTES + 1))
    assert "its first line has more than" in refused(folder)


# -- bags ----------------------------------------------------------------------------------------------------------
ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT "


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    """A bag of one topic in SQLite."""
    made = BagMaker()
    made.put(0.0, "/chatter", "std_msgs/msg/String", made.kind("std_msgs/msg/String")(data="hello"))
    (file,) = made.write(tmp_path_factory.mktemp("bag") / "b", StoragePlugin.SQLITE3).glob("*.db3")
    return file.read_bytes()


@pytest.mark.parametrize(("table", "columns"), [
    ("messages", "i AS id, 1 AS topic_id, i AS timestamp, x'00' AS data FROM n"),
    ("messages", "i AS id, 2 AS topic_id, i AS timestamp, zeroblob(900000000) AS data FROM n"),
    ("topics", "i AS id, 'a' || i AS name, 'b' AS type, 'cdr' AS serialization_format FROM n"),
    ("message_definitions", "'a' AS topic_type, 'b' AS encoding, 'c' AS encoded_message_definition FROM n"),
])  # fmt: skip
def test_a_view_that_never_ends_is_no_table(tmp_path, base, table, columns):
    (tmp_path / "x.db3").write_bytes(base)
    with closing(sqlite3.connect(tmp_path / "x.db3")) as made, made:
        made.execute(f"DROP TABLE {table}")
        made.execute(f"CREATE VIEW {table.upper()} AS {ENDLESS}{columns}")
    assert f"x.db3: {table} is a view, no table of a ROS 2 bag; give it" in refused(tmp_path / "x.db3")


def test_nor_is_a_virtual_table(tmp_path, base):
    (tmp_path / "x.db3").write_bytes(base)
    with closing(sqlite3.connect(tmp_path / "x.db3")) as made, made:
        made.execute("DROP TABLE messages")
        made.execute("CREATE VIRTUAL TABLE messages USING fts4(topic_id, timestamp, data)")
    assert "messages is a virtual table, no table" in refused(tmp_path / "x.db3")


def test_a_column_that_makes_its_values_gives_no_more_than_the_file_holds(tmp_path, base):
    (tmp_path / "x.db3").write_bytes(base)
    with closing(sqlite3.connect(tmp_path / "x.db3")) as made, made:
        made.execute("DROP TABLE messages")
        made.execute("CREATE TABLE messages(id, topic_id, timestamp, data GENERATED ALWAYS AS (zeroblob(500000000)))")
        made.execute("INSERT INTO messages(id, topic_id, timestamp) VALUES (1, 1, 1)")
    bag, before = Bag(), peak_bytes(anew=True)
    assert list(messages(tmp_path / "x.db3", bag, lambda channel: True)) == []
    assert peak_bytes() - before < FLOOR_BYTES
    assert "x.db3: damaged (string or blob too big); what follows is left out" in bag.notes


def test_rows_end_where_the_file_would_be_full():
    """As of pages of a B-tree that lead to each other."""
    with closing(sqlite3.connect(":memory:")) as made, pytest.raises(sqlite3.DataError, match="more rows than its"):
        list(_rows(made, f"{ENDLESS}i FROM n", 1000))


@pytest.mark.parametrize("packing", ["BZ2", "LZ4"])
def test_a_chunk_of_ros_1_that_becomes_many_times_larger_is_left_out(tmp_path, packing):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store, file = get_typestore(Stores.ROS1_NOETIC), tmp_path / "x.bag"
    writer = Writer(file)
    writer.set_compression(getattr(Writer.CompressionFormat, packing))
    with writer:
        topic = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
        writer.write(topic, 1, bytes(96 << 20))
    assert file.stat().st_size < 1 << 19
    assert "no message can be read (x.bag: damaged (a chunk of" in (said := refused(file))
    assert said.endswith("; copy it again")


def test_streams_after_streams_do_not_become_a_chunk():
    """As of the case that was found: bzip2's library reads all that follow each other."""
    unpacking, packed = _Unpacking(1 << 20), bz2.compress(bytes(100_000))
    assert unpacking.bz2(packed * 10_000) == bytes(100_000)
    unpacking.left = 0
    with pytest.raises(TooLargeError):
        unpacking.bz2(packed)


def test_an_index_that_all_chunks_share_is_no_index(tmp_path):
    """Kilobytes of chunk infos, all of one chunk, whose entries are read for each of them."""
    made = ros_flight(log_of_flight(4.0).tables)
    content = made.write_ros_1(tmp_path / "x.bag").read_bytes()
    infos = content.rindex(b"op=\x06") - 8
    many = content[:infos].replace(b"chunk_count=\x01\x00", b"chunk_count=\x10\x27") + content[infos:] * 10_000
    (tmp_path / "x.bag").write_bytes(many)
    said = "no readable ROS 1 bag (its index has more entries than its bytes can hold); try `rosbag reindex`"
    assert said in refused(tmp_path / "x.bag")


def notes_on(path):
    """The notes on an MCAP file without a message, read soon and in little memory."""
    bag, before, begun = Bag(), peak_bytes(anew=True), time.perf_counter()
    assert list(messages(path, bag, lambda channel: True)) == []
    assert peak_bytes() - before < FLOOR_BYTES
    assert time.perf_counter() - begun < SOON_S
    return bag.notes


def test_zeros_are_no_records_of_mcap(tmp_path):
    """They were nine bytes each: 4 GB of them had no end."""
    path = holed(tmp_path / "x.mcap", MCAP_MAGIC, len(MCAP_MAGIC))
    assert notes_on(path) == [
        f"x.mcap: damaged (no record at byte 8 of {path.stat().st_size}); what follows is left out"
    ]


@pytest.mark.parametrize("kind", [SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT])
@pytest.mark.parametrize("whole", [True, False])
def test_a_record_of_gigabytes_is_not_read(tmp_path, kind, whole):
    stated = (4 << 30) if whole else 1 << 62
    content = MCAP_MAGIC + bytes([kind]) + stated.to_bytes(8, "little")
    path = holed(tmp_path / "x.mcap", content, len(content))
    with path.open("ab") as file:  # a channel behind it, which is read where its length was true
        channel = b"\1\0\0\0\1\0\0\0a\3\0\0\0cdr\0\0\0\0"
        file.write(bytes([CHANNEL]) + len(channel).to_bytes(8, "little") + channel)
    bag = Bag()
    list(messages(path, bag, lambda channel: True))
    assert {channel.topic for channel in bag.channels} == ({"a"} if whole else set())
    lost = "one record is damaged and left out" if whole else f"damaged (a record of {stated} bytes at byte 8 of "
    assert notes_on(path)[0].startswith(f"x.mcap: {lost}")


def test_a_chunk_in_a_chunk_is_damage(tmp_path):
    """Or each would unpack to hundreds more."""
    from mcap.writer import CompressionType, Writer

    file = tmp_path / "x.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE, chunk_size=1 << 20)
        writer.start(profile="ros2", library="other")
        writer.register_channel("/imu", "cdr", writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", b""))
        writer.add_message(1, 1, b"x", 1)
        writer.finish()
    content = file.read_bytes()
    start = content.index(b"\x06", 8 + 9 + int.from_bytes(content[9:17], "little"))
    size = int.from_bytes(content[start + 1 : start + 9], "little")
    inner = content[start : start + 9 + size]
    body = (
        bytes(16) + len(inner).to_bytes(8, "little") + bytes(4) + bytes(4) + len(inner).to_bytes(8, "little")
    ) + inner
    file.write_bytes(content[:start] + b"\x06" + len(body).to_bytes(8, "little") + body)
    bag = Bag()
    assert list(messages(file, bag, lambda channel: True)) == []
    assert bag.notes == ["x.mcap: one record is damaged and left out"]
