"""Frames of a pad as the camera takes them: projection, blur by lens, pixel and motion, noise, 8 bits.

Blur is linear, so the pad is blurred rather than the frame: `seen` applies lens, defocus and the pixel's own area
by Fourier transform, at the scale at which the camera sees the pad, and a frame then samples the result along
its rays. Motion blur is the mean over two instants of the exposure (the Gauss points), which has the variance of
the whole. Stripes seen square on need no raster: `stripe_row` sums their harmonics.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import cos, equation, kernel, sin, write_function
from flownav.core.errors import InputError
from flownav.lab.optics.camera import (
    Camera,
    Exposure,
    box_transfer,
    effective_focal_px,
    exposed,
    lens_transfer,
    light_named,
)
from flownav.lab.optics.pad import BLACK, WHITE, Pad
from flownav.lab.optics.projection import Pose, ground_point

NOISE_BANK = 1 << 17
GAUSS_POINT = 0.28867513459481287  # the two instants: mid-exposure -+ this part of it
HIGHEST_FREQUENCY = 1.5  # harmonics of stripes are summed up to here [cycles/px]
SCALE_TOLERANCE = 0.05
RADIAL_SAMPLES = 512
GOLDEN = np.uint64(0x9E3779B97F4A7C15)


# -- blur ----------------------------------------------------------------------------------------------------
def footprint(pose: Pose, focal_px: float) -> NDArray[np.float64]:
    """How the ground point moves with the pixel at the frame's centre, [[dx/du, dx/dv], [dy/du, dy/dv]] [m/px]."""
    step = 0.5
    columns = []
    for u, v in ((step, 0.0), (0.0, step)):
        ahead, behind = ground_point(pose, u, v, focal_px), ground_point(pose, -u, -v, focal_px)
        columns.append([(ahead[i] - behind[i]) / (2.0 * step) for i in (0, 1)])
    return np.array(columns).T


def seen(pad: Pad, camera: Camera, pose: Pose) -> NDArray[np.float32]:
    """The pad's raster under the blur of lens, defocus and pixel as they are at the centre of this view."""
    ground = footprint(pose, effective_focal_px(camera))
    return blurred(pad, camera, ground, ground_point(pose, 0.0, 0.0, 1.0)[2])


def blurred(pad: Pad, camera: Camera, ground: NDArray[np.float64], distance_m: float) -> NDArray[np.float32]:
    """The pad's raster under lens, defocus at a distance and pixel; `ground` (2, 2) [m/px] as `footprint` has it."""
    rows, columns = pad.reflectance.shape
    fy = np.fft.fftfreq(rows, pad.texel_m)[:, None]
    fx = np.fft.rfftfreq(columns, pad.texel_m)[None, :]
    u, v = ground[0, 0] * fx + ground[1, 0] * fy, ground[0, 1] * fx + ground[1, 1] * fy  # [cycles/px]
    radial = np.hypot(u, v)
    samples = np.linspace(0.0, float(radial.max()), RADIAL_SAMPLES)
    lens = np.interp(radial, samples, lens_transfer(camera, samples, distance_m))
    spectrum = np.fft.rfft2(pad.reflectance) * lens * box_transfer(u, 1.0) * box_transfer(v, 1.0)
    return np.fft.irfft2(spectrum, pad.reflectance.shape).astype(np.float32)


def stripe_harmonics(pitch_m: float, camera: Camera, distance_m: float) -> NDArray[np.float64]:
    """Amplitudes of the odd harmonics 1, 3, 5 ... of a striped pad as pixels of the camera see them, rows (k, nu, A).

    A square wave between BLACK and WHITE has the amplitudes (WHITE - BLACK) 2/(pi k); each is reduced by the
    blur at its frequency k nu [cycles/px].
    """
    frequency = distance_m / effective_focal_px(camera) / pitch_m
    k = np.arange(1, max(HIGHEST_FREQUENCY / frequency, 2.0), 2.0)
    transfer = box_transfer(k * frequency, 1.0) * lens_transfer(camera, k * frequency, distance_m)
    return np.column_stack([k, k * frequency, (WHITE - BLACK) * 2.0 / (np.pi * k) * transfer])


# -- kernels: reflectance along rays, then grey levels ----------------------------------------------------------
@kernel
def stripe_row(pose, along_x, focal_px, pitch_m, harmonics, blur_px, row):  # type: ignore[no-untyped-def]
    """Reflectance along the frame's middle row (or column), for stripes that lie square to it.

    `blur_px` is how far the image moves during the exposure.
    """
    middle = 0.5 * (len(row) - 1)
    for n in range(len(row)):
        offset = n - middle
        x_m = ground_point(pose, offset if along_x else 0.0, 0.0 if along_x else offset, focal_px)[0]
        phase = 2.0 * np.pi * (x_m / pitch_m - np.floor(x_m / pitch_m))
        this, before = sin(phase), -sin(phase)
        twice = 2.0 * cos(2.0 * phase)
        total = 0.5 * (WHITE + BLACK)
        for i in range(len(harmonics)):
            smear = np.pi * harmonics[i, 1] * blur_px
            total += harmonics[i, 2] * this * (sin(smear) / smear if smear > 1e-6 else 1.0)
            this, before = twice * this - before, this
        row[n] = total


@equation
def sampled(raster, x, y):  # type: ignore[no-untyped-def]
    """A repeating raster between its samples, bilinear; x and y in texels from the middle of the first."""
    rows, columns = raster.shape
    x, y = x - np.floor(x / columns) * columns, y - np.floor(y / rows) * rows
    column, row = min(int(x), columns - 1), min(int(y), rows - 1)
    right, below = (column + 1 if column + 1 < columns else 0), (row + 1 if row + 1 < rows else 0)
    a, b = x - column, y - row
    upper = (1.0 - a) * raster[row, column] + a * raster[row, right]
    lower = (1.0 - a) * raster[below, column] + a * raster[below, right]
    return (1.0 - b) * upper + b * lower


@kernel
def add_view(raster, texel_m, pose, focal_px, weight, image):  # type: ignore[no-untyped-def]
    """Adds `weight` times the reflectance that every pixel sees to `image` (height, width) float32."""
    height, width = image.shape
    for row in range(height):
        for column in range(width):
            u, v = column - 0.5 * (width - 1), row - 0.5 * (height - 1)
            x_m, y_m, _ = ground_point(pose, u, v, focal_px)
            image[row, column] += weight * sampled(raster, x_m / texel_m - 0.5, y_m / texel_m - 0.5)


@equation
def scrambled(counter):  # type: ignore[no-untyped-def]
    """SplitMix64: 64 random bits of a counter."""
    z = np.uint64(counter) * GOLDEN
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@kernel
def digitise(image, exposure, bank, frame, grey):  # type: ignore[no-untyped-def]
    """Grey levels 0..255 of reflectances: read and photon noise, rounding, saturation.

    Every row of every frame takes its normals from a random place of `bank`, by counter: (frame, row).
    """
    white, photon = np.float32(exposure.white_grey), np.float32(exposure.photon_noise_grey)
    read = np.float32(exposure.read_noise_grey * exposure.read_noise_grey)
    half, least, most = np.float32(0.5), np.float32(0.0), np.float32(255.0)
    height, width = image.shape
    for row in range(height):
        start = scrambled(np.uint64(frame) * np.uint64(height) + np.uint64(row) + np.uint64(1)) % np.uint64(NOISE_BANK)
        normals = bank[start : start + np.uint64(width)]
        for column in range(width):
            level = white * image[row, column]
            level += np.float32(np.sqrt(read + photon * max(level, least))) * normals[column]
            grey[row, column] = np.uint8(min(max(level + half, least), most))


class Raster(NamedTuple):
    """A pad as reflectance, and the side of one of its texels."""

    reflectance: NDArray[np.float32]
    texel_m: float


class Chip(NamedTuple):
    """Digitiser of an image: exposure, and normals for its noise."""

    exposure: Exposure
    bank: NDArray[np.float32]


def interpolating(kind: type[Pose]) -> Callable[[Pose, Pose, float], Pose]:
    """An equation: the pose this part of the way from a to b, of two so near that rotations may be interpolated."""
    fields = ", ".join(f"a.{name} + part * (b.{name} - a.{name})" for name in kind._fields)
    return equation(write_function("between", f"def between(a, b, part):\n    return Pose({fields})\n", {"Pose": kind}))


between = interpolating(Pose)


@kernel
def take_raster_frame(raster, opened, closed, focal_px, chip, frame, image, grey):  # type: ignore[no-untyped-def]
    """One frame of a raster pad, exposed while the camera moved from pose `opened` to pose `closed`."""
    image[:] = np.float32(0.0)
    for part in (0.5 - GAUSS_POINT, 0.5 + GAUSS_POINT):
        pose = between(opened, closed, part)
        add_view(raster.reflectance, raster.texel_m, pose, focal_px, np.float32(0.5), image)
    digitise(image, chip.exposure, chip.bank, frame, grey)


# -- for Python ----------------------------------------------------------------------------------------------------
@lru_cache(maxsize=4)
def noise_bank(seed: int, width_px: int) -> NDArray[np.float32]:
    """Standard normals from which `digitise` takes its noise."""
    return np.random.default_rng([seed, 3]).standard_normal(NOISE_BANK + width_px, dtype=np.float32)


def film(
    pad: Pad,
    poses: Sequence[Pose],
    *,
    camera: Camera | None = None,
    closing_poses: Sequence[Pose] | None = None,
    light: str = "normal",
    seed: int = 1,
) -> NDArray[np.uint8]:
    """Frames (n, height, width) uint8 of a pad from a sequence of camera poses.

    The exposure opens at `poses[k]` and closes at `closing_poses[k]` (the same where not given: no motion blur).
    InputError where a pose does not look down on the pad or the light is unknown.
    """
    camera = camera or Camera()
    closing = list(closing_poses) if closing_poses is not None else list(poses)
    if len(closing) != len(poses):
        raise InputError(f"film: {len(poses)} poses but {len(closing)} closing poses; give as many of both")
    exposure, focal_px = exposed(camera, light_named(light)), effective_focal_px(camera)
    chip = Chip(exposure, noise_bank(seed, camera.width_px))
    image = np.zeros((camera.height_px, camera.width_px), np.float32)
    frames = np.empty((len(poses), camera.height_px, camera.width_px), np.uint8)
    raster, scale = np.zeros((0, 0), np.float32), np.zeros((2, 2))
    for k, (opened, closed) in enumerate(zip(poses, closing, strict=True)):
        _require_looking_down(opened, k)
        now = footprint(opened, focal_px)
        if np.abs(now - scale).max() > SCALE_TOLERANCE * np.abs(now).max():
            raster, scale = seen(pad, camera, opened), now
        take_raster_frame(Raster(raster, pad.texel_m), opened, closed, focal_px, chip, k, image, frames[k])
    return frames


def _require_looking_down(pose: Pose, k: int) -> None:
    if not (pose.height_m > 0.0 and pose.r33 > 0.2):
        raise InputError(f"pose {k}: the camera must be above the pad and look down, at most 78 degrees from it")
