"""Named tuples in kernels and flat buffers: code that loads, stores and changes them, written out field by field.

LLVM vectorises straight-line code only, so the functions are generated, not looped.
"""

import hashlib
import linecache
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from flownav.core.compiling.engine import equation
from flownav.core.compiling.spelled import load_spelled, replaced_spelled, store_spelled


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
    told = "work, lanes, lane" if row is not None else "work, lanes, row, lane"
    stores = "\n".join(f"    {place} = value.{name}" for place, name in zip(at, fields, strict=True))
    scope: dict[str, Any] = {"bundle": bundle}
    load = write_function("load", f"def load({told}):\n    return bundle({', '.join(at)})\n", scope)
    store = write_function("store", f"def store({told}, value):\n{stores}\n", scope)
    return load_spelled(load, bundle, rows), store_spelled(store, bundle, rows)


Bundle = TypeVar("Bundle", bound=tuple[Any, ...])


def replacing(bundle: type[Bundle], *names: str) -> Callable[..., Bundle]:
    """`replaced(value, **named)`: a named tuple with these fields anew, all of them; the others as they are.

    `NamedTuple._replace` does not compile. ValueError where the bundle has no such field.
    """
    fields = _known(bundle, names)
    values = ", ".join(name if name in names else f"value.{name}" for name in fields)
    source = f"def replaced(value, {', '.join(names)}):\n    return bundle({values})\n"
    return replaced_spelled(write_function("replaced", source, {"bundle": bundle}), bundle, names)


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
