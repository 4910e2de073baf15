"""A ULog's references: ground truth, visual odometry, and the autopilot's own estimates."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import heading_from_quaternion, rotation_from_quaternion, to_body, turned_about_down
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Table
from flownav.logs.assembly import possible_variance
from flownav.logs.log import attitude_at, state_table
from flownav.logs.ulog_topics import Topic, Topics

LEAST_ROWS = 2
NED, FRD, BODY = "NED", "FRD", "body"
# vehicle_odometry names its frames by number, differently before (local_frame) and since (pose_frame) PX4 1.14
OLD_FRAMES = {0: NED, 1: FRD, 3: BODY}
NEW_FRAMES = {1: NED, 2: FRD, 3: BODY}


def truth_of(topics: Topics, odometry_serves: bool) -> tuple[Table | None, str]:
    """A simulator's ground truth; else, if it may serve, the visual odometry, with a note."""
    place = topics.fullest("vehicle_local_position_groundtruth", needs=("x", "y", "z"))
    if place is not None:
        place.keep(np.isfinite(place.matrix("x", "y", "z")).all(axis=1), "not_finite")
    if place is not None and len(place) >= LEAST_ROWS:
        turned = topics.fullest("vehicle_attitude_groundtruth", needs=("q[0]", "q[3]"))
        attitude = Stream.of(Sensor.ATTITUDE, turned.t_s, turned.vector("q", 4)) if turned is not None else None
        return _table(place.instant_s, place.matrix("x", "y", "z"), place.matrix("vx", "vy", "vz"), attitude), ""
    odometry = _odometry(topics)
    if not odometry_serves or odometry is None:
        return None, ""
    t_s, quaternion = odometry.instant_s, odometry.vector("q", 4)
    table: Table = {"t_s": t_s, **dict(zip(POSITION_NED, odometry.vector("position", 3).T, strict=True))}
    table |= dict(zip(VELOCITY_BODY, _body_velocity(odometry).T, strict=True))
    table |= dict(zip(QUATERNION, quaternion.T, strict=True))
    return table, f"the reference is the vehicle's own visual odometry, {odometry.label}: not the truth"


def pose_stream(topics: Topics, attitude: Stream | None) -> tuple[Stream | None, str]:
    """The visual odometry as a position measurement, turned to the heading of the attitude where its own is free."""
    odometry = _odometry(topics)
    if odometry is None:
        return None, ""
    position, note = odometry.vector("position", 3), f"{odometry.label} is read as a position measurement"
    if _frame(odometry, "position") != NED:
        turn = _heading_between(odometry, attitude)
        if not np.isfinite(turn):
            return None, f"{odometry.label} is left out: how its frame lies to north is unknown"
        c, s = np.cos(turn), np.sin(turn)
        position = position @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        note += f", turned by {np.degrees(turn):.0f} deg to the heading of the attitude"
    if odometry.has("position_variance[0]"):
        variance = odometry.vector("position_variance", 3)
    else:
        variance = odometry.matrix("pose_covariance[0]", "pose_covariance[6]", "pose_covariance[11]")
    stream = Stream.of(
        Sensor.POSE,
        odometry.t_s,
        position,
        variance=possible_variance(variance),
        delay_s=odometry.delay_s,
        rejected=odometry.rejected,
    )
    return stream, note


def autopilot_estimate(topics: Topics, attitude: Stream | None, source: str) -> tuple[Table | None, str]:
    """vehicle_local_position with the attitude; rows that the autopilot marks as invalid are left out.

    attitude: the log's, of the topic `source`; where that is not the autopilot's own, the estimate's heading is put in.
    """
    topic = topics.fullest("vehicle_local_position", needs=("x", "y", "z", "vx", "vy", "vz"))
    if topic is None:
        return None, ""
    good = np.isfinite(topic.matrix("x", "y", "z", "vx", "vy", "vz")).all(axis=1)
    for flag in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"):
        good &= topic.columns.get(flag, np.ones(len(topic))) > 0
    count, invalid = len(topic), int(np.count_nonzero(~good))
    topic.keep(good, "invalid")
    note = f"the autopilot marks {invalid} of its {count} estimates as invalid" if invalid else ""
    if len(topic) < LEAST_ROWS:
        return None, ""
    t_s = topic.instant_s
    if attitude is not None and source != "vehicle_attitude":
        heading = topic.matrix("heading" if topic.has("heading") else "yaw")[:, 0]
        quaternion = _instants(attitude, t_s)
        attitude = Stream.of(Sensor.ATTITUDE, t_s, _with_heading(quaternion, heading))
    return _table(t_s, topic.matrix("x", "y", "z"), topic.matrix("vx", "vy", "vz"), attitude), note


def _table(t_s: Array, position: Array, velocity_ned: Array, attitude: Stream | None) -> Table:
    """Position NED, and where the attitude is known velocity in body axes and the attitude."""
    return state_table(t_s, position, velocity_ned, None if attitude is None else _instants(attitude, t_s))


def _instants(attitude: Stream, t_s: Array) -> Array:
    """Quaternions (n, 4) at instants; a stream's readings describe what was before they arrived."""
    return attitude_at(replace(attitude, t_s=attitude.t_s - attitude.delay_s), t_s)


# -- visual odometry ---------------------------------------------------------------------------------------
def _odometry(topics: Topics) -> Topic | None:
    """Visual odometry with a position, under the names position, velocity of PX4 1.14; None without."""
    topic = topics.fullest("vehicle_visual_odometry", needs=("position[0]",))
    if topic is None:
        topic = topics.fullest("vehicle_visual_odometry", needs=("x", "y", "z"))
        if topic is None:
            return None
        topic.columns |= {f"position[{k}]": topic.columns[name] for k, name in enumerate("xyz")}
        velocity = topic.matrix("vx", "vy", "vz")
        topic.columns |= {f"velocity[{k}]": velocity[:, k] for k in range(3)}
    topic.keep(np.isfinite(topic.vector("position", 3)).all(axis=1), "not_finite")
    return topic if len(topic) >= LEAST_ROWS else None


def _frame(odometry: Topic, what: str) -> str:
    """The frame of the position or the velocity; without a word, that of the position is NED, the velocity's too."""
    new = odometry.has("pose_frame")
    name = {"position": "pose_frame" if new else "local_frame", "velocity": "velocity_frame"}[what]
    if name not in odometry.columns:
        return NED
    return (NEW_FRAMES if new else OLD_FRAMES).get(int(np.median(odometry.columns[name])), "other")


def _body_velocity(odometry: Topic) -> Array:
    """Velocity in body axes (n, 3)."""
    velocity = odometry.vector("velocity", 3)
    if _frame(odometry, "velocity") == BODY:
        return velocity
    rotation = rotation_from_quaternion(*odometry.vector("q", 4).T)
    return np.column_stack(to_body(rotation, *velocity.T))


def _heading_between(odometry: Topic, attitude: Stream | None) -> float:
    """How far the attitude's heading is clockwise of the odometry's, in the middle [rad]; NaN where unknown."""
    quaternion = odometry.vector("q", 4)
    known = np.isfinite(quaternion).all(axis=1) & (abs(np.linalg.norm(quaternion, axis=1) - 1.0) < 0.1)
    if attitude is None or not known.any():
        return np.nan
    other = _heading(_instants(attitude, odometry.instant_s[known]))
    difference = np.exp(1j * (other - _heading(quaternion[known])))
    middle = np.angle(difference.mean())
    return float(middle + np.median(np.angle(difference * np.exp(-1j * middle))))


def _heading(quaternion: Array) -> NDArray[np.float64]:
    """Heading [rad] of quaternions (n, 4)."""
    w, x, y, z = quaternion.T
    return np.asarray(heading_from_quaternion(w, x, y, z))


def _with_heading(quaternion: Array, heading: Array) -> Array:
    """Attitudes of the same tilt with another heading, where that is known: a turn about the vertical from the left."""
    turn_rad = np.where(np.isfinite(heading), heading - _heading(quaternion), 0.0)
    return np.column_stack(turned_about_down(tuple(quaternion.T), turn_rad))
