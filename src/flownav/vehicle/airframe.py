"""Blocks 3 and 4: forces and torques about the centre of gravity, body axes, and the rigid body that they move.

Sources: reference section 2, block 3 (Gavrilets, Mettler and Feron; Heffley and Mnich NASA CR-177476). The main
rotor turns clockwise seen from above, so its torque yaws the body to the left and the tail rotor pushes left.

The rigid body is the paper's equations 2-7, with the attitude as a quaternion in place of equations 8-10.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation, magnitude
from flownav.core.frames import Rotation, Vector, rotation_from_quaternion, to_body
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters
from flownav.vehicle.rotor import cosine_of_tilt, sine_of_tilt
from flownav.vehicle.state import Around, HelicopterState, MultirotorState

AnyMotion = HelicopterState | MultirotorState  # their first fields are the same


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
def attitude(state: AnyMotion) -> Rotation:
    """R_EB of the state."""
    return rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)


@equation
def air_motion(state: AnyMotion, rotation: Rotation, around: Around) -> AirMotion:
    """Motion through the air; a gradient of the air's velocity is a rotation that is not the vehicle's own."""
    wind = to_body(rotation, around.wind_n_m_s, around.wind_e_m_s, around.wind_d_m_s)
    turn = to_body(rotation, around.turn_n_rad_s, around.turn_e_rad_s, around.turn_d_rad_s)
    return AirMotion(
        state.u - wind[0], state.v - wind[1], state.w - wind[2],
        state.p - turn[0], state.q - turn[1], state.r - turn[2],
    )  # fmt: skip


@equation
def tail_sideslip(air: AirMotion, vehicle: VehicleParameters) -> float:
    """Sideways velocity of the tail rotor and the fin through the air [m/s]."""
    return air.v - vehicle.tail_behind_cg_m * air.r + vehicle.tail_above_cg_m * air.p


@equation
def main_rotor_wrench(
    thrust: float, torque: float, a1: float, b1: float, air: AirMotion, ratio: float, vehicle: VehicleParameters
) -> Wrench:
    """Tilted thrust, in-plane blade drag (H-force) and hub stiffness; a1 > 0 tilts the disc back, b1 > 0 right.

    ratio: `rotor.speed_ratio`.
    """
    drag = vehicle.main_inplane_drag_n_s_m * ratio
    x = -thrust * sine_of_tilt(a1) - drag * air.u
    y = thrust * sine_of_tilt(b1) - drag * air.v
    z = -thrust * cosine_of_tilt(a1) * cosine_of_tilt(b1)
    roll = vehicle.hub_stiffness_n_m_rad * b1 + vehicle.hub_above_cg_m * y
    pitch = vehicle.hub_stiffness_n_m_rad * a1 - vehicle.hub_above_cg_m * x
    return Wrench(x, y, z, roll, pitch, -torque)


@equation
def tail_side_force(thrust: float, induced: float, air: AirMotion, vehicle: VehicleParameters) -> float:
    """Side force of the tail rotor, to the left, and of the vertical fin in its wake, at one place [N]."""
    sideslip = tail_sideslip(air, vehicle) - vehicle.vertical_fin_tail_inflow_fraction * induced
    lift = vehicle.vertical_fin_lift_slope_per_rad * magnitude(air.u) + magnitude(sideslip)
    pressure = 0.5 * vehicle.air_density_kg_m3 * vehicle.vertical_fin_area_m2
    return -pressure * lift * sideslip - vehicle.tail_fin_blockage * thrust


@equation
def tail_plane_force(induced: float, air: AirMotion, vehicle: VehicleParameters) -> float:
    """Downward force of the horizontal fin in the airspeed and a share of the main rotor's wake [N]."""
    w = air.w + vehicle.horizontal_fin_behind_cg_m * air.q - vehicle.horizontal_fin_main_inflow_fraction * induced
    lift = vehicle.horizontal_fin_lift_slope_per_rad * magnitude(air.u) + magnitude(w)
    pressure = 0.5 * vehicle.air_density_kg_m3 * vehicle.horizontal_fin_area_m2
    return -pressure * lift * w


@equation
def fuselage_drag(induced: float, air: AirMotion, vehicle: VehicleParameters | MultirotorParameters) -> Vector:
    """Drag of the fuselage in the airspeed and the main rotor's wake [N]; it acts at the centre of gravity."""
    w = air.w - induced
    speed = np.sqrt(air.u * air.u + air.v * air.v + w * w)
    half_density = 0.5 * vehicle.air_density_kg_m3
    return (
        -(half_density * vehicle.fuselage_area_x_m2) * speed * air.u,
        -(half_density * vehicle.fuselage_area_y_m2) * speed * air.v,
        -(half_density * vehicle.fuselage_area_z_m2) * speed * w,
    )


@equation
def flight_wrench(
    rotor: Wrench, tail: float, plane: float, fuselage: Vector, down: Vector, vehicle: VehicleParameters
) -> Wrench:
    """All but the ground: main rotor, tail (side force), tail plane (down force), fuselage and weight.

    `down` is the earth's down axis in body axes, (-sin θ, sin φ cos θ, cos φ cos θ).
    """
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    return Wrench(
        rotor.x + fuselage[0] + weight * down[0],
        rotor.y + fuselage[1] + weight * down[1] + tail,
        rotor.z + fuselage[2] + weight * down[2] + plane,
        rotor.l + vehicle.tail_above_cg_m * tail,
        rotor.m + vehicle.horizontal_fin_behind_cg_m * plane,
        rotor.n - vehicle.tail_behind_cg_m * tail,
    )


@equation
def linear_acceleration(velocity: Vector, rates: Vector, force: Vector, mass_kg: float) -> Vector:
    """Rate of the body-frame velocity [m/s2] (equations 5-7); force [N] with gravity in it."""
    u, v, w = velocity
    p, q, r = rates
    per_mass = 1.0 / mass_kg
    return (
        r * v - q * w + force[0] * per_mass,
        p * w - r * u + force[1] * per_mass,
        q * u - p * v + force[2] * per_mass,
    )


@equation
def angular_acceleration(rates: Vector, moment: Vector, vehicle: VehicleParameters | MultirotorParameters) -> Vector:
    """Rate of the body rates [rad/s2] (equations 2-4); moment [N m] about the centre of gravity."""
    p, q, r = rates
    jx, jy, jz = vehicle.inertia_xx_kg_m2, vehicle.inertia_yy_kg_m2, vehicle.inertia_zz_kg_m2
    return (
        (moment[0] - (jz - jy) * q * r) * (1.0 / jx),
        (moment[1] - (jx - jz) * p * r) * (1.0 / jy),
        (moment[2] - (jy - jx) * p * q) * (1.0 / jz),
    )
