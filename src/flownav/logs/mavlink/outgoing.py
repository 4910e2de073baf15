"""Messages that are sent: flownav's estimate to an autopilot, and an autopilot's messages, for a simulated vehicle.

Pure functions of a pymavlink `MAVLink` (see `framing.coder`), returning the message to pack or send. Inside, all is
NED, FRD, SI, radians, Hamilton quaternions; the messages' units and frames are made here. An autopilot's values are
rounded to the message's resolution; values beyond a field's range are held at its limit.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from flownav.core.frames import Quaternion, Vector, euler_from_quaternion, rotation_from_quaternion, to_body
from flownav.core.measurement import Array, Measurement
from flownav.logs.mavlink.framing import INVALID_AUTOPILOT, Message
from flownav.logs.mavlink.position_messages import BODY_FRD, LOCAL_FRD, LOCAL_NED, UNKNOWN_16
from flownav.logs.mavlink.sensor_messages import ACCEL, DOWN, GYRO, MAG, PRESSURE, UNKNOWN_COVARIANCE, pressure_hpa

NAN = float("nan")
ESTIMATOR_VIO = 3  # MAV_ESTIMATOR_TYPE
UPPER = np.triu_indices(6)
HELICOPTER, ONBOARD_CONTROLLER, GENERIC_AUTOPILOT = 4, 18, 0  # MAV_TYPE, MAV_AUTOPILOT
ODOMETRY_COMPONENT = 197  # MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY, the component that flownav sends as
ARMED, ACTIVE, STANDBY = 128, 4, 3  # MAV_MODE_FLAG, MAV_STATE
MAVLINK_VERSION = 3
FIX_3D = 3
UNKNOWN_DISTANCE_M = -1.0
WRAP_MS = 2**32


class Estimate(NamedTuple):
    """The part of a filter's state that is sent.

    time_us: microseconds on the clock agreed with the autopilot (its boot time by TIMESYNC, or UNIX). Position and
    velocity in NED [m, m/s], attitude body FRD to earth NED, body rates [rad/s] (NaN where unknown).
    pose_covariance (6, 6): north, east, down, roll, pitch, yaw. velocity_covariance (6, 6): velocity in the axes
    of `vel_ned_m_s`, body rates. None where unknown. reset_counter counts every jump of the estimate. quality: 1 to
    100 percent, 0 unstated, -1 failed.
    """

    time_us: int
    pos_ned_m: Vector
    vel_ned_m_s: Vector
    quaternion: Quaternion
    rate_frd_rad_s: Vector = (NAN, NAN, NAN)
    pose_covariance: Array | None = None
    velocity_covariance: Array | None = None
    reset_counter: int = 0
    quality: int = 0


def companion_heartbeat(mav: Any) -> Message:
    """HEARTBEAT (#0) of a companion computer."""
    return mav.heartbeat_encode(ONBOARD_CONTROLLER, INVALID_AUTOPILOT, 0, 0, ACTIVE, MAVLINK_VERSION)


def odometry(mav: Any, estimate: Estimate, *, frame: int = LOCAL_FRD, estimator_type: int = ESTIMATOR_VIO) -> Message:
    """ODOMETRY (#331): pose in LOCAL_FRD or LOCAL_NED, velocity in BODY_FRD.

    Traps. ArduPilot takes LOCAL_FRD and no other; PX4 takes the heading from LOCAL_NED only, whose first axis is
    north. Velocity is of the body axes, and its covariance is turned with it. A covariance that is not known is NaN
    in its first entry; 0 elsewhere could be read as certainty, so all are NaN. PX4 takes a jump without a new
    `reset_counter` for motion, and estimator types other than naive, vision, VIO and motion capture for an error.
    """
    rotation = rotation_from_quaternion(*estimate.quaternion)
    velocity = [float(value) for value in to_body(rotation, *estimate.vel_ned_m_s)]
    return mav.odometry_encode(
        estimate.time_us,
        frame,
        BODY_FRD,
        *estimate.pos_ned_m,
        [*estimate.quaternion],
        *velocity,
        *estimate.rate_frd_rad_s,
        upper_triangle(estimate.pose_covariance),
        upper_triangle(_in_body(estimate.velocity_covariance, np.reshape(rotation, (3, 3)))),
        estimate.reset_counter % 256,
        estimator_type,
        max(-1, min(100, estimate.quality)),
    )


def vision_position_estimate(mav: Any, estimate: Estimate) -> Message:
    """VISION_POSITION_ESTIMATE (#102), what ArduPilot takes beside ODOMETRY: NED [m], roll, pitch, yaw [rad]."""
    angles = [float(angle) for angle in euler_from_quaternion(*estimate.quaternion)]
    return mav.vision_position_estimate_encode(
        estimate.time_us,
        *estimate.pos_ned_m,
        *angles,
        upper_triangle(estimate.pose_covariance),
        estimate.reset_counter % 256,
    )


def vision_speed_estimate(mav: Any, estimate: Estimate) -> Message:
    """VISION_SPEED_ESTIMATE (#103): velocity NED [m/s]; its covariance is the whole 3x3, row by row."""
    known = estimate.velocity_covariance
    covariance = [NAN] * 9 if known is None else [float(value) for value in np.asarray(known)[:3, :3].ravel()]
    return mav.vision_speed_estimate_encode(
        estimate.time_us, *estimate.vel_ned_m_s, covariance, estimate.reset_counter % 256
    )


def landing_target(
    mav: Any,
    time_us: int,
    tan_forward: float,
    tan_right: float,
    distance_m: float,
    *,
    target: int = 0,
    pad_ned_m: Vector | None = None,
) -> Message:
    """LANDING_TARGET (#149) from a sighting of the pad: angles and distance, and the position in BODY_FRD.

    tan_forward, tan_right: tangents of the angles from body down; distance along the line of sight [m], NaN where
    unknown: then it is sent as 0 and the position as not valid. angle_x is to the right, angle_y backwards.
    pad_ned_m: the pad's place about the autopilot's origin, sent in LOCAL_NED in place of the one in BODY_FRD.

    Trap. ArduPilot takes BODY_FRD and no other frame, PX4 LOCAL_NED and no other: it refuses a valid position in
    BODY_FRD with `landing target: unsupported coordinate frame` (mavlink_receiver.cpp, handle_message_landing_target).
    """
    known = math.isfinite(distance_m) and distance_m > 0.0
    down = distance_m / math.sqrt(1.0 + tan_forward**2 + tan_right**2) if known else 0.0
    place = (tan_forward * down, tan_right * down, down) if pad_ned_m is None else pad_ned_m
    return mav.landing_target_encode(
        time_us,
        target,
        BODY_FRD if pad_ned_m is None else LOCAL_NED,
        math.atan(tan_right),
        math.atan(-tan_forward),
        distance_m if known else 0.0,
        0.0,
        0.0,
        *place,
        [1.0, 0.0, 0.0, 0.0],
        0,
        int(known),
    )


def upper_triangle(covariance: Array | None) -> list[float]:
    """A 6x6 covariance as its upper triangle, row by row (21 values); all NaN where it is unknown or not finite."""
    if covariance is None or not np.isfinite(covariance).all():
        return [NAN] * len(UPPER[0])
    triangle: list[float] = np.asarray(covariance)[UPPER].tolist()
    return triangle


def _in_body(covariance: Array | None, body_to_earth: Array) -> Array | None:
    """A covariance of earth velocity and body rates with its velocity turned into body axes."""
    if covariance is None:
        return None
    turn = np.eye(6)
    turn[:3, :3] = body_to_earth.T
    return np.asarray(turn @ covariance @ turn.T)


# -- an autopilot's messages -------------------------------------------------------------------------------------
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


def hil_gps(mav: Any, time_us: int, fix_deg_m: tuple[float, float, float], vel_ned_m_s: Vector) -> Message:
    """HIL_GPS (#113) of a good fix: latitude, longitude [deg], altitude [m]."""
    north, east, down = (round(v * 1e2) for v in vel_ned_m_s)
    latitude, longitude, altitude = fix_deg_m
    return mav.hil_gps_encode(
        time_us, FIX_3D, round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3), 50, 80,
        round(math.hypot(north, east)), north, east, down,
        round(math.degrees(math.atan2(east, north)) * 1e2) % 36000, 14,
    )  # fmt: skip


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
