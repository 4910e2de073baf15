"""The corners of a vehicle's uncertainty box, from the uncertainties that its file states.

Entries that one cause moves, or that push a loop the same way, move together: a box of fifty dimensions has 10¹⁵
corners, one of five has 32. What the autopilot's first hover shows anyway (how fast a cyclic turns the body, how much
collective carries it) is moved alone, on the nominal vehicle. Each corner keeps the uncertainty that the file states of
every number, `uncertainty = 0.6` (either way) or `"0.012..0.025"` (from, to).
"""

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from flownav.core.errors import InputError
from flownav.core.parameter_files import as_shown, read_toml
from flownav.vehicle.kinds import AnyVehicle, flattened, read_kind, vehicle_file
from flownav.vehicle.schema import MultirotorFile

NOMINAL = "nominal"
Groups = dict[str, tuple[str, ...]]
# every combination of these is a corner
CROSSED: Groups = {
    "mass": ("body.mass_kg",),
    "inertia": ("body.inertia_xx_kg_m2", "body.inertia_yy_kg_m2", "body.inertia_zz_kg_m2"),
    "flapping stiffness": ("main_rotor.hub_stiffness_n_m_rad", "main_rotor.hub_above_cg_m"),
    "drag": (
        "fuselage.area_x_m2", "fuselage.area_y_m2", "fuselage.area_z_m2", "main_rotor.profile_drag_coefficient",
        "vertical_fin.area_m2", "main_rotor.flap_response",
    ),
    "servos": (
        "cyclic.frequency_rad_s", "collective.frequency_rad_s", "pedal.frequency_rad_s", "cyclic.damping_ratio",
        "collective.damping_ratio", "pedal.damping_ratio",
    ),
}  # fmt: skip
# these are moved one at a time
ALONE: Groups = {
    "flapping inertia": ("main_rotor.blade_flap_inertia_kg_m2",),
    "air density": ("environment.air_density_kg_m3",),
    "lift": ("main_rotor.lift_slope_per_rad", "tail_rotor.lift_slope_per_rad"),
    "tail rotor": ("tail_rotor.radius_m", "tail_rotor.chord_m", "tail_rotor.gear_ratio"),
}


# of a multirotor
MULTIROTOR_CROSSED: Groups = {
    "mass": ("body.mass_kg",),
    "inertia": ("body.inertia_xx_kg_m2", "body.inertia_yy_kg_m2", "body.inertia_zz_kg_m2"),
    "thrust": ("propeller.thrust_coefficient", "motor.full_speed_rad_s"),
    "drag": (
        "propeller.inplane_drag_n_s2_m_rad", "propeller.flap_response", "propeller.hub_stiffness_n_m_rad",
        "propeller.lift_slope_per_rad", "fuselage.area_x_m2", "fuselage.area_y_m2", "fuselage.area_z_m2",
    ),
    "motors": ("motor.time_constant_s",),
}  # fmt: skip
MULTIROTOR_ALONE: Groups = {
    "rotor inertia": ("propeller.inertia_kg_m2",),
    "torque": ("propeller.power_coefficient",),
    "air density": ("environment.air_density_kg_m3",),
    "battery": ("battery.resistance_ohm",),
    "rotors' height": ("frame.rotors_above_cg_m",),
}


class Corner(NamedTuple):
    """A vehicle at a corner of the box; name: `nominal`, or `mass +, inertia -, ...` of the groups that are moved."""

    name: str
    vehicle: AnyVehicle


def groups_of(file: Any) -> tuple[Groups, Groups]:
    """Groups that are crossed and groups that are moved alone, of a file's kind."""
    multirotor = isinstance(file, MultirotorFile)
    return (MULTIROTOR_CROSSED, MULTIROTOR_ALONE) if multirotor else (CROSSED, ALONE)


def corners(path: Path | None = None) -> Iterator[Corner]:
    """The vehicle as its file states it, then every corner of its box; the shipped vehicle where `path` is None.

    InputError where the file does not fit its schema, or an uncertainty is no number and no `"from..to"`.
    """
    path = vehicle_file(path)
    contents = read_toml(path)
    nominal_file = read_kind(contents, str(path))
    yield Corner(NOMINAL, flattened(nominal_file))
    crossed, alone = (
        {name: keys for name, keys in groups.items() if _is_wide(contents, keys, path)}
        for groups in groups_of(nominal_file)
    )
    combined = list(product((-1, 1), repeat=len(crossed))) if crossed else []
    for groups, signs in [(crossed, signs) for signs in combined] + [
        ({name: keys}, (sign,)) for name, keys in alone.items() for sign in (-1, 1)
    ]:
        moved = contents
        for keys, sign in zip(groups.values(), signs, strict=True):
            for key in keys:
                moved = _moved(moved, key, sign, path)
        name = ", ".join(f"{group} {'+' if sign > 0 else '-'}" for group, sign in zip(groups, signs, strict=True))
        yield Corner(name, flattened(read_kind(moved, f"{path}, corner {name}")))


def _is_wide(contents: dict[str, Any], keys: tuple[str, ...], path: Path) -> bool:
    return any(_ends(_entry(contents, key), key, path) for key in keys)


def _entry(contents: dict[str, Any], key: str) -> Any:
    table, field = key.split(".")
    return contents[table][field]


def _ends(entry: Any, key: str, path: Path) -> tuple[float, float] | None:
    """The smallest and the largest value that an entry states; None where it states no uncertainty."""
    if not isinstance(entry, dict) or "uncertainty" not in entry:
        return None
    stated = entry["uncertainty"]
    try:
        if isinstance(stated, str):
            low, _, high = stated.partition("..")
            return float(low), float(high)
        return float(entry["value"] - stated), float(entry["value"] + stated)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f'{path}: {key}: uncertainty is a number or "from..to", got {as_shown(stated)}') from None


def _moved(contents: dict[str, Any], key: str, sign: int, path: Path) -> dict[str, Any]:
    """The contents with one entry at its smallest (-1) or largest (+1) value; as it is without an uncertainty."""
    ends = _ends(_entry(contents, key), key, path)
    if ends is None:
        return contents
    table, field = key.split(".")
    return contents | {table: contents[table] | {field: ends[0] if sign < 0 else ends[1]}}
