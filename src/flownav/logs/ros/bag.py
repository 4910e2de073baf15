"""The content of a bag, whatever its file format; bags of SQLite (.db3) and of ROS 1 (.bag); messages as objects.

rosbag2_storage_sqlite3 has the tables of a .db3: https://github.com/ros2/rosbag2, rosbag2_storage_sqlite3/README.md.
The library rosbags reads a .bag, and makes objects of bytes from the definitions that the bag itself holds.
"""

import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from flownav.core.errors import InputError

MCAP_MAGIC, SQLITE_MAGIC, ROS1_MAGIC = b"\x89MCAP0\r\n", b"SQLite format 3\0", b"#ROSBAG V2.0\n"
NEEDED = "ROS bags need the package rosbags: pip install 'flownav[ros]'"
LARGEST_CHUNK, LARGEST_RATIO = 64 << 20, 200  # bytes unpacked, and times the packed size; rosbag's chunks are 768 kB
LEAST_PACKED = 4096  # bytes, what is smaller counts as so much
PIECE = 1 << 20  # bytes that are unpacked at a time
STEPS, STEPS_A_BYTE = 5_000_000, 4  # of SQLite's machine; a row takes a dozen and forty bytes
LONGEST_DEFINITION = 64 << 10


class Channel(NamedTuple):
    """The type of one topic's messages.

    kind: the type, "sensor_msgs/msg/Imu". encoding: of the messages, "cdr", "ros1" or "json". definition: of the type
    in ROS's own words, empty where the bag has none; definition_kind: "ros2msg", "ros2idl", "ros1msg", "jsonschema".
    """

    topic: str
    kind: str
    encoding: str
    definition: str
    definition_kind: str


def one_line(words: object) -> str:
    """Any text of a library or a bag as one line for a message: names in a bag may hold anything."""
    return " ".join(str(words).split())


def _why(error: BaseException) -> str:
    return one_line(error) or type(error).__name__


class Message(NamedTuple):
    """One message: its channel, when it was logged [ns], its bytes."""

    channel: Channel
    log_ns: int
    data: bytes


@dataclass
class Bag:
    """The result of reading a bag: its channels, notes on damage, files attached to it."""

    channels: set[Channel] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)
    attachments: dict[str, bytes] = field(default_factory=dict)


Wanted = Callable[[Channel], bool]
# what SQLite's module raises of a file in which bits flipped: a name that is no text, a value larger than memory
DAMAGED = (sqlite3.Error, OverflowError, UnicodeDecodeError, MemoryError)


TABLES = ("topics", "messages", "message_definitions")
TOO_MANY = "it has more rows than its bytes can hold"


def sqlite_messages(path: Path, bag: Bag, wanted: Wanted) -> Iterator[Message]:
    """The wanted messages of a .db3 file. InputError where SQLite cannot open it or it holds no bag's tables."""
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as base:
            size = path.stat().st_size
            _limit(base, size)
            _require_tables(path, base)
            channels = _channels(base, size)
            bag.channels.update(channels.values())
            taken = [number for number, channel in channels.items() if wanted(channel)]
            marks = ",".join("?" * len(taken))
            query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks})"
            try:
                for number, log_ns, data in _rows(base, query, size, taken):
                    if isinstance(log_ns, int) and isinstance(data, bytes) and number in channels:
                        yield Message(channels[number], log_ns, data)
            except DAMAGED as error:
                bag.notes.append(f"{path.name}: damaged ({_why(error)}); what follows is left out")
    except DAMAGED as error:
        raise InputError(f"{path}: no readable ROS 2 bag ({_why(error)}); give another log") from error


def _limit(base: sqlite3.Connection, size: int) -> None:
    """Limit SQLite to the content that an unpacked file of `size` bytes can hold: a value's length, its steps."""
    base.text_factory = lambda text: text.decode(errors="replace")
    base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(size + (1 << 20), LARGEST_CHUNK))
    every, left = 1000, [STEPS + STEPS_A_BYTE * size]

    def spent() -> bool:
        left[0] -= every
        return left[0] < 0

    base.set_progress_handler(spent, every)


def _require_tables(path: Path, base: sqlite3.Connection) -> None:
    """InputError where what a bag's tables are called is made by SQLite and not stored: a view may never end."""
    for name in TABLES:
        query = "SELECT type, rootpage FROM sqlite_master WHERE name = ? COLLATE NOCASE"
        for kind, page in base.execute(query, [name]):
            if kind != "table" or not page:
                what = "virtual table" if kind == "table" else one_line(kind)
                raise InputError(f"{path}: {name} is a {what}, no table of a ROS 2 bag; give it as it was recorded")


def _rows(base: sqlite3.Connection, query: str, size: int, values: Sequence[int] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield rows as long as a file of `size` bytes can hold them: pages of a damaged one may lead to each other."""
    left = size
    try:
        for row in base.execute(query, values):
            left -= 2 + sum(len(value) for value in row if isinstance(value, (str, bytes)))
            if left < 0:
                raise sqlite3.DataError(TOO_MANY)
            yield row
    except sqlite3.OperationalError as error:
        raise sqlite3.DataError(TOO_MANY if str(error) == "interrupted" else str(error)) from error


def _channels(base: sqlite3.Connection, size: int) -> dict[int, Channel]:
    definitions = {}
    if base.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone():
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        definitions = {str(kind): (str(words), str(encoding)) for kind, encoding, words in _rows(base, query, size)}
    found = {}
    query = "SELECT id, name, type, serialization_format FROM topics"
    for number, topic, kind, encoding in _rows(base, query, size):
        words, definition_kind = definitions.get(str(kind), ("", ""))
        found[number] = Channel(one_line(topic), str(kind), str(encoding), words, definition_kind)
    return found


def ros1_messages(path: Path, bag: Bag, wanted: Wanted) -> Iterator[Message]:
    """The wanted messages of a .bag file. InputError where the library cannot open it (a bag without its index)."""
    try:
        reader = _ros1_reader(path)
    except ImportError as error:
        raise InputError(NEEDED) from error
    try:
        reader.open()
    except Exception as error:  # whatever the library raises is the file's fault
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: no readable ROS 1 bag ({why}); try `rosbag reindex`") from error
    try:
        channels = {
            connection: Channel(
                one_line(connection.topic), connection.msgtype, "ros1", connection.msgdef.data, "ros1msg"
            )
            for connection in reader.connections
        }
        bag.channels.update(channels.values())
        taken = [connection for connection, channel in channels.items() if wanted(channel)]
        if taken:
            for connection, log_ns, data in reader.messages(connections=taken):
                yield Message(channels[connection], log_ns, bytes(data))
    except Exception as error:
        why = _why(error) if isinstance(error, TooLargeError) else type(error).__name__
        bag.notes.append(f"{path.name}: damaged ({why}); what follows is left out")
    finally:
        reader.close()


class TooLargeError(ValueError):
    """Something in a bag that would become larger than what recorders write."""


def _ros1_reader(path: Path) -> Any:
    """The library's reader, held to what a file of this size can hold. ImportError where the library is not there."""
    from rosbags.rosbag1 import Reader

    size = path.stat().st_size
    unpack = _Unpacking(size)

    class Bounded(Reader):
        """Reads no more entries of an index than there are bytes for, and unpacks chunks as far as they may grow."""

        def read_index_data(self, pos: int, indexes: Any) -> None:
            """An index's entries, twelve bytes each."""
            super().read_index_data(pos, indexes)
            if 12 * sum(map(len, indexes.values())) > size:
                raise TooLargeError("its index has more entries than its bytes can hold")

        def read_chunk(self) -> Any:
            """Where a chunk lies, and how it is unpacked."""
            chunk = super().read_chunk()
            library = chunk.decompressor.__module__.partition(".")[0]
            return (
                chunk if library == "rosbags" else chunk._replace(decompressor=unpack.ways[library])
            )  # its own: as is

    return Bounded(path)


class _Unpacking:
    """Unpacks the chunks of a bag of `size` bytes, as far as they may grow, each and together."""

    def __init__(self, size: int) -> None:
        self.left = LARGEST_CHUNK + LARGEST_RATIO * size
        self.ways: dict[str, Callable[[bytes], bytes]] = {"bz2": self.bz2, "_bz2": self.bz2, "lz4": self.lz4}

    def bz2(self, packed: bytes) -> bytes:
        """A chunk of bzip2's."""
        from bz2 import BZ2Decompressor

        return self._bounded(BZ2Decompressor(), packed)

    def lz4(self, packed: bytes) -> bytes:
        """A chunk of LZ4's."""
        from lz4.frame import LZ4FrameDecompressor

        return self._bounded(LZ4FrameDecompressor(), packed)

    def _bounded(self, unpacker: Any, packed: bytes) -> bytes:
        most = min(LARGEST_CHUNK, LARGEST_RATIO * max(len(packed), LEAST_PACKED))
        found, length = [unpacker.decompress(packed, max_length=PIECE)], 0
        while True:
            length += len(found[-1])
            self.left -= len(found[-1])
            if length > most or self.left < 0:
                raise TooLargeError(f"a chunk of {len(packed)} bytes that becomes more than {most}")
            if unpacker.eof or unpacker.needs_input:
                return b"".join(found)
            found.append(unpacker.decompress(b"", max_length=PIECE))


class Decoder:
    """Makes objects of messages. undecodable: how many could not be, by topic; undefined: topics without a type."""

    def __init__(self) -> None:
        self.undecodable: Counter[str] = Counter()
        self.undefined: set[str] = set()
        self._stores: dict[Channel, Any] = {}

    def decode(self, message: Message) -> Any | None:
        """A message's object; None, counted, where its bytes are none of its type."""
        channel = message.channel
        if channel not in self._stores:
            self._stores[channel] = self._store(channel)
        store = self._stores[channel]
        if store is None:
            return None
        read = store.deserialize_ros1 if channel.encoding == "ros1" else store.deserialize_cdr
        try:
            return read(message.data, channel.kind)
        except Exception:  # whatever the library stumbles over is the file's fault
            self.undecodable[channel.topic] += 1
            return None

    def _store(self, channel: Channel) -> Any | None:
        """The types of a channel: its own definition's; without one those of ROS itself. None where there is none."""
        try:
            from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
        except ImportError as error:
            raise InputError(NEEDED) from error
        if channel.definition and len(channel.definition) <= LONGEST_DEFINITION:
            read = {"ros2idl": lambda words, kind: get_types_from_idl(words)}.get(
                channel.definition_kind, get_types_from_msg
            )
            try:
                store = get_typestore(Stores.EMPTY)
                store.register(read(channel.definition, channel.kind))
                if channel.kind in store.fielddefs:
                    return store
            except Exception:  # a definition that is damaged: ROS's own serves, where it has one
                pass
        known = get_typestore(Stores.ROS1_NOETIC if channel.encoding == "ros1" else Stores.ROS2_HUMBLE)
        if channel.kind in known.fielddefs:
            return known
        self.undefined.add(channel.topic)
        return None
