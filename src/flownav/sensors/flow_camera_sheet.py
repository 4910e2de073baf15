"""The datasheet of a flow camera: what a sensor file (`datasheet.FlowSensor`: dynamics, noise, limits) does not say."""

from __future__ import annotations

import math
from typing import ClassVar

from pydantic import Field, ValidationInfo, field_validator

from flownav.core.parameter_files import Number, ParameterModel, in_si, record_of
from flownav.sensors.flow_camera import FlowCameraParameters
from flownav.sensors.processes import level_of
from flownav.sensors.sheet import Lever, SensorSheet, Spells


class Gain(ParameterModel):
    """The gain over the sensor file's, at heights from low to high: its spread, and where it is cut off."""

    sigma: Number = Field(ge=0.0, le=1.0)
    lowest: Number = Field(gt=0.0, le=1.0)
    highest: Number = Field(ge=1.0, le=10.0)
    low_height_m: Number = Field(gt=0.0, le=1000.0)
    high_height_m: Number = Field(gt=0.0, le=1000.0)

    @field_validator("high_height_m")
    @classmethod
    def _above(cls, value: float, info: ValidationInfo) -> float:
        if value <= info.data.get("low_height_m", 0.0):
            raise ValueError(f"more than low_height_m = {info.data['low_height_m']:g} is needed")
        return value


class CameraGyro(ParameterModel):
    """The gyro on the camera's board; density one-sided, the others one standard deviation."""

    density_deg_s_rthz: Number = Field(ge=0.0, le=100.0)
    bias_deg_s: Number = Field(ge=0.0, le=100.0)
    walk_deg_s_rts: Number = Field(ge=0.0, le=100.0)
    scale_percent: Number = Field(ge=0.0, le=50.0)


class Texture(ParameterModel):
    """The least texture (0 to 1) that it can follow; spells that leave `remaining` of it and multiply the noise."""

    least: Number = Field(0.05, ge=0.0, le=1.0)
    low: Spells = Spells()
    remaining: Number = Field(0.3, ge=0.0, le=1.0)
    noise_factor: Number = Field(3.0, ge=1.0, le=100.0)


class Quality(ParameterModel):
    """best: low, slow, over good texture; shares of it lost at the sensor file's greatest height and fastest flow."""

    best: Number = Field(ge=1.0, le=255.0)
    lost_at_height: Number = Field(ge=0.0, le=1.0)
    lost_at_speed: Number = Field(ge=0.0, le=1.0)
    sigma: Number = Field(ge=0.0, le=255.0)


class Outliers(ParameterModel):
    """What share of the readings is off by an error of this standard deviation."""

    share: Number = Field(0.0, ge=0.0, le=1.0)
    sigma_rad_s: Number = Field(1.0, ge=0.0, le=100.0)


class FlowCameraSheet(SensorSheet):
    """A flow camera. `exposure_s`: over which it sums image and gyro; `lost_share`: of readings that never arrive."""

    shipped_file: ClassVar[str] = "flow_camera.toml"

    rate_hz: Number = Field(ge=1.0, le=500.0)
    exposure_s: Number = Field(gt=0.0, le=1.0)
    lost_share: Number = Field(0.0, ge=0.0, le=1.0)
    misalignment_deg: Number = Field(ge=0.0, le=10.0)
    noise_spread: Number = Field(0.0, ge=0.0, le=2.0)
    gain: Gain
    gyro: CameraGyro
    texture: Texture = Texture()
    quality: Quality
    outliers: Outliers = Outliers()
    lens: Lever = Lever()

    def parameters(self) -> FlowCameraParameters:
        """Coefficients of one reading."""
        low, high = self.gain.low_height_m**0.25, self.gain.high_height_m**0.25
        numbers = in_si(self)
        begins_above, ends_above = self.texture.low.levels(self.period_s)
        return record_of(
            FlowCameraParameters,
            numbers,
            gain_centre=0.5 * (low + high),
            gain_scale=2.0 / (high - low),
            gyro_sigma_rad_s=numbers["gyro_density_rad_s_rthz"] / math.sqrt(2.0 * self.exposure_s),
            gyro_walk_rad_s=numbers["gyro_walk_rad_s_rts"] * math.sqrt(self.period_s),
            low_begins_above=begins_above,
            low_ends_above=ends_above,
            outlier_above=level_of(self.outliers.share),
            lost_above=level_of(self.lost_share),
        )
