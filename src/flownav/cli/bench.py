"""`flownav bench`: how fast this machine runs flownav, as ratios and times measured in one run."""

from __future__ import annotations

from typing import Annotated, Any

from flownav.cli import options
from flownav.cli.options import option
from flownav.cli.tables import Column, answer, say, table_of

WIDE = 144  # columns of the table
COLUMNS = (
    Column("figure", "name"),
    Column("measured", lambda row: f"{row['value']:.3g} {row['unit']}"),
    Column("asked", lambda row: "" if row["asked"] is None else _asked(row)),
    Column("verdict", lambda row: {True: "reached", False: "missed", None: ""}[row["reached"]]),
    Column("note", "note"),
)


def command(
    flights: Annotated[int, option("N", "Flights in the batch that is timed.")] = 1024,
    as_json: options.Json = False,
) -> None:
    """Measure flights on both filters, lanes, the filters' steps, replay, start-up, compile time and memory."""
    from flownav.cli.output import progress, require_between
    from flownav.studies.benchmark.measures import MEASUREMENTS, measure_all

    require_between("--flights", flights, 16, 1_000_000)
    figures = []
    with progress("Measuring", MEASUREMENTS) as advance:
        for measured in measure_all(flights):
            figures += measured
            advance(1)
    rows = [{**figure.__dict__, "reached": figure.reached} for figure in figures]
    shown = table_of(COLUMNS, rows, title="flownav on this machine", title_justify="left")
    shown.columns[1].justify = shown.columns[2].justify = "right"
    answer({"figures": rows}, as_json, lambda: say(shown, wide=WIDE))


def _asked(row: dict[str, Any]) -> str:
    return f"{'>=' if row['more_is_better'] else '<='} {row['asked']:g} {row['unit']}"
