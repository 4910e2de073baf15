"""The two kinds of vehicle, and the functions of either: its file, its parameters, its trim, its rotor.

A file is checked, made flat, and refused where no such vehicle could hover.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from flownav.core.errors import InputError
from flownav.core.parameter_files import as_shown, check, read_toml, shipped
from flownav.core.text import meant
from flownav.vehicle.feasibility import hover_induced_velocity, require_feasible, require_multirotor
from flownav.vehicle.parameters import (
    MultirotorParameters,
    VehicleParameters,
    flatten,
    flatten_multirotor,
    hover_speed,
    without_slop,
)
from flownav.vehicle.schema import KIND, MultirotorFile, VehicleFile
from flownav.vehicle.state import HelicopterState, MultirotorState
from flownav.vehicle.trim import MultirotorTrim, Trim, is_hexa, trim, trim_multirotor

AnyFile = VehicleFile | MultirotorFile
AnyVehicle = VehicleParameters | MultirotorParameters
AnyTrim = Trim | MultirotorTrim
AnyState = HelicopterState | MultirotorState


class RotorFacts(NamedTuple):
    """Facts of the rotors that sensors feel: speed in hover [rad/s], radius, height above the centre of gravity [m]."""

    speed_rad_s: float
    radius_m: float
    above_cg_m: float


class Disc(NamedTuple):
    """The vehicle's width [m], the disc that its rotors have together: diameter [m], height over the centre of gravity
    [m], induced velocity in hover [m/s].
    """

    span_m: float
    diameter_m: float
    above_cg_m: float
    induced_m_s: float


def schema_of(contents: dict[str, Any], where: str) -> type[VehicleFile] | type[MultirotorFile]:
    """The schema of a file's contents: a helicopter's where it has no `kind`. InputError where it is unknown."""
    kind = contents.get("kind")
    if kind is None:
        return VehicleFile
    if kind != KIND:
        raise InputError(f'{where}: kind = {as_shown(kind)}: known is "{KIND}"; a helicopter\'s file says none')
    return MultirotorFile


def flattened(file: AnyFile) -> AnyVehicle:
    """The parameters of a checked file."""
    return flatten_multirotor(file) if isinstance(file, MultirotorFile) else flatten(file)


def require_flyable(vehicle: AnyVehicle, where: str) -> None:
    """InputError where the vehicle contradicts itself or cannot hover."""
    if isinstance(vehicle, MultirotorParameters):
        require_multirotor(vehicle, where)
    else:
        require_feasible(vehicle, where)


def hover_of(vehicle: AnyVehicle) -> AnyTrim:
    """The trim in hover, out of ground effect. InputError as `trim`."""
    return trim_multirotor(vehicle) if isinstance(vehicle, MultirotorParameters) else trim(vehicle)


def rotor_facts(vehicle: AnyVehicle) -> RotorFacts:
    """The main rotor's, or those that a multirotor's have in common."""
    if isinstance(vehicle, MultirotorParameters):
        return RotorFacts(hover_speed(vehicle), vehicle.radius_m, vehicle.rotors_above_cg_m)
    return RotorFacts(vehicle.main_speed_rad_s, vehicle.main_radius_m, vehicle.hub_above_cg_m)


def rotors_of(vehicle: AnyVehicle) -> tuple[int, ...] | None:
    """The kind as kernels take it, in its type: a multirotor's 0 for each rotor; None for a helicopter."""
    if not isinstance(vehicle, MultirotorParameters):
        return None
    return (0,) * (6 if is_hexa(vehicle) else 4)


def disc_of(vehicle: AnyVehicle) -> Disc:
    """The air that a vehicle fills and moves."""
    if isinstance(vehicle, MultirotorParameters):
        together = 2.0 * vehicle.radius_m * math.sqrt(vehicle.rotor_count)
        induced = vehicle.hover_inflow_m * hover_speed(vehicle)
        return Disc(2.0 * (1.0 / vehicle.per_arm_1_m + vehicle.radius_m), together, vehicle.rotors_above_cg_m, induced)
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    induced = hover_induced_velocity(weight, vehicle.main_thrust_slope_n_s_m, vehicle.main_inflow_speed_m_s)
    width = 2.0 * vehicle.main_radius_m
    return Disc(width, width, vehicle.hub_above_cg_m, induced)


def as_the_paper_has_it(vehicle: AnyVehicle) -> AnyVehicle:
    """The vehicle without what the paper's model does not know: slop of the servos."""
    return vehicle if isinstance(vehicle, MultirotorParameters) else without_slop(vehicle)


SHIPPED_VEHICLE = "maxi_joker_3.toml"
SHIPPED_NAMES = {"maxi-joker-3": SHIPPED_VEHICLE, "quad-450": "quad_450.toml", "hexa-550": "hexa_550.toml"}


class Entry(NamedTuple):
    """One number of a vehicle file: dotted key, value in the file's unit, and the file's statement of it."""

    key: str
    value: float
    uncertainty: str  # as written, e.g. "0.6" or "0.012..0.025"; "" where the file gives none
    source: str  # "" where the file gives none


class VehicleDescription(NamedTuple):
    """A vehicle file as people read it."""

    name: str
    path: Path
    entries: tuple[Entry, ...]


def vehicle_file(path: Path | None = None) -> Path:
    """Where a vehicle's file is: a path, a shipped vehicle's name (`quad-450`), the Maxi Joker 3 where it is None.

    InputError for a bare name that is neither shipped nor a file.
    """
    name = "maxi-joker-3" if path is None else str(path)
    if name in SHIPPED_NAMES:
        return shipped(SHIPPED_NAMES[name])
    if not Path(name).suffix and not Path(name).exists():
        known = ", ".join(SHIPPED_NAMES)
        raise InputError(f"{name}: no such vehicle; shipped: {known}, or give a TOML file{meant(name, SHIPPED_NAMES)}")
    return Path(name)


def load_vehicle(path: Path | None = None) -> AnyVehicle:
    """The parameters in a vehicle file or of a shipped vehicle (see `vehicle_file`).

    InputError names the file, the key and what is allowed: an unknown or missing key, a value out of range, a
    vehicle that cannot be (inertia, skids) or that cannot hold a hover.
    """
    return flattened(read_vehicle(path))


def read_vehicle(path: Path | None = None) -> AnyFile:
    """A vehicle file as it stands, checked. InputError as `load_vehicle`."""
    path = vehicle_file(path)
    file = read_kind(read_toml(path), str(path))
    require_flyable(flattened(file), str(path))
    return file


def read_kind(contents: dict[str, Any], where: str) -> AnyFile:
    """A file's contents checked by the schema of their kind. InputError names the file and the key."""
    schema: Any = schema_of(contents, where)
    file: AnyFile = check(contents, schema, where)
    return file


def described_again(entries: Mapping[str, Any], where: str) -> AnyFile:
    """The file of a vehicle whose entries (`describe_vehicle`) a record kept. InputError where they are none."""
    contents: dict[str, Any] = {"schema_version": 1, "name": "as recorded"}
    for key, entry in entries.items():
        table, _, name = key.partition(".")
        contents.setdefault(table, {})[name] = entry["value"]
    return read_kind(contents, where)


def describe_vehicle(path: Path | None = None) -> VehicleDescription:
    """Name and every number with its uncertainty and provenance, for tables and reports.

    InputError where the file does not fit its schema.
    """
    path = vehicle_file(path)
    contents = read_toml(path)
    file = read_kind(contents, str(path))
    tables = {key: table for key, table in contents.items() if isinstance(table, dict)}
    entries = [_entry(f"{table}.{key}", value) for table, rows in tables.items() for key, value in rows.items()]
    return VehicleDescription(file.name, path, tuple(entries))


def _entry(key: str, given: Any) -> Entry:
    if not isinstance(given, dict):
        return Entry(key, float(given), "", "")
    return Entry(key, float(given["value"]), str(given.get("uncertainty", "")), str(given.get("source", "")))
