"""The table of `make integrity` as Markdown, and its place in a page."""

from __future__ import annotations

from collections.abc import Sequence

from flownav.campaigns.faults.integrity import LONG_S, SUSPECTS, TOGETHER, Row
from flownav.campaigns.faults.table import NO_FAULT
from flownav.core.errors import InputError
from flownav.core.version import __version__

BEGIN, END = "<!-- make integrity: begin -->", "<!-- make integrity: end -->"
HEADINGS = (
    "fault", "flights", "suspected [% of flights]", "warning stands [% of steps]",
    "above the level unsaid, horizontal [‰ of steps]", "vertical [‰]", "at most above [m]", "vertical [m]",
    "level / error, median", "vertical", "level, median [m]", "vertical [m]",
)  # fmt: skip


def table(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table."""
    lines = [HEADINGS, ("---", *["---:"] * (len(HEADINGS) - 1)), *map(_cells, rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def section(rows: Sequence[Row], long: Sequence[Row], seeds: tuple[int, int], cost: float) -> str:
    """The tables with how they were made.

    rows: of faults as `flownav faults` has them; long: of such that last. seeds: first and last of all flights. cost:
    the time of following faults, as a factor on the navigator's.
    """
    steps = sum(row.steps for row in rows if row.fault != TOGETHER)
    return (
        f"Printed by `make integrity` with flownav {__version__}, seeds {seeds[0]} to {seeds[1]}, {steps} steps. The "
        f"navigator took {cost:.2f} times as long as without following faults.\n\n{table(rows)}\n"
        + "".join(f"{alarms(row)}\n\n" for row in rows if row.fault == NO_FAULT)
        + f"The same with faults that last {LONG_S:g} s (`silence` 5 s):\n\n{table(long)}"
    )


def alarms(row: Row) -> str:
    """The warnings of flights in which nothing failed."""
    counted = {SUSPECTS: 0.0, **row.raised}
    said = "; ".join(f"`{name}` in {round(share * row.flights)}" for name, share in counted.items())
    return f"Warnings in the {row.flights} flights in which nothing fails: {said}."


def placed(page: str, text: str, name: str) -> str:
    """A page with a text between its two marks. InputError where it lacks them."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise InputError(f"{name}: lacks the lines {BEGIN} and {END}; put them where the table belongs")
    return f"{before}{BEGIN}\n\n{text}\n{END}{after}"


def _cells(row: Row) -> tuple[str, ...]:
    percent = [f"{100.0 * share:.1f}" for share in (row.raised.get(SUSPECTS, 0.0), row.said)]
    unsaid = [f"{1000.0 * share:.2f}" for share in row.unsaid]
    metres = [f"{value:.2f}" for value in (*row.beyond_m, *row.ratio, *row.level_m)]
    name = f"`{row.fault}`" if " " not in row.fault else f"**{row.fault}**"
    return (name, str(row.flights), *percent, *unsaid, *metres)
