"""`flownav campaign`: a scenario flown many times, swept and dispersed, with intervals, kept as it flies."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli.choices import SAMPLINGS, SCENARIOS, TRUTH_MODELS, argument, one_of
from flownav.cli.options import EngineOption, FilterOption, JsonOption, SeedOption, VehicleOption, out_option
from flownav.cli.output import emit
from flownav.errors import InputError

if TYPE_CHECKING:
    from flownav.campaigns.engines.engine import Engine
    from flownav.campaigns.plan import Plan


def command(
    scenarios: Annotated[
        list[str],
        argument("SCENARIO", "What is flown", *SCENARIOS, beside="a scenario's FILE.toml"),
    ],
    flights: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Flights of each cell; with --until or --rare the most.",
            show_default="1000; with --until or --rare 100000",
        ),
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(metavar="RULE", help='Stop when an interval is narrow enough: "r95_m width <= 0.005".'),
    ] = None,
    sweep: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUES",
            help="Fly every value of a key of the scenario, wind.speed_20ft_m_s=0:12:2 or =a,b,c; may be repeated.",
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Another value in the scenario: filter.name=paper."),
    ] = None,
    sampling: Annotated[
        str, typer.Option(help="How the dispersed inputs are spread over the flights.", **one_of(*SAMPLINGS))
    ] = "plain",
    truth_model: Annotated[
        str,
        typer.Option(
            help="Each flight's vehicle, wind and sensors drawn, as the datasheets say, or both.",
            **one_of(*TRUTH_MODELS),
        ),
    ] = "ensemble",
    filter_name: FilterOption = None,
    vehicle: VehicleOption = None,
    seed: SeedOption = 1,
    engine: EngineOption = "local",
    out: Annotated[
        Path | None,
        out_option(
            "The folder; flights that are there are kept",
            "out/SCENARIO_campaign; with --rare SCENARIO_rare",
        ),
    ] = None,
    records: Annotated[
        int, typer.Option(metavar="N", help="Write records and reports of so many of the worst flights.")
    ] = 1,
    flight: Annotated[
        str | None,
        typer.Option(
            metavar="K",
            help="Fly this flight again and write its record: K, CELL:K, or --rare's rare_flight.json.",
        ),
    ] = None,
    rare: Annotated[
        str | None,
        typer.Option(metavar="EVENT", help='How probable this is, to 1e-6: "touchdown.horizontal_m > 1", "crash".'),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Fly a scenario many times: radii, shares and percentiles with intervals, a dataset, the worst flights."""
    from flownav.api.campaigning import FLIGHTS, FLIGHTS_UNTIL, MOST_SEED, plan_of
    from flownav.api.parts import split
    from flownav.api.scenario import Scenario
    from flownav.campaigns.engines.named import engine_named, require_engine
    from flownav.campaigns.plan import MOST_FLIGHTS
    from flownav.campaigns.summary import WORST
    from flownav.cli.output import require_between
    from flownav.guard import an_input
    from flownav.parts.engine import OwnPartsEngine, identities

    if flight is not None and flights is None:
        flights = _planned_flights(out)
    most = FLIGHTS if until is None and rare is None else FLIGHTS_UNTIL
    flights = flights if flights is not None else most
    require_between("--flights", flights, 1, MOST_FLIGHTS)
    require_between("--seed", seed, 0, MOST_SEED)
    require_between("--records", records, 0, WORST)
    require_engine(engine)
    parts, ours, _ = split(filter_name, (), None, None)
    if parts.any and (engine != "local" or rare is not None):
        raise InputError(f"--filter {filter_name}: is flown by this process; leave out --engine and --rare")
    chosen = [Scenario.load(name).changed(filter=ours, vehicle=vehicle) for name in scenarios]
    for name in (*scenarios, vehicle):
        if name is not None and Path(name).exists():
            an_input(Path(name))
    plan = plan_of(
        chosen, flights=flights, seed=seed, sweep=_once("--sweep", map(_swept, sweep or ())),
        changes=_once("--set", map(_set, set_ or ())), sampling=sampling, truth_model=truth_model, until=until,
    )  # fmt: skip
    plan = replace(plan, parts=identities(parts))
    flies = OwnPartsEngine(parts) if parts.any else None
    names = "_".join(dict.fromkeys(each.name for each in chosen))[:100]
    if rare is not None and engine != "local":
        raise InputError(f"--rare: flies on this machine's cores only; leave out --engine {engine}")
    folder = out or Path("out") / f"{names}_campaign"
    if rare is not None:
        from flownav.cli.campaign_rare import fly_rare

        fly_rare(plan, rare, out or Path("out") / f"{names}_rare", as_json)
    elif flight is not None and flight.endswith(".json"):
        from flownav.cli.campaign_rare import fly_again

        fly_again(plan, Path(flight), as_json)
    elif flight is not None:
        _again(plan, flight, folder, as_json, flies)
    else:
        _fly(plan, flies or engine_named(engine), folder, records, as_json)


def _fly(plan: Plan, engine: Engine, folder: Path, records: int, as_json: bool) -> None:
    """Fly what the folder lacks; what is said of it."""
    from flownav.api.campaigning import fly_plan
    from flownav.campaigns.store import REPORT
    from flownav.cli.campaign_progress import watching

    with watching(plan) as watch:
        flown = fly_plan(plan, engine, folder, records=records, watch=watch)
    kept = [str(path) for path in flown.records]
    if as_json:
        where = {"rate_per_s": flown.rate_per_s, "dataset": str(folder / "flights"), "records": kept}
        emit(flown.summary | where | {"report": str(folder / REPORT)})
    else:
        from flownav.cli.campaign_table import show

        show(flown.summary, folder, flown.rate_per_s, kept)


def _again(plan: Plan, flight: str, folder: Path, as_json: bool, engine: Engine | None) -> None:
    """One flight of the campaign, flown again."""
    from flownav.api.campaigning import fly_again

    cell, _, number = flight.rpartition(":")
    try:
        place, index = int(cell or 0), int(number)
    except ValueError:
        raise InputError(f"--flight {flight}: a number, or CELL:NUMBER, is needed") from None
    record, path = fly_again(plan, folder, place, index, engine)
    where = {"record": str(path), "report": str(path.with_suffix(".html"))}
    facts = {"cell": plan.cells[place].label, "flight": index, **record.scores, **where}
    if as_json:
        emit(facts)
    else:
        typer.echo(f"{facts['cell']}, flight {index}\nrecord  {where['record']}\nreport  {where['report']}")


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
    from flownav.text import number

    text = text.strip()
    if text in ("true", "false"):
        return text == "true"
    try:
        return number(text)
    except ValueError:
        return text
