"""`flownav paper`: the paper's tables and figures, published and reproduced side by side."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from flownav.paper.reproduction import Reproduction


def command(
    table: Annotated[int | None, typer.Option(help="One table alone: 1, 2, 3, 5 or 6; all where unsaid.")] = None,
    out: Annotated[Path | None, typer.Option(help="The page to write; out/paper.html where unsaid.")] = None,
    flights: Annotated[int, typer.Option(help="Flights for each of Tables 5 and 6.")] = 200,
    seed: Annotated[int, typer.Option(help="The noise of rig and flights; the same seed gives the same page.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Reproduce the paper: Tables 1 to 3 from the synthetic rig, 5 and 6 from flights, on one HTML page."""
    from flownav.cli.output import require_between, require_writable
    from flownav.errors import InputError, VerdictError
    from flownav.paper.reproduction import TABLES

    require_between("--flights", flights, 1, 1_000_000)
    require_between("--seed", seed, 0, 2**31 - 1)
    if table is not None and table not in TABLES:
        raise InputError(
            f"--table {table}: Tables 1, 2, 3, 5 and 6 hold results (4 is the receiver's data sheet); give one of them"
        )
    page = out or Path("out") / ("paper.html" if table is None else f"paper-table{table}.html")
    require_writable(page)
    made = _reproduced((table,) if table else TABLES, seed, flights)
    from flownav.paper.page import write_page

    try:
        write_page(made, page)
    except OSError as error:
        raise InputError(f"{page}: the page cannot be written ({error.strerror}); give another --out") from error
    if as_json:
        typer.echo(json.dumps(made.as_json() | {"page": str(page)}))
    else:
        from flownav.paper.console import show

        show(made, str(page))
    if made.broken:
        raise VerdictError("; ".join(f"{f.topic}: {f.here}, the paper has {f.paper}" for f in made.broken))


def _reproduced(tables: tuple[int, ...], seed: int, flights: int) -> Reproduction:
    """The reproduction behind progress bars."""
    from flownav.cli.output import progress
    from flownav.compile import announce_compilation
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
