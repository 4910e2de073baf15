"""The cells of a requirement: each combination of the heights, sensors, vehicles and faults of its conditions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import pairwise, product
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.faults.catalogue import FAULTS, NOT_FLOWN
from flownav.campaigns.faults.flown import law_of_flight
from flownav.campaigns.measures import MEASURES, NOT_LANDED
from flownav.campaigns.plan import EDGE_MARGIN, Cell, Plan, lands
from flownav.campaigns.requirement import NO_FAULT, OWN_SENSOR, Requirement, fixed_by, scenario_of
from flownav.campaigns.store import PLAN, plan_in
from flownav.core.errors import InputError, arg
from flownav.core.parameter_files import check
from flownav.simulation.plan import Flight
from flownav.simulation.scenario import Scenario
from flownav.simulation.sensing import EPOCH_S
from flownav.simulation.truth import SensorFault

BEFORE_LANDING_S = 5.0  # that a fault begins, where the requirement gives no time
MOST_CELLS = 200


@dataclass(frozen=True)
class SensorFailure:
    """A fault of the catalogue by its name, from when to when [s]."""

    name: str
    begins_s: float
    ends_s: float

    @property
    def words(self) -> str:
        """The failure, from when to when, and its effect, in words."""
        return f"{self.name} from {self.begins_s:.15g} to {self.ends_s:.15g} s: {FAULTS[self.name].what}"

    def law(self, flight: Flight, seed: int, number: int) -> SensorFault:
        """One flight's fault."""
        assert flight.onboard is not None  # `_failure` asked
        period_s = flight.onboard.carried.flow_camera.clock.every * EPOCH_S
        return law_of_flight(FAULTS[self.name], (self.begins_s, self.ends_s), seed, number, period_s)


def plan_of(requirement: Requirement, flights: int | None = None, vehicle: str | None = None) -> Plan:
    """The campaign of a requirement, each flight with a number of its own, so that all are independent.

    Its seed is of the requirement's, of how many are flown and of what is asked (`seed_of`): a plan of more flights
    shares none with one of fewer, so that none are added to flights that can be seen, in whatever folder.

    flights: how many at least; as many as the requirement needs where it is None. As many are flown in each cell.
    InputError as `cells_of`.
    """
    cells = cells_of(requirement, vehicle)
    each = -(-(flights or requirement.flights()) // len(cells))
    asked = tuple(table.sentence() for table in requirement.requirement)
    own = tuple(replace(cell, first=k * each) for k, cell in enumerate(cells))
    return Plan(own, seed_of(requirement.seed, each, asked), each, asked=asked)


def seed_of(seed: int, each: int, asked: tuple[str, ...]) -> int:
    """A campaign's seed, 31 bits of the SHA-256 of the requirement's seed, the flights a cell and what is asked."""
    seeds = "\n".join([str(seed), str(each), *asked])
    return int.from_bytes(sha256(seeds.encode()).digest()[:4], "big") >> 1


def require_planned(plan: Plan, folder: Path) -> None:
    """InputError where a folder's flights were planned to be fewer or more, or for something else that was asked.

    None are added, and nothing softer is asked, once they can be seen.
    """
    known = plan_in(folder) if (folder / PLAN).is_file() else plan.as_json
    planned, asked = known.get("flights"), known.get("asked")
    if asked is not None and list(asked) != list(plan.asked):
        raise InputError(
            f"{folder}: was flown for {'; '.join(map(str, asked))}; to judge its flights by something else takes more "
            "risk than is stated: give another folder, whose flights will be others"
        )
    if planned != plan.flights:
        raise InputError(
            f"{folder}: was planned with {planned} flights a cell, not {plan.flights}; to add flights until they pass "
            "takes more risk than is stated: give another folder, whose flights will be others"
        )


def cells_of(requirement: Requirement, vehicle: str | None = None) -> tuple[Cell, ...]:
    """Every cell. InputError where one cannot be flown, or does not have what a requirement measures.

    vehicle: another one than the requirement's; the conditions must then name none.
    """
    conditions = requirement.conditions
    if vehicle is not None and conditions.vehicle:
        raise InputError(
            f"{arg('vehicle')} {vehicle}: {requirement.name} names vehicles in its conditions; leave one of the two out"
        )
    lists: dict[str, tuple[Any, ...]] = {
        "vehicle": conditions.vehicle,
        "height_m": conditions.heights_m(),
        "sensor": conditions.sensor,
        "fault": conditions.fault,
    }
    named = {name: values for name, values in lists.items() if values}
    count = prod(map(len, named.values()))
    if count > MOST_CELLS:
        raise InputError(f"{requirement.name}: conditions: {count} cells; at most {MOST_CELLS} are flown")
    combinations = [dict(zip(named, values, strict=True)) for values in product(*named.values())]
    return tuple(_cell(requirement, values, vehicle) for values in combinations)


def _cell(requirement: Requirement, values: dict[str, Any], vehicle: str | None) -> Cell:
    scenario = scenario_of(requirement, values.get("vehicle", vehicle))
    if "height_m" in values:
        scenario = from_height(scenario, values["height_m"])
    if values.get("sensor", OWN_SENSOR) != OWN_SENSOR:
        entries = scenario.model_dump(exclude_unset=True) | {"flow_sensor": values["sensor"]}
        scenario = check(entries, Scenario, f"{requirement.name}: sensor")
    _require_judged(requirement, scenario)
    failure = _failure(requirement, scenario, values.get("fault", NO_FAULT))
    cell = Cell(scenario, values, "ensemble", fixed=tuple(fixed_by(requirement)), failure=failure)
    names = tuple(requirement.conditions.ranges)
    for share in (EDGE_MARGIN, 1.0 - EDGE_MARGIN):  # check now what cannot be flown
        cell.setup.ensemble(Ends(names, share)).truths(requirement.seed, 0, 1)
    return cell


class Ends:
    """A design that draws the named numbers at one end of what they may be, and all others in their middle."""

    def __init__(self, names: tuple[str, ...], share: float) -> None:
        self.names, self.share = names, share

    def uniforms(self, seed: int, flights: Sequence[int], name: str) -> NDArray[np.float64]:
        """One number for every flight."""
        return np.full(len(flights), self.share if name in self.names else 0.5)


def words_of(cell: Cell) -> str:
    """A cell as the certificate names it."""
    return ", ".join(_words(name, value) for name, value in cell.values.items()) or "all flights"


def _words(name: str, value: Any) -> str:
    if name == "height_m":
        return f"from {value:.15g} m"
    return "no fault" if value == NO_FAULT and name == "fault" else str(value)


def _require_judged(requirement: Requirement, scenario: Scenario) -> None:
    """InputError where a requirement is of a touchdown and the scenario has none."""
    of_landing = [
        table.measure
        for table in requirement.requirement
        if MEASURES[table.measure].of_touchdown or table.measure == NOT_LANDED
    ]
    if of_landing and not lands(scenario):
        raise InputError(f"{requirement.name}: {of_landing[0]}: the scenario {scenario.name} never lands")
    if scenario.optics != "model":
        raise InputError(
            f'{requirement.name}: the scenario {scenario.name} has optics = "pixels"; certify flies "model"'
        )


def _failure(requirement: Requirement, scenario: Scenario, name: str) -> SensorFailure | None:
    """A fault and when it strikes. InputError where it is none, or cannot be flown here."""
    where = f"{requirement.name}: conditions: fault {name}"
    if name == NO_FAULT:
        return None
    if name not in FAULTS:
        raise InputError(f"{where}: no such fault; there are {NO_FAULT}, {', '.join(FAULTS)}")
    if name in NOT_FLOWN:
        raise InputError(f"{where}: it is not flown in the closed loop; leave it out")
    if scenario.filter.name != "landing":
        raise InputError(f'{where}: the paper\'s filter has no sensors that fail; fly filter.name = "landing"')
    fault, conditions, flight = FAULTS[name], requirement.conditions, scenario.flight
    lands_s = float(flight.duration_s if flight.may_land_after_s is None else flight.may_land_after_s)
    begun_s = float(flight.takeoff_at_s if flight.start == "ground" else scenario.filter.handover_s)
    begins_s = lands_s if fault.in_descent else max(lands_s - BEFORE_LANDING_S, begun_s)
    if conditions.fault_begins_s is not None:
        begins_s = float(conditions.fault_begins_s)
    if begins_s >= flight.duration_s:
        raise InputError(f"{where}: it begins after {begins_s:g} s, and the flight ends after {flight.duration_s:g} s")
    lasts_s = float(conditions.fault_lasts_s) if fault.lasts_s is None else fault.lasts_s
    return SensorFailure(name, begins_s, begins_s + lasts_s)


# -- from another height -----------------------------------------------------------------------------------------
def from_height(scenario: Scenario, height_m: float) -> Scenario:
    """The scenario with the greatest height of its path put at height_m (of the skids).

    Every way up to that height or down from it is flown as fast as before, so that it takes longer or less long; what
    comes later, the flight's end, the instant from which it may land and events move along. InputError where the height
    is not above the path's other knots, or the scenario cannot be flown from there.
    """
    knots = scenario.flight.path
    top = max(float(knot.height_m) for knot in knots)
    others = [float(knot.height_m) for knot in knots if knot.height_m < top]
    next_m = max([0.0, *others])
    if not height_m > next_m:
        raise InputError(f"{scenario.name}: height_m {height_m:g}: must lie above the path's next height, {next_m:g} m")
    ends, delays = [], []  # of each stretched way: when it ended, and by how much later it ends now
    for here, following in pairwise(knots):
        rise, fall = here.height_m < top <= following.height_m, following.height_m < top <= here.height_m
        low = float(min(here.height_m, following.height_m))
        if rise or fall:
            ends.append(float(following.t_s))
            delays.append(float(following.t_s - here.t_s) * (height_m - top) / (top - low))
    entries: dict[str, Any] = scenario.model_dump(exclude_unset=True)

    def later(t_s: float) -> float:
        return t_s + sum(delay for end, delay in zip(ends, delays, strict=True) if end <= t_s)

    flight = entries["flight"]
    flight["path"] = [
        knot | {"t_s": later(knot["t_s"]), "height_m": height_m if knot["height_m"] == top else knot["height_m"]}
        for knot in flight["path"]
    ]
    flight["duration_s"] = float(scenario.flight.duration_s) + sum(delays)
    if scenario.flight.may_land_after_s is not None:
        flight["may_land_after_s"] = later(float(scenario.flight.may_land_after_s))
    if "event" in entries:
        entries["event"] = [event | {"at_s": later(event["at_s"])} for event in entries["event"]]
    return check(entries, Scenario, f"{scenario.name} from {height_m:g} m")
