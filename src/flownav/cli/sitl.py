"""`flownav sitl`: a real autopilot's simulator flies on flownav's estimate, with faults, scored against its truth."""

from __future__ import annotations

import shlex
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import argument, chosen, option, switch
from flownav.cli.output import Column, answer, figure, progress, say, table_of
from flownav.core.errors import InputError

if TYPE_CHECKING:
    from flownav.live.sitl.campaign import Cell

GPS = ("on", "cut", "never")
VEHICLES = ("heli", "copter", "quad")
SCENARIOS = ("square", "indoor", "land", "hover", "tour", "pad", "sortie")
FAULT = "A fault, T seconds after the hover began, for S seconds; may be repeated. `all`: each of them in turn."
LINK = "Keep the companion's line (from_vehicle.tlog, from_flownav.tlog), truth.csv and the autopilot's own log."
LIVE = "Options for `flownav live`, in one string."
BINARY = "The simulator's program."
OUT = "Folder of records and figures; what is there already is not flown again."
WIDE = 170
NOTE = (
    "height: of the hover. floor: drift that its flow's noise alone integrates to. hover: the vehicle from where its "
    "hover began, rms. drift: the estimate in that time. error: largest that was "
    "sent, level and down, since the last counted reset. unwarned: how long it was beyond 1 m. silent: longest gap in "
    "sending. strayed: from the commanded path. touchdown: from the place of take-off, R95. Median (worst)."
)


def _cell(title: str, key: str, form: str = ".2f") -> Column:
    """Median and worst of a figure."""

    def text(row: dict[str, Any]) -> str:
        found = row[key]
        return f"{figure(found['median'], form)} ({figure(found['worst'], form)})" if found else "-"

    return Column(title, text)


def _median(title: str, key: str, form: str) -> Column:
    """The median alone, of a figure that the flight is given."""

    def text(row: dict[str, Any]) -> str:
        found = row.get(key)
        return figure(found["median"], form) if found else "-"

    return Column(title, text)


COLUMNS = (
    Column("flown", "cell"),
    Column("landed", lambda row: f"{row['landed']} of {row['flights']}"),
    _median("height [m]", "height_m", ".1f"),
    _median("floor [m]", "floor_m", ".2f"),
    _cell("hover [m]", "hover_rms_m"),
    _cell("drift [m]", "error_rms_m"),
    _cell("error [m]", "error_m"),
    _cell("down [m]", "error_down_m"),
    _cell("unwarned [s]", "unsaid_s", ".1f"),
    _cell("silent [s]", "silent_s", ".1f"),
    _cell("strayed [m]", "strayed_m", ".1f"),
    Column("touchdown [m]", lambda row: figure(row["touchdown_r95_m"], ".2f")),
    _cell("CPU", "cpu_share"),
)


def command(
    autopilot: Annotated[str, argument("AUTOPILOT", "Whose simulator", *options.AUTOPILOTS[::-1])],
    vehicle: Annotated[str | None, chosen("Which vehicle.", *VEHICLES, unset="heli, of PX4 quad")] = None,
    scenario: Annotated[str, chosen("The scenario.", *SCENARIOS)] = "square",
    gps: Annotated[str | None, chosen("The use of GPS.", *GPS, unset="the scenario's")] = None,
    fault: Annotated[list[str] | None, option("NAME@T[+S]", FAULT)] = None,
    flights: Annotated[int, option("N", "Flights of each row.", within=(1, 10_000))] = 1,
    beside: Annotated[int, option("N", "Flights beside each other.", within=(1, 9))] = 1,
    wind: Annotated[float, option("M/S", "Wind, from another side in each flight.", within=(0.0, 20.0))] = 0.0,
    send: Annotated[str, chosen("As which message the estimate is sent.", *options.SENDINGS)] = "odometry",
    binary: Annotated[
        Path | None, option("PATH", BINARY, unset="FLOWNAV_ARDUPILOT, FLOWNAV_PX4, or on the PATH")
    ] = None,
    out: Annotated[Path | None, option("PATH", OUT, unset="a temporary one")] = None,
    live: Annotated[str | None, option("OPTIONS", LIVE, unset="none")] = None,
    link: Annotated[bool, switch(LINK, "--link")] = False,
    seed: options.Seed = 1,
    as_json: options.Json = False,
) -> None:
    """Fly a real autopilot's simulator on flownav's estimate: take off, hover, square, land; with faults; scored."""
    from flownav.live.sitl.campaign import flown, given, opened, program_of, row_of, tasks_of
    from flownav.live.sitl.flight import PILOTS
    from flownav.live.sitl.flight import SCENARIOS as KNOWN

    kinds = PILOTS[autopilot].vehicles
    vehicle = vehicle or kinds[0]
    if vehicle not in kinds:
        raise InputError(f"--vehicle {vehicle}: the simulator of {autopilot} flies {' and '.join(kinds)}")
    if wind and autopilot == "px4":
        raise InputError("--wind: PX4's SIH has no wind; leave it out")
    if KNOWN[scenario].pad and autopilot == "px4":
        raise InputError(f"--scenario {scenario}: is flown by ardupilot alone; PX4 lands on a pad in a mode of its own")
    program = program_of(autopilot, vehicle, binary)
    cells = _cells(autopilot, vehicle, scenario, gps or KNOWN[scenario].gps, fault or [], flights, wind, send, seed)
    cells = [given(cell, tuple(shlex.split(live or "")), link=link) for cell in cells]
    folder = out or Path(mkdtemp(prefix="flownav-sitl-"))
    plan = {
        "autopilot": autopilot, "vehicle": vehicle, "scenario": scenario, "gps": gps, "fault": fault, "wind_m_s": wind,
        "send": send, "seed": seed, "live": live, "flights": flights,
    }  # fmt: skip
    opened(folder, plan)
    tasks = tasks_of(cells, program, folder)
    found: dict[str, list[dict[str, Any]]] = {cell.name: [] for cell in cells}
    with progress(f"{autopilot} on flownav", len(tasks)) as advance:
        for task, result in flown(tasks, beside, advance):
            found[task.cell].append(result)
    rows = [row_of(name, results) for name, results in found.items()]
    facts = plan | {"program": str(program), "folder": str(folder), "rows": rows, "results": found}
    answer(facts, as_json, lambda: _show(rows, autopilot, vehicle, scenario, folder))
    if any(row["landed"] < row["flights"] for row in rows):
        raise typer.Exit(1)


def _cells(
    autopilot: str, vehicle: str, scenario: str, gps: str, faults: list[str], flights: int, wind_m_s: float, send: str,
    seed: int,
) -> list[Cell]:  # fmt: skip
    """The rows of the table: one, or one for each fault."""
    from flownav.live.sitl.campaign import Cell
    from flownav.live.sitl.flight import SCENARIOS as KNOWN
    from flownav.live.sitl.flight import Order, struck_of
    from flownav.live.sitl.pilot import Case
    from flownav.live.sitl.tables import faults_of

    known = faults_of(autopilot)
    every = [text for text in faults if text.partition("@")[0] == "all"]
    if every and len(faults) > 1:
        raise InputError("--fault all: is every fault, each in flights of its own; leave the others out")
    when = every[0].partition("@")[2] if every else ""
    kinds = [[f"{name}@{when or '10'}"] for name in known] if every else [faults]

    def order(texts: list[str], number: int) -> Order:
        turn = seed + number
        stays = every and gps == "cut" and any(known[text.partition("@")[0]].gps for text in texts)
        case = Case(
            vehicle, "on" if stays else gps, wind_m_s, (137.5 * turn) % 360.0, (222.5 * turn) % 360.0, send, turn,
            KNOWN[scenario].pad,
        )  # fmt: skip
        return Order(autopilot, scenario, case, tuple(struck_of(text, known) for text in texts))

    name = f"{vehicle}-{scenario}-gps-{gps}" + (f"-wind-{wind_m_s:g}" if wind_m_s else "")
    return [
        Cell(
            "-".join([name, *(text.partition("@")[0] for text in texts)]),
            tuple(order(texts, n) for n in range(flights)),
        )
        for texts in kinds
    ]


def _show(rows: list[dict[str, Any]], autopilot: str, vehicle: str, scenario: str, folder: Path) -> None:
    title = f"{autopilot}, {vehicle}: {scenario}, on flownav's estimate"
    say(table_of(COLUMNS, rows, left=1, fixed=1, title=title, title_justify="left"), NOTE, wide=WIDE)
    lines = [f"{row['cell']}: not flown: {why}" for row in rows for why in dict.fromkeys(row["not_flown"])]
    say(*lines, f"Records and figures: {folder}", soft=True)
