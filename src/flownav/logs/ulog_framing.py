"""The messages of a ULog file, one by one, before they are passed to pyulog.

pyulog believes a file: a lying length, a nested format that grows without end or a damaged parameter makes it search
byte by byte, fill the memory, or stop early without an error. So the framing is read here, each message is checked
against its definitions, damage is skipped and counted, and only whole messages of the wanted topics are kept, as places
in the file. Format: docs.px4.io, "ULog File Format".
"""

import re
import struct
from collections.abc import Collection
from dataclasses import dataclass, field
from mmap import mmap
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.text import plain
from flownav.logs.ulog_rows import AT_ONCE, DATA_KIND, Places, nothing_announced, walk_data

MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35"
HEADER_SIZE = 16
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
TYPE_SIZES = {
    "int8_t": 1, "uint8_t": 1, "bool": 1, "char": 1, "int16_t": 2, "uint16_t": 2,
    "int32_t": 4, "uint32_t": 4, "float": 4, "int64_t": 8, "uint64_t": 8, "double": 8,
}  # fmt: skip
KINDS = frozenset(b"FBIMPQARDLCSO")
A_HEADER = re.compile(rb"(?s)..[FIMPQARDLCSO]")  # where a message may begin again after damage
FIELD = re.compile(rb"([A-Za-z0-9_/]{1,128})(?:\[(\d{1,5})\])? ([A-Za-z0-9_]{1,128})")
SYSTEM = re.compile(rb".char\[\d{1,2}\] sys_name", re.DOTALL)  # an information message, after its header
NAME = re.compile(rb"[A-Za-z0-9_/-]{1,128}")
LARGEST_MESSAGE = 0xFFFF
LARGEST_TOPIC = 8192  # bytes; uORB's largest have a quarter of that
DEEPEST_NESTING = 8
MOST_BAD_FORMATS = 1000
LOGGED, MOST_MESSAGES = struct.Struct("<BQ"), 2000  # a logged string's level and time; how many are kept
APPENDED_FLAG = 1  # the one incompatible flag that is known: data appended at stated offsets

header_at = struct.Struct("<HB").unpack_from
id_at = struct.Struct("<H").unpack_from


@dataclass
class Framed:
    """The wanted topics of a file, and the damage in the rest.

    content: their definitions as a sound ULog with one row of each. rows: where all of their rows begin, by message id,
    in the file's order. dropouts_s: gaps that the logger itself states [s].
    rejected: messages by reason. damaged: number of stretches skipped, and their bytes.
    system: the name of the system that wrote the log ("PX4"). messages: logged strings with the clock's time [s].
    """

    content: bytes = b""
    rows: dict[int, Places] = field(default_factory=dict)
    topics: set[str] = field(default_factory=set)
    dropouts_s: list[float] = field(default_factory=list)
    rejected: dict[str, int] = field(default_factory=dict)
    damaged_stretches: int = 0
    damaged_bytes: int = 0
    system: str = ""
    messages: list[tuple[float, str]] = field(default_factory=list)

    def count(self, reason: str) -> None:
        """One more message thrown away."""
        self.rejected[reason] = self.rejected.get(reason, 0) + 1


class Formats:
    """The definitions read so far, and the size of a topic's flattened data."""

    def __init__(self) -> None:
        self.fields: dict[str, list[tuple[str, int, str]]] = {}
        self.bad = 0
        self._sizes: dict[str, int] = {}

    def take(self, text: bytes) -> str:
        """Read a definition; its name, "" where it is none. A second one of the same name is not taken."""
        if self.bad > MOST_BAD_FORMATS:
            return ""
        name, _, rest = text.partition(b":")
        parts = [FIELD.fullmatch(part) for part in rest.rstrip(b"\0").split(b";") if part]
        if not NAME.fullmatch(name) or not parts or None in parts:
            self.bad += 1
            return ""
        fields = [(m[1].decode() + ("[]" if m[2] else ""), int(m[2] or 1), m[3].decode()) for m in parts if m]
        self.fields.setdefault(name.decode(), fields)
        return name.decode()

    def size(self, name: str) -> int:
        """Bytes of a topic's data without the padding at its end; 0 where its definition cannot be."""
        if name not in self._sizes:
            fields = list(self.fields.get(name, ()))
            while fields and fields[-1][2].startswith("_padding"):
                fields.pop()
            names = [field_name for _, _, field_name in fields]
            sound = ("uint64_t", 1, "timestamp") in fields and len(set(names)) == len(names)
            size = self._sum(fields, 0) if sound else 0
            self._sizes[name] = size if size <= LARGEST_TOPIC else 0
        return self._sizes[name]

    def full_size(self, name: str) -> int:
        """Bytes with the padding at the end, which some writers log."""
        return self._sum(self.fields[name], 0)

    def _sum(self, fields: list[tuple[str, int, str]], depth: int) -> int:
        """Flattened size; 0 where a type is unknown, empty, or nested without end."""
        total = 0
        for written, count, _ in fields:
            kind = written.removesuffix("[]")
            each = TYPE_SIZES.get(kind, 0)
            if not each and depth < DEEPEST_NESTING and kind in self.fields:
                each = self._sum(self.fields[kind], depth + 1)
            total += each * count
            if not each or not count or total > LARGEST_TOPIC:
                return 0
        return total


class Framing:
    """One walk over a file's messages."""

    def __init__(self, path: Path, content: mmap | bytes, wanted: Collection[str]) -> None:
        self.content, self.wanted = content, wanted
        self.formats = Formats()
        self.framed = Framed()
        self.subscribed: dict[int, tuple[str, int, int]] = {}  # id: topic, least and most bytes
        self.definitions: dict[bytes, bytes] = {}  # the first of each name
        self.parameters: list[bytes] = []
        self.announcements: dict[int, bytes] = {}
        self.bytes = np.frombuffer(content, np.uint8)
        self.announced = nothing_announced()
        self.found: list[tuple[Places, NDArray[np.uint16]]] = []  # rows, and of which topic
        self.room = np.empty(AT_ONCE, np.int64), np.empty(AT_ONCE, np.uint16)
        self.limits = [*self._appended(path), len(content)]

    def _appended(self, path: Path) -> list[int]:
        """Offsets of appended data, in order. InputError where the file asks for a reader that knows more."""
        if len(self.content) < HEADER_SIZE + 43 or self.content[HEADER_SIZE + 2] != ord("B"):
            return []
        flags = self.content[HEADER_SIZE + 11 : HEADER_SIZE + 19]
        if flags[0] & ~APPENDED_FLAG or any(flags[1:]):
            raise InputError(
                f"{path}: a ULog with features that are not known here (flags {flags.hex()}); update flownav"
            )
        if not flags[0] & APPENDED_FLAG:
            return []
        offsets = struct.unpack_from("<3Q", self.content, HEADER_SIZE + 19)
        return sorted(offset for offset in offsets if HEADER_SIZE + 43 < offset < len(self.content))

    def walk(self) -> Framed:
        """Read every message; damage is skipped and counted."""
        pos = HEADER_SIZE
        for limit in self.limits:
            while pos < limit:
                after = self._walk_data(pos, limit)
                if after > pos:
                    pos = after
                    continue
                stop = self._valid(pos, limit)
                if not stop:
                    pos = self._resynchronise(pos, limit)
                    continue
                self._take(pos, stop)
                pos = stop
        framed = self.framed
        framed.rows = self._rows()
        framed.content = b"".join([
            self.content[:HEADER_SIZE], *self.definitions.values(), *self.parameters,
            *(message for number, message in self.announcements.items() if number in framed.rows),
            *(self._whole(number, int(rows[0])) for number, rows in framed.rows.items()),
        ])  # fmt: skip
        return framed

    def _walk_data(self, pos: int, limit: int) -> int:
        """Over the sound data messages that follow; where the first of another kind begins."""
        known, (rows, ids) = self.announced, self.room
        stop, count = walk_data(self.bytes, pos, limit, known.least, known.most, known.wanted, rows, ids)
        if count:
            self.found.append((rows[:count].copy(), ids[:count].copy()))
        return int(stop)

    def _rows(self) -> dict[int, Places]:
        """By message id, in the file's order."""
        if not self.found:
            return {}
        rows, ids = (np.concatenate(parts) for parts in zip(*self.found, strict=True))
        self.found.clear()
        return {int(number): rows[ids == number] for number in np.unique(ids)}

    def _whole(self, number: int, row: int) -> bytes:
        """A data message without the padding behind its data."""
        size = self.subscribed[number][1]
        return struct.pack("<HBH", size + 2, DATA_KIND, number) + self.content[row : row + size]

    def _resynchronise(self, pos: int, limit: int) -> int:
        """Where the next two messages that can be begin; counts what lies between. A cut last message is no damage."""
        at = pos
        while found := A_HEADER.search(self.content, at + 1, limit):
            at = found.start()
            stop = self._valid(at, limit)
            if stop and (stop == limit or self._valid(stop, limit)):
                break
        else:
            at = limit
        cut = at == limit and self._header_is_known(pos, limit) and limit - pos <= LARGEST_MESSAGE
        if cut:
            self.framed.count("cut_message")
        else:
            self.framed.damaged_stretches += 1
            self.framed.damaged_bytes += at - pos
        return at

    def _header_is_known(self, pos: int, limit: int) -> bool:
        """Whether a message of a known kind begins here, or a piece of a header lies at the very end."""
        return limit - pos < 3 or self.content[pos + 2] in KINDS

    def _valid(self, pos: int, limit: int) -> int:
        """Where the message at a place ends; 0 where none can be there."""
        if pos + 3 > limit:
            return 0
        size, kind = header_at(self.content, pos)
        stop = pos + 3 + size
        if not size or stop > limit:
            return 0
        if kind == 68:  # D
            entry = self.subscribed.get(id_at(self.content, pos + 3)[0]) if size >= 2 else None
            sound = entry[1] <= size - 2 <= entry[2] if entry else size > 2 and self._may_begin(stop, limit)
        elif kind == 83:  # S
            sound = size == len(SYNC) and self.content[pos + 3 : stop] == SYNC
        elif kind in b"OR":
            sound = size == 2
        elif kind == 65:  # A
            sound = 3 < size <= 131 and NAME.fullmatch(self.content[pos + 6 : stop]) is not None
        elif kind == 70:  # F
            known = self.formats.bad <= MOST_BAD_FORMATS and self._may_begin(stop, limit)
            sound = known and bool(self.formats.take(self.content[pos + 3 : stop]))
        else:
            sound = self._may_begin(stop, limit)
        return stop if sound else 0

    def _may_begin(self, pos: int, limit: int) -> bool:
        """Whether a message may begin at a place, by its header alone."""
        if pos + 3 > limit:
            return pos == limit
        size, kind = header_at(self.content, pos)
        return kind in KINDS and size > 0 and pos + 3 + size <= limit

    def _take(self, pos: int, stop: int) -> None:
        """Keep what is wanted of a sound message."""
        kind, framed = self.content[pos + 2], self.framed
        if kind == 68:
            framed.count("unknown_topic")  # those of known topics are walked over in `_walk_data`
        elif kind == 70:
            name = self.content[pos + 3 : stop].partition(b":")[0]
            self.definitions.setdefault(name, self.content[pos:stop])
        elif kind == 80 and self._is_parameter(pos, stop):
            self.parameters.append(self.content[pos:stop])
        elif kind == 73 and (named := SYSTEM.match(self.content, pos + 3, stop)):
            framed.system = framed.system or plain(self.content[named.end() : stop].decode(errors="replace"))
        elif kind == 65:
            self._subscribe(pos, stop)
        elif kind == 76 and stop - pos > LOGGED.size + 3 and len(framed.messages) < MOST_MESSAGES:
            time_us = LOGGED.unpack_from(self.content, pos + 3)[1]
            text = self.content[pos + 3 + LOGGED.size : stop].decode(errors="replace")
            framed.messages.append((1e-6 * time_us, plain(text.strip())))
        elif kind == 79:
            framed.dropouts_s.append(1e-3 * id_at(self.content, pos + 3)[0])

    def _is_parameter(self, pos: int, stop: int) -> bool:
        key = self.content[pos + 4 : pos + 4 + self.content[pos + 3]]
        of_four_bytes = stop - pos - 4 - len(key) == 4
        return of_four_bytes and re.fullmatch(rb"(int32_t|float) [A-Z0-9_]{1,32}", key) is not None

    def _subscribe(self, pos: int, stop: int) -> None:
        number, name = id_at(self.content, pos + 4)[0], self.content[pos + 6 : stop].decode()
        size = self.formats.size(name)
        if not size:
            self.framed.count("undefined_topic")
        elif number in self.subscribed:
            if self.subscribed[number][0] != name:
                self.framed.count("topic_redefined")
        else:
            full = self.formats.full_size(name)
            self.subscribed[number] = (name, size, full)
            known = self.announced
            known.least[number], known.most[number], known.wanted[number] = size, full, name in self.wanted
            self.announcements[number] = self.content[pos:stop]
            self.framed.topics.add(name)


def frame(path: Path, content: mmap | bytes, wanted: Collection[str]) -> Framed:
    """The messages of a file. InputError where it is no ULog, or needs a reader that knows more."""
    if len(content) < HEADER_SIZE or content[: len(MAGIC)] != MAGIC:
        raise InputError(f"{path}: not a ULog file (it does not begin as one); is it whole?")
    return Framing(path, content, wanted).walk()
