"""What the pages of a Parquet file state before any is decompressed, so that a small file does not become a large one.

The footer's sizes are checked by whoever reads; here the pages' own headers are held against the footer (Thrift's
compact protocol, apache/parquet-format PageHeader).
"""

from __future__ import annotations

from typing import Any

UNCOMPRESSED, COMPRESSED, DATA_PAGE, DATA_PAGE_V2 = 2, 3, 5, 8  # fields of PageHeader
ENCODING = {DATA_PAGE: 2, DATA_PAGE_V2: 4}  # where a data page's header says its encoding
DELTA_BYTE_ARRAY = 7  # each text a part of the one before: what it grows to stands nowhere
DEEPEST = 8  # of structures in a page's header
TRUE, FALSE, BYTE, I16, I32, I64, DOUBLE, BINARY, LIST, SET, MAP, STRUCT = range(1, 13)


def check_pages(data: bytes, metadata: Any) -> None:
    """ValueError where a page would become larger than the footer (a pyarrow FileMetaData) says of its column."""
    for group in range(metadata.num_row_groups):
        row_group = metadata.row_group(group)
        for place in range(row_group.num_columns):
            _check_chunk(data, row_group.column(place))


def _check_chunk(data: bytes, chunk: Any) -> None:
    at = chunk.data_page_offset
    if chunk.has_dictionary_page and 0 < chunk.dictionary_page_offset < at:
        at = chunk.dictionary_page_offset
    end, left = at + chunk.total_compressed_size, chunk.total_uncompressed_size
    if not 0 < at <= end <= len(data):
        raise ValueError(f"column {chunk.path_in_schema} lies outside its table")
    while at < end:
        header, at = _structure(data, at, 0)
        left -= _size(header, UNCOMPRESSED)
        at += _size(header, COMPRESSED)
        if left < 0 or at > end:
            raise ValueError(f"a page of column {chunk.path_in_schema} is larger than its table says")
        for kind, field in ENCODING.items():
            if isinstance(header.get(kind), dict) and header[kind].get(field) == DELTA_BYTE_ARRAY:
                raise ValueError(f"column {chunk.path_in_schema} is encoded as flownav writes none")


def _size(header: dict[int, Any], field: int) -> int:
    found = header.get(field)
    if not isinstance(found, int) or found < 0:
        raise ValueError("a page says no size")
    return found


def _structure(data: bytes, at: int, depth: int) -> tuple[dict[int, Any], int]:
    """A structure's fields by number, and where it ends; texts and lists are passed over, as None."""
    if depth > DEEPEST:
        raise ValueError("a page's header is too deep")
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
        return None, _past_list(data, at, depth)
    if kind == STRUCT:
        return _structure(data, at, depth + 1)
    raise ValueError("a page's header is of an unknown kind")


def _past_list(data: bytes, at: int, depth: int) -> int:
    head = _byte(data, at)
    count, kind, at = head >> 4, head & 0x0F, at + 1
    if count == 15:
        count, at = _varint(data, at)
    for _ in range(count):
        if kind in (TRUE, FALSE):  # in a list, a truth value is a byte
            _byte(data, at)
            at += 1
        else:
            _, at = _value(data, at, kind, depth + 1)
            _byte(data, at - 1)
    return at


def _byte(data: bytes, at: int) -> int:
    if not 0 <= at < len(data):
        raise ValueError("a page's header is cut off")
    return data[at]


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        byte = _byte(data, at)
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise ValueError("a number in a page's header is too long")


def _signed(raw: int) -> int:
    """Zigzag."""
    return (raw >> 1) ^ -(raw & 1)
