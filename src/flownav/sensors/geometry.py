"""Where a sensor sits and how it looks: levers, and mountings that are off by small angles.

Levers are body FRD metres from the centre of gravity. A mounting error is three small angles [rad] about the body's
x, y and z by which the sensor's axes are turned against the body's; first order, good to 2e-4 of the vector at a
degree (Titterton, Weston, Strapdown Inertial Navigation Technology, 2nd ed., section 3.6).
"""

from __future__ import annotations

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.core.frames import Rotation, Vector, to_earth


class LensPose(NamedTuple):
    """A lens north and east of the pad's centre and above what it looks at [m], and R_EB of the body it is on."""

    north_m: float
    east_m: float
    height_m: float
    rotation: Rotation


@equation
def lever_velocity(
    rotation: Rotation,
    rate_p_rad_s: float, rate_q_rad_s: float, rate_r_rad_s: float,
    lever_x_m: float, lever_y_m: float, lever_z_m: float,
) -> Vector:  # fmt: skip
    """R_EB (w x l): velocity [m/s, NED] of a point of the body against its centre of gravity."""
    return to_earth(
        rotation,
        rate_q_rad_s * lever_z_m - rate_r_rad_s * lever_y_m,
        rate_r_rad_s * lever_x_m - rate_p_rad_s * lever_z_m,
        rate_p_rad_s * lever_y_m - rate_q_rad_s * lever_x_m,
    )


@equation
def in_turned_axes(x: float, y: float, z: float, about_x: float, about_y: float, about_z: float) -> Vector:
    """A body vector in axes that are turned by small angles: v - theta x v."""
    return (
        x + y * about_z - z * about_y,
        y + z * about_x - x * about_z,
        z + x * about_y - y * about_x,
    )


@equation
def turned_rotation(rotation: Rotation, about_x: float, about_y: float, about_z: float) -> Rotation:
    """R_ES of axes that are turned by small angles in the body: R_EB (I + [theta x])."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = rotation
    return (
        xx + xy * about_z - xz * about_y, xy + xz * about_x - xx * about_z, xz + xx * about_y - xy * about_x,
        yx + yy * about_z - yz * about_y, yy + yz * about_x - yx * about_z, yz + yx * about_y - yy * about_x,
        zx + zy * about_z - zz * about_y, zy + zz * about_x - zx * about_z, zz + zx * about_y - zy * about_x,
    )  # fmt: skip
