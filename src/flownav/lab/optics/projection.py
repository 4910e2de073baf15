"""Where a camera over a plane looks, and how its image moves: the analytic oracle of the laboratory.

Camera frame: x to the right of the image, y down, z along the optical axis (right-handed). The ground is the
plane at height 0; the earth frame has x and y in the ground and z down, so a camera at height h stands at
z = -h. Pixels (x, y) are counted from the principal point; f is the focal length in pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation


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
