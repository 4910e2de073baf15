"""`flownav faults`: sensors that fail on a landing, flown in the closed loop or put into the log of a flight."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli.output import VehicleOption
from flownav.errors import InputError

if TYPE_CHECKING:
    from flownav.faults.catalogue import Fault
    from flownav.faults.flown import Row as FlownRow
    from flownav.faults.navigated import Navigate
    from flownav.faults.table import Row

HEIGHTS_M = (0.3, 20.0)
DURATIONS_S = (0.1, 60.0)
FLIGHTS, DEFAULT_FLIGHTS = (1, 100_000), 16
WIDE = 130  # columns that the table takes


def command(
    faults: Annotated[
        str | None,
        typer.Option(help="Which faults, with commas between; all that can be flown unless given."),
    ] = None,
    heights: Annotated[str, typer.Option(help="Skids above the pad in hover [m], with commas between.")] = "0.5,1.5,3",
    durations: Annotated[
        str | None, typer.Option(help="How long a fault lasts [s]; 5,20 unless given, 2,5 with --offline.")
    ] = None,
    flights: Annotated[int, typer.Option(help="Flights of each row, each with a truth of its own.")] = DEFAULT_FLIGHTS,
    matched: Annotated[bool, typer.Option("--matched", help="Vehicle and sensors as their datasheets say.")] = False,
    offline: Annotated[
        bool, typer.Option("--offline", help="Put the faults into the log of one flight that is flown on the truth.")
    ] = False,
    vehicle: VehicleOption = None,
    seed: Annotated[int, typer.Option(help="The noise of flights and faults; the same seed gives the same table.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Sensors that fail on a landing: whether the vehicle lands, goes around or crashes, and what is said of it."""
    from flownav.cli.output import require_between
    from flownav.faults.catalogue import FAULTS, faults_named
    from flownav.faults.laws import NOT_FLOWN

    require_between("--seed", seed, 0, 2**63 - 1)
    require_between("--flights", flights, *FLIGHTS)
    named = FAULTS if faults is None else _words("--faults", faults)
    if faults is None and not offline:
        named = [name for name in FAULTS if name not in NOT_FLOWN]
    chosen = faults_named(named)
    heights_m = _numbers("--heights", heights, *HEIGHTS_M)
    lasting_s = _numbers("--durations", durations or ("2,5" if offline else "5,20"), *DURATIONS_S)
    facts: dict[str, Any] = {"vehicle": vehicle, "seed": seed, "heights_m": heights_m, "durations_s": lasting_s}
    name = f", {vehicle}" if vehicle else ""
    if offline and (matched or flights != DEFAULT_FLIGHTS):
        raise InputError("--flights, --matched: are of flights in the closed loop; leave them out with --offline")
    if offline:
        rows = _logged(chosen, heights_m, lasting_s, seed, vehicle)
        _say(
            rows,
            facts | {"closed_loop": False},
            as_json,
            lambda: _show(rows, f"Failing sensors in a log{name}, seed {seed}"),
        )
        return
    if absent := [fault.name for fault in chosen if fault.name in NOT_FLOWN]:
        raise InputError(f"--faults {absent[0]}: a receiver's queue sorts that out before its navigator; try --offline")
    flown = _flown(chosen, heights_m, lasting_s, flights, seed, vehicle, matched)
    facts |= {"closed_loop": True, "flights": flights, "truth_model": "matched" if matched else "ensemble"}
    heading = f"Sensors that fail in flight{name}, {flights} flights a row, seed {seed}"
    _say(flown, facts, as_json, lambda: _show_flown(flown, heading))


def _say(rows: Any, facts: dict[str, Any], as_json: bool, show: Any) -> None:
    """One JSON object, or the table."""
    if as_json:
        typer.echo(json.dumps(facts | {"rows": [row.entry() for row in rows]}))
    else:
        show()


def _flown(
    chosen: tuple[Fault, ...], heights_m: list[float], lasting_s: list[float], flights: int, seed: int,
    vehicle: str | None, matched: bool,
) -> list[FlownRow]:  # fmt: skip
    from flownav.cli.output import progress
    from flownav.faults.flown import flown_table
    from flownav.faults.table import runs

    with progress("Sensors that fail in flight", runs(chosen, heights_m, lasting_s)) as advance:
        return flown_table(
            chosen, heights_m, lasting_s, flights=flights, seed=seed, vehicle=vehicle, matched=matched,
            on_progress=advance,
        )  # fmt: skip


def _logged(
    chosen: tuple[Fault, ...], heights_m: list[float], lasting_s: list[float], seed: int, vehicle: str | None
) -> list[Row]:
    from flownav.cli.output import progress
    from flownav.faults.table import fault_table, runs

    with progress("Failing sensors", runs(chosen, heights_m, lasting_s)) as advance:
        return fault_table(navigator(vehicle), chosen, heights_m, lasting_s, seed, advance, vehicle)


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
    from flownav.text import number

    numbers = []
    for word in _words(option, text):
        try:
            numbers.append(number(word))
        except ValueError:
            raise InputError(f"{option} {word}: a number is needed") from None
        require_between(option, numbers[-1], low, high)
    return numbers


def _show_flown(rows: list[FlownRow], title: str) -> None:
    """What became of the flights, for people."""
    columns = (
        "height m",
        "lasts s",
        "noticed s",
        "said s",
        "unsaid m",
        "largest m",
        "landed",
        "around",
        "crashed",
        "off m",
    )
    shown: list[tuple[str, ...]] = []
    for row in rows:
        said, faulty = row.entry(), row.duration_s > 0.0
        off = said["off_pad_m"]
        shown.append((
            row.fault, f"{row.height_m:g}", f"{row.duration_s:g}" if faulty else "", _after(said["noticed"], faulty),
            _after(said["said"], faulty), _cell(said["largest_error_unsaid_m"]), _cell(said["largest_error_m"]),
            str(said["landed"]), str(said["went_around"]), str(said["crashed"]),
            f"{off['median']:.2f} ({off['worst']:.2f})" if off else "-",
        ))  # fmt: skip
    _print(title, columns, shown)
    _note(
        "noticed: more refusals in a second than before, or said. said: the navigator warns; in so many flights, "
        "median time after the fault began. unsaid: largest horizontal error before that. landed: also after a climb. "
        "around: aloft at the end; the rest did not end in time. off: the pad, at rest; median (worst)."
    )


def _after(when: dict[str, Any], faulty: bool) -> str:
    if not faulty and not when["flights"]:
        return ""
    return f"{when['flights']}: {_cell(when['median_s'])}"


def _show(rows: list[Row], title: str) -> None:
    """The rows of logs for people."""
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
    shown: list[tuple[str, ...]] = []
    for row in rows:
        noticed, moved, largest, back, fused, touchdown, unsaid = row.scores
        faulty = row.duration_s > 0.0
        shown.append((
            row.fault, f"{row.height_m:g}", f"{row.duration_s:g}" if faulty else "",
            _cell(noticed) if faulty else "",
            _cell(moved, 3) if faulty else "", _cell(largest), _cell(back) if faulty else "",
            str(fused) if faulty else "", _cell(touchdown), _cell(unsaid),
        ))  # fmt: skip
    _print(title, columns, shown)
    _note(
        "noticed: first rejection, event or flag. moved: from the run without, "
        "while it lasts. back: as good as without the fault, after its end. "
        "unsaid: longest time beyond 3 sigma with no event or flag. -: never."
    )


def _print(title: str, columns: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    table.add_column("fault", no_wrap=True)
    for name in columns:
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(*row)
    console = Console()
    console.width = max(console.width, WIDE)
    console.print(table)


def _note(text: str) -> None:
    from rich.console import Console

    console = Console()
    console.width = max(console.width, WIDE)
    console.print(text, highlight=False)


def _cell(number: float | None, digits: int = 2) -> str:
    return "-" if number is None else f"{number:.{digits}f}"
