"""OPTICAL_FLOW, OPTICAL_FLOW_RAD, DISTANCE_SENSOR, RANGEFINDER: what looks down.

Flow is in PX4's sensor convention, which is MAVLink's: a right-hand turn about an axis is positive flow about it.
"""

from __future__ import annotations

from collections.abc import Iterator

from flownav.core.measurement import Measurement, Sensor
from flownav.mavlink.converted import NAN, Context, Dropped, Outcome, quality_of, reading
from flownav.mavlink.dialect import Message

DOWN = 25  # MAV_SENSOR_ROTATION_PITCH_270
UNKNOWN_COVARIANCE = 255
INVALID_SIGNAL = 1
LONGEST_INTEGRATION_S = 1.0


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
    NaN where the sensor has no gyro. A negative distance is unknown; 0 is what a rangefinder that sees nothing says.
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

    Traps. Only orientation 25 looks down. A reading outside the sensor's own limits is none (ArduPilot says 0 when
    it sees nothing); limits of 0 and 0 are not stated. Variance: 255 is unknown, 0 unset. signal_quality: 0 is
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
