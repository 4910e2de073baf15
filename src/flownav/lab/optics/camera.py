"""The PX4FLOW's camera, its focus, exposure and noise; and a wide lens, its calibration, and a frame without it.

The lens is a thin lens: screwed out to focus at distance d it stands f d/(d - f) from the sensor, so the image
is larger by 1/(1 - f/d) than the firmware, which knows only f, believes; what is not at d is blurred to a disc.

A ray at the angle theta from the optical axis lands at the radius r = f (theta + k1 theta^3 + k2 theta^5) from the
principal point (Kannala and Brandt, PAMI 28, 2006, of two terms; k1 = 1/3 and k2 = 2/15 are a pinhole's first terms).
Pixels are counted from the image's middle, as `projection` does; rays are tangents (x/z, y/z) in the camera frame.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import map_coordinates

from flownav.core.errors import InputError
from flownav.core.measurement import Array

SUPER_PIXEL_M = 24e-6
FOCAL_M = 0.016
FIRMWARE_FOCAL_PX = FOCAL_M / SUPER_PIXEL_M  # 666.67
FRAME_PX = 64


class Camera(NamedTuple):
    """Lens and sensor. `focus_m` is where the lens is focused, `psf_px` the lens's own blur (standard deviation)."""

    width_px: int = FRAME_PX
    height_px: int = FRAME_PX
    pixel_m: float = SUPER_PIXEL_M
    focal_m: float = FOCAL_M
    f_number: float = 2.0
    focus_m: float = 0.6
    psf_px: float = 0.5
    target_grey: float = 90.0
    normal_exposure_s: float = 1.5e-3
    longest_exposure_s: float = 3.5e-3
    largest_gain: float = 4.0
    read_noise_grey: float = 1.4
    photon_noise_grey: float = 0.02

    @property
    def nominal_focal_px(self) -> float:
        """The focal length that a firmware assumes [px]."""
        return self.focal_m / self.pixel_m


class Exposure(NamedTuple):
    """Result of automatic exposure: time [s], gain, and the grey level of a perfectly white pad."""

    time_s: float
    gain: float
    white_grey: float
    read_noise_grey: float
    photon_noise_grey: float


# relative to the light at which the camera reaches its target in its normal exposure
LIGHTS = {"low": 0.08, "normal": 1.0, "intense": 10.0}
MEAN_REFLECTANCE = 0.5


def light_named(name: str) -> float:
    """Relative illumination of `low`, `normal` or `intense` light; InputError lists them."""
    if name not in LIGHTS:
        raise InputError(f"light {name!r}: unknown; known are {', '.join(LIGHTS)}")
    return LIGHTS[name]


def effective_focal_px(camera: Camera) -> float:
    """Focal length of the image as focused [px]: the nominal one times 1/(1 - f/d), 2.7 % more at 0.6 m."""
    return camera.nominal_focal_px / (1.0 - camera.focal_m / camera.focus_m)


def defocus_px(camera: Camera, distance_m: float) -> float:
    """Diameter of the blur disc of a point at `distance_m` [px]; 5.5 px at 1.5 m, focused at 0.6 m at f/2."""
    image_m = camera.focal_m / (1.0 - camera.focal_m / camera.focus_m)
    aperture_m = camera.focal_m / camera.f_number
    return aperture_m * image_m * abs(1.0 / camera.focus_m - 1.0 / distance_m) / camera.pixel_m


def refocused(camera: Camera, distance_m: float, fraction: float) -> Camera:
    """The lens turned this fraction of the way (in dioptres) from where it is focused to `distance_m`."""
    dioptres = (1.0 - fraction) / camera.focus_m + fraction / distance_m
    return camera._replace(focus_m=1.0 / dioptres)


def exposed(camera: Camera, illumination: float) -> Exposure:
    """Automatic exposure: first the time, then the gain, as far as each goes, towards the target grey level.

    `illumination` is relative to the light that needs the normal exposure. Photon noise is proportional to the
    root of the grey level (`photon_noise_grey` is its variance per grey level) and is amplified with the gain.
    """
    time_s = min(camera.normal_exposure_s / illumination, camera.longest_exposure_s)
    collected = camera.target_grey * illumination * time_s / camera.normal_exposure_s
    gain = min(camera.target_grey / collected, camera.largest_gain)
    white_grey = collected * gain / MEAN_REFLECTANCE
    return Exposure(time_s, gain, white_grey, camera.read_noise_grey * gain, camera.photon_noise_grey * gain)


# -- modulation transfer: what blur does to a pattern of frequency nu [cycles/px] -----------------------------
def box_transfer(frequency: ArrayLike, length_px: float) -> NDArray[np.float64]:
    """Transfer of averaging over a length: the pixel's own (1 px), or the way the image moves during the exposure."""
    return np.asarray(np.sinc(np.asarray(frequency, float) * length_px))


def gauss_transfer(frequency: ArrayLike, sigma_px: float) -> NDArray[np.float64]:
    """Transfer of a Gaussian blur."""
    return np.asarray(np.exp(-2.0 * (np.pi * sigma_px * np.asarray(frequency, float)) ** 2))


def disc_transfer(frequency: ArrayLike, diameter_px: float, nodes: int = 64) -> NDArray[np.float64]:
    """Transfer of the blur disc of defocus, 2 J1(x)/x with x = pi D nu; negative where the contrast is reversed.

    The disc's width at offset s is sqrt(1 - s²): Gauss-Chebyshev quadrature of the second kind is exact.
    """
    angle = np.arange(1, nodes + 1) * np.pi / (nodes + 1)
    x = np.pi * diameter_px * np.asarray(frequency, float)[..., None]
    weights = 2.0 / (nodes + 1) * np.sin(angle) ** 2
    return np.asarray((weights * np.cos(x * np.cos(angle))).sum(-1))


def lens_transfer(camera: Camera, frequency: ArrayLike, distance_m: float) -> NDArray[np.float64]:
    """Transfer of lens and defocus together at a distance (radial frequency [cycles/px])."""
    disc = disc_transfer(frequency, defocus_px(camera, distance_m))
    return gauss_transfer(frequency, camera.psf_px) * disc


# -- a wide lens -------------------------------------------------------------------------------------------------
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
    """Errors of a detector's calibration of its lens, one standard deviation each."""

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
