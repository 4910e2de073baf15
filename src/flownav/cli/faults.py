"""`flownav faults`: sensors that fail on a landing, flown in the closed loop or put into the log of a flight."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import FAULTS, one_of, option
from flownav.cli.output import emit
from flownav.core.errors import InputError

if TYPE_CHECKING:
    from flownav.campaigns.faults.catalogue import Fault
    from flownav.campaigns.faults.flown import Row as FlownRow
    from flownav.campaigns.faults.navigated import Navigate
    from flownav.campaigns.faults.table import Row

HEIGHTS_M = (0.3, 20.0)
DURATIONS_S = (0.1, 60.0)
FLIGHTS, DEFAULT_FLIGHTS = (1, 100_000), 16
WIDE = 144  # columns that the table takes
HOVERS_M, LASTING_S = ["0.5,1.5,3"], {False: "5,20", True: "2,5"}


FaultsOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help=f"Which faults, repeated or with commas: {', '.join(FAULTS)}.",
        show_default="all that can be flown",
        autocompletion=one_of(*FAULTS)["autocompletion"],
    ),
]
LastingOption = Annotated[
    list[str] | None,
    option("S", "How long a fault lasts [s], repeated or with commas.", unset="5,20; with --offline 2,5"),
]
OfflineOption = Annotated[
    bool, typer.Option("--offline", help="Put the faults into the log of one flight that is flown on the truth.")
]


def command(
    faults: FaultsOption = None,
    heights: Annotated[list[str], option("M", "Skids above the pad in hover [m], repeated or with commas.")] = HOVERS_M,
    durations: LastingOption = None,
    flights: Annotated[int, option("N", "Flights of each row.")] = DEFAULT_FLIGHTS,
    ensemble: options.Ensemble = True,
    offline: OfflineOption = False,
    vehicle: options.Vehicle = None,
    seed: options.Seed = 1,
    as_json: options.Json = False,
) -> None:
    """Sensors that fail on a landing: whether the vehicle lands, goes around or crashes, and what is said of it."""
    from flownav.campaigns.faults.catalogue import faults_named
    from flownav.campaigns.faults.laws import NOT_FLOWN
    from flownav.cli.options import numbers, words
    from flownav.cli.output import require_between

    require_between("--flights", flights, *FLIGHTS)
    named = words("--faults", faults) if faults else [name for name in FAULTS if offline or name not in NOT_FLOWN]
    chosen = faults_named(named)
    heights_m = numbers("--heights", heights, *HEIGHTS_M)
    lasting_s = numbers("--durations", durations or [LASTING_S[offline]], *DURATIONS_S)
    facts: dict[str, Any] = {"vehicle": vehicle, "seed": seed, "heights_m": heights_m, "durations_s": lasting_s}
    name = f", {vehicle}" if vehicle else ""
    if offline and (not ensemble or flights != DEFAULT_FLIGHTS):
        raise InputError("--flights, --matched: are of flights in the closed loop; leave them out with --offline")
    if offline:
        rows = _logged(chosen, heights_m, lasting_s, seed, vehicle)
        heading = f"Failing sensors in a log{name}, seed {seed}"
        return _say(rows, facts | {"closed_loop": False}, as_json, lambda: _show(rows, heading))
    if absent := [fault.name for fault in chosen if fault.name in NOT_FLOWN]:
        raise InputError(f"--faults {absent[0]}: a receiver's queue sorts that out before its navigator; try --offline")
    flown = _flown(chosen, heights_m, lasting_s, flights, seed, vehicle, not ensemble)
    facts |= {"closed_loop": True, "flights": flights, "truth_model": "ensemble" if ensemble else "matched"}
    heading = f"Sensors that fail in flight{name}, {flights} flights a row, seed {seed}"
    _say(flown, facts, as_json, lambda: _show_flown(flown, heading))


def _say(rows: Any, facts: dict[str, Any], as_json: bool, show: Any) -> None:
    """One JSON object, or the table."""
    if as_json:
        emit(facts | {"rows": [row.entry() for row in rows]})
    else:
        show()


def _flown(
    chosen: tuple[Fault, ...], heights_m: list[float], lasting_s: list[float], flights: int, seed: int,
    vehicle: str | None, matched: bool,
) -> list[FlownRow]:  # fmt: skip
    from flownav.campaigns.faults.flown import flown_table
    from flownav.campaigns.faults.table import runs
    from flownav.cli.output import progress

    with progress("Sensors that fail in flight", runs(chosen, heights_m, lasting_s)) as advance:
        return flown_table(
            chosen, heights_m, lasting_s, flights=flights, seed=seed, vehicle=vehicle, matched=matched,
            on_progress=advance,
        )  # fmt: skip


def _logged(
    chosen: tuple[Fault, ...], heights_m: list[float], lasting_s: list[float], seed: int, vehicle: str | None
) -> list[Row]:
    from flownav.campaigns.faults.table import fault_table, runs
    from flownav.cli.output import progress

    with progress("Failing sensors", runs(chosen, heights_m, lasting_s)) as advance:
        return fault_table(navigator(vehicle), chosen, heights_m, lasting_s, seed, advance, vehicle)


def navigator(vehicle: str | None = None) -> Navigate:
    """The navigator on trial, told what the datasheets of the vehicle's sensors state."""
    from flownav.campaigns.faults.navigator import navigator_of
    from flownav.campaigns.faults.table import scenario_at
    from flownav.simulation.assemble import assemble

    return navigator_of(assemble(scenario_at(1.0, 1.0, vehicle)))


def _show_flown(rows: list[FlownRow], title: str) -> None:
    """What became of the flights, for people."""
    columns = (
        "height [m]",
        "lasts [s]",
        "noticed [s]",
        "said [s]",
        "unsaid [m]",
        "largest [m]",
        "landed",
        "around",
        "crashed",
        "off [m]",
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
        "height [m]",
        "lasts [s]",
        "noticed [s]",
        "moved [m]",
        "largest [m]",
        "back [s]",
        "wrongly fused",
        "touchdown [m]",
        "unsaid [s]",
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
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, WIDE)
    console.print(table)


def _note(text: str) -> None:
    from rich.console import Console

    console = Console(markup=False, highlight=False)
    console.width = max(console.width, WIDE)
    console.print(text, highlight=False)


def _cell(number: float | None, digits: int = 2) -> str:
    return "-" if number is None else f"{number:.{digits}f}"
