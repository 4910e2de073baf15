"""Where a plane figure stands before a camera, from points of it that the camera sees.

Camera frame: x to the right of the image, y down, z along the optical axis. Image points are tangents (x/z, y/z).
"""

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array

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
