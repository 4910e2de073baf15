"""P <- F P F' for a sparse F that is written as a law: new errors as linear functions of old ones, by name.

F stands nowhere as a matrix. A law such as `motion.errors_in_motion` says what some errors become, given others;
applied to each column of P and then, on the block of its own states, to each row, it moves the whole covariance in
one pass and multiplies by no zero.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import combinations_with_replacement, pairwise
from typing import Any, NamedTuple, Protocol, cast, get_type_hints

from flownav.estimation.covariance import column
from flownav.estimation.law import Signature, at, value_of
from flownav.estimation.states import MOST_SOURCES, PLACES, SCRATCH, SHORT_NAMES


class Transition(Protocol):
    """`transition(work, lanes, n, **scalars)`, and the law itself."""

    law: Callable[..., Any]

    def __call__(self, work: Any, lanes: Any, n: Any, *scalars: float, **named: float) -> None:
        """Move the covariance of every lane."""


def transition(function: Callable[..., Any]) -> Transition:
    """The transition of the states that the law's result names; it reads states, rows and keyword-only scalars.

    The law must be linear in the states that it reads, and it must read what it changes.
    """
    plan = _Plan.of(function)
    return _generated(plan, [*plan.columns_beside(), *plan.block_out(), *plan.block_moved(), *plan.block_back()])


def block_ahead(function: Callable[..., Any]) -> Transition:
    """The transition of a law's own states alone, left in SCRATCH: P stays as it is (`block_place` says where)."""
    plan = _Plan.of(function)
    return _generated(plan, [*plan.block_out(), *plan.block_moved()])


def block_place(function: Callable[..., Any], state: int) -> tuple[int, int]:
    """Where a state's column begins in the block of `block_ahead`, and which row of each column it is."""
    sources = _Plan.of(function).sources
    place = sources.index(state)
    return SCRATCH + place * len(sources), place


def _generated(plan: _Plan, lines: list[str]) -> Transition:
    takes = plan.takes
    head = f"def move({', '.join(['work', 'lanes', 'n', *takes.scalars])}):"
    return cast(Transition, takes.generated("move", [head, *lines], column=column))


class _Plan(NamedTuple):
    """Plan of a transition: the states that it reads and changes, and the source of its pass, part by part.

    The block of P on its own states goes through SCRATCH, where element (row, column) of both triangles lies at
    `SCRATCH + column * width + row`, rows and columns counted along `sources`.
    """

    takes: Signature
    sources: list[int]
    targets: list[int]

    @classmethod
    def of(cls, function: Callable[..., Any]) -> _Plan:
        """By the names of a law. NameError where it changes what it does not read; ValueError where it reads much."""
        takes = Signature.of(function)
        sources = sorted(PLACES[name] for name in takes.names if name in PLACES)
        targets = [PLACES[name] for name in get_type_hints(function)["return"]._fields]
        if not set(targets) <= set(sources):
            raise NameError(f"{function.__name__} changes states that it does not read")
        if len(sources) > MOST_SOURCES:
            raise ValueError(f"{function.__name__} reads more than {MOST_SOURCES} states")
        return cls(takes, sources, targets)

    def columns_beside(self) -> list[str]:
        """Columns of the states that the law does not read: what F makes of them stays where they are."""
        lines = []
        for first, end in gaps(self.sources):
            lines += [f"    for j in range({first}, {end}):", *self._called(partial(beside, first))]
        return lines

    def block_out(self) -> list[str]:
        """The transition's own block into SCRATCH, its upper triangle first and then mirrored."""
        lines = []
        for one, other in combinations_with_replacement(runs(self.sources, []), 2):
            lines += self._copied(one, other, f"{self._scratch('i', 'j', one, other)} = {packed('i', 'j')}")
        width = len(self.sources)
        mirrored = f"{at(f'{SCRATCH} + i * {width} + j')} = {at(f'{SCRATCH} + j * {width} + i')}"
        return [*lines, *loops(f"0, {width}", "0, j", mirrored)]

    def block_moved(self) -> list[str]:
        """F P by columns, and (F P) F' by rows."""
        width, place = len(self.sources), self.sources.index
        lines = [f"    for k in range({width}):"]
        lines += self._called(lambda state: at(f"{SCRATCH + place(state)} + k * {width}"))
        for run in self._runs_of_targets():
            lines += [f"    for k in range({place(run[0])}, {place(run[-1]) + 1}):"]
            lines += self._called(lambda state: at(f"{SCRATCH + place(state) * width} + k"))
        return lines

    def block_back(self) -> list[str]:
        """The rows that changed, back into the triangle."""
        lines, changed = [], self._runs_of_targets()
        for one, other in combinations_with_replacement(runs(self.sources, self.targets), 2):
            if one in changed:
                lines += self._copied(one, other, f"{packed('i', 'j')} = {self._scratch('i', 'j', one, other)}")
            elif other in changed:
                lines += self._copied(one, other, f"{packed('i', 'j')} = {self._scratch('j', 'i', other, one)}")
        return lines

    def _called(self, where: Callable[[int], str]) -> list[str]:
        """The law called on errors that lie at `where`; what becomes of them is put there."""
        call = self.takes.call(lambda name: where(PLACES[name]) if name in PLACES else value_of(name))
        return [
            "        for lane in range(len(lanes)):",
            f"            found = {call}",
            *(f"            {where(state)} = found.{SHORT_NAMES[state]}" for state in self.targets),
        ]

    def _runs_of_targets(self) -> list[list[int]]:
        return [run for run in runs(self.sources, self.targets) if run[0] in self.targets]

    def _scratch(self, row: str, column: str, rows: list[int], columns: list[int]) -> str:
        """Where SCRATCH has the element of two states, given by variables that run through `rows` and `columns`."""
        shift = self.sources.index(columns[0]) - columns[0]
        along = self.sources.index(rows[0]) - rows[0]
        return at(f"{SCRATCH + along} + ({column} + {shift}) * {len(self.sources)} + {row}")

    def _copied(self, one: list[int], other: list[int], line: str) -> list[str]:
        """A line for each element (i, j), i <= j, i in `one` and j in `other`."""
        return loops(f"{other[0]}, {other[-1] + 1}", f"{one[0]}, {'j + 1' if one == other else one[-1] + 1}", line)


# -- from states to source ----------------------------------------------------------------------------------
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


def packed(i: str, j: str) -> str:
    """Element (i, j) of P, i <= j, two variables."""
    return at(f"column({j}) + {i}")


def beside(first: int, state: int) -> str:
    """Element (state, j) of P, for a j that runs from `first` on, on one side of the state."""
    if state < first:
        return at(f"column(j) + {state}")
    return at(f"{column(state)} + j")


def loops(j: str, i: str, line: str) -> list[str]:
    """A line in a loop over j, i and lanes."""
    return [
        f"    for j in range({j}):",
        f"        for i in range({i}):",
        "            for lane in range(len(lanes)):",
        f"                {line}",
    ]
