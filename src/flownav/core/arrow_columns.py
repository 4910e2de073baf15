"""Columns between NumPy and Arrow, by their buffers: Arrow's own conversions load pandas, wherever it is installed.

That costs a second and 60 MB of a command that wants no data frame. Neither side copies what it can share.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

NUMBERS = "fiub"  # NumPy's kinds
KINDS = {"double": "float64", "float": "float32", "halffloat": "float16"}  # Arrow's words that are not NumPy's


def numbers(values: NDArray[Any]) -> Any:
    """An Arrow array of a NumPy array of numbers or of truth values, (rows,), which it keeps alive."""
    import pyarrow as pa

    values = np.ascontiguousarray(values)
    held = np.packbits(values, bitorder="little") if values.dtype == bool else values
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, pa.py_buffer(held)])


def texts(values: Iterable[str | None]) -> Any:
    """An Arrow array of texts, None where there is none."""
    import pyarrow as pa

    given = list(values)
    each = [(value or "").encode() for value in given]
    ends = np.cumsum([0, *map(len, each)], dtype=np.int64)
    large = ends[-1] > np.iinfo(np.int32).max
    missing = [value is None for value in given]
    held = pa.py_buffer(np.packbits(~np.array(missing), bitorder="little")) if any(missing) else None
    buffers = [held, pa.py_buffer(ends if large else ends.astype(np.int32)), pa.py_buffer(b"".join(each))]
    return pa.Array.from_buffers(pa.large_utf8() if large else pa.utf8(), len(given), buffers)


def words(values: Sequence[str]) -> Any:
    """An Arrow array of words, each kept once."""
    import pyarrow as pa

    known = {word: place for place, word in enumerate(dict.fromkeys(values))}
    places = numbers(np.array([known[word] for word in values], np.int32))
    return pa.DictionaryArray.from_arrays(places, texts(known))


def table_of(columns: Mapping[str, NDArray[Any]]) -> Any:
    """An Arrow table of NumPy columns: numbers, truth values, or texts."""
    import pyarrow as pa

    return pa.table({name: _arrow(one) for name, one in columns.items()})


def _arrow(values: NDArray[Any]) -> Any:
    import pyarrow as pa

    if values.dtype.kind in NUMBERS:
        return numbers(values)
    given = values.tolist()
    return texts(given) if all(one is None or isinstance(one, str) for one in given) else pa.array(given)


def as_numpy(found: Any) -> NDArray[Any]:
    """An Arrow column (chunked or not) as NumPy, (rows,): numbers, with NaN where a float is missing; or texts.

    ValueError where another number is missing.
    """
    parts = [_part(chunk) for chunk in (found.chunks if hasattr(found, "chunks") else [found]) if len(chunk)]
    return np.concatenate(parts) if parts else np.zeros(0, _dtype(found.type))


def places(chunk: Any) -> NDArray[np.int64]:
    """Which word of its dictionary each row of a chunk has, (rows,); -1 where there is none."""
    found, there = _held(chunk.indices)
    return np.where(there, found, -1).astype(np.int64) if there is not None else found.astype(np.int64)


def _part(chunk: Any) -> NDArray[Any]:
    if hasattr(chunk.type, "index_type"):
        return np.array([*chunk.dictionary.to_pylist(), None], object)[places(chunk)]
    if _dtype(chunk.type).kind == "O":
        return np.array(chunk.to_pylist(), object)
    found, there = _held(chunk)
    if there is None:
        return found
    if found.dtype.kind != "f":
        raise ValueError(f"{len(there) - int(there.sum())} cells without a number")
    return np.where(there, found, np.array(np.nan, found.dtype))


def _held(chunk: Any) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """A chunk's numbers, and which of them are there (None: all)."""
    there, data = chunk.buffers()
    rows, start = len(chunk), chunk.offset
    kind = _dtype(chunk.type)
    truth = kind.kind == "b"
    found = _bits(data, start, rows) if truth else np.frombuffer(data, kind, rows, start * kind.itemsize)
    return found, None if there is None or not chunk.null_count else _bits(there, start, rows)


def _bits(data: Any, start: int, rows: int) -> NDArray[np.bool_]:
    return np.unpackbits(np.frombuffer(data, np.uint8), count=start + rows, bitorder="little")[start:].astype(bool)


def _dtype(kind: Any) -> np.dtype[Any]:
    """NumPy's type of what Arrow calls a number; object of all else."""
    name = str(kind)
    try:
        found = np.dtype(KINDS.get(name, name))
    except (TypeError, ValueError):
        found = np.dtype(object)
    return found if found.kind in NUMBERS else np.dtype(object)
