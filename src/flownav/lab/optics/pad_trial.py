"""Fixes from rendered frames beside the poses they were rendered from: many cameras, each on a flight of its own.

A flight's camera has a calibration that is somewhat wrong, its own focus and sharpness, its own light, shadows, glare
and things that lie on the pad; these last as long as the flight. Attitude, place in the image, velocity and rates are
drawn anew for every frame. The detector corrects the lens by what it believes of it.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.lab.optics.camera import (
    MEAN_REFLECTANCE,
    PINHOLE_K1,
    PINHOLE_K2,
    Calibration,
    Camera,
    Exposure,
    Lens,
    Rectifier,
    believed,
    effective_focal_px,
    exposed,
    image_radius_px,
    pixels_of,
    rays_of,
    rectified,
    rectifier,
)
from flownav.lab.optics.frame_files import save_picture
from flownav.lab.optics.pad import GROUND_REFLECTANCE, PadTarget
from flownav.lab.optics.pad_fix import PadSearch, Truth, find_pad, fix_error, is_wrong, truth_of
from flownav.lab.optics.projection import FlightMotion, Pose, ground_point, pose_looking_down
from flownav.lab.optics.scene import Scene, drawn_scene, in_shadow_of_vehicle
from flownav.lab.optics.shot import Ground, Optic, Shot, View, ground_at, shoot, view_of
from flownav.sensors.geometry import image_rate_rad_s

TILT_RAD = float(np.radians(15.0))
RATE_RAD_S = 0.15  # standard deviation of each of the body's rates
MIDDLE_SHARE = 0.25  # the pad's centre lies within so much of the frame's width and height from its middle
DIMMEST, BRIGHTEST, SUNNY = 0.1, 8.0, 1.0  # light, relative to that of the normal exposure
MEAN_GREY = 70.0  # of a frame, as the automatic exposure wants it
EXPOSURE_SPREAD = 0.25  # of the automatic exposure's grey level, as a logarithm
SHARPEST_PX, SOFTEST_PX = 0.5, 1.0  # blur of lenses of one make
FOCUS_SPREAD_DPT = 0.7  # of where they are focused
SAME_GROUND = 1.3  # the ground's raster serves for heights within this factor


class TrialCamera(NamedTuple):
    """A camera as its maker describes it: focal length and pixel are `camera`'s, k1 and k2 its lens's."""

    camera: Camera
    k1: float
    k2: float
    readout_s: float
    calibration: Calibration = Calibration()


def _wide_lens_m(half_view_rad: float, half_width_px: float, pixel_m: float, k1: float, k2: float) -> float:
    """The focal length [m] with which half the frame's width is so wide an angle."""
    return half_width_px * pixel_m / float(image_radius_px(Lens(1.0, k1=k1, k2=k2), half_view_rad))


def _vga(half_view_deg: float, k1: float, k2: float) -> TrialCamera:
    """640x480 pixels of 3 um, a lens of f/2.8 focused at 1 m; rows are read in 16 ms, half of the time of a frame."""
    focal_m = _wide_lens_m(np.radians(half_view_deg), 320.0, 3e-6, k1, k2)
    sensor = Camera(640, 480, 3e-6, focal_m, 2.8, 1.0, normal_exposure_s=2e-3, longest_exposure_s=12e-3)
    return TrialCamera(sensor, k1, k2, 16e-3)


CAMERAS = {
    "wide120": _vga(60.0, -0.02, 0.002),
    "wide60": _vga(30.0, 0.2, 0.05),
    "px4flow": TrialCamera(Camera(), PINHOLE_K1, PINHOLE_K2, 0.0),
}


def camera_named(name: str, focus_m: float | None = None) -> TrialCamera:
    """One of CAMERAS, focused elsewhere where a distance is given. InputError lists them."""
    if name not in CAMERAS:
        raise InputError(f"camera {name!r}: unknown; known are {', '.join(CAMERAS)}")
    found = CAMERAS[name]
    return found if focus_m is None else found._replace(camera=found.camera._replace(focus_m=focus_m))


class CameraFlight(NamedTuple):
    """One camera on one flight: what it is, what its detector takes it for, and what it looks at."""

    optic: Optic
    view: View
    taken_for: Lens
    rectifier: Rectifier
    exposure: Exposure
    scene: Scene
    target: PadTarget
    seed: int


class TrialFrame(NamedTuple):
    """Result of one frame. error (4,): `pad_truth.fix_error`, NaN without a fix.

    reach_m: `pad_truth.Truth`. whole: the whole board is in the frame. image_rate_rad_s: of the ground straight below.
    tangents: of the centre, as they are.
    """

    flight: int
    height_m: float
    reach_m: float
    speed_m_s: float
    image_rate_rad_s: float
    whole: bool
    found: bool
    wrong: bool
    reason: str
    tangents: tuple[float, float]
    error: Array


def camera_flight(trial: TrialCamera, target: PadTarget, seed: int, flight: int) -> CameraFlight:
    """The camera of flight number `flight`, with its calibration, focus, light and scene."""
    rng = np.random.default_rng([seed, flight, 21])
    camera = trial.camera
    light = float(np.exp(rng.uniform(np.log(DIMMEST), np.log(BRIGHTEST))))
    dioptres = max(1.0 / camera.focus_m + FOCUS_SPREAD_DPT * rng.standard_normal(), 0.05)
    camera = camera._replace(psf_px=rng.uniform(SHARPEST_PX, SOFTEST_PX), focus_m=1.0 / dioptres)
    lens = Lens(effective_focal_px(camera), k1=trial.k1, k2=trial.k2)
    taken_for = believed(lens, trial.calibration, rng.standard_normal(5))
    optic = Optic(camera, lens, trial.readout_s)
    view = view_of(optic)
    darker = MEAN_REFLECTANCE / (GROUND_REFLECTANCE * float(view.falloff.mean()))  # ground than a rig's pad
    grey = MEAN_GREY * darker * float(np.exp(EXPOSURE_SPREAD * rng.standard_normal()))
    return CameraFlight(
        optic, view, taken_for, rectifier(taken_for, camera.height_px, camera.width_px),
        exposed(camera._replace(target_grey=grey), light), drawn_scene(rng, target.side_m, light > SUNNY), target,
        int(rng.integers(1 << 31)),
    )  # fmt: skip


def take_frame(flown: CameraFlight, land: Ground, pose: Pose, motion: FlightMotion, frame: int) -> NDArray[np.uint8]:
    """The frame (height, width) as the sensor gives it."""
    scene = in_shadow_of_vehicle(flown.scene, pose)
    shot = Shot(flown.target, flown.optic, flown.view, flown.exposure, flown.seed)
    return shoot(shot, land, scene, pose, motion, frame)


def look(flown: CameraFlight, frame: NDArray[np.uint8], body_from_camera: Array | None = None) -> PadSearch:
    """The detector: the frame without its lens, as far as that is known, then `find_pad`."""
    by = flown.rectifier
    return find_pad(rectified(frame, by), flown.target, by.focal_px, body_from_camera)


def frames_at(
    flown: CameraFlight, height_m: float, speed_m_s: float, count: int, seed: int, tilt_rad: float = TILT_RAD
) -> Iterator[tuple[NDArray[np.uint8], Pose, FlightMotion]]:
    """Frames from one height at one speed over the ground in any direction, their poses and motions."""
    rng = np.random.default_rng([seed, flown.seed, round(1e3 * height_m), round(1e3 * speed_m_s)])
    land = ground_below(flown, height_m)
    for k in range(count):
        pose, motion = drawn_pose(flown.optic, height_m, tilt_rad, rng), drawn_motion(speed_m_s, rng)
        yield take_frame(flown, land, pose, motion, (round(1e3 * height_m) << 12) + k), pose, motion


def ground_below(flown: CameraFlight, height_m: float) -> Ground:
    """The ground of this flight as it is seen from about this height."""
    step = round(float(np.log(height_m) / np.log(SAME_GROUND)))
    return _ground(SAME_GROUND**step, flown.optic.lens.focal_px, flown.seed % (1 << 16))


_ground = lru_cache(maxsize=16)(ground_at)


def drawn_pose(optic: Optic, height_m: float, tilt_rad: float, rng: np.random.Generator) -> Pose:
    """A pose that has the pad's centre somewhere in the middle half of the frame's width and height."""
    tilt, way, yaw = tilt_rad * np.sqrt(rng.uniform()), *rng.uniform(-np.pi, np.pi, 2)
    turned = {"roll_rad": tilt * np.cos(way), "pitch_rad": tilt * np.sin(way), "yaw_rad": yaw}
    size = np.array([optic.camera.width_px, optic.camera.height_px])
    ray = rays_of(optic.lens, rng.uniform(-MIDDLE_SHARE, MIDDLE_SHARE, 2) * size)
    x_m, y_m, _ = ground_point(pose_looking_down(0.0, 0.0, height_m, **turned), float(ray[0]), float(ray[1]), 1.0)
    return pose_looking_down(-x_m, -y_m, height_m, **turned)


def drawn_motion(speed_m_s: float, rng: np.random.Generator) -> FlightMotion:
    """A motion over the ground in any direction, sinking or climbing at a third of its speed, turning as in a hover."""
    way = rng.uniform(-np.pi, np.pi)
    rates = RATE_RAD_S * rng.standard_normal(3)
    down = speed_m_s / 3.0 * rng.standard_normal()
    return FlightMotion(speed_m_s * np.cos(way), speed_m_s * np.sin(way), down, *rates)


def rate_of(pose: Pose, motion: FlightMotion) -> float:
    """Size of the flow of the ground straight below [rad/s]."""
    forward, right, _ = np.array(pose[3:]).reshape(3, 3).T @ np.array(motion[:3])
    return float(np.hypot(*image_rate_rad_s(forward, right, motion.rate_x_rad_s, motion.rate_y_rad_s, pose.height_m)))


def whole_in_view(optic: Optic, truth: Truth) -> bool:
    """Whether all four corners of the board are in the frame."""
    half = 0.5 * np.array([optic.camera.width_px - 1.0, optic.camera.height_px - 1.0])
    return bool((np.abs(pixels_of(optic.lens, truth.board_rays)) < half).all())


def tried(
    flown: CameraFlight, flight: int, height_m: float, speed_m_s: float, count: int, seed: int, tilt_rad: float
) -> Iterator[TrialFrame]:
    """Results of the detector on `count` frames."""
    for frame, pose, motion in frames_at(flown, height_m, speed_m_s, count, seed, tilt_rad):
        truth = truth_of(pose, flown.target)
        fix, reason = look(flown, frame)
        error = np.full(4, np.nan) if fix is None else fix_error(fix, truth)
        wrong = fix is not None and is_wrong(error, truth, flown.target)
        yield TrialFrame(
            flight, height_m, truth.reach_m, speed_m_s, rate_of(pose, motion), whole_in_view(flown.optic, truth),
            fix is not None and not wrong, wrong, reason, (truth.tan_forward, truth.tan_right), error,
        )  # fmt: skip


class Trials(NamedTuple):
    """Heights and speeds, the number of frames that every flight takes at each, and the standard deviation of its
    tilt.
    """

    heights_m: Sequence[float]
    speeds_m_s: Sequence[float]
    flights: int
    frames: int
    tilt_rad: float
    seed: int


def fly_cameras(
    trial: TrialCamera, target: PadTarget, trials: Trials, on_progress: Callable[[int], None] = lambda done: None,
    pictures: Path | None = None,
) -> list[TrialFrame]:  # fmt: skip
    """Every flight's frames at every height and speed; the same whatever the number of threads.

    pictures: a folder that gets the first frame of each flight and height. InputError where it cannot be written.
    """

    heights_m, speeds_m_s, flights, count, tilt_rad, seed = trials

    def fly(flight: int) -> list[TrialFrame]:
        flown = camera_flight(trial, target, seed, flight)
        found: list[TrialFrame] = []
        for height_m in heights_m:
            if pictures is not None:
                frame = next(frames_at(flown, height_m, speeds_m_s[0], 1, seed, tilt_rad))[0]
                save_picture(frame, pictures / f"flight{flight}_{height_m:g}m.png")
            for speed_m_s in speeds_m_s:
                found += tried(flown, flight, height_m, speed_m_s, count, seed, tilt_rad)
        return found

    frames: list[TrialFrame] = []
    fly_nothing = camera_flight(trial, target, seed, 0)
    next(frames_at(fly_nothing, heights_m[-1], 0.0, 1, seed))  # kernels are compiled before there are threads
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for found in pool.map(fly, range(flights)):
            frames += found
            on_progress(1)
    return frames
