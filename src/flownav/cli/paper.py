"""`flownav paper`: the paper's tables and figures beside ours; `flownav validate`: recorded flights flown again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flownav.cli import options
from flownav.cli.options import chosen, option, out_option
from flownav.cli.output import answer, place, progress, require_between, say, table, writing
from flownav.core.errors import InputError, VerdictError

if TYPE_CHECKING:
    from flownav.paper.reproduction import Reproduction
    from flownav.studies.validation.job import Row


def command(
    table: Annotated[str | None, chosen("One table alone.", *options.TABLES, unset="all of them")] = None,
    out: Annotated[Path | None, out_option("The page (HTML)", "out/paper.html, or out/paper-tableN.html")] = None,
    force: options.Force = False,
    flights: Annotated[int, option("N", "Flights for each of Tables 5 and 6.")] = 200,
    seed: options.RigSeed = 1,
    as_json: options.Json = False,
) -> None:
    """Reproduce the paper: Tables 1 to 3 from the synthetic rig, 5 and 6 from flights, on one HTML page."""
    from flownav.paper.reproduction import TABLES as ALL_TABLES

    require_between("--flights", flights, 1, 1_000_000)
    page = place(out or Path("out") / ("paper.html" if table is None else f"paper-table{table}.html"), force=force)
    made = _reproduced((int(table),) if table else ALL_TABLES, seed, flights)
    from flownav.paper.page import show, write_page

    with writing(page, "the page "):
        write_page(made, page)
    answer(made.as_json() | {"page": str(page)}, as_json, lambda: show(made, str(page)))
    if made.broken:
        raise VerdictError("; ".join(f"{f.topic}: {f.here}, the paper has {f.paper}" for f in made.broken))


def _reproduced(tables: tuple[int, ...], seed: int, flights: int) -> Reproduction:
    """The reproduction behind progress bars."""
    from flownav.core.compile import announce_compilation
    from flownav.paper.laboratory import rig_runs
    from flownav.paper.reproduction import FLIGHT_TABLES, RIG_TABLES, reproduce

    on_rig, flown = tuple(t for t in tables if t in RIG_TABLES), tuple(t for t in tables if t in FLIGHT_TABLES)
    made = None
    if on_rig:
        with announce_compilation("rig and identification"), progress("Swinging", rig_runs(1 in tables)) as advance:
            made = reproduce(on_rig, seed, flights, on_run=advance)
    if flown:
        with progress("Flying", 3 * flights * len(flown)) as advance:
            in_air = reproduce(flown, seed, flights, on_flight=advance)
            made = in_air if made is None else made.with_flights(in_air)
    assert made is not None
    return made


MOST_FLIGHTS = 1000
WIDE = 130  # columns that the table takes


DATA = "The folder that holds the logs."
FILE = "Which logs and outages."


def validate(
    data: Annotated[Path, typer.Option(metavar="PATH", envvar="FLOWNAV_DATA", help=DATA)] = Path("../shared/data"),
    flights_file: Annotated[Path | None, option("FILE.toml", FILE, "--file", unset="three outdoor flights")] = None,
    flights: Annotated[int, option("N", "Simulated flights of each log.")] = 8,
    seed: options.Seed = 1,
    out: Annotated[Path | None, out_option("The page (Markdown)")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Hold the simulator against recorded flights: outage drift, innovations, noise, as flown and as simulated."""
    from flownav.core.guard import an_input, write_text
    from flownav.core.marks import XML
    from flownav.studies.validation.drawn import load_flights
    from flownav.studies.validation.job import replays_of
    from flownav.studies.validation.job import validate as validated
    from flownav.studies.validation.page import page

    require_between("--flights", flights, 1, MOST_FLIGHTS)
    path = None if out is None else place(out, data, flights_file, force=force)
    if not an_input(data).is_dir():
        raise InputError(f"{data}: no such folder; give the folder of logs by --data or FLOWNAV_DATA")
    recorded = load_flights(flights_file)
    with progress("Validating", replays_of(recorded, flights)) as advance:
        rows = validated(data, recorded, seed, flights, advance)
    if path is not None:
        write_text(page(rows, seed, flights, recorded.vehicle.path_bandwidth_hz), path, XML)
    facts = {"seed": seed, "flights": flights, "rows": [row.as_json() for row in rows]}
    answer(facts | {"out": str(path) if path else None}, as_json, lambda: _show_validated(rows))
    kind = [row for row in rows if row.decides and row.verdict == "too kind"]
    if kind:
        raise VerdictError(
            "; ".join(f"{row.log}: {row.figure} {row.flown:.2f}, simulated {row.high:.2f} at most" for row in kind)
        )


def _show_validated(rows: list[Row]) -> None:
    """The rows for people."""
    from flownav.studies.validation.page import TOO_KIND, number, sentences_of, verdicts, widened

    heads = ("log", "figure", "flown", "simulated", "least", "largest", "the simulator is")
    shown = table(heads, title="Recorded flights, and the same paths with simulated sensors", title_justify="left")
    for k, column in enumerate(shown.columns):
        column.justify, column.no_wrap = ("left", True) if k in (0, 1, 6) else ("right", False)
    for row in rows:
        cells = [number(value) for value in (row.flown, row.simulated, row.low, row.high)]
        shown.add_row(row.log, row.figure, *cells, row.verdict, style="bold" if row.verdict == TOO_KIND else "")
    sentences = [f"Too kind: {sentence}" for sentence in sentences_of(rows, TOO_KIND)]
    drawn = [f"Widened: {name}: {drawn} ({source})" for name, drawn, source in widened()]
    say(shown, verdicts(rows), *sentences, *drawn, wide=WIDE)
