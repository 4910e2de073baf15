"""A record as a ULog file of its own, or merged into a copy of the log that it was replayed from.

Formats may only stand among the definitions, so ours are put at the end of those, our subscriptions after them,
and each of our messages before the first one of the log that is later. The log's own bytes are all kept, in their
order; only the offsets of what the vehicle appended (crash dumps) grow by what was put in before it.
To append our data in that way too would be simpler, but PlotJuggler and PX4's replay ignore appended data.
"""

import struct
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from flownav.core.errors import InputError, arg
from flownav.core.guard import written_whole
from flownav.core.provenance import hash_of
from flownav.core.record import Record
from flownav.core.version import __version__
from flownav.export import ulog_topics as ulog
from flownav.export.trajectory import finite_rows, is_text, shift_needed_s, trajectories

DEFINITIONS = frozenset(b"BFIMPQ")
FLAGS_SIZE, INCOMPATIBLE_AT, OFFSETS_AT = 40, 8, 16
OFFSETS = struct.Struct("<3Q")
CLOCKED = b"uint64_t timestamp;"
NAMED = {"estimate": "", "truth": "_groundtruth"}  # what PX4 calls the estimate and the truth of a simulation
WRITTEN_APART = ("estimate", "smoothed", "truth", "autopilot", "innovation", "events")


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


def merged(
    log: bytes, name: str, topics: list[ulog.Topic], strings: list[ulog.Stamped], texts: dict[str, str]
) -> bytes:
    """A log with our topics, logged strings and texts in it; `name` is the log's, for errors.

    InputError where it is no ULog that can be read, holds such topics already, or is of another time.
    """
    if not log.startswith(ulog.MAGIC) or len(log) < ulog.HEADER_SIZE:
        raise InputError(f"{name}: not a ULog file; give the .ulg that was replayed")
    flags = _flags(log, name)
    layout = _layout(log, sorted({*(offset for offset in flags.offsets if offset), len(log)}))
    _check(layout, name, topics)
    first = layout.next_number
    numbered = list(enumerate(topics, first))
    rows = [row for number, topic in numbered for row in ulog.data(topic, number)]
    rows = sorted([*rows, *strings], key=lambda row: row.time_us)
    head = [ulog.definition(topic) for topic in topics]
    head += [ulog.information(key, text) for key, text in texts.items() if text]
    head += [ulog.subscription(topic.name, number) for number, topic in numbered]
    body = _interleaved(log, layout, rows)
    grown = sum(map(len, head)) + sum(len(row.body) for row in rows)
    return b"".join([_with_offsets(log[: layout.data_at], flags, grown), *head, *body, log[layout.whole_to :]])


def _flags(log: bytes, name: str) -> Flags:
    """The flag bits, which old logs lack. InputError where they announce what this reader does not know."""
    first = next(ulog.walk(log, ulog.HEADER_SIZE, len(log)), None)
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
    data_at, whole_to, next_number = -1, ulog.HEADER_SIZE, 0
    formats: dict[bytes, bool] = {}
    clocked: set[int] = set()
    clock: list[tuple[int, int]] = []
    for found in ulog.walk(log, ulog.HEADER_SIZE, ends[0]):
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
        for found in ulog.walk(log, begin, end):
            if found.kind == ord("A"):
                next_number = max(next_number, _number(log, found, 4) + 1)
    return Layout(data_at, whole_to, clock, {topic.decode("utf-8", "replace") for topic in formats}, next_number)


def _check(layout: Layout, name: str, topics: list[ulog.Topic]) -> None:
    """InputError where our topics cannot go into that log."""
    if not layout.clock:
        raise InputError(f"{name}: the ULog holds no data with times; give the .ulg that was replayed")
    taken = sorted(layout.formats & {topic.name for topic in topics})
    if taken:
        raise InputError(f"{name}: holds {taken[0]} already; merge into the log as the vehicle wrote it")
    if layout.next_number + len(topics) > ulog.LARGEST_UINT16:
        raise InputError(f"{name}: no message numbers are left for {len(topics)} more topics")
    ours = [int(t) for topic in topics for t in (topic.time_us[:1], topic.time_us[-1:]) for t in t]
    theirs = [t for t, _ in layout.clock]
    if min(ours) > max(theirs) or max(ours) < min(theirs):
        raise InputError(
            f"{name}: runs from {min(theirs) / 1e6:.1f} to {max(theirs) / 1e6:.1f} s of its clock, the record from "
            f"{min(ours) / 1e6:.1f} to {max(ours) / 1e6:.1f} s; the record's clock is another one"
        )


def _interleaved(log: bytes, layout: Layout, rows: list[ulog.Stamped]) -> list[bytes]:
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


def _number(log: bytes, found: ulog.Found, at: int) -> int:
    """The uint16 at a place of a message."""
    return int.from_bytes(log[found.begin + at : found.begin + at + 2], "little")


# -- the file -----------------------------------------------------------------------------------------------
class Contents(NamedTuple):
    """Contents of a log: topics, logged strings, texts about the whole log, and notes for the user."""

    topics: list[ulog.Topic]
    strings: list[ulog.Stamped]
    texts: dict[str, str]
    notes: list[str]


def write_ulog(record: Record, path: Path, original: Path | None = None) -> tuple[list[Path], list[str]]:
    """Write a ULog file, whole or not at all; the file and notes.

    With `original`, the log that the record was replayed from, a copy of that log with flownav's topics among its own,
    on its clock: the manifest's `clock_start_s` is that clock's time at time 0 of the record. InputError where the
    original is missing, is no ULog, is not the log that was replayed or does not overlap in time, or where the record
    holds no path or does not say how its times lie on that clock.
    """
    if original is None:
        contents = _all_of(record)
        texts = {"sys_name": "flownav", "ver_sw": __version__, **contents.texts}
        whole = ulog.assembled(contents.topics, contents.strings, texts)
    else:
        log = _read_original(record, original)
        contents = _from_zero_on(_ours(record, _clock_start_s(record, original)))
        whole = merged(log, str(original), contents.topics, contents.strings, contents.texts)
    with written_whole(path) as temporary:
        temporary.write_bytes(whole)
    return [path], contents.notes


def _all_of(record: Record) -> Contents:
    """Everything that the record holds, the estimate and the truth also under PX4's names."""
    shift_s = shift_needed_s(record)
    ours = _ours(record, shift_s)
    topics, notes = list(ours.topics), list(ours.notes)
    if shift_s:
        notes.append(f"all times are {shift_s:g} s later than in the record: the format has no negative time")
    for path in trajectories(record):
        if path.name in NAMED:
            topics.append(ulog.position_topic(record, path, f"vehicle_local_position{NAMED[path.name]}", shift_s))
            if path.oriented:
                topics.append(ulog.attitude_topic(path, f"vehicle_attitude{NAMED[path.name]}", shift_s))
    for name, table in record.tables.items():
        if name not in WRITTEN_APART:
            topics.append(ulog.table_topic(name, table, shift_s))
            text = [column for column in table if is_text(table[column])]
            if text:
                notes.append(f"{name}: ULog topics hold numbers; left out: {', '.join(text)}")
    return Contents(topics, ours.strings, ours.texts, notes)


def _ours(record: Record, shift_s: float) -> Contents:
    """Contents that only flownav has: paths, innovations, events."""
    paths = trajectories(record)
    notes = [note for path in paths for note in path._replace(oriented=True).notes]  # nothing stands in here
    for name, table in record.tables.items():
        lost = len(table["t_s"]) - len(finite_rows(table["t_s"]))
        if lost and name not in [path.name for path in paths]:
            notes.append(f"{name}: rows without a time left out: {lost}")
    topics = [ulog.our_topic(record, path, shift_s) for path in paths]
    texts = {"flownav_record": str(record.manifest.get("scenario") or record.manifest.get("log") or "")}
    if {"sensor", "component"} <= record.tables.get("innovation", {}).keys():
        innovations, reasons = ulog.innovation_topics(record.tables["innovation"], shift_s)
        topics += innovations
        texts["flownav_reasons"] = ", ".join(f"{code} {reason}" for code, reason in enumerate(reasons))
    strings = ulog.event_strings(record.tables["events"], shift_s) if "events" in record.tables else []
    return Contents(topics, strings, texts, notes)


def _clock_start_s(record: Record, original: Path) -> float:
    """Time of the original's clock at time 0 of the record [s]. InputError where the record does not state it."""
    start_s = record.manifest.get("clock_start_s")
    if start_s is None:
        raise InputError(
            f"{arg('original')} {original}: the record does not say when its time began there; replay the log again"
        )
    return float(start_s)


def _from_zero_on(contents: Contents) -> Contents:
    """Contents without what lies before time 0 of the log's clock, which ULog cannot hold; counted in the notes."""
    topics = []
    for topic in contents.topics:
        kept = topic.time_us >= 0
        topics.append(
            ulog.Topic(topic.name, topic.time_us[kept], [f._replace(values=f.values[kept]) for f in topic.fields])
        )
    strings = [string for string in contents.strings if string.time_us >= 0]
    lost = sum(len(before.time_us) - len(after.time_us) for before, after in zip(contents.topics, topics, strict=True))
    lost += len(contents.strings) - len(strings)
    notes = [*contents.notes, *([f"rows before time 0 of the log's clock left out: {lost}"] if lost else [])]
    return contents._replace(topics=topics, strings=strings, notes=notes)


def _read_original(record: Record, original: Path) -> bytes:
    """The log's bytes. InputError where it cannot be read or is not among the record's inputs."""
    if not original.is_file():
        raise InputError(f"{arg('original')} {original}: no such file; give the log that was replayed")
    inputs = record.manifest.get("provenance", {}).get("inputs", {}).values()
    hashes = {value["sha256"] if isinstance(value, dict) else value for value in inputs}
    if hash_of(original) not in hashes:
        raise InputError(
            f"{arg('original')} {original}: the record was not replayed from this file (its SHA-256 differs)"
        )
    return original.read_bytes()
