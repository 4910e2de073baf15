"""Sizes that a Parquet file states, read before any of it is decompressed, so that no small file becomes a large one.

Its footer and the headers of its pages are read here, and compared with each other (Thrift's compact protocol,
apache/parquet-format): pyarrow believes both, and ends the process at some footers that are damaged.
"""

from typing import Any, NamedTuple

MAGIC = b"PAR1"
MOST_FOOTER = 1 << 20
ROWS, GROUPS = 3, 4  # fields of FileMetaData
GROUP_COLUMNS, GROUP_ROWS = 1, 3  # of RowGroup
OTHER_FILE, CHUNK = 1, 3  # of ColumnChunk
GROWN, STORED, DATA_AT, DICTIONARY_AT = 6, 7, 9, 11  # of ColumnMetaData
PAGE_GROWN, PAGE_STORED, DATA_PAGE, DATA_PAGE_V2 = 2, 3, 5, 8  # of PageHeader
ENCODING = {DATA_PAGE: 2, DATA_PAGE_V2: 4}  # where a data page's header says its encoding
DELTA_BYTE_ARRAY = 7  # each text a part of the one before: what it grows to stands nowhere
DEEPEST_NESTING = 8  # of structures in one another
TRUE, FALSE, BYTE, I16, I32, I64, DOUBLE, BINARY, LIST, SET, MAP, STRUCT = range(1, 13)


class Chunk(NamedTuple):
    """A column's part of a group of rows: where it lies, its bytes, and how many they become."""

    at: int
    stored: int
    grown: int


class Footer(NamedTuple):
    """Rows of each group, and its columns."""

    rows: list[int]
    groups: list[list[Chunk]]


def read_footer(data: bytes) -> Footer:
    """The footer's contents. ValueError where it is none, or its parts do not agree."""
    length = int.from_bytes(data[-8:-4], "little")
    if data[-4:] != MAGIC or length + 12 > len(data):
        raise ValueError("not a Parquet file")
    if length > MOST_FOOTER:
        raise ValueError("its footer is too long")
    meta, _ = _structure(data[-8 - length : -8], 0, 0)
    groups = _structures(meta, GROUPS)
    rows: list[int] = [_number(group, GROUP_ROWS) for group in groups]
    if sum(rows) != _number(meta, ROWS) or (any(rows) and 0 in rows):
        raise ValueError("its parts do not have the rows that it says")
    return Footer(rows, [[_chunk(column) for column in _structures(group, GROUP_COLUMNS)] for group in groups])


def _structures(fields: dict[int, Any], field: int) -> list[dict[int, Any]]:
    """A list of structures; none where the field is missing or null. ValueError where it is anything else."""
    found = fields.get(field) or []
    if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
        raise ValueError("a list of its parts is none")
    return found


def _chunk(column: dict[int, Any]) -> Chunk:
    meta = column.get(CHUNK)
    if not isinstance(meta, dict) or OTHER_FILE in column:
        raise ValueError("a column lies elsewhere")
    at, dictionary_at = _number(meta, DATA_AT), meta.get(DICTIONARY_AT)
    if isinstance(dictionary_at, int) and 0 < dictionary_at < at:
        at = dictionary_at
    return Chunk(at, _number(meta, STORED), _number(meta, GROWN))


def check_pages(data: bytes, footer: Footer) -> None:
    """ValueError where a page would become larger than the footer says of its column."""
    for group in footer.groups:
        for chunk in group:
            _check_chunk(data, chunk)


def _check_chunk(data: bytes, chunk: Chunk) -> None:
    at, end, left = chunk.at, chunk.at + chunk.stored, chunk.grown
    if not 0 < at <= end <= len(data):
        raise ValueError("a column lies outside its table")
    while at < end:
        header, at = _structure(data, at, 0)
        left -= _number(header, PAGE_GROWN)
        at += _number(header, PAGE_STORED)
        if left < 0 or at > end:
            raise ValueError("a page of a column is larger than its table says")
        for kind, field in ENCODING.items():
            if isinstance(header.get(kind), dict) and header[kind].get(field) == DELTA_BYTE_ARRAY:
                raise ValueError("a column is encoded as flownav writes none")


def _number(fields: dict[int, Any], field: int) -> int:
    found = fields.get(field)
    if not isinstance(found, int) or isinstance(found, bool) or found < 0:
        raise ValueError("a size is missing, or negative")
    return found


def _structure(data: bytes, at: int, depth: int) -> tuple[dict[int, Any], int]:
    """A structure's fields by number, and where it ends; texts and lists of other than structures are None."""
    if depth > DEEPEST_NESTING:
        raise ValueError("what it says is nested too deep")
    fields: dict[int, Any] = {}
    number = 0
    while kind := _byte(data, at):
        at += 1
        step = kind >> 4
        if step:
            number += step
        else:
            raw, at = _varint(data, at)
            number = _signed(raw)
        fields[number], at = _value(data, at, kind & 0x0F, depth)
    return fields, at + 1


def _value(data: bytes, at: int, kind: int, depth: int) -> tuple[Any, int]:
    """A field's value: a truth value lies in its kind."""
    if kind in (TRUE, FALSE):
        return kind == TRUE, at
    if kind in (I16, I32, I64):
        raw, at = _varint(data, at)
        return _signed(raw), at
    if kind in (BYTE, DOUBLE):
        return None, at + (1 if kind == BYTE else 8)
    if kind == BINARY:
        count, at = _varint(data, at)
        return None, at + count
    if kind in (LIST, SET):
        return _list(data, at, depth)
    if kind == STRUCT:
        return _structure(data, at, depth + 1)
    raise ValueError("it says something of an unknown kind")


def _list(data: bytes, at: int, depth: int) -> tuple[list[Any] | None, int]:
    found = []
    head = _byte(data, at)
    count, kind, at = head >> 4, head & 0x0F, at + 1
    if count == 15:
        count, at = _varint(data, at)
    for _ in range(count):
        value, at = _value(data, at, BYTE if kind in (TRUE, FALSE) else kind, depth + 1)  # a truth value is a byte here
        _byte(data, at - 1)
        if kind == STRUCT:
            found.append(value)
    return found if kind == STRUCT else None, at


def _byte(data: bytes, at: int) -> int:
    if not 0 <= at < len(data):
        raise ValueError("what it says is cut off")
    return data[at]


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        byte = _byte(data, at)
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise ValueError("a number in it is too long")


def _signed(raw: int) -> int:
    """Zigzag."""
    return (raw >> 1) ^ -(raw & 1)
