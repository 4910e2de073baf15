"""What an autopilot's estimator or a simulator says of the vehicle's state: compared with, never fused.

LOCAL_POSITION_NED, GLOBAL_POSITION_INT; SIM_STATE and HIL_STATE_QUATERNION, which are a simulator's truth.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flownav.core.frames import Quaternion, Vector
from flownav.mavlink.converted import LARGEST_UNIT_ERROR
from flownav.mavlink.dialect import Message

LARGEST_DEG = 90.0
FARTHEST_M, FASTEST_M_S, QUICKEST_RAD_S = 1e6, 1e3, 70.0  # beyond is no vehicle


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
