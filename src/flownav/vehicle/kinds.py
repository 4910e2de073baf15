"""The two kinds of vehicle, and what is asked of either: its file's schema, its parameters, its trim, its rotor."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from flownav.core.errors import InputError
from flownav.vehicle.feasibility import hover_induced_velocity, require_feasible
from flownav.vehicle.multirotor_parameters import (
    MultirotorParameters,
    flatten_multirotor,
    hover_speed,
    require_multirotor,
)
from flownav.vehicle.multirotor_schema import KIND, MultirotorFile
from flownav.vehicle.multirotor_state import MultirotorState
from flownav.vehicle.multirotor_trim import MultirotorTrim, is_hexa, trim_multirotor
from flownav.vehicle.parameters import VehicleParameters, flatten, without_slop
from flownav.vehicle.schema import VehicleFile
from flownav.vehicle.state import HelicopterState
from flownav.vehicle.trim import Trim, trim

AnyFile = VehicleFile | MultirotorFile
AnyVehicle = VehicleParameters | MultirotorParameters
AnyTrim = Trim | MultirotorTrim
AnyState = HelicopterState | MultirotorState


class RotorFacts(NamedTuple):
    """What the sensors feel of the rotors: speed in hover [rad/s], radius, height above the centre of gravity [m]."""

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
    """The schema of a file's contents: a helicopter's where it says no `kind`. InputError where it is unknown."""
    kind = contents.get("kind")
    if kind is None:
        return VehicleFile
    if kind != KIND:
        raise InputError(f'{where}: kind = {kind!r}: known is "{KIND}"; a helicopter\'s file says none')
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
