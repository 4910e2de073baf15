"""The PX4FLOW's camera: 64x64 super-pixels of 24 um behind a 16 mm lens, its focus, exposure and noise.

The lens is a thin lens: screwed out to focus at distance d it stands f d/(d - f) from the sensor, so the image
is larger by 1/(1 - f/d) than the firmware, which knows only f, believes; what is not at d is blurred to a disc.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flownav.core.errors import InputError

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
    """What automatic exposure settled on: time [s], gain, and the grey level of a perfectly white pad."""

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
    """Of averaging over a length: the pixel's own (1 px), or the way the image moves during the exposure."""
    return np.asarray(np.sinc(np.asarray(frequency, float) * length_px))


def gauss_transfer(frequency: ArrayLike, sigma_px: float) -> NDArray[np.float64]:
    """Of a Gaussian blur."""
    return np.asarray(np.exp(-2.0 * (np.pi * sigma_px * np.asarray(frequency, float)) ** 2))


def disc_transfer(frequency: ArrayLike, diameter_px: float, nodes: int = 64) -> NDArray[np.float64]:
    """Of the blur disc of defocus, 2 J1(x)/x with x = pi D nu; negative where the contrast is reversed.

    The disc's width at offset s is sqrt(1 - s²): Gauss-Chebyshev quadrature of the second kind is exact.
    """
    angle = np.arange(1, nodes + 1) * np.pi / (nodes + 1)
    x = np.pi * diameter_px * np.asarray(frequency, float)[..., None]
    weights = 2.0 / (nodes + 1) * np.sin(angle) ** 2
    return np.asarray((weights * np.cos(x * np.cos(angle))).sum(-1))


def lens_transfer(camera: Camera, frequency: ArrayLike, distance_m: float) -> NDArray[np.float64]:
    """Of lens and defocus together at a distance (radial frequency [cycles/px])."""
    disc = disc_transfer(frequency, defocus_px(camera, distance_m))
    return gauss_transfer(frequency, camera.psf_px) * disc
