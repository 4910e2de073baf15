"""Loading a vehicle file of either kind: checked, made flat, and refused where no such vehicle could hover."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from flownav.core.parameter_files import check, read_toml, shipped
from flownav.vehicle.kinds import AnyFile, AnyVehicle, flattened, require_flyable, schema_of

SHIPPED_VEHICLE = "maxi_joker_3.toml"
SHIPPED_NAMES = {"maxi-joker-3": SHIPPED_VEHICLE, "quad-450": "quad_450.toml", "hexa-550": "hexa_550.toml"}


class Entry(NamedTuple):
    """One number of a vehicle file: dotted key, value in the file's unit, and what the file says of it."""

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
    """Where a vehicle's file is: a path, a shipped vehicle's name (`quad-450`), the Maxi Joker 3 where it is None."""
    name = "maxi-joker-3" if path is None else str(path)
    return shipped(SHIPPED_NAMES[name]) if name in SHIPPED_NAMES else Path(name)


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
