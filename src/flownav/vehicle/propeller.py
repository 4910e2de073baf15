"""Block 2 of a multirotor: a fixed-pitch propeller's thrust, torque, flapping and drag, and the ground under it.

Svacha, Mohta and Kumar (ICUAS 2017) and RotorPy (Folk, Paulos and Kumar 2023): thrust, drag and axial damping linear in
Ω·velocity; the coefficients follow from the propeller's static thrust, see `MultirotorParameters`.
"""

from __future__ import annotations

from typing import NamedTuple

from flownav.core.compile import equation, larger
from flownav.vehicle.ground_effect import source_and_image
from flownav.vehicle.multirotor_parameters import MultirotorParameters

STILL_SQ = 1e-9  # [m2/s2] keeps a rotor at rest in dead air from dividing by zero


class PropellerLoad(NamedTuple):
    """Thrust [N]; drag per in-plane airspeed, the disc's tilt in it [N s/m]; hub moment per airspeed [N s]; torque."""

    thrust_n: float
    drag_n_s_m: float
    hub_n_s: float
    torque_n_m: float


@equation
def lifting(speed: float, inplane_sq: float, vehicle: MultirotorParameters) -> tuple[float, float]:
    """Translational lift [N] is the first over the second.

    It grows with V² and levels out at V = 2·v_i, as momentum theory does (3 % of v_i to V = 3·v_i).
    """
    twice_inflow_sq = 4.0 * (vehicle.hover_inflow_m * vehicle.hover_inflow_m) * speed * speed + STILL_SQ
    return vehicle.inplane_n_s2_m2 * (inplane_sq * twice_inflow_sq), twice_inflow_sq + inplane_sq


@equation
def level_thrust(speed: float, axial: float, vehicle: MultirotorParameters) -> float:
    """Thrust [N] without translational lift and ground; axial: velocity against the thrust, up is negative [m/s]."""
    return vehicle.thrust_n_s2 * speed * speed + vehicle.axial_n_s2_m * speed * axial


@equation
def propeller_load(
    speed: float, inplane_sq: float, axial: float, horizontal_sq: float, hub_height_m: float,
    vehicle: MultirotorParameters,
) -> PropellerLoad:  # fmt: skip
    """One propeller at a height of its hub above the ground [m], horizontal airspeed squared [m2/s2].

    Divisions are most of what a rotor costs on lanes: one serves lift, ground and flapping.
    """
    lift, by_lift = lifting(speed, inplane_sq, vehicle)
    free, image = source_and_image(hub_height_m, horizontal_sq, vehicle.hover_inflow_m * speed, vehicle.radius_m)
    by_ground, by_tilt = free - image, vehicle.radius_m * vehicle.radius_m * larger(speed, 1.0)
    per_all = 1.0 / (by_lift * by_ground * by_tilt)
    lifted = lift * (by_ground * by_tilt * per_all)
    thrust = free * (by_lift * by_tilt * per_all) * (level_thrust(speed, axial, vehicle) + lifted)
    tilt = vehicle.flap_back_m * (by_lift * by_ground * per_all)  # [rad/(m/s)]
    return PropellerLoad(
        thrust,
        vehicle.inplane_drag_n_s2_m * speed + thrust * tilt,
        vehicle.hub_stiffness_n_m_rad * tilt,
        vehicle.torque_n_m_s2 * speed * speed,
    )
