"""fly: a scenario flown in closed loop, one flight or many, as records with their scores."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flownav.api.arguments import checked
from flownav.api.calls import call_of, require_from, require_known, split
from flownav.api.record import Record
from flownav.api.scenario import Scenario, scenario_of
from flownav.api.vehicle import Vehicle
from flownav.campaigns.judged import BOUND_FLIGHTS, Judged, bound_of, consistency_facts, fly_judged
from flownav.campaigns.local import fly_recorded, known_exactly, median_flight, score_history
from flownav.core.compile import meanwhile
from flownav.core.errors import InputError, arg
from flownav.core.provenance import called_as
from flownav.core.record_file import load_libraries
from flownav.parts.flying import fly_parts, fly_with, names_of
from flownav.parts.protocols import Controller, Filter, Parts, SensorModel, VehicleModel
from flownav.scoring.errors import attitude_scores, percentile_of_paper, published, scores_of_flights, touchdown_rows
from flownav.scoring.landings import takeoff_of_flights, touches_of_flights
from flownav.scoring.touchdown import load_kernel
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.engine import fly_one
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.scenario import Scenario as ScenarioFile

OF_MANY_FLIGHTS = ("rmse_over_bound", "anees_inside_fraction", "error_over_stated")
UNCOUNTED: dict[str, Any] = {"takeoff": None, "attitude_deg": None}  # of many flights with parts or on pixels
MOST_FLIGHTS, MOST_SEED = 10_000_000, 2**63 - 1

NO_PARTS = Parts()

Progress = Callable[[int], object]


@checked
def fly(
    scenario: str | Path | Scenario = "sortie",
    *,
    seed: int = 1,
    flight: int | Mapping[str, Any] = 0,
    filter: str | Filter | type[Filter] | None = None,
    sensors: Sequence[SensorModel | type[SensorModel] | str] = (),
    vehicle: str | Path | Vehicle | VehicleModel | type[VehicleModel] | None = None,
    controller: str | Controller | type[Controller] | None = None,
    dispersed: bool = False,
    progress: Progress | None = None,
    **changes: Any,
) -> Record:
    """Fly a scenario once, in closed loop, and score the flight.

    scenario: sortie (the whole mission, by default), takeoff, landing, gusty, pad_return, approach, a TOML file or a
    Scenario. seed: of all noise. flight: the number of the flight, flight k of a seed being always the same to the bit;
    or a mapping of the scenario's table of that name: `flight={"duration_s": 6.0}`. filter: "landing" (the navigator,
    by default), "paper", or a filter of your own: its class, an object, an entry point's name or "file.py:Class" (docs:
    own parts); likewise sensors, each in place of ours of its kind, and controller. vehicle: a shipped one's name, a
    file, a Vehicle or a vehicle of your own. dispersed: vehicle, wind and sensors are drawn for this flight, and
    neither navigator nor autopilot knows how; else they are what is believed. progress: called with 1 when it is down.
    changes: other values for the scenario's own keys, as `Scenario.changed` takes them (docs/reference/scenarios.md):
    `wind=8` or `wind="8:270"` (m/s at 20 ft, from the west), `gps="midg"`, `wind={"speed_20ft_m_s": 4.0}`.
    InputError, one line, for a name, a key or a value that cannot be. What a flight crashes on is in `record.verdict`.

    Example:
        >>> import flownav
        >>> record = flownav.fly("landing", seed=1, flight={"duration_s": 6.0}, wind={"speed_20ft_m_s": 4.0})
        >>> record.scores["states"]["x"]["rms_error"] < 1.0
        True
    """
    number = 0 if isinstance(flight, Mapping) else flight
    parts, own_filter, own_vehicle = split(filter, sensors, vehicle, controller)
    require_known(changes, ScenarioFile.model_fields, fly)
    options: dict[str, Any] = {"filter": own_filter, "vehicle": own_vehicle, **changes}
    if isinstance(flight, Mapping):
        options["flight"] = flight
    require_from("seed", seed, 0, MOST_SEED)
    require_from("flight", number, 0, MOST_FLIGHTS)
    setup = assemble(scenario_of(scenario, **options).file)
    passed = {
        **names_of(parts),
        **{name: value for name, value in options.items() if value is not None and name != "flight"},
    }
    with called_as(call_of("fly", scenario, seed=seed, flight=flight, dispersed=dispersed or None, **passed)):
        return fly_setup(setup, seed, number, dispersed=dispersed, parts=parts, progress=progress).record


@dataclass(frozen=True)
class Flights:
    """One flight or many of a scenario.

    record: of the one, or of the one with the median largest error, which is flight `index` of the seed. facts: what
    was flown, and its scores; of many each number with its median and 5th and 95th percentile.
    """

    record: Record
    index: int
    facts: dict[str, Any]


def fly_setup(
    setup: Setup, seed: int, first: int = 0, flights: int = 1, *, dispersed: bool = False,
    parts: Parts = NO_PARTS, progress: Progress | None = None,
) -> Flights:  # fmt: skip
    """Fly one flight, or flights 0 to `flights - 1`, of a scenario that is made ready, and score them.

    first: the number of the one flight. parts: those that are not ours. progress: called with how many more flights are
    down.
    """
    advance = progress or (lambda flown: None)
    truths = setup.ensemble() if dispersed else None
    facts = _facts(setup, seed, flights, dispersed=dispersed)
    if parts.any:
        return _fly_parts(setup, parts, seed, first, flights, truths, facts, advance)
    if setup.scenario.optics == "pixels":
        return _fly_pixels(setup, seed, first, flights, truths, facts, advance)
    if flights > 1:
        return _fly_many(setup, seed, flights, truths, facts, advance)
    with meanwhile(_get_ready_to_save):
        record = Record.of(fly_recorded(setup, seed, first, truths))
    advance(1)
    return Flights(record, first, facts | _nothing_of_many(setup) | record.scores)


def _get_ready_to_save() -> None:
    """Load the modules that score and save a flight: a second, which a first flight has while it waits for a kernel."""
    import flownav.report.html  # noqa: F401

    load_kernel()
    load_libraries()


def _facts(setup: Setup, seed: int, flights: int, *, dispersed: bool) -> dict[str, Any]:
    """Facts of the flights: scenario, filter, truth model and seed."""
    scenario = setup.scenario
    return {
        "scenario": scenario.name,
        "filter": scenario.filter.name,
        "gps": scenario.gps.model,
        "truth": scenario.truth,
        "feedback": scenario.autopilot.feedback,
        "optics": scenario.optics,
        "truth_model": "ensemble" if dispersed else "matched",
        "seed": seed,
        "flights": flights,
        "notes": notes_of(setup),
    }


def notes_of(setup: Setup) -> list[str]:
    """Sentences on a scenario that is flown beyond the limits that its vehicle's file states; most have none."""
    asked_m_s, stated_m_s = setup.scenario.wind.speed_20ft_m_s, setup.file.wind.max_speed_20ft_m_s
    if stated_m_s == 0.0 or asked_m_s <= stated_m_s:
        return []
    limit = f"beyond the {stated_m_s:g} m/s that the vehicle's file states"
    return [f"the wind of {asked_m_s:g} m/s at 20 ft is {limit} (docs/explanation/control.md, The envelope)"]


def _nothing_of_many(setup: Setup) -> dict[str, Any]:
    """The list of what the navigator is given exactly, with figures of many flights left empty."""
    if setup.fitted is None:
        return {}
    return {"known_exactly": known_exactly(setup.scenario), **dict.fromkeys(OF_MANY_FLIGHTS)}


def _fly_many(
    setup: Setup, seed: int, flights: int, truths: Ensemble | None, facts: dict[str, Any], advance: Progress
) -> Flights:
    """Many flights side by side; the record of the median one."""
    judged: Judged = fly_judged(setup.flight, seed, flights, ensemble=truths, on_progress=advance)
    index = median_flight(judged.scores)
    if setup.fitted is not None:
        facts |= consistency_facts(judged, bound_of(setup, seed, min(flights, BOUND_FLIGHTS)))
        facts["known_exactly"] = known_exactly(setup.scenario)
    scores = scores_of_flights(judged.scores)
    scores["takeoff"] = None if judged.takeoffs is None else takeoff_of_flights(judged.takeoffs)
    scores["attitude_deg"] = None if judged.attitude_deg is None else attitude_scores(judged.attitude_deg)
    table = published(setup.scenario.paper_table)
    percentile = {"paper_percentile": percentile_of_paper(judged.scores, table)} if table else {}
    record = Record.of(fly_recorded(setup, seed, index, truths))
    if scores["touchdown"] is not None:
        record.manifest["many"] = touches_of_flights(touchdown_rows(judged.scores), scores["touchdown"])
    return Flights(record, index, facts | scores | percentile)


def _fly_parts(
    setup: Setup, parts: Parts, seed: int, first: int, flights: int, truths: Ensemble | None, facts: dict[str, Any],
    advance: Progress,
) -> Flights:  # fmt: skip
    """Flights with a user's own parts, one after the other; the record of the median one."""
    rows = []
    for index in range(first, first + flights) if flights > 1 else ():
        flown = fly_parts(setup, parts, seed, index, truths, written=False)
        rows.append(score_history(setup.flight, flown.history)[0])
        advance(1)
    index = first + median_flight(np.array(rows)) if rows else first
    record = Record.of(fly_with(setup, parts, seed, index, truths))
    scores = scores_of_flights(np.array(rows)) | UNCOUNTED if rows else record.scores
    named = {"filter": record.manifest["filter"], "parts": record.manifest["parts"]}
    return Flights(record, index, facts | named | _nothing_of_many(setup) | scores)


def _fly_pixels(
    setup: Setup, seed: int, first: int, flights: int, truths: Ensemble | None, facts: dict[str, Any], advance: Progress
) -> Flights:
    """Flights on rendered frames, one after the other; the first one's record, and what was seen by height."""
    from flownav.campaigns.pixels import agreement, fly_on_pixels

    records, rows, frames = [], [], []
    for index in range(first, first + flights):
        seen, rendered = fly_on_pixels(setup, seed, index, truths)
        records.append(fly_recorded(seen, seed, index, truths))
        rows.append(score_history(seen.flight, fly_one(seen.flight, seed, index, truths))[0])
        frames += rendered
        advance(1)
    assert setup.fitted is not None
    assert setup.fitted.sheets.pad_camera is not None
    facts["pad_frames"] = agreement(frames, setup.fitted.sheets.pad_camera)
    scores = records[0].manifest["scores"] if flights == 1 else scores_of_flights(np.array(rows)) | UNCOUNTED
    return Flights(Record.of(records[0]), first, facts | _nothing_of_many(setup) | scores)


def tell(setup: Setup, record: Record, url: str, speed: float, key: Path | None) -> dict[str, Any]:
    """Send a flight of `setup` over MAVLink, as an autopilot would; return how far it came, and the messages received.

    speed: 1 is real time. key: a file whose key signs the messages. InputError where the flight has no sensors of its
    own, or the link cannot be opened.
    """
    from flownav.campaigns.faults.table import log_of
    from flownav.live.byte_links import open_link
    from flownav.live.loop import run_vehicle, stoppable
    from flownav.live.simulated import SimulatedVehicle
    from flownav.logs.mavlink.signing import load_key

    if "imu" not in record.tables or "gps_velocity" not in record.tables:
        raise InputError(
            f"{arg('url')}: the flight has no IMU or no GPS velocity; give {arg('filter')} landing {arg('gps')} midg"
        )
    vehicle = SimulatedVehicle(log_of(record, setup), key=load_key(key) if key else None)
    link = open_link(url)
    try:
        with stoppable() as asked:
            reached_s = run_vehicle(vehicle, link, speed, asked)
    finally:
        link.close()
    return {"flight_s": min(reached_s, vehicle.end_s), "speed": speed, "heard": dict(vehicle.counts)}
