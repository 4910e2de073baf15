"""The journal of a live session: blocks behind one another, each with its number, its length and checksums.

A file is MAGIC and blocks. A block is a header (HEADER: mark, number, bytes of the payload, CRC-32 of the payload,
CRC-32 of the header before it), and a payload: the length of a JSON object, the object, and the rows of 64-bit numbers
that its `rows` name with their shapes. Nothing is ever written over, so that a file that was cut off anywhere holds
every block before the cut; after damage in the middle the next block is found by its mark.
"""

import json
import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from flownav.core.measurement import Array

MAGIC = b"FNRJRNL1"
SUFFIX = ".journal"
MARK = b"\xf7\x9aBK"
HEADER = struct.Struct("<4sIIII")
MARKS = re.compile(re.escape(MARK))
LENGTH = struct.Struct("<I")
MOST_BYTES = 1 << 28  # of a payload
DTYPE = np.dtype("<f8")


class Block(NamedTuple):
    """A whole block: its number, its entries, and rows by name, each (n, columns)."""

    number: int
    stated: dict[str, Any]
    rows: dict[str, Array]


class Damage(NamedTuple):
    """Bytes that are no block, from a place in the file on; tail: no whole block comes after them."""

    place: int
    length: int
    tail: bool


def block(number: int, stated: Mapping[str, Any], rows: Mapping[str, Array] | None = None) -> bytes:
    """A block's bytes. ValueError where it would be too large."""
    found = rows or {}
    shapes = {name: list(values.shape) for name, values in found.items()}
    text = json.dumps({**stated, "rows": shapes}, default=str).encode()
    payload = b"".join(
        [LENGTH.pack(len(text)), text, *(np.ascontiguousarray(v, DTYPE).tobytes() for v in found.values())]
    )
    if len(payload) > MOST_BYTES:
        raise ValueError(f"a block of {len(payload)} bytes: at most {MOST_BYTES} are possible")
    head = HEADER.pack(MARK, number & 0xFFFFFFFF, len(payload), zlib.crc32(payload), 0)[:-4]
    return head + LENGTH.pack(zlib.crc32(head)) + payload


def blocks(data: memoryview) -> Iterator[Block | Damage]:
    """Yield the blocks and damage of a journal's bytes, in order. The time grows in proportion to their number."""
    place, bad, patience = len(MAGIC), -1, 4 * len(data)
    while place < len(data):
        length = _payload_length(data, place)
        end = place + HEADER.size + length
        found = _block_at(data, place, length) if length >= 0 and end <= len(data) else None
        if found is not None:
            if bad >= 0:
                yield Damage(bad, place - bad, False)
            bad, place = -1, end
            yield found
            continue
        bad = place if bad < 0 else bad
        patience -= max(length, 0)  # bytes that were summed up in vain
        place = _next_mark(data, place + 1) if patience > 0 or length < 0 else end
    if bad >= 0:
        yield Damage(bad, len(data) - bad, True)


def _payload_length(data: memoryview, place: int) -> int:
    """The payload's length that a header states; -1 where there is none that holds."""
    head = bytes(data[place : place + HEADER.size])
    if len(head) < HEADER.size:
        return -1
    mark, _, length, _, check = HEADER.unpack(head)
    return int(length) if mark == MARK and length <= MOST_BYTES and zlib.crc32(head[:-4]) == check else -1


def _block_at(data: memoryview, place: int, length: int) -> Block | None:
    """The block whose header stands at a place; None where its payload is not what was written."""
    _, number, _, check, _ = HEADER.unpack(data[place : place + HEADER.size])
    payload = data[place + HEADER.size : place + HEADER.size + length]
    if zlib.crc32(payload) != check:
        return None
    try:
        (count,) = LENGTH.unpack(payload[: LENGTH.size])
        at = LENGTH.size + count
        stated = json.loads(bytes(payload[LENGTH.size : at]))
        rows = {}
        for name, (many, width) in stated.pop("rows").items():
            size = many * width * DTYPE.itemsize
            rows[name] = np.frombuffer(payload[at : at + size], DTYPE).reshape(many, width)
            at += size
    except (struct.error, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None
    return Block(int(number), stated, rows)


def _next_mark(data: memoryview, place: int) -> int:
    """Where the next mark stands; the end where there is none."""
    found = MARKS.search(data, place)
    return found.start() if found else len(data)
