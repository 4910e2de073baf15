"""Loading a vehicle file: checked, made flat, and refused where no such helicopter could hover."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from flownav.parameter_files import check, read_toml, shipped
from flownav.vehicle.feasibility import require_feasible
from flownav.vehicle.parameters import VehicleParameters, flatten
from flownav.vehicle.schema import VehicleFile

SHIPPED_VEHICLE = "maxi_joker_3.toml"


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


def load_vehicle(path: Path | None = None) -> VehicleParameters:
    """The parameters in a vehicle file, the shipped Maxi Joker 3 where `path` is None.

    InputError names the file, the key and what is allowed: an unknown or missing key, a value out of range, a
    helicopter that cannot be (inertia, skids) or that cannot hold a hover.
    """
    return flatten(read_vehicle(path))


def read_vehicle(path: Path | None = None) -> VehicleFile:
    """A vehicle file as it stands, checked. InputError as `load_vehicle`."""
    path = path or shipped(SHIPPED_VEHICLE)
    file = check(read_toml(path), VehicleFile, str(path))
    require_feasible(flatten(file), str(path))
    return file


def describe_vehicle(path: Path | None = None) -> VehicleDescription:
    """Name and every number with its uncertainty and provenance, for tables and reports.

    InputError where the file does not fit its schema.
    """
    path = path or shipped(SHIPPED_VEHICLE)
    contents = read_toml(path)
    file = check(contents, VehicleFile, str(path))
    tables = {key: table for key, table in contents.items() if isinstance(table, dict)}
    entries = [_entry(f"{table}.{key}", value) for table, rows in tables.items() for key, value in rows.items()]
    return VehicleDescription(file.name, path, tuple(entries))


def _entry(key: str, given: Any) -> Entry:
    if not isinstance(given, dict):
        return Entry(key, float(given), "", "")
    return Entry(key, float(given["value"]), str(given.get("uncertainty", "")), str(given.get("source", "")))
