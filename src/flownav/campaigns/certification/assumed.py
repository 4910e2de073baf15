"""What a certificate rests on: the truth model, what the vehicle knows, its datasheets, and what is not modelled."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from flownav.campaigns.certification.cells import words_of as words_of_cell
from flownav.campaigns.local import known_exactly
from flownav.campaigns.plan import Cell, Plan
from flownav.campaigns.requirement import requirement_file
from flownav.core.parameter_files import shipped
from flownav.core.provenance import hash_of
from flownav.sensors.datasheet import DEFAULT_SENSOR
from flownav.simulation.carried import carried_sensors
from flownav.simulation.dispersion import SHIPPED as SHIPPED_DISPERSION
from flownav.simulation.dispersion import SHIPPED_FILE, Distribution
from flownav.simulation.scenario import SHIPPED as SHIPPED_SCENARIOS
from flownav.simulation.scenario import Scenario
from flownav.vehicle.kinds import vehicle_file
from flownav.vehicle.parameters import MultirotorParameters

# each is said at greater length in the docs named
NOT_MODELLED = (
    "Failures of servos, engine, battery, computer or software; sensors fail only where the conditions name a fault.",
    "Jamming and spoofing of GPS; multipath is a noise of stated size, not a place's own "
    "(docs/explanation/sensors.md).",
    "Gust fronts, and the wake of buildings and trees; the wind is a mean, turbulence and a profile over height "
    "(docs/reference/scenarios.md).",
    "Temperature, rectified vibration and clipped samples in the IMU; wind on the static port "
    "(docs/explanation/sensors.md).",
    "Blades in the pad camera's frame, dirt on its lens, water, a pad that is bent or moves "
    "(docs/explanation/pad-target.md).",
    "Obstacles, people, and what a pilot or a ground station would do.",
    "Dispersed numbers that go together: each is drawn independently of the others (docs/reference/scenarios.md).",
)
OF_A_HELICOPTER = (
    "Vortex ring, bending of blades and airframe, the tail rotor's torque about the pitch axis "
    "(docs/explanation/vehicle.md).",
)
OF_THE_PAPERS_FILTER = "its attitude and the ground's height, and where it starts if its GPS noise is white"
OF_A_MULTIROTOR = ("Vortex ring, bending of arms and propellers (docs/explanation/multirotor.md).",)


def assumed(plan: Plan) -> dict[str, Any]:
    """Everything that was assumed: of all cells, and of each vehicle with its sensors."""
    cell = plan.cells[0]
    known = {known_exactly(each.scenario) if each.setup.fitted else OF_THE_PAPERS_FILTER for each in plan.cells}
    kinds = [isinstance(each.setup.flight.vehicle, MultirotorParameters) for each in plan.cells]
    own = (OF_A_HELICOPTER if not all(kinds) else ()) + (OF_A_MULTIROTOR if any(kinds) else ())
    found: dict[tuple[str | None, str | None], int] = {}
    for number, each in enumerate(plan.cells):
        found.setdefault((each.scenario.vehicle.file, each.scenario.flow_sensor), number)
    variants = [_variant(plan, number) for number in found.values()]
    return {
        "truth": cell.scenario.truth,
        "vehicle": ", ".join(dict.fromkeys(variant["vehicle"] for variant in variants)),
        "filter": cell.scenario.filter.name,
        "known_exactly": "; or ".join(sorted(known)),
        "failure": {words_of_cell(each): each.failure.words for each in plan.cells if each.failure},
        "variants": variants,
        "not_modelled": [*NOT_MODELLED, *own],
    }


def _variant(plan: Plan, number: int) -> dict[str, Any]:
    """What is dispersed and what is told of the vehicle and the sensors of a cell."""
    cell, ensemble = plan.cells[number], plan.ready(number).ensemble
    assert ensemble is not None  # a certificate's cells are dispersed
    parameters = cell.setup.parameters
    return {
        "vehicle": cell.setup.described.name,
        "cell": words_of_cell(cell),
        "dispersed": [
            {
                "input": name,
                "distribution": words_of(entry),
                "believed": ensemble.believed_of(name),
                "known": entry.known,
                "source": entry.source or _uncertainty(cell, name),
            }
            for name, entry in ensemble.entries.items()
        ],
        "told": {name: value for name, value in parameters.items() if name != "vehicle"},
        "vehicle_numbers": parameters["vehicle"],
    }


def words_of(entry: Distribution) -> str:
    """A distribution as its file has it: name, parameters, what is done with the draw."""
    numbers = entry.shapes | {"loc": entry.loc, "scale": entry.scale}
    plain = {"loc": 0.0, "scale": 1.0}
    said = ", ".join(f"{name} {value:g}" for name, value in numbers.items() if plain.get(name) != value)
    if entry.mode == "uncertainty" and entry.distribution == "truncnorm":
        low, high = (entry.shapes[name] * entry.scale for name in ("a", "b"))
        if (low, high) == (-1.0, 1.0) and entry.loc == 0.0:
            return f"normal, cut off at the stated uncertainty, {entry.shapes['b']:g} sigma"
    if entry.distribution == "uniform":
        said = f"{entry.loc:g} to {entry.loc + entry.scale:g}"
    of = {"value": "", "factor": " times what is believed", "offset": " more than is believed",
          "uncertainty": " of the stated uncertainty"}  # fmt: skip
    return f"{entry.distribution} {said}{of[entry.mode]}"


def _uncertainty(cell: Cell, name: str) -> str:
    """What the vehicle's file says of a number."""
    stated = {f"vehicle.{entry.key}": entry for entry in cell.setup.described.entries}.get(name)
    if stated is None:
        return ""
    return f"uncertainty {stated.uncertainty} in the vehicle's file" + (f": {stated.source}" if stated.source else "")


def files_in(requirement: str, scenario: str, plan: Plan) -> list[Path]:
    """Every file that the flights are made from, each once: the requirement's, and those of all cells."""
    found = [requirement_file(requirement)]
    found.append(shipped(f"{scenario}.toml") if scenario in SHIPPED_SCENARIOS else Path(scenario))
    for cell in plan.cells:
        found += _files_of(cell.scenario)
    return list(dict.fromkeys(found))


def _files_of(scenario: Scenario) -> Iterable[Path]:
    """The files that a scenario is assembled from."""
    file = scenario.vehicle.file
    yield vehicle_file(Path(file) if file else None)
    yield Path(scenario.flow_sensor) if scenario.flow_sensor else shipped(DEFAULT_SENSOR)
    dispersion = scenario.dispersion.file
    yield shipped(SHIPPED_FILE) if dispersion == SHIPPED_DISPERSION else Path(dispersion)
    if scenario.filter.name == "landing":
        for sensor in sorted(carried_sensors(), key=lambda one: one.channels.reading):
            own = getattr(scenario.sensors, sensor.name)
            if sensor.name == "pad_camera" and scenario.pad_fix is None:
                continue
            if own or sensor.sheet.shipped_file:
                yield Path(own) if own else shipped(f"sensors/{sensor.sheet.shipped_file}")


def hashes(files: Sequence[Path], beside: Path | None = None) -> dict[str, str]:
    """SHA-256 of files by name: of those in the folder `beside` relative to it, of shipped ones within the package."""
    data = shipped("")
    named = {}
    for file in files:
        if beside is not None and file.is_relative_to(beside):
            name = file.relative_to(beside).as_posix()
        else:
            name = f"flownav/data/{file.relative_to(data).as_posix()}" if file.is_relative_to(data) else str(file)
        named[name] = hash_of(file)
    return named
