"""The datasheet of a rangefinder, and the coefficients that follow from it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

from pydantic import Field, ValidationInfo, field_validator

from flownav.core.parameter_files import Number
from flownav.sensors.chance import level_of
from flownav.sensors.quantisation import steps_per_unit
from flownav.sensors.range_sensor import RangeSensorParameters
from flownav.sensors.sheet import Lever, SensorSheet, Spells


class RangeSensorSheet(SensorSheet):
    """A lidar or a sonar. half_beam_deg: of the cone; max_incidence_deg: beyond which there is no echo."""

    shipped_file: ClassVar[str] = "range_sensor.toml"

    rate_hz: Number = Field(ge=1.0, le=1000.0)
    floor_m: Number = Field(ge=0.0, le=10.0)
    ceiling_m: Number = Field(gt=0.0, le=1000.0)
    half_beam_deg: Number = Field(0.0, ge=0.0, le=45.0)
    max_incidence_deg: Number = Field(60.0, gt=0.0, le=80.0)
    resolution_m: Number = Field(0.0, ge=0.0, le=1.0)
    sigma_m: Number = Field(ge=0.0, le=10.0)
    sigma_percent: Number = Field(0.0, ge=0.0, le=50.0)
    scale_percent: Number = Field(0.0, ge=0.0, le=20.0)
    offset_sigma_m: Number = Field(0.0, ge=0.0, le=1.0)
    echo_share: Number = Field(0.0, ge=0.0, le=1.0)
    near_echo_m: Number = Field(0.3, ge=0.0, le=10.0)
    lost: Spells = Spells()
    held: Spells = Spells()
    stuck_at_m: Number | None = Field(None, ge=0.0, le=1000.0)
    lens: Lever = Lever()

    @field_validator("ceiling_m")
    @classmethod
    def _above_the_floor(cls, value: float, info: ValidationInfo) -> float:
        if value <= info.data.get("floor_m", 0.0):
            raise ValueError(f"more than floor_m = {info.data['floor_m']:g} is needed")
        return value

    def parameters(self) -> RangeSensorParameters:
        """Coefficients of one reading."""
        half_beam = math.radians(self.half_beam_deg)
        return RangeSensorParameters(
            math.cos(half_beam), math.sin(half_beam), math.cos(math.radians(self.max_incidence_deg)),
            self.floor_m, self.ceiling_m, self.resolution_m, steps_per_unit(self.resolution_m),
            0.01 * self.scale_percent, self.offset_sigma_m, self.sigma_m, 0.01 * self.sigma_percent,
            level_of(self.echo_share), self.near_echo_m,
            *self.lost.levels(self.period_s), *self.held.levels(self.period_s),
            0.0 if self.stuck_at_m is None else 1.0, self.stuck_at_m or 0.0,
        )  # fmt: skip


def load_range_sensor_sheet(path: Path | str | None = None) -> RangeSensorSheet:
    """The rangefinder of a file; the shipped one where `path` is None."""
    return RangeSensorSheet.read(path)
