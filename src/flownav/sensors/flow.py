"""The optical-flow sensor (PX4FLOW) as the paper identified it: a second-order lag, noise by height, limits.

Each velocity channel passes through G(s) = a/(s^2 + b s + c) (paper, section III and Table 1), advanced exactly
at the sensor's 250 Hz with the input held over each 4 ms. Readings are published at 50 Hz with white noise of a
standard deviation that grows with height. What else happens on a real vehicle is switchable by parameters:

- the sonar cannot report less than its floor (0.30 m), and the sensor multiplies flow by the sonar's range, so
  below the floor its velocity is too large by floor/range (MaxBotix, HRLV-MaxSonar-EZ datasheet);
- the sonar's range is old, so the scale is wrong while the height changes, and what the sensor's own gyro does not
  show of a rotation reads as velocity (`misread`; the rig has both, docs/how-to/rig.md);
- changes of rotor thrust shake the sensor on its elastic mount (figure 28): a mode xi'' + 2 zeta w xi' + w^2 xi
  = T/m whose velocity xi' adds to what the sensor sees, ahead of the lag;
- PX4FLOW measures no vertical velocity (finding 10): the third channel is either declared `synthetic` (the same
  lag applied to the true one) or built from the sonar.

Velocities are of the lens, body FRD [m/s]; heights are of the lens above the ground.

Last: when the sensor sees the pattern of the pad and can follow it (`engagement`).
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, equation, larger, magnitude, replacing
from flownav.sensors.geometry import LensPose
from flownav.sensors.processes import SecondOrderHold, hold_step

PERIOD_S = 0.004  # inside the sensor
SMALLEST_RANGE_M = 0.01  # keeps divisions finite when the lens touches the ground
NOISE_DEGREE = 8


class FlowParameters(NamedTuple):
    """Coefficients of one 4 ms period, noise and limits."""

    # a/(s^2 + b s + c): velocity = gain * x1
    lag_f11: float
    lag_f12: float
    lag_f21: float
    lag_f22: float
    lag_g1: float
    lag_g2: float
    lag_rest: float  # x1 at rest per m/s: 1/c
    gain: float  # a
    # the elastic mount
    mount_f11: float
    mount_f12: float
    mount_f21: float
    mount_f22: float
    mount_g1: float
    mount_g2: float
    mount_rest: float  # displacement at rest per m/s2 of thrust: 1/w^2
    shake_vertical: float  # share of the mount's velocity that the vertical channel sees: 1, or 0 for no shake
    shake_horizontal: float  # and each horizontal channel
    # range and the vertical channel
    sonar_floor_m: float  # 0: no over-scaling near the ground
    sonar_lag_s: float  # how old the range is that the sensor multiplies its flow by; 0: of this instant
    rotation_leak: float  # share of the rotation that the sensor's gyro leaves in the flow
    vertical_from_sonar: float  # 1: third channel from the sonar; 0: synthetic
    # sigma = polynomial in s = (h^(1/4) - centre) * scale, h held to the identified heights
    noise_low_m: float
    noise_high_m: float
    noise_centre: float
    noise_scale: float
    noise_0: float
    noise_1: float
    noise_2: float
    noise_3: float
    noise_4: float
    noise_5: float
    noise_6: float
    noise_7: float
    noise_8: float
    noise_floor_m_s: float
    # limits
    min_height_m: float
    max_height_m: float
    max_flow_rad_s: float
    min_tilt_cosine: float  # to stay engaged
    engaging_tilt_cosine: float  # to become engaged
    hysteresis: float  # fraction of each limit
    half_fov_tangent: float


class FlowState(NamedTuple):
    """Lag states of the three channels, the mount's displacement [m] and velocity [m/s] (down), and engaged 0/1."""

    u1: float
    u2: float
    v1: float
    v2: float
    w1: float
    w2: float
    mount_m: float
    mount_m_s: float
    engaged: float


class FlowReading(NamedTuple):
    """Published velocity, body FRD, its standard deviation by the sensor's law, and engaged 0/1."""

    vel_u_m_s: float
    vel_v_m_s: float
    vel_w_m_s: float
    sigma_m_s: float
    engaged: float


@equation
def start_flow(
    vel_u_m_s: float, vel_v_m_s: float, vel_w_m_s: float, thrust_m_s2: float, p: FlowParameters
) -> FlowState:
    """At rest in a steady motion under a steady thrust: no transient of lag or mount, not engaged."""
    return FlowState(
        vel_u_m_s * p.lag_rest,
        0.0,
        vel_v_m_s * p.lag_rest,
        0.0,
        vel_w_m_s * p.lag_rest,
        0.0,
        thrust_m_s2 * p.mount_rest,
        0.0,
        0.0,
    )


@equation
def sonar_overscale(range_m: float, p: FlowParameters) -> float:
    """Velocity reported over velocity: sonar range over true range, 1 above the sonar's floor."""
    true_range_m = larger(range_m, SMALLEST_RANGE_M)
    return larger(true_range_m, p.sonar_floor_m) / true_range_m


@equation
def misread(
    vel_u_m_s: float, vel_v_m_s: float, vel_w_m_s: float, rate_p_rad_s: float, rate_q_rad_s: float, range_m: float,
    p: FlowParameters,
) -> tuple[float, float]:  # fmt: skip
    """Horizontal velocity as a sensor sees it that multiplies by an old range and takes off too little rotation.

    Flow less the gyro's share of the rate, times the range: v/r·r_old + leak·ω·r, about y forward, about x to the left.
    """
    true_range_m = larger(range_m, SMALLEST_RANGE_M)
    scale = larger(range_m + p.sonar_lag_s * vel_w_m_s, SMALLEST_RANGE_M) / true_range_m
    left = p.rotation_leak * range_m
    return vel_u_m_s * scale + left * rate_q_rad_s, vel_v_m_s * scale - left * rate_p_rad_s


@equation
def step_flow(
    state: FlowState,
    vel_u_m_s: float,
    vel_v_m_s: float,
    vel_w_m_s: float,
    range_m: float,
    thrust_m_s2: float,
    p: FlowParameters,
) -> FlowState:
    """The state 4 ms on, the inputs held at their values at the start.

    range_m: true distance along the boresight. thrust_m_s2: rotor thrust over vehicle mass, >= 0 upwards.
    """
    shake_m_s = state.mount_m_s
    overscale = sonar_overscale(range_m, p)
    seen_u = (vel_u_m_s + p.shake_horizontal * shake_m_s) * overscale
    seen_v = (vel_v_m_s + p.shake_horizontal * shake_m_s) * overscale
    seen_w = vel_w_m_s + p.shake_vertical * shake_m_s
    u1, u2 = _lag(state.u1, state.u2, seen_u, p)
    v1, v2 = _lag(state.v1, state.v2, seen_v, p)
    w1, w2 = _lag(state.w1, state.w2, seen_w, p)
    mount = SecondOrderHold(p.mount_f11, p.mount_f12, p.mount_f21, p.mount_f22, p.mount_g1, p.mount_g2)
    mount_m, mount_m_s = hold_step(state.mount_m, state.mount_m_s, thrust_m_s2, mount)
    return FlowState(u1, u2, v1, v2, w1, w2, mount_m, mount_m_s, state.engaged)


@equation
def _lag(x1: float, x2: float, seen_m_s: float, p: FlowParameters) -> tuple[float, float]:
    """One channel of the identified dynamics, 4 ms on."""
    return hold_step(x1, x2, seen_m_s, SecondOrderHold(p.lag_f11, p.lag_f12, p.lag_f21, p.lag_f22, p.lag_g1, p.lag_g2))


@equation
def flow_noise_sigma(height_m: float, p: FlowParameters) -> float:
    """Standard deviation [m/s] of a published velocity at this height: the sensor file's law.

    Heights outside the identified ones take the value at the nearest of them: no extrapolation. The law is a
    polynomial in the fourth root of the height, fitted when the parameters are built (`noise_law.py`).
    """
    held_m = clamp(height_m, p.noise_low_m, p.noise_high_m)
    s = (np.sqrt(np.sqrt(held_m)) - p.noise_centre) * p.noise_scale
    high = p.noise_5 + s * (p.noise_6 + s * (p.noise_7 + s * p.noise_8))
    law = p.noise_0 + s * (p.noise_1 + s * (p.noise_2 + s * (p.noise_3 + s * (p.noise_4 + s * high))))
    return larger(law, p.noise_floor_m_s)


@equation
def read_flow(
    state: FlowState,
    height_m: float,
    sonar_rate_m_s: float,
    normal_u: float,
    normal_v: float,
    normal_w: float,
    p: FlowParameters,
) -> FlowReading:
    """The reading published now (50 Hz).

    sonar_rate_m_s: rate of the sonar's filtered range, which the vertical channel takes, reversed, where it is
    built from the sonar (that range has noise of its own, none is added).
    """
    sigma = flow_noise_sigma(height_m, p)
    synthetic = p.gain * state.w1 + sigma * normal_w
    return FlowReading(
        p.gain * state.u1 + sigma * normal_u,
        p.gain * state.v1 + sigma * normal_v,
        -sonar_rate_m_s if p.vertical_from_sonar > 0.5 else synthetic,
        sigma,
        state.engaged,
    )


SMALLEST_COSINE = 0.1  # keeps a ray finite that grazes the ground

with_engaged = replacing(FlowState, "engaged")


@equation
def _corner_reach(lens: LensPose, right: float, forward: float) -> float:
    """Distance of one image corner's ground point from the pad's centre: the larger of |north| and |east|.

    The corner's ray is (forward, right, 1) in the body.
    """
    rotation = lens.rotation
    north = rotation[0] * forward + rotation[1] * right + rotation[2]
    east = rotation[3] * forward + rotation[4] * right + rotation[5]
    down = rotation[6] * forward + rotation[7] * right + rotation[8]
    length = lens.height_m / larger(down, SMALLEST_COSINE)
    return larger(magnitude(lens.north_m + length * north), magnitude(lens.east_m + length * east))


@equation
def pattern_reach(lens: LensPose, half_fov_tangent: float) -> float:
    """Half the side of the smallest pad (square, its sides north and east) that fills the whole image [m].

    The four corners of the image are projected through the attitude on to level ground, so tilt, heading and footprint
    are exact (finite while tilt < 84 degrees).
    """
    t = half_fov_tangent
    front = larger(_corner_reach(lens, t, t), _corner_reach(lens, -t, t))
    back = larger(_corner_reach(lens, t, -t), _corner_reach(lens, -t, -t))
    return larger(front, back)


@equation
def engagement(
    engaged: float,
    height_m: float,
    tilt_cosine: float,
    reach_m: float,
    pad_half_size_m: float,
    flow_x_rad_s: float,
    flow_y_rad_s: float,
    p: FlowParameters,
) -> float:
    """1 where the sensor can see and follow the pattern, else 0.

    Height between its limits, tilt and flow rate below theirs, and the pattern filling the image. A sensor that
    is engaged stays so up to the limits; one that is not must first be inside them by the fraction `hysteresis`.
    """
    was = engaged > 0.5
    inside = 1.0 if was else 1.0 - p.hysteresis
    lowest_m = p.min_height_m if was else p.min_height_m * (1.0 + p.hysteresis)
    lowest_cosine = p.min_tilt_cosine if was else p.engaging_tilt_cosine
    flow_rad_s = larger(magnitude(flow_x_rad_s), magnitude(flow_y_rad_s))
    in_height = (height_m >= lowest_m) & (height_m <= p.max_height_m * inside)
    in_motion = (tilt_cosine >= lowest_cosine) & (flow_rad_s <= p.max_flow_rad_s * inside)
    in_view = reach_m <= pad_half_size_m * inside
    return 1.0 if in_height & in_motion & in_view else 0.0


@equation
def engage_flow(
    state: FlowState, lens: LensPose, flow_x_rad_s: float, flow_y_rad_s: float, pad_half_size_m: float,
    p: FlowParameters,
) -> FlowState:  # fmt: skip
    """The state with `engaged` judged anew from the lens's true place over the pad, its attitude and the flow."""
    reach_m = pattern_reach(lens, p.half_fov_tangent)
    tilt_cosine = lens.rotation[8]
    engaged = engagement(
        state.engaged, lens.height_m, tilt_cosine, reach_m, pad_half_size_m, flow_x_rad_s, flow_y_rad_s, p
    )
    return with_engaged(state, engaged=engaged)
