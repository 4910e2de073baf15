"""The datasheet of a magnetometer, the field of a place, and the coefficients that follow from both."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

from pydantic import Field

from flownav.core.parameter_files import Number, ParameterModel
from flownav.sensors.magnetometer import MagnetometerParameters
from flownav.sensors.sheet import SensorSheet

SHARJAH_GAUSS = 0.4455  # World Magnetic Model 2025 at 25.31 N, 55.49 E, mid-2025
SHARJAH_DECLINATION_DEG = 2.2
SHARJAH_INCLINATION_DEG = 40.0


class MagneticField(ParameterModel):
    """The earth's field at a place; inclination downwards. The default is Sharjah's, the paper's place."""

    strength_gauss: Number = Field(SHARJAH_GAUSS, gt=0.0, le=1.0)
    declination_deg: Number = Field(SHARJAH_DECLINATION_DEG, ge=-180.0, le=180.0)
    inclination_deg: Number = Field(SHARJAH_INCLINATION_DEG, ge=-90.0, le=90.0)

    @property
    def ned_gauss(self) -> tuple[float, float, float]:
        """North, east, down."""
        dip, east = math.radians(self.inclination_deg), math.radians(self.declination_deg)
        level = self.strength_gauss * math.cos(dip)
        return level * math.cos(east), level * math.sin(east), self.strength_gauss * math.sin(dip)


class MagnetometerSheet(SensorSheet):
    """A magnetometer where it is fitted, after calibration: each figure one standard deviation of an axis."""

    shipped_file: ClassVar[str] = "magnetometer.toml"

    rate_hz: Number = Field(ge=1.0, le=1000.0)
    sigma_mgauss: Number = Field(ge=0.0, le=100.0)
    hard_iron_mgauss: Number = Field(ge=0.0, le=1000.0)
    scale_percent: Number = Field(ge=0.0, le=50.0)
    soft_iron_percent: Number = Field(ge=0.0, le=50.0)
    current_mgauss_per_kw: Number = Field(0.0, ge=0.0, le=1000.0)

    def parameters(self, field: MagneticField) -> MagnetometerParameters:
        """Coefficients of one reading at a place."""
        return MagnetometerParameters(
            *field.ned_gauss,
            sigma_gauss=1e-3 * self.sigma_mgauss,
            hard_gauss=1e-3 * self.hard_iron_mgauss,
            scale=0.01 * self.scale_percent,
            soft=0.01 * self.soft_iron_percent,
            gauss_per_w=1e-6 * self.current_mgauss_per_kw,
        )


def load_magnetometer_sheet(path: Path | str | None = None) -> MagnetometerSheet:
    """The magnetometer of a file; the shipped one where `path` is None."""
    return MagnetometerSheet.read(path)
