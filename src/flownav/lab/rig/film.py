"""The camera on the rod: every frame rendered and matched against the one before, nothing kept but the flow."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import kernel
from flownav.core.measurement import Array
from flownav.lab.optics.block_matching import Matching, Workspace, fits, match, matching_of, workspace
from flownav.lab.optics.camera import Camera, Exposure, effective_focal_px
from flownav.lab.optics.firmware import Firmware
from flownav.lab.optics.pad import Pad
from flownav.lab.optics.projection import pose_looking_down
from flownav.lab.optics.render import (
    Chip,
    Raster,
    digitise,
    noise_bank,
    seen,
    stripe_harmonics,
    stripe_row,
    take_raster_frame,
)
from flownav.lab.rig.pendulum import sensor_pose


class Rod(NamedTuple):
    """Where the camera hangs: rod length, height at rest, the axis along the swing, and its place on the pad."""

    length_m: float
    height_m: float
    along_x: bool
    x0_m: float


class Swing(NamedTuple):
    """A rod's angles as each frame's exposure opens and closes (n,), and the camera's focal length."""

    opened_rad: Array
    closed_rad: Array
    rod: Rod
    focal_px: float


class Stripes(NamedTuple):
    """A pad of stripes: their period, and the harmonics of its brightness."""

    pitch_m: float
    harmonics: Array


class Matcher(NamedTuple):
    """The firmware's search: its settings and its scratch, with the two frames that it holds against each other."""

    settings: Matching
    work: Workspace
    frames: NDArray[np.uint8]


class Film(NamedTuple):
    """Flow (n-1, 2) [px] and quality (n-1) measured from the film."""

    flow_px: Array
    quality: NDArray[np.int64]


@kernel
def film_of_stripes(swing: Swing, stripes: Stripes, chip: Chip, matcher: Matcher, film: Film) -> None:
    """Flow and quality of frames over stripes."""
    opened_rad, closed_rad, rod, focal_px = swing
    pitch_m, harmonics = stripes
    settings, work, frames = matcher
    size = frames.shape[1]
    row, image = np.empty(size), np.empty((size, size), np.float32)
    for k in range(len(opened_rad)):
        first = sensor_pose(opened_rad[k], rod.length_m, rod.height_m, rod.along_x, rod.x0_m)
        last = sensor_pose(closed_rad[k], rod.length_m, rod.height_m, rod.along_x, rod.x0_m)
        middle = sensor_pose(0.5 * (opened_rad[k] + closed_rad[k]), rod.length_m, rod.height_m, rod.along_x, rod.x0_m)
        travel_m = last.x_m - first.x_m + middle.height_m * (last.r13 / last.r33 - first.r13 / first.r33)
        stripe_row(middle, rod.along_x, focal_px, pitch_m, harmonics, abs(travel_m) * focal_px / middle.height_m, row)
        for i in range(size):
            for j in range(size):
                image[i, j] = np.float32(row[j] if rod.along_x else row[i])
        digitise(image, chip.exposure, chip.bank, k, frames[k % 2])
        if k > 0:
            x, y, good = match(frames[(k - 1) % 2].ravel(), frames[k % 2].ravel(), size, settings, work)
            film.flow_px[k - 1, 0], film.flow_px[k - 1, 1], film.quality[k - 1] = x, y, good


@kernel
def film_of_raster(swing: Swing, raster: Raster, chip: Chip, matcher: Matcher, film: Film) -> None:
    """Flow and quality of frames over a raster, blurred beforehand as it is seen from the height at rest."""
    opened_rad, closed_rad, rod, focal_px = swing
    settings, work, frames = matcher
    size = frames.shape[1]
    image = np.empty((size, size), np.float32)
    for k in range(len(opened_rad)):
        first = sensor_pose(opened_rad[k], rod.length_m, rod.height_m, rod.along_x, rod.x0_m)
        last = sensor_pose(closed_rad[k], rod.length_m, rod.height_m, rod.along_x, rod.x0_m)
        take_raster_frame(raster, first, last, focal_px, chip, k, image, frames[k % 2])
        if k > 0:
            x, y, good = match(frames[(k - 1) % 2].ravel(), frames[k % 2].ravel(), size, settings, work)
            film.flow_px[k - 1, 0], film.flow_px[k - 1, 1], film.quality[k - 1] = x, y, good


def film_swing(
    opened_rad: Array,
    closed_rad: Array,
    rod: Rod,
    pad: Pad,
    camera: Camera,
    exposure: Exposure,
    firmware: Firmware,
    seed: int,
) -> tuple[Array, NDArray[np.int64]]:
    """Flow [px] (n-1, 2) and quality (n-1) between frames exposed from `opened_rad[k]` to `closed_rad[k]` (n)."""
    size = camera.width_px
    if camera.height_px != size or not fits(size, size, firmware):
        raise ValueError(f"a square frame that firmware {firmware.name} can search is needed, not {size} px")
    frames = np.zeros((2, size, size), np.uint8)
    film = Film(np.zeros((len(opened_rad) - 1, 2)), np.zeros(len(opened_rad) - 1, np.int64))
    swing = Swing(opened_rad, closed_rad, rod, effective_focal_px(camera))
    chip = Chip(exposure, noise_bank(seed, size))
    matcher = Matcher(matching_of(firmware), workspace(size, size, firmware), frames)
    if pad.stripe_pitch_m > 0.0:
        harmonics = stripe_harmonics(pad.stripe_pitch_m, camera, rod.height_m)
        film_of_stripes(swing, Stripes(pad.stripe_pitch_m, harmonics), chip, matcher, film)
    else:
        view = pose_looking_down(height_m=rod.height_m, yaw_rad=0.0 if rod.along_x else -0.5 * np.pi)
        film_of_raster(swing, Raster(seen(pad, camera, view), pad.texel_m), chip, matcher, film)
    return film.flow_px, film.quality
