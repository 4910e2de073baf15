"""The result of converting a message: its measurements, and what was dropped and why. Absurd values never pass."""

import math
from collections.abc import Iterable
from typing import NamedTuple

from flownav.core.frames import Quaternion, Vector
from flownav.core.measurement import Measurement, Sensor

NAN = float("nan")
LARGEST_UNIT_ERROR = 0.05  # of a quaternion's length


class Pose(NamedTuple):
    """Where the vehicle is: north, east, down [m] and attitude, body FRD to earth NED."""

    pos_ned_m: Vector
    quaternion: Quaternion


class Context(NamedTuple):
    """Data that a message does not contain.

    ardupilot: its sender is an ArduPilot autopilot. autopilot: its sender is the autopilot, of whatever make.
    origin_deg_m: latitude, longitude [deg], altitude [m] of the local frame. pose: the vehicle's, where known.
    """

    ardupilot: bool = False
    autopilot: bool = True
    origin_deg_m: tuple[float, float, float] | None = None
    pose: Pose | None = None


class Dropped(NamedTuple):
    """A reading that is not passed on."""

    sensor: Sensor
    reason: str


Outcome = Measurement | Dropped

# the largest magnitude of each value; a wrong unit or a broken sensor lies beyond
LIMITS: dict[Sensor, tuple[float, ...]] = {
    Sensor.GPS_POSITION: (1e6, 1e6, 1e5),
    Sensor.GPS_VELOCITY: (150.0, 150.0, 150.0),
    Sensor.FLOW_RATE: (70.0, 70.0, 70.0, 70.0),
    Sensor.FLOW_VELOCITY: (150.0, 150.0, 150.0),
    Sensor.RANGE: (1000.0,),
    Sensor.IMU: (70.0, 70.0, 70.0, 400.0, 400.0, 400.0),
    Sensor.ATTITUDE: (1.0 + LARGEST_UNIT_ERROR,) * 4,
    Sensor.BARO: (20000.0,),
    Sensor.MAG: (20.0, 20.0, 20.0),
    Sensor.POSE: (1e5, 1e5, 1e5),
    Sensor.YAW: (2.1 * math.pi,),
    Sensor.PAD: (20.0, 20.0, 1000.0),
    Sensor.LANDED: (1.0,),
}
# values that a sensor may leave out (NaN): the flow's gyro, vertical velocities, the pad's distance
OPTIONAL: dict[Sensor, frozenset[int]] = {
    Sensor.FLOW_RATE: frozenset({2, 3}),
    Sensor.FLOW_VELOCITY: frozenset({2}),
    Sensor.GPS_VELOCITY: frozenset({2}),
    Sensor.PAD: frozenset({2}),
}


def checked(outcomes: Iterable[Outcome]) -> tuple[Outcome, ...]:
    """Measurements with a value that is not finite or not possible become Dropped; absurd variances become NaN."""
    return tuple(_checked(outcome) if isinstance(outcome, Measurement) else outcome for outcome in outcomes)


def _checked(reading: Measurement) -> Outcome:
    optional = OPTIONAL.get(reading.sensor, frozenset())
    for column, (value, limit) in enumerate(zip(reading.value, LIMITS[reading.sensor], strict=True)):
        if not math.isfinite(value):
            if column in optional and value != value:
                continue
            return Dropped(reading.sensor, "not_finite")
        if abs(value) > limit:
            return Dropped(reading.sensor, "out_of_range")
    if reading.sensor == Sensor.ATTITUDE:
        length = math.sqrt(sum(value * value for value in reading.value))
        if abs(length - 1.0) > LARGEST_UNIT_ERROR:
            return Dropped(reading.sensor, "not_unit")
        reading = reading._replace(value=tuple(value / length for value in reading.value))
    if all(variance != variance or 0.0 < variance < 1e12 for variance in reading.variance):
        return reading
    return reading._replace(variance=tuple(v if 0.0 < v < 1e12 else NAN for v in reading.variance))


def unstated(sensor: Sensor) -> tuple[float, ...]:
    """The variances of a sensor that states none."""
    return (NAN,) * len(LIMITS[sensor])


def reading(sensor: Sensor, t_s: float, *value: float, quality: float = 255.0, delay_s: float = 0.0) -> Measurement:
    """A measurement without a stated variance."""
    return Measurement(t_s, sensor, value, unstated(sensor), delay_s, quality)


def quality_of(percent: int) -> float:
    """0..255 of MAVLink's 1..100 percent; 0, which is not stated, and more than 100 are 255."""
    return min(percent, 100) * 255 / 100 if percent else 255.0
