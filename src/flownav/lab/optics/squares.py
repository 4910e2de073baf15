"""Squares in a grey frame: regions darker or brighter than their surroundings, and their edges to sub-pixels.

Image coordinates here are (column, row) [px], whole numbers at the middle of a pixel. Corners go clockwise as seen.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import kernel
from flownav.core.measurement import Array

DARK, LIGHT = 1, 2
TILES_ALONG_SHORT_SIDE = (3, 8, 24)  # a pixel is judged against 3x3 tiles of each of these sizes
LEAST_CONTRAST_GREY = 12.0
LEAST_SIDE_PX = 12.0
LEAST_FILL = 0.85  # of a region's convex hull by the four corners
LEAST_CUT_FILL = 0.93  # of the convex hull of a region at the frame's edge, where it is part of a square
BLOCKS, SAMPLES_A_BLOCK = 10, 6
CORNER_MARGIN = 0.08  # part of a side at each end that the neighbouring edge disturbs
WIDEST_REACH_PX = 3.0
STEP_PX = 0.25
PASSES = 4


class Square(NamedTuple):
    """Four corners (4, 2) [px] and how good the edges between them are.

    `rms_px`: of the edge's places about straight sides. `weakest`: the least contrast of a part of a side as a part of
    the median contrast. `inner_grey`, `outer_grey`: levels on the two sides of the edges.
    """

    corners: Array
    rms_px: float
    weakest: float
    inner_grey: float
    outer_grey: float


class Region(NamedTuple):
    """A connected region: its convex hull's four corners, and whether it is a straight-sided one cut by the frame."""

    shade: int
    box_px: tuple[int, int]  # rows, columns
    cut: bool
    corners: Array | None  # None: not a square


# -- regions ---------------------------------------------------------------------------------------------------------
def shades(frame: NDArray[np.uint8], tiles: int) -> NDArray[np.uint8]:
    """DARK, LIGHT or 0 of every pixel: below or above the middle between its surroundings' extremes.

    0 where the surroundings, 3x3 tiles, have too little contrast (the threshold of AprilTag 2, Wang and Olson 2016).
    """
    height, width = frame.shape
    tile = max(min(height, width) // tiles, 2)
    rows, columns = -(-height // tile), -(-width // tile)
    padded = np.pad(frame, ((0, rows * tile - height), (0, columns * tile - width)), mode="edge")
    blocks = padded.reshape(rows, tile, columns, tile)
    low, high = _around(blocks.min((1, 3)), np.minimum), _around(blocks.max((1, 3)), np.maximum)
    contrast, middle = high.astype(float) - low, 0.5 * (high.astype(float) + low)
    middle = np.repeat(np.repeat(middle, tile, 0), tile, 1)[:height, :width]
    known = np.repeat(np.repeat(contrast >= LEAST_CONTRAST_GREY, tile, 0), tile, 1)[:height, :width]
    return np.where(known, np.where(frame < middle, DARK, LIGHT), 0).astype(np.uint8)


def _around(values: NDArray[np.uint8], extreme: np.ufunc) -> NDArray[np.uint8]:
    """The extreme of every tile and its eight neighbours."""
    padded = np.pad(values, 1, mode="edge")
    across = extreme(extreme(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])
    return np.asarray(extreme(extreme(across[:-2], across[1:-1]), across[2:]))


@kernel
def label_regions(shade, labels, stack, table):  # type: ignore[no-untyped-def]
    """Number the connected regions (four neighbours) of one shade each; how many.

    `labels` (height, width) takes the numbers from 1, `table` (n, 5) each region's shade and box: first and last row,
    first and last column. Regions beyond the table's length are left out.
    """
    height, width = shade.shape
    labels[:] = 0
    count = 0
    for start in range(height * width):
        row, column = start // width, start % width
        if shade[row, column] == 0 or labels[row, column] != 0:
            continue
        if count == len(table):
            return count
        kind = shade[row, column]
        box = (row, row, column, column)
        count += 1
        labels[row, column] = count
        stack[0] = start
        waiting = 1
        while waiting > 0:
            waiting -= 1
            r, c = stack[waiting] // width, stack[waiting] % width
            box = (min(box[0], r), max(box[1], r), min(box[2], c), max(box[3], c))
            for k in range(4):
                nr = r + (k == 0) - (k == 1)
                nc = c + (k == 2) - (k == 3)
                inside = 0 <= nr < height and 0 <= nc < width
                if inside and shade[nr, nc] == kind and labels[nr, nc] == 0:
                    labels[nr, nc] = count
                    stack[waiting] = nr * width + nc
                    waiting += 1
        table[count - 1, 0] = kind
        table[count - 1, 1], table[count - 1, 2], table[count - 1, 3], table[count - 1, 4] = box
    return count


def regions(frame: NDArray[np.uint8], wanted: tuple[int, ...]) -> Iterator[Region]:
    """Regions of the wanted shades large enough to be a target, at every size of surroundings."""
    height, width = frame.shape
    labels, stack = np.zeros((height, width), np.int32), np.empty(height * width, np.int64)
    table = np.zeros((height * width, 5), np.int64)
    for tiles in TILES_ALONG_SHORT_SIDE:
        count = label_regions(shades(frame, tiles), labels, stack, table)
        tall, wide = table[:count, 2] - table[:count, 1] + 1, table[:count, 4] - table[:count, 3] + 1
        large = np.isin(table[:count, 0], wanted) & (np.minimum(tall, wide) >= 0.7 * LEAST_SIDE_PX)
        for k in np.flatnonzero(large):
            shade, top, bottom, left, right = (int(v) for v in table[k])
            cut = top == 0 or left == 0 or bottom == height - 1 or right == width - 1
            inside = labels[top : bottom + 1, left : right + 1] == k + 1
            hull = convex_hull(_row_ends(inside))
            corners = None if cut else four_corners(hull)
            even = cut and _filled(inside) >= LEAST_CUT_FILL * area(hull)
            yield Region(shade, (bottom - top + 1, right - left + 1), even, _moved(corners, left, top))


def _filled(inside: NDArray[np.bool_]) -> float:
    """Area [px²] of a region with its gaps filled along rows or along columns, whichever is more."""
    return max(float((_spans(side) - 1).clip(0).sum()) for side in (inside, inside.T))


def _spans(inside: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Pixels from the first to the last of every row, 0 where a row is empty."""
    width = inside.shape[1] - inside[:, ::-1].argmax(1) - inside.argmax(1)
    return np.asarray(np.where(inside.any(1), width, 0))


def _moved(corners: Array | None, column: int, row: int) -> Array | None:
    return None if corners is None else corners + np.array([column, row], float)


def _row_ends(inside: NDArray[np.bool_]) -> Array:
    """The first and the last pixel (column, row) of every row of a region."""
    row = np.arange(len(inside))
    first, last = inside.argmax(1), inside.shape[1] - 1 - inside[:, ::-1].argmax(1)
    return np.column_stack([np.concatenate([first, last]), np.concatenate([row, row])]).astype(float)


def convex_hull(points: Array) -> Array:
    """Corners of the convex hull, clockwise as seen with rows downwards (Andrew's monotone chain)."""
    ordered = sorted({(float(x), float(y)) for x, y in points})
    if len(ordered) < 3:
        return np.array(ordered)

    def chain(sequence: list[tuple[float, float]]) -> list[tuple[float, float]]:
        kept: list[tuple[float, float]] = []
        for x, y in sequence:
            while len(kept) > 1:
                (ax, ay), (bx, by) = kept[-2], kept[-1]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                    break
                kept.pop()
            kept.append((x, y))
        return kept[:-1]

    return np.array(chain(ordered) + chain(ordered[::-1]))


def area(polygon: Array) -> float:
    """Area of a polygon [px²], positive where its corners go clockwise as seen with rows downwards."""
    x, y = polygon[:, 0], polygon[:, 1]
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def four_corners(hull: Array) -> Array | None:
    """The hull's two farthest corners and the farthest on either side of them; None where four do not fill it."""
    if len(hull) < 4:
        return None
    apart = hull[:, None] - hull[None, :]
    a, c = sorted(np.unravel_index(np.argmax((apart**2).sum(-1)), (len(hull), len(hull))))
    way = hull[c] - hull[a]
    off = (hull - hull[a]) @ np.array([-way[1], way[0]])
    quad = hull[sorted([int(a), int(c), int(off.argmin()), int(off.argmax())])]
    if len({tuple(corner) for corner in quad}) < 4 or area(quad) < LEAST_FILL * area(hull):
        return None
    return quad


# -- edges --------------------------------------------------------------------------------------------------------
def bilinear(frame: Array, x: Array, y: Array) -> Array:
    """Grey levels between pixels; beyond the frame the nearest pixel's."""
    height, width = frame.shape
    x, y = np.clip(x, 0.0, width - 1.0), np.clip(y, 0.0, height - 1.0)
    column, row = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    a, b = x - column, y - row
    upper = (1.0 - a) * frame[row, column] + a * frame[row, column + 1]
    lower = (1.0 - a) * frame[row + 1, column] + a * frame[row + 1, column + 1]
    return np.asarray((1.0 - b) * upper + b * lower)


def refined(frame: Array, corners: Array, shade: int, cells: int) -> Square | None:
    """The square whose sides run along the edges of a region's rough corners; None where there are none such.

    Every side is looked across at places along it, as far as half a cell (`cells` make a side), four times over: the
    edge is at the centroid of the gradient, a straight line is fitted to ten such places, neighbouring lines meet.
    The centroid is linear in the grey levels: any threshold on the gradient would draw edges towards pixels.
    """
    for turn in range(PASSES):
        side = np.linalg.norm(np.roll(corners, -1, 0) - corners, axis=1)
        if not side.min() >= LEAST_SIDE_PX * 0.7 or not (np.abs(corners) < 1e5).all():
            return None
        reach = min(0.5 * float(side.mean()) / cells, WIDEST_REACH_PX)
        reach = max(reach, 1.75) if turn < 2 else max(reach, 1.0)
        place, offset, contrast, ends = _edge_places(frame, corners, shade, reach)
        slope, level, residual = _lines(place, offset, np.maximum(contrast, 0.0))
        moved = _meeting(corners, slope, level)
        if moved is None or not np.isfinite(moved).all() or np.abs(moved - corners).max() > 0.25 * side.max():
            return None
        corners = moved
    middle = float(np.median(contrast))
    if middle < LEAST_CONTRAST_GREY or area(corners) <= 0.0:
        return None
    rms = float(np.sqrt(np.mean(residual**2)))
    inner, outer = (float(np.median(level)) for level in ends)
    return Square(corners, rms, float(contrast.min()) / middle, inner, outer)


def _edge_places(
    frame: Array, corners: Array, shade: int, reach: float
) -> tuple[Array, Array, Array, tuple[Array, Array]]:
    """Along each side (4, blocks): the place 0..1, the edge's offset outwards [px], its contrast, levels in and out."""
    along = np.roll(corners, -1, 0) - corners
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    samples = BLOCKS * SAMPLES_A_BLOCK
    place = CORNER_MARGIN + (1.0 - 2.0 * CORNER_MARGIN) * (np.arange(samples) + 0.5) / samples
    across = np.arange(-reach, reach + 0.5 * STEP_PX, STEP_PX)
    points = (
        corners[:, None, None]
        + place[None, :, None, None] * along[:, None, None]
        + across[None, None, :, None] * outward[:, None, None]
    )
    profile = bilinear(frame, points[..., 0], points[..., 1])
    profile = profile.reshape(4, BLOCKS, SAMPLES_A_BLOCK, len(across)).mean(2)
    rise = np.diff(profile, axis=-1) * (1.0 if shade == DARK else -1.0)
    contrast = rise.sum(-1)
    centroid = (rise @ (0.5 * (across[1:] + across[:-1]))) / np.where(contrast > 1.0, contrast, np.inf)
    offset = np.clip(centroid, -reach, reach)
    places = np.broadcast_to(place.reshape(BLOCKS, SAMPLES_A_BLOCK).mean(1), offset.shape)
    return places, offset, contrast, (profile[..., 0], profile[..., -1])


def _lines(place: Array, offset: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Straight lines offset = level + slope (place - 1/2) of each side, the farthest places left out once."""
    used = weight + 1e-9
    for _ in range(2):
        x = place - 0.5
        mean_x, mean_y = (np.sum(used * v, 1) / np.sum(used, 1) for v in (x, offset))
        dx, dy = x - mean_x[:, None], offset - mean_y[:, None]
        slope = np.sum(used * dx * dy, 1) / np.sum(used * dx * dx, 1)
        residual = dy - slope[:, None] * dx
        spread = np.median(np.abs(residual), 1, keepdims=True)
        used = np.where(np.abs(residual) <= 4.5 * spread + 0.02, weight + 1e-9, 1e-9)
    return slope, mean_y - slope * mean_x, residual


def _meeting(corners: Array, slope: Array, level: Array) -> Array | None:
    """Where neighbouring sides, moved by level + slope (place - 1/2), meet; None where they are parallel."""
    along = np.roll(corners, -1, 0) - corners
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    start = corners + (level - 0.5 * slope)[:, None] * outward
    way = along + slope[:, None] * outward
    before, before_way = np.roll(start, 1, 0), np.roll(way, 1, 0)
    cross = before_way[:, 0] * way[:, 1] - before_way[:, 1] * way[:, 0]
    if (np.abs(cross) < 1e-9).any():
        return None
    gap = start - before
    part = (gap[:, 0] * way[:, 1] - gap[:, 1] * way[:, 0]) / cross
    return np.asarray(before + part[:, None] * before_way)
