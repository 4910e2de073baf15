"""Functions that kernels get as instructions: no code of Numba's is made, typed and optimised for each of them.

A record is read from and written to a lane buffer by hundreds of short functions. As equations each of them costs the
compiler as long as a law does.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin


def load_intrinsic(function: Callable[..., Any], bundle: type, rows: tuple[int, ...] | None) -> Callable[..., Any]:
    """`load(work, lanes, lane)` of the generated Python function; rows None: the first is an argument, before the
    lane.
    """
    fields: tuple[str, ...] = bundle._fields  # type: ignore[attr-defined]
    kind = types.BaseTuple.from_types((types.float64,) * len(fields), bundle)

    def typed(work: Any, lanes: Any, *places: Any) -> Any:
        return signature(kind, work, lanes, *(types.intp for _ in places))

    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = [builder.load(place) for place in _places(context, builder, sig, args[0], args[2:], rows, len(fields))]
        return context.make_tuple(builder, kind, at)

    return _intrinsic(function, _on_work(typed), lowered)


def store_intrinsic(function: Callable[..., Any], bundle: type, rows: tuple[int, ...] | None) -> Callable[..., Any]:
    """`store(work, lanes, lane, value)` likewise; fields that the value leaves out are stored by their defaults."""
    fields: tuple[str, ...] = bundle._fields  # type: ignore[attr-defined]
    defaults: dict[str, float] = bundle._field_defaults  # type: ignore[attr-defined]

    def typed(work: Any, lanes: Any, *arguments: Any) -> Any:
        *places, value = arguments
        if getattr(value, "fields", ()) != fields or not set(fields[len(value) :]) <= set(defaults):
            return None
        return signature(types.none, work, lanes, *(types.intp for _ in places), value)

    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = _places(context, builder, sig, args[0], args[2:-1], rows, len(fields))
        kinds = list(sig.args[-1])
        for i, place in enumerate(at):
            if i < len(kinds):
                number = context.cast(builder, builder.extract_value(args[-1], i), kinds[i], types.float64)
            else:  # Numba makes a named tuple of the given numbers: the rest is by default
                number = context.get_constant(types.float64, defaults[fields[i]])
            builder.store(number, place)
        return context.get_dummy_value()

    return _intrinsic(function, _on_work(typed), lowered)


def replaced_intrinsic(function: Callable[..., Any], bundle: type, names: tuple[str, ...]) -> Callable[..., Any]:
    """`replaced(value, **named)` of the generated Python function."""
    fields: tuple[str, ...] = bundle._fields  # type: ignore[attr-defined]
    signature_of_function = inspect.signature(function)

    def typed(args: Any, kws: Any) -> Any:
        value, *new = signature_of_function.bind(*args, **kws).args
        if getattr(value, "fields", ()) != fields:
            return None
        parts = dict(zip(fields, value, strict=True)) | dict(zip(names, map(types.unliteral, new), strict=True))
        kind = types.BaseTuple.from_types(tuple(parts.values()), bundle)
        return signature(kind, value, *(parts[name] for name in names)).replace(pysig=signature_of_function)

    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        new = dict(zip(names, args[1:], strict=True))
        parts = (new[name] if name in new else builder.extract_value(args[0], i) for i, name in enumerate(fields))
        return context.make_tuple(builder, sig.return_type, list(parts))

    return _intrinsic(function, typed, lowered)


def _places(
    context: Any, builder: Any, sig: Any, work: Any, places_given: Any, rows: tuple[int, ...] | None, count: int
) -> list[Any]:
    """Where each field of a lane stands, as addresses."""
    kind, width, integer = sig.args[0], sig.args[1].count, places_given[-1].type
    begin = work if isinstance(kind, types.CPointer) else context.make_array(kind)(context, builder, value=work).data
    if rows is None:
        first = builder.add(builder.mul(places_given[0], integer(width)), places_given[-1])
        return [builder.gep(begin, [builder.add(first, integer(i * width))]) for i in range(count)]
    return [builder.gep(begin, [builder.add(places_given[-1], integer(row * width))]) for row in rows]


def _on_work(typed: Callable[..., Any]) -> Callable[..., Any]:
    """The type of a function whose first argument is a lane buffer: the address of float64s, or an array of them."""

    def of_call(args: Any, kws: Any) -> Any:
        work = args[0]
        flat = isinstance(work, types.Array) and work.layout == "C" and work.ndim == 1
        known = isinstance(work, types.CPointer) or (flat and work.mutable)
        return typed(*args) if known and not kws and work.dtype == types.float64 else None

    return of_call


def _intrinsic(
    function: Callable[..., Any], typed: Callable[..., Any], lowered: Callable[..., Any]
) -> Callable[..., Any]:
    class Intrinsic(AbstractTemplate):
        """Its type."""

        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            return typed(args, kws)

    infer_global(function, types.Function(Intrinsic))
    lower_builtin(function, types.VarArg(types.Any))(lowered)
    return function
