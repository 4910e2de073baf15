"""campaign: a scenario flown many times, swept and dispersed: figures with intervals, flights, rare events."""

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any
from weakref import finalize

from flownav.api.arguments import checked
from flownav.api.calls import call_of, require_from, require_known, split
from flownav.api.campaign import Campaign
from flownav.api.record import Record
from flownav.api.scenario import Scenario, scenario_of
from flownav.api.vehicle import Vehicle
from flownav.campaigns.engines import Engine
from flownav.campaigns.measures import MEASURES, Event, event_of, stop_of
from flownav.campaigns.plan import MOST_FLIGHTS, SAMPLINGS, Plan, Sampling, Value, lands, planned
from flownav.campaigns.rare.branches import read_branch, replayed, write_branch
from flownav.campaigns.rare.estimate import Rare, estimate_rare
from flownav.campaigns.run import Progress, Watch, engine_named, record_path, run_campaign
from flownav.campaigns.store import RECORDS, SUMMARY, Store
from flownav.campaigns.summary import WORST_FLIGHTS, summary_of
from flownav.core.errors import InputError, arg
from flownav.core.files import written_whole
from flownav.core.provenance import called_as
from flownav.parts.flying import OwnPartsEngine, identities
from flownav.parts.protocols import Controller, Filter, SensorModel, VehicleModel
from flownav.simulation.scenario import Scenario as ScenarioFile

FLIGHTS, FLIGHTS_UNTIL = 1000, 100_000
TRUTH_MODELS = ("ensemble", "matched", "both")
MOST_SEED = 2**63 - 1

Named = str | Path | Scenario


@checked
def campaign(
    scenario: Named | Sequence[Named] = "landing",
    *,
    flights: int | None = None,
    seed: int = 1,
    sweep: Mapping[str, Sequence[Value]] | None = None,
    sampling: str = "plain",
    truth_model: str = "ensemble",
    until: str | None = None,
    filter: str | Filter | type[Filter] | None = None,
    sensors: Sequence[SensorModel | type[SensorModel] | str] = (),
    vehicle: str | Path | Vehicle | VehicleModel | type[VehicleModel] | None = None,
    controller: str | Controller | type[Controller] | None = None,
    engine: str = "local",
    folder: str | Path | None = None,
    records: int = 0,
    progress: Watch | None = None,
    **changes: Any,
) -> Campaign:
    """Fly a scenario many times; return the results with intervals.

    scenario: one, or several. flights: of each cell, 1000 if not given; with `until` the most, then 100000. seed:
    flight k of a seed is always the same flight. sweep: every value of numbers of the scenario by their dotted names.
    sampling: plain, latin or sobol. truth_model: ensemble (each flight's truth is drawn), matched (as the filter
    assumes) or both. until: when to stop, such as "r95_m width <= 0.005". engine: local, ray (a cluster) or cuda (a
    GPU). folder: where the flights are kept, and where a campaign that was stopped goes on; None keeps them for as long
    as the result lives. records: write records and reports of this many of the worst flights into the folder. progress:
    called with `campaigns.run.Progress` as flights land. filter, sensors, vehicle, controller, changes: as `fly`; with
    parts of your own flights are flown one after the other, by this process. InputError, one line, for a name, a key or
    a value that cannot be.

    Example:
        >>> import flownav
        >>> result = flownav.campaign("landing", flights=16, sweep={"wind.speed_20ft_m_s": [0.0, 4.0]})
        >>> [cell["flights"] for cell in result.cells]
        [16, 16]
    """
    chosen = [scenario] if isinstance(scenario, str | Path | Scenario) else list(scenario)
    if not chosen:
        raise InputError("scenario: an empty list is given; name at least one")
    most = FLIGHTS if until is None else FLIGHTS_UNTIL
    call = call_of("campaign", *([chosen[0]] if len(chosen) == 1 else [chosen]), flights=flights, seed=seed,
                   sweep=sweep, sampling=sampling, truth_model=truth_model, until=until, filter=filter,
                   vehicle=vehicle, sensors=list(sensors), controller=controller,
                   **changes)  # fmt: skip
    parts, our_filter, our_vehicle = split(filter, sensors, vehicle, controller)
    require_known(changes, ScenarioFile.model_fields, campaign)
    fixed, rest = _split(changes)
    plan = plan_of(
        [scenario_of(one, filter=our_filter, vehicle=our_vehicle, **rest) for one in chosen],
        flights=most if flights is None else flights,
        seed=seed, sweep=sweep or {}, changes=fixed, sampling=sampling, truth_model=truth_model, until=until,
    )  # fmt: skip
    require_from("records", records, 0, WORST_FLIGHTS)
    if parts.any and engine != "local":
        raise InputError(f"engine {engine}: parts of your own are flown by this process; leave it out")
    plan = replace(plan, parts=identities(parts))
    where = OwnPartsEngine(parts) if parts.any else engine_named(engine)
    with called_as(call):
        if folder is not None:
            return fly_plan(plan, where, Path(folder), records=records, watch=progress)
        return _fly_for_now(plan, where, records, progress)


def _fly_for_now(plan: Plan, engine: Engine, records: int, watch: Watch | None) -> Campaign:
    """Fly into a folder that is removed when the result is no longer used."""
    folder = Path(mkdtemp(prefix="flownav-campaign-"))
    try:
        found = fly_plan(plan, engine, folder, records=records, watch=watch, page=False)
    except BaseException:
        rmtree(folder, ignore_errors=True)
        raise
    finalize(found, rmtree, folder, ignore_errors=True)
    return found


def plan_of(
    scenarios: Iterable[Scenario], *, flights: int, seed: int, sweep: Mapping[str, Sequence[Value]],
    changes: Mapping[str, Value], sampling: str, truth_model: str, until: str | None,
) -> Plan:  # fmt: skip
    """The plan of a campaign. InputError for what cannot be flown."""
    require_from("flights", flights, 1, MOST_FLIGHTS)
    for name, values in sweep.items():
        if isinstance(values, str) or not isinstance(values, Sequence) or len(values) == 0:
            raise InputError(f"sweep {name}: a list of values is needed, such as [0.0, 4.0]; got {values!r}")
    require_from("seed", seed, 0, MOST_SEED)
    for name, value, known in (("sampling", sampling, SAMPLINGS), ("truth_model", truth_model, TRUTH_MODELS)):
        if value not in known:
            raise InputError(f"{name} {value}: must be {', '.join(known[:-1])} or {known[-1]}")
    if until is not None:
        stop_of(until)
    models: Any = ("ensemble", "matched") if truth_model == "both" else (truth_model,)
    spread: Sampling = sampling  # type: ignore[assignment]
    return planned(
        [scenario.file for scenario in scenarios], sweep, truth_models=models, seed=seed, flights=flights,
        sampling=spread, until=until, changes=changes,
    )  # fmt: skip


def fly_plan(
    plan: Plan, engine: Engine, folder: Path, *, records: int = 0, watch: Watch | None = None, page: bool = True
) -> Campaign:
    """Fly what the folder lacks of a plan, and write its summary, records of its worst flights and its page.

    records: how many of the worst; with one or more the first cell's median flight is kept too. page: whether the page
    is written. InputError as `campaigns.run.run_campaign`.
    """
    flown = 0

    def watching(progress: Progress) -> None:
        nonlocal flown
        flown = progress.flown
        if watch is not None:
            watch(progress)

    with Store(folder).opened(plan) as store:
        began_s = time.monotonic()
        data = run_campaign(plan, engine, store, watching)
        rate = flown / max(time.monotonic() - began_s, 1e-9) if flown else None
        summary = summary_of(plan, data)
        store.keep_text(SUMMARY, json.dumps(summary, indent=1) + "\n")
        found = Campaign(plan, folder, summary, rate, engine)
        found.records += _keep_records(found, records)
        if page:
            found.report()
    return found


def _keep_records(found: Campaign, count: int) -> list[Path]:
    """Records and reports of the worst flights and of the first cell's median one; where they lie."""
    if count == 0:
        return []
    chosen = [*found.summary["worst"][:count], found.summary["cells"][0]["median"]]
    places = dict.fromkeys((each["cell"], each["flight"]) for each in chosen)
    return [_keep(found.record(flight, cell=cell), found.folder, cell, flight) for cell, flight in places]


def fly_again(plan: Plan, folder: Path, cell: int, flight: int, engine: Engine | None = None) -> tuple[Record, Path]:
    """One flight of a plan flown again, its record and its report in the folder; the record, and where it lies.

    InputError where there is no such flight, or the folder is another campaign's.
    """
    Store(folder).check(plan.as_json)
    record = Campaign(plan, folder, {}, engine=engine).record(flight, cell=cell)
    return record, _keep(record, folder, cell, flight)


def _keep(record: Record, folder: Path, cell: int, flight: int) -> Path:
    """A flight's record and report in a campaign's folder; where the record lies."""
    path = record_path(folder / RECORDS, cell, flight)
    record.save(path)
    record.report(path.with_suffix(".html"))
    return path


def _split(changes: Mapping[str, Any], prefix: str = "") -> tuple[dict[str, Value], dict[str, Any]]:
    """Numbers and words that the campaign sets, by dotted names, and what else is changed (a path, a vehicle)."""
    fixed: dict[str, Value] = {}
    rest: dict[str, Any] = {}
    for name, value in changes.items():
        if isinstance(value, Mapping):
            inner, other = _split(value)
            fixed |= {f"{name}.{key}": one for key, one in inner.items()}
            rest |= {name: other} if other else {}
        elif isinstance(value, bool | int | float) or "." in name:
            fixed[name] = value
        elif value is not None:
            rest[name] = value
    return fixed, rest


FLIGHT, FOUND = "rare_flight.json", "rare.json"


@dataclass(frozen=True)
class RareEvent:
    """A rare event's figures, as rare.json has them, the number of flights a second, and where the most likely flight
    lies.
    """

    facts: dict[str, Any]
    rate_per_s: float
    where: dict[str, str]


def rare_event_of(plan: Plan, text: str) -> Event:
    """The event in these words. InputError where it is none, or this plan cannot be asked for it."""
    require_one(plan, "rare")
    if plan.sampling != "plain" or plan.until is not None:
        raise InputError(
            f"{arg('rare')}: has samples and a stop of its own; leave out {arg('sampling')} and {arg('until')}"
        )
    chosen = event_of(text)
    if MEASURES[chosen.measure].of_landing and not lands(plan.cells[0].scenario):
        raise InputError(f"{arg('rare')} {chosen}: the scenario {plan.cells[0].scenario.name} never lands")
    return chosen


def estimate_event(plan: Plan, event: Event, folder: Path, progress: Callable[[int], object]) -> RareEvent:
    """How probable an event is, by subset simulation; written into the folder with its most likely flight.

    progress: called with how many more flights are down.
    """
    folder.mkdir(parents=True, exist_ok=True)
    cell = plan.cells[0]
    began_s = time.monotonic()
    found = estimate_rare(
        cell.setup, event, seed=plan.seed, flights=plan.flights, dispersed=cell.truth_model == "ensemble",
        on_progress=progress,
    )  # fmt: skip
    rate = found.flights / (time.monotonic() - began_s)
    facts = found.as_json() | {"cell": cell.label, "seed": plan.seed, "known": found.known}
    with written_whole(folder / FOUND) as whole:
        whole.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    return RareEvent(facts, rate, _keep_branch(plan, found, folder))


def fly_branch(plan: Plan, path: Path) -> tuple[Record, dict[str, str]]:
    """The flight of such a file, flown again; its record and its report lie beside it. InputError where it is none."""
    require_one(plan, "flight")
    setup = plan.cells[0].setup
    record = Record.of(replayed(setup, read_branch(path, setup)))
    return record, _written(record, path.with_suffix(".fnr"))


def require_one(plan: Plan, name: str) -> None:
    """InputError where there is more than one cell."""
    if len(plan.cells) != 1:
        raise InputError(
            f"{arg(name)}: needs one scenario, one {arg('truth_model')} and no {arg('sweep')}, "
            f"not {len(plan.cells)} cells"
        )


def _keep_branch(plan: Plan, found: Rare, folder: Path) -> dict[str, str]:
    """The most likely flight as a file, as a record and as a report; where they lie."""
    if found.branch is None:
        return {}
    setup, flight = plan.cells[0].setup, folder / FLIGHT
    write_branch(flight, setup, found.branch, found.event, found.branch_response)
    record = Record.of(replayed(setup, found.branch))
    return {"flight": str(flight), **_written(record, flight.with_suffix(".fnr"))}


def _written(record: Record, path: Path) -> dict[str, str]:
    record.save(path)
    return {"record": str(path), "report": str(record.report(path.with_suffix(".html")))}
