"""`flownav paper`: the paper's tables and figures, published and reproduced side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from flownav.cli import options
from flownav.cli.options import chosen, option, out_option
from flownav.cli.tables import answer

if TYPE_CHECKING:
    from flownav.paper.reproduction import Reproduction


def command(
    table: Annotated[str | None, chosen("One table alone.", *options.TABLES, unset="all of them")] = None,
    out: Annotated[Path | None, out_option("The page (HTML)", "out/paper.html, or out/paper-tableN.html")] = None,
    force: options.Force = False,
    flights: Annotated[int, option("N", "Flights for each of Tables 5 and 6.")] = 200,
    seed: options.RigSeed = 1,
    as_json: options.Json = False,
) -> None:
    """Reproduce the paper: Tables 1 to 3 from the synthetic rig, 5 and 6 from flights, on one HTML page."""
    from flownav.cli.output import place, require_between, writing
    from flownav.core.errors import VerdictError
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
    from flownav.cli.output import progress
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
