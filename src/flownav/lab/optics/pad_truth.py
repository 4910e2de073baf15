"""The pad as it is from a camera's pose, and how far a fix is off it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.lab.optics.pad_fix import PadFix
from flownav.lab.optics.pad_target import PadTarget, corners_m
from flownav.lab.optics.projection import Pose, image_point

Array = NDArray[np.float64]

WRONG_CENTRE, WRONG_DISTANCE = 0.5, 0.1  # of the pad's side, of the distance: a fix farther off is wrong, not noisy


class Truth(NamedTuple):
    """Tangents towards camera x and y, distance from the lens, heading, rays of the corners (4, 2) of the square that
    is looked for and of the whole board, which a tag's white ring belongs to; the height from which a level target
    looks as small straight above it (`sensors.pad_camera.reach_of`).
    """

    tan_forward: float
    tan_right: float
    distance_m: float
    heading_rad: float
    corner_rays: Array
    board_rays: Array
    reach_m: float


def truth_of(pose: Pose, target: PadTarget) -> Truth:
    """What a perfect fix says, camera axes taken as the body's."""
    rotation = np.array(pose[3:]).reshape(3, 3)
    forward, right, down = rotation.T @ np.array([-pose.x_m, -pose.y_m, pose.height_m])
    wider = target.board_m / target.side_m
    corners, board = (
        np.array([image_point(pose, x, y, 1.0) for x, y in of]) for of in (corners_m(target), wider * corners_m(target))
    )
    distance_m = float(np.sqrt(forward**2 + right**2 + down**2))
    heading = float(np.arctan2(rotation[0, 1], rotation[0, 0]))
    return Truth(
        float(forward / down), float(right / down), distance_m, heading, corners, board, distance_m**2 / pose.height_m
    )


def fix_error(fix: PadFix, truth: Truth) -> Array:
    """Across the sight forward and sideways [rad], distance as a part of it, heading [rad]: measured less true.

    The angles are those between the two lines of sight, taken apart along the triad of `estimation.laws.pad`.
    """
    a, b = truth.tan_forward, truth.tan_right
    level, length = np.sqrt(1.0 + a * a), np.sqrt(1.0 + a * a + b * b)
    along = (1.0 + a * fix.tan_forward + b * fix.tan_right) / length
    across = (fix.tan_forward - a) / level / along
    sideways = ((1.0 + a * a) * fix.tan_right - b * (1.0 + a * fix.tan_forward)) / (level * length) / along
    whole_turn = 2.0 * np.pi if fix.coded else np.pi
    heading = (fix.heading_rad - truth.heading_rad + 0.5 * whole_turn) % whole_turn - 0.5 * whole_turn
    return np.array([np.arctan(across), np.arctan(sideways), fix.distance_m / truth.distance_m - 1.0, heading])


def is_wrong(error: Array, truth: Truth, target: PadTarget) -> bool:
    """Whether something else was taken for the pad."""
    off_m = float(np.hypot(error[0], error[1])) * truth.distance_m
    return bool(abs(error[2]) > WRONG_DISTANCE or off_m > WRONG_CENTRE * target.side_m)
