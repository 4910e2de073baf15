"""The flow sensor's identified dynamics inside the filter: two states a channel (docs/explanation/landing-filter.md).

The sensor sees the body velocity m = o R_BE v, where o > 1 only below the floor of its own sonar, and reports
gain x1 of x' = [0 1; -c -b] x + [0 1]' m. The filter carries x, so that a reading corrects what was, some 80 ms ago,
as well as what is. Only a filter of STATES_WITH_LAG states has them: `lag_starts`, `motion.predict`, `lag_ends` are
one step of it, which `predict_with_lag` takes.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, cos, cosh, equation, exp, procedure, sin, sinh
from flownav.core.frames import Rotation
from flownav.estimation.covariance import columns_of
from flownav.estimation.error_models import FilterSettings, discretised
from flownav.estimation.law import step
from flownav.estimation.laws import along_axis, cross, lens_range
from flownav.estimation.motion import predict
from flownav.estimation.named import Attitude, BodyRate, Height, Tilt, VelocityNed, rotation_by
from flownav.estimation.states import STATES_WITH_LAG
from flownav.estimation.transition import transition


class FlowLag(NamedTuple):
    """A flow sensor's identified dynamics G(s) = a/(s^2 + b s + c) over one prediction of fixed length.

    x <- F x + g0 m0 + g1 m1, where the seen velocity goes in a straight line from m0 to m1; reading = gain x1.
    """

    f11: float
    f12: float
    f21: float
    f22: float
    start_1: float  # g0
    start_2: float
    end_1: float  # g1
    end_2: float
    gain: float
    sonar_floor_m: float  # below it the sensor multiplies its flow by this instead of the range; 0: it does not
    lens_below_m: float  # the lens below the vehicle's reference point, along body down
    forward_m: float = 0.0  # the lens's lever from the IMU, body FRD; 0 where no gyro measures its swing
    right_m: float = 0.0
    below_m: float = 0.0


def lag_over(
    a_1_s2: float, b_1_s: float, c_1_s2: float, dt_s: float, sonar_floor_m: float, lens_below_m: float
) -> FlowLag:
    """G(s) = a/(s^2 + b s + c) over steps of dt in which the seen velocity goes in a straight line.

    The velocity is a third state whose slope is held (first-order hold; Franklin, Powell and Workman, Digital Control
    of Dynamic Systems, 1998, section 6.3.2).
    """
    model = np.array([[0.0, 1.0, 0.0], [-c_1_s2, -b_1_s, 1.0], [0.0, 0.0, 0.0]])
    whole, by_slope = discretised(model, np.array([[0.0], [0.0], [1.0]]), dt_s)
    end = by_slope[:2, 0] / dt_s
    start = whole[:2, 2] - end
    return FlowLag(
        float(whole[0, 0]), float(whole[0, 1]), float(whole[1, 0]), float(whole[1, 1]),
        float(start[0]), float(start[1]), float(end[0]), float(end[1]), a_1_s2, sonar_floor_m, lens_below_m,
    )  # fmt: skip


SLOW_TURN = 1e-4  # below it sine and argument are the same to 2e-9


@equation
def lag_of_step(b_1_s: float, c_1_s2: float, dt_s: float, forward_m: float, right_m: float, below_m: float) -> FlowLag:
    """c/(s^2 + b s + c) over a step of any length, in closed form: `lag_over` in kernels, of gain 1 and no floor.

    F = e^(-b t/2) ((cos wt + b/2 s) I + s [0 1; -c -b]), s = sin(wt)/w, w^2 = c - b^2/4; hyperbolic where w^2 < 0.
    Its integral and the integral of that follow from A^-1 (F - I).
    """
    half = 0.5 * b_1_s
    square = c_1_s2 - half * half
    rate = np.sqrt(abs(square))
    turn = rate * dt_s
    cosine = cos(turn) if square > 0.0 else cosh(turn)
    sine = sin(turn) if square > 0.0 else sinh(turn)
    slope = sine / rate if turn > SLOW_TURN else dt_s
    fade = exp(-half * dt_s)
    f11, f12 = fade * (cosine + half * slope), fade * slope
    f21, f22 = -c_1_s2 * fade * slope, fade * (cosine - half * slope)
    held_1, held_2 = (1.0 - f22 - b_1_s * f12) / c_1_s2, f12
    end_1, end_2 = (1.0 - (b_1_s * held_1 + held_2) / dt_s) / c_1_s2, held_1 / dt_s
    return FlowLag(
        f11, f12, f21, f22, held_1 - end_1, held_2 - end_2, end_1, end_2, c_1_s2, 0.0, below_m,
        forward_m, right_m, below_m,
    )  # fmt: skip


class Seen(NamedTuple):
    """A seen velocity, and its derivatives on velocity, attitude error and height."""

    value: float
    vel: tuple[float, float, float]
    turn: tuple[float, float, float]
    height: float


class LagLens(NamedTuple):
    """The lens of a `FlowLag`: the floor of the sensor's own sonar, its depth, its lever from the IMU, body FRD [m]."""

    sonar_floor_m: float
    lens_below_m: float
    forward_m: float
    right_m: float
    below_m: float


@equation
def seen_velocity(
    rotation: Rotation, vel: VelocityNed, height_m: float, channel: int, sonar_floor_m: float, lens_below_m: float,
    swing_m_s: float = 0.0,
) -> Seen:  # fmt: skip
    """Channel 0 (forward) or 1 (right) as it sees the velocity: o (e . v + swing), o = floor/range below the floor.

    swing_m_s: the velocity that turning adds at the lens.
    """
    e, along, turn = along_axis(rotation, channel, vel, swing_m_s)
    range_m, by_height, by_north, by_east = lens_range(rotation, height_m, (0.0, 0.0, lens_below_m))
    low = range_m.real < sonar_floor_m
    over = sonar_floor_m / range_m if low else 1.0
    by_range = -over * along / range_m if low else 0.0
    return Seen(
        over * along,
        (over * e[0], over * e[1], over * e[2]),
        (over * turn[0] + by_range * by_north, over * turn[1] + by_range * by_east, over * turn[2]),
        by_range * by_height,
    )


class Lagged(NamedTuple):
    """The states of the sensor's dynamics."""

    lag_u1: float
    lag_u2: float
    lag_v1: float
    lag_v2: float


class LagMove(NamedTuple):
    """x <- F x + g m of one channel."""

    f11: float
    f12: float
    f21: float
    f22: float
    gain_1: float
    gain_2: float


@equation
def moved_lag(x: Lagged, u: float, v: float, move: LagMove) -> Lagged:
    """x <- F x + g m of both channels, which see u and v."""
    return Lagged(
        move.f11 * x.lag_u1 + move.f12 * x.lag_u2 + move.gain_1 * u,
        move.f21 * x.lag_u1 + move.f22 * x.lag_u2 + move.gain_2 * u,
        move.f11 * x.lag_v1 + move.f12 * x.lag_v2 + move.gain_1 * v,
        move.f21 * x.lag_v1 + move.f22 * x.lag_v2 + move.gain_2 * v,
    )


@step
def move_lag(
    x: Lagged, vel: VelocityNed, height: Height, q: Attitude, rate: BodyRate, *, move: LagMove, lens: LagLens
) -> Lagged:
    """x <- F x + g m of both channels, with the velocity that the state now has and the last step's turning."""
    rotation, floor_m, below_m = rotation_by(q), lens.sonar_floor_m, lens.lens_below_m
    swing = cross(rate, (lens.forward_m, lens.right_m, lens.below_m))
    height_m = height.ground - height.pos_d
    u = seen_velocity(rotation, vel, height_m, 0, floor_m, below_m, swing[0]).value
    v = seen_velocity(rotation, vel, height_m, 1, floor_m, below_m, swing[1]).value
    return moved_lag(x, u, v, move)


class Slopes(NamedTuple):
    """The derivatives of the velocities that are seen forward (u) and right (v), which lie in rows between laws."""

    u_by_vel_n: float
    u_by_vel_e: float
    u_by_vel_d: float
    u_by_tilt_n: float
    u_by_tilt_e: float
    u_by_heading: float
    u_by_height: float
    v_by_vel_n: float
    v_by_vel_e: float
    v_by_vel_d: float
    v_by_tilt_n: float
    v_by_tilt_e: float
    v_by_heading: float
    v_by_height: float


@step
def set_slopes(vel: VelocityNed, height: Height, q: Attitude, *, sonar_floor_m: float, lens_below_m: float) -> Slopes:
    """The derivatives of both seen velocities on velocity, attitude error and height."""
    rotation, height_m = rotation_by(q), height.ground - height.pos_d
    u = seen_velocity(rotation, vel, height_m, 0, sonar_floor_m, lens_below_m)
    v = seen_velocity(rotation, vel, height_m, 1, sonar_floor_m, lens_below_m)
    return Slopes(
        u.vel[0], u.vel[1], u.vel[2], u.turn[0], u.turn[1], u.turn[2], u.height,
        v.vel[0], v.vel[1], v.vel[2], v.turn[0], v.turn[1], v.turn[2], v.height,
    )  # fmt: skip


@transition
def errors_in_lag(x: Lagged, vel: VelocityNed, tilt: Tilt, height: Height, slopes: Slopes, *, move: LagMove) -> Lagged:
    """dx <- F dx + g dm, with the derivatives that `set_slopes` left."""
    s, above = slopes, height.ground - height.pos_d
    u = (
        s.u_by_vel_n * vel.vel_n + s.u_by_vel_e * vel.vel_e + s.u_by_vel_d * vel.vel_d
        + s.u_by_tilt_n * tilt.tilt_n + s.u_by_tilt_e * tilt.tilt_e + s.u_by_heading * tilt.heading
        + s.u_by_height * above
    )  # fmt: skip
    v = (
        s.v_by_vel_n * vel.vel_n + s.v_by_vel_e * vel.vel_e + s.v_by_vel_d * vel.vel_d
        + s.v_by_tilt_n * tilt.tilt_n + s.v_by_tilt_e * tilt.tilt_e + s.v_by_heading * tilt.heading
        + s.v_by_height * above
    )  # fmt: skip
    return moved_lag(x, u, v, move)


@procedure
def lag_step(work: Work, lanes: Lanes, m: LagMove, lag: FlowLag) -> None:
    """x <- F x + g m, state and covariance."""
    set_slopes(work, lanes, lag.sonar_floor_m, lag.lens_below_m)
    move_lag(
        work, lanes, m.f11, m.f12, m.f21, m.f22, m.gain_1, m.gain_2, lag.sonar_floor_m, lag.lens_below_m,
        lag.forward_m, lag.right_m, lag.below_m,
    )  # fmt: skip
    n = columns_of(work, lanes, STATES_WITH_LAG)
    errors_in_lag(work, lanes, n, m.f11, m.f12, m.f21, m.f22, m.gain_1, m.gain_2)


@equation
def lag_starts(work: Work, lanes: Lanes, lag: FlowLag) -> None:
    """Add the effect that the velocity at the start of a prediction has on the sensor's state at its end."""
    lag_step(work, lanes, LagMove(lag.f11, lag.f12, lag.f21, lag.f22, lag.start_1, lag.start_2), lag)


@equation
def lag_ends(work: Work, lanes: Lanes, lag: FlowLag) -> None:
    """Add the effect of the velocity at the end of a prediction."""
    lag_step(work, lanes, LagMove(1.0, 0.0, 0.0, 1.0, lag.end_1, lag.end_2), lag)


@procedure
def predict_with_lag(work: Work, lanes: Lanes, dt_s: float, settings: FilterSettings, lag: FlowLag) -> None:
    """`motion.predict` of a filter that carries the flow sensor's dynamics; lag: over a step of dt."""
    lag_starts(work, lanes, lag)
    predict(work, lanes, STATES_WITH_LAG, dt_s, settings)
    lag_ends(work, lanes, lag)
