"""flownav's topics into a copy of an existing ULog.

Formats may only stand among the definitions, so ours are put at the end of those, our subscriptions after them,
and each of our messages before the first one of the log that is later. The log's own bytes are all kept, in their
order; only the offsets of what the vehicle appended (crash dumps) grow by what was put in before it.
To append our data in that way too would be simpler, but PlotJuggler and PX4's replay ignore appended data.
"""

from __future__ import annotations

import struct
from itertools import pairwise
from typing import NamedTuple

from flownav.core.errors import InputError
from flownav.export.ulog_messages import (
    HEADER_SIZE,
    LARGEST,
    MAGIC,
    Found,
    Stamped,
    Topic,
    data,
    definition,
    information,
    subscription,
    walk,
)

DEFINITIONS = frozenset(b"BFIMPQ")
FLAGS_SIZE, INCOMPATIBLE_AT, OFFSETS_AT = 40, 8, 16
OFFSETS = struct.Struct("<3Q")
CLOCKED = b"uint64_t timestamp;"


class Flags(NamedTuple):
    """The flag bits' offsets of appended data: where they stand in the file, None where there is no appended data."""

    at: int | None
    offsets: tuple[int, ...]


class Layout(NamedTuple):
    """A log's parts.

    data_at: where the data section begins. whole_to: where its last whole message ends.
    clock: time [microseconds] and place of each data message whose format begins with its time.
    formats: the names defined. next_number: the first message number that is free.
    """

    data_at: int
    whole_to: int
    clock: list[tuple[int, int]]
    formats: set[str]
    next_number: int


def merged(log: bytes, name: str, topics: list[Topic], strings: list[Stamped], texts: dict[str, str]) -> bytes:
    """A log with our topics, logged strings and texts in it; `name` is the log's, for errors.

    InputError where it is no ULog that can be read, holds such topics already, or is of another time.
    """
    if not log.startswith(MAGIC) or len(log) < HEADER_SIZE:
        raise InputError(f"{name}: not a ULog file; give the .ulg that was replayed")
    flags = _flags(log, name)
    layout = _layout(log, sorted({*(offset for offset in flags.offsets if offset), len(log)}))
    _check(layout, name, topics)
    first = layout.next_number
    numbered = list(enumerate(topics, first))
    rows = [row for number, topic in numbered for row in data(topic, number)]
    rows = sorted([*rows, *strings], key=lambda row: row.time_us)
    head = [definition(topic) for topic in topics]
    head += [information(key, text) for key, text in texts.items() if text]
    head += [subscription(topic.name, number) for number, topic in numbered]
    body = _interleaved(log, layout, rows)
    grown = sum(map(len, head)) + sum(len(row.body) for row in rows)
    return b"".join([_with_offsets(log[: layout.data_at], flags, grown), *head, *body, log[layout.whole_to :]])


def _flags(log: bytes, name: str) -> Flags:
    """The flag bits, which old logs lack. InputError where they announce what this reader does not know."""
    first = next(walk(log, HEADER_SIZE, len(log)), None)
    if first is None:
        raise InputError(f"{name}: the ULog holds no message; give the .ulg that was replayed")
    body = first.begin + 3
    if first.kind != ord("B") or first.end - body < FLAGS_SIZE:
        return Flags(None, ())
    incompatible = log[body + INCOMPATIBLE_AT : body + OFFSETS_AT]
    if incompatible[0] & ~1 or any(incompatible[1:]):
        raise InputError(f"{name}: the ULog is of a newer kind (incompatible flags); it cannot be merged into")
    at = body + OFFSETS_AT
    return Flags(at, OFFSETS.unpack_from(log, at)) if incompatible[0] & 1 else Flags(None, ())


def _layout(log: bytes, ends: list[int]) -> Layout:
    """One walk over what was written while flying, up to the first of `ends`, and the numbers taken after it."""
    data_at, whole_to, next_number = -1, HEADER_SIZE, 0
    formats: dict[bytes, bool] = {}
    clocked: set[int] = set()
    clock: list[tuple[int, int]] = []
    for found in walk(log, HEADER_SIZE, ends[0]):
        whole_to = found.end
        if data_at < 0 and found.kind not in DEFINITIONS:
            data_at = found.begin
        if found.kind == ord("F"):
            topic, _, fields = log[found.begin + 3 : found.end].partition(b":")
            formats[topic] = fields.startswith(CLOCKED)
        elif found.kind == ord("A"):
            number = _number(log, found, 4)
            next_number = max(next_number, number + 1)
            if formats.get(log[found.begin + 6 : found.end]):
                clocked.add(number)
        elif found.kind == ord("D") and found.end - found.begin >= 13 and _number(log, found, 3) in clocked:
            clock.append((int.from_bytes(log[found.begin + 5 : found.begin + 13], "little"), found.begin))
    for begin, end in pairwise(ends):
        for found in walk(log, begin, end):
            if found.kind == ord("A"):
                next_number = max(next_number, _number(log, found, 4) + 1)
    return Layout(data_at, whole_to, clock, {topic.decode("utf-8", "replace") for topic in formats}, next_number)


def _check(layout: Layout, name: str, topics: list[Topic]) -> None:
    """InputError where our topics cannot go into that log."""
    if not layout.clock:
        raise InputError(f"{name}: the ULog holds no data with times; give the .ulg that was replayed")
    taken = sorted(layout.formats & {topic.name for topic in topics})
    if taken:
        raise InputError(f"{name}: holds {taken[0]} already; merge into the log as the vehicle wrote it")
    if layout.next_number + len(topics) > LARGEST:
        raise InputError(f"{name}: no message numbers are left for {len(topics)} more topics")
    ours = [int(t) for topic in topics for t in (topic.time_us[:1], topic.time_us[-1:]) for t in t]
    theirs = [t for t, _ in layout.clock]
    if min(ours) > max(theirs) or max(ours) < min(theirs):
        raise InputError(
            f"{name}: runs from {min(theirs) / 1e6:.1f} to {max(theirs) / 1e6:.1f} s of its clock, the record from "
            f"{min(ours) / 1e6:.1f} to {max(ours) / 1e6:.1f} s; the record's clock is another one"
        )


def _interleaved(log: bytes, layout: Layout, rows: list[Stamped]) -> list[bytes]:
    """The data section's whole messages with `rows` (in order of time) between them."""
    pieces, copied, row = [], layout.data_at, 0
    for time_us, place in layout.clock:
        if row == len(rows):
            break
        if rows[row].time_us < time_us:
            pieces.append(log[copied:place])
            copied = place
            while row < len(rows) and rows[row].time_us < time_us:
                pieces.append(rows[row].body)
                row += 1
    pieces.append(log[copied : layout.whole_to])
    return [*pieces, *(later.body for later in rows[row:])]


def _with_offsets(head: bytes, flags: Flags, grown: int) -> bytes:
    """The file's beginning, its offsets of appended data moved by `grown` bytes."""
    if flags.at is None:
        return head
    moved = OFFSETS.pack(*(offset + grown if offset else 0 for offset in flags.offsets))
    return head[: flags.at] + moved + head[flags.at + OFFSETS.size :]


def _number(log: bytes, found: Found, at: int) -> int:
    """The uint16 at a place of a message."""
    return int.from_bytes(log[found.begin + at : found.begin + at + 2], "little")
