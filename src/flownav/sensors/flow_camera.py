"""A flow camera with its own gyro: angular flow as vehicles report it, and how little of it is to be believed.

PX4's sensor convention (ECL's optical-flow fusion; MAVLink OPTICAL_FLOW_RAD), r the distance along the boresight:

    flow_x = w_x - v_y/r,   flow_y = w_y + v_x/r

v is the lens's velocity, body FRD, as the sensor's identified dynamics make it: `gain * u1`, `gain * v1`, `gain * w1`
of `flow.FlowState`, whose lag stands for the delay of the chain (the sonar's over-scaling belongs to metric sensors and
is switched off there). w are the mean body rates over the exposure. On top of that, in this order:

- the camera is turned against the body by small angles, its gyro with it, so that vertical velocity and yaw leak in;
- the translational part carries a gain that varies smoothly with height and differs from flight to flight (the paper's
  Table 1: 0.75 to 1.30 over 0.6 to 1.5 m); a gain that is not one is also what a wrong focal length makes;
- noise of the sensor file's law, in m/s over the range, more where there is little texture; outliers;
- saturation at the fastest flow that the image search can follow.

**Seeing.** Height and tilt within the sensor file's limits (`flow_engagement.engagement`, with its hysteresis), and
texture; where it cannot see, quality and flow are 0. Texture is the scenario's (1 everywhere, or 1 on the pad and 0
beside it: `pad_texture`); spells of low texture come on their own. **Quality** falls with the square of the height over
the greatest and of the flow over the fastest, by the texture, and it is noisy: it is little evidence on one reading.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, equation, larger, magnitude
from flownav.core.frames import angular_flow
from flownav.sensors.flow import SMALLEST_RANGE_M, FlowParameters, engagement, flow_noise_sigma, pattern_reach
from flownav.sensors.geometry import LensPose, in_turned_axes
from flownav.sensors.processes import factor, spell


class FlowCameraParameters(NamedTuple):
    """Coefficients of one reading."""

    gain_sigma: float
    gain_lowest: float
    gain_highest: float
    gain_centre: float  # s = (h^(1/4) - centre) scale runs from -1 to 1 over the heights of the gain's curve
    gain_scale: float
    noise_spread: float  # share by which flights (grounds) differ in the noise
    misalignment_rad: float  # standard deviation of each angle
    gyro_sigma_rad_s: float
    gyro_bias_rad_s: float
    gyro_walk_rad_s: float
    gyro_scale: float
    texture_least: float
    texture_remaining: float  # what a spell leaves of it
    texture_noise_factor: float  # and makes of the noise
    low_begins_above: float
    low_ends_above: float
    outlier_above: float
    outliers_sigma_rad_s: float
    quality_best: float
    quality_lost_at_height: float  # share of the quality lost at the greatest height
    quality_lost_at_speed: float  # and at the fastest flow
    quality_sigma: float
    lost_above: float


class FlowCameraTruth(NamedTuple):
    """View and motion of the flow camera: the lens's velocity after the dynamics and body rates, body FRD.

    range_m: along the boresight. height_m: of the lens. texture: 0 (none) to 1.
    """

    seen_u_m_s: float
    seen_v_m_s: float
    seen_w_m_s: float
    rate_p_rad_s: float
    rate_q_rad_s: float
    rate_r_rad_s: float
    range_m: float
    height_m: float
    tilt_cosine: float
    texture: float


class FlowCameraUnit(NamedTuple):
    """This unit: the gain's curve, mounting angles [rad], the gyro's scale errors, and its noise
    over the datasheet's. As normals: one for each."""

    gain_0: float
    gain_1: float
    gain_2: float
    gain_3: float
    turned_x: float
    turned_y: float
    turned_z: float
    gyro_scale_x: float
    gyro_scale_y: float
    noise: float


class FlowCameraStartNormals(NamedTuple):
    """Standard normals of a state's start."""

    gyro_bias_x: float
    gyro_bias_y: float


class FlowCameraNormals(NamedTuple):
    """Standard normals of one reading."""

    noise_x: float
    noise_y: float
    gyro_x: float
    gyro_y: float
    walk_x: float
    walk_y: float
    outlier: float
    outlier_x: float
    outlier_y: float
    texture: float
    quality: float
    lost: float


class FlowCameraState(NamedTuple):
    """1 where height and tilt are within the limits, 1 in a spell of low texture, and the gyro's biases [rad/s]."""

    engaged: float
    low_texture: float
    gyro_bias_x: float
    gyro_bias_y: float


class FlowCameraReading(NamedTuple):
    """Angular flow and the camera's own gyro [rad/s], quality 0 (no data) to 255, and 1 where it arrived."""

    flow_x_rad_s: float
    flow_y_rad_s: float
    gyro_x_rad_s: float
    gyro_y_rad_s: float
    quality: float
    arrived: float


@equation
def draw_flow_camera(n: FlowCameraUnit, p: FlowCameraParameters) -> FlowCameraUnit:
    """This flight's unit."""
    return FlowCameraUnit(
        gain_0=p.gain_sigma * n.gain_0,
        gain_1=p.gain_sigma * n.gain_1,
        gain_2=p.gain_sigma * n.gain_2,
        gain_3=p.gain_sigma * n.gain_3,
        turned_x=p.misalignment_rad * n.turned_x,
        turned_y=p.misalignment_rad * n.turned_y,
        turned_z=p.misalignment_rad * n.turned_z,
        gyro_scale_x=p.gyro_scale * n.gyro_scale_x,
        gyro_scale_y=p.gyro_scale * n.gyro_scale_y,
        noise=factor(p.noise_spread, n.noise),
    )


@equation
def start_flow_camera(n: FlowCameraStartNormals, p: FlowCameraParameters) -> FlowCameraState:
    """Not engaged, over texture, with the gyro biases of this flight."""
    return FlowCameraState(0.0, 0.0, p.gyro_bias_rad_s * n.gyro_bias_x, p.gyro_bias_rad_s * n.gyro_bias_y)


@equation
def flow_gain(height_m: float, unit: FlowCameraUnit, p: FlowCameraParameters) -> float:
    """This unit's gain at this height over the datasheet's: 1 + a random smooth curve of the same spread everywhere.

    The curve is a cubic in s of Legendre polynomials with independent weights, divided by the root of the sum of
    their squares, so that its standard deviation is `gain_sigma` at every height and near heights go together.
    """
    root = np.sqrt(np.sqrt(larger(height_m, 0.0)))
    s = clamp((root - p.gain_centre) * p.gain_scale, -1.0, 1.0)
    second = 1.5 * s * s - 0.5
    third = s * (2.5 * s * s - 1.5)
    size = np.sqrt(1.0 + s * s + second * second + third * third)
    curve = unit.gain_0 + s * unit.gain_1 + second * unit.gain_2 + third * unit.gain_3
    return clamp(1.0 + curve / size, p.gain_lowest, p.gain_highest)


@equation
def pad_texture(lens: LensPose, pad_half_size_m: float, flow: FlowParameters) -> float:
    """1 where a pad with its centre at the origin fills the image, else 0: texture where only the pad has any."""
    return 1.0 if pattern_reach(lens, flow.half_fov_tangent) <= pad_half_size_m else 0.0


@equation
def _next_state(
    s: FlowCameraState, truth: FlowCameraTruth, n: FlowCameraNormals, flow: FlowParameters, p: FlowCameraParameters
) -> FlowCameraState:
    """Limits judged anew, texture and biases one reading on."""
    return FlowCameraState(
        engagement(s.engaged, truth.height_m, truth.tilt_cosine, 0.0, 0.0, 0.0, 0.0, flow),
        spell(s.low_texture, n.texture, p.low_begins_above, p.low_ends_above),
        s.gyro_bias_x + p.gyro_walk_rad_s * n.walk_x,
        s.gyro_bias_y + p.gyro_walk_rad_s * n.walk_y,
    )


@equation
def _quality(texture: float, height_share: float, flow_share: float, normal: float, p: FlowCameraParameters) -> float:
    """A whole number from 1 to 255: what texture, height and speed leave of the best, and noise."""
    at_height = 1.0 - p.quality_lost_at_height * height_share * height_share
    at_speed = 1.0 - p.quality_lost_at_speed * flow_share * flow_share
    quality: float = np.rint(
        clamp(p.quality_best * texture * at_height * at_speed + p.quality_sigma * normal, 1.0, 255.0)
    )
    return quality


@equation
def step_flow_camera(
    state: FlowCameraState,
    unit: FlowCameraUnit,
    truth: FlowCameraTruth,
    n: FlowCameraNormals,
    flow: FlowParameters,
    p: FlowCameraParameters,
) -> tuple[FlowCameraState, FlowCameraReading]:
    """One reading. `flow`: the sensor file's noise and limits."""
    s = _next_state(state, truth, n, flow, p)
    rate_x, rate_y, _ = in_turned_axes(
        truth.rate_p_rad_s, truth.rate_q_rad_s, truth.rate_r_rad_s, unit.turned_x, unit.turned_y, unit.turned_z
    )
    vel_x, vel_y, _ = in_turned_axes(
        truth.seen_u_m_s, truth.seen_v_m_s, truth.seen_w_m_s, unit.turned_x, unit.turned_y, unit.turned_z
    )
    low = s.low_texture > 0.5
    texture = truth.texture * (p.texture_remaining if low else 1.0)
    per_m = 1.0 / larger(truth.range_m, SMALLEST_RANGE_M)
    gain = flow_gain(truth.height_m, unit, p)
    sigma = unit.noise * flow_noise_sigma(truth.height_m, flow) * per_m * (p.texture_noise_factor if low else 1.0)
    stray = p.outliers_sigma_rad_s if n.outlier > p.outlier_above else 0.0
    # the velocity is over the range already: what is seen from a metre away
    flow_x, flow_y = angular_flow(gain * vel_x * per_m, gain * vel_y * per_m, rate_x, rate_y, 1.0)
    flow_x, flow_y = (
        flow_x + sigma * n.noise_x + stray * n.outlier_x,
        flow_y + sigma * n.noise_y + stray * n.outlier_y,
    )
    fastest = flow.max_flow_rad_s
    sees = (s.engaged > 0.5) & (texture >= p.texture_least)
    height_share = clamp(truth.height_m / flow.max_height_m, 0.0, 1.0)
    flow_share = clamp(larger(magnitude(flow_x), magnitude(flow_y)) / fastest, 0.0, 1.0)
    return s, FlowCameraReading(
        clamp(flow_x, -fastest, fastest) if sees else 0.0,
        clamp(flow_y, -fastest, fastest) if sees else 0.0,
        rate_x + (unit.gyro_scale_x * rate_x + s.gyro_bias_x + p.gyro_sigma_rad_s * n.gyro_x),
        rate_y + (unit.gyro_scale_y * rate_y + s.gyro_bias_y + p.gyro_sigma_rad_s * n.gyro_y),
        _quality(texture, height_share, flow_share, n.quality, p) if sees else 0.0,
        0.0 if n.lost > p.lost_above else 1.0,
    )
