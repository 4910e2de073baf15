"""Messages that flownav sends: its estimate to an autopilot. `sensors_outgoing` is the other end's.

Pure functions of a pymavlink `MAVLink` (see `dialect.coder`), returning the message to pack or send. Inside, all is
NED, FRD, SI, radians, Hamilton quaternions; the messages' units and frames are made here.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from flownav.core.frames import Quaternion, Vector, euler_from_quaternion, rotation_from_quaternion, to_body
from flownav.core.measurement import Array
from flownav.mavlink.dialect import Message
from flownav.mavlink.position_messages import BODY_FRD, LOCAL_FRD, LOCAL_NED

NAN = float("nan")
ESTIMATOR_VIO = 3  # MAV_ESTIMATOR_TYPE
UPPER = np.triu_indices(6)


class Estimate(NamedTuple):
    """What is sent of a filter's state.

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
    pad_ned_m: the pad's place about the autopilot's origin, told in LOCAL_NED in place of the one in BODY_FRD.

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
    return [float(value) for value in np.asarray(covariance)[UPPER]]


def _in_body(covariance: Array | None, body_to_earth: Array) -> Array | None:
    """A covariance of earth velocity and body rates with its velocity turned into body axes."""
    if covariance is None:
        return None
    turn = np.eye(6)
    turn[:3, :3] = body_to_earth.T
    return np.asarray(turn @ covariance @ turn.T)
