"""Records in a lane buffer, and scalar functions of records made to run on lanes.

A `Layout` assigns named tuples their rows in a lane buffer. A function of records, decorated with `layout.on_lanes`, is
written without rows, lanes or loops: it takes the records that its parameters are annotated with, and returns those
that it changes. From the annotations the loop is generated that loads each lane's records, calls the function, and
stores what it returns; straight-line code, which LLVM vectorises. A result of a function beyond its memory (an offer to
the filter, an event, a state to reset) is a record that some procedure takes: its sink.

The loop is called with other arguments than the function has. They stand, one line for each function, in a module
`calls` beside the functions, which tools/calls.py writes and tests/compiling/test_calls.py holds; the decorator takes
that line, so that mypy checks every call.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from types import FunctionType
from typing import Any, NamedTuple, ParamSpec, Protocol, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from flownav.core.compiling.bundles import lane_access, write_function
from flownav.core.compiling.engine import equation, procedure

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result", covariant=True)


class OnLanes(Protocol[Arguments, Result]):
    """`run(work, lanes, **told)`, and the function of one lane's records itself."""

    law: Callable[..., Any]

    def __call__(self, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        """Call the law in every lane; True where a truth that it returns (a `bool` field) holds in any."""


class _Kept(NamedTuple):
    """How a record is loaded and stored. by_keyword: arguments of its access, such as which of several
    it is; buffer: the name of the lane buffer in which it lies.
    """

    load: Callable[..., Any]
    store: Callable[..., Any] | None
    by_keyword: tuple[str, ...]
    buffer: str = "work"


class _Sink(NamedTuple):
    """A procedure that takes a record of one lane, and the further arguments that it needs."""

    take: Callable[..., Any]
    needs: tuple[str, ...]


class Layout:
    """Where records lie in a lane buffer. below: the layout of the rows before these, whose records are known too."""

    def __init__(self, first: int = 0, below: Layout | None = None) -> None:
        self.next = first
        self._kept: dict[Any, _Kept] = {} if below is None else dict(below._kept)
        self._sinks: dict[Any, _Sink] = {} if below is None else dict(below._sinks)
        self._rows: dict[Any, Sequence[int]] = {} if below is None else dict(below._rows)
        self._fresh: list[tuple[int, tuple[float, ...]]] = []

    def take(self, count: int) -> int:
        """The first of `count` new rows."""
        first = self.next
        self.next += count
        return first

    def keep(self, record: Any, count: int = 1, index: str = "") -> int:
        """The first of new rows for a record, or for `count` of them, distinguished by a number of the name `index`.

        Before anything is stored a field has its default, or 0.
        """
        size = len(record._fields)
        first = self.take(count * size)
        access = _several(record, first) if index else lane_access(record, first)
        self._kept[record] = _Kept(*access, (index,) if index else ())
        self._rows[record] = range(first, first + size)
        defaults = record._field_defaults
        self._fresh.append((first, tuple(defaults.get(name, 0.0) for name in record._fields) * count))
        return first

    def name(self, record: Any, *rows: int) -> None:
        """Rows that exist already are the fields of a record."""
        self._rows[record] = rows
        self._kept[record] = _Kept(*lane_access(record, rows), ())

    def derive(self, record: Any, found: Callable[..., Any], *by_keyword: str) -> None:
        """A record that is not stored: `found(work, lanes, *told, lane)` computes it."""
        self._kept[record] = _Kept(found, None, by_keyword)

    def see(self, law: Callable[..., Any]) -> None:
        """A record that is not stored: the result of a law of other records of this layout, and of the law's
        arguments.
        """
        plan = _Plan(self, law)
        passed = plan.passed(law)
        source = f"def found({', '.join(['work', 'lanes', *plan.by_keyword, 'lane'])}):\n    return law({passed})\n"
        self.derive(
            get_type_hints(law)["return"], equation(write_function("found", source, plan.scope)), *plan.by_keyword
        )

    def anywhere(self, record: Any, row: str) -> tuple[Callable[..., Any], Callable[..., Any]]:
        """A record whose first row the caller passes by the name `row`; its access, `load(work, lanes, row, lane)`."""
        self._kept[record] = _Kept(*lane_access(record, None), (row,))
        return self.access(record)

    def beside(self, layout: Layout, buffer: str) -> None:
        """The records of another buffer are known too; the caller passes that buffer by the name `buffer`."""
        self._kept.update({record: kept._replace(buffer=buffer) for record, kept in layout._kept.items()})

    def sink(self, record: Any, take: Callable[..., Any], *needs: str) -> None:
        """A record that is not stored: `take(work, lanes, lane, value, *needs)` carries it out."""
        self._sinks[record] = _Sink(take, needs)

    def access(self, record: Any) -> tuple[Callable[..., Any], Callable[..., Any]]:
        """`load(work, lanes, lane)` and `store(work, lanes, lane, value)`; with an index, before `lane`."""
        kept = self._kept[record]
        assert kept.store is not None
        return kept.load, kept.store

    def row(self, record: Any, field: str) -> int:
        """The row of a record's field; of several such records, of the first."""
        rows = self._rows[record]
        place: int = record._fields.index(field)
        return rows[place]

    def put_fresh(self, work: NDArray[np.float64]) -> None:
        """Set every record that was kept to what it is before anything happened; work (rows, lanes)."""
        for first, values in self._fresh:
            work[first : first + len(values)] = np.array(values)[:, None]

    def on_lanes(self, call: Callable[Arguments, Result]) -> Callable[[Callable[..., Any]], OnLanes[Arguments, Result]]:
        """A decorator: a function of one lane's records becomes a procedure on all lanes, called as `call` is.

        call: a line of a module `calls`; only its arguments count, and only for whoever checks types.
        """
        return cast(Callable[[Callable[..., Any]], OnLanes[Arguments, Result]], self.loop)

    def loop(self, function: Callable[..., Any]) -> OnLanes[..., Any]:
        """A function of one lane's records made a procedure on all lanes.

        Its positional parameters are annotated with records of this layout, or with named tuples of them; its
        keyword-only ones are passed by the caller, the same for all lanes, as are an index and the arguments of sinks:
        `run(work, lanes, t_s, *others, o)`, the others as the function has them, then other buffers and indices. It
        returns a record, or a tuple or a named tuple of records, of truths and of such tuples.
        """
        return _generated(self, function)

    def _record(self, kind: Any, where: str) -> _Kept:
        if kind not in self._kept:
            raise TypeError(f"{where}: {kind} is no record of this layout")
        return self._kept[kind]


def _several(record: Any, first: int) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Access to one of several records after one another: `load(work, lanes, index, lane)`."""
    size = len(record._fields)
    load, store = lane_access(record, None)
    scope = {"load": load, "store": store}
    found = write_function(
        "found",
        f"def found(work, lanes, index, lane):\n    return load(work, lanes, {first} + {size} * index, lane)\n",
        scope,
    )
    put = write_function(
        "put",
        f"def put(work, lanes, index, lane, value):\n    store(work, lanes, {first} + {size} * index, lane, value)\n",
        scope,
    )
    return equation(found), equation(put)


# -- from annotations to source -------------------------------------------------------------------------------
class _Plan:
    """The source of one generated loop, as it grows: its arguments, and the names in its text."""

    def __init__(self, layout: Layout, function: Callable[..., Any]) -> None:
        self.layout, self.name = layout, function.__name__
        self.scope: dict[str, Any] = {"law": compiled(function)}
        self.by_keyword = [p.name for p in parameters(function) if p.kind is p.KEYWORD_ONLY]
        self.truths: list[str] = []

    def also(self, names: tuple[str, ...]) -> str:
        """Add these names to the loop's arguments; return them as arguments of a call, each followed by a comma."""
        self.by_keyword += [name for name in names if name not in self.by_keyword]
        return "".join(f"{name}, " for name in names)

    def known(self, value: Any) -> str:
        """A name of the generated text for a function."""
        name = f"f{len(self.scope)}"
        self.scope[name] = value
        return name

    def loaded(self, kind: Any, name: str) -> str:
        """An expression for a record of one lane, or for a record of such records."""
        if kind not in self.layout._kept and _is_of_records(kind):
            parts = get_type_hints(kind)
            return f"{self.known(kind)}({', '.join(self.loaded(parts[part], name) for part in kind._fields)})"
        kept = self.layout._record(kind, f"{self.name}, parameter {name}")
        return f"{self.known(kept.load)}({self.place(kept)})"

    def passed(self, function: Callable[..., Any]) -> str:
        """Arguments of the law's call, in one lane."""
        kinds = get_type_hints(function)
        return ", ".join(
            p.name if p.kind is p.KEYWORD_ONLY else self.loaded(kinds[p.name], p.name) for p in parameters(function)
        )

    def place(self, kept: _Kept) -> str:
        """Where a record lies, as arguments of a call."""
        buffer = self.also((kept.buffer,)) if kept.buffer != "work" else "work, "
        return f"{buffer}lanes, {self.also(kept.by_keyword)}lane"

    def put(self, kind: Any, value: str) -> list[str]:
        """Lines that store what was returned, or pass it to its sink."""
        if kind is bool:
            self.truths.append(f"any{len(self.truths)}")
            return [f"{self.truths[-1]} = {self.truths[-1]} or {value}"]
        if get_origin(kind) is tuple:
            return [line for i, part in enumerate(get_args(kind)) for line in self.put(part, f"{value}[{i}]")]
        if kind in self.layout._sinks:
            sink = self.layout._sinks[kind]
            needs = self.also(sink.needs)
            return [f"{self.known(sink.take)}(work, lanes, lane, {value}, {needs})"]
        if kind not in self.layout._kept and _is_of_records(kind):
            parts = get_type_hints(kind)
            return [line for name in kind._fields for line in self.put(parts[name], f"{value}.{name}")]
        kept = self.layout._record(kind, f"{self.name} returns {value}")
        if kept.store is None:
            raise TypeError(f"{self.name} returns {kind}, which is computed and cannot be stored")
        return [f"{self.known(kept.store)}({self.place(kept)}, {value})"]


def _is_of_records(kind: Any) -> bool:
    """Whether a named tuple has fields that are no numbers."""
    return hasattr(kind, "_fields") and not {float, int} & set(get_type_hints(kind).values())


def _generated(layout: Layout, function: Callable[..., Any]) -> OnLanes[..., Any]:
    if function.__kwdefaults__:
        raise TypeError(f"{function.__name__}: what the caller tells has no defaults")
    plan, result = _Plan(layout, function), get_type_hints(function)["return"]
    lines = [f"found = law({plan.passed(function)})", *plan.put(result, "found")]
    by_keyword = sorted(plan.by_keyword, key=lambda name: (name != "t_s", name == "o"))  # as the house has them
    source = [f"def run({', '.join(['work', 'lanes', *by_keyword])}):"]
    source += [f"    {truth} = False" for truth in plan.truths]
    source += ["    for lane in range(len(lanes)):", *(f"        {line}" for line in lines)]
    source += [f"    return {' or '.join(plan.truths)}"] if plan.truths else []
    return cast(OnLanes[..., Any], dressed(write_function("run", "\n".join(source) + "\n", plan.scope), function))


def parameters(function: Callable[..., Any]) -> list[inspect.Parameter]:
    """The parameters of a function, in order."""
    return list(inspect.signature(function).parameters.values())


def compiled(function: Any) -> Callable[..., Any]:
    """The law as an equation. Numba knows no keyword-only parameters, so they become ordinary ones."""
    code = function.__code__
    plain = code.replace(co_argcount=code.co_argcount + code.co_kwonlyargcount, co_kwonlyargcount=0)
    return equation(FunctionType(plain, function.__globals__, function.__name__, None, function.__closure__))


def dressed(generated: Any, function: Any, defaults: tuple[float, ...] = ()) -> Callable[..., Any]:
    """The generated function under the law's name, a procedure, the law beside it; defaults: of its last arguments."""
    generated.__name__ = generated.__qualname__ = function.__name__
    generated.__doc__, generated.__module__ = function.__doc__, function.__module__
    generated.law, generated.__defaults__ = function, defaults or None
    return cast(Callable[..., Any], procedure(generated))
