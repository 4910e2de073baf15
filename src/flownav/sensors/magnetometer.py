"""A magnetometer: the place's field in body axes, bent by iron and current.

    b = (I + S) R_EB' b_earth + hard + c P + noise      [gauss, body FRD]

S soft iron, scale errors and misalignment of this unit (3 x 3), `hard` hard iron, c the field per watt of the power
that motor and battery carry (Gebre-Egziabher et al., Calibration of strapdown magnetometers in magnetic field domain,
J. Aerospace Eng. 19(2), 2006; motor current as in ArduPilot's compass-motor calibration). All are what calibration
has left, drawn once a flight.
"""

import math
from functools import cache
from typing import ClassVar, NamedTuple

from pydantic import Field

from flownav.core.compile import equation
from flownav.core.frames import Rotation, to_body
from flownav.core.parameter_files import Number, ParameterModel, in_si, record_of
from flownav.sensors.sheet import SensorSheet


class MagnetometerParameters(NamedTuple):
    """The place's field, and standard deviations: of a reading's noise, and of what differs between units."""

    field_n_gauss: float
    field_e_gauss: float
    field_d_gauss: float
    sigma_gauss: float
    hard_iron_gauss: float
    scale: float
    soft_iron: float  # off the diagonal
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
    scale, soft, hard, power = p.scale, p.soft_iron, p.hard_iron_gauss, p.gauss_per_w
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


SHARJAH_GAUSS = 0.4455  # World Magnetic Model 2025 at 25.31 N, 55.49 E, mid-2025
SHARJAH_DECLINATION_DEG = 2.2
SHARJAH_INCLINATION_DEG = 40.0


class MagneticField(ParameterModel):
    """The earth's field at a place; inclination downwards. The default is Sharjah's, the paper's place."""

    strength_gauss: Number = Field(SHARJAH_GAUSS, gt=0.0, le=1.0)  # of the whole field
    declination_deg: Number = Field(SHARJAH_DECLINATION_DEG, ge=-180.0, le=180.0)  # of magnetic north; positive: east
    inclination_deg: Number = Field(SHARJAH_INCLINATION_DEG, ge=-90.0, le=90.0)  # positive: it points into the ground

    @property
    def ned_gauss(self) -> tuple[float, float, float]:
        """North, east, down."""
        dip, east = math.radians(self.inclination_deg), math.radians(self.declination_deg)
        level = self.strength_gauss * math.cos(dip)
        return level * math.cos(east), level * math.sin(east), self.strength_gauss * math.sin(dip)


class MagnetometerSheet(SensorSheet):
    """A magnetometer where it is fitted, after calibration: each figure one standard deviation of an axis."""

    shipped_file: ClassVar[str] = "magnetometer.toml"

    rate_hz: Number = Field(ge=1.0, le=1000.0)  # readings a second
    sigma_mgauss: Number = Field(ge=0.0, le=100.0)  # noise of a reading, each axis
    hard_iron_mgauss: Number = Field(ge=0.0, le=1000.0)  # constant field of the vehicle itself, each axis
    scale_percent: Number = Field(ge=0.0, le=50.0)  # error of an axis's scale
    soft_iron_percent: Number = Field(ge=0.0, le=50.0)  # what an axis reads of each other one's field
    current_mgauss_per_kw: Number = Field(0.0, ge=0.0, le=1000.0)  # field of the motor's current, each axis

    def parameters(self, field: MagneticField) -> MagnetometerParameters:
        """Coefficients of one reading at a place."""
        north, east, down = field.ned_gauss
        return record_of(
            MagnetometerParameters, in_si(self), field_n_gauss=north, field_e_gauss=east, field_d_gauss=down,
            gauss_per_w=1e-6 * self.current_mgauss_per_kw,
        )  # fmt: skip


MODEL_YEAR = 2026.0  # declination changes by less than 0.3 deg a year; logs seldom state their year
COARSE_DEG = 0.1


def declination_rad(origin_deg_m: tuple[float, float, float] | None) -> float:
    """Heading of magnetic north at latitude, longitude [deg], altitude [m], clockwise from true north [rad].

    0 where there is no origin, or the needle does not know (at the poles).
    """
    if origin_deg_m is None or not all(math.isfinite(value) for value in origin_deg_m):
        return 0.0
    latitude, longitude, _ = origin_deg_m
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        return 0.0
    return _declination_rad(round(latitude / COARSE_DEG), round(longitude / COARSE_DEG))


@cache
def _declination_rad(latitude_steps: int, longitude_steps: int) -> float:
    from pygeomag import GeoMag

    field = GeoMag().calculate(
        glat=latitude_steps * COARSE_DEG, glon=longitude_steps * COARSE_DEG, alt=0.0, time=MODEL_YEAR
    )
    declination = math.radians(float(field.d))
    return declination if math.isfinite(declination) else 0.0
