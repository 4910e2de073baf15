"""An ensemble: flights each with a truth of its own, drawn from the scenario's dispersion, which the filter does not
know.

The navigator's settings, its timetable and the autopilot's gains stay those of the datasheets. A truth is a function of
(seed, flight) alone, so that a flight is the same by itself, in any batch and on any lane.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.core.parameter_files import ParameterModel, check
from flownav.sensors.datasheet import FlowSensor
from flownav.sensors.sheets import SensorSheets
from flownav.simulation.dispersion import Design, Distribution, drawn, uniforms
from flownav.simulation.fitting import onboard_of
from flownav.simulation.ground import RecirculationParameters, RecirculationSettings
from flownav.simulation.onboard import Onboard
from flownav.simulation.plan import Flight
from flownav.simulation.scenario import Scenario
from flownav.simulation.truth import LATE, NAMES, PARTS, PUNCTUAL, SIZES, SOUND, Carried, Truth
from flownav.vehicle.kinds import AnyFile, AnyVehicle, VehicleDescription, as_the_paper_has_it, disc_of, flattened
from flownav.vehicle.schema import MultirotorFile, VehicleFile

WORLD = ("vehicle", "wind", "ground", "recirculation")
SHEETS = (*NAMES, "flow_sensor", "magnetic_field")
# these are the timetable's, the scenario's or the judge's, one for all flights
SHARED = (
    "rate_hz",
    "jitter_s",
    "exposure_s",
    "lens",
    "optics",
    "touchdown",
    "gravity_m_s2",
    "cg_above_skid_m",
    "rotor_count",
)

# tables that one kind of vehicle has and another has not
OF_A_KIND = set(VehicleFile.model_fields) ^ set(MultirotorFile.model_fields)

LOT_FLIGHTS = 64  # flights whose numbers are drawn together


def believed(flight: Flight) -> Truth:
    """The truth of a flight by its datasheets; the sensors that it has not are zeros."""
    onboard = flight.onboard
    if onboard is None:
        none = {part: PARTS[part](*([0.0] * SIZES[part])) for part in (*NAMES, "camera_flow")}
        sensors = {"camera_flow": none.pop("camera_flow"), "carried": Carried(**none)}
    else:
        sensors = sensed_by(onboard)
    return Truth(
        vehicle=flight.vehicle, wind=flight.wind, ground=flight.ground, recirculation=flight.recirculation,
        flow=flight.sensors.flow, late=PUNCTUAL, fault=SOUND, **sensors,
    )  # fmt: skip


def sensed_by(onboard: Onboard) -> dict[str, Any]:
    """The parts of a truth that are of the sensors that feed the navigator."""
    return {"camera_flow": onboard.flow, "carried": Carried(*(one.p for one in onboard.carried))}


def flown(scenario: Scenario, file: AnyFile) -> AnyVehicle:
    """The vehicle of a checked file as this scenario flies it: the paper's filter flies the paper's helicopter."""
    vehicle = flattened(file)
    return as_the_paper_has_it(vehicle) if scenario.filter.name == "paper" else vehicle


def recirculation_of(
    scenario: Scenario, settings: RecirculationSettings, vehicle: AnyVehicle
) -> RecirculationParameters:
    """A rotor's own wake near the ground; the paper's model has none."""
    disc = disc_of(vehicle)
    if scenario.filter.name == "paper":
        settings = RecirculationSettings(loss=0.0, unsteady=0.0)
    return settings.parameters(disc.diameter_m, disc.above_cg_m, vehicle.air_density_kg_m3, disc.induced_m_s)


class Ensemble:
    """Dispersed numbers of one scenario, ready to be drawn for each flight. InputError where an entry cannot be.

    file and described: the vehicle's, as it is believed to be; sheets: its sensors', None where the paper's filter
    flies, of whose sensors only the flow sensor's file is dispersed; dispersion: entries by dotted name. design:
    spreads them over the flights; None: the noise counter.
    """

    def __init__(
        self, scenario: Scenario, flight: Flight, file: AnyFile, described: VehicleDescription, sensor: FlowSensor,
        sheets: SensorSheets | None, dispersion: Mapping[str, Distribution], design: Design | None = None,
    ) -> None:  # fmt: skip
        self.design = design
        self.scenario, self.flight, self.sheets = scenario, flight, sheets
        self.models: dict[str, Any] = {
            "vehicle": file, "wind": scenario.wind, "ground": scenario.ground, "flow_sensor": sensor,
            "recirculation": scenario.recirculation,
        }  # fmt: skip
        if sheets is not None:
            fitted = {name: getattr(sheets, name) for name in SHEETS if name != "flow_sensor"}
            self.models |= {name: sheet for name, sheet in fitted.items() if sheet is not None}
        self.contents = {name: model.model_dump() for name, model in self.models.items()}
        self.base = believed(flight)
        self.reach = {f"vehicle.{entry.key}": entry.uncertainty for entry in described.entries}
        self.entries = {name: one for name, one in dispersion.items() if self._is_fitted(name)}
        self.frozen = {name: self._checked(name, one) for name, one in self.entries.items()}
        for name in filter(self._is_fitted, scenario.dispersion.fixed):
            self.believed_of(name)  # a misspelt name would leave its number drawn
        self._chunk = lru_cache(maxsize=16)(self._drawn)

    def truths(self, seed: int, first: int, count: int) -> list[Truth]:
        """The truths of flights `first` to `first + count - 1`. InputError where a draw is not possible."""
        return self.truths_of(self.values(seed, first, count), range(first, first + count))

    def truths_of(self, values: Mapping[str, Sequence[float]], flights: Sequence[int]) -> list[Truth]:
        """The truths that these dispersed numbers make, one of each flight; InputError as `truths`."""
        return [
            self._truth(flight, {name: column[k] for name, column in values.items()})
            for k, flight in enumerate(flights)
        ]

    def values(self, seed: int, first: int, count: int) -> dict[str, list[float]]:
        """The dispersed numbers of the same flights, by dotted name, in the units of their names."""
        numbers = range(first // LOT_FLIGHTS, (first + count - 1) // LOT_FLIGHTS + 1)
        chunks = [self._chunk(seed, number) for number in numbers]
        skipped = first - numbers[0] * LOT_FLIGHTS
        return {
            name: np.concatenate([chunk[name] for chunk in chunks])[skipped : skipped + count].tolist()
            for name in self.entries
        }

    def _drawn(self, seed: int, number: int) -> dict[str, Array]:
        """The numbers of LOT_FLIGHTS flights, the `number`-th such lot: SciPy takes as long for one as for all of them.

        A flight stands at the same place of the same lot in every call, and so has the same bits.
        """
        flights = range(number * LOT_FLIGHTS, (number + 1) * LOT_FLIGHTS)
        spread = uniforms if self.design is None else self.design.uniforms
        return self.values_of({name: spread(seed, flights, name) for name in self.entries})

    def values_of(self, shares: Mapping[str, Array]) -> dict[str, Array]:
        """The dispersed numbers that have these shares of their distributions below them, by dotted name."""
        return {name: self.numbers(name, shares[name]) for name in self.entries}

    def numbers(self, name: str, shares: Array) -> Array:
        """A dispersed number at these shares of its distribution, in (0, 1), in the unit of its name."""
        entry, believed_value = self.entries[name], self.believed_of(name)
        below, above = self._reach(name, believed_value) if entry.mode == "uncertainty" else (0.0, 0.0)
        draws = self.frozen[name].ppf(shares)
        return np.array([drawn(entry.mode, float(draw), believed_value, below, above) for draw in draws])

    def _truth(self, flight: int, values: Mapping[str, float]) -> Truth:
        """One flight's truth: parts that the drawn numbers touch are built anew, the rest is as believed."""
        touched: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            source, _, key = name.partition(".")
            touched.setdefault(source, {})[key] = value
        models: dict[str, Any] = dict(self.models)
        for source, numbers in touched.items():
            where = f"{self.scenario.name}: dispersion, flight {flight}: {source}"
            models[source] = with_numbers(self.models[source], numbers, where)
        found: dict[str, Any] = {}
        vehicle: Any = self.flight.vehicle
        if "vehicle" in touched:
            vehicle = found["vehicle"] = flown(self.scenario, models["vehicle"])
        if "wind" in touched:
            found["wind"] = models["wind"].parameters(disc_of(vehicle).span_m)
        if "ground" in touched:
            found["ground"] = models["ground"].parameters()
        if "vehicle" in touched or "recirculation" in touched:
            found["recirculation"] = recirculation_of(self.scenario, models["recirculation"], vehicle)
        if "flow_sensor" in touched:
            found["flow"] = self.scenario.flow.parameters(models["flow_sensor"])
        if self.sheets is not None:
            sheets = self.sheets.model_copy(update={name: models[name] for name in touched if name in SHEETS})
            onboard = onboard_of(self.scenario, sheets, found.get("flow", self.flight.sensors.flow), vehicle)
            found |= sensed_by(onboard)
            found["late"] = self._lateness(touched)
        return self.base._replace(**found)

    def _lateness(self, touched: Mapping[str, Mapping[str, float]]) -> Any:
        """How much older than stated each sensor's readings are."""
        late = {
            sheet: touched[sheet]["latency_s"] - float(self.contents[sheet]["latency_s"])
            for sheet in LATE
            if "latency_s" in touched.get(sheet, {})
        }
        return PUNCTUAL._replace(**late)

    def _is_fitted(self, name: str) -> bool:
        """Whether the vehicle has the part of an entry; a part of another kind, or a known sensor, is passed over."""
        source = name.partition(".")[0]
        if source == "vehicle" and name.split(".")[1] in OF_A_KIND - set(self.contents["vehicle"]):
            return False
        if source in self.models:
            return True
        if source in SHEETS:
            return False
        known = ", ".join((*WORLD, *SHEETS))
        raise self._wrong(name, f"no such source; known: {known}")

    def _checked(self, name: str, entry: Distribution) -> Any:
        """SciPy's distribution of an entry that names a number which may differ."""
        source, _, key = name.partition(".")
        parts = key.split(".")
        if any(part in SHARED for part in parts) or (key == "latency_s" and source not in LATE):
            raise self._wrong(name, "is the same for all flights of a scenario")
        believed_value = self.believed_of(name)
        if entry.mode == "uncertainty":
            self._reach(name, believed_value)
        try:
            return entry.frozen()
        except ValueError as error:
            raise self._wrong(name, str(error)) from None

    def believed_of(self, name: str) -> float:
        """The datasheet's value of a number. InputError where there is none."""
        source, _, key = name.partition(".")
        inside: Any = self.contents[source]
        for part in key.split("."):
            if not isinstance(inside, dict) or part not in inside:
                known = ", ".join(inside) if isinstance(inside, dict) else "nothing"
                raise self._wrong(name, f"no such number; known there: {known}")
            inside = inside[part]
        if isinstance(inside, bool) or not isinstance(inside, (int, float)):
            raise self._wrong(name, "is no number of the datasheet")
        return float(inside)

    def _reach(self, name: str, believed_value: float) -> tuple[float, float]:
        """How far below and above its value the uncertainty that the vehicle's file states reaches."""
        stated = self.reach.get(name, "")
        if not stated:
            raise self._wrong(name, 'mode = "uncertainty": the vehicle\'s file states none there')
        low, between, high = stated.partition("..")
        try:
            return (
                (believed_value - float(low), float(high) - believed_value)
                if between
                else (float(stated), float(stated))
            )
        except ValueError:
            raise self._wrong(name, f'its uncertainty "{stated}" is neither a number nor low..high') from None

    def _wrong(self, name: str, what: str) -> InputError:
        return InputError(f"{self.scenario.name}: dispersion.{name}: {what}")


def with_numbers(model: ParameterModel, numbers: Mapping[str, float], where: str) -> Any:
    """A datasheet with other numbers at dotted keys; only the tables that they stand in are checked anew."""
    own = {key: value for key, value in numbers.items() if "." not in key}
    inner: dict[str, dict[str, float]] = {}
    for key, value in numbers.items():
        table, dot, rest = key.partition(".")
        if dot:
            inner.setdefault(table, {})[rest] = value
    tables = {table: with_numbers(getattr(model, table), given, f"{where}.{table}") for table, given in inner.items()}
    changed = model.model_copy(update=tables)
    return check(dict(changed) | own, type(model), where) if own else changed
