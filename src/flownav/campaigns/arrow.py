"""Columns of numbers and of words between NumPy and Arrow, without pandas, which Arrow loads where it is installed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

KINDS = {"d": "float64", "i": "int32", "l": "int64", "?": "bool"}


def numbers(values: NDArray[Any]) -> Any:
    """An Arrow array of a NumPy array of float64, int32 or int64, (rows,), which it keeps alive."""
    import pyarrow as pa

    values = np.ascontiguousarray(values)
    kind = getattr(pa, KINDS[values.dtype.char])()
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(values)])


def words(values: Sequence[str]) -> Any:
    """An Arrow array of words, each kept once."""
    import pyarrow as pa

    known = {word: place for place, word in enumerate(dict.fromkeys(values))}
    text = [word.encode() for word in known]
    ends = np.concatenate([[0], np.cumsum([len(word) for word in text])]).astype(np.int32)
    book = pa.Array.from_buffers(pa.utf8(), len(text), [None, pa.py_buffer(ends), pa.py_buffer(b"".join(text))])
    return pa.DictionaryArray.from_arrays(numbers(np.array([known[word] for word in values], np.int32)), book)


def column(table: Any, name: str) -> NDArray[Any]:
    """A column as NumPy, (rows,): numbers, or words as objects. KeyError without it."""
    if str(table.schema.field(name).type).startswith("dictionary"):
        return np.array(table.column(name).to_pylist(), object)
    parts = []
    for chunk in table.column(name).chunks:
        kind = np.dtype(str(chunk.type).replace("double", "float64"))
        parts.append(np.frombuffer(chunk.buffers()[1], kind, len(chunk), chunk.offset * kind.itemsize))
    return np.concatenate(parts) if parts else np.zeros(0)


def read(path: Path, columns: Sequence[str] | None = None) -> Any:
    """A Parquet file's columns as a table."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        return file.read(list(columns) if columns is not None else None)
