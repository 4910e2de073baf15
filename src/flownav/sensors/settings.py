"""Settings of a scenario file for GPS/INS, flow, rangefinder and pad camera, and the parameters built from it.

Units stand in the keys; every default has a source in `docs/explanation/sensors.md`. `.parameters()` computes
the coefficients that the equations use, so no exponential is left for the flight loop.
"""

import math
from typing import Any, Literal

from pydantic import Field, ValidationInfo, field_validator

from flownav.core.parameter_files import Number, ParameterModel, in_si, record_of
from flownav.sensors import flow, gps_ins
from flownav.sensors.datasheet import FlowSensor
from flownav.sensors.flow import FlowParameters
from flownav.sensors.gps_ins import GpsInsParameters
from flownav.sensors.noise_law import NoiseFit, constant_noise
from flownav.sensors.processes import gauss_markov_coefficients, second_order_hold, steps_per_unit
from flownav.sensors.range_sensor import RangefinderParameters


class GpsInsSettings(ParameterModel):
    """The MIDG. `white`: independent position noise alone. `midg`: the errors that 2 m CEP stands for."""

    model: Literal["white", "midg"] = "midg"  # white: independent noise; midg: errors that last, as 2 m CEP
    white_sigma_m: Number = Field(0.3, ge=0.0, le=100.0)  # white: standard deviation, each axis
    slow_sigma_m: Number = Field(1.5, ge=0.0, le=100.0)  # midg, slow error: standard deviation, north and east
    slow_sigma_down_m: Number = Field(2.2, ge=0.0, le=100.0)  # midg, slow error: standard deviation, down
    slow_tau_s: Number = Field(300.0, ge=0.0, le=1e5)  # midg, slow error: correlation time; 0: white
    fast_sigma_m: Number = Field(0.75, ge=0.0, le=100.0)  # midg, fast error: standard deviation, north and east
    fast_sigma_down_m: Number = Field(1.2, ge=0.0, le=100.0)  # midg, fast error: standard deviation, down
    fast_tau_s: Number = Field(30.0, ge=0.0, le=1e5)  # midg, fast error: correlation time; 0: white
    jitter_sigma_m: Number = Field(0.05, ge=0.0, le=100.0)  # midg, jitter: standard deviation, each axis
    jitter_tau_s: Number = Field(0.3, ge=0.0, le=1e5)  # midg, jitter: correlation time; 0: white
    position_quantum_m: Number = Field(0.01, ge=0.0, le=1.0)  # midg: positions in whole steps of this; 0: none
    velocity_sigma_m_s: Number = Field(0.12, ge=0.0, le=10.0)  # midg, lasting error: standard deviation, each axis
    velocity_tau_s: Number = Field(10.0, ge=0.0, le=1e5)  # midg, lasting error of velocity: correlation time
    velocity_white_m_s: Number = Field(0.02, ge=0.0, le=10.0)  # midg: white noise of velocity, each axis
    velocity_quantum_m_s: Number = Field(0.01, ge=0.0, le=1.0)  # midg: velocities in whole steps of this; 0: none
    tilt_sigma_deg: Number = Field(0.4, ge=0.0, le=10.0)  # midg: error of roll and of pitch, standard deviation
    tilt_tau_s: Number = Field(60.0, ge=0.0, le=1e5)  # midg: its correlation time
    heading_sigma_deg: Number = Field(1.5, ge=0.0, le=30.0)  # midg: error of heading, standard deviation
    heading_tau_s: Number = Field(100.0, ge=0.0, le=1e5)  # midg: its correlation time
    latency_s: Number = Field(gps_ins.PERIOD_S, ge=0.0, le=gps_ins.PERIOD_S)  # midg: age of a reading, 0 or 0.02

    @field_validator("*")
    @classmethod
    def _belongs_to_the_model(cls, value: Any, info: ValidationInfo) -> Any:
        """A key of the model that was not chosen would be ignored: refuse it."""
        if info.field_name == "model":
            return value
        owner = "white" if info.field_name == "white_sigma_m" else "midg"
        if info.data.get("model", owner) != owner:
            raise ValueError(f'belongs to model = "{owner}"; set that or remove the key')
        return value

    @field_validator("latency_s")
    @classmethod
    def _whole_period(cls, value: float) -> float:
        if value not in (0.0, gps_ins.PERIOD_S):
            raise ValueError(f"0 or {gps_ins.PERIOD_S} (one reading at 50 Hz) is needed")
        return value

    @property
    def delay_s(self) -> float:
        """How old a reading is when it arrives."""
        return self.latency_s if self.model == "midg" else 0.0

    @property
    def position_sigma_m(self) -> tuple[float, float, float]:
        """Stationary standard deviation of the position error along north, east and down."""
        if self.model == "white":
            return self.white_sigma_m, self.white_sigma_m, self.white_sigma_m
        horizontal = math.hypot(self.slow_sigma_m, self.fast_sigma_m, self.jitter_sigma_m)
        return horizontal, horizontal, math.hypot(self.slow_sigma_down_m, self.fast_sigma_down_m, self.jitter_sigma_m)

    @property
    def velocity_sigma_total_m_s(self) -> float:
        """Stationary standard deviation of the velocity error of one axis."""
        return math.hypot(self.velocity_sigma_m_s, self.velocity_white_m_s) if self.model == "midg" else 0.0

    def parameters(self) -> GpsInsParameters:
        """Coefficients at 50 Hz."""
        return self._midg() if self.model == "midg" else self._white()

    def _midg(self) -> GpsInsParameters:
        period = gps_ins.PERIOD_S
        slow, fast, jitter, velocity, tilt, heading = (
            gauss_markov_coefficients(tau_s, period)
            for tau_s in (
                self.slow_tau_s, self.fast_tau_s, self.jitter_tau_s,
                self.velocity_tau_s, self.tilt_tau_s, self.heading_tau_s,
            )
        )  # fmt: skip
        return GpsInsParameters(
            *slow, self.slow_sigma_m, self.slow_sigma_down_m,
            *fast, self.fast_sigma_m, self.fast_sigma_down_m,
            *jitter, self.jitter_sigma_m, self.jitter_sigma_m,
            *velocity, self.velocity_sigma_m_s, self.velocity_white_m_s,
            *tilt, math.radians(self.tilt_sigma_deg),
            *heading, math.radians(self.heading_sigma_deg),
            self.position_quantum_m, steps_per_unit(self.position_quantum_m),
            self.velocity_quantum_m_s, steps_per_unit(self.velocity_quantum_m_s),
            1.0 if self.latency_s > 0.0 else 0.0,
        )  # fmt: skip

    def _white(self) -> GpsInsParameters:
        nothing = dict.fromkeys(GpsInsParameters._fields, 0.0)
        white = {"jitter_drive": 1.0, "jitter_sigma_m": self.white_sigma_m, "jitter_sigma_down_m": self.white_sigma_m}
        return GpsInsParameters(**nothing | white)


class FlowSettings(ParameterModel):
    """Settings of a scenario for the flow sensor beyond its file: which effects are switched on, and the shake's mode.

    identified_height_m and identified_model choose a row of the file's identified models instead of its own
    dynamics; constant_noise_m_s replaces its noise law.
    """

    vertical: Literal["synthetic", "sonar"] = "synthetic"  # paper's filter: from the true speed, or the sonar's rate
    sonar_overscale: bool = True  # paper's filter: reads too fast below the sonar's floor
    sonar_lag_s: Number = Field(0.0, ge=0.0, le=1.0)  # paper's filter: age of the range that scales the flow; 0: none
    rotation_leak: Number = Field(0.0, ge=-1.0, le=1.0)  # paper's filter: share of rotation its gyro leaves in; 0: none
    shake: bool = True  # whether the mount shakes when the thrust changes
    shake_frequency_hz: Number = Field(4.0, gt=0.0, le=100.0)  # natural frequency of the mount
    shake_damping_ratio: Number = Field(0.1, gt=0.0, le=2.0)  # of the mount; 1: critical
    shake_horizontal_fraction: Number = Field(0.2, ge=-1.0, le=1.0)  # of the shake, seen as velocity forward and right
    gain_sigma: Number = Field(0.0, ge=0.0, le=0.5)  # without effect; the flow camera's datasheet has [gain] sigma
    constant_noise_m_s: Number | None = Field(None, ge=0.0, le=100.0)  # at every height; none: the file's [noise]
    identified_height_m: Number | None = Field(None, gt=0.0, le=1000.0)  # row of the file's models; none: [dynamics]
    identified_model: int | None = Field(None, ge=1, validate_default=True)  # that row's number at this height

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
        noise, limits = self._noise(sensor), sensor.limits
        numbers = in_si(self) | in_si(limits)
        for name, part in (("lag", lag), ("mount", mount), ("noise", noise)):
            numbers |= {f"{name}_{field}": value for field, value in part._asdict().items()}
        return record_of(
            FlowParameters,
            numbers | {f"noise_{i}": c for i, c in enumerate(noise.coefficients)},
            lag_rest=1.0 / sensor.dynamics.c_1_s2,
            gain=sensor.dynamics.a_1_s2,
            mount_rest=1.0 / mode_rad_s**2,
            shake_vertical=1.0 if self.shake else 0.0,
            shake_horizontal=self.shake_horizontal_fraction if self.shake else 0.0,
            sonar_floor_m=sensor.sonar_floor_m if self.sonar_overscale else 0.0,
            vertical_from_sonar=1.0 if self.vertical == "sonar" else 0.0,
            noise_floor_m_s=0.0 if self.constant_noise_m_s is not None else sensor.noise.floor_m_s,
            min_tilt_cosine=math.cos(math.radians(limits.max_tilt_deg)),
            engaging_tilt_cosine=math.cos(math.radians(limits.max_tilt_deg * (1.0 - limits.hysteresis))),
            half_fov_tangent=sensor.optics.half_fov_tangent,
        )

    def _noise(self, sensor: FlowSensor) -> NoiseFit:
        """The sensor's law, or the constant in its place."""
        if self.constant_noise_m_s is None:
            return sensor.noise.fit()
        return constant_noise(self.constant_noise_m_s, sensor.noise.min_height_m, sensor.noise.max_height_m)


class RangefinderSettings(ParameterModel):
    """The HRLV sonar of the PX4FLOW."""

    floor_m: Number = Field(0.3, ge=0.0, le=10.0)  # what it reads of anything nearer
    ceiling_m: Number = Field(5.0, gt=0.0, le=1000.0, validate_default=True)  # beyond: no echo, and it reads this
    resolution_m: Number = Field(0.001, ge=0.0, le=1.0)  # readings come in whole steps of this; 0: no steps
    sigma_m: Number = Field(0.005, ge=0.0, le=10.0)  # noise of a reading, standard deviation
    stuck_at_m: Number | None = Field(None, ge=0.0, le=1000.0)  # every reading is this; none: it works

    @field_validator("ceiling_m")
    @classmethod
    def _above_the_floor(cls, value: float, info: ValidationInfo) -> float:
        if value <= info.data.get("floor_m", 0.0):
            raise ValueError(f"more than floor_m = {info.data['floor_m']} is needed")
        return value

    def parameters(self) -> RangefinderParameters:
        """Coefficients of one reading."""
        stuck = 0.0 if self.stuck_at_m is None else 1.0
        steps = steps_per_unit(self.resolution_m)
        return record_of(
            RangefinderParameters, in_si(self), steps_per_m=steps, stuck=stuck, stuck_m=self.stuck_at_m or 0.0
        )


class PadFixSettings(ParameterModel):
    """A camera that finds the pad: noise of its angles and distance, and where it works."""

    angle_sigma_rad: Number = Field(0.005, gt=0.0, le=1.0)  # noise across the line of sight, standard deviation
    distance_sigma: Number = Field(0.02, gt=0.0, le=1.0)  # noise of the distance as a part of it, standard deviation
    min_height_m: Number = Field(0.3, ge=0.0, le=100.0)  # of the lens over the pad; lower: not seen
    max_height_m: Number = Field(3.0, gt=0.0, le=100.0)  # of the lens over the pad; higher: not seen
    half_view_deg: Number = Field(30.0, gt=0.0, lt=80.0)  # half the angle of view, forward and to the right
