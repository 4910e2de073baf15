"""Block 3, forces and torques about the centre of gravity, body axes: rotors, fuselage, fins, gravity.

Sources: reference section 2, block 3 (Gavrilets, Mettler and Feron; Heffley and Mnich NASA CR-177476). The main
rotor turns clockwise seen from above, so its torque yaws the body to the left and the tail rotor pushes left.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.compile import equation, magnitude
from flownav.frames import Vector
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.rotor import cosine_of_tilt, sine_of_tilt


class Wrench(NamedTuple):
    """Force X, Y, Z [N] and moment L, M, N [N m] about the centre of gravity, body FRD."""

    x: float
    y: float
    z: float
    l: float  # noqa: E741  (the roll moment's name in every text)
    m: float
    n: float


class AirMotion(NamedTuple):
    """Motion through the air, body FRD: u, v, w [m/s] (wind taken off) and the rates p, q, r [rad/s]."""

    u: float
    v: float
    w: float
    p: float
    q: float
    r: float


@equation
def add(a: Wrench, b: Wrench) -> Wrench:
    """Two wrenches about the same point together."""
    return Wrench(a.x + b.x, a.y + b.y, a.z + b.z, a.l + b.l, a.m + b.m, a.n + b.n)


@equation
def tail_sideslip(air: AirMotion, vehicle: VehicleParameters) -> float:
    """Sideways velocity of the tail rotor and the fin through the air [m/s]."""
    return air.v - vehicle.tail_behind_cg_m * air.r + vehicle.tail_above_cg_m * air.p


@equation
def main_rotor_wrench(
    thrust: float, torque: float, a1: float, b1: float, air: AirMotion, vehicle: VehicleParameters
) -> Wrench:
    """Tilted thrust, in-plane blade drag (H-force) and hub stiffness; a1 > 0 tilts the disc back, b1 > 0 right."""
    x = -thrust * sine_of_tilt(a1) - vehicle.main_inplane_drag_n_s_m * air.u
    y = thrust * sine_of_tilt(b1) - vehicle.main_inplane_drag_n_s_m * air.v
    z = -thrust * cosine_of_tilt(a1) * cosine_of_tilt(b1)
    roll = vehicle.hub_stiffness_n_m_rad * b1 + vehicle.hub_above_cg_m * y
    pitch = vehicle.hub_stiffness_n_m_rad * a1 - vehicle.hub_above_cg_m * x
    return Wrench(x, y, z, roll, pitch, -torque)


@equation
def tail_wrench(thrust: float, induced: float, air: AirMotion, vehicle: VehicleParameters) -> Wrench:
    """The tail rotor's thrust to the left, and the vertical fin in its wake, at one place."""
    sideslip = tail_sideslip(air, vehicle) - vehicle.vertical_fin_inflow_fraction * induced
    lift = vehicle.vertical_fin_lift_slope_per_rad * magnitude(air.u) + magnitude(sideslip)
    fin = -0.5 * vehicle.air_density_kg_m3 * vehicle.vertical_fin_area_m2 * lift * sideslip
    y = fin - vehicle.tail_fin_blockage * thrust
    return Wrench(0.0, y, 0.0, vehicle.tail_above_cg_m * y, 0.0, -vehicle.tail_behind_cg_m * y)


@equation
def fuselage_wrench(induced: float, air: AirMotion, vehicle: VehicleParameters) -> Wrench:
    """Drag of the fuselage in the airspeed and the main rotor's wake; it acts at the centre of gravity."""
    w = air.w - induced
    speed = np.sqrt(air.u * air.u + air.v * air.v + w * w)
    pressure = -0.5 * vehicle.air_density_kg_m3 * speed
    return Wrench(
        pressure * vehicle.fuselage_area_x_m2 * air.u,
        pressure * vehicle.fuselage_area_y_m2 * air.v,
        pressure * vehicle.fuselage_area_z_m2 * w,
        0.0,
        0.0,
        0.0,
    )


@equation
def tail_plane_wrench(induced: float, air: AirMotion, vehicle: VehicleParameters) -> Wrench:
    """The horizontal fin in the airspeed and a share of the main rotor's wake."""
    arm = vehicle.horizontal_fin_behind_cg_m
    w = air.w + arm * air.q - vehicle.horizontal_fin_inflow_fraction * induced
    lift = vehicle.horizontal_fin_lift_slope_per_rad * magnitude(air.u) + magnitude(w)
    z = -0.5 * vehicle.air_density_kg_m3 * vehicle.horizontal_fin_area_m2 * lift * w
    return Wrench(0.0, 0.0, z, 0.0, arm * z, 0.0)


@equation
def gravity_wrench(down: Vector, vehicle: VehicleParameters) -> Wrench:
    """Weight; `down` is the earth's down axis in body axes, (-sin θ, sin φ cos θ, cos φ cos θ)."""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    return Wrench(weight * down[0], weight * down[1], weight * down[2], 0.0, 0.0, 0.0)
