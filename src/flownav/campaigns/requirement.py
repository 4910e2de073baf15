"""A requirement's file: what a vehicle must do, how surely, and under which conditions (docs/how-to/certify.md).

`approach`, `approach_8_m_s`, `landing`, `pad_return` and `takeoff` ship; any TOML file of this schema can be certified.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from flownav.campaigns.measures import CRASH, MEASURES, NOT_LANDED
from flownav.core.errors import InputError
from flownav.core.parameter_files import Number, ParameterModel, check, load, shipped
from flownav.core.text import exactly
from flownav.simulation.dispersion import Distribution, leaves
from flownav.simulation.scenario import SHIPPED as SHIPPED_SCENARIOS
from flownav.simulation.scenario import Scenario, load_scenario, with_vehicle
from flownav.vehicle.kinds import SHIPPED_NAMES

SHIPPED = ("takeoff", "landing", "pad_return", "approach", "approach_8_m_s")
FOLDER = "requirements"
OWN_SENSOR, NO_FAULT = "scenario", "none"
NONE_OF = {CRASH: "no crash", NOT_LANDED: "a landing"}  # a measure that is 0, in words
WIND = "wind.speed_20ft_m_s"
USUAL_SEED = 1  # what is drawn then comes of what is asked alone (`certification.cells.seed_of`)
RANGED = "the requirement's conditions"


class RequirementTable(ParameterModel):
    """One `[[requirement]]`: a share `probability` of all flights has the measure at most (or at least) this.

    allowed_failures: with how many failures the plan may still pass; more of them need more flights.
    """

    measure: str  # its name, such as touchdown.horizontal_m or crash
    at_most: Number | None = None  # largest figure that passes; this, or at_least
    at_least: Number | None = None  # smallest figure that passes; this, or at_most
    probability: Number = Field(gt=0.0, lt=1.0)  # share of all flights that has to pass
    confidence: Number = Field(0.90, ge=0.5, lt=1.0)  # with which the flights must show it
    allowed_failures: int = Field(2, ge=0, le=10_000)

    @field_validator("measure")
    @classmethod
    def _is_known(cls, name: str) -> str:
        if name not in MEASURES:
            raise ValueError(f"no such measure; known: {', '.join(MEASURES)}")
        return name

    @model_validator(mode="after")
    def _has_one_limit(self) -> RequirementTable:
        if (self.at_most is None) == (self.at_least is None):
            raise ValueError("give one of at_most and at_least")
        if self.at_most is not None and self.at_most < 0.0:
            raise ValueError(f"at_most {self.at_most:g}: no flight has a {self.measure} below 0")
        return self

    @property
    def limit(self) -> float:
        """The limit, on whichever side."""
        return float(self.at_least if self.at_most is None else self.at_most)  # type: ignore[arg-type]  # one is there

    @property
    def upper(self) -> bool:
        """Whether small figures are the good ones."""
        return self.at_most is not None

    @property
    def yes_or_no(self) -> bool:
        """Whether the measure says only whether something happened."""
        return self.measure in NONE_OF

    def sentence(self) -> str:
        """The requirement in the words of a test plan."""
        unit = MEASURES[self.measure].unit
        side = "at most" if self.upper else "at least"
        what = f"{self.measure} {side} {exactly(self.limit)} {unit}".rstrip()
        if self.yes_or_no and self.upper and self.limit == 0.0:
            what = NONE_OF[self.measure]
        share, sure = exactly(self.probability, 100), exactly(self.confidence, 100)
        return f"{what} with {share} % probability at {sure} % confidence"


class Conditions(ParameterModel):
    """`[conditions]`: under what the statement holds.

    ranges: numbers that a dispersion may name, evenly between two ends or of a distribution; they stand above the
    scenario's own entries. The others make cells, each combination of them one, which get as many flights each:
    height_m of the start (two ends: low, middle and high), sensor (flow sensor files), vehicle, fault (by the names of
    `flownav faults`). A fault begins fault_begins_s after the start and lasts fault_lasts_s.
    """

    ranges: dict[str, Distribution] = Field(default_factory=dict)
    height_m: tuple[Number, ...] = Field((), max_length=2)  # the path's greatest; of [low, high] ends and middle
    sensor: tuple[str, ...] = ()  # flow sensor files; "scenario": its own
    vehicle: tuple[str, ...] = ()  # shipped names, or files beside this one
    fault: tuple[str, ...] = ()  # names of `flownav faults`; "none": no fault
    fault_begins_s: Number | None = Field(None, ge=0.0, le=3600.0)  # none: about when it may land
    fault_lasts_s: Number = Field(20.0, gt=0.0, le=3600.0)  # of a fault that has no length of its own

    @model_validator(mode="before")
    @classmethod
    def _flattened(cls, given: Any) -> Any:
        if not isinstance(given, Mapping):
            return given
        own = {name: given[name] for name in cls.model_fields if name != "ranges" and name in given}
        if isinstance(own.get("height_m"), (int, float)):
            own["height_m"] = [own["height_m"]]
        rest = {name: value for name, value in given.items() if name not in own}
        return own | {"ranges": {name: _distribution(name, value) for name, value in leaves(rest, "")}}

    @field_validator("sensor", "vehicle", "fault")
    @classmethod
    def _are_different(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(names)) < len(names):
            raise ValueError("the same twice")
        return names

    @field_validator("ranges")
    @classmethod
    def _blow(cls, ranges: dict[str, Distribution]) -> dict[str, Distribution]:
        wind = ranges.get(WIND)
        if wind is not None and wind.frozen().support()[0] < 0.0:
            raise ValueError(f"{WIND}: a wind's speed begins at 0; where it comes from is wind.from_direction_deg")
        return ranges

    @field_validator("height_m")
    @classmethod
    def _rise(cls, ends: tuple[float, ...]) -> tuple[float, ...]:
        if len(ends) == 2 and not ends[0] < ends[1]:
            raise ValueError("a range is [low, high], low below high")
        return ends

    def heights_m(self) -> tuple[float, ...]:
        """The heights that are flown: of a range both ends and the middle."""
        ends = tuple(float(end) for end in self.height_m)
        return ends if len(ends) < 2 else (ends[0], 0.5 * (ends[0] + ends[1]), ends[1])


class Requirement(ParameterModel):
    """A requirement's file. set: entries that stand above the scenario's own."""

    schema_version: Literal[1]  # of this kind of file; 1
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")  # of the certificate: letters, digits, . _ and -
    description: str = ""  # one sentence, shown in the certificate
    scenario: str  # a shipped scenario's name, or a file beside this one
    vehicle: str | None = None  # a shipped name, or a file beside this one; none: the scenario's
    seed: int = Field(USUAL_SEED, ge=0, lt=2**63)  # of all random draws; another than 1 is reported as chosen
    set: dict[str, Any] = Field(default_factory=dict)
    conditions: Conditions = Field(default_factory=Conditions)
    requirement: tuple[RequirementTable, ...] = Field(min_length=1, max_length=20)

    def flights(self) -> int:
        """How many flights show every requirement with as many failures as each allows. InputError beyond 10^9."""
        return max(needed_by(table) for table in self.requirement)


def needed_by(table: RequirementTable, failures: int | None = None) -> int:
    """The number of flights a requirement needs with this number of failures (else with those that it allows).
    InputError.
    """
    from flownav.campaigns.tolerance import needed

    try:
        most = table.allowed_failures if failures is None else failures
        return needed(table.probability, table.confidence, most)
    except ValueError as error:
        raise InputError(f"{table.measure}: {error}; ask for less, or use `flownav campaign --rare`") from None


def requirement_file(name: str) -> Path:
    """The file of a shipped requirement, or the path itself. InputError where the name is neither."""
    if name in SHIPPED:
        return shipped(f"{FOLDER}/{name}.toml")
    path = Path(name)
    if not path.suffix and not path.exists():
        raise InputError(f"{name}: no such requirement; shipped: {', '.join(SHIPPED)}, or give a TOML file")
    return path


def load_requirement(name: str) -> Requirement:
    """A shipped requirement by name, or a file; files that it names lie beside it. InputError where it is wrong."""
    path = requirement_file(name)
    requirement = load(path, Requirement)

    def beside(file: str, known: Collection[str]) -> str:
        return file if file in known else str(path.parent / file)

    conditions = requirement.conditions
    return requirement.model_copy(
        update={
            "scenario": beside(requirement.scenario, SHIPPED_SCENARIOS),
            "vehicle": None if requirement.vehicle is None else beside(requirement.vehicle, SHIPPED_NAMES),
            "set": _sensors_beside(requirement.set, path.parent),
            "conditions": conditions.model_copy(
                update={
                    "vehicle": tuple(beside(name, SHIPPED_NAMES) for name in conditions.vehicle),
                    "sensor": tuple(beside(name, (OWN_SENSOR,)) for name in conditions.sensor),
                }
            ),
        }
    )


def fixed_by(requirement: Requirement) -> dict[str, Any]:
    """The values that a requirement fixes, by dotted name: all of its `set` that has no range."""
    return {name: value for name, value in leaves(requirement.set, "") if name not in requirement.conditions.ranges}


def _sensors_beside(given: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The settings with the datasheets that they name looked for beside the requirement's file."""
    found = dict(given)
    if isinstance(given.get("sensors"), dict):
        found["sensors"] = {
            name: str(folder / value) if name != "texture" and isinstance(value, str) else value
            for name, value in given["sensors"].items()
        }
    if isinstance(given.get("flow_sensor"), str):
        found["flow_sensor"] = str(folder / given["flow_sensor"])
    return found


def scenario_of(requirement: Requirement, vehicle: str | None = None) -> Scenario:
    """The scenario with what the requirement sets, and its ranges as dispersion. InputError where it cannot be.

    vehicle: another one than the requirement's (a shipped name, or a file).
    """
    scenario = with_vehicle(load_scenario(requirement.scenario), vehicle or requirement.vehicle)
    entries = _over(scenario.model_dump(exclude_unset=True), requirement.set)
    scenario = check(entries, Scenario, f"{requirement.name}: set") if requirement.set else scenario
    if not requirement.conditions.ranges:
        return scenario
    dispersed = scenario.dispersion.entries()
    ranges = {
        name: one if "known" in one.model_fields_set else one.model_copy(
            update={"known": dispersed[name].known if name in dispersed else "day"}
        )
        for name, one in requirement.conditions.ranges.items()
    }  # fmt: skip
    section = scenario.dispersion.model_copy(update={"parameters": {**scenario.dispersion.parameters, **ranges}})
    return scenario.model_copy(update={"dispersion": section})


def _over(entries: dict[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Nested tables with others laid over them."""
    found = dict(entries)
    for key, value in given.items():
        inner = found.get(key)
        found[key] = _over(inner, value) if isinstance(inner, dict) and isinstance(value, Mapping) else value
    return found


def _distribution(name: str, value: Any) -> Any:
    """An entry of the conditions as one of a dispersion: [low, high] is even between them."""
    if isinstance(value, Mapping):
        return dict(value)
    numbers = isinstance(value, list) and all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in value)
    if not numbers or len(value) != 2 or not value[0] < value[1]:
        raise ValueError(f"{name}: a range is [low, high], low below high; what is fixed stands in [set]")
    return {"distribution": "uniform", "loc": value[0], "scale": value[1] - value[0], "source": RANGED}
