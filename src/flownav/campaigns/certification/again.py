"""Flights of a certificate flown again: a random sample, and all that decided at the margin, the same to the bit.

Digests reveal rows that were edited, not an editor who makes the digests anew. A flight is a function of the plan
and of its number, so that any of them can be repeated. Of n flights of which k were altered a sample of m misses all
with probability (1 - k/n)(1 - k/(n - 1)) ..., about exp(-m k / n): it finds an editor who turns a verdict against
the evidence of many flights. The alteration of one flight of thousands is found if that flight is at the margin, or
by flying all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from secrets import SystemRandom
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.certification.envelope import Judgement, bad_first, failed
from flownav.campaigns.chain import DIGEST_BYTES, digests_of
from flownav.campaigns.engines import Engine, Part
from flownav.campaigns.measures import measured
from flownav.campaigns.plan import Plan
from flownav.campaigns.requirement import Requirement
from flownav.campaigns.store import Dataset, table_of
from flownav.core.errors import InputError
from flownav.core.measurement import Array

SAMPLE = 64  # flights that every certificate flies again
MOST_AT_THE_MARGIN = 64  # flights of each requirement, those nearest to its limit


class Again(NamedTuple):
    """How many flights were flown again: drawn at random, and because they decided."""

    sample: int
    margin: int


def deciding(requirement: Requirement, judgements: Sequence[Judgement], rows: Array) -> NDArray[np.int64]:
    """The places of the flights without which a verdict would be another, rows (flights, len(ROW_COLUMNS)).

    Of a requirement that passes with `most` failures these are its most + 1 worst flights: as long as the last of them
    meets the limit, it passes. Of one that does not, the most + 1 failures that fail least. Of more than
    MOST_AT_THE_MARGIN those nearest to the limit.
    """
    found: list[int] = []
    for table, judgement in zip(requirement.requirement, judgements, strict=True):
        figures = measured(table.measure, rows)
        badness = bad_first(table, figures) * (1.0 if table.upper else -1.0)
        worst = np.argsort(-badness, kind="stable")
        if judgement.verdict != "pass":
            worst = worst[failed(table, figures)[worst]][::-1]
        own = worst[: judgement.most + 1]
        distance = np.abs(badness[own] - (table.limit if table.upper else -table.limit))
        found += own[np.argsort(distance, kind="stable")[:MOST_AT_THE_MARGIN]].tolist()
    return np.unique(np.array(found, np.int64))


def drawn(flights: int, sample: int) -> NDArray[np.int64]:
    """The numbers of `sample` of `flights` flights, drawn at random, sorted; all where there are no more."""
    return np.array(sorted(SystemRandom().sample(range(flights), min(sample, flights))), np.int64)


def fly_again(
    plan: Plan, data: Dataset, cell: int, numbers: Sequence[int], engine: Engine,
    on_progress: Callable[[int], object] = lambda flown: None,
) -> None:  # fmt: skip
    """Fly these flights of a cell again, and hold every number of their rows against the folder's, to the bit.

    InputError names the first that is another, and what it was.
    """
    ready, kept = plan.ready(cell), data.table(cell)
    parts = [Part(k, number, 1) for k, number in enumerate(numbers)]
    for part, rows in engine.fly(ready, plan.seed, parts, on_progress) if parts else ():
        inputs = ready.ensemble.values(plan.seed, part.first, 1) if ready.ensemble else {}
        own = table_of(cell, plan.cells[cell].values, part.first, rows, inputs)
        there = kept.slice(part.first - plan.cells[cell].first, 1)
        if digests_of(there, bytes(DIGEST_BYTES)) != digests_of(own, bytes(DIGEST_BYTES)):
            raise InputError(f"{data.folder}: flight {part.first} of cell {cell} {difference(there, own, 'flown')}")


def difference(there: Any, own: Any, made: str) -> str:
    """In what a flight of the folder is another than that which is made now; tables of one row. made: by which verb."""
    (kept,), (again,) = there.to_pylist(), own.to_pylist()
    differs = [name for name in {**again, **kept} if repr(kept.get(name)) != repr(again.get(name))] or ["a number"]
    more = f" and {len(differs) - 1} more" if len(differs) > 1 else ""
    name = differs[0]
    return (
        f"is not what is {made}: {name}{more} is {kept.get(name)} in the folder and {again.get(name)} {made} again; "
        "move the folder away, and fly it anew"
    )
