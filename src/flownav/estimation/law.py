"""Scalar functions over named scalars, made to run on lanes: the loops and the index arithmetic that laws do without.

A law says which scalars it reads by the names of its parameters, and which states its Jacobian or its result concerns
by the fields of the NamedTuple that its return annotation names. From these names the code is written that loads each
scalar of one lane, calls the law, and stores what it returns: straight-line code in a loop over lanes, which LLVM
vectorises. Names are those of `states.ROWS_BY_NAME`; a vector's (`states.VECTOR_ROWS`) means its component `axis`.
Keyword-only parameters are passed by the caller, the same for all lanes.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, Protocol, cast, get_args, get_type_hints

from flownav.compile import compiled, dressed, write_function
from flownav.estimation.states import (
    COEFFICIENT,
    INNOVATION,
    MEASURED,
    MOST_OBSERVED,
    OBSERVED,
    PLACES,
    ROWS_BY_NAME,
    VECTOR_ROWS,
    VECTORS,
)


class Observation(Protocol):
    """`observe(work, lanes, axis, **scalars)`, and the law itself, a function of floats or complex numbers."""

    law: Callable[..., tuple[Any, Any]]

    def __call__(self, work: Any, lanes: Any, axis: Any, *scalars: float, **named: float) -> None:
        """Set INNOVATION, COEFFICIENT and OBSERVED."""


class Step(Protocol):
    """`step(work, lanes, **scalars)`, and the law itself."""

    law: Callable[..., Any]

    def __call__(self, work: Any, lanes: Any, *scalars: float, **named: float) -> None:
        """Replace the rows that the law's result names, in every lane."""


def law(function: Callable[..., tuple[Any, Any]]) -> Observation:
    """An observation's law: `(prediction, Jacobian)`, or `(innovation, Jacobian)` where it reads `measured`.

    The innovation of the former is row MEASURED less the prediction. The Jacobian is that of the prediction on the
    error states, in both cases; its fields are states' names.
    """
    names, scalars = parameters(function)
    jacobian = get_args(get_type_hints(function)["return"])[1]
    if len(jacobian._fields) > MOST_OBSERVED:
        raise ValueError(f"{function.__name__} reads more than {MOST_OBSERVED} states")
    reads = any(name.startswith("measured") for name in names)
    noted = [f"work[{OBSERVED} * len(lanes)] = {len(jacobian._fields)}.0"]
    noted += [f"work[{OBSERVED + 1 + i} * len(lanes)] = {place(name)}" for i, name in enumerate(jacobian._fields)]
    stored = [f"work[{INNOVATION} * len(lanes) + lane] = {'' if reads else at(MEASURED) + ' - '}found"]
    stored += [f"{at(COEFFICIENT + i)} = jacobian.{name}" for i, name in enumerate(jacobian._fields)]
    source = (
        [f"def observe({', '.join(['work', 'lanes', 'axis', *scalars])}):"]
        + [f"    {line}" for line in noted]
        + ["    for lane in range(len(lanes)):", f"        found, jacobian = law({arguments(names, scalars)})"]
        + [f"        {line}" for line in stored]
    )
    observe = write_function("observe", "\n".join(source) + "\n", {"law": compiled(function)})
    return cast(Observation, dressed(observe, function))


def step(function: Callable[..., Any]) -> Step:
    """A law that replaces rows: its result is a NamedTuple whose fields name them."""
    names, scalars = parameters(function)
    result = get_type_hints(function)["return"]
    source = (
        [f"def move({', '.join(['work', 'lanes', *scalars])}):", "    for lane in range(len(lanes)):"]
        + [f"        found = law({arguments(names, scalars)})"]
        + [f"        {at(ROWS_BY_NAME[name])} = found.{name}" for name in result._fields]
    )
    move = write_function("move", "\n".join(source) + "\n", {"law": compiled(function)})
    return cast(Step, dressed(move, function))


# -- from names to source -----------------------------------------------------------------------------------
def parameters(function: Callable[..., Any]) -> tuple[list[str], list[str]]:
    """The names of what a law reads and of what its caller passes."""
    found = inspect.signature(function).parameters.values()
    return (
        [p.name for p in found if p.kind is not p.KEYWORD_ONLY],
        [p.name for p in found if p.kind is p.KEYWORD_ONLY],
    )


def at(row: int | str) -> str:
    """The place of a row's value in `lane`."""
    return f"work[({row}) * len(lanes) + lane]" if isinstance(row, str) else f"work[{row} * len(lanes) + lane]"


def value_of(name: str) -> str:
    """What a law's parameter of this name is given."""
    if name == "axis":
        return "axis"
    if name in VECTOR_ROWS:
        return at(f"{VECTOR_ROWS[name]} + axis")
    if name not in ROWS_BY_NAME:
        raise NameError(f"a law reads '{name}', which is no state, no vector and no row")
    return at(ROWS_BY_NAME[name])


def place(name: str) -> str:
    """A state's place, as source that gives a float."""
    if name in VECTORS:
        return f"float({VECTORS[name]} + axis)"
    if name not in PLACES:
        raise NameError(f"a Jacobian names '{name}', which is no state")
    return f"{PLACES[name]}.0"


def arguments(names: list[str], scalars: list[str]) -> str:
    """The arguments of a call of the law."""
    return ", ".join([*(value_of(name) for name in names), *(f"{name}={name}" for name in scalars)])
