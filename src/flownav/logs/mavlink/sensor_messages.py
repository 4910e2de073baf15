"""Messages of what looks down and of what moves with the body: flow, range, inertial readings, attitude, pressure.

Flow is in PX4's sensor convention, which is MAVLink's: a right-hand turn about an axis is positive flow about it.
"""

import math
from collections.abc import Iterator

from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler
from flownav.core.measurement import Measurement, Sensor
from flownav.logs.mavlink.converted import NAN, Context, Dropped, Outcome, quality_of, reading
from flownav.logs.mavlink.framing import Message

DOWN = 25  # MAV_SENSOR_ROTATION_PITCH_270
UNKNOWN_COVARIANCE = 255
INVALID_SIGNAL = 1
LONGEST_INTEGRATION_S = 1.0
ACCEL, GYRO, MAG, PRESSURE = 0x007, 0x038, 0x1C0, 0x200  # HIGHRES_IMU.fields_updated
SEA_LEVEL_HPA = 1013.25
ATMOSPHERE_M, EXPONENT = 44330.77, 0.1902632  # ISO 2533: T0 / L and R L / g
MILLI = 1e-3
LARGEST_ANGLE_RAD = 2.1 * math.pi


def optical_flow(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """OPTICAL_FLOW (#100): angular rate, or velocity and distance, and quality 0..255.

    Traps. `flow_x/y` are tenths of pixels of an unknown lens, and ArduPilot truncates its rad/s into them, to 0:
    they are never used. `flow_rate_x/y` [rad/s] are extension fields: a sender that lacks them shows 0.
    `flow_comp_m_x/y` are m/s of the body, forward and right, by the message's definition; ArduPilot puts there the
    flow rate less the body's rate [rad/s], so the difference of the two is the gyro's rate over the exposure. Its
    `ground_distance` is its filter's height above ground, no reading of a rangefinder.
    """
    quality = float(message.quality)
    rate_x, rate_y = message.flow_rate_x, message.flow_rate_y
    if context.ardupilot:
        gyro = rate_x - message.flow_comp_m_x, rate_y - message.flow_comp_m_y
        yield reading(Sensor.FLOW_RATE, t_s, rate_x, rate_y, *gyro, quality=quality)
        return
    if rate_x or rate_y:
        yield reading(Sensor.FLOW_RATE, t_s, rate_x, rate_y, NAN, NAN, quality=quality)
    yield reading(Sensor.FLOW_VELOCITY, t_s, message.flow_comp_m_x, message.flow_comp_m_y, NAN, quality=quality)
    if message.ground_distance > 0.0:
        yield reading(Sensor.RANGE, t_s, message.ground_distance)


def optical_flow_rad(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """OPTICAL_FLOW_RAD (#106): angles [rad] summed over integration_time_us, quality 0..255, distance [m].

    Traps. Angles, not rates: divided by the integration time, which may be 0 without data. The gyro's angles are
    NaN where the sensor has no gyro. A negative distance is unknown; 0 is the output of a rangefinder without an echo.
    A reading describes the middle of its integration.
    """
    interval_s = message.integration_time_us * 1e-6
    if not 0.0 < interval_s <= LONGEST_INTEGRATION_S:
        yield Dropped(Sensor.FLOW_RATE, "no_interval")
    else:
        angles = message.integrated_x, message.integrated_y, message.integrated_xgyro, message.integrated_ygyro
        rates = (angle / interval_s for angle in angles)
        yield reading(Sensor.FLOW_RATE, t_s, *rates, quality=float(message.quality), delay_s=0.5 * interval_s)
    if message.distance > 0.0:
        yield reading(Sensor.RANGE, t_s, message.distance, delay_s=message.time_delta_distance_us * 1e-6)


def distance_sensor(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """DISTANCE_SENSOR (#132): cm, limits in cm, variance in cm^2, signal quality in percent.

    Traps. Only orientation 25 looks down. A reading outside the sensor's own limits is none (ArduPilot sends 0
    without an echo); limits of 0 and 0 are not stated. Variance: 255 is unknown, 0 unset. signal_quality: 0 is
    unknown, 1 invalid, 100 best.
    """
    if message.orientation != DOWN:
        return
    distance, low, high = message.current_distance, message.min_distance, message.max_distance
    if message.signal_quality == INVALID_SIGNAL:
        yield Dropped(Sensor.RANGE, "invalid")
    elif (high > low and not low <= distance <= high) or not distance:
        yield Dropped(Sensor.RANGE, "outside_limits")
    else:
        stated = 0 < message.covariance < UNKNOWN_COVARIANCE
        variance = message.covariance * 1e-4 if stated else NAN
        quality = quality_of(message.signal_quality)
        yield Measurement(t_s, Sensor.RANGE, (distance * 1e-2,), (variance,), 0.0, quality)


def rangefinder(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """RANGEFINDER (#173, ArduPilot): metres, downwards. Traps: no time, no limits, and 0 is no reading."""
    if message.distance > 0.0:
        yield reading(Sensor.RANGE, t_s, message.distance)
    else:
        yield Dropped(Sensor.RANGE, "outside_limits")


def range_limits_m(message: Message) -> tuple[float, float] | None:
    """The limits that a downward DISTANCE_SENSOR states [m]; None where it states none."""
    if message.orientation != DOWN or message.max_distance <= message.min_distance:
        return None
    return message.min_distance * 1e-2, message.max_distance * 1e-2


# -- inertial readings, attitude, pressure ------------------------------------------------------------------
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

    Traps. A thousandth of g is the accelerometer's resolution. Three zeros of field are no magnetometer, six of motion
    are no IMU: ArduPilot sends SCALED_IMU3 of a vehicle that has two. PX4's IMU is
    calibrated, without its filter's biases, and its field is the sensor's own, neither calibrated nor turned
    (streams/SCALED_IMU.hpp): ArduPilot's alone is taken.
    """
    gyro = (MILLI * message.xgyro, MILLI * message.ygyro, MILLI * message.zgyro)
    milli_g = MILLI * GRAVITY_M_S2
    force = (milli_g * message.xacc, milli_g * message.yacc, milli_g * message.zacc)
    yield reading(Sensor.IMU, t_s, *gyro, *force) if any((*gyro, *force)) else Dropped(Sensor.IMU, "no_data")
    if context.ardupilot and (message.xmag or message.ymag or message.zmag):
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
