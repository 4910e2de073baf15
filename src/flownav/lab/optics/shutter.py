"""When a pixel is exposed: the rows of a rolling shutter one after the other, each over the exposure's length.

Times are from the middle of the exposure of the frame's middle row, which is the instant that the frame is of.
"""

from __future__ import annotations

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.lab.optics.projection import Pose


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
