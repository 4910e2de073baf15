"""`flownav bench`: how fast this machine runs flownav, as ratios and times measured in one run."""

from __future__ import annotations

import json
from typing import Annotated

import typer

WIDE = 120  # columns of the table


def command(
    flights: Annotated[int, typer.Option(help="Size of the batch that is timed.")] = 1024,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Measure single flight, batch, lanes, filter, replay, start-up, compile time and memory."""
    from flownav.benchmark.measures import measure_all
    from flownav.cli.output import progress, require_between

    require_between("--flights", flights, 16, 1_000_000)
    figures = []
    with progress("Measuring", 9) as advance:
        for figure in measure_all(flights):
            figures.append(figure)
            advance(1)
    if as_json:
        rows = [{**figure.__dict__, "reached": figure.reached} for figure in figures]
        typer.echo(json.dumps({"figures": rows}))
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(title="flownav on this machine", title_justify="left")
    for heading in ("figure", "measured", "asked", "", "note"):
        table.add_column(heading, justify="right" if heading in ("measured", "asked") else "left")
    for figure in figures:
        sign = ">=" if figure.more_is_better else "<="
        verdict = "reached" if figure.reached else "missed"
        measured, asked = f"{figure.value:.3g} {figure.unit}", f"{sign} {figure.asked:g} {figure.unit}"
        table.add_row(figure.name, measured, asked, verdict, figure.note)
    console = Console()
    console.width = max(console.width, WIDE)
    console.print(table)
