"""`flownav faults`: what the navigator makes of sensors that fail, at several heights of a landing."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

import typer

from flownav.cli.output import VehicleOption
from flownav.errors import InputError

if TYPE_CHECKING:
    from flownav.faults.navigated import Navigate
    from flownav.faults.table import Row

HEIGHTS_M = (0.3, 20.0)
DURATIONS_S = (0.1, 60.0)
WIDE = 130  # columns that the table takes


def command(
    faults: Annotated[str | None, typer.Option(help="Which faults, with commas between; all where unsaid.")] = None,
    heights: Annotated[str, typer.Option(help="Skids above the pad in hover [m], with commas between.")] = "0.5,1.5,3",
    durations: Annotated[str, typer.Option(help="How long a fault lasts [s], with commas between.")] = "2,5",
    vehicle: VehicleOption = None,
    seed: Annotated[int, typer.Option(help="The noise of flights and faults; the same seed gives the same table.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Put faults into the log of a simulated flight: when they are noticed, and what they do to the estimate."""
    from flownav.cli.output import progress, require_between
    from flownav.faults.catalogue import FAULTS, faults_named
    from flownav.faults.table import fault_table, runs

    require_between("--seed", seed, 0, 2**63 - 1)
    chosen = faults_named(FAULTS if faults is None else _words("--faults", faults))
    heights_m = _numbers("--heights", heights, *HEIGHTS_M)
    durations_s = _numbers("--durations", durations, *DURATIONS_S)
    with progress("Failing sensors", runs(chosen, heights_m, durations_s)) as advance:
        rows = fault_table(navigator(vehicle), chosen, heights_m, durations_s, seed, advance, vehicle)
    if as_json:
        facts = {"vehicle": vehicle, "seed": seed, "heights_m": heights_m, "durations_s": durations_s}
        typer.echo(json.dumps(facts | {"rows": [row.entry() for row in rows]}))
    else:
        _show(rows, f"Failing sensors on a landing{f', {vehicle}' if vehicle else ''}, seed {seed}")


def navigator(vehicle: str | None = None) -> Navigate:
    """The navigator on trial, told what the datasheets of the vehicle's sensors state."""
    from flownav.faults.navigator import navigator_of
    from flownav.faults.table import scenario_at
    from flownav.simulation.assemble import assemble

    return navigator_of(assemble(scenario_at(1.0, 1.0, vehicle)))


def _words(option: str, text: str) -> list[str]:
    words = [word.strip() for word in text.split(",") if word.strip()]
    if not words:
        raise InputError(f"{option}: give one at least")
    return words


def _numbers(option: str, text: str, low: float, high: float) -> list[float]:
    """Numbers with commas between. InputError where one is none or out of range."""
    from flownav.cli.output import require_between

    numbers = []
    for word in _words(option, text):
        try:
            numbers.append(float(word))
        except ValueError:
            raise InputError(f"{option} {word}: a number is needed") from None
        require_between(option, numbers[-1], low, high)
    return numbers


def _show(rows: list[Row], title: str) -> None:
    """The rows for people."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    table.add_column("fault", no_wrap=True)
    columns = (
        "height m",
        "lasts s",
        "noticed s",
        "moved m",
        "largest m",
        "back s",
        "wrongly fused",
        "touchdown m",
        "unsaid s",
    )
    for name in columns:
        table.add_column(name, justify="right")
    for row in rows:
        noticed, moved, largest, back, fused, touchdown, unsaid = row.scores
        faulty = row.duration_s > 0.0
        table.add_row(
            row.fault, f"{row.height_m:g}", f"{row.duration_s:g}" if faulty else "",
            _cell(noticed) if faulty else "",
            _cell(moved, 3) if faulty else "", _cell(largest), _cell(back) if faulty else "",
            str(fused) if faulty else "", _cell(touchdown), _cell(unsaid),
        )  # fmt: skip
    console = Console()
    console.width = max(console.width, WIDE)
    console.print(table)
    console.print(
        "noticed: first rejection, event or flag. moved: from the run without, "
        "while it lasts. back: as good as without the fault, after its end. "
        "unsaid: longest time beyond 3 sigma with no event or flag. -: never.",
        highlight=False,
    )


def _cell(number: float | None, digits: int = 2) -> str:
    return "-" if number is None else f"{number:.{digits}f}"
