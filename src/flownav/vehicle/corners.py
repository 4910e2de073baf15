"""The corners of a vehicle's uncertainty box, from the uncertainties that its file states.

Entries that one cause moves, or that push a loop the same way, move together: a box of fifty dimensions has 10¹⁵
corners, one of seven has 128. Each corner keeps what the file says of every number, `uncertainty = 0.6` (either way)
or `"0.012..0.025"` (from, to).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from flownav.parameter_files import check, read_toml, shipped
from flownav.vehicle.loading import SHIPPED_VEHICLE
from flownav.vehicle.parameters import VehicleParameters, flatten
from flownav.vehicle.schema import VehicleFile

NOMINAL = "nominal"
# what moves together; `-` before a key: it goes the other way
GROUPS: dict[str, tuple[str, ...]] = {
    "mass": ("body.mass_kg",),
    "inertia": ("body.inertia_xx_kg_m2", "body.inertia_yy_kg_m2", "body.inertia_zz_kg_m2"),
    "flapping stiffness": ("main_rotor.hub_stiffness_n_m_rad", "main_rotor.hub_above_cg_m"),
    "flapping inertia": ("main_rotor.blade_flap_inertia_kg_m2",),
    "drag": (
        "fuselage.area_x_m2", "fuselage.area_y_m2", "fuselage.area_z_m2", "main_rotor.profile_drag_coefficient",
        "vertical_fin.area_m2", "main_rotor.flap_response",
    ),
    "lift": ("environment.air_density_kg_m3", "main_rotor.lift_slope_per_rad", "tail_rotor.lift_slope_per_rad"),
    "servos": (
        "cyclic.frequency_rad_s", "collective.frequency_rad_s", "pedal.frequency_rad_s", "cyclic.damping_ratio",
        "collective.damping_ratio", "pedal.damping_ratio",
    ),
}  # fmt: skip


class Corner(NamedTuple):
    """A vehicle at a corner of the box; name: `nominal`, or `mass +, inertia -, ...` for the groups that have a width."""

    name: str
    vehicle: VehicleParameters


def corners(path: Path | None = None) -> Iterator[Corner]:
    """The vehicle as its file says, then every corner of its box; the shipped vehicle where `path` is None.

    InputError where the file does not fit its schema.
    """
    path = path or shipped(SHIPPED_VEHICLE)
    contents = read_toml(path)
    yield Corner(NOMINAL, flatten(check(contents, VehicleFile, str(path))))
    wide = [name for name, keys in GROUPS.items() if any(_ends(_entry(contents, key)) for key in keys)]
    for signs in product((-1, 1), repeat=len(wide)) if wide else ():
        moved = contents
        for name, sign in zip(wide, signs, strict=True):
            for key in GROUPS[name]:
                moved = _moved(moved, key, sign)
        name = ", ".join(f"{group} {'+' if sign > 0 else '-'}" for group, sign in zip(wide, signs, strict=True))
        yield Corner(name, flatten(check(moved, VehicleFile, f"{path}, corner {name}")))


def _entry(contents: dict[str, Any], key: str) -> Any:
    table, field = key.split(".")
    return contents[table][field]


def _ends(entry: Any) -> tuple[float, float] | None:
    """The smallest and the largest value that an entry states; None where it states no uncertainty."""
    if not isinstance(entry, dict) or "uncertainty" not in entry:
        return None
    said = entry["uncertainty"]
    if isinstance(said, str):
        low, _, high = said.partition("..")
        return float(low), float(high)
    return entry["value"] - said, entry["value"] + said


def _moved(contents: dict[str, Any], key: str, sign: int) -> dict[str, Any]:
    """The contents with one entry at its smallest (-1) or largest (+1) value; as it is without an uncertainty."""
    ends = _ends(_entry(contents, key))
    if ends is None:
        return contents
    table, field = key.split(".")
    return contents | {table: contents[table] | {field: ends[0] if sign < 0 else ends[1]}}
