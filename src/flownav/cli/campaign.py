"""`flownav campaign`: a scenario flown many times, swept and dispersed, with intervals, kept as it flies."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli.engines import EngineOption, engine_named, require_engine
from flownav.cli.output import VehicleOption
from flownav.errors import InputError

if TYPE_CHECKING:
    from flownav.campaigns.engines.engine import Engine
    from flownav.campaigns.plan import Plan

FLIGHTS, FLIGHTS_UNTIL = 1000, 100_000
TRUTH_MODELS = ("ensemble", "matched", "both")


def command(
    scenarios: Annotated[
        list[str], typer.Argument(help="Scenarios: takeoff, landing, approach, ..., or files (TOML).")
    ],
    flights: Annotated[
        int | None,
        typer.Option(help="Flights of each cell, 1000 if not given; with --until or --rare the most, then 100000."),
    ] = None,
    until: Annotated[
        str | None, typer.Option(help='Stop when an interval is narrow enough: "r95_m width <= 0.005".')
    ] = None,
    sweep: Annotated[
        list[str] | None,
        typer.Option(help="Fly every value of a number of the scenario: wind.speed_20ft_m_s=0:12:2, or =a,b,c."),
    ] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", help="Another value in the scenario: filter.name=paper.")
    ] = None,
    sampling: Annotated[
        str, typer.Option(help="How inputs are spread over the flights: plain, latin, sobol.")
    ] = "plain",
    truth_model: Annotated[
        str, typer.Option(help="ensemble (each flight's truth is drawn), matched (as the filter is told), both.")
    ] = "ensemble",
    vehicle: VehicleOption = None,
    seed: Annotated[int, typer.Option(help="The campaign's noise; flight k of a seed is always the same flight.")] = 1,
    engine: EngineOption = "local",
    out: Annotated[Path | None, typer.Option(help="Its folder; out/SCENARIO_campaign if not given.")] = None,
    records: Annotated[int, typer.Option(help="Write records and reports of so many of the worst flights.")] = 1,
    flight: Annotated[
        str | None,
        typer.Option(help="Fly this flight again and write its record: K, CELL:K, or the rare_flight.json of --rare."),
    ] = None,
    rare: Annotated[
        str | None, typer.Option(help='How probable this is, down to 1e-6: "touchdown.horizontal_m > 1", "crash".')
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Fly a scenario many times: radii, shares and percentiles with intervals, a dataset, the worst flights."""
    from flownav.campaigns.figures import stop_of
    from flownav.campaigns.plan import MOST_FLIGHTS, planned
    from flownav.campaigns.sampling import SAMPLINGS
    from flownav.campaigns.summary import WORST
    from flownav.cli.output import require_between
    from flownav.guard import an_input
    from flownav.simulation.scenario import load_scenario, with_vehicle

    if flight is not None and flights is None:
        flights = _planned_flights(out)
    most = FLIGHTS if until is None and rare is None else FLIGHTS_UNTIL
    flights = flights if flights is not None else most
    require_between("--flights", flights, 1, MOST_FLIGHTS)
    require_between("--seed", seed, 0, 2**63 - 1)
    require_between("--records", records, 0, WORST)
    require_engine(engine)
    for option, value, known in (("--sampling", sampling, SAMPLINGS), ("--truth-model", truth_model, TRUTH_MODELS)):
        if value not in known:
            raise InputError(f"{option} {value}: must be {', '.join(known[:-1])} or {known[-1]}")
    if until is not None:
        stop_of(until)
    chosen = [with_vehicle(load_scenario(name), vehicle) for name in scenarios]
    for name in (*scenarios, vehicle):
        if name is not None and Path(name).exists():
            an_input(Path(name))
    models: Any = ("ensemble", "matched") if truth_model == "both" else (truth_model,)
    plan = planned(
        chosen, _once("--sweep", map(_swept, sweep or ())), truth_models=models, seed=seed, flights=flights,
        sampling=sampling, until=until, changes=_once("--set", map(_set, set_ or ())),  # type: ignore[arg-type]
    )  # fmt: skip
    names = "_".join(dict.fromkeys(each.name for each in chosen))
    if rare is not None and engine != "local":
        raise InputError(f"--rare: flies on this machine's cores only; leave out --engine {engine}")
    folder = out or Path("out") / f"{names[:100]}_campaign"
    if rare is not None or (flight is not None and flight.endswith(".json")):
        from flownav.cli.campaign_rare import fly_again, fly_rare

        if rare is not None:
            fly_rare(plan, rare, out or Path("out") / f"{names[:100]}_rare", as_json)
        else:
            fly_again(plan, Path(str(flight)), as_json)
    elif flight is not None:
        _again(plan, flight, folder, as_json)
    else:
        _fly(plan, engine_named(engine), folder, records, as_json)


def _fly(plan: Plan, engine: Engine, folder: Path, records: int, as_json: bool) -> None:
    """Fly what the folder lacks; summary, records and page; what is said of them."""
    from flownav.campaigns.run import run_campaign
    from flownav.campaigns.store import REPORT, SUMMARY, Store
    from flownav.campaigns.summary import summary_of
    from flownav.cli.campaign_progress import watching

    with Store(folder).opened(plan) as store:
        began_s = time.monotonic()
        with watching(plan) as watch:
            data = run_campaign(plan, engine, store, watch)
        rate = watch.flown / max(time.monotonic() - began_s, 1e-9) if watch.flown else None
        summary = summary_of(plan, data)
        store.keep_text(SUMMARY, json.dumps(summary, indent=1) + "\n")
        kept = _keep_records(plan, summary, folder, records)
        _keep_page(plan, summary, folder, kept)
    where = {"rate_per_s": rate, "dataset": str(folder / "flights"), "records": kept}
    where["report"] = str(folder / REPORT)
    if as_json:
        typer.echo(json.dumps(summary | where))
        return
    from flownav.cli.campaign_table import show

    show(summary, folder, rate, kept)


def _keep_records(plan: Plan, summary: dict[str, Any], folder: Path, count: int) -> list[str]:
    """Records and reports of the worst flights and of the first cell's median one; where they lie."""
    from flownav.campaigns.again import record_again, record_path
    from flownav.campaigns.store import RECORDS
    from flownav.cli.output import save

    if count == 0:
        return []
    chosen = [*summary["worst"][:count], summary["cells"][0]["median"]]
    found = []
    for cell, flight in dict.fromkeys((each["cell"], each["flight"]) for each in chosen):
        path = record_path(folder / RECORDS, cell, flight)
        save(record_again(plan, cell, flight), path, report=True)
        found.append(str(path))
    return found


def _keep_page(plan: Plan, summary: dict[str, Any], folder: Path, records: list[str]) -> None:
    """The campaign's page, with links to the reports of the flights that were kept."""
    from flownav.campaigns.measures import measured
    from flownav.campaigns.store import RECORDS, REPORT, Dataset
    from flownav.report.campaign import write_campaign
    from flownav.report.campaign_figures import Touchdowns

    data, touched = Dataset(folder), []
    for cell, planned in enumerate(plan.cells):
        rows = data.rows(cell)
        north, east, distance = (measured(f"touchdown.{name}_m", rows) for name in ("north", "east", "horizontal"))
        touched.append(Touchdowns(north, east, distance, float(planned.scenario.pad.size_m)))
    kept = [f"{RECORDS}/{Path(record).with_suffix('.html').name}" for record in records]
    write_campaign(summary, touched, kept, folder / REPORT)


def _again(plan: Plan, flight: str, folder: Path, as_json: bool) -> None:
    """One flight of the campaign, flown again."""
    from flownav.campaigns.again import record_again, record_path
    from flownav.campaigns.store import RECORDS, Store
    from flownav.cli.output import save

    cell, _, number = flight.rpartition(":")
    try:
        place, index = int(cell or 0), int(number)
    except ValueError:
        raise InputError(f"--flight {flight}: a number, or CELL:NUMBER, is needed") from None
    if not 0 <= place < len(plan.cells):
        raise InputError(f"--flight {flight}: there are cells 0 to {len(plan.cells) - 1}")
    if not 0 <= index < plan.flights:
        raise InputError(f"--flight {flight}: there are flights 0 to {plan.flights - 1} of each cell")
    Store(folder).check(plan.as_json)
    record = record_again(plan, place, index)
    where = save(record, record_path(folder / RECORDS, place, index), report=True)
    facts = {"cell": plan.cells[place].label, "flight": index, **record.manifest["scores"], **where}
    if as_json:
        typer.echo(json.dumps(facts))
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
