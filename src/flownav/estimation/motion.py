"""The filter's motion over one step: strapdown navigation, and the covariance of its errors.

Position, velocity and attitude follow the IMU (Groves, Principles of GNSS, Inertial, and Multisensor Integrated
Navigation Systems, 2013, section 5.4, on a flat, non-rotating earth); their errors are those of its section 14.2.4 in
the earth frame. docs/explanation/landing-filter.md derives both.
"""

from typing import NamedTuple

from flownav.core.compile import Lanes, Work, equation, procedure
from flownav.core.frames import (
    GRAVITY_M_S2,
    Quaternion,
    Rotation,
    of_unit_length,
    quaternion_product,
    rotation_from_quaternion,
    to_earth,
)
from flownav.estimation.covariance import add_noise, at, columns_of
from flownav.estimation.error_models import FilterSettings
from flownav.estimation.hypotheses import hold_unlearnt
from flownav.estimation.law import step
from flownav.estimation.named import (
    AccelBias,
    Attitude,
    ForceNed,
    GyroBias,
    Inertial,
    Middle,
    PositionNed,
    Tilt,
    VelocityNed,
)
from flownav.estimation.states import (
    ACCEL_BIAS,
    ACCEL_NOISE,
    ATTITUDE,
    GYRO_BIAS,
    GYRO_NOISE,
    IMU,
    POSITION,
    QUATERNION,
    STATE,
    VELOCITY,
)
from flownav.estimation.transition import transition


@equation
def turned(attitude: Quaternion, x_rad: float, y_rad: float, z_rad: float) -> Quaternion:
    """q exp(phi/2): the attitude after a rotation of the body by the small vector phi, third order; unit length."""
    square = 0.25 * (x_rad * x_rad + y_rad * y_rad + z_rad * z_rad)
    half = 0.5 * (1.0 - square / 6.0)
    turn = (1.0 - 0.5 * square, half * x_rad, half * y_rad, half * z_rad)
    return of_unit_length(quaternion_product(attitude, turn))


@equation
def attitude_of(work: Work, lanes: Lanes, lane: int) -> Quaternion:
    """A lane's attitude, body to earth."""
    return (
        work[QUATERNION * len(lanes) + lane],
        work[(QUATERNION + 1) * len(lanes) + lane],
        work[(QUATERNION + 2) * len(lanes) + lane],
        work[(QUATERNION + 3) * len(lanes) + lane],
    )


@equation
def rotation_of(work: Work, lanes: Lanes, lane: int) -> Rotation:
    """R_EB of a lane's attitude."""
    w, x, y, z = attitude_of(work, lanes, lane)
    return rotation_from_quaternion(w, x, y, z)


@procedure
def predict(work: Work, lanes: Lanes, n: int, dt_s: float, settings: FilterSettings) -> None:
    """The motion of dt with the IMU reading of its rows, which stands for that time, and the noise of motion.

    The walks of the biases and of everything else, and Gauss-Markov errors, are `error_models`' and no part of it.
    """
    strapdown(work, lanes, dt_s=dt_s)
    hold_unlearnt(work, lanes, n)
    errors_in_motion(work, lanes, columns_of(work, lanes, n), dt_s=dt_s)
    add_motion_noise(work, lanes, dt_s, settings.position_walk_m_rt_s)


class Moved(NamedTuple):
    """Result of a step: state, body rate, specific force NED, and R_EB in its middle, row by row."""

    pos_n: float
    pos_e: float
    pos_d: float
    vel_n: float
    vel_e: float
    vel_d: float
    qw: float
    qx: float
    qy: float
    qz: float
    rate_x: float
    rate_y: float
    rate_z: float
    force_n: float
    force_e: float
    force_d: float
    middle_0: float
    middle_1: float
    middle_2: float
    middle_3: float
    middle_4: float
    middle_5: float
    middle_6: float
    middle_7: float
    middle_8: float


@step
def strapdown(
    pos: PositionNed, vel: VelocityNed, attitude: Attitude, imu: Inertial, gyro_bias: GyroBias, accel_bias: AccelBias,
    *, dt_s: float,
) -> Moved:  # fmt: skip
    """q <- q exp(w dt), v <- v + (R_mid f + g) dt, p <- p + mean v dt, with w and f the readings less their biases."""
    p, q = imu.gyro_x - gyro_bias.gyro_bias_x, imu.gyro_y - gyro_bias.gyro_bias_y
    r = imu.gyro_z - gyro_bias.gyro_bias_z
    x, y, z = dt_s * p, dt_s * q, dt_s * r
    middle = turned(attitude, 0.5 * x, 0.5 * y, 0.5 * z)
    after = turned(attitude, x, y, z)
    rotation = rotation_from_quaternion(middle[0], middle[1], middle[2], middle[3])
    force = to_earth(
        rotation, imu.accel_x - accel_bias.accel_bias_x, imu.accel_y - accel_bias.accel_bias_y,
        imu.accel_z - accel_bias.accel_bias_z,
    )  # fmt: skip
    accel_d = force[2] + GRAVITY_M_S2
    return Moved(
        pos_n=pos.pos_n + dt_s * (vel.vel_n + 0.5 * dt_s * force[0]),
        pos_e=pos.pos_e + dt_s * (vel.vel_e + 0.5 * dt_s * force[1]),
        pos_d=pos.pos_d + dt_s * (vel.vel_d + 0.5 * dt_s * accel_d),
        vel_n=vel.vel_n + dt_s * force[0], vel_e=vel.vel_e + dt_s * force[1], vel_d=vel.vel_d + dt_s * accel_d,
        qw=after[0], qx=after[1], qy=after[2], qz=after[3],
        rate_x=p, rate_y=q, rate_z=r,
        force_n=force[0], force_e=force[1], force_d=force[2],
        middle_0=rotation[0], middle_1=rotation[1], middle_2=rotation[2],
        middle_3=rotation[3], middle_4=rotation[4], middle_5=rotation[5],
        middle_6=rotation[6], middle_7=rotation[7], middle_8=rotation[8],
    )  # fmt: skip


class MotionErrors(NamedTuple):
    """The errors that motion changes."""

    pos_n: float
    pos_e: float
    pos_d: float
    vel_n: float
    vel_e: float
    vel_d: float
    tilt_n: float
    tilt_e: float
    heading: float


@transition
def errors_in_motion(
    pos: PositionNed, vel: VelocityNed, tilt: Tilt, gyro_bias: GyroBias, accel_bias: AccelBias,
    force: ForceNed, middle: Middle, *, dt_s: float,
) -> MotionErrors:  # fmt: skip
    """theta' = -R dbg, dv' = theta x (R f) - R dba, dp' = dv, by the middle of the step: second order in dt.

    The attitude error turns velocity as it is in the middle, and position goes with the mean velocity.
    """
    turn_n, turn_e, turn_d = to_earth(middle, gyro_bias.gyro_bias_x, gyro_bias.gyro_bias_y, gyro_bias.gyro_bias_z)
    push_n, push_e, push_d = to_earth(middle, accel_bias.accel_bias_x, accel_bias.accel_bias_y, accel_bias.accel_bias_z)
    half_s = 0.5 * dt_s
    half_n, half_e, half_d = (
        tilt.tilt_n - half_s * turn_n,
        tilt.tilt_e - half_s * turn_e,
        tilt.heading - half_s * turn_d,
    )
    after_n = vel.vel_n + dt_s * (half_e * force.force_d - half_d * force.force_e - push_n)
    after_e = vel.vel_e + dt_s * (half_d * force.force_n - half_n * force.force_d - push_e)
    after_d = vel.vel_d + dt_s * (half_n * force.force_e - half_e * force.force_n - push_d)
    return MotionErrors(
        pos_n=pos.pos_n + half_s * (vel.vel_n + after_n),
        pos_e=pos.pos_e + half_s * (vel.vel_e + after_e),
        pos_d=pos.pos_d + half_s * (vel.vel_d + after_d),
        vel_n=after_n, vel_e=after_e, vel_d=after_d,
        tilt_n=tilt.tilt_n - dt_s * turn_n, tilt_e=tilt.tilt_e - dt_s * turn_e, heading=tilt.heading - dt_s * turn_d,
    )  # fmt: skip


@equation
def add_motion_noise(work: Work, lanes: Lanes, dt_s: float, position_walk_m_rt_s: float) -> None:
    """White noise of the specific force on velocity, and of the body rate on attitude: density times dt.

    Position walks by itself too, for what the model leaves out.
    """
    for axis in range(3):
        add_noise(work, lanes, POSITION + axis, position_walk_m_rt_s * position_walk_m_rt_s * dt_s)
        for lane in range(len(lanes)):
            noise = dt_s * work[(ACCEL_NOISE + axis // 2) * len(lanes) + lane]
            work[at(VELOCITY + axis, VELOCITY + axis) * len(lanes) + lane] += noise
        for lane in range(len(lanes)):
            noise = dt_s * work[GYRO_NOISE * len(lanes) + lane]
            work[at(ATTITUDE + axis, ATTITUDE + axis) * len(lanes) + lane] += noise


@equation
def hold_still(work: Work, lanes: Lanes, lane: int) -> None:
    """The IMU reading of one lane becomes that of no turning and no acceleration, in its own attitude and biases."""
    rotation = rotation_of(work, lanes, lane)
    for axis in range(3):
        weight = -GRAVITY_M_S2 * (rotation[6] if axis == 0 else (rotation[7] if axis == 1 else rotation[8]))
        gyro_bias = work[(STATE + GYRO_BIAS + axis) * len(lanes) + lane]
        accel_bias = work[(STATE + ACCEL_BIAS + axis) * len(lanes) + lane]
        work[(IMU + axis) * len(lanes) + lane] = gyro_bias
        work[(IMU + 3 + axis) * len(lanes) + lane] = accel_bias + weight
