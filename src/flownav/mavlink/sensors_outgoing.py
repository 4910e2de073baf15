"""Messages that an autopilot sends, built from measurements: the simulated vehicle's end of a link.

Each takes a pymavlink `MAVLink` and a Measurement of measurement.py (or plain SI values), and rounds to the
message's resolution; values beyond a field's range are held at its limit.
"""

from __future__ import annotations

import math
from typing import Any

from flownav.core.frames import Quaternion, Vector
from flownav.core.measurement import Measurement
from flownav.mavlink.dialect import Message
from flownav.mavlink.flow_messages import DOWN, UNKNOWN_COVARIANCE
from flownav.mavlink.inertial_messages import ACCEL, GYRO, MAG, PRESSURE, pressure_hpa
from flownav.mavlink.position_messages import UNKNOWN_16

HELICOPTER, GENERIC_AUTOPILOT = 4, 0  # MAV_TYPE, MAV_AUTOPILOT
ARMED, ACTIVE, STANDBY = 128, 4, 3  # MAV_MODE_FLAG, MAV_STATE
MAVLINK_VERSION = 3
FIX_3D = 3
UNKNOWN_DISTANCE_M = -1.0
WRAP_MS = 2**32


def heartbeat(mav: Any, *, armed: bool, autopilot: int = GENERIC_AUTOPILOT) -> Message:
    """HEARTBEAT (#0) of a helicopter, once a second."""
    return mav.heartbeat_encode(
        HELICOPTER, autopilot, ARMED if armed else 0, 0, ACTIVE if armed else STANDBY, MAVLINK_VERSION
    )


def highres_imu(
    mav: Any,
    time_us: int,
    imu: Measurement,
    *,
    mag_gauss: Vector | None = None,
    altitude_m: float | None = None,
) -> Message:
    """HIGHRES_IMU (#105): rates and specific force, and field and pressure where given; the rest is marked as old."""
    p, q, r, x, y, z = imu.value
    updated = ACCEL | GYRO | (MAG if mag_gauss else 0) | (0 if altitude_m is None else PRESSURE)
    pressure = 0.0 if altitude_m is None else pressure_hpa(altitude_m)
    field = mag_gauss or (0.0, 0.0, 0.0)
    return mav.highres_imu_encode(time_us, x, y, z, p, q, r, *field, pressure, 0.0, altitude_m or 0.0, 15.0, updated)


def attitude_quaternion(mav: Any, time_boot_ms: int, quaternion: Quaternion, rate_frd_rad_s: Vector) -> Message:
    """ATTITUDE_QUATERNION (#31)."""
    return mav.attitude_quaternion_encode(time_boot_ms % WRAP_MS, *quaternion, *rate_frd_rad_s)


def gps_raw_int(
    mav: Any,
    time_us: int,
    fix_deg_m: tuple[float, float, float],
    velocity: Measurement,
    *,
    horizontal_sigma_m: float,
    vertical_sigma_m: float,
) -> Message:
    """GPS_RAW_INT (#24) of a 3-D fix: latitude, longitude [deg], altitude [m]; the vertical velocity has no field."""
    north, east = velocity.value[:2]
    course = math.degrees(math.atan2(east, north)) % 360.0
    latitude, longitude, altitude = fix_deg_m
    sigma = math.sqrt(velocity.variance[0]) if velocity.variance[0] > 0.0 else 0.0
    return mav.gps_raw_int_encode(
        time_us,
        FIX_3D,
        round(latitude * 1e7),
        round(longitude * 1e7),
        round(altitude * 1e3),
        UNKNOWN_16,
        UNKNOWN_16,
        _held(math.hypot(north, east) * 1e2, UNKNOWN_16 - 1),
        round(course * 1e2) % 36000,
        10,
        round(altitude * 1e3),
        _held(horizontal_sigma_m * 1e3, 2**32 - 1),
        _held(vertical_sigma_m * 1e3, 2**32 - 1),
        _held(sigma * 1e3, 2**32 - 1),
        0,
        0,
    )


def optical_flow_rad(
    mav: Any, time_us: int, flow: Measurement, interval_s: float, *, distance_m: float = UNKNOWN_DISTANCE_M
) -> Message:
    """OPTICAL_FLOW_RAD (#106) from a FLOW_RATE reading: rates times the interval; NaN gyros stay NaN."""
    flow_x, flow_y, gyro_x, gyro_y = flow.value
    return mav.optical_flow_rad_encode(
        time_us,
        0,
        round(interval_s * 1e6),
        flow_x * interval_s,
        flow_y * interval_s,
        gyro_x * interval_s,
        gyro_y * interval_s,
        float("nan"),
        0,
        _held(flow.quality, 255),
        0,
        distance_m,
    )


def distance_sensor(mav: Any, time_boot_ms: int, reading: Measurement, limits_m: tuple[float, float]) -> Message:
    """DISTANCE_SENSOR (#132), downwards: cm, and cm^2 of variance (255 unknown)."""
    (distance,), (variance,) = reading.value, reading.variance
    return mav.distance_sensor_encode(
        time_boot_ms % WRAP_MS,
        _held(limits_m[0] * 1e2, UNKNOWN_16),
        _held(limits_m[1] * 1e2, UNKNOWN_16),
        _held(distance * 1e2, UNKNOWN_16),
        0,
        0,
        DOWN,
        max(1, _held(variance * 1e4, UNKNOWN_COVARIANCE - 1)) if variance > 0.0 else UNKNOWN_COVARIANCE,
        signal_quality=max(2, _held(reading.quality / 2.55, 100)) if reading.quality > 0.0 else 1,
    )


def extended_sys_state(mav: Any, *, landed: bool) -> Message:
    """EXTENDED_SYS_STATE (#245): on the ground, or in air."""
    return mav.extended_sys_state_encode(0, 1 if landed else 2)


def sim_state(
    mav: Any,
    position_deg_m: tuple[float, float, float],
    vel_ned_m_s: Vector,
    quaternion: Quaternion,
    angles_rad: Vector,
    rate_frd_rad_s: Vector,
    force_frd_m_s2: Vector,
) -> Message:
    """SIM_STATE (#108), a simulator's truth: degrees in lat and lon as defined, and in 1e-7 deg beside."""
    latitude, longitude, altitude = position_deg_m
    return mav.sim_state_encode(
        *quaternion,
        *angles_rad,
        *force_frd_m_s2,
        *rate_frd_rad_s,
        latitude,
        longitude,
        altitude,
        0.0,
        0.0,
        *vel_ned_m_s,
        round(latitude * 1e7),
        round(longitude * 1e7),
    )


def timesync_reply(mav: Any, request: Message, now_ns: int) -> Message | None:
    """TIMESYNC (#111): their time mirrored, ours beside it; None where the message is no request (its tc1 is not 0)."""
    return None if request.tc1 else mav.timesync_encode(now_ns, request.ts1)


def _held(value: float, most: int) -> int:
    """Rounded, and held to 0..most."""
    return max(0, min(most, round(value)))
