"""`flownav bench`: how fast this machine runs flownav, as ratios and times measured in one run."""

from __future__ import annotations

from typing import Annotated

import typer

from flownav.cli import options
from flownav.cli.output import emit

WIDE = 144  # columns of the table


def command(
    flights: Annotated[int, typer.Option(metavar="N", help="Flights in the batch that is timed.")] = 1024,
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
    if as_json:
        rows = [{**figure.__dict__, "reached": figure.reached} for figure in figures]
        emit({"figures": rows})
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(title="flownav on this machine", title_justify="left")
    for heading in ("figure", "measured", "asked", "verdict", "note"):
        table.add_column(heading, justify="right" if heading in ("measured", "asked") else "left")
    for figure in figures:
        sign = ">=" if figure.more_is_better else "<="
        verdict = {True: "reached", False: "missed", None: ""}[figure.reached]
        asked = "" if figure.asked is None else f"{sign} {figure.asked:g} {figure.unit}"
        table.add_row(figure.name, f"{figure.value:.3g} {figure.unit}", asked, verdict, figure.note)
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, WIDE)
    console.print(table)
