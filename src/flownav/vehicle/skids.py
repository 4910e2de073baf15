"""Skid contact with the ground: four unilateral sprung feet, and dry friction that really sticks.

The ground is a plane, level or not, and what each foot finds over it (a step, a stone): `state.Around`.

The feet push and never pull. Their damping comes in over the first 2 mm, so the force has no jump at touch.

Friction acts in the plane of the skids, as one force below the centre of gravity and one torque. It is what it
takes to stop the sliding within `STICK_TIME_S`, all other forces included, but no more than μ·N along the skids,
μ·N across them (a friction pyramid) and μ·N times the feet's distance in torque: Karnopp's reading of Coulomb's
law. A parked helicopter therefore stays put against its tail rotor, without the creep of a viscous
regularisation and without its stiffness, which a 2 ms Runge-Kutta step could not carry.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, equation, larger, smaller, squared
from flownav.core.frames import Vector
from flownav.vehicle.airframe import Wrench
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters
from flownav.vehicle.state import Around

OnFeet = VehicleParameters | MultirotorParameters

DAMPING_DEPTH_M = 0.002
STICK_TIME_S = 0.010


class Support(NamedTuple):
    """Load on the feet: total normal force [N] and its moments of place Σ N·x, Σ N·y [N m], body axes."""

    normal_n: float
    forward_n_m: float
    right_n_m: float


@equation
def foot_force(depth: float, sink: float, vehicle: OnFeet) -> float:
    """Normal force of one foot [N], `depth` below the ground [m] and sinking at `sink` [m/s]; never negative."""
    pressed = larger(depth, 0.0)
    damping = vehicle.skid_damping_n_s_m * smaller(pressed * (1.0 / DAMPING_DEPTH_M), 1.0)
    return larger(vehicle.skid_stiffness_n_m * pressed + damping * sink, 0.0)


@equation
def support(below: float, normal: Vector, velocity: Vector, rates: Vector, around: Around, vehicle: OnFeet) -> Support:
    """The normal forces of the four feet at (±half_length, ±half_track, cg_above_skid), body axes.

    below: of the centre of gravity under the ground's plane [m] (`state.below_plane`), normal: into the ground, body
    axes. A foot at r is below·cosine + normal·r deep, and what it finds over the plane; it sinks at
    normal·(velocity + rates × r).
    """
    x, y, z = vehicle.skid_half_length_m, vehicle.skid_half_track_m, vehicle.cg_above_skid_m
    p, q, r = rates
    level = around.cosine
    depth = below * level + normal[2] * z
    depth_x, depth_y = normal[0] * x, normal[1] * y
    turn_x, turn_y = (normal[1] * r - normal[2] * q) * x, (normal[2] * p - normal[0] * r) * y
    sink = (
        normal[0] * velocity[0] + normal[1] * velocity[1] + normal[2] * velocity[2]
        + (normal[0] * q - normal[1] * p) * z
    )  # fmt: skip
    front_right = foot_force(depth + depth_x + depth_y + level * around.foot_1_m, sink + turn_x + turn_y, vehicle)
    front_left = foot_force(depth + depth_x - depth_y + level * around.foot_2_m, sink + turn_x - turn_y, vehicle)
    rear_right = foot_force(depth - depth_x + depth_y + level * around.foot_3_m, sink - turn_x + turn_y, vehicle)
    rear_left = foot_force(depth - depth_x - depth_y + level * around.foot_4_m, sink - turn_x - turn_y, vehicle)
    front, rear = front_right + front_left, rear_right + rear_left
    right, left = front_right + rear_right, front_left + rear_left
    return Support(front + rear, (front - rear) * x, (right - left) * y)


@equation
def with_support(free: Wrench, feet: Support, normal: Vector, vehicle: OnFeet) -> Wrench:
    """The free wrench and the feet's normal forces, which act out of the ground: -N·normal at the feet."""
    z = feet.normal_n * vehicle.cg_above_skid_m
    return Wrench(
        free.x - feet.normal_n * normal[0],
        free.y - feet.normal_n * normal[1],
        free.z - feet.normal_n * normal[2],
        free.l + (z * normal[1] - feet.right_n_m * normal[2]),
        free.m + (feet.forward_n_m * normal[2] - z * normal[0]),
        free.n + (feet.right_n_m * normal[0] - feet.forward_n_m * normal[1]),
    )


@equation
def with_friction(free: Wrench, feet: Support, velocity: Vector, rates: Vector, vehicle: OnFeet) -> Wrench:
    """The free wrench, which holds all other forces, and the dry friction under the skids."""
    z = vehicle.cg_above_skid_m
    per_mass, per_jx, per_jy = 1.0 / vehicle.mass_kg, 1.0 / vehicle.inertia_xx_kg_m2, 1.0 / vehicle.inertia_yy_kg_m2
    per_time = 1.0 / STICK_TIME_S
    p, q, r = rates
    # the acceleration that friction has to give the point under the centre of gravity, and the mass it moves there
    stop_x = free.x * per_mass + free.m * (per_jy * z) + (velocity[0] + q * z) * per_time
    stop_y = free.y * per_mass - free.l * (per_jx * z) + (velocity[1] - p * z) * per_time
    need_x = stop_x * (1.0 / (per_mass + z * z * per_jy))
    need_y = stop_y * (1.0 / (per_mass + z * z * per_jx))
    limit = vehicle.skid_friction_coefficient * feet.normal_n
    arm = np.sqrt(squared(vehicle.skid_half_length_m) + squared(vehicle.skid_half_track_m))
    x, y = clamp(need_x, -limit, limit), clamp(need_y, -limit, limit)
    torque = clamp(free.n + r * (vehicle.inertia_zz_kg_m2 * per_time), -limit * arm, limit * arm)
    return Wrench(free.x - x, free.y - y, free.z, free.l + z * y, free.m - z * x, free.n - torque)
