"""P <- F P F' for a sparse F that is written as a law: new errors as linear functions of old ones, by name.

F stands nowhere as a matrix. A law such as `motion.errors_in_motion` says what some errors become, given others;
applied to each column of P and then, on the block of its own states, to each row, it moves the whole covariance in
one pass and multiplies by no zero.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any, Protocol, cast, get_type_hints

from flownav.compiling.bundles import write_function
from flownav.estimation.law import at, compiled, dressed, parameters, value_of
from flownav.estimation.states import COVARIANCE, MOST_SOURCES, PLACES, SCRATCH, SHORT_NAMES


class Transition(Protocol):
    """`transition(work, lanes, n, **scalars)`, and the law itself."""

    law: Callable[..., Any]

    def __call__(self, work: Any, lanes: Any, n: Any, *scalars: float, **named: float) -> None:
        """Move the covariance of every lane."""


def transition(function: Callable[..., Any]) -> Transition:
    """The transition of the states that the law's result names; it reads states, rows and keyword-only scalars.

    The law must be linear in the states that it reads, and it must read what it changes.
    """
    names, scalars = parameters(function)
    sources = sorted(PLACES[name] for name in names if name in PLACES)
    targets = [PLACES[name] for name in get_type_hints(function)["return"]._fields]
    if not set(targets) <= set(sources):
        raise NameError(f"{function.__name__} changes states that it does not read")
    if len(sources) > MOST_SOURCES:
        raise ValueError(f"{function.__name__} reads more than {MOST_SOURCES} states")
    width, position = len(sources), {state: k for k, state in enumerate(sources)}

    def call(where: Callable[[int], str], changed: list[int]) -> list[str]:
        """Source that calls the law on errors that lie at `where`, and puts what becomes of them there."""
        given = [where(PLACES[name]) if name in PLACES else value_of(name) for name in names]
        passed = [f"{name}={name}" for name in scalars]
        return [
            "        for lane in range(len(lanes)):",
            f"            found = law({', '.join([*given, *passed])})",
            *(f"            {where(state)} = found.{SHORT_NAMES[state]}" for state in changed),
        ]

    lines = [f"def move(work, lanes, n{''.join(f', {name}' for name in scalars)}):"]
    for first, end in gaps(sources):  # columns of states that the law does not read
        lines += [f"    for j in range({first}, {end}):", *call(partial(beside, first), targets)]
    for a, one in enumerate(runs(sources, [])):  # its own block, both triangles, column by column into SCRATCH
        for other in runs(sources, [])[a:]:
            lines += copied(one, other, width, position, out=True)
    lines += [f"    for k in range({width}):"]  # by columns
    lines += call(lambda state: at(f"{SCRATCH + position[state]} + k * {width}"), targets)
    blocks = runs(sources, targets)
    for one in blocks:  # by rows
        if one[0] in targets:
            lines += [f"    for k in range({position[one[0]]}, {position[one[-1]] + 1}):"]
            lines += call(lambda state: at(f"{SCRATCH + position[state] * width} + k"), targets)
    for a, one in enumerate(blocks):  # and back into the triangle
        for other in blocks[a:]:
            if one[0] in targets or other[0] in targets:
                lines += copied(one, other, width, position, out=False, by_row=one[0] in targets)
    move = write_function("move", "\n".join(lines) + "\n", {"law": compiled(function)})
    return cast(Transition, dressed(move, function))


def gaps(order: list[int]) -> list[tuple[int, int | str]]:
    """Ranges of the states that a transition does not read, in order; the last ends at `n`."""
    between: list[tuple[int, int | str]] = [(a + 1, b) for a, b in pairwise([-1, *order]) if b > a + 1]
    return [*between, (order[-1] + 1, "n")]


def runs(order: list[int], targets: list[int]) -> list[list[int]]:
    """Runs of consecutive states, all of them targets or none."""
    found: list[list[int]] = []
    for state in order:
        if found and state == found[-1][-1] + 1 and (state in targets) == (found[-1][-1] in targets):
            found[-1].append(state)
        else:
            found.append([state])
    return found


def beside(first: int, state: int) -> str:
    """Element (state, j) of P, for a j that runs from `first` on, on one side of the state."""
    if state < first:
        return at(f"{COVARIANCE + state} + (j * (j + 1) // 2 & 1023)")
    return at(f"{COVARIANCE + state * (state + 1) // 2} + j")


def copied(
    one: list[int], other: list[int], width: int, position: dict[int, int], out: bool, by_row: bool = False
) -> list[str]:
    """Source that copies elements (i, j), i <= j, i in `one` and j in `other`, to SCRATCH or back."""
    i, j = f"(i - {one[0] - position[one[0]]})", f"(j - {other[0] - position[other[0]]})"
    below, above = at(f"{SCRATCH} + {i} * {width} + {j}"), at(f"{SCRATCH} + {j} * {width} + {i}")
    element = at(f"{COVARIANCE} + (j * (j + 1) // 2 & 1023) + i")
    end = "j + 1" if one == other else f"{one[-1] + 1}"
    copies = [f"{above} = {element}", f"{below} = {element}"] if out else [f"{element} = {above if by_row else below}"]
    return [
        f"    for j in range({other[0]}, {other[-1] + 1}):",
        f"        for i in range({one[0]}, {end}):",
        "            for lane in range(len(lanes)):",
        *(f"                {line}" for line in copies),
    ]
