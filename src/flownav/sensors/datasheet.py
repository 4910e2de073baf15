"""The flow sensor's file: dynamics, noise against height, limits and optics, in TOML, and what is built from it.

`identify` writes such a file, and simulation, replay and campaigns read it. `px4flow_paper.toml` ships: the
sensor of the paper, with the 28 models of its Table 1.
"""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationInfo, field_validator

from flownav.core.errors import InputError
from flownav.core.parameter_files import Number, ParameterModel, load, shipped
from flownav.sensors import flow
from flownav.sensors.flow import FlowParameters
from flownav.sensors.noise_law import Law, NoiseFit, accuracy_law, constant_noise, fit_noise_law, power_law
from flownav.sensors.processes import second_order_hold

DEFAULT_SENSOR = "px4flow_paper.toml"


class Dynamics(ParameterModel):
    """G(s) = a/(s^2 + b s + c), velocity to velocity."""

    a_1_s2: Number = Field(gt=0.0, le=1e7)
    b_1_s: Number = Field(gt=0.0, le=1e4)
    c_1_s2: Number = Field(gt=0.0, le=1e7)

    @property
    def gain(self) -> float:
        """Reported over true velocity at rest: a/c."""
        return self.a_1_s2 / self.c_1_s2

    @property
    def delay_s(self) -> float:
        """Delay of a slow signal: b/c."""
        return self.b_1_s / self.c_1_s2

    @property
    def natural_frequency_rad_s(self) -> float:
        """sqrt(c)."""
        return math.sqrt(self.c_1_s2)

    @property
    def damping_ratio(self) -> float:
        """b/(2 sqrt(c))."""
        return 0.5 * self.b_1_s / self.natural_frequency_rad_s


class IdentifiedModel(Dynamics):
    """One row of a table of identified models."""

    height_m: Number = Field(gt=0.0, le=1000.0)
    model: int = Field(ge=1)
    fit_percent: Number = Field(le=100.0)


class Noise(ParameterModel):
    """Standard deviation of a published velocity against height (`noise_law.py`); the law picks its keys."""

    law: Literal["constant", "power", "accuracy"]
    sigma_m_s: Number | None = Field(None, ge=0.0, le=100.0, validate_default=True)
    reference_height_m: Number = Field(0.6, gt=0.0, le=1000.0)
    exponent: Number = Field(1.0, ge=-4.0, le=4.0)
    accuracy: Number = Field(0.9, gt=0.0, lt=1.0)
    signal_sigma_m_s: Number | None = Field(None, gt=0.0, le=100.0, validate_default=True)
    floor_m_s: Number = Field(0.0, ge=0.0, le=100.0)
    min_height_m: Number = Field(gt=0.0, le=1000.0)
    max_height_m: Number = Field(gt=0.0, le=1000.0)

    @field_validator("sigma_m_s", "signal_sigma_m_s")
    @classmethod
    def _scale_is_given(cls, value: float | None, info: ValidationInfo) -> float | None:
        law = info.data.get("law")
        needed = "signal_sigma_m_s" if law == "accuracy" else "sigma_m_s"
        if law is not None and value is None and info.field_name == needed:
            raise ValueError(f'law = "{law}" needs this key')
        return value

    @field_validator("max_height_m")
    @classmethod
    def _law_holds(cls, value: float, info: ValidationInfo) -> float:
        """Above the lower height, and the law can be evaluated between the two (checked if all else is right)."""
        value = _not_below("min_height_m", value, info)
        if set(info.data) | {"max_height_m"} == set(cls.model_fields):
            cls.model_construct(**info.data, max_height_m=value).fit()
        return value

    def fit(self) -> NoiseFit:
        """The law as the equations evaluate it, without its floor. ValueError as `fit_noise_law`."""
        return _fitted(self)

    def curve(self) -> Law:
        """The law that varies with height: heights [m] to standard deviations [m/s]."""
        if self.law == "accuracy":
            return accuracy_law(self.accuracy, self.reference_height_m, self.signal_sigma_m_s or 0.0)
        return power_law(self.sigma_m_s or 0.0, self.reference_height_m, self.exponent)


@lru_cache(maxsize=64)
def _fitted(noise: Noise) -> NoiseFit:
    """The law's fit, which many flights of one sensor share."""
    if noise.law == "constant":
        return constant_noise(noise.sigma_m_s or 0.0, noise.min_height_m, noise.max_height_m)
    return fit_noise_law(noise.curve(), noise.min_height_m, noise.max_height_m)


class Limits(ParameterModel):
    """Where the sensor measures. `hysteresis` is the fraction inside each limit that it takes to engage."""

    min_height_m: Number = Field(ge=0.0, le=1000.0)
    max_height_m: Number = Field(gt=0.0, le=1000.0)
    max_flow_rad_s: Number = Field(gt=0.0, le=100.0)
    max_tilt_deg: Number = Field(gt=0.0, lt=84.0)
    hysteresis: Number = Field(0.05, ge=0.0, lt=0.5)

    @field_validator("max_height_m")
    @classmethod
    def _above(cls, value: float, info: ValidationInfo) -> float:
        return _not_below("min_height_m", value, info)


class Optics(ParameterModel):
    """The square image that the pattern must fill."""

    focal_length_px: Number = Field(gt=0.0, le=1e6)
    image_side_px: Number = Field(gt=0.0, le=1e6)

    @property
    def half_fov_tangent(self) -> float:
        """Half the image's side over the focal length."""
        return 0.5 * self.image_side_px / self.focal_length_px


class LogSource(ParameterModel):
    """A file that the sensor was identified from."""

    path: str
    sha256: str


class IdentifiedResponse(ParameterModel):
    """Gain and latency of one axis at one height with their 95 % intervals, and how good the model is.

    validation_percent: fit on runs that the model has not seen, their mean.
    """

    axis: Literal["x", "y"]
    height_m: Number = Field(gt=0.0, le=1000.0)
    gain: Number
    gain_low: Number
    gain_high: Number
    latency_s: Number
    latency_low_s: Number
    latency_high_s: Number
    order: str
    fit_percent: Number = Field(le=100.0)
    validation_percent: Number | None = Field(None, le=100.0)
    residual_sigma_m_s: Number = Field(ge=0.0)
    residuals_white: bool
    runs: int = Field(ge=1)
    readings: int = Field(ge=1)


class NoiseAtHeight(ParameterModel):
    """Standard deviation of the error about one height."""

    height_m: Number = Field(gt=0.0, le=1000.0)
    sigma_m_s: Number = Field(ge=0.0)
    readings: int = Field(ge=1)


class QualityVariance(ParameterModel):
    """Error variance of readings whose quality lies from quality_low to quality_high."""

    quality_low: int = Field(ge=0, le=255)
    quality_high: int = Field(ge=0, le=255)
    variance_m2_s2: Number = Field(ge=0.0)
    readings: int = Field(ge=1)


class DynamicsInterval(ParameterModel):
    """95 % intervals of the dynamics. `validity`: "identified", or "assumed" where only gain and latency are."""

    validity: Literal["identified", "assumed"]
    note: str
    a_low_1_s2: Number | None = None
    a_high_1_s2: Number | None = None
    b_low_1_s: Number | None = None
    b_high_1_s: Number | None = None
    c_low_1_s2: Number | None = None
    c_high_1_s2: Number | None = None


class Identification(ParameterModel):
    """Where an identified sensor's figures come from; nothing that simulation needs, everything that judges it."""

    kind: Literal["rig", "flight"]
    reference: str
    axes: str
    verdict: str
    parameters: int = Field(ge=1)
    identifiable: int = Field(ge=0)
    gain: Number
    gain_low: Number
    gain_high: Number
    latency_s: Number
    latency_low_s: Number
    latency_high_s: Number
    lowest_height_m: Number = Field(ge=0.0)
    highest_height_m: Number = Field(gt=0.0)
    fastest_flow_rad_s: Number = Field(ge=0.0)
    least_quality: int = Field(ge=0, le=255)
    noise_exponent_low: Number
    noise_exponent_high: Number
    dynamics: DynamicsInterval
    responses: tuple[IdentifiedResponse, ...]
    noise: tuple[NoiseAtHeight, ...]
    quality: tuple[QualityVariance, ...] = ()
    notes: tuple[str, ...] = ()
    sources: tuple[LogSource, ...] = ()


class FlowSensor(ParameterModel):
    """A flow sensor's file. `identification` stands in those that `flownav identify` wrote."""

    schema_version: Literal[1]
    name: str
    provenance: str
    sonar_floor_m: Number = Field(0.0, ge=0.0, le=10.0)
    dynamics: Dynamics
    noise: Noise
    limits: Limits
    optics: Optics
    identified_models: tuple[IdentifiedModel, ...] = ()
    identification: Identification | None = None

    def with_model(self, height_m: float, model: int) -> FlowSensor:
        """The sensor with the dynamics of one of its identified models. InputError where there is none."""
        for row in self.identified_models:
            if math.isclose(row.height_m, height_m) and row.model == model:
                chosen = Dynamics(a_1_s2=row.a_1_s2, b_1_s=row.b_1_s, c_1_s2=row.c_1_s2)
                return self.model_copy(update={"dynamics": chosen})
        known = ", ".join(f"{row.height_m:g} m model {row.model}" for row in self.identified_models) or "none"
        raise InputError(f"{self.name}: no identified model {model} at {height_m:g} m; it has: {known}")


def _not_below(lower: str, value: float, info: ValidationInfo) -> float:
    if value < info.data.get(lower, 0.0):
        raise ValueError(f"at least {lower} = {info.data[lower]} is needed")
    return value


def load_sensor(path: Path | str | None = None) -> FlowSensor:
    """The sensor of a file; the paper's where `path` is None. InputError names file, key and allowed range."""
    return load(Path(path) if path is not None else shipped(DEFAULT_SENSOR), FlowSensor)


class FlowSettings(ParameterModel):
    """What a scenario says about the flow sensor beside its file: what is switched on, and the shake's mode.

    identified_height_m and identified_model choose a row of the file's identified models instead of its own
    dynamics; constant_noise_m_s replaces its noise law.
    """

    vertical: Literal["synthetic", "sonar"] = "synthetic"
    sonar_overscale: bool = True
    sonar_lag_s: Number = Field(0.0, ge=0.0, le=1.0)
    rotation_leak: Number = Field(0.0, ge=-1.0, le=1.0)
    shake: bool = True
    shake_frequency_hz: Number = Field(4.0, gt=0.0, le=100.0)
    shake_damping_ratio: Number = Field(0.1, gt=0.0, le=2.0)
    shake_horizontal_fraction: Number = Field(0.2, ge=-1.0, le=1.0)
    gain_sigma: Number = Field(0.0, ge=0.0, le=0.5)
    constant_noise_m_s: Number | None = Field(None, ge=0.0, le=100.0)
    identified_height_m: Number | None = Field(None, gt=0.0, le=1000.0)
    identified_model: int | None = Field(None, ge=1, validate_default=True)

    @field_validator("identified_model")
    @classmethod
    def _whole_choice(cls, value: int | None, info: ValidationInfo) -> int | None:
        if (value is None) != (info.data.get("identified_height_m") is None):
            raise ValueError("goes together with identified_height_m; give both or neither")
        return value

    def parameters(self, sensor: FlowSensor) -> FlowParameters:
        """Coefficients at 250 Hz of this sensor under these settings. InputError where the model is unknown."""
        if self.identified_model is not None and self.identified_height_m is not None:
            sensor = sensor.with_model(self.identified_height_m, self.identified_model)
        mode_rad_s = 2.0 * math.pi * self.shake_frequency_hz
        lag = second_order_hold(sensor.dynamics.b_1_s, sensor.dynamics.c_1_s2, flow.PERIOD_S)
        mount = second_order_hold(2.0 * self.shake_damping_ratio * mode_rad_s, mode_rad_s**2, flow.PERIOD_S)
        noise = self._noise(sensor)
        limits = sensor.limits
        engaging_tilt = math.radians(limits.max_tilt_deg * (1.0 - limits.hysteresis))
        return FlowParameters(
            *lag, 1.0 / sensor.dynamics.c_1_s2, sensor.dynamics.a_1_s2,
            *mount, 1.0 / mode_rad_s**2,
            shake_vertical=1.0 if self.shake else 0.0,
            shake_horizontal=self.shake_horizontal_fraction if self.shake else 0.0,
            sonar_floor_m=sensor.sonar_floor_m if self.sonar_overscale else 0.0,
            sonar_lag_s=self.sonar_lag_s,
            rotation_leak=self.rotation_leak,
            vertical_from_sonar=1.0 if self.vertical == "sonar" else 0.0,
            noise_low_m=noise.low_m, noise_high_m=noise.high_m,
            noise_centre=noise.centre, noise_scale=noise.scale,
            **{f"noise_{i}": c for i, c in enumerate(noise.coefficients)},
            noise_floor_m_s=0.0 if self.constant_noise_m_s is not None else sensor.noise.floor_m_s,
            min_height_m=limits.min_height_m,
            max_height_m=limits.max_height_m,
            max_flow_rad_s=limits.max_flow_rad_s,
            min_tilt_cosine=math.cos(math.radians(limits.max_tilt_deg)),
            engaging_tilt_cosine=math.cos(engaging_tilt),
            hysteresis=limits.hysteresis,
            half_fov_tangent=sensor.optics.half_fov_tangent,
        )  # fmt: skip

    def _noise(self, sensor: FlowSensor) -> NoiseFit:
        """The sensor's law, or the constant in its place."""
        if self.constant_noise_m_s is None:
            return sensor.noise.fit()
        return constant_noise(self.constant_noise_m_s, sensor.noise.min_height_m, sensor.noise.max_height_m)
