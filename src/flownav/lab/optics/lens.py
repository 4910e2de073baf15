"""A wide lens: where a ray lands, how bright the image is there, what a calibration is off by, and a frame without it.

A ray at the angle theta from the optical axis lands at the radius r = f (theta + k1 theta^3 + k2 theta^5) from the
principal point (Kannala and Brandt, PAMI 28, 2006, of two terms; k1 = 1/3 and k2 = 2/15 are a pinhole's first terms).
Pixels are counted from the image's middle, as `projection` does; rays are tangents (x/z, y/z) in the camera frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import map_coordinates

Array = NDArray[np.float64]

PINHOLE_K1, PINHOLE_K2 = 1.0 / 3.0, 2.0 / 15.0
NEWTON_STEPS = 8
WIDEST_RAD = 1.45  # rays farther from the axis have no tangent worth the name


class Lens(NamedTuple):
    """f [px], where the axis meets the image [px from its middle], and the two terms of its distortion."""

    focal_px: float
    centre_x_px: float = 0.0
    centre_y_px: float = 0.0
    k1: float = PINHOLE_K1
    k2: float = PINHOLE_K2


class Calibration(NamedTuple):
    """How far off what a detector believes of its lens is, one standard deviation each."""

    focal_share: float = 0.003
    centre_px: float = 1.0
    k1: float = 0.004
    k2: float = 0.002


def image_radius_px(lens: Lens, angle_rad: ArrayLike) -> Array:
    """How far from the principal point a ray at this angle from the axis lands."""
    angle = np.asarray(angle_rad, float)
    return np.asarray(lens.focal_px * angle * (1.0 + lens.k1 * angle**2 + lens.k2 * angle**4))


def field_angle_rad(lens: Lens, radius_px: ArrayLike) -> Array:
    """The angle from the axis of what lands at this radius (Newton), at most WIDEST_RAD."""
    wanted = np.asarray(radius_px, float) / lens.focal_px
    angle = np.minimum(wanted, WIDEST_RAD)
    for _ in range(NEWTON_STEPS):
        slope = 1.0 + 3.0 * lens.k1 * angle**2 + 5.0 * lens.k2 * angle**4
        off = image_radius_px(lens, angle) / lens.focal_px - wanted
        angle = np.clip(angle - off / np.maximum(slope, 0.1), 0.0, WIDEST_RAD)
    return angle


def pixels_of(lens: Lens, tangents: Array) -> Array:
    """Pixels (..., 2) from the image's middle at which rays (..., 2) land."""
    size = np.hypot(tangents[..., 0], tangents[..., 1])
    radius = image_radius_px(lens, np.arctan(size))
    scale = np.where(size > 1e-9, radius / np.maximum(size, 1e-9), lens.focal_px)
    return np.asarray(tangents * scale[..., None] + np.array([lens.centre_x_px, lens.centre_y_px]))


def rays_of(lens: Lens, pixels: Array) -> Array:
    """Rays (..., 2) that land on pixels (..., 2) from the image's middle."""
    off = pixels - np.array([lens.centre_x_px, lens.centre_y_px])
    radius = np.hypot(off[..., 0], off[..., 1])
    tangent = np.tan(field_angle_rad(lens, radius))
    scale = np.where(radius > 1e-9, tangent / np.maximum(radius, 1e-9), 1.0 / lens.focal_px)
    return np.asarray(off * scale[..., None])


def illumination(lens: Lens, angle_rad: ArrayLike) -> Array:
    """Brightness of an even scene at this angle, 1 on the axis: what vignetting leaves.

    The pupil is seen narrower by cos(theta), and a pixel takes in the solid angle sin(theta) dtheta / (r dr) f^2:
    cos^4(theta) for a pinhole, cos(theta) sin(theta)/theta for a lens with r = f theta.
    """
    angle = np.maximum(np.asarray(angle_rad, float), 1e-6)
    radius = angle * (1.0 + lens.k1 * angle**2 + lens.k2 * angle**4)
    slope = 1.0 + 3.0 * lens.k1 * angle**2 + 5.0 * lens.k2 * angle**4
    return np.asarray(np.cos(angle) * np.sin(angle) / (radius * slope))


def believed(lens: Lens, wrong: Calibration, normals: ArrayLike) -> Lens:
    """The lens as a calibration has it, off by `wrong` times five standard normals (focal, centre x, y, k1, k2)."""
    focal, x, y, k1, k2 = np.asarray(normals, float)
    return Lens(
        lens.focal_px * (1.0 + wrong.focal_share * focal),
        lens.centre_x_px + wrong.centre_px * x,
        lens.centre_y_px + wrong.centre_px * y,
        lens.k1 + wrong.k1 * k1,
        lens.k2 + wrong.k2 * k2,
    )


class Rectifier(NamedTuple):
    """From a lens's frame to a pinhole's of `focal_px`: where each of the latter's pixels lies, (2, rows, columns)."""

    focal_px: float
    row_column: Array


def pixel_grid(height_px: int, width_px: int) -> Array:
    """Every pixel (height, width, 2) as (x, y) from the image's middle."""
    x, y = np.arange(width_px) - 0.5 * (width_px - 1), np.arange(height_px) - 0.5 * (height_px - 1)
    return np.stack(np.meshgrid(x, y), axis=-1).astype(float)


def rectifier(lens: Lens, height_px: int, width_px: int) -> Rectifier:
    """For frames of this size, as wide and as high as the lens sees along its middle row and column.

    Its focal length is the lens's own on the axis, so that nothing is lost there.
    """
    half = np.tan(field_angle_rad(lens, 0.5 * np.array([width_px, height_px])))
    columns, rows = (2 * int(np.ceil(lens.focal_px * t)) for t in half)
    pixels = pixels_of(lens, pixel_grid(rows, columns) / lens.focal_px)
    row_column = np.stack([pixels[..., 1] + 0.5 * (height_px - 1), pixels[..., 0] + 0.5 * (width_px - 1)])
    return Rectifier(lens.focal_px, row_column)


def rectified(frame: NDArray[np.uint8], by: Rectifier) -> NDArray[np.uint8]:
    """The frame as a pinhole of `by.focal_px` would have it, bilinear; beyond the frame the nearest pixel's grey."""
    levels = map_coordinates(frame.astype(np.float32), by.row_column, order=1, mode="nearest")
    return np.asarray(np.rint(levels), np.uint8)
