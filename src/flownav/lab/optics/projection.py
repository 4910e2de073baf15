"""Where a camera over a plane looks, how its image moves, and when each row of it is exposed.

Camera frame: x to the right of the image, y down, z along the optical axis (right-handed). The ground is the
plane at height 0; the earth frame has x and y in the ground and z down, so a camera at height h stands at
z = -h. Pixels (x, y) are counted from the principal point; f is the focal length in pixels.

Times are from the middle of the exposure of the frame's middle row, which is the instant that the frame is of.

Last: where a plane figure stands before a camera, from points of it that the camera sees, as tangents (x/z, y/z).
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation
from flownav.core.measurement import Array


class Pose(NamedTuple):
    """A camera's place above the ground [m] and its rotation camera -> earth, row by row."""

    x_m: float
    y_m: float
    height_m: float
    r11: float
    r12: float
    r13: float
    r21: float
    r22: float
    r23: float
    r31: float
    r32: float
    r33: float


def pose_looking_down(
    x_m: float = 0.0,
    y_m: float = 0.0,
    height_m: float = 1.0,
    *,
    roll_rad: float = 0.0,
    pitch_rad: float = 0.0,
    yaw_rad: float = 0.0,
) -> Pose:
    """A camera that looks down, turned by yaw, then pitch, then roll about its own z, y and x (Euler 3-2-1)."""
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    cp, sp = np.cos(pitch_rad), np.sin(pitch_rad)
    cy, sy = np.cos(yaw_rad), np.sin(yaw_rad)
    return Pose(
        x_m,
        y_m,
        height_m,
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )


@equation
def ground_point(pose: Pose, x_px: float, y_px: float, focal_px: float) -> tuple[float, float, float]:
    """Ground point (x, y) [m] that pixel (x_px, y_px) sees, and its depth Z along the optical axis [m]."""
    u, v = x_px / focal_px, y_px / focal_px
    depth_m = pose.height_m / (pose.r31 * u + pose.r32 * v + pose.r33)
    x_m = pose.x_m + depth_m * (pose.r11 * u + pose.r12 * v + pose.r13)
    y_m = pose.y_m + depth_m * (pose.r21 * u + pose.r22 * v + pose.r23)
    return x_m, y_m, depth_m


@equation
def image_point(pose: Pose, x_m: float, y_m: float, focal_px: float) -> tuple[float, float]:
    """Pixel (x, y) at which the ground point (x_m, y_m) appears."""
    north, east, down = x_m - pose.x_m, y_m - pose.y_m, pose.height_m
    right = pose.r11 * north + pose.r21 * east + pose.r31 * down
    below = pose.r12 * north + pose.r22 * east + pose.r32 * down
    depth_m = pose.r13 * north + pose.r23 * east + pose.r33 * down
    return focal_px * right / depth_m, focal_px * below / depth_m


# -- the shutter -------------------------------------------------------------------------------------------------
class FlightMotion(NamedTuple):
    """How the camera moves while a frame is taken: velocity in the earth frame [m/s], rates in its own [rad/s]."""

    velocity_x_m_s: float
    velocity_y_m_s: float
    velocity_z_m_s: float
    rate_x_rad_s: float
    rate_y_rad_s: float
    rate_z_rad_s: float


@equation
def row_time_s(row: float, rows: int, readout_s: float) -> float:
    """The middle of a row's exposure; readout_s: from the first row to the one after the last, 0 for a global shutter.

    A rate w that moves the image along its rows shears it by w readout_s f pixels from top to bottom.
    """
    return (row - 0.5 * (rows - 1)) / rows * readout_s


@equation
def part_time_s(part: int, parts: int, exposure_s: float) -> float:
    """The middle of the `part`-th of equal parts of an exposure: what moves by w rad/s is w exposure_s f wide."""
    return ((part + 0.5) / parts - 0.5) * exposure_s


@equation
def moved(pose: Pose, motion: FlightMotion, time_s: float) -> Pose:
    """The pose this much later, the turn to the first order: good to 1e-4 rad in 15 ms at 1 rad/s."""
    x, y, z = motion.rate_x_rad_s * time_s, motion.rate_y_rad_s * time_s, motion.rate_z_rad_s * time_s
    return Pose(
        pose.x_m + motion.velocity_x_m_s * time_s,
        pose.y_m + motion.velocity_y_m_s * time_s,
        pose.height_m - motion.velocity_z_m_s * time_s,
        pose.r11 + pose.r12 * z - pose.r13 * y,
        pose.r12 + pose.r13 * x - pose.r11 * z,
        pose.r13 + pose.r11 * y - pose.r12 * x,
        pose.r21 + pose.r22 * z - pose.r23 * y,
        pose.r22 + pose.r23 * x - pose.r21 * z,
        pose.r23 + pose.r21 * y - pose.r22 * x,
        pose.r31 + pose.r32 * z - pose.r33 * y,
        pose.r32 + pose.r33 * x - pose.r31 * z,
        pose.r33 + pose.r31 * y - pose.r32 * x,
    )


MOST_STEPS = 30


class PlanePose(NamedTuple):
    """The figure's axes as columns of `rotation` (3, 3), its origin `place_m` (3,), both in the camera frame.

    `rms` is of the image points about their prediction [tangent], each coordinate.
    """

    rotation: Array
    place_m: Array
    rms: float


def homography(source: Array, image: Array) -> Array | None:
    """The projective map (3, 3) from four points to four points, each (4, 2); None where three lie on a line."""
    rows, right = np.zeros((8, 8)), np.empty(8)
    for k in range(4):
        (x, y), (u, v) = source[k], image[k]
        rows[2 * k] = [x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y]
        rows[2 * k + 1] = [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y]
        right[2 * k : 2 * k + 2] = u, v
    try:
        entries = np.linalg.solve(rows, right)
    except np.linalg.LinAlgError:
        return None
    return np.append(entries, 1.0).reshape(3, 3) if np.isfinite(entries).all() else None


def mapped(transform: Array, points: Array) -> Array:
    """Points (n, 2) under a projective map."""
    whole = points @ transform[:, :2].T + transform[:, 2]
    return np.asarray(whole[:, :2] / whole[:, 2:])


def plane_pose(figure_m: Array, tangents: Array) -> PlanePose | None:
    """The pose with the least squared error in the image, of four points (4, 2) of the plane z = 0; None without one.

    A small plane has two poses that look almost alike, tilted either way about the line of sight (Schweighofer and
    Pinz 2006): both are refined, the better one is returned.
    """
    transform = homography(figure_m, tangents)
    if transform is None:
        return None
    first = _from_homography(transform)
    if first is None:
        return None
    refined = [_refined(*start, figure_m, tangents) for start in (first, (_tilted_back(*first), first[1]))]
    ahead = [pose for pose in refined if np.isfinite(pose.rms) and pose.place_m[2] > 0.0]
    return min(ahead, key=lambda pose: pose.rms) if ahead else None


def _from_homography(transform: Array) -> tuple[Array, Array] | None:
    """Rotation and place from the columns of the map, which are two axes and the origin but for one scale."""
    size = 0.5 * (np.linalg.norm(transform[:, 0]) + np.linalg.norm(transform[:, 1]))
    if not 1e-12 < size < 1e12:
        return None
    columns = transform / (size if transform[2, 2] > 0.0 else -size)
    axes = np.column_stack([columns[:, 0], columns[:, 1], np.cross(columns[:, 0], columns[:, 1])])
    left, _, right = np.linalg.svd(axes)
    return left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right, columns[:, 2]


def _tilted_back(rotation: Array, place_m: Array) -> Array:
    """The plane tilted as much to the other side of the line of sight."""
    sight = place_m / np.linalg.norm(place_m)
    normal = rotation[:, 2]
    axis = np.cross(normal, sight)
    size = float(np.linalg.norm(axis))
    angle = 2.0 * float(np.arctan2(size, normal @ sight))
    return rotation if size < 1e-12 else _turn(axis * (angle / size)) @ rotation


def _turn(vector: Array) -> Array:
    """The rotation about a vector by its length [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle > 0.0 else np.zeros(3)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * skew @ skew)


def _refined(rotation: Array, place_m: Array, figure_m: Array, tangents: Array) -> PlanePose:
    """Levenberg-Marquardt on three small turns and the place."""
    damping = 1e-3
    error, slope = _error(rotation, place_m, figure_m, tangents)
    for _ in range(MOST_STEPS):
        normal = slope.T @ slope
        step = np.linalg.lstsq(normal + damping * np.diag(np.diag(normal) + 1e-15), -slope.T @ error, rcond=None)[0]
        turned, moved = _turn(np.asarray(step[:3], float)) @ rotation, place_m + step[3:]
        new_error, new_slope = _error(turned, moved, figure_m, tangents)
        if not new_error @ new_error < error @ error:
            damping *= 10.0
            if damping > 1e6:
                break
            continue
        rotation, place_m, error, slope = turned, moved, new_error, new_slope
        damping = max(damping * 0.1, 1e-12)
        if np.abs(step[:3]).max() < 1e-12 and np.abs(step[3:]).max() < 1e-12 * np.linalg.norm(place_m):
            break
    return PlanePose(rotation, place_m, float(np.sqrt(np.mean(error**2))))


def _error(rotation: Array, place_m: Array, figure_m: Array, tangents: Array) -> tuple[Array, Array]:
    """Predicted less seen tangents (8,) and their derivatives (8, 6) by turn and place."""
    turned = figure_m @ rotation[:, :2].T
    x, y, z = (turned + place_m).T
    z = np.where(np.abs(z) < 1e-9, 1e-9, z)
    zero = np.zeros_like(z)
    by_point = np.stack(
        [np.column_stack([1.0 / z, zero, -x / z**2]), np.column_stack([zero, 1.0 / z, -y / z**2])], axis=1
    )
    ax, ay, az = turned.T
    by_turn = np.stack(
        [np.column_stack([zero, az, -ay]), np.column_stack([-az, zero, ax]), np.column_stack([ay, -ax, zero])], axis=1
    )
    slope = np.concatenate([by_point @ by_turn, by_point], axis=2).reshape(-1, 6)
    return (np.column_stack([x / z, y / z]) - tangents).ravel(), slope
