"""The inertial sensors inside the MIDG (paper Table 4), which no flight has aboard: bandwidth, noise, biases, range.

Each axis is a first-order filter of bandwidth f_3dB whose input is the truth and white noise of the published
density N (one-sided, unit/sqrt(Hz)). The filtered noise has the standard deviation N sqrt(pi/2 f_3dB): 0.28 deg/s
and 0.0082 m/s^2. Truth and noise share the pole, hence one state an axis, advanced once a reading: exactly for the
noise, and for a truth that is held over the period, which is why its mean over the period is the best to hand in.
A bias is constant from the start of the flight plus a random walk. Readings stop at the range. Non-linearity (0.1
and 0.3 % of full scale) is not modelled.

Body FRD; gyro [rad/s], specific force (all forces but gravity, over mass) [m/s^2].
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pydantic import Field

from flownav.core.compile import clamp, equation
from flownav.core.frames import GRAVITY_M_S2 as STANDARD_GRAVITY_M_S2
from flownav.core.parameter_files import Number, ParameterModel
from flownav.sensors.inertial import ImuReading
from flownav.sensors.processes import gauss_markov, gauss_markov_coefficients

PERIOD_S = 0.02


class ImuParameters(NamedTuple):
    """Coefficients of one period."""

    decay: float  # exp(-2 pi f_3dB period)
    drive: float  # sqrt(1 - decay^2)
    gyro_sigma_rad_s: float  # of the filtered noise
    gyro_bias_rad_s: float  # standard deviation of the bias at the start
    gyro_walk_rad_s: float  # standard deviation of one step of the bias
    gyro_range_rad_s: float
    accel_sigma_m_s2: float
    accel_bias_m_s2: float
    accel_walk_m_s2: float
    accel_range_m_s2: float


class ImuNormals(NamedTuple):
    """Standard normals of one reading, noise and bias of each axis; the start of a flight takes the same set."""

    gyro_x: float
    gyro_y: float
    gyro_z: float
    accel_x: float
    accel_y: float
    accel_z: float
    gyro_bias_x: float
    gyro_bias_y: float
    gyro_bias_z: float
    accel_bias_x: float
    accel_bias_y: float
    accel_bias_z: float


class ImuState(NamedTuple):
    """Filter output (truth and noise) and bias of each axis; rad/s and m/s^2."""

    gyro_x: float
    gyro_y: float
    gyro_z: float
    accel_x: float
    accel_y: float
    accel_z: float
    gyro_bias_x: float
    gyro_bias_y: float
    gyro_bias_z: float
    accel_bias_x: float
    accel_bias_y: float
    accel_bias_z: float


@equation
def start_imu(truth: ImuReading, n: ImuNormals, p: ImuParameters) -> ImuState:
    """Filters settled on the truth with stationary noise, and the biases of this flight."""
    return ImuState(
        gyro_x=truth.gyro_x_rad_s + p.gyro_sigma_rad_s * n.gyro_x,
        gyro_y=truth.gyro_y_rad_s + p.gyro_sigma_rad_s * n.gyro_y,
        gyro_z=truth.gyro_z_rad_s + p.gyro_sigma_rad_s * n.gyro_z,
        accel_x=truth.accel_x_m_s2 + p.accel_sigma_m_s2 * n.accel_x,
        accel_y=truth.accel_y_m_s2 + p.accel_sigma_m_s2 * n.accel_y,
        accel_z=truth.accel_z_m_s2 + p.accel_sigma_m_s2 * n.accel_z,
        gyro_bias_x=p.gyro_bias_rad_s * n.gyro_bias_x,
        gyro_bias_y=p.gyro_bias_rad_s * n.gyro_bias_y,
        gyro_bias_z=p.gyro_bias_rad_s * n.gyro_bias_z,
        accel_bias_x=p.accel_bias_m_s2 * n.accel_bias_x,
        accel_bias_y=p.accel_bias_m_s2 * n.accel_bias_y,
        accel_bias_z=p.accel_bias_m_s2 * n.accel_bias_z,
    )


@equation
def _filtered(before: float, truth: float, sigma: float, normal: float, p: ImuParameters) -> float:
    """First-order filter of truth and white noise; `sigma` is that of the filtered noise."""
    return gauss_markov(before, p.decay, p.drive * sigma, normal) + (1.0 - p.decay) * truth


@equation
def step_imu(state: ImuState, truth: ImuReading, n: ImuNormals, p: ImuParameters) -> tuple[ImuState, ImuReading]:
    """One period (50 Hz), `truth` standing for the whole of it; the reading at its end."""
    s = ImuState(
        gyro_x=_filtered(state.gyro_x, truth.gyro_x_rad_s, p.gyro_sigma_rad_s, n.gyro_x, p),
        gyro_y=_filtered(state.gyro_y, truth.gyro_y_rad_s, p.gyro_sigma_rad_s, n.gyro_y, p),
        gyro_z=_filtered(state.gyro_z, truth.gyro_z_rad_s, p.gyro_sigma_rad_s, n.gyro_z, p),
        accel_x=_filtered(state.accel_x, truth.accel_x_m_s2, p.accel_sigma_m_s2, n.accel_x, p),
        accel_y=_filtered(state.accel_y, truth.accel_y_m_s2, p.accel_sigma_m_s2, n.accel_y, p),
        accel_z=_filtered(state.accel_z, truth.accel_z_m_s2, p.accel_sigma_m_s2, n.accel_z, p),
        gyro_bias_x=state.gyro_bias_x + p.gyro_walk_rad_s * n.gyro_bias_x,
        gyro_bias_y=state.gyro_bias_y + p.gyro_walk_rad_s * n.gyro_bias_y,
        gyro_bias_z=state.gyro_bias_z + p.gyro_walk_rad_s * n.gyro_bias_z,
        accel_bias_x=state.accel_bias_x + p.accel_walk_m_s2 * n.accel_bias_x,
        accel_bias_y=state.accel_bias_y + p.accel_walk_m_s2 * n.accel_bias_y,
        accel_bias_z=state.accel_bias_z + p.accel_walk_m_s2 * n.accel_bias_z,
    )
    gyro, accel = p.gyro_range_rad_s, p.accel_range_m_s2
    reading = ImuReading(
        gyro_x_rad_s=clamp(s.gyro_x + s.gyro_bias_x, -gyro, gyro),
        gyro_y_rad_s=clamp(s.gyro_y + s.gyro_bias_y, -gyro, gyro),
        gyro_z_rad_s=clamp(s.gyro_z + s.gyro_bias_z, -gyro, gyro),
        accel_x_m_s2=clamp(s.accel_x + s.accel_bias_x, -accel, accel),
        accel_y_m_s2=clamp(s.accel_y + s.accel_bias_y, -accel, accel),
        accel_z_m_s2=clamp(s.accel_z + s.accel_bias_z, -accel, accel),
    )
    return s, reading


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
        decay, drive = gauss_markov_coefficients(tau_s, PERIOD_S)
        rt_period = math.sqrt(PERIOD_S)
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
