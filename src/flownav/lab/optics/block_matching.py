"""The PX4FLOW's block matching: 8x8 sums of absolute differences, full search, half a pixel (section 4.3).

The sums of one shift are taken for a whole row of patches at once, column by column, and then over the eight
columns of each patch: the same numbers as patch by patch, in loops that the compiler turns into vector code.
Frames are flat uint8 arrays, row after row; x is to the right, y down, a positive flow is a scene that moves
to the right or down from the previous frame to the current one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import kernel
from flownav.lab.optics.firmware import TILE_PX, Firmware

TILE = TILE_PX
FEWEST_PATCHES = 10  # the flow is given where more than this many patches are accepted
WORST_SAD = np.uint16(65535)
VECTOR = 16
NO_DIRECTION = 8

# the eight half-pixel directions: 0 right, 1 right-down, 2 down, 3 left-down, 4 left, 5 left-up, 6 up, 7 right-up
HALF_X = np.array([0.5, 0.5, 0.0, -0.5, -0.5, -0.5, 0.0, 0.5, 0.0])
HALF_Y = np.array([0.0, 0.5, 0.5, 0.5, 0.0, -0.5, -0.5, -0.5, 0.0])


class Matching(NamedTuple):
    """The firmware's settings as the kernel takes them (whole numbers; switches are 0 or 1)."""

    search: int
    feature_threshold: int
    sad_threshold: int
    histogram: int
    rows_twice: int
    half_pixel_y: int
    histogram_index: int


class Workspace(NamedTuple):
    """Arrays that the kernel reuses from frame to frame: corners, half-pixel planes and per-patch results."""

    corners_x: NDArray[np.int64]
    corners_y: NDArray[np.int64]
    columns: NDArray[np.uint16]
    right: NDArray[np.uint8]
    down: NDArray[np.uint8]
    diagonal: NDArray[np.uint8]
    usable: NDArray[np.uint8]
    best: NDArray[np.uint16]
    shift_x: NDArray[np.int64]
    shift_y: NDArray[np.int64]
    direction: NDArray[np.int64]
    histogram_x: NDArray[np.int64]
    histogram_y: NDArray[np.int64]


class PixelFlow(NamedTuple):
    """Flow from one frame to the next [px], not yet compensated, and its quality 0..255."""

    x_px: float
    y_px: float
    quality: int


def corners(length_px: int, firmware: Firmware) -> NDArray[np.int64]:
    """First pixels of the patches along an axis of `length_px` pixels, the firmware's formula or its fixed grid."""
    low = firmware.search_px + 1
    high = length_px - (firmware.search_px + 1) - TILE
    if firmware.step_px:
        first = firmware.first_px + (length_px - 64) // 2
        return first + firmware.step_px * np.arange(firmware.patches, dtype=np.int64)
    return np.arange(low, high, max((high - low) // firmware.patches + 1, 1), dtype=np.int64)


def fits(height_px: int, width_px: int, firmware: Firmware) -> bool:
    """Whether frames of this size hold enough patches, each with its search window, to give a flow."""
    inside, count = True, 1
    for length in (height_px, width_px):
        grid = corners(length, firmware)
        count *= len(grid)
        margin = firmware.search_px + 1
        inside = inside and len(grid) > 0 and grid[0] >= margin and grid[-1] + TILE + margin <= length
    return bool(inside and count > FEWEST_PATCHES)


def matching_of(firmware: Firmware) -> Matching:
    """The kernel's settings of a firmware version."""
    return Matching(
        firmware.search_px,
        firmware.feature_threshold,
        firmware.sad_threshold,
        int(firmware.histogram_filter),
        int(firmware.rows_twice_defect),
        int(firmware.half_pixel_y_defect),
        int(firmware.histogram_index_defect),
    )


def workspace(height_px: int, width_px: int, firmware: Firmware) -> Workspace:
    """Fresh arrays for frames of this size."""
    grid_x, grid_y = corners(width_px, firmware), corners(height_px, firmware)
    across, patches = len(grid_x), len(grid_x) * len(grid_y)
    span = int(grid_x[-1] - grid_x[0]) + TILE
    plane = height_px * width_px
    bins = 2 * (2 * firmware.search_px + 1) + 1
    return Workspace(
        grid_x,
        grid_y,
        columns=np.zeros(-(-span // VECTOR) * VECTOR, np.uint16),
        right=np.zeros(plane, np.uint8),
        down=np.zeros(plane, np.uint8),
        diagonal=np.zeros(plane, np.uint8),
        usable=np.zeros(across, np.uint8),
        best=np.zeros(across, np.uint16),
        shift_x=np.zeros(across, np.int64),
        shift_y=np.zeros(across, np.int64),
        direction=np.full(max(patches, width_px), NO_DIRECTION, np.int64),
        histogram_x=np.zeros(bins, np.int64),
        histogram_y=np.zeros(bins, np.int64),
    )


# -- the parts of one match --------------------------------------------------------------------------------
@kernel
def gradient_sum(image, first, width, rows_twice):  # type: ignore[no-untyped-def]
    """The feature test: absolute steps between neighbours in the middle 4x4 of the patch at flat index `first`."""
    corner = first + 2 * width + 2
    down, across = np.int64(0), np.int64(0)
    for row in range(4):
        for column in range(4):
            here = corner + row * width + column
            if row < 3:
                down += abs(np.int64(image[here]) - np.int64(image[here + width]))
            if column < 3:
                across += abs(np.int64(image[here]) - np.int64(image[here + 1]))
    return 2 * down if rows_twice else down + across


@kernel
def half_pixel_planes(image, width, right, down, diagonal):  # type: ignore[no-untyped-def]
    """The image half a pixel to the right, down and both: halving averages that round down, as the ARM's UHADD8."""
    n = np.uint64(len(image))
    one, row = np.uint64(1), np.uint64(width)
    shift = np.uint16(1)
    for k in range(n - one):
        right[k] = np.uint8((np.uint16(image[k]) + np.uint16(image[k + one])) >> shift)
    for k in range(n - row):
        down[k] = np.uint8((np.uint16(image[k]) + np.uint16(image[k + row])) >> shift)
    for k in range(n - row):
        diagonal[k] = np.uint8((np.uint16(right[k]) + np.uint16(right[k + row])) >> shift)


@kernel
def patch_sad(first_image, first, second_image, second, width):  # type: ignore[no-untyped-def]
    """Sum of absolute differences of the 8x8 patches at flat indices `first` and `second`."""
    a, b, row = np.uint64(first), np.uint64(second), np.uint64(width)
    total = np.uint16(0)
    for x in range(TILE):
        column = np.uint16(0)
        for r in range(TILE):
            p = first_image[a + np.uint64(x) + np.uint64(r) * row]
            c = second_image[b + np.uint64(x) + np.uint64(r) * row]
            column = np.uint16(column + np.uint16(max(p, c) - min(p, c)))
        total = np.uint16(total + column)
    return total


@kernel
def column_sads(previous, first, current, second, width, columns):  # type: ignore[no-untyped-def]
    """Absolute differences summed down eight rows, for every column of a row of patches."""
    a, b, row = np.uint64(first), np.uint64(second), np.uint64(width)
    for x in range(len(columns)):
        total = np.uint16(0)
        for r in range(TILE):
            p = previous[a + np.uint64(x) + np.uint64(r) * row]
            c = current[b + np.uint64(x) + np.uint64(r) * row]
            total = np.uint16(total + np.uint16(max(p, c) - min(p, c)))
        columns[x] = total


@kernel
def search_row(previous, current, width, corner_y, settings, work):  # type: ignore[no-untyped-def]
    """Best whole-pixel shift of every patch of one row; the first smallest sum, row by row, wins."""
    start = work.corners_x[0]
    work.best[:] = WORST_SAD
    for shift_y in range(-settings.search, settings.search + 1):
        for shift_x in range(-settings.search, settings.search + 1):
            first = corner_y * width + start
            second = (corner_y + shift_y) * width + start + shift_x
            column_sads(previous, first, current, second, width, work.columns)
            for n in range(len(work.corners_x)):
                left = np.uint64(work.corners_x[n] - start)
                total = np.uint16(0)
                for column in range(TILE):
                    total = np.uint16(total + work.columns[left + np.uint64(column)])
                if total < work.best[n]:
                    work.best[n] = total
                    work.shift_x[n] = shift_x
                    work.shift_y[n] = shift_y


@kernel
def half_pixel_direction(previous, first, second, width, sad, work):  # type: ignore[no-untyped-def]
    """Which of the eight half-pixel neighbours of the best match is better still, 8 for none."""
    direction: int = NO_DIRECTION
    least = sad
    for k in range(8):
        if k == 0 or k == 4:
            candidate = patch_sad(previous, first, work.right, second - (1 if k == 4 else 0), width)
        elif k == 2 or k == 6:
            candidate = patch_sad(previous, first, work.down, second - (width if k == 6 else 0), width)
        else:
            corner = second - (1 if k == 3 or k == 5 else 0) - (width if k == 5 or k == 7 else 0)
            candidate = patch_sad(previous, first, work.diagonal, corner, width)
        if candidate < least:
            least, direction = candidate, k
    return direction


@kernel
def histogram_peak(histogram, search):  # type: ignore[no-untyped-def]
    """Centroid of the five bins about the fullest one [px]; a bin is half a pixel."""
    peak = 0
    for k in range(len(histogram)):
        if histogram[k] > histogram[peak]:
            peak = k
    weight, moment = 0, 0
    for k in range(max(peak - 2, 0), min(peak + 3, len(histogram))):
        weight += histogram[k]
        moment += k * histogram[k]
    return (moment / weight - (2 * search + 1)) / 2.0


@kernel
def match(previous, current, width, settings, work):  # type: ignore[no-untyped-def]
    """Flow [px] and quality 0..255 from one flat frame to the next; 0, 0, 0 where too few patches are accepted."""
    half_pixel_planes(current, width, work.right, work.down, work.diagonal)
    work.histogram_x[:] = 0
    work.histogram_y[:] = 0
    accepted, total_x, total_y = 0, 0.0, 0.0
    y_sign = -1.0 if settings.half_pixel_y else 1.0
    for corner_y in work.corners_y:
        some = False
        for n in range(len(work.corners_x)):
            first = corner_y * width + work.corners_x[n]
            usable = gradient_sum(previous, first, width, settings.rows_twice) >= settings.feature_threshold
            work.usable[n] = usable
            some = some or usable
        if not some:
            continue
        search_row(previous, current, width, corner_y, settings, work)
        for n in range(len(work.corners_x)):
            if not work.usable[n] or work.best[n] >= settings.sad_threshold:
                continue
            first = corner_y * width + work.corners_x[n]
            second = first + work.shift_y[n] * width + work.shift_x[n]
            direction = half_pixel_direction(previous, first, second, width, work.best[n], work)
            work.direction[accepted] = direction
            total_x += work.shift_x[n] + HALF_X[direction]
            total_y += work.shift_y[n] + y_sign * HALF_Y[direction]
            accepted += 1
            # before 2020 the histogram took the direction of the patch whose number is this patch's column
            seen = work.direction[work.corners_x[n]] if settings.histogram_index else direction
            work.histogram_x[2 * (work.shift_x[n] + settings.search) + 1 + int(2.0 * HALF_X[seen])] += 1
            work.histogram_y[2 * (work.shift_y[n] + settings.search) + 1 + int(2.0 * y_sign * HALF_Y[seen])] += 1
    if accepted <= FEWEST_PATCHES:
        return 0.0, 0.0, 0
    quality = accepted * 255 // (len(work.corners_x) * len(work.corners_y))
    if settings.histogram:
        return (
            histogram_peak(work.histogram_x, settings.search),
            histogram_peak(work.histogram_y, settings.search),
            quality,
        )
    return total_x / accepted, total_y / accepted, quality


@kernel
def match_sequence(frames, settings, work, flow_px, quality):  # type: ignore[no-untyped-def]
    """`match` from each of `frames` (n, height, width) uint8 to the next: flow_px (n-1, 2), quality (n-1)."""
    width = frames.shape[2]
    for k in range(len(frames) - 1):
        x, y, good = match(frames[k].ravel(), frames[k + 1].ravel(), width, settings, work)
        flow_px[k, 0] = x
        flow_px[k, 1] = y
        quality[k] = good
