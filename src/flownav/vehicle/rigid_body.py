"""Block 4, the rigid body: paper equations 2-7, with the attitude as a quaternion in place of equations 8-10."""

from __future__ import annotations

from flownav.core.compile import equation
from flownav.core.frames import Vector
from flownav.vehicle.multirotor_parameters import MultirotorParameters
from flownav.vehicle.parameters import VehicleParameters


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
