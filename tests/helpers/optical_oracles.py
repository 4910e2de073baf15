"""How the image of a camera over a plane moves, analytically: the oracle of the laboratory."""

from __future__ import annotations

from typing import NamedTuple

from flownav.core.compile import equation


class CameraMotion(NamedTuple):
    """Velocity [m/s] and rates [rad/s] of the camera in its own frame."""

    velocity_x_m_s: float
    velocity_y_m_s: float
    velocity_z_m_s: float
    rate_x_rad_s: float
    rate_y_rad_s: float
    rate_z_rad_s: float


@equation
def motion_field(
    motion: CameraMotion, depth_m: float, x_px: float, y_px: float, focal_px: float
) -> tuple[float, float]:
    """Speed of the image [px/s] at pixel (x, y) of depth Z (Honegger 2013; paper section III.A; section 4.4).

    vx = (Tz x - Tx f)/Z - wy f + wz y + (wx x y - wy x²)/f
    vy = (Tz y - Ty f)/Z + wx f - wz x + (wx y² - wy x y)/f
    """
    tx, ty, tz, wx, wy, wz = motion
    x, y, f = x_px, y_px, focal_px
    speed_x = (tz * x - tx * f) / depth_m - wy * f + wz * y + (wx * x * y - wy * x * x) / f
    speed_y = (tz * y - ty * f) / depth_m + wx * f - wz * x + (wx * y * y - wy * x * y) / f
    return speed_x, speed_y
