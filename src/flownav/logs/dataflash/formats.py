"""What a DataFlash file says of its own messages: FMT (layout), FMTU, UNIT and MULT (units and factors).

Format characters and their factors are ArduPilot's (libraries/AP_Logger/LogStructure.h).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from flownav.logs.dataflash.scan import HEADER_BYTES, Bytes, Headers

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

_SIZES = np.full(256, -1000)
_SIZES[0] = 0
for _code, _kind in CODES.items():
    _SIZES[ord(_code)] = np.dtype(_kind).itemsize
_NAME = re.compile(rb"[A-Za-z][A-Za-z0-9_]{0,3}")


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
        if not _NAME.fullmatch(name) or len(codes) != len(labels if codes else []) or not _distinct(labels, codes):
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


def _distinct(labels: list[str], codes: str) -> bool:
    return not codes or (len(set(labels)) == len(labels) and all(labels))


def records(content: Bytes, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """The file seen as a record at every byte, so that indexing with offsets gathers whole messages."""
    count = max(0, len(content) - dtype.itemsize + 1)
    return np.ndarray((count,), dtype, buffer=content.data, strides=(1,))


def with_units(formats: dict[str, Format], tables: dict[str, NDArray[np.void]]) -> dict[str, Format]:
    """The formats with what the FMTU, UNIT and MULT messages say of them; rows that fit no format are passed over."""
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
