"""A certificate written down: records of the worst flights, what was assumed, hashes of every file, JSON and page."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flownav.campaigns.certification.cells import words_of as words_of_cell
from flownav.campaigns.certification.certify import FOLDER as RANKING
from flownav.campaigns.certification.certify import Certificate
from flownav.campaigns.certification.envelope import failures_in
from flownav.campaigns.local import known_exactly
from flownav.campaigns.measures import MEASURES, NOT_LANDED, ROW_COLUMNS, measured
from flownav.campaigns.plan import Cell, Plan
from flownav.campaigns.requirement import requirement_file
from flownav.campaigns.run import record_again, record_path
from flownav.campaigns.store import PLAN, RECORDS, Dataset, Store
from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.core.parameter_files import shipped
from flownav.core.provenance import code_sha256, command_line, hash_of, provenance
from flownav.report.campaign import render_certificate
from flownav.report.html import write_report
from flownav.sensors.datasheet import DEFAULT_SENSOR
from flownav.simulation.dispersion import SHIPPED as SHIPPED_DISPERSION
from flownav.simulation.dispersion import SHIPPED_FILE, Distribution
from flownav.simulation.scenario import SHIPPED as SHIPPED_SCENARIOS
from flownav.simulation.scenario import Scenario
from flownav.simulation.sensor_table import sensor_rows
from flownav.vehicle.kinds import vehicle_file
from flownav.vehicle.parameters import MultirotorParameters

PAGE, FACTS = "certificate.html", "certificate.json"
SCHEMA = 1  # `flownav schema certificate` prints what it holds


def write_certificate(
    certificate: Certificate, store: Store, name: str, records: int,
    on_recorded: Callable[[int], object] = lambda done: None,
) -> dict[str, Any]:  # fmt: skip
    """Write the records and reports of the `records` worst flights, certificate.json and certificate.html; returns the
    facts.

    name: the requirement's, as it was given. OSError where a file cannot be written.
    """
    facts = certificate.as_json()
    for flight, row in zip(certificate.worst[:records], facts["worst"], strict=False):
        row["record"], row["report"] = _recorded(certificate, flight, store.folder, name)
        on_recorded(1)
    facts |= {"assumed": assumed(certificate.plan), "made_by": made_by(), "files": _files(certificate, store, name)}
    page = render_certificate(facts, drawn(certificate))
    store.keep_text(PAGE, page)
    facts["files"]["page"] = {PAGE: hash_of(store.folder / PAGE)}
    store.keep_text(FACTS, written({"schema": SCHEMA} | facts))
    return facts | {"out": str(store.folder / PAGE)}


def written(facts: Mapping[str, Any]) -> str:
    """The text of certificate.json."""
    return json.dumps(facts, indent=1) + "\n"


def drawn(certificate: Certificate) -> dict[str, Any]:
    """Data of the page's figures for each flight: values of the measures, places of the touchdowns [m]."""
    rows, requirement = certificate.flown.rows, certificate.requirement
    measures = [table.measure for table in requirement.requirement]
    of = "rest" if "touchdown.rest_m" in measures else "contact"
    of_touchdown = any(MEASURES[name].of_touchdown or name == NOT_LANDED for name in measures)
    good = np.isfinite(measured("touchdown.rest_m" if of == "rest" else "touchdown.horizontal_m", rows))
    north_m, east_m = (
        np.where(good, rows[:, ROW_COLUMNS.index(f"touchdown.{of}.{axis}_m")], np.inf) for axis in ("north", "east")
    )
    return {
        "figures": {table.measure: measured(table.measure, rows) for table in requirement.requirement},
        "failed": failures_in(requirement, rows).any(axis=0),
        "of": of,
        "north_m": north_m,
        "east_m": east_m,
        "places": of_touchdown and bool(np.isfinite(north_m).any()),
    }


def _recorded(certificate: Certificate, flight: int, folder: Path, name: str) -> tuple[str, str]:
    """Record and report of one flight; where they lie, relative to the page."""
    cell, number = int(certificate.flown.cell[flight]), int(certificate.flown.number[flight])
    path = record_path(folder / RECORDS, cell, number)
    page = path.with_suffix(".html")
    record = record_again(certificate.plan, cell, number)
    record.manifest["command"] = f"flownav certify {name}"
    record.save(path)
    write_report(record, page)
    return path.relative_to(folder).as_posix(), page.relative_to(folder).as_posix()


def _files(certificate: Certificate, store: Store, name: str) -> dict[str, dict[str, str]]:
    """SHA-256 of everything that went in and came out, but for the page and the facts."""
    went_in = files_in(name, certificate.requirement.scenario, certificate.plan)
    return {"in": hashes(went_in), "out": hashes(files_out(certificate.plan, store.folder), store.folder)}


def files_out(plan: Plan, folder: Path) -> list[Path]:
    """The files of a certificate's folder that have hashes, but for the page."""
    parts = [path for cell in range(len(plan.cells)) for path in Dataset(folder).parts(cell)]
    ranking = sorted((folder / RANKING).glob("*/*.parquet"))
    return [folder / PLAN, *parts, *ranking, *sorted((folder / RECORDS).glob("*"))]


def made_by() -> dict[str, Any]:
    """The command, the versions and the code."""
    made = provenance()
    return {
        "command": command_line(),
        "flownav": made["flownav"],
        "code_sha256": code_sha256(),
        "python": made["python"],
        **made["libraries"],
        "written_utc": made["written_utc"],
    }


# -- limits of the certificate --------------------------------------------------------------------------------------
# each is explained in the docs named
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
    """The dispersions of a cell, and the data of its vehicle and sensors that the navigator is given."""
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
    numbers_words = ", ".join(f"{name} {value:.15g}" for name, value in numbers.items() if plain.get(name) != value)
    if entry.mode == "uncertainty" and entry.distribution == "truncnorm":
        low, high = (entry.shapes[name] * entry.scale for name in ("a", "b"))
        if (low, high) == (-1.0, 1.0) and entry.loc == 0.0:
            return f"normal, cut off at the stated uncertainty, {entry.shapes['b']:g} sigma"
    if entry.distribution == "uniform":
        numbers_words = f"{entry.loc:.15g} to {entry.loc + entry.scale:.15g}"
    of = {"value": "", "factor": " times what is believed", "offset": " more than is believed",
          "uncertainty": " of the stated uncertainty"}  # fmt: skip
    return f"{entry.distribution} {numbers_words}{of[entry.mode]}"


def _uncertainty(cell: Cell, name: str) -> str:
    """The uncertainty and source that the vehicle's file states for a number."""
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
        for sensor in sorted(sensor_rows(), key=lambda one: one.channels.reading):
            own = getattr(scenario.sensors, sensor.name)
            if sensor.name == "pad_camera" and scenario.pad_fix is None:
                continue
            if own or sensor.sheet.shipped_file:
                yield Path(own) if own else shipped(f"sensors/{sensor.sheet.shipped_file}")


def hashes_again(expected: Mapping[str, str], folder: Path | None) -> str | None:
    """The first file whose SHA-256 differs or that is missing, and why; None where all agree. folder: in which they
    lie.
    """
    for name, digest in expected.items():
        path = Path(name) if folder is None else folder / name
        if folder is not None and (Path(name).is_absolute() or ".." in Path(name).parts):
            return f"{name}: lies elsewhere"
        try:
            if folder is not None and not path.resolve().is_relative_to(folder.resolve()):
                return f"{name}: is a link to elsewhere"
            found = hash_of(an_input(path))
        except InputError as error:
            return str(error)
        except OSError as error:
            return f"{name}: cannot be read ({error.strerror})"
        if found != digest:
            return f"{name}: has another SHA-256 than the certificate says"
    return None


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


def place_of(name: str) -> Path:
    """Where a file lies that went in, by its name in the certificate."""
    own = "flownav/data/"
    return shipped(name.removeprefix(own)) if name.startswith(own) else Path(name)
