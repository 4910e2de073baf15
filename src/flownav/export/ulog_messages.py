"""ULog's messages as bytes: what a writer needs of the format, and a walk over a log's messages.

PX4's ULog file format: header, definitions (flag bits, formats, information), data (subscriptions, data,
logged strings). Little endian; a message is its size (uint16, without this header), its type and its body.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.export.stamps import Stamps

MAGIC = b"ULog\x01\x12\x35"
HEADER_SIZE = 16
SYNC = b"\x08\x00S\x2f\x73\x13\x20\x25\x0c\xbb\x12"
KNOWN = frozenset(b"BFIMPQARDLCSO")
LARGEST = 0xFFFF
_TYPES = {"float": "<f4", "double": "<f8", "uint64_t": "<u8", "uint32_t": "<u4", "uint8_t": "u1", "int8_t": "i1"}
_TYPES["bool"] = "u1"


class Field(NamedTuple):
    """One field of a topic: its ULog type, its name and its values, (n,) or, as an array field, (n, k)."""

    kind: str
    name: str
    values: NDArray[Any]


class Topic(NamedTuple):
    """A topic's messages: times [microseconds] in ascending order, and fields of as many rows each."""

    name: str
    time_us: Stamps
    fields: list[Field]


class Stamped(NamedTuple):
    """A message of the data section and the time [microseconds] that it is put in order by."""

    time_us: int
    body: bytes


class Found(NamedTuple):
    """A message of a log: its type, and where it begins (its own header) and ends."""

    kind: int
    begin: int
    end: int


def message(kind: str, body: bytes) -> bytes:
    """A message of a type with its header. ValueError where the body is too long for one."""
    if len(body) > LARGEST:
        raise ValueError(f"a ULog message holds {LARGEST} bytes, not {len(body)}")
    return struct.pack("<HB", len(body), ord(kind)) + body


def header(start_us: int) -> bytes:
    """The file's first 16 bytes and the flag bits, none of them set, that must follow."""
    return MAGIC + struct.pack("<BQ", 1, start_us) + message("B", bytes(40))


def information(name: str, text: str) -> bytes:
    """A text that belongs to the whole log."""
    value = text.encode(errors="backslashreplace")
    key = f"char[{len(value)}] {name}".encode()
    return message("I", bytes([len(key)]) + key + value)


def definition(topic: Topic) -> bytes:
    """A topic's format message."""
    fields = ["uint64_t timestamp"]
    for field in topic.fields:
        length = f"[{field.values.shape[1]}]" if field.values.ndim == 2 else ""
        fields.append(f"{field.kind}{length} {field.name}")
    return message("F", (f"{topic.name}:" + "".join(f"{field};" for field in fields)).encode())


def subscription(name: str, number: int) -> bytes:
    """A topic's first instance under its number."""
    return message("A", struct.pack("<BH", 0, number) + name.encode())


def data(topic: Topic, number: int) -> list[Stamped]:
    """A topic's rows as data messages."""
    layout = [("size", "<u2"), ("kind", "u1"), ("number", "<u2"), ("timestamp", "<u8")]
    layout += [(f.name, _TYPES[f.kind], f.values.shape[1:]) for f in topic.fields]  # type: ignore[misc]
    rows = np.zeros(len(topic.time_us), np.dtype(layout))
    size = rows.dtype.itemsize
    rows["size"], rows["kind"], rows["number"], rows["timestamp"] = size - 3, ord("D"), number, topic.time_us
    for field in topic.fields:
        rows[field.name] = field.values
    packed = rows.tobytes()
    return [Stamped(t, packed[k * size : (k + 1) * size]) for k, t in enumerate(topic.time_us.tolist())]


def logged(time_us: int, text: str, level: str = "6") -> Stamped:
    """A logged string; level as the Linux kernel's, "4" a warning, "6" information."""
    return Stamped(
        time_us, message("L", level.encode() + struct.pack("<q", time_us) + text.encode(errors="backslashreplace"))
    )


def assembled(topics: Sequence[Topic], strings: Sequence[Stamped], texts: dict[str, str]) -> bytes:
    """A log of these topics, logged strings and texts about the whole of it, in order of time."""
    rows = [row for number, topic in enumerate(topics) for row in data(topic, number)]
    rows = sorted([*rows, *strings], key=lambda row: row.time_us)
    return b"".join(
        [
            header(rows[0].time_us),
            *(definition(topic) for topic in topics),
            *(information(name, text) for name, text in texts.items() if text),
            *(subscription(topic.name, number) for number, topic in enumerate(topics)),
            *(row.body for row in rows),
        ]
    )


def walk(log: bytes, begin: int, end: int) -> Iterator[Found]:
    """The messages between two offsets; damage is skipped up to the next synchronisation message, or ends the walk."""
    at = begin
    while at + 3 <= end:
        stop = at + 3 + (log[at] | log[at + 1] << 8)
        if log[at + 2] in KNOWN and stop <= end:
            yield Found(log[at + 2], at, stop)
            at = stop
        else:
            at = log.find(SYNC, at + 1, end)
            if at < 0:
                return
