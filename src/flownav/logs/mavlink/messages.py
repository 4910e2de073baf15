"""From one decoded MAVLink message to measurements, by the table of converters, and to states.

Conversions are pure functions of the message, its log time and a Context. Units and traps stand with each. States
are outputs of an autopilot's estimator or a simulator: LOCAL_POSITION_NED, GLOBAL_POSITION_INT; SIM_STATE and
HIL_STATE_QUATERNION, which are a simulator's truth. They are compared with, never fused.
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from flownav.core.frames import Quaternion, Vector
from flownav.core.measurement import Sensor
from flownav.logs.mavlink import position_messages, sensor_messages
from flownav.logs.mavlink.converted import LARGEST_UNIT_ERROR, Context, Outcome, checked
from flownav.logs.mavlink.framing import Message

LARGEST_DEG = 90.0
FARTHEST_M, FASTEST_M_S, QUICKEST_RAD_S = 1e6, 1e3, 70.0  # beyond is no vehicle
CONVERTERS: dict[str, Callable[[Message, float, Context], Iterator[Outcome]]] = {
    "OPTICAL_FLOW": sensor_messages.optical_flow,
    "OPTICAL_FLOW_RAD": sensor_messages.optical_flow_rad,
    "DISTANCE_SENSOR": sensor_messages.distance_sensor,
    "RANGEFINDER": sensor_messages.rangefinder,
    "HIGHRES_IMU": sensor_messages.highres_imu,
    "SCALED_IMU": sensor_messages.scaled_imu,
    "SCALED_IMU2": sensor_messages.scaled_imu,
    "SCALED_IMU3": sensor_messages.scaled_imu,
    "RAW_IMU": sensor_messages.raw_imu,
    "ATTITUDE": sensor_messages.attitude,
    "ATTITUDE_QUATERNION": sensor_messages.attitude_quaternion,
    "SCALED_PRESSURE": sensor_messages.scaled_pressure,
    "GPS_RAW_INT": position_messages.gps_raw_int,
    "ODOMETRY": position_messages.odometry,
    "VISION_POSITION_ESTIMATE": position_messages.vision_position_estimate,
    "LANDING_TARGET": position_messages.landing_target,
    "EXTENDED_SYS_STATE": position_messages.extended_sys_state,
}

# where several messages hold one sensor, the earlier is the finer or the more direct
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


class LocalState(NamedTuple):
    """Position north, east, down about the estimator's own origin [m], velocity north, east, down [m/s]."""

    pos_ned_m: Vector
    vel_ned_m_s: Vector


class GlobalState(NamedTuple):
    """Latitude, longitude [deg], altitude above mean sea level [m] and velocity north, east, down [m/s]."""

    position_deg_m: Vector
    vel_ned_m_s: Vector


class TrueState(NamedTuple):
    """A simulator's truth: the global state, attitude body FRD to earth NED, and body rates [rad/s]."""

    position_deg_m: Vector
    vel_ned_m_s: Vector
    quaternion: Quaternion
    rate_frd_rad_s: Vector


def local_position_ned(message: Message) -> LocalState | None:
    """LOCAL_POSITION_NED (#32): m and m/s. None where a value is not finite or not possible."""
    position, velocity = (message.x, message.y, message.z), (message.vx, message.vy, message.vz)
    return LocalState(position, velocity) if _possible(position, velocity) else None


def global_position_int(message: Message) -> GlobalState | None:
    """GLOBAL_POSITION_INT (#33): 1e-7 deg, mm, cm/s; the filter's output, not the receiver's. None at 0, 0."""
    if not (message.lat or message.lon) or abs(message.lat) > LARGEST_DEG * 1e7:
        return None
    velocity = (message.vx * 1e-2, message.vy * 1e-2, message.vz * 1e-2)
    return GlobalState((message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3), velocity)


def sim_state(message: Message) -> TrueState | None:
    """SIM_STATE (#108): metres, m/s, rad/s, quaternion w, x, y, z.

    Traps. No time. `lat`, `lon` are single-precision degrees by definition, and degrees * 1e7 from ArduPilot: the
    integers are right (`lat_int`, `lon_int`, 1e-7 deg), the others serve only where both are 0.
    """
    latitude, longitude = message.lat_int * 1e-7, message.lon_int * 1e-7
    if not message.lat_int and not message.lon_int:
        scale = 1e-7 if max(abs(message.lat), abs(message.lon)) > 2.0 * LARGEST_DEG else 1.0
        latitude, longitude = message.lat * scale, message.lon * scale
    return _true_state(
        (latitude, longitude, message.alt),
        (message.vn, message.ve, message.vd),
        (message.q1, message.q2, message.q3, message.q4),
        (message.xgyro, message.ygyro, message.zgyro),
    )


def hil_state_quaternion(message: Message) -> TrueState | None:
    """HIL_STATE_QUATERNION (#115): 1e-7 deg, mm, cm/s, rad/s, w, x, y, z."""
    w, x, y, z = message.attitude_quaternion
    return _true_state(
        (message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3),
        (message.vx * 1e-2, message.vy * 1e-2, message.vz * 1e-2),
        (w, x, y, z),
        (message.rollspeed, message.pitchspeed, message.yawspeed),
    )


def _true_state(position: Vector, velocity: Vector, quaternion: Quaternion, rate: Vector) -> TrueState | None:
    length = math.sqrt(sum(value * value for value in quaternion))
    if not abs(length - 1.0) <= LARGEST_UNIT_ERROR or not _possible(position, velocity, rate):
        return None
    if abs(position[0]) > LARGEST_DEG:
        return None
    w, x, y, z = (value / length for value in quaternion)
    return TrueState(position, velocity, (w, x, y, z), rate)


def _possible(position: Vector, velocity: Vector, rate: Vector = (0.0, 0.0, 0.0)) -> bool:
    """Whether all is finite and within what a vehicle can do; NaN compares as false."""
    return (
        all(abs(value) <= FARTHEST_M for value in position)
        and all(abs(value) <= FASTEST_M_S for value in velocity)
        and all(abs(value) <= QUICKEST_RAD_S for value in rate)
    )


STATES: dict[str, Callable[[Message], LocalState | GlobalState | TrueState | None]] = {
    "LOCAL_POSITION_NED": local_position_ned,
    "GLOBAL_POSITION_INT": global_position_int,
    "SIM_STATE": sim_state,
    "HIL_STATE_QUATERNION": hil_state_quaternion,
}


# -- measurements -------------------------------------------------------------------------------------------
def measurements(message: Message, t_s: float, context: Context) -> tuple[Outcome, ...]:
    """The measurements in a message at its log time [s], and what of it was dropped and why; empty where nothing.

    A message of a kind that measures nothing yields nothing. Values that are not finite or that no vehicle can have
    are Dropped (`not_finite`, `out_of_range`, `not_unit`).
    """
    convert = CONVERTERS.get(message.msgname)
    return checked(convert(message, t_s, context)) if convert else ()


def instance_of(message: Message) -> int:
    """Which of several like sensors a message is of; 0 where it does not state it."""
    name = INSTANCE_FIELD.get(message.msgname)
    return int(getattr(message, name)) if name else 0
