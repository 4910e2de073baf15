"""How well the pad is found: fixes from rendered frames beside the poses they were rendered from.

The frames have the laboratory camera's blur, exposure and noise; attitude, heading, place in the image and motion
during the exposure are drawn anew. The lens is taken as calibrated: focal length and axis are what they are said to be.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.errors import InputError
from flownav.optics.camera import Camera, effective_focal_px, exposed, light_named
from flownav.optics.pad_fix import PadFix, find_pad
from flownav.optics.pad_target import PadTarget, checked, corners_m, laid_out
from flownav.optics.projection import Pose, ground_point, image_point, pose_looking_down
from flownav.optics.render import film

Array = NDArray[np.float64]

# 640x480 pixels of 3 um over 60 degrees, fixed focus: a small global-shutter camera
WIDE = Camera(640, 480, 3e-6, 320.0 * 3e-6 / np.tan(np.radians(30.0)), 2.8, 1.5)
CAMERAS = {"wide": WIDE, "px4flow": Camera()}
HEIGHTS_M = (0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
FRAMES_AN_ATTITUDE = 5
SPEED_M_S, RATE_RAD_S = 0.3, 0.2  # standard deviations of the motion during the exposure, each axis
TEXELS_A_PIXEL = 2.0
WRONG_CENTRE, WRONG_DISTANCE = 0.5, 0.1  # of the pad's side, of the distance: a fix farther off is wrong, not noisy
LEAST_SHARE = 0.9  # of the frames with the whole pad in view that give a fix, within the range that is stated
LEAST_FRAMES = 5


def camera_named(name: str, focus_m: float | None = None) -> Camera:
    """`wide` or `px4flow`, focused elsewhere where a distance is given. InputError lists the cameras."""
    if name not in CAMERAS:
        raise InputError(f"camera {name!r}: unknown; known are {', '.join(CAMERAS)}")
    camera = CAMERAS[name]
    return camera if focus_m is None else camera._replace(focus_m=focus_m)


class PadFixNoise(NamedTuple):
    """The fix as a sensor for simulation. The numbers are those that `flownav pad` prints for the wide camera.

    angle_sigma_rad: of each angle to the centre. distance_relative_sigma: of the distance, as a part of it, at 1 m;
    it grows with distance to the power of `distance_exponent`. least_height_m to greatest_height_m: where the
    pad is found whenever it is whole in view, but for one frame in 1/outage_probability.
    """

    angle_sigma_rad: float = 1.3e-05
    distance_relative_sigma: float = 1.13e-04
    distance_exponent: float = 1.45
    least_height_m: float = 0.3
    greatest_height_m: float = 5.0
    outage_probability: float = 0.0


class HeightNoise(NamedTuple):
    """Fixes at one height. `in_view`: frames with the whole square in them; `found` of those; `wrong` of all found.

    Sigmas and biases are of the found that are not wrong: of each angle to the centre, of the distance as a part of
    it, of the heading. NaN where there are fewer than two.
    """

    height_m: float
    frames: int
    in_view: int
    found: int
    wrong: int
    angle_sigma_rad: float
    angle_bias_rad: float
    distance_sigma: float
    distance_bias: float
    heading_sigma_rad: float
    reasons: dict[str, int]


class Truth(NamedTuple):
    """The pad as it is: tangents towards camera x and y, distance from the lens, heading, corners (4, 2) [px]."""

    tan_forward: float
    tan_right: float
    distance_m: float
    heading_rad: float
    corners_px: Array


def truth_of(pose: Pose, target: PadTarget, camera: Camera) -> Truth:
    """What a perfect fix says, camera axes taken as the body's; corners as (column, row)."""
    rotation = np.array(pose[3:]).reshape(3, 3)
    forward, right, down = rotation.T @ np.array([-pose.x_m, -pose.y_m, pose.height_m])
    middle = 0.5 * np.array([camera.width_px - 1.0, camera.height_px - 1.0])
    focal_px = effective_focal_px(camera)
    corners = np.array([image_point(pose, x, y, focal_px) for x, y in corners_m(target)]) + middle
    distance_m = float(np.sqrt(forward**2 + right**2 + down**2))
    heading = float(np.arctan2(rotation[0, 1], rotation[0, 0]))
    return Truth(float(forward / down), float(right / down), distance_m, heading, corners)


def views(
    target: PadTarget, camera: Camera, height_m: float, frames: int, tilt_rad: float, light: str, seed: int
) -> Iterator[tuple[NDArray[np.uint8], Pose]]:
    """Frames over the target from one height, and the pose at the middle of each exposure."""
    rng = np.random.default_rng([seed, round(1000.0 * height_m), 7])
    exposure_s = exposed(camera, light_named(light)).time_s
    done = 0
    while done < frames:
        count = min(FRAMES_AN_ATTITUDE, frames - done)
        tilt, way, yaw = tilt_rad * np.sqrt(rng.uniform()), *rng.uniform(-np.pi, np.pi, 2)
        attitude = {"roll_rad": tilt * np.cos(way), "pitch_rad": tilt * np.sin(way), "yaw_rad": yaw}
        places = [_over(attitude, height_m, camera, rng) for _ in range(count)]
        motion = [0.5 * exposure_s * rng.standard_normal(6) for _ in range(count)]
        opened = [_moved(pose, -step) for pose, step in zip(places, motion, strict=True)]
        closed = [_moved(pose, step) for pose, step in zip(places, motion, strict=True)]
        texel_m = height_m / effective_focal_px(camera) / TEXELS_A_PIXEL
        pad = laid_out(target, _extent_m(places, camera) + target.side_m, texel_m, seed + done)
        shots = film(pad, opened, camera=camera, closing_poses=closed, light=light, seed=seed + 1000 + done)
        yield from zip(shots, places, strict=True)
        done += count


def _over(attitude: dict[str, float], height_m: float, camera: Camera, rng: np.random.Generator) -> Pose:
    """A pose that has the pad's centre somewhere in the middle half of the frame's width and height."""
    u = rng.uniform(-0.25, 0.25) * camera.width_px
    v = rng.uniform(-0.25, 0.25) * camera.height_px
    x_m, y_m, _ = ground_point(pose_looking_down(0.0, 0.0, height_m, **attitude), u, v, effective_focal_px(camera))
    return pose_looking_down(-x_m, -y_m, height_m, **attitude)


def _moved(pose: Pose, step: Array) -> Pose:
    """The pose after a small step: standard normals times seconds, in place and in attitude."""
    x, y, z = RATE_RAD_S * step[3:]
    turn = np.array(pose[3:]).reshape(3, 3) @ (np.eye(3) + np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))
    along = SPEED_M_S * step[:3]
    return Pose(pose.x_m + along[0], pose.y_m + along[1], pose.height_m - along[2], *turn.ravel())


def _extent_m(poses: Sequence[Pose], camera: Camera) -> float:
    """How far from the pad's centre the frames reach along x or y [m], at least a side's length."""
    half_u, half_v = 0.5 * camera.width_px, 0.5 * camera.height_px
    focal_px = effective_focal_px(camera)
    corners = [ground_point(p, u, v, focal_px) for p in poses for u in (-half_u, half_u) for v in (-half_v, half_v)]
    return max(max(abs(x), abs(y)) for x, y, _ in corners)


def measure_height(
    target: PadTarget,
    camera: Camera,
    height_m: float,
    *,
    frames: int = 40,
    tilt_rad: float = np.radians(15.0),
    light: str = "normal",
    seed: int = 1,
) -> HeightNoise:
    """Detection and noise at one height. InputError where target or light is unknown."""
    checked(target)
    errors: list[Array] = []
    reasons: dict[str, int] = {}
    in_view = found = wrong = 0
    for frame, pose in views(target, camera, height_m, frames, tilt_rad, light, seed):
        truth = truth_of(pose, target, camera)
        size = np.array([camera.width_px - 1.0, camera.height_px - 1.0])
        whole = bool(((truth.corners_px > 0.0) & (truth.corners_px < size)).all())
        in_view += whole
        fix, reason = find_pad(frame, target, effective_focal_px(camera))
        if fix is None:
            reasons[reason] = reasons.get(reason, 0) + 1
            continue
        error = fix_error(fix, truth)
        if abs(error[2]) > WRONG_DISTANCE or np.hypot(*error[:2]) * truth.distance_m > WRONG_CENTRE * target.side_m:
            wrong += 1
            continue
        found += whole
        errors.append(error)
    return HeightNoise(height_m, frames, in_view, found, wrong, *_spread(np.array(errors).reshape(-1, 4)), reasons)


def fix_error(fix: PadFix, truth: Truth) -> Array:
    """Angles towards forward and right [rad], distance as a part of it, heading [rad]: measured less true."""
    angle = [np.arctan(fix.tan_forward) - np.arctan(truth.tan_forward)]
    angle.append(np.arctan(fix.tan_right) - np.arctan(truth.tan_right))
    whole_turn = 2.0 * np.pi if fix.coded else np.pi
    heading = (fix.heading_rad - truth.heading_rad + 0.5 * whole_turn) % whole_turn - 0.5 * whole_turn
    return np.array([*angle, fix.distance_m / truth.distance_m - 1.0, heading])


def _spread(errors: Array) -> tuple[float, float, float, float, float]:
    if len(errors) < 2:
        return (float("nan"),) * 5
    mean, sigma = errors.mean(0), errors.std(0, ddof=1)
    angle_sigma, angle_bias = np.sqrt(np.mean(sigma[:2] ** 2)), np.hypot(*mean[:2])
    return float(angle_sigma), float(angle_bias), float(sigma[2]), float(mean[2]), float(sigma[3])


def noise_law(rows: Sequence[HeightNoise]) -> PadFixNoise | None:
    """The sensor that the rows describe, over the widest range of heights without a gap; None where there is none.

    A height counts where nine of ten frames with the whole pad in view give a fix and none is wrong. Sigmas
    contain the bias. The distance's power law is fitted to the logarithms.
    """
    good = [
        r.in_view >= LEAST_FRAMES and r.found >= LEAST_SHARE * r.in_view and not r.wrong and r.distance_sigma > 0.0
        for r in rows
    ]
    runs: list[list[HeightNoise]] = [[]]
    for row, is_good in zip(rows, good, strict=True):
        if is_good:
            runs[-1].append(row)
        elif runs[-1]:
            runs.append([])
    best = max(runs, key=len)
    if not best:
        return None
    angle = np.sqrt(np.mean([r.angle_sigma_rad**2 + 0.5 * r.angle_bias_rad**2 for r in best]))
    log_sigma = np.log([np.hypot(r.distance_sigma, r.distance_bias) for r in best])
    log_height = np.log([r.height_m for r in best])
    exponent, level = np.polyfit(log_height, log_sigma, 1) if len(best) > 1 else (0.0, log_sigma[0])
    outage = 1.0 - sum(r.found for r in best) / sum(r.in_view for r in best)
    heights = best[0].height_m, best[-1].height_m
    return PadFixNoise(float(angle), float(np.exp(level)), float(exponent), *heights, float(outage))
