"""What a scenario file may say about GPS/INS, rangefinder and IMU, and the parameters built from it.

Units stand in the keys; every default has a source in `docs/explanation/sensors.md`. `.parameters()` computes
the coefficients that the equations use, so no exponential is left for the flight loop.
"""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import Field, ValidationInfo, field_validator

from flownav.core.frames import GRAVITY_M_S2 as STANDARD_GRAVITY_M_S2
from flownav.core.parameter_files import Number, ParameterModel
from flownav.sensors import gps_ins, imu
from flownav.sensors.gps_ins import GpsInsParameters
from flownav.sensors.imu import ImuParameters
from flownav.sensors.processes import gauss_markov_coefficients, steps_per_unit
from flownav.sensors.rangefinder import RangefinderParameters

SIGMA_PER_CEP = 1.0 / math.sqrt(2.0 * math.log(2.0))  # one axis of two equal normal ones: 1/1.1774


class GpsInsSettings(ParameterModel):
    """The MIDG. `white`: independent position noise alone. `midg`: the errors that 2 m CEP stands for."""

    model: Literal["white", "midg"] = "midg"
    white_sigma_m: Number = Field(0.3, ge=0.0, le=100.0)
    slow_sigma_m: Number = Field(1.5, ge=0.0, le=100.0)
    slow_sigma_down_m: Number = Field(2.2, ge=0.0, le=100.0)
    slow_tau_s: Number = Field(300.0, ge=0.0, le=1e5)
    fast_sigma_m: Number = Field(0.75, ge=0.0, le=100.0)
    fast_sigma_down_m: Number = Field(1.2, ge=0.0, le=100.0)
    fast_tau_s: Number = Field(30.0, ge=0.0, le=1e5)
    jitter_sigma_m: Number = Field(0.05, ge=0.0, le=100.0)
    jitter_tau_s: Number = Field(0.3, ge=0.0, le=1e5)
    position_quantum_m: Number = Field(0.01, ge=0.0, le=1.0)
    velocity_sigma_m_s: Number = Field(0.12, ge=0.0, le=10.0)
    velocity_tau_s: Number = Field(10.0, ge=0.0, le=1e5)
    velocity_white_m_s: Number = Field(0.02, ge=0.0, le=10.0)
    velocity_quantum_m_s: Number = Field(0.01, ge=0.0, le=1.0)
    tilt_sigma_deg: Number = Field(0.4, ge=0.0, le=10.0)
    tilt_tau_s: Number = Field(60.0, ge=0.0, le=1e5)
    heading_sigma_deg: Number = Field(1.5, ge=0.0, le=30.0)
    heading_tau_s: Number = Field(100.0, ge=0.0, le=1e5)
    latency_s: Number = Field(gps_ins.PERIOD_S, ge=0.0, le=gps_ins.PERIOD_S)

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

    @property
    def horizontal_cep_m(self) -> float:
        """Circular error probable of the horizontal position."""
        return self.position_sigma_m[0] / SIGMA_PER_CEP

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


class RangefinderSettings(ParameterModel):
    """The HRLV sonar of the PX4FLOW."""

    floor_m: Number = Field(0.3, ge=0.0, le=10.0)
    ceiling_m: Number = Field(5.0, gt=0.0, le=1000.0, validate_default=True)
    resolution_m: Number = Field(0.001, ge=0.0, le=1.0)
    sigma_m: Number = Field(0.005, ge=0.0, le=10.0)
    stuck_at_m: Number | None = Field(None, ge=0.0, le=1000.0)

    @field_validator("ceiling_m")
    @classmethod
    def _above_the_floor(cls, value: float, info: ValidationInfo) -> float:
        if value <= info.data.get("floor_m", 0.0):
            raise ValueError(f"more than floor_m = {info.data['floor_m']} is needed")
        return value

    def parameters(self) -> RangefinderParameters:
        """Coefficients of one reading."""
        return RangefinderParameters(
            floor_m=self.floor_m,
            ceiling_m=self.ceiling_m,
            resolution_m=self.resolution_m,
            steps_per_m=steps_per_unit(self.resolution_m),
            sigma_m=self.sigma_m,
            stuck=0.0 if self.stuck_at_m is None else 1.0,
            stuck_m=self.stuck_at_m or 0.0,
        )


class ImuSettings(ParameterModel):
    """The MIDG's gyros and accelerometers: Table 4, and biases that the paper does not print."""

    bandwidth_hz: Number = Field(20.0, gt=0.0, le=10000.0)
    gyro_density_deg_s_rthz: Number = Field(0.05, ge=0.0, le=10.0)
    gyro_bias_deg_s: Number = Field(0.1, ge=0.0, le=100.0)
    gyro_walk_deg_s_rts: Number = Field(0.002, ge=0.0, le=10.0)
    gyro_range_deg_s: Number = Field(300.0, gt=0.0, le=10000.0)
    accel_density_ug_rthz: Number = Field(150.0, ge=0.0, le=1e5)
    accel_bias_mg: Number = Field(2.0, ge=0.0, le=1000.0)
    accel_walk_mg_rts: Number = Field(0.02, ge=0.0, le=1000.0)
    accel_range_g: Number = Field(6.0, gt=0.0, le=1000.0)

    def parameters(self) -> ImuParameters:
        """Coefficients at 50 Hz."""
        tau_s = 1.0 / (2.0 * math.pi * self.bandwidth_hz)
        noise_bandwidth_rthz = math.sqrt(0.5 * math.pi * self.bandwidth_hz)
        decay, drive = gauss_markov_coefficients(tau_s, imu.PERIOD_S)
        rt_period = math.sqrt(imu.PERIOD_S)
        mg_m_s2 = 1e-3 * STANDARD_GRAVITY_M_S2
        return ImuParameters(
            decay=decay,
            drive=drive,
            gyro_sigma_rad_s=math.radians(self.gyro_density_deg_s_rthz) * noise_bandwidth_rthz,
            gyro_bias_rad_s=math.radians(self.gyro_bias_deg_s),
            gyro_walk_rad_s=math.radians(self.gyro_walk_deg_s_rts) * rt_period,
            gyro_range_rad_s=math.radians(self.gyro_range_deg_s),
            accel_sigma_m_s2=1e-3 * mg_m_s2 * self.accel_density_ug_rthz * noise_bandwidth_rthz,
            accel_bias_m_s2=mg_m_s2 * self.accel_bias_mg,
            accel_walk_m_s2=mg_m_s2 * self.accel_walk_mg_rts * rt_period,
            accel_range_m_s2=STANDARD_GRAVITY_M_S2 * self.accel_range_g,
        )


class PadFixSettings(ParameterModel):
    """A camera that finds the pad: noise of its angles and distance, and where it works."""

    angle_sigma_rad: Number = Field(0.005, gt=0.0, le=1.0)
    distance_sigma: Number = Field(0.02, gt=0.0, le=1.0)
    min_height_m: Number = Field(0.3, ge=0.0, le=100.0)
    max_height_m: Number = Field(3.0, gt=0.0, le=100.0)
    half_view_deg: Number = Field(30.0, gt=0.0, lt=80.0)
