"""One frame of a pad as a real camera takes it: lens, defocus, motion, rolling shutter, light and noise.

The target's board is blurred once a frame, by lens, defocus and pixel at the place where the camera sees it; every
pixel then samples it along its ray at a few instants of its row's exposure. Ground beyond the board is a second
raster at the scale of a pixel straight below, whose contrast is let go as pixels take in more of it.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import clamp, equation, kernel
from flownav.core.measurement import Array
from flownav.lab.optics.camera import Camera, Exposure, Lens, illumination, pixel_grid, pixels_of, rays_of
from flownav.lab.optics.pad import GROUND_REFLECTANCE, Pad, PadTarget, ground, laid_out
from flownav.lab.optics.projection import FlightMotion, Pose, ground_point, moved, part_time_s, row_time_s
from flownav.lab.optics.render import blurred, digitise, noise_bank, sampled
from flownav.lab.optics.scene import Cover, Scene, Shadow, covered, lit, mirrored
from flownav.sensors.geometry import image_rate_rad_s

SKY = 1.0
HORIZON = 0.05  # rays lower than this below the horizon, as a part of their length along the axis, see the sky
BLEND_M = 0.15  # of the target's side: over which the board's raster gives way to the ground's
LEAST_PARTS, MOST_PARTS = 2, 10  # of an exposure, half a pixel of motion each as far as that goes
TEXELS_A_PIXEL = 1.5
MOST_TEXELS = 2048  # along the board's raster
GROUND_TEXELS = 1024
MARKS, SMALLEST_MARK_PX, LARGEST_MARK_PX = 40, 4.0, 60.0


class Optic(NamedTuple):
    """Camera, its lens as it is, time from the first row to the last."""

    camera: Camera
    lens: Lens
    readout_s: float


class View(NamedTuple):
    """View of a lens for every pixel: its ray (h, w, 2) and the brightness of an even scene there (h, w)."""

    rays: Array
    falloff: Array


def view_of(optic: Optic) -> View:
    """Rays and brightness of every pixel."""
    rays = rays_of(optic.lens, pixel_grid(optic.camera.height_px, optic.camera.width_px))
    angle = np.arctan(np.hypot(rays[..., 0], rays[..., 1]))
    return View(rays, illumination(optic.lens, angle))


class Ground(NamedTuple):
    """The raster of the ground round the target, and its texel."""

    raster: NDArray[np.float32]
    texel_m: float


def ground_at(height_m: float, focal_px: float, seed: int) -> Ground:
    """Natural ground with marks, stones and tiles: rectangles of any grey, at the scale of a pixel straight below."""
    rng = np.random.default_rng([seed, 11])
    raster = ground(GROUND_TEXELS, seed)
    row, column = np.meshgrid(*(np.arange(n, dtype=float) for n in raster.shape), indexing="ij")
    for _ in range(MARKS):
        middle, turn = rng.uniform(0.0, GROUND_TEXELS, 2), rng.uniform(0.0, np.pi)
        half = 0.5 * np.exp(rng.uniform(np.log(SMALLEST_MARK_PX), np.log(LARGEST_MARK_PX), 2))
        reach = int(np.hypot(*half)) + 1
        top, left = (max(int(m) - reach, 0) for m in middle)
        part = np.s_[top : int(middle[0]) + reach, left : int(middle[1]) + reach]
        y, x = row[part] - middle[0], column[part] - middle[1]
        inside = np.abs(np.cos(turn) * x + np.sin(turn) * y) < half[0]
        inside &= np.abs(np.cos(turn) * y - np.sin(turn) * x) < half[1]
        raster[part][inside] = rng.uniform(0.05, 0.8)
    return Ground(raster, height_m / focal_px)


def board_seen(target: PadTarget, optic: Optic, pose: Pose, seed: int) -> Pad:
    """The target and a little ground round it, blurred as the camera sees it where it stands in the image."""
    rotation = np.array(pose[3:]).reshape(3, 3)
    x, y, depth_m = rotation.T @ np.array([-pose.x_m, -pose.y_m, pose.height_m])
    ray = np.array([x / depth_m, y / depth_m])
    footprint = footprint_at(optic.lens, pose, ray)
    finest_m = float(np.linalg.svd(footprint)[1].min()) / TEXELS_A_PIXEL
    extent_m = 1.02 * (target.board_m + 2.0 * BLEND_M * target.side_m)
    pad = laid_out(target, extent_m, max(finest_m, extent_m / MOST_TEXELS), seed)
    return Pad(pad.name, blurred(pad, optic.camera, footprint, float(np.hypot(depth_m, np.hypot(x, y)))), pad.texel_m)


def footprint_at(lens: Lens, pose: Pose, ray: Array) -> Array:
    """How the ground point moves with the pixel where a ray lands, [[dx/du, dx/dv], [dy/du, dy/dv]] [m/px]."""
    pixel = pixels_of(lens, ray)
    columns = []
    for step in (np.array([0.5, 0.0]), np.array([0.0, 0.5])):
        ahead, behind = rays_of(lens, pixel + step), rays_of(lens, pixel - step)
        one, two = (ground_point(pose, float(r[0]), float(r[1]), 1.0) for r in (ahead, behind))
        columns.append([one[0] - two[0], one[1] - two[1]])
    return np.array(columns).T


def blur_width_px(optic: Optic, pose: Pose, motion: FlightMotion, exposure_s: float) -> float:
    """How far the ground straight below moves in the image while a row is exposed: rate x exposure x focal length."""
    velocity = np.array(pose[3:]).reshape(3, 3).T @ np.array(motion[:3])
    rate = image_rate_rad_s(velocity[0], velocity[1], motion.rate_x_rad_s, motion.rate_y_rad_s, pose.height_m)
    return float(np.hypot(*rate)) * exposure_s * optic.lens.focal_px


class Board(NamedTuple):
    """A target's raster and its texel; half the board's side; over which length the raster gives way to the ground."""

    raster: NDArray[np.float32]
    texel_m: float
    half_m: float
    blend_m: float


class Shutter(NamedTuple):
    """How long a row is exposed, in how many parts that is sampled, and the time from the first row to the last."""

    exposure_s: float
    parts: int
    readout_s: float


@equation
def reflected(board: Board, reach_m: float, land: Ground, x_m: float, y_m: float, nearness: float) -> float:
    """Reflectance of a place: the board's raster as far as it reaches, beyond it the ground's.

    nearness: 1 below, 0 at the horizon.
    """
    off = max(abs(x_m), abs(y_m))
    own = clamp((reach_m - off) / board.blend_m, 0.0, 1.0)
    level = 0.0
    if own < 1.0:
        far = sampled(land.raster, x_m / land.texel_m, y_m / land.texel_m)
        level += (1.0 - own) * (GROUND_REFLECTANCE + (far - GROUND_REFLECTANCE) * nearness)
    if own > 0.0:
        level += own * sampled(board.raster, x_m / board.texel_m - 0.5, y_m / board.texel_m - 0.5)
    return level


@kernel
def expose(
    board: Board, land: Ground, view: View, pose: Pose, motion: FlightMotion, shutter: Shutter, scene: Scene,
    image: NDArray[np.float32],
) -> None:  # fmt: skip
    """Fills `image` (height, width) with the light that every pixel collects, as reflectance."""
    height, width = image.shape
    rays, falloff = view
    exposure_s, parts, readout_s = shutter
    shadows, covers, gloss = scene
    reach_m = 0.5 * board.raster.shape[0] * board.texel_m
    image[:] = 0.0
    for row in range(height):
        for part in range(parts):
            then = moved(pose, motion, row_time_s(row, height, readout_s) + part_time_s(part, parts, exposure_s))
            for column in range(width):
                x, y = rays[row, column, 0], rays[row, column, 1]
                down = then.r31 * x + then.r32 * y + then.r33
                light = SKY
                if down > HORIZON:
                    x_m, y_m, _ = ground_point(then, x, y, 1.0)
                    near = down * down / (1.0 + x * x + y * y)
                    light = reflected(board, reach_m, land, x_m, y_m, near)
                    for k in range(len(covers)):
                        if covered(Cover(covers[k, 0], covers[k, 1], covers[k, 2], covers[k, 3]), x_m, y_m):
                            light = covers[k, 3]
                    for k in range(len(shadows)):
                        s = shadows[k]
                        light *= lit(Shadow(s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7]), x_m, y_m)
                    if gloss.strength > 0.0 and max(abs(x_m), abs(y_m)) < board.half_m:
                        ahead = then.r11 * x + then.r12 * y + then.r13
                        aside = then.r21 * x + then.r22 * y + then.r23
                        light += mirrored(gloss, ahead, aside, down)
                image[row, column] += falloff[row, column] * light / parts + gloss.veil / parts


class Shot(NamedTuple):
    """A camera's shot: a target by an optic, its view and exposure; the seed names the sensor's noise."""

    target: PadTarget
    optic: Optic
    view: View
    exposure: Exposure
    seed: int


def shoot(shot: Shot, land: Ground, scene: Scene, pose: Pose, motion: FlightMotion, frame: int) -> NDArray[np.uint8]:
    """The frame (height, width) uint8 that is of `pose`; its number names the sensor's noise beside the seed."""
    target, optic, view, exposure, seed = shot
    board = board_seen(target, optic, pose, seed)
    blur_px = blur_width_px(optic, pose, motion, exposure.time_s)
    parts = int(np.clip(np.ceil(2.0 * blur_px), LEAST_PARTS, MOST_PARTS))
    image = np.zeros(view.falloff.shape, np.float32)
    laid = Board(board.reflectance, board.texel_m, 0.5 * target.board_m, BLEND_M * target.side_m)
    expose(laid, land, view, pose, motion, Shutter(exposure.time_s, parts, optic.readout_s), scene, image)
    grey: Any = np.empty(image.shape, np.uint8)
    digitise(image, exposure, noise_bank(seed, optic.camera.width_px), frame, grey)
    return np.asarray(grey)
