"""From frames, rates and range to flow, velocity and quality: what the PX4FLOW does after the matching.

`flow_of_frames` is the whole sensor for a user's own pictures. The parts are functions of arrays, one value a
frame pair, which `lab/rig/` uses too.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.lab.optics.block_matching import (
    PixelFlow,
    fits,
    match_sequence,
    matching_of,
    workspace,
)
from flownav.lab.optics.camera import FIRMWARE_FOCAL_PX
from flownav.lab.optics.firmware import DEFAULT, TILE_PX, Firmware, firmware_named


@dataclass(frozen=True)
class FlowSeries:
    """Flow from each frame to the next: n frames give n - 1 rows.

    Times are those of the newer frame. `flow_px` and `flow_rad_s` are compensated for rotation where rates were
    given; x is to the right of the image, y down; a positive flow is a scene that moves that way. `velocity_m_s`
    is the camera's velocity along its x and y, NaN without a range.
    """

    time_s: Array
    flow_px: Array
    flow_rad_s: Array
    velocity_m_s: Array
    quality: NDArray[np.int64]
    firmware: Firmware


def flow_between(previous: ArrayLike, current: ArrayLike, firmware: str | Firmware = DEFAULT) -> PixelFlow:
    """Flow [px] and quality 0..255 from one frame (height, width) to the next, not compensated for rotation."""
    pair = [np.asarray(frame) for frame in (previous, current)]
    if pair[0].shape != pair[1].shape:
        raise InputError(f"frames of {pair[0].shape} and {pair[1].shape} pixels; both must be of one size")
    flow, quality = raw_flow(np.stack(pair), _version(firmware))
    return PixelFlow(float(flow[0, 0]), float(flow[0, 1]), int(quality[0]))


def flow_of_frames(
    frames: ArrayLike,
    fps: float,
    *,
    focal_px: float = FIRMWARE_FOCAL_PX,
    rates_rad_s: ArrayLike | None = None,
    range_m: ArrayLike | None = None,
    firmware: str | Firmware = DEFAULT,
) -> FlowSeries:
    """The PX4FLOW on frames (n, height, width) of grey levels 0..255, taken `fps` a second.

    `rates_rad_s` (n, 3) are the camera's rates about its x, y and z at every frame; they are compensated where
    given, with the firmware's threshold, scale and clamp. `range_m` is one distance or one a frame.
    InputError where the frames are too small, not numbers or fewer than two, or where the lengths differ.
    """
    version = _version(firmware)
    grey = grey_frames(frames)
    if len(grey) < 2:
        raise InputError(f"{len(grey)} frame(s): two at least are needed for a flow")
    if not (np.isfinite(fps) and fps > 0.0 and np.isfinite(focal_px) and focal_px > 0.0):
        raise InputError(f"fps {fps:g}, focal length {focal_px:g} px: both must be above 0")
    flow, quality = raw_flow(grey, version)
    if rates_rad_s is not None:
        rates = _rows("rates_rad_s", rates_rad_s, len(grey), 3)[1:]
        used = version._replace(gyro_compensation=True)
        flow = np.where((quality > 0)[:, None], compensated(flow, rates, 1.0 / fps, focal_px, used), flow)
    distance = np.full(len(grey), np.nan) if range_m is None else _rows("range_m", range_m, len(grey), 1)[:, 0]
    velocity = velocities(flow, 1.0 / fps, focal_px, distance[1:])
    return FlowSeries(np.arange(1, len(grey)) / fps, flow, flow / focal_px * fps, velocity, quality, version)


def grey_frames(frames: ArrayLike) -> NDArray[np.uint8]:
    """Frames as (n, height, width) uint8; colours (n, height, width, 3) by their mean. InputError where not frames."""
    array = np.asarray(frames)
    if array.dtype == object or array.ndim not in (3, 4) or (array.ndim == 4 and array.shape[3] not in (1, 3, 4)):
        raise InputError(f"frames of shape {array.shape}: (n, height, width) or (n, height, width, 3) is needed")
    if array.dtype != np.uint8:
        if array.dtype.kind not in "uif" or (array.dtype.kind == "f" and not np.isfinite(array).all()):
            raise InputError("frames hold values that are not numbers; grey levels from 0 to 255 are needed")
        if array.size and (array.min() < 0 or array.max() > 255):
            raise InputError(f"frames hold {array.min():g} to {array.max():g}; grey levels from 0 to 255 are needed")
    if array.ndim == 4:
        array = array[..., :3].mean(axis=3)
    return np.ascontiguousarray(np.round(array) if array.dtype.kind == "f" else array).astype(np.uint8)


def raw_flow(frames: ArrayLike, firmware: Firmware) -> tuple[Array, NDArray[np.int64]]:
    """Block matching alone: flow [px] (n-1, 2) and quality (n-1). InputError where frames are too small."""
    grey = grey_frames(frames)
    height, width = grey.shape[1:]
    if not fits(height, width, firmware):
        margin = firmware.search_px + 1
        raise InputError(
            f"frames of {width}x{height} pixels are too small for firmware {firmware.name}: "
            f"more than 10 patches of {TILE_PX}x{TILE_PX} must fit inside a margin of {margin}; give at least 64x64"
        )
    flow, quality = np.zeros((len(grey) - 1, 2)), np.zeros(len(grey) - 1, np.int64)
    match_sequence(grey, matching_of(firmware), workspace(height, width, firmware), flow, quality)
    return flow, quality


def compensated(flow_px: Array, rates_rad_s: Array, dt_s: ArrayLike, focal_px: float, firmware: Firmware) -> Array:
    """The firmware's gyro compensation: f_x + w_y dt F and f_y - w_x dt F above a threshold, then a clamp.

    Until 2014-01 nothing was clamped and a correction as large as the flow gave 0 ("do not correct over zero").
    """
    if not firmware.gyro_compensation:
        return flow_px
    rates = np.stack([rates_rad_s[:, 1], -rates_rad_s[:, 0]], axis=1)
    turned_px = firmware.gyro_scale * rates * np.asarray(dt_s)[..., None] * focal_px
    limit = firmware.search_px + 0.5
    sum_px = flow_px + turned_px
    if firmware.over_zero_defect:
        corrected = np.where(np.abs(turned_px) >= np.abs(flow_px), 0.0, sum_px)
    else:
        corrected = np.clip(sum_px, -limit, limit)
    return np.where(np.abs(rates) > firmware.gyro_threshold_rad_s, corrected, flow_px)


def velocities(flow_px: Array, dt_s: ArrayLike, focal_px: float, distance_m: Array) -> Array:
    """The camera's velocity along its x and y [m/s]: v = -flow/(F dt) d."""
    return np.asarray(-flow_px / focal_px / np.asarray(dt_s)[..., None] * distance_m[:, None])


def _version(firmware: str | Firmware) -> Firmware:
    return firmware_named(firmware) if isinstance(firmware, str) else firmware


def _rows(name: str, values: ArrayLike, count: int, columns: int) -> Array:
    """Values of every frame as (count, columns); one number may stand for all frames."""
    array = np.asarray(values, float)
    if array.ndim == 0:
        array = np.full((count, columns), float(array))
    if array.ndim == 1 and columns == 1:
        array = array[:, None]
    if array.shape != (count, columns):
        raise InputError(f"{name} of shape {array.shape}: {(count, columns)} is needed, one row a frame")
    if not np.isfinite(array).all():
        raise InputError(f"{name} holds values that are not numbers")
    return array
