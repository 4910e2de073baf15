"""A magnetometer: the place's field in body axes, bent by iron and current.

    b = (I + S) R_EB' b_earth + hard + c P + noise      [gauss, body FRD]

S soft iron, scale errors and misalignment of this unit (3 x 3), `hard` hard iron, c the field per watt of the power
that motor and battery carry (Gebre-Egziabher et al., Calibration of strapdown magnetometers in magnetic field domain,
J. Aerospace Eng. 19(2), 2006; motor current as in ArduPilot's compass-motor calibration). All are what calibration
has left, drawn once a flight.
"""

from __future__ import annotations

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.core.frames import Rotation, to_body


class MagnetometerParameters(NamedTuple):
    """The place's field, and standard deviations: of a reading's noise, and of what differs between units."""

    field_n_gauss: float
    field_e_gauss: float
    field_d_gauss: float
    sigma_gauss: float
    hard_gauss: float
    scale: float
    soft: float  # off the diagonal
    gauss_per_w: float


class MagnetometerUnit(NamedTuple):
    """S row by row, hard iron [gauss], field per watt [gauss/W], and a normal to spare. As normals: one for each."""

    soft_xx: float
    soft_xy: float
    soft_xz: float
    soft_yx: float
    soft_yy: float
    soft_yz: float
    soft_zx: float
    soft_zy: float
    soft_zz: float
    hard_x: float
    hard_y: float
    hard_z: float
    power_x: float
    power_y: float
    power_z: float
    spare: float


class MagnetometerNormals(NamedTuple):
    """Standard normals of one reading."""

    x: float
    y: float
    z: float
    spare: float


class MagnetometerReading(NamedTuple):
    """Field, body FRD; quality is 255 and a reading always arrives (the sensor is wired)."""

    mag_x_gauss: float
    mag_y_gauss: float
    mag_z_gauss: float
    quality: float
    arrived: float


@equation
def draw_magnetometer(n: MagnetometerUnit, p: MagnetometerParameters) -> MagnetometerUnit:
    """This flight's unit in this flight's vehicle."""
    scale, soft, hard, power = p.scale, p.soft, p.hard_gauss, p.gauss_per_w
    return MagnetometerUnit(
        scale * n.soft_xx, soft * n.soft_xy, soft * n.soft_xz,
        soft * n.soft_yx, scale * n.soft_yy, soft * n.soft_yz,
        soft * n.soft_zx, soft * n.soft_zy, scale * n.soft_zz,
        hard * n.hard_x, hard * n.hard_y, hard * n.hard_z,
        power * n.power_x, power * n.power_y, power * n.power_z,
        0.0,
    )  # fmt: skip


@equation
def read_magnetometer(
    unit: MagnetometerUnit, rotation: Rotation, power_w: float, n: MagnetometerNormals, p: MagnetometerParameters
) -> MagnetometerReading:
    """One reading at attitude R_EB while motor and battery carry `power_w`."""
    u = unit
    x, y, z = to_body(rotation, p.field_n_gauss, p.field_e_gauss, p.field_d_gauss)
    return MagnetometerReading(
        x + (u.soft_xx * x + u.soft_xy * y + u.soft_xz * z) + u.hard_x + u.power_x * power_w + p.sigma_gauss * n.x,
        y + (u.soft_yx * x + u.soft_yy * y + u.soft_yz * z) + u.hard_y + u.power_y * power_w + p.sigma_gauss * n.y,
        z + (u.soft_zx * x + u.soft_zy * y + u.soft_zz * z) + u.hard_z + u.power_z * power_w + p.sigma_gauss * n.z,
        255.0,
        1.0,
    )
