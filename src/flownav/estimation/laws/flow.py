"""Optical flow: angular rates less the vehicle's turning, metric velocities, and a sensor with its own dynamics."""

from __future__ import annotations

from typing import NamedTuple

from flownav.estimation.law import law
from flownav.estimation.laws.geometry import body_axis, component, cross, lens_range
from flownav.estimation.named import Attitude, BodyRate, FlowMount, GyroLeft, Height, Lever, VelocityNed, rotation_by


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

    PX4's convention. u and v are the lens's velocity along body forward and right, R_BE v + w x l with the lever
    l = (forward, right, below), body FRD (0 where no gyro tells w); r is the distance along body down from a lens
    `lens_below_m` below the IMU to level ground.
    """
    rotation = rotation_by(q)
    body = 1 if axis == 0 else 0
    direction = body_axis(rotation, body)
    turn = cross(direction, vel)
    swing = component(cross(rate, (mount.forward_m, mount.right_m, mount.below_m)), body)
    along = direction[0] * vel.vel_n + direction[1] * vel.vel_e + direction[2] * vel.vel_d + swing
    lens = (0.0, 0.0, mount.lens_below_m)
    range_m, by_height, by_north, by_east = lens_range(rotation, height.ground - height.pos_d, lens)
    sign = -1.0 if axis == 0 else 1.0
    per_speed = sign * (1.0 + flow_scale) / range_m
    by_range = -per_speed * along / range_m
    return per_speed * along - gyro.gyro_share * gyro.gyro_bias, OnFlowRate(
        vel_n=per_speed * direction[0], vel_e=per_speed * direction[1], vel_d=per_speed * direction[2],
        tilt_n=per_speed * turn[0] + by_range * by_north, tilt_e=per_speed * turn[1] + by_range * by_east,
        heading=per_speed * turn[2], flow_scale=sign * along / range_m,
        pos_d=-by_range * by_height, ground=by_range * by_height, gyro_bias=-gyro.gyro_share,
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
    direction = body_axis(rotation_by(q), axis)
    turn = cross(direction, vel)
    swing = component(cross(rate, lever), axis)
    along = direction[0] * vel.vel_n + direction[1] * vel.vel_e + direction[2] * vel.vel_d + swing
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
    sign = -1.0 if axis == 0 else 1.0
    along = gain * (lag_v1 if axis == 0 else lag_u1)
    per_speed = sign * (1.0 + flow_scale) / range_m
    by_range = -per_speed * along / range_m
    return per_speed * along, OnLaggedFlowRate(
        lag_u1=0.0 if axis == 0 else gain * per_speed, lag_v1=gain * per_speed if axis == 0 else 0.0,
        flow_scale=sign * along / range_m, tilt_n=by_range * by_north, tilt_e=by_range * by_east,
        pos_d=-by_range * by_height, ground=by_range * by_height,
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
