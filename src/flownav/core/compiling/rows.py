"""Tables whose rows are records: where each field stands, the columns by name, and code that writes a lane's row.

A record is a NamedTuple class over one type variable: its fields are a row's numbers in a kernel and whole columns in
Python. A field takes one number, or as many as its annotation says: `pos_ned_m: Annotated[Value, 3]`.
"""

from collections.abc import Callable
from functools import cache
from itertools import accumulate
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from flownav.core.compiling.bundles import write_function
from flownav.core.compiling.engine import equation


@cache
def counts_of(record: type) -> tuple[int, ...]:
    """How many numbers each field of a record takes."""
    hints = get_type_hints(record, include_extras=True)
    fields: tuple[str, ...] = record._fields  # type: ignore[attr-defined]
    return tuple(getattr(hints[name], "__metadata__", (1,))[0] for name in fields)


def width_of(record: type) -> int:
    """How many numbers a row has."""
    return sum(counts_of(record))


@cache
def places_of(record: type) -> Any:
    """Where each field begins in a row, by the field's name."""
    return record(*accumulate(counts_of(record)[:-1], initial=0))


def columns_of(record: type, rows: NDArray[np.float64]) -> Any:
    """The columns of rows (n, width) by name, views: (n,) of a field of one number, (n, count) of one of several."""
    each = zip(places_of(record), counts_of(record), strict=True)
    return record(*(rows[:, at] if count == 1 else rows[:, at : at + count] for at, count in each))


def row_store(record: type, width: int | None = None) -> Callable[..., None]:
    """`store(table, lanes, row, lane, value)`: a record as one lane's row of a flat table (rows, width, lanes).

    width: of the table's rows where they are wider than the record.
    """
    fields: tuple[str, ...] = record._fields  # type: ignore[attr-defined]
    numbers = [
        f"value.{name}" if count == 1 else f"value.{name}[{i}]"
        for name, count in zip(fields, counts_of(record), strict=True)
        for i in range(count)
    ]
    stores = (f"    table[(first + {i}) * len(lanes) + lane] = {number}\n" for i, number in enumerate(numbers))
    first = f"    first = row * {width or len(numbers)}\n"
    source = "def store(table, lanes, row, lane, value):\n" + first + "".join(stores)
    return equation(write_function("store", source, {}))


def row_view(record: type) -> Callable[[NDArray[np.float64]], Any]:
    """`view(row)`: one row (width,) by name, a number or, of a field of several, the part of the array."""
    each = zip(places_of(record), counts_of(record), strict=True)
    parts = ", ".join(f"row[{at}]" if count == 1 else f"row[{at} : {at + count}]" for at, count in each)
    return equation(write_function("view", f"def view(row):\n    return record({parts})\n", {"record": record}))


@equation
def row_of(work: Any, lanes: tuple[int, ...], row: int, lane: int) -> float:
    """What stands in a row of a lane."""
    value: float = work[row * len(lanes) + lane]
    return value


def gathering(one: Callable[..., Any], indices: range) -> Callable[..., tuple[Any, ...]]:
    """`gathered(work, lanes, lane)`: the tuple of one(work, lanes, index, lane), index by index."""
    each = "".join(f"one(work, lanes, {index}, lane), " for index in indices)
    return equation(
        write_function("gathered", f"def gathered(work, lanes, lane):\n    return ({each})\n", {"one": one})
    )
