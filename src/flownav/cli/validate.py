"""`flownav validate`: recorded flights flown again with simulated sensors, figure beside figure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flownav.cli import options
from flownav.cli.options import option, out_option
from flownav.cli.tables import answer, say, table

if TYPE_CHECKING:
    from flownav.studies.validation.job import Row

MOST_FLIGHTS = 1000
WIDE = 130  # columns that the table takes


DATA = "The folder that holds the logs."
FILE = "Which logs and outages."


def command(
    data: Annotated[Path, typer.Option(metavar="PATH", envvar="FLOWNAV_DATA", help=DATA)] = Path("../shared/data"),
    flights_file: Annotated[Path | None, option("FILE.toml", FILE, "--file", unset="three outdoor flights")] = None,
    flights: Annotated[int, option("N", "Simulated flights of each log.")] = 8,
    seed: options.Seed = 1,
    out: Annotated[Path | None, out_option("The page (Markdown)")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Hold the simulator against recorded flights: outage drift, innovations, noise, as flown and as simulated."""
    from flownav.cli.output import place, progress, require_between, write_text
    from flownav.core.errors import InputError, VerdictError
    from flownav.core.guard import an_input
    from flownav.studies.validation.drawn import load_flights
    from flownav.studies.validation.job import replays_of, validate
    from flownav.studies.validation.page import page

    require_between("--flights", flights, 1, MOST_FLIGHTS)
    path = None if out is None else place(out, data, flights_file, force=force)
    if not an_input(data).is_dir():
        raise InputError(f"{data}: no such folder; give the folder of logs by --data or FLOWNAV_DATA")
    recorded = load_flights(flights_file)
    with progress("Validating", replays_of(recorded, flights)) as advance:
        rows = validate(data, recorded, seed, flights, advance)
    if path is not None:
        write_text(path, page(rows, seed, flights, recorded.vehicle.path_bandwidth_hz))
    facts = {"seed": seed, "flights": flights, "rows": [row.as_json() for row in rows]}
    answer(facts | {"out": str(path) if path else None}, as_json, lambda: _show(rows))
    kind = [row for row in rows if row.decides and row.verdict == "too kind"]
    if kind:
        raise VerdictError(
            "; ".join(f"{row.log}: {row.figure} {row.flown:.2f}, simulated {row.high:.2f} at most" for row in kind)
        )


def _show(rows: list[Row]) -> None:
    """The rows for people."""
    from flownav.studies.validation.page import TOO_KIND, number, said, verdicts, widened

    heads = ("log", "figure", "flown", "simulated", "least", "largest", "the simulator is")
    shown = table(heads, title="Recorded flights, and the same paths with simulated sensors", title_justify="left")
    for k, column in enumerate(shown.columns):
        column.justify, column.no_wrap = ("left", True) if k in (0, 1, 6) else ("right", False)
    for row in rows:
        cells = [number(value) for value in (row.flown, row.simulated, row.low, row.high)]
        shown.add_row(row.log, row.figure, *cells, row.verdict, style="bold" if row.verdict == TOO_KIND else "")
    sentences = [f"Too kind: {sentence}" for sentence in said(rows, TOO_KIND)]
    drawn = [f"Widened: {name}: {drawn} ({source})" for name, drawn, source in widened()]
    say(shown, verdicts(rows), *sentences, *drawn, wide=WIDE)
