"""HIGHRES_IMU, SCALED_IMU, RAW_IMU, ATTITUDE, ATTITUDE_QUATERNION, SCALED_PRESSURE: what moves with the body."""

from __future__ import annotations

import math
from collections.abc import Iterator

from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler
from flownav.core.measurement import Sensor
from flownav.mavlink.converted import Context, Dropped, Outcome, reading
from flownav.mavlink.dialect import Message

ACCEL, GYRO, MAG, PRESSURE = 0x007, 0x038, 0x1C0, 0x200  # HIGHRES_IMU.fields_updated
SEA_LEVEL_HPA = 1013.25
ATMOSPHERE_M, EXPONENT = 44330.77, 0.1902632  # ISO 2533: T0 / L and R L / g
MILLI = 1e-3
LARGEST_ANGLE_RAD = 2.1 * math.pi


def highres_imu(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """HIGHRES_IMU (#105): m/s2, rad/s, gauss, hPa, body FRD.

    Trap: only what `fields_updated` names is new; the rest repeats or is 0. The IMU needs both accelerometer and
    gyro new.
    """
    updated = message.fields_updated
    if updated & (ACCEL | GYRO) == ACCEL | GYRO:
        gyro, force = (message.xgyro, message.ygyro, message.zgyro), (message.xacc, message.yacc, message.zacc)
        yield reading(Sensor.IMU, t_s, *gyro, *force)
    elif updated & (ACCEL | GYRO):
        yield Dropped(Sensor.IMU, "incomplete")
    if updated & MAG == MAG:
        yield reading(Sensor.MAG, t_s, message.xmag, message.ymag, message.zmag)
    if updated & PRESSURE:
        yield from _altitude(message.abs_pressure, t_s)


def scaled_imu(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """SCALED_IMU, 2, 3 (#26, 116, 129): thousandths of g, of rad/s and of gauss, body FRD.

    Traps. A thousandth of g is the accelerometer's resolution. Three zeros of field are no magnetometer.
    """
    gyro = (MILLI * message.xgyro, MILLI * message.ygyro, MILLI * message.zgyro)
    milli_g = MILLI * GRAVITY_M_S2
    yield reading(Sensor.IMU, t_s, *gyro, milli_g * message.xacc, milli_g * message.yacc, milli_g * message.zacc)
    if message.xmag or message.ymag or message.zmag:
        yield reading(Sensor.MAG, t_s, MILLI * message.xmag, MILLI * message.ymag, MILLI * message.zmag)


def raw_imu(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """RAW_IMU (#27): counts of the sensor, by its definition; ArduPilot sends thousandths, as in SCALED_IMU."""
    if context.ardupilot:
        yield from scaled_imu(message, t_s, context)
    else:
        yield Dropped(Sensor.IMU, "raw_counts")


def attitude(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """ATTITUDE (#30): roll, pitch, yaw [rad], Z-Y-X, yaw from true north."""
    angles = message.roll, message.pitch, message.yaw
    if all(abs(angle) <= LARGEST_ANGLE_RAD for angle in angles):
        yield reading(Sensor.ATTITUDE, t_s, *(float(value) for value in quaternion_from_euler(*angles)))
    else:
        yield Dropped(Sensor.ATTITUDE, "out_of_range" if all(map(math.isfinite, angles)) else "not_finite")


def attitude_quaternion(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """ATTITUDE_QUATERNION (#31): q1..q4 are w, x, y, z, body FRD to earth NED; `repr_offset_q` is for displays."""
    yield reading(Sensor.ATTITUDE, t_s, message.q1, message.q2, message.q3, message.q4)


def scaled_pressure(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """SCALED_PRESSURE (#29): hPa, to pressure altitude."""
    yield from _altitude(message.press_abs, t_s)


def pressure_altitude_m(pressure_hpa: float) -> float:
    """Altitude in the International Standard Atmosphere's troposphere (ISO 2533), 15 degC and 1013.25 hPa at 0 m."""
    return ATMOSPHERE_M * (1.0 - math.pow(pressure_hpa / SEA_LEVEL_HPA, EXPONENT))


def pressure_hpa(altitude_m: float) -> float:
    """The inverse of `pressure_altitude_m`."""
    return SEA_LEVEL_HPA * math.pow(1.0 - altitude_m / ATMOSPHERE_M, 1.0 / EXPONENT)


def _altitude(pressure: float, t_s: float) -> Iterator[Outcome]:
    if not pressure > 0.0:
        yield Dropped(Sensor.BARO, "not_finite" if pressure != pressure else "out_of_range")
    else:
        yield reading(Sensor.BARO, t_s, pressure_altitude_m(pressure))
