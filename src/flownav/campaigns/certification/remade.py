"""Rows of a certificate held against its plan, all of them, without a flight: number, inputs and words of each.

Only a flight's scores come of flying it. Its cell, its number, the inputs that were drawn for it, its verdict and its
limiting cause follow from the plan and from the scores, so that all rows are held against them, and not a sample. A
flight that fails and was replaced by one of another number, or was moved to another wind, is found here.
"""

from __future__ import annotations

from typing import Any

from flownav.campaigns.certification.again import difference
from flownav.campaigns.chain import DIGEST_BYTES, DamagedError, digests_of, read_part
from flownav.campaigns.plan import Plan
from flownav.campaigns.store import Dataset, rows_of_table, table_of
from flownav.core.errors import InputError

NOTHING_BEFORE = bytes(DIGEST_BYTES)
ANEW = "move the folder away, and fly it anew"


def require_drawn(plan: Plan, data: Dataset) -> None:
    """InputError unless a folder's rows are the flights of a plan, each with what was drawn for it.

    It names the first row that is another, and what it was.
    """
    for cell in range(len(plan.cells)):
        flights = _checked_flights(plan, data, cell)
        if flights != plan.flights:
            raise InputError(f"{data.folder}: cell {cell} has {flights} flights, not {plan.flights}; {ANEW}")


def require_numbered(plan: Plan, data: Dataset) -> None:
    """InputError unless a folder's rows have the numbers of a plan's flights, each once and in order. What another
    version of flownav drew for them is not known here.
    """
    for cell, own in enumerate(plan.cells):
        numbers = data.column(cell, "flight").tolist() if data.parts(cell) else []
        if len(numbers) != plan.flights:
            raise InputError(f"{data.folder}: cell {cell} has {len(numbers)} flights, not {plan.flights}; {ANEW}")
        row = next((row for row, number in enumerate(numbers) if number != own.first + row), None)
        if row is not None:
            raise InputError(
                f"{data.folder}: row {row + 1} of cell {cell} is flight {numbers[row]}, not {own.first + row}; {ANEW}"
            )


def _checked_flights(plan: Plan, data: Dataset, cell: int) -> int:
    """How many flights a cell's files hold. InputError where one is not as the plan draws it."""
    ready, first, values = plan.ready(cell), plan.cells[cell].first, plan.cells[cell].values
    flights = 0
    for path in data.parts(cell):
        try:
            kept = read_part(path).table
            rows = rows_of_table(kept)
        except (DamagedError, KeyError, ValueError) as error:
            raise InputError(f"{path}: is damaged ({error}); {ANEW}") from None
        number, flights = first + flights, flights + len(rows)
        drawn = ready.ensemble.values(plan.seed, number, len(rows)) if ready.ensemble and len(rows) else {}
        _require_same(kept, table_of(cell, values, number, rows, drawn), f"{path}")
    return flights


def _require_same(kept: Any, own: Any, where: str) -> None:
    """InputError with the first row that differs. Tables of as many rows."""
    pairs = zip(digests_of(kept, NOTHING_BEFORE), digests_of(own, NOTHING_BEFORE), strict=True)
    row = next((number for number, (there, ours) in enumerate(pairs) if there != ours), None)
    if row is not None:
        raise InputError(f"{where}: row {row + 1} {difference(kept.slice(row, 1), own.slice(row, 1), 'drawn')}")
