"""`flownav faults`: sensors that fail on a landing, flown in the closed loop or put into the log of a flight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import FAULTS, numbers, one_of, option, switch, words
from flownav.cli.output import Column, answer, figure, progress, require_between, say, table_of
from flownav.core.errors import InputError

if TYPE_CHECKING:
    from flownav.campaigns.faults.catalogue import Fault
    from flownav.campaigns.faults.flown import Row as FlownRow
    from flownav.campaigns.faults.navigator import Navigate
    from flownav.campaigns.faults.table import Row

HEIGHTS_M = (0.3, 20.0)
DURATIONS_S = (0.1, 60.0)
FLIGHTS, DEFAULT_FLIGHTS = (1, 100_000), 16
WIDE = 144  # columns that the table takes
HOVERS_M, LASTING_S = ["0.5,1.5,3"], {False: "5,20", True: "2,5"}


LONG = "How long a fault lasts [s], repeated or with commas."
OFFLINE = "Put the faults into the log of one flight whose autopilot uses the truth."
Faults = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help=f"Which faults, repeated or with commas: {', '.join(FAULTS)}.",
        show_default="all that can be flown",
        autocompletion=one_of(*FAULTS)["autocompletion"],
    ),
]
FLOWN_NOTE = (
    "none, pad camera: no fault, and the camera and the autopilot of approach lead the landing; all other rows land on "
    "GPS and flow alone. noticed: more readings refused in a second than before, or a warning. warned: the navigator "
    "warns. 4 in 0.5: in 4 flights, in the median 0.5 s after the fault began. before: the largest horizontal error "
    "before the warning. landed: also after a climb. around: aloft at the end; the rest did not end in time. off: from "
    "the pad's centre, at rest; median (worst)."
)
LOGGED_NOTE = (
    "noticed: first rejection, event or flag. moved: from the run without, while it lasts. back: as good as without "
    "the fault, after its end. unwarned: longest time beyond 3 sigma with no event or flag. -: never."
)


def command(
    faults: Faults = None,
    heights: Annotated[list[str], option("M", "Skids above the pad in hover [m], repeated or with commas.")] = HOVERS_M,
    durations: Annotated[list[str] | None, option("S", LONG, unset="5,20; with --offline 2,5")] = None,
    flights: Annotated[int, option("N", "Flights of each row.")] = DEFAULT_FLIGHTS,
    ensemble: options.Ensemble = True,
    offline: Annotated[bool, switch(OFFLINE, "--offline")] = False,
    vehicle: options.Vehicle = None,
    seed: options.Seed = 1,
    as_json: options.Json = False,
) -> None:
    """Sensors that fail on a landing: whether the vehicle lands, goes around or crashes, and which warnings come."""
    from flownav.campaigns.faults.catalogue import NOT_FLOWN, faults_named

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
        return _say(rows, facts | {"closed_loop": False}, as_json, heading, LOGGED, LOGGED_NOTE)
    if absent := [fault.name for fault in chosen if fault.name in NOT_FLOWN]:
        raise InputError(f"--faults {absent[0]}: a receiver's queue sorts that out before its navigator; try --offline")
    flown = _flown(chosen, heights_m, lasting_s, flights, seed, vehicle, not ensemble)
    facts |= {"closed_loop": True, "flights": flights, "truth_model": "ensemble" if ensemble else "matched"}
    heading = (
        f"Sensors that fail in a hover over the pad{name}, {flights} flights a row, seed {seed}; {_flown_in(vehicle)}"
    )
    _say(flown, facts, as_json, heading, FLOWN, FLOWN_NOTE)


def _say(
    rows: Sequence[Any], facts: dict[str, Any], as_json: bool, title: str, columns: Sequence[Column], note: str
) -> None:
    """One JSON object, or the rows as a table whose columns are explained below it."""

    def show() -> None:
        entries = [row.entry() | {"faulty": row.duration_s > 0.0} for row in rows]
        say(table_of(columns, entries, left=1, fixed=len(FAULT), title=title, title_justify="left"), note, wide=WIDE)

    answer(facts | {"rows": [row.entry() for row in rows]}, as_json, show)


def _flown_in(vehicle: str | None) -> str:
    """The scenario and the wind of the flights."""
    from flownav.campaigns.faults.flown import scenario_flown
    from flownav.campaigns.faults.table import BASE

    file = scenario_flown(1.0, vehicle)
    return f"scenario {BASE}, wind {file.wind.speed_20ft_m_s:g} m/s"


def _of_fault(title: str, key: str, form: str) -> Column:
    """A column that is empty in the row without a fault."""
    return Column(title, lambda row: figure(row[key], form) if row["faulty"] else "")


def _after(title: str, key: str) -> Column:
    """In how many flights, and after how long in the median."""

    def cell(row: dict[str, Any]) -> str:
        when = row[key]
        if not when["flights"]:
            return "never" if row["faulty"] else ""
        return f"{when['flights']} in {figure(when['median_s'])}"

    return Column(title, cell)


def _off(row: dict[str, Any]) -> str:
    off = row["off_pad_m"]
    return f"{off['median']:.2f} ({off['worst']:.2f})" if off else "-"


FAULT = (Column("fault", "fault"), Column("height [m]", "height_m", "g"), _of_fault("lasts [s]", "duration_s", "g"))
FLOWN = (
    *FAULT,
    _after("noticed [s]", "noticed"),
    _after("warned [s]", "said"),
    Column("before [m]", "largest_error_unsaid_m", ".2f"),
    Column("largest [m]", "largest_error_m", ".2f"),
    Column("landed", "landed"),
    Column("around", "went_around"),
    Column("crashed", "crashed"),
    Column("off [m]", _off),
)
LOGGED = (
    *FAULT,
    _of_fault("noticed [s]", "detected_after_s", ".2f"),
    _of_fault("moved [m]", "moved_m", ".3f"),
    Column("largest [m]", "max_error_m", ".2f"),
    _of_fault("back [s]", "recovered_after_s", ".2f"),
    _of_fault("wrongly fused", "wrongly_fused", ""),
    Column("touchdown [m]", "touchdown_error_m", ".2f"),
    Column("unwarned [s]", "unflagged_above_3_sigma_s", ".2f"),
)


def _flown(
    chosen: tuple[Fault, ...], heights_m: list[float], lasting_s: list[float], flights: int, seed: int,
    vehicle: str | None, matched: bool,
) -> list[FlownRow]:  # fmt: skip
    from flownav.campaigns.faults.flown import flown_table
    from flownav.campaigns.faults.table import runs

    with progress("Sensors that fail in flight", runs(chosen, heights_m, lasting_s) + len(heights_m)) as advance:
        return flown_table(
            chosen, heights_m, lasting_s, flights=flights, seed=seed, vehicle=vehicle, matched=matched,
            on_progress=advance,
        )  # fmt: skip


def _logged(
    chosen: tuple[Fault, ...], heights_m: list[float], lasting_s: list[float], seed: int, vehicle: str | None
) -> list[Row]:
    from flownav.campaigns.faults.table import fault_table, runs

    with progress("Failing sensors", runs(chosen, heights_m, lasting_s)) as advance:
        return fault_table(navigator(vehicle), chosen, heights_m, lasting_s, seed, advance, vehicle)


def navigator(vehicle: str | None = None) -> Navigate:
    """The navigator under test, set up from the datasheets of the vehicle's sensors."""
    from flownav.campaigns.faults.navigator import navigator_of
    from flownav.campaigns.faults.table import scenario_at
    from flownav.simulation.assemble import assemble

    return navigator_of(assemble(scenario_at(1.0, 1.0, vehicle)))
