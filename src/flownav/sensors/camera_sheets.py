"""The datasheets of a flow camera and of a camera that finds the pad, and the coefficients that follow from them.

Of flow: what a sensor file (`datasheet.FlowSensor`: dynamics, noise, limits) does not state.
"""

import math
from typing import ClassVar

from pydantic import Field, ValidationInfo, field_validator

from flownav.core.parameter_files import Number, ParameterModel, in_si, more_than, record_of
from flownav.sensors.flow_camera import FlowCameraParameters
from flownav.sensors.pad_camera import PadCameraParameters
from flownav.sensors.processes import level_of
from flownav.sensors.sheet import Lever, SensorSheet, Spells


class Gain(ParameterModel):
    """The gain over the sensor file's, at heights from low to high: its spread, and where it is cut off."""

    sigma: Number = Field(ge=0.0, le=1.0)  # standard deviation at every height, over the file's gain
    lowest: Number = Field(gt=0.0, le=1.0)  # no gain is less
    highest: Number = Field(ge=1.0, le=10.0)  # no gain is more
    low_height_m: Number = Field(gt=0.0, le=1000.0)  # below it the gain stays
    high_height_m: Number = Field(gt=0.0, le=1000.0)  # above it the gain stays

    _above = field_validator("high_height_m")(more_than("low_height_m"))


class CameraGyro(ParameterModel):
    """The gyro on the camera's board; density one-sided, the others one standard deviation."""

    density_deg_s_rthz: Number = Field(ge=0.0, le=100.0)  # white noise, one-sided density
    bias_deg_s: Number = Field(ge=0.0, le=100.0)  # at the start of a flight, standard deviation
    walk_deg_s_rts: Number = Field(ge=0.0, le=100.0)  # random walk of the bias
    scale_percent: Number = Field(ge=0.0, le=50.0)  # error of an axis's scale, standard deviation


class Texture(ParameterModel):
    """The least texture (0 to 1) that it can follow; spells that leave `remaining` of it and multiply the noise."""

    least: Number = Field(0.05, ge=0.0, le=1.0)  # below it nothing is seen; 0: none, 1: full
    low: Spells = Spells()
    remaining: Number = Field(0.3, ge=0.0, le=1.0)  # share of the texture that a low spell leaves
    noise_factor: Number = Field(3.0, ge=1.0, le=100.0)  # times the noise in a low spell


class Quality(ParameterModel):
    """best: low, slow, over good texture; shares of it lost at the sensor file's greatest height and fastest flow."""

    best: Number = Field(ge=1.0, le=255.0)  # when low, slow and over good texture; 255: the most
    lost_at_height: Number = Field(ge=0.0, le=1.0)  # share lost at the sensor file's greatest height
    lost_at_speed: Number = Field(ge=0.0, le=1.0)  # share lost at the sensor file's fastest flow
    sigma: Number = Field(ge=0.0, le=255.0)  # noise of a reading's quality, standard deviation


class Outliers(ParameterModel):
    """Share of the readings that is off by an error of this standard deviation."""

    share: Number = Field(0.0, ge=0.0, le=1.0)  # of the readings, are outliers; 0: none
    sigma_rad_s: Number = Field(1.0, ge=0.0, le=100.0)  # error of an outlier, standard deviation


class FlowCameraSheet(SensorSheet):
    """A flow camera. `exposure_s`: over which it sums image and gyro; `lost_share`: of readings that never arrive."""

    shipped_file: ClassVar[str] = "flow_camera.toml"

    rate_hz: Number = Field(ge=1.0, le=500.0)  # readings a second
    exposure_s: Number = Field(gt=0.0, le=1.0)  # over which it sums image and gyro
    lost_share: Number = Field(0.0, ge=0.0, le=1.0)  # of the readings, never arrive
    misalignment_deg: Number = Field(ge=0.0, le=10.0)  # of the mounting about each axis, standard deviation
    noise_spread: Number = Field(0.0, ge=0.0, le=2.0)  # share by which flights (grounds) differ in the noise; 0: alike
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


class Missed(ParameterModel):
    """Shares of frames in which the pad is not found: low and slow, at the greatest height, at this image rate.

    A share that is worse than low and slow must not be less than that one's.
    """

    share: Number = Field(ge=1e-6, le=0.99)  # missed when low and slow
    share_at_max_height: Number = Field(ge=1e-6, le=0.9999)  # missed at max_height_m, slow
    share_at_blur: Number = Field(ge=1e-6, le=0.9999)  # missed at the image rate blur_rad_s, low
    blur_rad_s: Number = Field(gt=0.0, le=100.0)  # image rate of the ground below, for share_at_blur

    @field_validator("share_at_max_height", "share_at_blur")
    @classmethod
    def _not_better(cls, value: float, info: ValidationInfo) -> float:
        if value < info.data.get("share", 0.0):
            raise ValueError(f"at least share = {info.data['share']:g} is needed")
        return value


class AngleNoise(ParameterModel):
    """Standard deviation of each angle: floor, per metre of height, per rad/s of image rate, added in squares."""

    floor_mrad: Number = Field(ge=0.0, le=1000.0)  # low and slow
    per_m_mrad: Number = Field(0.0, ge=0.0, le=1000.0)  # more with distance squared over height
    per_rad_s_mrad: Number = Field(0.0, ge=0.0, le=1000.0)  # more with the image rate of the ground below


class DistanceNoise(ParameterModel):
    """Standard deviation of the distance as a part of it, likewise."""

    floor_percent: Number = Field(ge=0.0, le=100.0)  # low and slow
    per_m_percent: Number = Field(0.0, ge=0.0, le=100.0)  # more with distance squared over height
    per_rad_s_percent: Number = Field(0.0, ge=0.0, le=100.0)  # more with the image rate of the ground below


class PadCameraSheet(SensorSheet):
    """A camera and its detector, as `flownav pad --out` writes it.

    camera: the name by which `flownav pad` renders its frames. Half angles of view are forward and to the right (the
    same where only one is given); the mark of side `side_m` must be whole in it, or one round it
    that is `ratio` times as large. boresight_deg and scale_percent last a
    flight. hidden_share: of the frames, lost whatever the vehicle does. stated_spread: the share by which the
    accuracies that it states are wrong.
    """

    shipped_file: ClassVar[str] = "pad_camera.toml"

    rate_hz: Number = Field(ge=0.5, le=200.0)  # frames a second
    camera: str = ""
    angle: AngleNoise
    distance: DistanceNoise
    min_height_m: Number = Field(ge=0.0, le=100.0)  # of the lens over the pad; lower: not seen
    max_height_m: Number = Field(gt=0.0, le=100.0)  # greatest distance squared over height that finds the mark
    half_view_deg: Number = Field(gt=0.0, lt=80.0)  # half the view, forward
    half_view_right_deg: Number | None = Field(None, gt=0.0, lt=80.0)  # half the view, right; none: as forward
    side_m: Number = Field(0.0, ge=0.0, le=20.0)  # of the mark, which must be whole in view; 0: its centre
    ratio: Number = Field(1.0, ge=1.0, le=20.0)  # size of a second mark round it over its own; 1: there is none
    boresight_deg: Number = Field(ge=0.0, le=5.0)  # error of the mounting about each axis, standard deviation
    scale_percent: Number = Field(0.0, ge=0.0, le=20.0)  # error of the focal length, standard deviation
    hidden_share: Number = Field(0.0, ge=0.0, le=1.0)
    stated_spread: Number = Field(0.0, ge=0.0, le=2.0)
    missed: Missed
    false_share: Number = Field(0.0, ge=0.0, le=1.0)  # of the frames, take something else for the pad
    lens: Lever = Lever()

    _above = field_validator("max_height_m")(more_than("min_height_m"))

    @property
    def angle_sigma_mrad(self) -> float:
        """Standard deviation of each angle in a hover at 1 m."""
        return math.hypot(self.angle.floor_mrad, self.angle.per_m_mrad)

    @property
    def distance_sigma_percent(self) -> float:
        """Standard deviation of the distance in a hover at 1 m."""
        return math.hypot(self.distance.floor_percent, self.distance.per_m_percent)

    def parameters(self) -> PadCameraParameters:
        """Coefficients of one frame."""
        level = level_of(self.missed.share)
        aside_deg = self.half_view_deg if self.half_view_right_deg is None else self.half_view_right_deg
        return record_of(
            PadCameraParameters,
            in_si(self),
            angle_per_m=1e-3 * self.angle.per_m_mrad,
            angle_per_rad_s=1e-3 * self.angle.per_rad_s_mrad,
            half_view_forward_tangent=math.tan(math.radians(self.half_view_deg)),
            half_view_right_tangent=math.tan(math.radians(aside_deg)),
            missed_above=level,
            missed_by_height=level - level_of(self.missed.share_at_max_height),
            missed_per_rad_s=(level - level_of(self.missed.share_at_blur)) / self.missed.blur_rad_s,
            hidden_above=level_of(self.hidden_share),
            false_above=level_of(self.false_share),
        )
