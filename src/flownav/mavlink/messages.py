"""From one decoded MAVLink message to measurements: the table of who converts what.

Conversions are pure functions of the message, its log time and a Context. Units and traps stand with each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from flownav.core.measurement import Sensor
from flownav.mavlink import flow_messages, inertial_messages, position_messages
from flownav.mavlink.converted import Context, Outcome, checked
from flownav.mavlink.dialect import Message

CONVERTERS: dict[str, Callable[[Message, float, Context], Iterator[Outcome]]] = {
    "OPTICAL_FLOW": flow_messages.optical_flow,
    "OPTICAL_FLOW_RAD": flow_messages.optical_flow_rad,
    "DISTANCE_SENSOR": flow_messages.distance_sensor,
    "RANGEFINDER": flow_messages.rangefinder,
    "HIGHRES_IMU": inertial_messages.highres_imu,
    "SCALED_IMU": inertial_messages.scaled_imu,
    "SCALED_IMU2": inertial_messages.scaled_imu,
    "SCALED_IMU3": inertial_messages.scaled_imu,
    "RAW_IMU": inertial_messages.raw_imu,
    "ATTITUDE": inertial_messages.attitude,
    "ATTITUDE_QUATERNION": inertial_messages.attitude_quaternion,
    "SCALED_PRESSURE": inertial_messages.scaled_pressure,
    "GPS_RAW_INT": position_messages.gps_raw_int,
    "ODOMETRY": position_messages.odometry,
    "VISION_POSITION_ESTIMATE": position_messages.vision_position_estimate,
    "LANDING_TARGET": position_messages.landing_target,
    "EXTENDED_SYS_STATE": position_messages.extended_sys_state,
}

# where several messages tell of one sensor, the earlier is the finer or the more direct
PREFERENCE: dict[Sensor, tuple[str, ...]] = {
    Sensor.FLOW_RATE: ("OPTICAL_FLOW_RAD", "OPTICAL_FLOW"),
    Sensor.RANGE: ("DISTANCE_SENSOR", "RANGEFINDER", "OPTICAL_FLOW_RAD", "OPTICAL_FLOW"),
    Sensor.IMU: ("HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3"),
    Sensor.MAG: ("HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3"),
    Sensor.ATTITUDE: ("ATTITUDE_QUATERNION", "ATTITUDE"),
    Sensor.BARO: ("SCALED_PRESSURE", "HIGHRES_IMU"),
    Sensor.POSE: ("ODOMETRY", "VISION_POSITION_ESTIMATE"),
    Sensor.YAW: ("GPS_RAW_INT", "ODOMETRY", "VISION_POSITION_ESTIMATE"),
}
INSTANCE_FIELD = {
    "OPTICAL_FLOW": "sensor_id",
    "OPTICAL_FLOW_RAD": "sensor_id",
    "DISTANCE_SENSOR": "id",
    "HIGHRES_IMU": "id",
    "LANDING_TARGET": "target_num",
}


def measurements(message: Message, t_s: float, context: Context) -> tuple[Outcome, ...]:
    """What a message measures at its log time [s], and what of it was dropped and why; empty where nothing.

    A message of a kind that measures nothing yields nothing. Values that are not finite or that no vehicle can have
    are Dropped (`not_finite`, `out_of_range`, `not_unit`).
    """
    convert = CONVERTERS.get(message.msgname)
    return checked(convert(message, t_s, context)) if convert else ()


def instance_of(message: Message) -> int:
    """Which of several like sensors a message is of; 0 where it does not say."""
    name = INSTANCE_FIELD.get(message.msgname)
    return int(getattr(message, name)) if name else 0
