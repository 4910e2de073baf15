"""An inertial measurement unit that integrates over its period, as flight controllers have: gyro and accelerometer.

A reading is the mean rate and the mean specific force (all forces but gravity, over mass) over the period, body FRD:

    w_read = w + E w + G f + b + noise + vibration,    f_read = f + E' f + b' + noise + vibration,

E, E' the scale errors and misalignments and G the gyro's sensitivity to specific force, of this very unit and drawn
once a flight; b, b' biases that start somewhere and walk. Readings stop at the range. (Titterton, Weston, Strapdown
Inertial Navigation Technology, 2nd ed., chapters 4 and 8; IEEE Std 952 for the noises.)

White noise has the datasheet's one-sided density N: sigma = N sqrt(rate/2) for a mean over the period, hence an Allan
deviation of N/sqrt(2 t). A bias walks by `walk` sqrt(t).

**Vibration** at once a revolution of the rotor and at the blade rate. A rotating hub force is seen in quadrature by x
and y; z and the rates have amplitudes of their own. The mean over the period T of a tone of frequency f is the tone at
the middle of the period times sin(pi f T)/(pi f T), which `parameters` has put into the amplitudes together with the
sensor's bandwidth. The part beyond half the rate aliases by itself: the phase advances by the exact turn of one period,
as a precomputed rotation, and by the little that this flight's rotor turns faster than stated.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, equation, larger
from flownav.core.frames import turned_level
from flownav.sensors.processes import factor

QUALITY = 255.0


class ImuReading(NamedTuple):
    """Gyro and accelerometer, body FRD: a reading, or the truth behind it."""

    gyro_x_rad_s: float
    gyro_y_rad_s: float
    gyro_z_rad_s: float
    accel_x_m_s2: float
    accel_y_m_s2: float
    accel_z_m_s2: float


class InertialParameters(NamedTuple):
    """Coefficients of one period."""

    gyro_sigma_rad_s: float  # white, of one reading
    gyro_bias_rad_s: float  # standard deviation of the bias at the start
    gyro_walk_rad_s: float  # standard deviation of one step of the bias
    gyro_scale: float  # standard deviation of an axis's scale error
    gyro_misalignment_rad: float  # and of each angle between axes
    gyro_per_force_rad_s: float  # and of each sensitivity to specific force, per m/s2
    gyro_range_rad_s: float
    accel_sigma_m_s2: float
    accel_bias_m_s2: float
    accel_walk_m_s2: float
    accel_scale: float
    accel_misalignment_rad: float
    accel_range_m_s2: float
    # the turn of each tone's phase in a period, and what amplitude is left of it in a reading
    rev_cosine: float
    rev_sine: float
    rev_turn_rad: float
    rev_level_m_s2: float
    rev_vertical_m_s2: float
    rev_tilt_rad_s: float
    rev_yaw_rad_s: float
    blade_cosine: float
    blade_sine: float
    blade_turn_rad: float
    blade_level_m_s2: float
    blade_vertical_m_s2: float
    blade_tilt_rad_s: float
    blade_yaw_rad_s: float
    vibration_spread: float  # from flight to flight, a share
    vibration_speed_spread: float  # of the rotor's speed, a share


class InertialUnit(NamedTuple):
    """This unit's own errors, constant in flight: E, G and E' row by row (gyro_xy: of w_y in the x reading).

    vibration: how strong this flight's is, against the datasheet's; faster: the share by which its rotor turns faster.
    """

    gyro_xx: float
    gyro_xy: float
    gyro_xz: float
    gyro_yx: float
    gyro_yy: float
    gyro_yz: float
    gyro_zx: float
    gyro_zy: float
    gyro_zz: float
    force_xx: float  # rad/s per m/s2
    force_xy: float
    force_xz: float
    force_yx: float
    force_yy: float
    force_yz: float
    force_zx: float
    force_zy: float
    force_zz: float
    accel_xx: float
    accel_xy: float
    accel_xz: float
    accel_yx: float
    accel_yy: float
    accel_yz: float
    accel_zx: float
    accel_zy: float
    accel_zz: float
    vibration: float
    faster: float


class InertialState(NamedTuple):
    """Biases [rad/s, m/s2], and the phase of each tone as its cosine and sine."""

    gyro_bias_x: float
    gyro_bias_y: float
    gyro_bias_z: float
    accel_bias_x: float
    accel_bias_y: float
    accel_bias_z: float
    rev_cosine: float
    rev_sine: float
    blade_cosine: float
    blade_sine: float


class InertialNormals(NamedTuple):
    """Standard normals of one reading: noise, and the step of the bias, of each axis."""

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


class InertialStartNormals(NamedTuple):
    """Standard normals of one state's start: biases, and two for the direction of each tone's phase."""

    gyro_bias_x: float
    gyro_bias_y: float
    gyro_bias_z: float
    accel_bias_x: float
    accel_bias_y: float
    accel_bias_z: float
    rev_one: float
    rev_two: float
    blade_one: float
    blade_two: float


class InertialReading(NamedTuple):
    """Means over the period, body FRD; quality is 255 and a reading always arrives (the unit is wired)."""

    gyro_x_rad_s: float
    gyro_y_rad_s: float
    gyro_z_rad_s: float
    accel_x_m_s2: float
    accel_y_m_s2: float
    accel_z_m_s2: float
    quality: float
    arrived: float


@equation
def draw_inertial(n: InertialUnit, p: InertialParameters) -> InertialUnit:
    """This flight's unit; `n` carries a standard normal for each of its fields."""
    scale, angle = p.gyro_scale, p.gyro_misalignment_rad
    force = p.gyro_per_force_rad_s
    stretch, turn = p.accel_scale, p.accel_misalignment_rad
    return InertialUnit(
        scale * n.gyro_xx, angle * n.gyro_xy, angle * n.gyro_xz,
        angle * n.gyro_yx, scale * n.gyro_yy, angle * n.gyro_yz,
        angle * n.gyro_zx, angle * n.gyro_zy, scale * n.gyro_zz,
        force * n.force_xx, force * n.force_xy, force * n.force_xz,
        force * n.force_yx, force * n.force_yy, force * n.force_yz,
        force * n.force_zx, force * n.force_zy, force * n.force_zz,
        stretch * n.accel_xx, turn * n.accel_xy, turn * n.accel_xz,
        turn * n.accel_yx, stretch * n.accel_yy, turn * n.accel_yz,
        turn * n.accel_zx, turn * n.accel_zy, stretch * n.accel_zz,
        factor(p.vibration_spread, n.vibration), p.vibration_speed_spread * n.faster,
    )  # fmt: skip


@equation
def _direction(one: float, two: float) -> tuple[float, float]:
    """Cosine and sine of an angle that is even over the circle: two standard normals over their length."""
    shrink = 1.0 / np.sqrt(larger(one * one + two * two, 1e-30))
    return one * shrink, two * shrink


@equation
def start_inertial(n: InertialStartNormals, p: InertialParameters) -> InertialState:
    """The biases of this flight, and tones of any phase."""
    rev_cosine, rev_sine = _direction(n.rev_one, n.rev_two)
    blade_cosine, blade_sine = _direction(n.blade_one, n.blade_two)
    return InertialState(
        gyro_bias_x=p.gyro_bias_rad_s * n.gyro_bias_x,
        gyro_bias_y=p.gyro_bias_rad_s * n.gyro_bias_y,
        gyro_bias_z=p.gyro_bias_rad_s * n.gyro_bias_z,
        accel_bias_x=p.accel_bias_m_s2 * n.accel_bias_x,
        accel_bias_y=p.accel_bias_m_s2 * n.accel_bias_y,
        accel_bias_z=p.accel_bias_m_s2 * n.accel_bias_z,
        rev_cosine=rev_cosine,
        rev_sine=rev_sine,
        blade_cosine=blade_cosine,
        blade_sine=blade_sine,
    )


@equation
def _turned(cosine: float, sine: float, by: tuple[float, float], further_rad: float) -> tuple[float, float]:
    """A phase turned by an angle, given by its cosine and sine, and by a small one more (to its fourth order)."""
    square = further_rad * further_rad
    near, off = 1.0 - square * (0.5 - square / 24.0), further_rad * (1.0 - square / 6.0)
    c, s = by[0] * near - by[1] * off, by[1] * near + by[0] * off
    return turned_level(cosine, sine, c, s)


@equation
def _next_state(state: InertialState, faster: float, n: InertialNormals, p: InertialParameters) -> InertialState:
    """Biases walked and phases turned by one period."""
    rev = _turned(state.rev_cosine, state.rev_sine, (p.rev_cosine, p.rev_sine), faster * p.rev_turn_rad)
    blade = _turned(state.blade_cosine, state.blade_sine, (p.blade_cosine, p.blade_sine), faster * p.blade_turn_rad)
    return InertialState(
        gyro_bias_x=state.gyro_bias_x + p.gyro_walk_rad_s * n.gyro_bias_x,
        gyro_bias_y=state.gyro_bias_y + p.gyro_walk_rad_s * n.gyro_bias_y,
        gyro_bias_z=state.gyro_bias_z + p.gyro_walk_rad_s * n.gyro_bias_z,
        accel_bias_x=state.accel_bias_x + p.accel_walk_m_s2 * n.accel_bias_x,
        accel_bias_y=state.accel_bias_y + p.accel_walk_m_s2 * n.accel_bias_y,
        accel_bias_z=state.accel_bias_z + p.accel_walk_m_s2 * n.accel_bias_z,
        rev_cosine=rev[0],
        rev_sine=rev[1],
        blade_cosine=blade[0],
        blade_sine=blade[1],
    )


@equation
def _row(a: float, b: float, c: float, x: float, y: float, z: float) -> float:
    """One row of a 3 x 3 matrix times a vector."""
    return a * x + b * y + c * z


@equation
def step_inertial(
    state: InertialState, unit: InertialUnit, truth: ImuReading, n: InertialNormals, p: InertialParameters
) -> tuple[InertialState, InertialReading]:
    """The reading of one period, whose mean rate and mean specific force are `truth`."""
    s, u = _next_state(state, unit.faster, n, p), unit
    wx, wy, wz = truth.gyro_x_rad_s, truth.gyro_y_rad_s, truth.gyro_z_rad_s
    fx, fy, fz = truth.accel_x_m_s2, truth.accel_y_m_s2, truth.accel_z_m_s2
    gyro_x = wx + (
        _row(u.gyro_xx, u.gyro_xy, u.gyro_xz, wx, wy, wz) + _row(u.force_xx, u.force_xy, u.force_xz, fx, fy, fz)
    )
    gyro_y = wy + (
        _row(u.gyro_yx, u.gyro_yy, u.gyro_yz, wx, wy, wz) + _row(u.force_yx, u.force_yy, u.force_yz, fx, fy, fz)
    )
    gyro_z = wz + (
        _row(u.gyro_zx, u.gyro_zy, u.gyro_zz, wx, wy, wz) + _row(u.force_zx, u.force_zy, u.force_zz, fx, fy, fz)
    )
    accel_x = fx + _row(u.accel_xx, u.accel_xy, u.accel_xz, fx, fy, fz)
    accel_y = fy + _row(u.accel_yx, u.accel_yy, u.accel_yz, fx, fy, fz)
    accel_z = fz + _row(u.accel_zx, u.accel_zy, u.accel_zz, fx, fy, fz)
    rev_c, rev_s = u.vibration * s.rev_cosine, u.vibration * s.rev_sine
    blade_c, blade_s = u.vibration * s.blade_cosine, u.vibration * s.blade_sine
    tilting_x = p.rev_tilt_rad_s * rev_c + p.blade_tilt_rad_s * blade_c
    tilting_y = p.rev_tilt_rad_s * rev_s + p.blade_tilt_rad_s * blade_s
    yawing = p.rev_yaw_rad_s * rev_c + p.blade_yaw_rad_s * blade_c
    shaking_x = p.rev_level_m_s2 * rev_c + p.blade_level_m_s2 * blade_c
    shaking_y = p.rev_level_m_s2 * rev_s + p.blade_level_m_s2 * blade_s
    heaving = p.rev_vertical_m_s2 * rev_c + p.blade_vertical_m_s2 * blade_c
    gyro, accel = p.gyro_range_rad_s, p.accel_range_m_s2
    return s, InertialReading(
        clamp(gyro_x + s.gyro_bias_x + tilting_x + p.gyro_sigma_rad_s * n.gyro_x, -gyro, gyro),
        clamp(gyro_y + s.gyro_bias_y + tilting_y + p.gyro_sigma_rad_s * n.gyro_y, -gyro, gyro),
        clamp(gyro_z + s.gyro_bias_z + yawing + p.gyro_sigma_rad_s * n.gyro_z, -gyro, gyro),
        clamp(accel_x + s.accel_bias_x + shaking_x + p.accel_sigma_m_s2 * n.accel_x, -accel, accel),
        clamp(accel_y + s.accel_bias_y + shaking_y + p.accel_sigma_m_s2 * n.accel_y, -accel, accel),
        clamp(accel_z + s.accel_bias_z + heaving + p.accel_sigma_m_s2 * n.accel_z, -accel, accel),
        QUALITY,
        1.0,
    )
