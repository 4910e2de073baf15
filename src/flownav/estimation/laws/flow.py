"""Optical flow: angular rates less the vehicle's turning, metric velocities, and a sensor with its own dynamics."""

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.core.frames import flow_about
from flownav.estimation.law import law
from flownav.estimation.laws import along_axis, component, cross, lens_range
from flownav.estimation.named import Attitude, BodyRate, FlowMount, GyroLeft, Height, Lever, VelocityNed, rotation_by


class Angular(NamedTuple):
    """A velocity over a range as angular flow [rad/s], and its slopes on velocity, range and scale."""

    value: float
    by_speed: float
    by_range: float
    by_scale: float


@equation
def scaled_flow(axis: int, across_m_s: float, flow_scale: float, range_m: float) -> Angular:
    """(1 + scale) times `frames.flow_about`."""
    by_speed = flow_about(axis, 1.0 + flow_scale, range_m)
    return Angular(
        by_speed * across_m_s,
        by_speed,
        -by_speed * across_m_s / range_m,
        flow_about(axis, across_m_s, range_m),
    )


class OnFlowRate(NamedTuple):
    """The Jacobian of a flow rate."""

    vel_n: float
    vel_e: float
    vel_d: float
    tilt_n: float
    tilt_e: float
    heading: float
    flow_scale: float
    pos_d: float
    ground: float
    gyro_bias: float


@law
def flow_rate(
    axis: int, vel: VelocityNed, height: Height, flow_scale: float, q: Attitude, rate: BodyRate, gyro: GyroLeft,
    *, mount: FlowMount,
) -> tuple[float, OnFlowRate]:  # fmt: skip
    """Flow less rotation: z_x = -(1 + scale) v/r - k b_x (axis 0), z_y = (1 + scale) u/r - k b_y (axis 1) [rad/s].

    k b is what the gyro that took the rotation off has left there: its bias b, k = `gyro_share`.

    PX4's convention. u and v are the lens's velocity along body forward and right, R_BE v + w x l with the lever l =
    (forward, right, below), body FRD (0 where no gyro measures w); r is the distance along body down from a lens
    `lens_below_m` below the IMU to level ground.
    """
    rotation = rotation_by(q)
    body = 1 if axis == 0 else 0
    swing = component(cross(rate, (mount.forward_m, mount.right_m, mount.below_m)), body)
    direction, along, turn = along_axis(rotation, body, vel, swing)
    lens = (0.0, 0.0, mount.lens_below_m)
    range_m, by_height, by_north, by_east = lens_range(rotation, height.ground - height.pos_d, lens)
    flow = scaled_flow(axis, along, flow_scale, range_m)
    return flow.value - gyro.gyro_share * gyro.gyro_bias, OnFlowRate(
        vel_n=flow.by_speed * direction[0], vel_e=flow.by_speed * direction[1], vel_d=flow.by_speed * direction[2],
        tilt_n=flow.by_speed * turn[0] + flow.by_range * by_north,
        tilt_e=flow.by_speed * turn[1] + flow.by_range * by_east,
        heading=flow.by_speed * turn[2], flow_scale=flow.by_scale,
        pos_d=-flow.by_range * by_height, ground=flow.by_range * by_height, gyro_bias=-gyro.gyro_share,
    )  # fmt: skip


class OnBodyVelocity(NamedTuple):
    """The Jacobian of a body velocity."""

    vel_n: float
    vel_e: float
    vel_d: float
    tilt_n: float
    tilt_e: float
    heading: float
    flow_scale: float


@law
def body_velocity(
    axis: int, vel: VelocityNed, flow_scale: float, q: Attitude, rate: BodyRate, *, lever: Lever
) -> tuple[float, OnBodyVelocity]:
    """z = (1 + scale)(R_BE v + w x l) [m/s]: metric flow, one body axis (0 forward, 1 right, 2 down)."""
    swing = component(cross(rate, lever), axis)
    direction, along, turn = along_axis(rotation_by(q), axis, vel, swing)
    scale = 1.0 + flow_scale
    return scale * along, OnBodyVelocity(
        vel_n=scale * direction[0], vel_e=scale * direction[1], vel_d=scale * direction[2],
        tilt_n=scale * turn[0], tilt_e=scale * turn[1], heading=scale * turn[2], flow_scale=along,
    )  # fmt: skip


class OnLaggedFlowRate(NamedTuple):
    """The Jacobian of a lagged flow rate."""

    lag_u1: float
    lag_v1: float
    flow_scale: float
    tilt_n: float
    tilt_e: float
    pos_d: float
    ground: float


@law
def lagged_flow_rate(
    axis: int, lag_u1: float, lag_v1: float, flow_scale: float, height: Height, q: Attitude,
    *, gain: float, lens_below_m: float,
) -> tuple[float, OnLaggedFlowRate]:  # fmt: skip
    """`flow_rate` of a sensor whose dynamics are states: gain x1, swing and all, over the range of now."""
    lens = (0.0, 0.0, lens_below_m)
    range_m, by_height, by_north, by_east = lens_range(rotation_by(q), height.ground - height.pos_d, lens)
    flow = scaled_flow(axis, gain * (lag_v1 if axis == 0 else lag_u1), flow_scale, range_m)
    slope = gain * flow.by_speed
    return flow.value, OnLaggedFlowRate(
        lag_u1=0.0 if axis == 0 else slope, lag_v1=slope if axis == 0 else 0.0, flow_scale=flow.by_scale,
        tilt_n=flow.by_range * by_north, tilt_e=flow.by_range * by_east,
        pos_d=-flow.by_range * by_height, ground=flow.by_range * by_height,
    )  # fmt: skip


class OnLaggedFlow(NamedTuple):
    """The Jacobian of a lagged flow."""

    lag_u1: float
    lag_v1: float
    flow_scale: float


@law
def lagged_flow(
    axis: int, lag_u1: float, lag_v1: float, flow_scale: float, *, gain: float
) -> tuple[float, OnLaggedFlow]:
    """z = (1 + scale) gain x1 [m/s]: metric flow of a sensor whose dynamics are states, axis 0 forward, 1 right."""
    unscaled = gain * (lag_u1 if axis == 0 else lag_v1)
    slope = (1.0 + flow_scale) * gain
    return (1.0 + flow_scale) * unscaled, OnLaggedFlow(
        lag_u1=slope if axis == 0 else 0.0, lag_v1=0.0 if axis == 0 else slope, flow_scale=unscaled
    )
