"""Damaged logs: a reader gives an InputError of one line or a sound Log, soon, in bounded memory, and nothing else.

`make fuzz` runs 20 000 of them; FLOWNAV_FUZZ sets another number, FLOWNAV_FUZZ_FIRST the first seed, and
FLOWNAV_FUZZ_FLIGHT_S how long the made flights are (1 s is read three times as fast). A failure names its seed:
`damaged(sample, seed)` is the same bytes again.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from blackbox_logs import blackbox_log
from blackbox_logs import quantised as box_tables
from crazyflie_logs import deck_log, event_log
from crazyflie_logs import quantised as deck_tables
from dataflash_files import HEAD, DataFlashWriter, as_text, blank, dataflash_of, old_dataflash_of
from fed_records import queue_of_flight, record_of
from flownav.core.errors import InputError
from flownav.export.formats import export
from flownav.logs.blackbox.reader import read_blackbox
from flownav.logs.crazyflie import read_crazyflie
from flownav.logs.csv_folder import read_csv_folder
from flownav.logs.dataflash import read_dataflash
from flownav.logs.dataflash.formats import CODES
from flownav.logs.dataflash.sensors import FIELDS
from flownav.logs.log import Log
from flownav.logs.mavlink_log import read_tlog
from flownav.logs.open_log import open_log
from flownav.logs.ros.reader import read_ros
from flownav.logs.ulog import read_ulog
from fuzzing import FIRST_SEED, MUTANTS, assert_promise, assert_sound
from log_mutations import mutate
from mavlink_logs import flight_log
from places import data_root
from replay_logs import SyntheticLog, log_of_flight
from ros_bags import px4_flight, ros_flight
from ulog_files import ulog_of_flight


@dataclass(frozen=True)
class Sample:
    """A small sound log: its files by name, and what reads it (a file's path, or the folder's)."""

    name: str
    suffix: str
    files: dict[str, bytes]
    read: Callable[[Path], Log]

    def put(self, folder: Path, changed: str, content: bytes) -> Path:
        """Write the files, one of them changed; what the reader takes."""
        if not self.suffix:
            for name, kept in self.files.items():
                (folder / name).write_bytes(content if name == changed else kept)
            return folder
        path = folder / f"log{self.suffix}"
        path.write_bytes(content)
        return path


FLIGHT_S = float(os.environ.get("FLOWNAV_FUZZ_FLIGHT_S", "6"))


def synthetic_flight() -> SyntheticLog:
    return log_of_flight(FLIGHT_S, imu_hz=25.0, attitude_hz=25.0)


def synthetic_dataflash() -> bytes:
    writer = dataflash_of(synthetic_flight())
    for at, event in ((42.0, 28), (45.0, 18)):
        writer.put("EV", at * 1e6, event)
    return writer.content()


def real_slice(name: str, head_bytes: int, from_byte: int, body_bytes: int) -> bytes | None:
    """The start of a real log, where it describes itself, and a piece of its flight."""
    path = data_root() / name
    if not path.is_file():
        return None
    with path.open("rb") as file:
        head = file.read(head_bytes)
        file.seek(from_byte)
        return head + file.read(body_bytes)


def other_formats(folder: Path, flown: SyntheticLog) -> list[Sample]:
    """Bags of ROS in both containers, our own export, the Crazyflie's deck, both blackboxes."""
    from rosbags.rosbag2 import StoragePlugin

    made = ros_flight(flown.tables)
    mcap, sqlite = made.write(folder / "mcap"), made.write(folder / "db3", StoragePlugin.SQLITE3)
    px4 = px4_flight(flown.tables).write(folder / "px4")
    record = record_of(queue_of_flight())
    record.add("estimate", {"t_s": np.arange(2.0), **{f"pos_{axis}_m": np.zeros(2) for axis in "ned"}})
    export(record, "mcap", folder / "ours.mcap")
    deck, events = (write(deck_tables(flown.tables)) for write in (deck_log, event_log))
    boxes = {name: blackbox_log(box_tables(flown.tables, inav), inav) for name, inav in BOXES.items()}
    return [
        Sample("ros mcap", ".mcap", {"": next(mcap.glob("*.mcap")).read_bytes()}, read_ros),
        Sample("px4 mcap", ".mcap", {"": next(px4.glob("*.mcap")).read_bytes()}, read_ros),
        Sample("ros sqlite", ".db3", {"": next(sqlite.glob("*.db3")).read_bytes()}, read_ros),
        Sample("our mcap", ".mcap", {"": (folder / "ours.mcap").read_bytes()}, read_ros),
        Sample(
            "ros 1 bag", ".bag", {"": ros_flight(flown.tables).write_ros_1(folder / "x.bag").read_bytes()}, read_ros
        ),
        Sample("crazyflie", ".log", {"": deck.content()}, read_crazyflie),
        Sample("crazyflie events", ".log", {"": events.content()}, read_crazyflie),
        *(Sample(name, ".bbl", {"": box.content()}, read_blackbox) for name, box in boxes.items()),
    ]


def samples(folder: Path) -> list[Sample]:
    """Every reader's samples: synthetic ones, and slices of the real logs that are at hand."""
    flown = synthetic_flight()
    csv = flown.write(folder / "csv")
    found = [
        Sample("csv", "", {file.name: file.read_bytes() for file in sorted(csv.iterdir())}, read_csv_folder),
        Sample("dataflash", ".bin", {"": synthetic_dataflash()}, read_dataflash),
        Sample("dataflash text", ".log", {"": as_text(old_dataflash_of(flown).content()).encode()}, read_dataflash),
        Sample("ulog", ".ulg", {"": ulog_of_flight(flown.tables).bytes()}, read_ulog),
        Sample("old ulog", ".ulg", {"": ulog_of_flight(flown.tables, old=True).bytes()}, read_ulog),
        Sample("tlog", ".tlog", {"": flight_log(6.0).content}, read_tlog),
        *other_formats(folder, flown),
    ]
    for name, (suffix, read, *where) in REAL.items():
        content = real_slice(*where)
        if content is not None:
            found.append(Sample(name, suffix, {"": content}, read))
    return found


# where a real log describes itself, and a piece of its flight: file, bytes at its start, from which byte, how many
HELI_BIN = "dataflash/heli_sitl_takeoff_square_land.bin"
REAL = {
    "real dataflash": (
        ".bin",
        read_dataflash,
        "dataflash/heli_sitl_takeoff_square_land.bin",
        90_000,
        3_000_000,
        90_000,
    ),
    "real ulog": (".ulg", read_ulog, "ulog/sample_log_small.ulg", 120_000, 200_000, 60_000),
    "real tlog": (".tlog", read_tlog, "mavlink/heli_sitl.tlog", 0, 600_000, 60_000),
}
BOXES = {"inav": True, "betaflight": False}
NAMES = ("csv", "dataflash", "dataflash text", "ulog", "old ulog", "tlog", "ros mcap", "px4 mcap", "ros sqlite",
         "our mcap", "ros 1 bag", "crazyflie", "crazyflie events", *BOXES, *REAL)  # fmt: skip


@pytest.fixture(scope="module")
def at_hand(tmp_path_factory) -> dict[str, Sample]:
    found = {sample.name: sample for sample in samples(tmp_path_factory.mktemp("samples"))}
    folder = tmp_path_factory.mktemp("compiled")
    for name in ("ulog", *BOXES):  # what is measured is the reading, not the compiler
        found[name].read(found[name].put(folder, "", found[name].files[""]))
    return found


def damaged(sample: Sample, seed: int) -> tuple[str, bytes]:
    """The file that a seed damages, and what becomes of it."""
    names = sorted(sample.files)
    changed = names[seed % len(names)]
    return changed, mutate(sample.files[changed], sample.files[names[(seed // 7) % len(names)]], seed)


@pytest.mark.fuzz
@pytest.mark.parametrize("name", NAMES)
def test_a_damaged_log_is_read_or_refused(at_hand, tmp_path, name):
    """By its reader, and every other one as any log, recognised from the rest of it."""
    if name not in at_hand:
        pytest.skip(f"the recorded logs hold no sample: {name}")
    sample = at_hand[name]
    for seed in range(FIRST_SEED, FIRST_SEED + -(-MUTANTS // len(at_hand))):
        changed, content = damaged(sample, seed)
        path = sample.put(tmp_path, changed, content)
        size = sum(map(len, sample.files.values())) + len(content)
        read = open_log if seed // len(sample.files) % 2 else sample.read
        assert_promise(read, path, size, f"{name}, seed {seed}")


@pytest.mark.parametrize("name", NAMES)
def test_the_samples_themselves_are_read(at_hand, tmp_path, name):
    """Without this, a reader that refused everything would pass."""
    if name not in at_hand:
        pytest.skip(f"the recorded logs hold no sample: {name}")
    sample = at_hand[name]
    first = sorted(sample.files)[0]
    path = sample.put(tmp_path, first, sample.files[first])
    read, opened = sample.read(path), open_log(path)
    assert_sound(read)
    assert {sensor: len(stream) for sensor, stream in opened.streams.items()} == {
        sensor: len(stream) for sensor, stream in read.streams.items()
    }


@pytest.mark.fuzz
@pytest.mark.parametrize(("name", "pattern"), [
    *(("dataflash", HEAD + rest) for rest in (b"", b"\x80", b"\x80" + b"A" * 7, b"\x84")),
    *(("ulog", struct.pack("<HB", size, kind)) for size in (0, 5, 9) for kind in b"DAFO"),
    *(("tlog", pattern) for pattern in (b"\xfd", b"\xfe", b"\xfd\x00" * 6, b"\xfe\xff")),
    *((name, pattern) for name in ("dataflash", "ulog", "tlog") for pattern in (b"\0", b"\xff")),
])  # fmt: skip
def test_a_megabyte_of_one_pattern_after_a_flight_is_soon_done(at_hand, tmp_path, name, pattern):
    sample = at_hand[name]
    content = sample.files[""] + pattern * (1_000_000 // len(pattern))
    assert_promise(sample.read, sample.put(tmp_path, "", content), len(content), repr(pattern))


KINDS = sorted({*FIELDS, "PARM", "ORGN", "XKF1", "XKF4", "SIM", "SIM2", "UNIT", "MULT", "FMTU"})
LABELS = sorted(
    {"TimeUS", "I", "C", "Id", "Mult", "Label", "FmtType", "UnitIds", "MultIds", "Name", "Value", "PI", "Type"}
    | {field.label for fields in FIELDS.values() for field in fields}
)
FORMATS = st.lists(st.tuples(st.sampled_from(sorted(CODES)), st.sampled_from(LABELS)), max_size=6).filter(
    lambda fields: len(blank("".join(code for code, _ in fields))) < 250
)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    kinds=st.lists(st.tuples(st.sampled_from(KINDS), FORMATS, st.binary(max_size=200)), max_size=8), flies=st.booleans()
)
def test_messages_that_are_not_what_their_names_say_are_no_other_error(tmp_path, kinds, flies):
    """Kinds with known names and any fields: text where numbers belong, arrays, instances of the wrong type."""
    writer = DataFlashWriter(units=False)
    for name, fields, noise in kinds:
        codes, labels = "".join(code for code, _ in fields), ",".join(label for _, label in fields)
        writer.define(name, codes, labels)
        kind = writer.types[name][0]
        size = len(blank(codes))
        for i in range(3):
            body = (noise[i:] + blank(codes))[:size]
            writer.parts.append(HEAD + bytes([kind]) + body)
    content = writer.content()
    if flies:
        content += dataflash_of(log_of_flight(2.0), DataFlashWriter()).content()
    path = tmp_path / "log.bin"
    path.write_bytes(content)
    try:
        assert_sound(read_dataflash(path))
    except InputError as error:
        said = str(error)
    else:
        said = ""
    assert "\n" not in said


@pytest.mark.parametrize(("suffix", "read"), [
    (".bin", read_dataflash), (".ulg", read_ulog), (".tlog", read_tlog), (".mcap", read_ros), (".db3", read_ros),
    (".bbl", read_blackbox), (".log", read_crazyflie),
])  # fmt: skip
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(max_size=2000))
def test_arbitrary_bytes_are_refused(tmp_path, suffix, read, content):
    path = tmp_path / f"log{suffix}"
    path.write_bytes(content)
    for reader in (read, open_log):
        with pytest.raises(InputError):
            reader(path)
