"""Rotations between the earth frame (NED) and the body frame (FRD), and geodetic to local positions.

Quaternions are Hamilton, body to earth, `(w, x, y, z)`. Euler angles are Z-Y-X (yaw, pitch, roll), radians.
"""

from typing import Any

import numpy as np

from flownav.core.compile import arcsin, arctan2, cos, equation, sin

GRAVITY_M_S2 = 9.80665  # standard gravity
TURN_RAD = 6.283185307179586

Scalar = Any  # a float, a complex number, or an array of them, element by element
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Rotation = tuple[float, float, float, float, float, float, float, float, float]


@equation
def rotation_from_quaternion(w: float, x: float, y: float, z: float) -> Rotation:
    """R_EB (body to earth) row by row, nine scalars; the quaternion has unit length (paper eq. 1, corrected)."""
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


@equation
def to_earth(rotation: Rotation, x: float, y: float, z: float) -> Vector:
    """R_EB [x y z]': a body FRD vector in earth NED."""
    return (
        rotation[0] * x + rotation[1] * y + rotation[2] * z,
        rotation[3] * x + rotation[4] * y + rotation[5] * z,
        rotation[6] * x + rotation[7] * y + rotation[8] * z,
    )


@equation
def to_body(rotation: Rotation, x: float, y: float, z: float) -> Vector:
    """R_EB' [x y z]': an earth NED vector in body FRD."""
    return (
        rotation[0] * x + rotation[3] * y + rotation[6] * z,
        rotation[1] * x + rotation[4] * y + rotation[7] * z,
        rotation[2] * x + rotation[5] * y + rotation[8] * z,
    )


@equation
def heading_cosine_sine(rotation: Rotation) -> tuple[Scalar, Scalar]:
    """Cosine and sine of the heading of body-to-earth `rotation`; not for a nose straight up or down."""
    level = 1.0 / np.sqrt(rotation[0] * rotation[0] + rotation[3] * rotation[3])
    return rotation[0] * level, rotation[3] * level


@equation
def turned_level(x: Scalar, y: Scalar, cosine: Scalar, sine: Scalar) -> tuple[Scalar, Scalar]:
    """(x, y) turned from x towards y by the angle of this cosine and sine: body forward, right to north, east."""
    return cosine * x - sine * y, sine * x + cosine * y


@equation
def quaternion_product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product a b of quaternions `(w, x, y, z)`."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@equation
def conjugate(q: Quaternion) -> Quaternion:
    """The turn back: the inverse of a quaternion of unit length."""
    w, x, y, z = q
    return w, -x, -y, -z


@equation
def of_unit_length(q: Quaternion) -> Quaternion:
    """The quaternion scaled to unit length."""
    w, x, y, z = q
    scale = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    return w * scale, x * scale, y * scale, z * scale


@equation
def turned_about_down(q: Quaternion, angle_rad: Scalar) -> Quaternion:
    """The attitude turned by an angle about the earth's down [rad], clockwise seen from above."""
    return quaternion_product((cos(0.5 * angle_rad), 0.0, 0.0, sin(0.5 * angle_rad)), q)


@equation
def quaternion_rate(w: float, x: float, y: float, z: float, p: float, q: float, r: float) -> Quaternion:
    """dq/dt = q * (0, p, q, r) / 2, body rates [rad/s] (paper eqs. 8-10 without their singularity)."""
    return (
        0.5 * (-x * p - y * q - z * r),
        0.5 * (w * p + y * r - z * q),
        0.5 * (w * q - x * r + z * p),
        0.5 * (w * r + x * q - y * p),
    )


@equation
def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Unit quaternion of Z-Y-X Euler angles [rad]."""
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    cp, sp = cos(0.5 * pitch), sin(0.5 * pitch)
    cy, sy = cos(0.5 * yaw), sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@equation
def euler_from_quaternion(w: float, x: float, y: float, z: float) -> Vector:
    """Roll, pitch, yaw [rad] of a unit quaternion; pitch is held to +-90 degrees."""
    return (
        arctan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        arcsin(min(1.0, max(-1.0, 2.0 * (w * y - x * z)))),
        heading_from_quaternion(w, x, y, z),
    )


@equation
def within_half_turn(angle_rad: float) -> float:
    """The angle less whole turns, from -pi to pi."""
    within: float = angle_rad - TURN_RAD * np.rint(angle_rad / TURN_RAD)
    return within


@equation
def heading_from_quaternion(w: Scalar, x: Scalar, y: Scalar, z: Scalar) -> Scalar:
    """Yaw [rad] of a unit quaternion."""
    return arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))


@equation
def flow_about(axis: int, across_m_s: Scalar, range_m: Scalar) -> Scalar:
    """Angular flow [rad/s] about body x (axis 0), of moving right, or about body y (axis 1), of moving forward."""
    return (-across_m_s if axis == 0 else across_m_s) / range_m


@equation
def angular_flow(
    forward_m_s: Scalar, right_m_s: Scalar, rate_x_rad_s: Scalar, rate_y_rad_s: Scalar, range_m: Scalar
) -> tuple[Scalar, Scalar]:
    """(flow_x, flow_y) [rad/s] of a lens that looks along body z, r = range_m away, at ground that lies still.

    PX4's convention: flow_x = w_x - v / r, flow_y = w_y + u / r.
    """
    return rate_x_rad_s + flow_about(0, right_m_s, range_m), rate_y_rad_s + flow_about(1, forward_m_s, range_m)


@equation
def velocity_from_flow(flow_x: Scalar, flow_y: Scalar, range_m: Scalar) -> tuple[Scalar, Scalar]:
    """Forward and right [m/s] by an angular flow [rad/s] less the vehicle's turning: `angular_flow` turned around."""
    return flow_y * range_m, -flow_x * range_m
