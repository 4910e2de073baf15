"""`flownav campaign`: a scenario flown many times, swept and dispersed, with intervals, kept as it flies."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import SCENARIOS, argument, chosen, numbers, option, out_option
from flownav.cli.output import answer, place, progress, require_between, say, table, writing
from flownav.core.errors import InputError
from flownav.core.text import number

if TYPE_CHECKING:
    from flownav.api.scenario import Scenario
    from flownav.campaigns.engines import Engine
    from flownav.campaigns.plan import Plan


FLIGHTS_OF = "Flights of each cell; with --until or --rare the most."
UNTIL = 'Stop when an interval is narrow enough: "r95_m width <= 0.005".'
SWEEP = "Fly every value of a key of the scenario, wind.speed_20ft_m_s=0:12:2 or =a,b,c; may be repeated."
SET = "Another value in the scenario: filter.name=paper."
SAMPLING = "How the dispersed inputs are spread over the flights."
MODELS = "Each flight's vehicle, wind and sensors drawn, as the datasheets say, or both."
FOLDER = f"The folder; {options.KEPT}"
FLIGHT = "Fly this flight again and write its record: K, CELL:K, or --rare's rare_flight.json."
RARE = 'How probable this is, to 1e-6: "touchdown.horizontal_m > 1", "crash".'
Scenarios = Annotated[list[str], argument("SCENARIO", "The scenario", *SCENARIOS, beside="a scenario's FILE.toml")]
Flights = Annotated[int | None, option("N", FLIGHTS_OF, unset="1000; with --until or --rare 100000")]
Out = Annotated[Path | None, out_option(FOLDER, "out/SCENARIO_campaign; with --rare SCENARIO_rare")]


def command(
    scenarios: Scenarios,
    flights: Flights = None,
    until: Annotated[str | None, option("RULE", UNTIL)] = None,
    sweep: Annotated[list[str] | None, option("KEY=VALUES", SWEEP)] = None,
    set_: Annotated[list[str] | None, option("KEY=VALUE", SET, "--set")] = None,
    sampling: Annotated[str, chosen(SAMPLING, *options.SAMPLINGS)] = "plain",
    truth_model: Annotated[str, chosen(MODELS, *options.TRUTH_MODELS)] = "ensemble",
    filter_name: options.Filter = None,
    vehicle: options.Vehicle = None,
    seed: options.Seed = 1,
    engine: options.Engine = "local",
    out: Out = None,
    records: options.Records = 1,
    flight: Annotated[str | None, option("K", FLIGHT)] = None,
    rare: Annotated[str | None, option("EVENT", RARE)] = None,
    as_json: options.Json = False,
) -> None:
    """Fly a scenario many times: radii, shares and percentiles with intervals, a dataset, the worst flights."""
    from flownav.api.calls import split
    from flownav.api.campaigning import plan_of
    from flownav.campaigns.run import engine_named, give_back_early, require_engine
    from flownav.campaigns.summary import WORST_FLIGHTS
    from flownav.cli.campaign_output import fly_again, fly_rare
    from flownav.parts.flying import OwnPartsEngine, identities

    give_back_early()
    planned = _planned_flights(out) if flight is not None else None
    count = _flights_of(flights, planned, until=not (until is None and rare is None))
    require_between("--records", records, 0, WORST_FLIGHTS)
    require_engine(engine)
    parts, ours, _ = split(filter_name, (), None, None)
    if parts.any and (engine != "local" or rare is not None):
        raise InputError(f"--filter {filter_name}: is flown by this process; leave out --engine and --rare")
    scenarios_asked = _scenarios(scenarios, ours, vehicle)
    plan = plan_of(
        scenarios_asked, flights=count, seed=seed, sweep=_once("--sweep", map(_swept, sweep or ())),
        changes=_once("--set", map(_set, set_ or ())), sampling=sampling, truth_model=truth_model, until=until,
    )  # fmt: skip
    plan = replace(plan, parts=identities(parts))
    flies = OwnPartsEngine(parts) if parts.any else None
    if rare is not None and engine != "local":
        raise InputError(f"--rare: flies on this machine's cores only; leave out --engine {engine}")
    if rare is not None:
        return fly_rare(plan, rare, _folder(out, scenarios_asked, "rare"), as_json)
    if flight is not None and flight.endswith(".json"):
        return fly_again(plan, Path(flight), as_json)
    folder = _folder(out, scenarios_asked, "campaign")
    if flight is not None:
        return _again(plan, flight, folder, as_json, flies)
    _fly(plan, flies or engine_named(engine), folder, records, as_json)


def _flights_of(asked: int | None, planned: int | None, *, until: bool) -> int:
    """How many flights a cell has: as asked, as its folder's plan has them, or by default; with a rule the most."""
    from flownav.api.campaigning import FLIGHTS, FLIGHTS_UNTIL
    from flownav.campaigns.plan import MOST_FLIGHTS

    default = FLIGHTS_UNTIL if until else FLIGHTS
    count = next((each for each in (asked, planned) if each is not None), default)
    require_between("--flights", count, 1, MOST_FLIGHTS)
    return count


def _scenarios(names: list[str], filter_name: str | None, vehicle: str | None) -> list[Scenario]:
    """The scenarios with their filter and vehicle. InputError where one cannot be, or a file is none to read."""
    from flownav.api.scenario import Scenario
    from flownav.core.guard import an_input

    chosen = [Scenario.load(name).changed(filter=filter_name, vehicle=vehicle) for name in names]
    for name in (*names, vehicle):
        if name is not None and Path(name).exists():
            an_input(Path(name))
    return chosen


def _folder(asked: Path | None, scenarios: list[Scenario], kind: str) -> Path:
    """Where the flights lie."""
    names = "_".join(dict.fromkeys(each.name for each in scenarios))[:100]
    return asked or Path("out") / f"{names}_{kind}"


def _fly(plan: Plan, engine: Engine, folder: Path, records: int, as_json: bool) -> None:
    """Fly the flights that the folder lacks, and print the result."""
    from flownav.api.campaigning import fly_plan
    from flownav.campaigns.store import REPORT
    from flownav.cli.campaign_output import show, watching

    with watching(plan) as watch:
        flown = fly_plan(plan, engine, folder, records=records, watch=watch)
    kept = [str(path) for path in flown.records]
    where = {"rate_per_s": flown.rate_per_s, "dataset": str(folder / "flights"), "records": kept}
    facts = flown.summary | where | {"report": str(folder / REPORT)}
    answer(facts, as_json, lambda: show(flown.summary, folder, flown.rate_per_s, kept))


def _again(plan: Plan, flight: str, folder: Path, as_json: bool, engine: Engine | None) -> None:
    """One flight of the campaign, flown again."""
    from flownav.api.campaigning import fly_again
    from flownav.cli.campaign_output import say_flight

    cell, _, number = flight.rpartition(":")
    try:
        place, index = int(cell or 0), int(number)
    except ValueError:
        raise InputError(f"--flight {flight}: a number, or CELL:NUMBER, is needed") from None
    record, path = fly_again(plan, folder, place, index, engine)
    where = {"record": str(path), "report": str(path.with_suffix(".html"))}
    say_flight({"cell": plan.cells[place].label, "flight": index, **record.scores, **where}, f"flight {index}", as_json)


def _planned_flights(folder: Path | None) -> int | None:
    """How many flights the campaign of a folder has, where there is one."""
    from flownav.campaigns.store import PLAN, plan_in

    found = plan_in(folder).get("flights") if folder is not None and (folder / PLAN).is_file() else None
    return found if isinstance(found, int) else None


def _set(text: str) -> tuple[str, Any]:
    """A name and its value, from NAME=VALUE. InputError where it is none."""
    name, equals, value = text.partition("=")
    if not equals or not name.strip() or not value.strip():
        raise InputError(f"--set {text}: NAME=VALUE is needed, such as filter.name=paper")
    return name.strip(), _value(value)


def _once(option: str, pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Names and what they are given. InputError where a name is given twice."""
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise InputError(f"{option} {name}: is given twice; leave one out")
        found[name] = value
    return found


def _swept(text: str) -> tuple[str, list[Any]]:
    """A name and its values, from NAME=START:STOP:STEP or NAME=A,B,C. InputError where they are none."""
    import math

    name, equals, values = text.partition("=")
    wrong = InputError(f"--sweep {text}: NAME=START:STOP:STEP or NAME=A,B,C is needed, such as filter.handover_s=2:8:2")
    if not equals or not name.strip() or not values.strip():
        raise wrong
    if ":" not in values:
        return name.strip(), list(dict.fromkeys(_value(value) for value in values.split(",")))
    ends = [_value(value) for value in values.split(":")]
    if len(ends) != 3 or not all(isinstance(end, float) for end in ends):
        raise wrong
    start, stop, step = ends
    if step <= 0.0 or stop < start or not (stop - start) / step < 10_000:
        raise wrong
    count = math.floor((stop - start) / step + 1e-9) + 1
    return name.strip(), [start + k * step for k in range(count)]


def _value(text: str) -> Any:
    """A number, true or false, or a text."""

    text = text.strip()
    if text in ("true", "false"):
        return text == "true"
    try:
        return number(text)
    except ValueError:
        return text


SPEEDS_M_S = ["2,4,6,8,10"]


def envelope(
    scenario: options.Scenario,
    speeds: Annotated[list[str], option("M/S", "Wind speeds at 20 ft [m/s], repeated or with commas.")] = SPEEDS_M_S,
    directions: Annotated[int, option("N", "How many directions the wind blows from, from north on.")] = 8,
    vehicle: options.Vehicle = None,
    flights: Annotated[int, option("N", "Flights of each speed and direction.")] = 32,
    seed: options.Seed = 1,
    ensemble: options.Ensemble = True,
    out: Annotated[Path | None, out_option("The page (HTML)", "out/SCENARIO_envelope.html")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Fly a scenario in winds of many speeds and directions: a table and a polar map of the share that landed."""
    from flownav.campaigns.local import directions_deg, fly_envelope
    from flownav.report.campaign import write_envelope
    from flownav.simulation.scenario import load_scenario, with_vehicle

    require_between("--flights", flights, 1, 1_000_000)
    require_between("--directions", directions, 1, 360)
    chosen_speeds = sorted(set(numbers("--speeds", speeds, 0.1, 30.0)))
    chosen = with_vehicle(load_scenario(scenario), vehicle)
    last_s = chosen.flight.may_land_after_s
    if last_s is None or last_s >= chosen.flight.duration_s or chosen.truth == "linear":
        raise InputError(f"{chosen.name}: it never lands; give a scenario with a may_land_after_s before its end")
    page = place(out or Path("out") / f"{chosen.name}_envelope.html", scenario, vehicle, force=force)
    with progress(f"Flying {chosen.name}", flights * directions * len(chosen_speeds)) as advance:
        rows = fly_envelope(
            chosen, chosen_speeds, directions_deg(directions), seed, flights, dispersed=ensemble, on_progress=advance
        )
    model = "ensemble" if ensemble else "matched"
    named = f", {vehicle}" if vehicle else ""
    title = f"{chosen.name}{named}, {model}, {flights} flights a field, seed {seed}"
    with writing(page):
        write_envelope(title, rows, page)
    facts = {"scenario": chosen.name, "vehicle": vehicle, "truth_model": model, "flights": flights, "seed": seed}
    answer(facts | {"cells": rows, "out": str(page)}, as_json, lambda: _show_envelope(title, rows, page))


def _show_envelope(title: str, rows: list[dict[str, Any]], page: Path) -> None:
    """Landed [%] by speed (rows) and direction (columns)."""
    directions = sorted({row["from_direction_deg"] for row in rows})
    lines = []
    for speed in sorted({row["speed_20ft_m_s"] for row in rows}):
        ring = {row["from_direction_deg"]: row["success"]["rate"] for row in rows if row["speed_20ft_m_s"] == speed}
        lines.append((f"{speed:g}", *(f"{100.0 * ring[direction]:.0f}" for direction in directions)))
    heads = ("m/s", *(f"{direction:g}°" for direction in directions))
    stated = "landed [%] by the wind at 20 ft (rows) and the direction that it blows from (columns)"
    say(title, stated, table(heads, lines, left=1), wide=max(len(stated), 10 + 7 * len(directions)))
    typer.echo(f"page  {page}")
