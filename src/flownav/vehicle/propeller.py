"""Block 2 of a multirotor: a fixed-pitch propeller's thrust, torque, flapping and drag, and the ground under it.

Svacha, Mohta and Kumar (ICUAS 2017) and RotorPy (Folk, Paulos and Kumar 2023): thrust, drag and axial damping linear in
Ω·velocity; the coefficients follow from the propeller's static thrust, see `MultirotorParameters`.
"""

from __future__ import annotations

from typing import NamedTuple

from flownav.compile import equation, larger
from flownav.vehicle.ground_effect import multiplier_of_squares
from flownav.vehicle.multirotor_parameters import MultirotorParameters

STILL_SQ = 1e-9  # [m2/s2] keeps a rotor at rest in dead air from dividing by zero


class PropellerLoad(NamedTuple):
    """Thrust [N]; drag per in-plane airspeed, the disc's tilt in it [N s/m]; hub moment per airspeed [N s]; torque."""

    thrust_n: float
    drag_n_s_m: float
    hub_n_s: float
    torque_n_m: float


@equation
def free_thrust(speed: float, inplane_sq: float, axial: float, vehicle: MultirotorParameters) -> float:
    """Thrust out of ground effect [N]; axial: velocity against the thrust, positive in descent [m/s].

    Translational lift grows with V² and levels out at V = 2·v_i, as momentum theory does (3 % of v_i to V = 3·v_i).
    """
    twice_inflow_sq = 4.0 * (vehicle.hover_inflow_m * vehicle.hover_inflow_m) * speed * speed + STILL_SQ
    lifted = vehicle.inplane_n_s2_m2 * (inplane_sq * twice_inflow_sq) / (twice_inflow_sq + inplane_sq)
    return vehicle.thrust_n_s2 * speed * speed + vehicle.axial_n_s2_m * speed * axial + lifted


@equation
def propeller_load(
    speed: float, inplane_sq: float, axial: float, horizontal_sq: float, hub_height_m: float,
    vehicle: MultirotorParameters,
) -> PropellerLoad:  # fmt: skip
    """One propeller at a height of its hub above the ground [m], horizontal airspeed squared [m2/s2]."""
    near_ground = multiplier_of_squares(hub_height_m, horizontal_sq, vehicle.hover_inflow_m * speed, vehicle.radius_m)
    thrust = near_ground * free_thrust(speed, inplane_sq, axial, vehicle)
    tilt = vehicle.flap_back_m / (vehicle.radius_m * vehicle.radius_m * larger(speed, 1.0))  # [rad/(m/s)]
    return PropellerLoad(
        thrust,
        vehicle.inplane_drag_n_s2_m * speed + thrust * tilt,
        vehicle.hub_stiffness_n_m_rad * tilt,
        vehicle.torque_n_m_s2 * speed * speed,
    )
