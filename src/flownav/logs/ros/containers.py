"""A bag's messages, whatever file or folder they lie in; an MCAP file is read record by record from its start.

So an MCAP file that was cut off, or has no index, is read as far as it goes (https://mcap.dev/spec). A length that lies
ends the reading, sizes are held to limits before anything is unpacked.
"""

import struct
from collections.abc import Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.logs.holes import require_written
from flownav.logs.ros.bag import (
    MCAP_MAGIC,
    ROS1_MAGIC,
    SQLITE_MAGIC,
    Bag,
    Channel,
    Message,
    Wanted,
    one_line,
    ros1_messages,
    sqlite_messages,
)

SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT, DATA_END = 3, 4, 5, 6, 9, 15
LARGEST_CHUNK, LARGEST_RATIO = 256 << 20, 200  # bytes, and times the packed size: recorders write chunks of a few MB
LARGEST_ATTACHMENT, LARGEST_DEFINITION, MOST_CHANNELS = 16 << 20, 1 << 20, 65536
LARGEST_MESSAGE = 64 << 20  # chosen: no topic that is read carries pictures
LARGEST = {  # bytes of a record, before anything of it is read; what is larger is left out
    SCHEMA: LARGEST_DEFINITION + (1 << 16), CHANNEL: LARGEST_DEFINITION, MESSAGE: LARGEST_MESSAGE,
    CHUNK: LARGEST_CHUNK + (1 << 16), ATTACHMENT: LARGEST_ATTACHMENT,
}  # fmt: skip


class Damage(Exception):
    """A record that contradicts its own header."""


class _Walk:
    """The schemas and channels read so far, by number."""

    def __init__(self, bag: Bag, wanted: Wanted) -> None:
        self.bag, self.wanted = bag, wanted
        self.schemas: dict[int, tuple[str, str, str]] = {}
        self.channels: dict[int, Channel] = {}
        self.taken: set[int] = set()
        self.lost, self.unpacking = 0, False

    def records(self, content: Any, start: int, end: int) -> Iterator[Message]:
        """The messages among the records from `start` to `end`. Damage where a record reaches beyond."""
        while start + 9 <= end:
            kind, length = content[start], int.from_bytes(content[start + 1 : start + 9], "little")
            begin, stop = start + 9, start + 9 + length
            if kind == 0:  # no kind of the format: zeros, where nothing was written
                raise Damage(f"no record at byte {start} of {end}")
            if stop > end:
                if kind == CHUNK and end - begin <= LARGEST[CHUNK]:  # cut off in its middle: what is there of it
                    yield from self._other(kind, content[begin:end])
                raise Damage(f"a record of {length} bytes at byte {start} of {end}")
            if length > LARGEST.get(kind, length):
                self.lost += 1
            elif kind == MESSAGE:
                if length >= 22:
                    number, _, log_ns, _ = struct.unpack_from("<HIQQ", content, begin)
                    if number in self.taken:
                        yield Message(self.channels[number], log_ns, bytes(content[begin + 22 : stop]))
            elif kind == DATA_END:
                return
            else:
                yield from self._other(
                    kind, content[begin:stop] if kind in (SCHEMA, CHANNEL, CHUNK, ATTACHMENT) else b""
                )
            start = stop

    def _other(self, kind: int, record: bytes) -> Iterator[Message]:
        try:
            if kind == SCHEMA:
                number, name, encoding, data = _fields(record, "HSSB")
                if len(data) <= LARGEST_DEFINITION:
                    self.schemas[number] = (name, encoding, data.decode(errors="replace"))
            elif kind == CHANNEL and len(self.channels) < MOST_CHANNELS:
                number, schema, topic, encoding = _fields(record, "HHSS")
                name, definition_kind, definition = self.schemas.get(schema, ("", "", ""))
                channel = Channel(one_line(topic), ros2_name(name), encoding, definition, definition_kind)
                self.channels[number] = channel
                self.bag.channels.add(channel)
                self.taken.add(number) if self.wanted(channel) else self.taken.discard(number)
            elif kind == ATTACHMENT and len(record) <= LARGEST_ATTACHMENT:
                _, _, name, _, data = _fields(record, "QQSSL")
                self.bag.attachments.setdefault(name, data)
            elif kind == CHUNK:
                if self.unpacking:
                    raise Damage("a chunk in a chunk")
                unpacked = _unpacked(record)
                self.unpacking = True
                try:
                    yield from self.records(unpacked, 0, len(unpacked))
                finally:
                    self.unpacking = False
        except (Damage, struct.error, UnicodeDecodeError):
            self.lost += 1


def mcap_messages(path: Path, bag: Bag, wanted: Wanted) -> Iterator[Message]:
    """The wanted messages of an MCAP file; damage is stated in the bag's notes. InputError where it cannot be read."""
    walk = _Walk(bag, wanted)
    try:
        with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as content:
            try:
                yield from walk.records(content, len(MCAP_MAGIC), len(content))
            except Damage as damage:
                bag.notes.append(f"{path.name}: damaged ({damage}); what follows is left out")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if walk.lost:
        records = "one record is" if walk.lost == 1 else f"{walk.lost} records are"
        bag.notes.append(f"{path.name}: {records} damaged and left out")


def ros2_name(kind: str) -> str:
    """ROS 1's "sensor_msgs/Imu" as ROS 2 spells it; everything else as it is."""
    parts = kind.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else kind


def _fields(record: bytes, layout: str) -> list[Any]:
    """Numbers (H, Q), texts with their length before them (S), bytes with a length of four (B) or eight (L)."""
    found: list[Any] = []
    place = 0
    for code in layout:
        if code in "HQ":
            found.append(struct.unpack_from(f"<{code}", record, place)[0])
            place += struct.calcsize(f"<{code}")
            continue
        width = 8 if code == "L" else 4
        length = int.from_bytes(record[place : place + width], "little")
        place += width
        if place + length > len(record):
            raise Damage("a text longer than its record")
        part = bytes(record[place : place + length])
        found.append(part.decode() if code == "S" else part)
        place += length
    return found


def _unpacked(record: bytes) -> bytes:
    """The records of a chunk. Damage where they cannot be unpacked, or are larger than stated or than chunks are."""
    size = struct.unpack_from("<Q", record, 16)[0]
    name_length = struct.unpack_from("<I", record, 28)[0]
    if name_length > 16:
        raise Damage("a chunk's compression")
    name = bytes(record[32 : 32 + name_length])
    packed = bytes(record[40 + name_length :])
    if size > LARGEST_CHUNK or (name and size > LARGEST_RATIO * max(len(packed), 4096)):
        raise Damage(f"a chunk of {size} bytes")
    if name == b"":
        return packed
    try:
        if name == b"zstd":
            import zstandard

            with zstandard.ZstdDecompressor(max_window_size=LARGEST_CHUNK).stream_reader(packed) as reader:
                return bytes(reader.read(size))
        if name == b"lz4":
            from lz4.frame import LZ4FrameDecompressor

            return bytes(LZ4FrameDecompressor().decompress(packed, max_length=size))
    except ImportError as error:
        raise InputError("a compressed MCAP file needs lz4 and zstandard: pip install 'flownav[ros]'") from error
    except Exception as error:  # of either library, whatever it is called
        raise Damage("a chunk that cannot be unpacked") from error
    raise Damage(f"a chunk packed by {name!r}")


# -- files and folders --------------------------------------------------------------------------------------
def is_bag_folder(folder: Path) -> bool:
    """Whether a folder holds a ROS 2 bag: its files beside metadata.yaml, or alone."""
    try:
        return any(file.suffix.lower() in (".mcap", ".db3") for file in folder.iterdir())
    except OSError:
        return False


def files_of(path: Path) -> list[Path]:
    """The files of a bag, in the order of their names. InputError where a folder holds none that can be read."""
    if not an_input(path).is_dir():
        return [_written(path)]
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in (".mcap", ".db3"))
    packed = sorted(file.name for file in path.iterdir() if file.name.endswith((".db3.zstd", ".mcap.zstd")))
    if packed:
        raise InputError(f"{path}: {packed[0]} is compressed as a whole; unpack it first (unzstd {packed[0]})")
    if not files:
        raise InputError(f"{path}: no .mcap or .db3 file in it; a ROS 2 bag's folder is needed")
    return [_written(an_input(file)) for file in files]


def _written(file: Path) -> Path:
    """The file. InputError where much of it is a hole."""
    try:
        require_written(file, file.stat().st_size)
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror}); see who may read it") from error
    return file


def messages(path: Path, bag: Bag, wanted: Wanted) -> Iterator[Message]:
    """The wanted messages of one file, in the order in which they lie. InputError where it cannot be read at all."""
    try:
        with path.open("rb") as file:
            head = file.read(16)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); see who may read it") from error
    for magic, read in ((MCAP_MAGIC, mcap_messages), (SQLITE_MAGIC, sqlite_messages), (ROS1_MAGIC, ros1_messages)):
        if head.startswith(magic):
            return read(path, bag, wanted)
    raise InputError(f"{path}: no bag (neither MCAP nor SQLite nor ROS 1); record it again, or give another log")
