"""Scalar functions over named scalars, made to run on lanes: the loops and the index arithmetic that laws do without.

A law names the scalars that it reads by its parameters, and the states that its Jacobian or its result concerns by the
fields of the NamedTuple in its return annotation. From these names the code is written that loads each scalar of one
lane, calls the law, and stores what it returns: straight-line code in a loop over lanes, which LLVM vectorises. Names
are those of `states.ROWS_BY_NAME`; a vector's (`states.VECTOR_ROWS`) means its component `axis`. A parameter that is
annotated with a NamedTuple is a record of such scalars: its fields are their names (`named`). Keyword-only parameters,
and fields of such records, are passed by the caller, the same for all lanes.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, cast, get_args, get_type_hints

from flownav.core.compile import compiled, dressed, write_function
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
    takes = Signature.of(function)
    jacobian = get_args(get_type_hints(function)["return"])[1]
    if len(jacobian._fields) > MOST_OBSERVED:
        raise ValueError(f"{function.__name__} reads more than {MOST_OBSERVED} states")
    reads = any(name.startswith("measured") for name in takes.names)
    noted = [f"work[{OBSERVED} * len(lanes)] = {len(jacobian._fields)}.0"]
    noted += [f"work[{OBSERVED + 1 + i} * len(lanes)] = {place(name)}" for i, name in enumerate(jacobian._fields)]
    stored = [f"work[{INNOVATION} * len(lanes) + lane] = {'' if reads else at(MEASURED) + ' - '}found"]
    stored += [f"{at(COEFFICIENT + i)} = jacobian.{name}" for i, name in enumerate(jacobian._fields)]
    source = (
        [f"def observe({', '.join(['work', 'lanes', 'axis', *takes.scalars])}):"]
        + [f"    {line}" for line in noted]
        + ["    for lane in range(len(lanes)):", f"        found, jacobian = {takes.call(value_of)}"]
        + [f"        {line}" for line in stored]
    )
    return cast(Observation, takes.generated("observe", source))


def step(function: Callable[..., Any]) -> Step:
    """A law that replaces rows: its result is a NamedTuple whose fields name them."""
    takes = Signature.of(function)
    result = get_type_hints(function)["return"]
    source = (
        [f"def move({', '.join(['work', 'lanes', *takes.scalars])}):", "    for lane in range(len(lanes)):"]
        + [f"        found = {takes.call(value_of)}"]
        + [f"        {at(ROWS_BY_NAME[name])} = found.{name}" for name in result._fields]
    )
    return cast(Step, takes.generated("move", source))


# -- from names to source -----------------------------------------------------------------------------------
class Parameter(NamedTuple):
    """A law's parameter of one name: a number, or a record of numbers that have names of their own."""

    name: str
    record: Any = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its numbers."""
        return (self.name,) if self.record is None else tuple(self.record._fields)

    def given(self, value: Callable[[str], str]) -> str:
        """Source of what the law is given; value: source of a number by its name."""
        numbers = ", ".join(map(value, self.names))
        return numbers if self.record is None else f"{self.record.__name__}({numbers})"


class Signature(NamedTuple):
    """A law, what it reads, and what its caller passes."""

    function: Any
    reads: tuple[Parameter, ...]
    passed: tuple[Parameter, ...]

    @classmethod
    def of(cls, function: Callable[..., Any]) -> Signature:
        """By its parameters and their annotations."""
        hints, found = get_type_hints(function), inspect.signature(function).parameters.values()
        records = {name: hint for name, hint in hints.items() if hasattr(hint, "_fields")}
        every = [(p.kind is p.KEYWORD_ONLY, Parameter(p.name, records.get(p.name))) for p in found]
        return cls(function, tuple(p for passed, p in every if not passed), tuple(p for passed, p in every if passed))

    @property
    def names(self) -> list[str]:
        """Names of the scalars that it reads."""
        return [name for parameter in self.reads for name in parameter.names]

    @property
    def scalars(self) -> list[str]:
        """The names of those that its caller passes."""
        return [name for parameter in self.passed for name in parameter.names]

    def call(self, value: Callable[[str], str]) -> str:
        """Source of a call; value: of a scalar that it reads, by its name."""
        read = [parameter.given(value) for parameter in self.reads]
        return f"law({', '.join([*read, *(f'{p.name}={p.given(str)}' for p in self.passed)])})"

    def generated(self, name: str, lines: list[str], **called: Callable[..., Any]) -> Callable[..., Any]:
        """The function of these lines, under the law's name, with the law beside it. called: what else they call."""
        scope = {p.record.__name__: p.record for p in (*self.reads, *self.passed) if p.record is not None}
        found = write_function(name, "\n".join(lines) + "\n", {"law": compiled(self.function), **scope, **called})
        return dressed(found, self.function, self._defaults())

    def _defaults(self) -> tuple[float, ...]:
        """Values of the scalars that a caller may leave out, which are the last."""
        known: dict[str, float] = dict(self.function.__kwdefaults__ or {})
        for parameter in self.passed:
            known |= {} if parameter.record is None else parameter.record._field_defaults
        return tuple(known[name] for name in self.scalars if name in known)


def at(row: int | str) -> str:
    """The place of a row's value in `lane`."""
    return f"work[({row}) * len(lanes) + lane]" if isinstance(row, str) else f"work[{row} * len(lanes) + lane]"


def value_of(name: str) -> str:
    """Source text of the value of a law's parameter of this name."""
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
