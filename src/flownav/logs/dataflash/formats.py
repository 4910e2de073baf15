"""Where a DataFlash file's messages lie, and their description in the file: FMT (layout), FMTU, UNIT and MULT (units).

A message is 0xA3 0x95, its type, and a body whose length its type alone decides. Two header bytes also occur inside
bodies, so a header counts only where the chain of lengths arrives at it. Where the chain breaks (lost or damaged
bytes) it starts anew at the next header that leads on to another, and the bytes between are counted. Format characters
and their factors are ArduPilot's (libraries/AP_Logger/LogStructure.h).
"""

import re
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

HEAD = (0xA3, 0x95)
HEADER_BYTES = 3
BLOCK_BYTES = 1 << 20  # what is looked through at once stays in the cache

Bytes = NDArray[np.uint8]
Indices = NDArray[np.int64]
CODES: dict[str, str] = {
    "a": "(32,)<i2", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8", "Q": "<u8",
    "g": "<f2", "f": "<f4", "d": "<f8", "n": "S4", "N": "S16", "Z": "S64", "M": "u1",
    "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4",
}  # fmt: skip
DIVISORS = {"c": 100.0, "C": 100.0, "e": 100.0, "E": 100.0, "L": 1e7}  # these characters imply a factor
NOT_NUMBERS = "anNZ"
FMT_TYPE = 0x80
NO_UNIT, NO_MULTIPLIER = "", 0.0
INSTANCE_UNIT = "#"
INSTANCE_LABELS = ("I", "C", "Instance")  # of logs older than FMTU
# the field that is the vehicle's clock, and its unit [s]: TimeMS before May 2015; a GPS had its own time of the week in
# that, and the vehicle's in T
CLOCKS = (("TimeUS", 1e-6), ("TimeMS", 1e-3))
GPS_CLOCKS = (("TimeUS", 1e-6), ("T", 1e-3))

_SIZES = np.full(256, -1000)
_SIZES[0] = 0
for _code, _kind in CODES.items():
    _SIZES[ord(_code)] = np.dtype(_kind).itemsize
_NAME = re.compile(rb"[A-Za-z][A-Za-z0-9_]{0,3}")


class Headers(NamedTuple):
    """offset (n,) of every place where the two header bytes stand, ascending, and the type (n,) that follows them."""

    offset: Indices
    type: Bytes


class Scan(NamedTuple):
    """offset (n,) of every message's first byte, in file order, and type (n,); bytes in no message, and their gaps."""

    offset: Indices
    type: Bytes
    skipped_bytes: int
    gaps: int


def find_headers(content: Bytes) -> Headers:
    """Everything in a file that looks like a header."""
    found = [np.zeros(0, np.int64)]
    last = len(content) - HEADER_BYTES + 1
    for start in range(0, last, BLOCK_BYTES):
        first = np.flatnonzero(content[start : min(start + BLOCK_BYTES, last)] == HEAD[0]) + start
        found.append(first[content[1:][first] == HEAD[1]])
    offset = np.concatenate(found)
    return Headers(offset, content[2:][offset])


def chain_messages(content: Bytes, headers: Headers, length: Indices) -> Scan:
    """The messages among the headers; length (256,) is each type's in bytes, header included, 0 where unknown."""
    start, kind = headers
    possible = (length > 0)[kind]
    near_end = int(np.searchsorted(start, len(content) - int(length.max())))
    possible[near_end:] &= start[near_end:] + length[kind[near_end:]] <= len(content)
    start, kind = _only(possible, start, kind)
    if len(start):
        start, kind = _only(_walk(content, start, start + length[kind]), start, kind)
    if not len(start):
        return Scan(start, kind, len(content), int(len(content) > 0))
    end = start + length[kind]
    gaps = int(start[0] > 0) + int(np.count_nonzero(end[:-1] != start[1:])) + int(end[-1] < len(content))
    return Scan(start, kind, len(content) - int(length[kind].sum()), gaps)


def _only(chosen: NDArray[np.bool_], start: Indices, kind: Bytes) -> tuple[Indices, Bytes]:
    return (start, kind) if chosen.all() else (start[chosen], kind[chosen])


def _walk(content: Bytes, start: Indices, end: Indices) -> NDArray[np.bool_]:
    """Which candidates the chain visits, as a mask.

    Most candidates end where the next one starts; only the others (breaks) are looked at one by one. A break's
    successor is the candidate at its end, or the next good one: one that ends at a header or with the file. A
    candidate that ends at nothing while a good one lies inside it was cut short, and is thrown away.
    """
    count = len(start)
    breaks = np.append(np.flatnonzero(end[:-1] != start[1:]), count - 1)
    landing = np.searchsorted(start, end[breaks])
    meets = _at(start, landing) == end[breaks]
    leads_on = meets | _header_or_end_at(content, end[breaks])
    bad = breaks[~leads_on]
    inside = _next_good(breaks + 1, bad)
    successor = np.where(meets, landing, np.where(leads_on, _next_good(landing, bad), inside))
    whole = leads_on | (_at(start, inside) >= end[breaks])
    first = int(_next_good(np.zeros(1, np.int64), bad)[0])
    return _visited(count, first, breaks, successor, whole)


def _at(start: Indices, index: Indices) -> Indices:
    """start[index], a place beyond every file where the index is beyond the last."""
    return np.where(index < len(start), start[np.minimum(index, len(start) - 1)], np.iinfo(np.int64).max)


def _next_good(index: Indices, bad: Indices) -> Indices:
    """The first candidate from an index on that is not bad; bad ascending."""
    if not len(bad):
        return index
    run_ends = np.append(np.diff(bad) > 1, True)
    after_run = (bad[run_ends] + 1)[np.cumsum(run_ends) - run_ends]
    place = np.minimum(np.searchsorted(bad, index), len(bad) - 1)
    return np.where(bad[place] == index, after_run[place], index)


def _header_or_end_at(content: Bytes, place: Indices) -> NDArray[np.bool_]:
    """Whether the file ends there, or the two header bytes stand there (of whatever type)."""
    inside = place + 1 < len(content)
    at = np.where(inside, place, 0)
    return np.asarray((place == len(content)) | (inside & (content[at] == HEAD[0]) & (content[1:][at] == HEAD[1])))


def _visited(
    count: int, first: int, breaks: Indices, successor: Indices, whole: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Mask of the candidates from the first on: runs up to each break, then on from its successor."""
    next_break = np.searchsorted(breaks, successor).tolist()
    run_starts, run_breaks = [], []
    at, position = first, int(np.searchsorted(breaks, first))
    successors = successor.tolist()
    while at < count:
        run_starts.append(at)
        run_breaks.append(position)
        at, position = successors[position], next_break[position]
    edge = np.zeros(count + 1, np.int8)
    edge[run_starts] += 1
    ran = np.array(run_breaks, np.int64)
    np.add.at(edge, breaks[ran] + whole[ran], -1)
    return np.cumsum(edge[:-1], dtype=np.int8).astype(bool)


# -- formats ------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Format:
    """One kind of message: type, name, one format character and one label a field.

    units: by label, as the file's UNIT messages spell them. multipliers: by label, the factor from the written
    number to that unit, where the file states one and the character implies none. instance: the label that
    tells several sensors of one kind apart.
    """

    type: int
    name: str
    codes: str
    labels: tuple[str, ...]
    units: dict[str, str] = field(default_factory=dict)
    multipliers: dict[str, float] = field(default_factory=dict)
    instance: str | None = None

    @property
    def dtype(self) -> np.dtype[np.void]:
        """The message byte by byte, header first."""
        fields = [
            ("", f"V{HEADER_BYTES}"),
            *((label, CODES[c]) for label, c in zip(self.labels, self.codes, strict=True)),
        ]
        return np.dtype(fields)

    @property
    def numbers(self) -> frozenset[str]:
        """Labels of the fields that are one number each."""
        return frozenset(label for label, c in zip(self.labels, self.codes, strict=True) if c not in NOT_NUMBERS)

    @property
    def clock(self) -> tuple[str, float] | None:
        """The field with the time, and its unit [s]; None of a message without one."""
        clocks = GPS_CLOCKS if self.name.startswith("GPS") else CLOCKS
        return next(((label, unit_s) for label, unit_s in clocks if label in self.numbers), None)

    def code(self, label: str) -> str:
        """A field's format character."""
        return self.codes[self.labels.index(label)]


FMT = Format(FMT_TYPE, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))


def read_formats(content: Bytes, headers: Headers) -> tuple[dict[str, Format], int]:
    """Formats by name from every FMT message that is sound, and the number of those that contradict an earlier one.

    Sound: known characters, one label a character, a length that is their sum. The first definition of a type and
    of a name stands.
    """
    formats = {FMT.name: FMT}
    taken = {FMT_TYPE: FMT}
    contradictions = 0
    for row in _sound(content, headers):
        name, labels = bytes(row["Name"]), _text(row["Columns"]).split(",")
        codes = _text(row["Format"])
        distinct = not codes or (len(set(labels)) == len(labels) and all(labels))
        if not _NAME.fullmatch(name) or len(codes) != len(labels if codes else []) or not distinct:
            continue
        found = Format(int(row["Type"]), name.decode(), codes, tuple(labels) if codes else ())
        if taken.get(found.type, formats.get(found.name, found)) != found:
            contradictions += 1
        elif found.type not in taken and found.name not in formats:
            formats[found.name] = taken[found.type] = found
    return formats, contradictions


def _sound(content: Bytes, headers: Headers) -> NDArray[np.void]:
    """The distinct FMT rows whose characters add up to their length, in file order."""
    at = headers.offset[headers.type == FMT_TYPE]
    at = at[at + FMT.dtype.itemsize <= len(content)]
    for text in ("Name", "Format", "Columns"):  # letters or nothing: most chance headers end here
        at = at[content[at + int(FMT.dtype.fields[text][1])] < 128]  # type: ignore[index]
    rows = np.ascontiguousarray(records(content, FMT.dtype)[at])
    codes = np.ascontiguousarray(rows["Format"]).view(np.uint8).reshape(len(rows), FMT.dtype["Format"].itemsize)
    ended = np.logical_or.accumulate(codes == 0, axis=1)
    size = np.where(ended, 0, _SIZES[codes]).sum(axis=1) + HEADER_BYTES
    rows = rows[size == rows["Length"]]
    _, first = np.unique(rows.view(f"V{FMT.dtype.itemsize}"), return_index=True)
    return np.asarray(rows[np.sort(first)])


def records(content: Bytes, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """The file seen as a record at every byte, so that indexing with offsets gathers whole messages."""
    count = max(0, len(content) - dtype.itemsize + 1)
    return np.ndarray((count,), dtype, buffer=content.data, strides=(1,))


def with_units(formats: dict[str, Format], tables: dict[str, NDArray[np.void]]) -> dict[str, Format]:
    """The formats with units and factors from the FMTU, UNIT and MULT messages; rows that fit no format are passed
    over.
    """
    units = {chr(key & 0x7F): _text(label) for key, label in _pairs(tables, "UNIT", "Label")}
    factors = {chr(key & 0x7F): _rounded(factor) for key, factor in _pairs(tables, "MULT", "Mult")}
    stated = tables.get("FMTU")
    described = dict(formats)
    if stated is None:
        return {name: _guessed(known) for name, known in formats.items()}
    if not {"FmtType", "UnitIds", "MultIds"} <= set(stated.dtype.names or ()):
        return described
    by_type = {known.type: known for known in formats.values()}
    for row in stated:
        known = by_type.get(_integer(row["FmtType"]))
        if known is not None:
            described[known.name] = _described(known, _text(row["UnitIds"]), _text(row["MultIds"]), units, factors)
    return described


def _described(
    known: Format, unit_ids: str, multiplier_ids: str, units: dict[str, str], factors: dict[str, float]
) -> Format:
    named = {label: units.get(key, NO_UNIT) for label, key in zip(known.labels, unit_ids, strict=False)}
    multipliers = {
        label: factors[key]
        for label, key in zip(known.labels, multiplier_ids, strict=False)
        if factors.get(key, NO_MULTIPLIER) != NO_MULTIPLIER and known.code(label) not in DIVISORS and key != "?"
    }
    marked = [label for label, key in zip(known.labels, unit_ids, strict=False) if key == INSTANCE_UNIT]
    return Format(known.type, known.name, known.codes, known.labels, named, multipliers, marked[0] if marked else None)


def _guessed(known: Format) -> Format:
    """The instance field by its customary name, for a file without FMTU."""
    customary = [label for label in known.labels if label in INSTANCE_LABELS]
    return replace(known, instance=customary[0] if customary else None)


def _pairs(tables: dict[str, NDArray[np.void]], name: str, value: str) -> list[tuple[int, np.generic]]:
    table = tables.get(name)
    if table is None or not {"Id", value} <= set(table.dtype.names or ()):
        return []
    return [(_integer(row["Id"]), row[value]) for row in table]


def _integer(value: np.generic) -> int:
    """The number, -1 where the file's own FMT makes it something else."""
    return int(value) if isinstance(value, np.integer) else -1


def _rounded(factor: np.generic) -> float:
    """Factors are written from single precision: seven digits count. No factor where it is none."""
    if not isinstance(factor, np.floating) or not np.isfinite(factor) or factor <= 0:
        return NO_MULTIPLIER
    return float(f"{float(factor):.7g}")


def _text(value: np.generic) -> str:
    """A field's characters up to the first zero byte."""
    raw = bytes(value) if isinstance(value, np.bytes_) else b""
    return raw.split(b"\0", 1)[0].decode("latin-1")
