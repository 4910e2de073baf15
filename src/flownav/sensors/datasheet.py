"""The flow sensor's file: dynamics, noise against height, limits and optics, in TOML, and what is built from it.

`identify` writes such a file, and simulation, replay and campaigns read it. `px4flow_paper.toml` ships: the
sensor of the paper, with the 28 models of its Table 1.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.core.parameter_files import Number, ParameterModel, load, shipped
from flownav.sensors.noise_law import Noise, not_below

DEFAULT_SENSOR = "px4flow_paper.toml"
UNTURNED = ((1.0, 0.0), (0.0, 1.0))
BAND_HZ = 1.0  # of the closed loop: attitude follows to 5.4 rad/s (`simulation.assemble`), velocity less far
OFFSET_CERTAIN = 1.5  # half-widths of its 95 % interval: an uncertain offset would do more harm than good
DELAY_WITHIN_DEG = 10.0  # a delay stands for dynamics whose phase it follows so well


class Dynamics(ParameterModel):
    """G(s) = a/(s^2 + b s + c), velocity to velocity."""

    a_1_s2: Number = Field(gt=0.0, le=1e7)  # a/c is the gain: reported over true slow velocity
    b_1_s: Number = Field(gt=0.0, le=1e4)  # b/c is the delay of slow motion
    c_1_s2: Number = Field(ge=1e-3, le=1e7)  # square of the natural frequency

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

    height_m: Number = Field(gt=0.0, le=1000.0)  # at which it was identified
    model: int = Field(ge=1)  # its number at this height
    fit_percent: Number = Field(le=100.0)  # of the velocity explained; 100: all, 0: no more than its mean


class Limits(ParameterModel):
    """Where the sensor measures. `hysteresis` is the fraction inside each limit that it takes to engage."""

    min_height_m: Number = Field(ge=0.0, le=1000.0)  # of the lens; lower: it does not measure
    max_height_m: Number = Field(gt=0.0, le=1000.0)  # of the lens; higher: it does not measure
    max_flow_rad_s: Number = Field(gt=0.0, le=100.0)  # of either axis, rotation included; faster: it does not follow
    max_tilt_deg: Number = Field(gt=0.0, lt=84.0)  # of the boresight from straight down
    hysteresis: Number = Field(0.05, ge=0.0, lt=0.5)  # how far inside each limit, as a part of it, it engages

    @field_validator("max_height_m")
    @classmethod
    def _above(cls, value: float, info: ValidationInfo) -> float:
        return not_below("min_height_m", value, info)


class Optics(ParameterModel):
    """The square image that the pattern must fill."""

    focal_length_px: Number = Field(gt=0.0, le=1e6)  # in pixels of the image that flow is found in
    image_side_px: Number = Field(gt=0.0, le=1e6)  # side of the square image

    @property
    def half_fov_tangent(self) -> float:
        """Half the image's side over the focal length."""
        return 0.5 * self.image_side_px / self.focal_length_px


class LogSource(ParameterModel):
    """A file that the sensor was identified from."""

    path: str  # where it lay
    sha256: str  # of its content, hexadecimal


class IdentifiedResponse(ParameterModel):
    """Gain and latency of one axis at one height with their 95 % intervals, and how good the model is.

    validation_percent: fit on runs that the model has not seen, their mean.
    """

    axis: Literal["x", "y"]  # of velocity: x forward, y to the right
    height_m: Number = Field(gt=0.0, le=1000.0)  # at which it was identified
    gain: Number  # reported over true slow velocity
    gain_low: Number  # lower end of its 95 % interval
    gain_high: Number  # upper end of its 95 % interval
    latency_s: Number  # delay of slow motion
    latency_low_s: Number  # lower end of its 95 % interval
    latency_high_s: Number  # upper end of its 95 % interval
    order: str  # of the model; +delay: and a pure delay; delay: nothing but one
    fit_percent: Number = Field(le=100.0)  # of the velocity explained; 100: all, 0: no more than its mean
    validation_percent: Number | None = Field(None, le=100.0)  # mean fit on runs that the model has not seen
    residual_sigma_m_s: Number = Field(ge=0.0)  # standard deviation of what the model leaves over
    residuals_white: bool  # whether no dynamics are left over
    runs: int = Field(ge=1)  # how many
    readings: int = Field(ge=1)  # how many


class NoiseAtHeight(ParameterModel):
    """Standard deviation of the error about one height."""

    height_m: Number = Field(gt=0.0, le=1000.0)  # about which the readings lie
    sigma_m_s: Number = Field(ge=0.0)  # standard deviation of the readings' error
    readings: int = Field(ge=1)  # how many


class QualityVariance(ParameterModel):
    """Error variance of readings whose quality lies from quality_low to quality_high."""

    quality_low: int = Field(ge=0, le=255)  # least quality of these readings, 0 to 255
    quality_high: int = Field(ge=0, le=255)  # greatest quality of these readings, 0 to 255
    variance_m2_s2: Number = Field(ge=0.0)  # of the readings' error
    readings: int = Field(ge=1)  # how many


class DynamicsInterval(ParameterModel):
    """95 % intervals of the dynamics. `validity`: "identified", or "assumed" where only gain and latency are."""

    validity: Literal["identified", "assumed"]  # assumed: only gain and latency are identified
    note: str  # what holds, in words
    a_low_1_s2: Number | None = None  # lower end of the 95 % interval of dynamics.a_1_s2
    a_high_1_s2: Number | None = None  # upper end of the 95 % interval of dynamics.a_1_s2
    b_low_1_s: Number | None = None  # lower end of the 95 % interval of dynamics.b_1_s
    b_high_1_s: Number | None = None  # upper end of the 95 % interval of dynamics.b_1_s
    c_low_1_s2: Number | None = None  # lower end of the 95 % interval of dynamics.c_1_s2
    c_high_1_s2: Number | None = None  # upper end of the 95 % interval of dynamics.c_1_s2


class Identification(ParameterModel):
    """Where an identified sensor's figures come from; nothing that simulation needs, everything that judges it."""

    kind: Literal["rig", "flight"]  # whether a rig or a flight was logged
    reference: str  # what the sensor was compared with
    axes: str  # whether axes are swapped or inverted, in words
    verdict: str  # which parameters the log shows, in words
    parameters: int = Field(ge=1)  # how many the model has
    identifiable: int = Field(ge=0)  # how many of them the log shows
    gain: Number  # reported over true velocity, over all axes and heights
    gain_low: Number  # lower end of its 95 % interval
    gain_high: Number  # upper end of its 95 % interval
    latency_s: Number  # delay of slow motion, over all axes and heights
    latency_low_s: Number  # lower end of its 95 % interval
    latency_high_s: Number  # upper end of its 95 % interval
    offset_x_rad_s: Number | None = None  # of the flow about body x, the axes put right, where nothing moves
    offset_x_low_rad_s: Number | None = None  # lower end of its 95 % interval
    offset_x_high_rad_s: Number | None = None  # upper end of its 95 % interval
    offset_y_rad_s: Number | None = None  # of the flow about body y
    offset_y_low_rad_s: Number | None = None  # lower end of its 95 % interval
    offset_y_high_rad_s: Number | None = None  # upper end of its 95 % interval
    lowest_height_m: Number = Field(ge=0.0)  # of the readings used
    highest_height_m: Number = Field(gt=0.0)  # of the readings used
    fastest_flow_rad_s: Number = Field(ge=0.0)  # of the usable readings (99.9 %)
    least_quality: int = Field(ge=0, le=255)  # of the readings used, 0 to 255
    noise_exponent_low: Number  # lower end of the 95 % interval of noise.exponent
    noise_exponent_high: Number  # upper end of the 95 % interval of noise.exponent
    dynamics: DynamicsInterval
    responses: tuple[IdentifiedResponse, ...]
    noise: tuple[NoiseAtHeight, ...]
    quality: tuple[QualityVariance, ...] = ()
    notes: tuple[str, ...] = ()  # what else was found, a line each
    sources: tuple[LogSource, ...] = ()


class FlowSensor(ParameterModel):
    """A flow sensor's file. `identification` stands in those that `flownav identify` wrote."""

    schema_version: Literal[1]  # of this kind of file; 1
    name: str  # of the sensor
    provenance: str  # where the figures come from
    sonar_floor_m: Number = Field(0.0, ge=0.0, le=10.0)  # nearer it reads this, and velocities too fast; 0: never
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


def load_sensor(path: Path | str | None = None) -> FlowSensor:
    """The sensor of a file; the paper's where `path` is None. InputError names file, key and allowed range."""
    return load(Path(path) if path is not None else shipped(DEFAULT_SENSOR), FlowSensor)


# -- the file's numbers for users of the sensor ---------------------------------------------------------------
class IdentifiedFlow(NamedTuple):
    """Reported over true velocity of each body axis, the age of a reading, and sensor's axes = axes @ vehicle's.

    offset_rad_s: what the flow about x and y, its axes put right, reads where nothing moves.
    """

    gain_u: float
    gain_v: float
    latency_s: float
    axes: tuple[tuple[float, float], tuple[float, float]] = UNTURNED
    offset_rad_s: tuple[float, float] = (0.0, 0.0)


def in_vehicle_axes(value: Array, identified: IdentifiedFlow, *, angular: bool) -> Array:
    """Readings (n, 2 or more) of a sensor that is turned or wired otherwise, in the vehicle's axes, without its offset.

    A sensor's axes are the vehicle's, each with a sign and perhaps swapped, so the way back is the transpose. Angular
    flow and the sensor's own gyro (columns 2 and 3) turn as the velocity (flow_y, -flow_x) does.
    """
    back, value = np.transpose(identified.axes), value.copy()
    for x, y in ((0, 1), (2, 3)) if angular else ((0, 1),):
        if angular:
            forward, right = back @ np.array([value[:, y], -value[:, x]])
            value[:, y], value[:, x] = forward, -right
        else:
            value[:, x], value[:, y] = back @ value[:, [x, y]].T
    if angular and any(identified.offset_rad_s):
        value[:, :2] -= identified.offset_rad_s
    return value


def identified_axes(verdict: str) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Axes by a sensor file's verdict, as sensor's = axes @ vehicle's; None where it does not know."""
    if "unclear" in verdict or "mirrored" in verdict.replace("not mirrored", ""):
        return None
    both = "signs of x and y" in verdict or "both signs" in verdict
    x = -1.0 if both or "sign of x" in verdict else 1.0
    y = -1.0 if both or "sign of y" in verdict else 1.0
    return ((0.0, x), (y, 0.0)) if "swapped" in verdict else ((x, 0.0), (0.0, y))


def phase_off_delay_deg(dynamics: Dynamics, band_hz: float = BAND_HZ) -> float:
    """How far the phase of G(s) = a/(s^2 + b s + c) is at most from that of its delay b/c, from 0 to band_hz [deg].

    Noise beyond the band does not matter: G is taken for what it does to motion that the vehicle makes.
    """
    w = 2.0 * np.pi * np.linspace(0.0, band_hz, 201)
    lag = np.arctan2(dynamics.b_1_s * w, dynamics.c_1_s2 - w * w)
    return float(np.degrees(np.max(np.abs(lag - dynamics.delay_s * w))))


def needs_lag_states(sensor: FlowSensor) -> bool:
    """Whether the sensor's dynamics are more than a delay over the flight's band, and were identified as such."""
    found = sensor.identification
    off = phase_off_delay_deg(sensor.dynamics) > DELAY_WITHIN_DEG
    return off and (found is None or found.dynamics.validity == "identified")


def identified_flow(sensor: FlowSensor, lag_states: bool | None = None) -> IdentifiedFlow:
    """A sensor file's axes, gains and latency; those of its dynamics where no log was identified.

    lag_states: whether the dynamics are states of the filter; by default where the sensor needs it. The latency is then
    without their delay. InputError where the file's axes are not known.
    """
    found = sensor.identification
    lag_states = needs_lag_states(sensor) if lag_states is None else lag_states
    carried_s = sensor.dynamics.delay_s if lag_states else 0.0
    if found is None:
        return IdentifiedFlow(sensor.dynamics.gain, sensor.dynamics.gain, sensor.dynamics.delay_s - carried_s)
    axes = identified_axes(found.axes)
    if axes is None:
        raise InputError(f"{sensor.name}: {found.axes}; mend the log's axes, then identify again")

    def gain_of(axis: str) -> float:
        """The axis' gain, 1 where no height's interval excludes it: an uncertain gain would do more harm than good."""
        rows = [r for r in found.responses if r.axis == axis] or list(found.responses)
        sure = any(not r.gain_low <= 1.0 <= r.gain_high for r in rows)
        return float(np.mean([r.gain for r in rows])) if sure else 1.0

    offset = _certain(found, "x"), _certain(found, "y")
    return IdentifiedFlow(gain_of("x"), gain_of("y"), max(found.latency_s - carried_s, 0.0), axes, offset)


def _certain(found: Identification, axis: str) -> float:
    """The flow's offset about an axis [rad/s] that is taken out; 0 where the file has none."""
    value, low, high = (getattr(found, f"offset_{axis}{end}_rad_s") for end in ("", "_low", "_high"))
    return 0.0 if value is None or low is None or high is None else certain_offset(value, low, high)


def certain_offset(value: float, low: float, high: float) -> float:
    """An offset [rad/s] that is known well enough to be taken out, beyond three standard deviations; else 0."""
    return float(value) if abs(value) > OFFSET_CERTAIN * 0.5 * (high - low) else 0.0
