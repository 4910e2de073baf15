"""Named tuples in kernels and flat buffers: code that loads, stores and changes them, written out field by field; and
tables whose rows are such records: where each field stands, the columns by name.

LLVM vectorises straight-line code only, so the functions are generated, not looped. A table's record is a NamedTuple
class over one type variable: its fields are a row's numbers in a kernel and whole columns in Python. A field takes one
number, or as many as its annotation states: `pos_ned_m: Annotated[Value, 3]`.
"""

import hashlib
import linecache
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import accumulate
from typing import Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from flownav.core.compiling.engine import equation, intrinsic


def write_function(name: str, source: str, scope: dict[str, Any]) -> Callable[..., Any]:
    """The function `name` that `source` defines; tracebacks and compilers find its source."""
    file = f"<flownav {name} {hashlib.sha256(source.encode()).hexdigest()[:12]}>"
    linecache.cache[file] = (len(source), None, source.splitlines(True), file)
    exec(compile(source, file, "exec"), scope)
    function: Callable[..., Any] = scope[name]
    return function


def lane_access(bundle: type, row: int | Sequence[int] | None) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """`load(work, lanes, lane)` and `store(work, lanes, lane, value)` of a named tuple kept in a lane buffer.

    `bundle` is a NamedTuple class of scalars, `row` the constant row of its first field, or those of each. Field `i`
    of lane `k` lies at `(row + i) * len(lanes) + k`. row None: both take it, `load(work, lanes, row, lane)`.
    """
    fields: tuple[str, ...] = bundle._fields  # type: ignore[attr-defined]
    rows = None if row is None else tuple(range(row, row + len(fields)) if isinstance(row, int) else row)
    places = [f"(row + {i})" for i in range(len(fields))] if rows is None else list(map(str, rows))
    at = [f"work[{place} * len(lanes) + lane]" for place in places]
    arguments = "work, lanes, lane" if row is not None else "work, lanes, row, lane"
    stores = "\n".join(f"    {place} = value.{name}" for place, name in zip(at, fields, strict=True))
    scope: dict[str, Any] = {"bundle": bundle}
    load = write_function("load", f"def load({arguments}):\n    return bundle({', '.join(at)})\n", scope)
    store = write_function("store", f"def store({arguments}, value):\n{stores}\n", scope)
    return intrinsic(load, "load_intrinsic", bundle, rows), intrinsic(store, "store_intrinsic", bundle, rows)


Bundle = TypeVar("Bundle", bound=tuple[Any, ...])


def replacing(bundle: type[Bundle], *names: str) -> Callable[..., Bundle]:
    """`replaced(value, **named)`: a named tuple with these fields anew, all of them; the others as they are.

    `NamedTuple._replace` does not compile. ValueError where the bundle has no such field.
    """
    fields = _known(bundle, names)
    values = ", ".join(name if name in names else f"value.{name}" for name in fields)
    source = f"def replaced(value, {', '.join(names)}):\n    return bundle({values})\n"
    return intrinsic(write_function("replaced", source, {"bundle": bundle}), "replaced_intrinsic", bundle, names)


def passing(bundle: type[Bundle], through: Callable[..., float], *names: str) -> Callable[[Bundle], Bundle]:
    """`passed(value)`: a named tuple with these fields each passed through an equation; the others as they are."""
    fields = _known(bundle, names)
    values = ", ".join(f"through(value.{name})" if name in names else f"value.{name}" for name in fields)
    source = f"def passed(value):\n    return bundle({values})\n"
    return equation(write_function("passed", source, {"bundle": bundle, "through": through}))


def stepping(bundle: type[Bundle]) -> Callable[[Bundle, Bundle, float], Bundle]:
    """`stepped(state, rate, dt)`: state + rate·dt, component by component."""
    fields: tuple[str, ...] = bundle._fields  # type: ignore[attr-defined]
    sums = ", ".join(f"state.{name} + rate.{name} * dt" for name in fields)
    source = f"def stepped(state, rate, dt):\n    return bundle({sums})\n"
    return equation(write_function("stepped", source, {"bundle": bundle}))


def _known(bundle: type[Bundle], names: tuple[str, ...]) -> tuple[str, ...]:
    """The fields of a named tuple. ValueError where one of the names is none of them."""
    fields: tuple[str, ...] = bundle._fields  # type: ignore[attr-defined]
    if strange := set(names) - set(fields):
        raise ValueError(f"{bundle.__name__} has no {', '.join(sorted(strange))}")
    return fields


class FlatAccess(NamedTuple):
    """A nested named tuple as float64s in a row: how many, how to write them (Python), how to read them (kernels)."""

    size: int
    pack: Callable[[Any], NDArray[np.float64]]
    load: Callable[..., Any]


def flat_access(bundle: type, at: int = 0) -> FlatAccess:
    """`(size, pack, load)` of a NamedTuple class of floats, ints, bools, such classes and fixed tuples of these.

    `pack(value)` gives the float64s; `load(p)` or `load(p, first)`, an equation, builds the tuple from a pointer
    (or an array), an `int` field as an int and a `bool` field as a bool. at: where it starts unless `first` says.
    """
    scope: dict[str, Any] = {}
    leaves: list[type] = []
    expression = _load_expression(bundle, scope, leaves)
    load = write_function("load", f"def load(p, first={at}):\n    return {expression}\n", scope)

    def pack(value: Any) -> NDArray[np.float64]:
        """The float64s of one such tuple, in the order of its fields."""
        packed = np.array(list(_flattened(value)), dtype=np.float64)
        if packed.shape != (len(leaves),):
            raise ValueError(f"{bundle.__name__} has {len(leaves)} numbers, not {packed.size}")
        return packed

    return FlatAccess(len(leaves), pack, equation(load))


def _load_expression(kind: Any, scope: dict[str, Any], leaves: list[type]) -> str:
    """Source that builds `kind` from `p[first + i]`, i counted by `leaves`; `scope` collects the classes it names."""
    if kind in (float, int, bool):
        leaves.append(kind)
        element = f"p[first + {len(leaves) - 1}]"
        return {float: element, int: f"int({element})", bool: f"bool({element} != 0.0)"}[kind]
    if get_origin(kind) is tuple and Ellipsis not in get_args(kind):
        return "(" + "".join(_load_expression(part, scope, leaves) + ", " for part in get_args(kind)) + ")"
    if hasattr(kind, "_fields"):
        hints = get_type_hints(kind)
        name = f"{kind.__name__}_{len(scope)}"
        scope[name] = kind
        return f"{name}(" + ", ".join(_load_expression(hints[field], scope, leaves) for field in kind._fields) + ")"
    raise TypeError(f"flat_access keeps floats, ints, bools and named tuples of them, not {kind}")


def _flattened(value: Any) -> Iterator[float]:
    """The numbers of nested tuples, in order."""
    if isinstance(value, tuple):
        for part in value:
            yield from _flattened(part)
    else:
        yield float(value)


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
    """The number in a row of a lane."""
    value: float = work[row * len(lanes) + lane]
    return value


def gathering(one: Callable[..., Any], indices: range) -> Callable[..., tuple[Any, ...]]:
    """`gathered(work, lanes, lane)`: the tuple of one(work, lanes, index, lane), index by index."""
    each = "".join(f"one(work, lanes, {index}, lane), " for index in indices)
    return equation(
        write_function("gathered", f"def gathered(work, lanes, lane):\n    return ({each})\n", {"one": one})
    )
