"""Rows of a campaign that show any alteration: each has a digest of itself and of all rows before it.

A row's digest is SHA-256 over the digest before it, the names of the columns and the row's own bytes: flight, inputs,
scores, outcome. The first row of a cell follows that of the plan. So a file shows whether it is as it was written, from
its pages' checksums to the order of its rows, and the last digest of a cell stands for all of its flights. It is no
signature: anyone with this code can make digests of other numbers. Flying the flights again proves their content
(`certification.again`), and a key proves the author (`certification.verify`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.arrow_columns import as_numpy
from flownav.core.guard import an_input
from flownav.core.parquet_pages import check_pages, read_footer

DIGEST = "digest"  # the column
BEFORE = b"flownav.digest_before"  # in a file's metadata, hexadecimal: of the row before its first
DIGEST_BYTES = 32
OF_NO_FLIGHT = ("flights",)  # keys of a plan that may grow without another flight
MOST_PART_BYTES = 64 << 20  # of a part's file, and of what it is unpacked: 256 flights have some 0.2 MB


class DamagedError(ValueError):
    """A file of flights that is not as it was written; what is wrong with it."""


class Part(NamedTuple):
    """A file of flights as it was written: its table without digests, those before its first row and of its last."""

    table: Any
    before: bytes
    last: bytes


def root_of(plan: Mapping[str, Any], cell: int) -> bytes:
    """The digest that the first row of a cell follows: of the campaign's plan, as written in its folder, and the cell's
    number.
    """
    flown_part = {name: value for name, value in plan.items() if name not in OF_NO_FLIGHT}
    return hashlib.sha256(f"{json.dumps(flown_part, sort_keys=True)}\n{cell}".encode()).digest()


def digests_of(table: Any, before: bytes) -> list[bytes]:
    """The digest of each row of an Arrow table of numbers and words, one after the other."""
    names = "\n".join(f"{field.name} {_kind(field.type)}" for field in table.schema)
    head = hashlib.sha256(names.encode()).digest()
    words = [_words(table.column(field.name)) for field in table.schema if _kind(field.type) == "text"]
    found = []
    for number, row in enumerate(_numbers(table)):
        text = b"".join(len(column[number]).to_bytes(4, "little") + column[number] for column in words)
        before = hashlib.sha256(before + head + row.tobytes() + text).digest()
        found.append(before)
    return found


def _kind(kind: Any) -> str:
    """A column's type, whichever way Parquet stores it."""
    import pyarrow as pa

    return "text" if pa.types.is_dictionary(kind) or pa.types.is_string(kind) else str(kind)


def _numbers(table: Any) -> Any:
    """The bytes of a table's numbers, (rows, bytes), little-endian."""
    columns = [
        np.ascontiguousarray(as_numpy(table.column(field.name)))
        for field in table.schema
        if _kind(field.type) != "text"
    ]
    rows = [column.astype(column.dtype.newbyteorder("<")).view(np.uint8).reshape(len(column), -1) for column in columns]
    return np.hstack(rows)


def _words(column: Any) -> list[bytes]:
    """Each row's word; one that comes again is kept once."""
    found: list[bytes] = []
    for chunk in column.dictionary_encode().chunks:
        known = [word.encode() for word in chunk.dictionary.to_pylist()]
        found += [known[place] for place in chunk.indices.to_pylist()]
    return found


# -- as a file ---------------------------------------------------------------------------------------------------
def write_part(path: Path, table: Any, before: bytes, texts: Sequence[str] = ()) -> bytes:
    """Write a table of flights with their digests; the last of them. texts: columns in which words come again."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    digests = digests_of(table, before)
    kept = pa.Array.from_buffers(pa.binary(DIGEST_BYTES), len(digests), [None, pa.py_buffer(b"".join(digests))])
    chained = table.append_column(DIGEST, kept)
    chained = chained.replace_schema_metadata({BEFORE: before.hex().encode()})
    pq.write_table(chained, path, compression="zstd", use_dictionary=list(texts), write_page_checksum=True)
    return digests[-1]


def _read_checked(path: Path) -> Any:
    """A Parquet file as a table, its pages' checksums held. DamagedError where it cannot be read so."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        data = _bytes_of(path)
        schema = pq.read_schema(pa.BufferReader(data))
        texts = [field.name for field in schema if _kind(field.type) == "text"]
        source = pa.BufferReader(data)
        with pq.ParquetFile(source, page_checksum_verification=True, read_dictionary=texts) as file:
            return file.read()
    except (OSError, pa.ArrowException, ValueError, KeyError) as error:
        raise DamagedError(" ".join(str(error).split())[:120] or type(error).__name__) from error


def _bytes_of(path: Path) -> bytes:
    """A file's bytes. ValueError where its header states impossible sizes; pyarrow ends the process at some of them."""
    with an_input(path).open("rb") as file:
        data = file.read(MOST_PART_BYTES + 1)
    if len(data) > MOST_PART_BYTES:
        raise ValueError("it is too large")
    footer = read_footer(data)
    grown = sum(chunk.grown for group in footer.groups for chunk in group)
    numbers = 8 * sum(rows * len(group) for rows, group in zip(footer.rows, footer.groups, strict=True))
    if max(grown, numbers) > MOST_PART_BYTES:
        raise ValueError("its columns are too large")
    check_pages(data, footer)
    return data


def read_part(path: Path) -> Part:
    """A file of flights. DamagedError where it is not as it was written; which row, where a row was altered."""
    table = _read_checked(path)
    if DIGEST not in table.column_names or BEFORE not in (table.schema.metadata or {}):
        raise DamagedError("its rows have no digests")
    before = _before(table.schema.metadata[BEFORE])
    stored_all = table.column(DIGEST).to_pylist()
    own = table.drop_columns([DIGEST])
    try:
        digests = digests_of(own, before)
    except (ValueError, TypeError, AttributeError) as error:  # a column of another type, or without a value
        raise DamagedError(f"its columns are not as they were written ({error})"[:120]) from error
    for number, (found, stored) in enumerate(zip(digests, stored_all, strict=True)):
        if found != stored:
            raise DamagedError(f"row {number + 1} is not what its digest says")
    return Part(own, before, digests[-1] if digests else before)


def _before(text: bytes) -> bytes:
    try:
        return bytes.fromhex(text.decode("ascii"))
    except ValueError as error:
        raise DamagedError("what it follows is no digest") from error
