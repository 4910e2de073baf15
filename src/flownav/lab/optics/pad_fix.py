"""The landing pad in one camera frame: where its centre lies from the lens, how far away, and how far off that is.

The fix is what MAVLink's LANDING_TARGET carries and what `Sensor.PAD` means: tangents of the angles towards body
forward and right, and the distance from lens to centre. The image is rectilinear (a pinhole's); a lens that
distorts has to be corrected first.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.lab.optics import squares
from flownav.lab.optics.pad import BOARD_CELLS, TAG_CELLS, PadTarget, checked, corners_m, picture_cells
from flownav.lab.optics.projection import PlanePose, Pose, homography, image_point, mapped, plane_pose

# why there is no fix, from the least to the most that was seen
NO_FRAME = "not a frame of grey levels"
TOO_DARK = "too dark or without contrast"
NO_SQUARE = "no square in the frame"
CUT = "cut by the frame's edge"
TOO_FAR = "too far: too few pixels"
BLURRED = "edges blurred, bent or broken"
OTHER = "a square, but not this target"
REASONS = (NO_FRAME, TOO_DARK, NO_SQUARE, CUT, TOO_FAR, BLURRED, OTHER)

# of the 28 cells of a tag's ring and the 36 of its code (two codes differ in 11 or more); of a plain pad's 36 and 64
WRONG_CELLS_ALLOWED = {True: (2, 2), False: (3, 6)}
CUT_PART = 0.25  # of the frame's height and width: a region this large at the edge may be the target
STRAIGHT_PX = 0.6
WEAKEST_PART = {True: 0.25, False: 0.35}  # of the median contrast, along the sides of a tag and of a plain pad
SQUARE_PART = 0.012  # of the side: the corners of a plain pad agree with a square to this
MIDDLE = slice(TAG_CELLS // 2 - 1, TAG_CELLS // 2 + 1)
CELL_SAMPLES = np.array([-0.22, 0.0, 0.22])


class PadFix(NamedTuple):
    """The pad's centre from the lens, body FRD axes, and what it was measured on.

    `tan_forward`, `tan_right`: tangents of the angles from body down. `distance_m`: from lens to centre.
    `heading_rad`: of the top of the pad's picture from body forward, clockwise from above, -pi to pi; a plain pad
    looks alike after half a turn, so its heading is from -pi/2 to pi/2. `corners_px` (4, 2): column and row,
    from the picture's top left clockwise. `coded`: the identity was read, not only an outline. `side_m`: of the square
    that was found, of a nested tag the inner's or the outer's.
    """

    tan_forward: float
    tan_right: float
    distance_m: float
    heading_rad: float
    corners_px: Array
    coded: bool
    side_m: float


class PadSearch(NamedTuple):
    """Result of a search in a frame: a fix, or None and the reason (one of REASONS)."""

    fix: PadFix | None
    reason: str


def find_pad(
    frame: Any, target: PadTarget, focal_px: float, body_from_camera: NDArray[np.float64] | None = None
) -> PadSearch:
    """Look for a target in a frame (height, width) uint8; `focal_px` as effective, the image's middle on the axis.

    `body_from_camera` (3, 3) turns the camera frame into body FRD; without it the image's x is body forward and its
    y body right. Of a nested tag the inner one is looked for first. Never raises on a frame, whatever is in it;
    InputError where the target itself is none.
    """
    if checked(target).pattern == "nested":
        inner = find_pad(frame, target.inner, focal_px, body_from_camera)
        if inner.fix is not None:
            return inner
    grey = np.asarray(frame)
    if grey.ndim != 2 or grey.dtype != np.uint8 or min(grey.shape) < 2 * squares.LEAST_SIDE_PX:
        return PadSearch(None, NO_FRAME)
    low, high = np.percentile(_halved(grey), (0.2, 99.8))
    if high - low < squares.LEAST_CONTRAST_GREY:
        return PadSearch(None, TOO_DARK)
    axes = np.eye(3) if body_from_camera is None else np.asarray(body_from_camera, float)
    levels = grey.astype(float)
    seen: list[tuple[float, PadFix]] = []
    reasons = [NO_SQUARE]
    for region in squares.regions(
        np.ascontiguousarray(grey), (squares.DARK,) if target.coded else (squares.DARK, squares.LIGHT)
    ):
        corners, reason = _corners_of(region, levels, target)
        if corners is None:
            reasons.append(reason)
            continue
        pose = _pose_of(corners, levels.shape, target, focal_px)
        fix = None if pose is None else _fix(pose, corners, axes, target)
        if fix is None:
            reasons.append(OTHER)
        else:
            seen.append((squares.area(corners), fix))
    if not seen:
        return PadSearch(None, max(reasons, key=REASONS.index))
    return PadSearch(max(seen, key=lambda found: found[0])[1], "found")


def _halved(grey: NDArray[np.uint8]) -> Array:
    """Two by two pixels averaged, which halves the noise."""
    rows, columns = grey.shape[0] // 2, grey.shape[1] // 2
    return np.asarray(grey[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2).mean((1, 3)))


def _corners_of(region: squares.Region, levels: Array, target: PadTarget) -> tuple[Array | None, str]:
    """The target's corners in the picture's order, or None and why this region is not the target."""
    height, width = levels.shape
    if region.cut:
        large = region.box_px[0] >= CUT_PART * height and region.box_px[1] >= CUT_PART * width
        return None, CUT if large else NO_SQUARE
    if region.corners is None:
        return None, NO_SQUARE
    cells = TAG_CELLS if target.coded else BOARD_CELLS
    square = squares.refined(levels, region.corners, region.shade, cells)
    if square is None:
        return None, NO_SQUARE
    sides = np.linalg.norm(np.roll(square.corners, -1, 0) - square.corners, axis=1)
    if sides.min() < squares.LEAST_SIDE_PX:
        return None, TOO_FAR
    inside = (square.corners > 0.0) & (square.corners < np.array([width - 1.0, height - 1.0]))
    if not inside.all():
        return None, CUT
    if square.rms_px > STRAIGHT_PX or square.weakest < WEAKEST_PART[target.coded]:
        return None, BLURRED
    return _in_order(levels, square, target), OTHER


def _in_order(levels: Array, square: squares.Square, target: PadTarget) -> Array | None:
    """The corners turned so that the first is the picture's top left; None where the cells are not the target's."""
    wanted = picture_cells(target)[1:-1, 1:-1] if target.coded else picture_cells(target)
    cells = read_cells(levels, square, len(wanted))
    if cells is None:
        return None
    turned = [np.rot90(cells, turn) != wanted for turn in range(4)]
    if target.pattern == "nested":
        for wrong in turned:
            wrong[MIDDLE, MIDDLE] = False  # where the inner tag is
    best = int(np.argmin([wrong.sum() for wrong in turned]))
    ring = int(turned[best].sum() - turned[best][1:-1, 1:-1].sum())
    code = int(turned[best][1:-1, 1:-1].sum())
    ring_allowed, code_allowed = WRONG_CELLS_ALLOWED[target.coded]
    return np.roll(square.corners, -best, 0) if ring <= ring_allowed and code <= code_allowed else None


def read_cells(levels: Array, square: squares.Square, count: int) -> NDArray[np.bool_] | None:
    """The count x count cells of a square as they stand from its first corner, True where white.

    Grey levels are compared with the middle of those within and without the square's edge. None where the corners
    are not those of a square in perspective.
    """
    outline = count * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    transform = homography(outline, square.corners)
    if transform is None:
        return None
    place = (np.arange(count)[:, None] + 0.5 + CELL_SAMPLES).ravel()
    column, row = np.meshgrid(place, place)
    points = mapped(transform, np.column_stack([column.ravel(), row.ravel()]))
    if not np.isfinite(points).all():
        return None
    samples = squares.bilinear(levels, points[:, 0], points[:, 1])
    means = samples.reshape(count, len(CELL_SAMPLES), count, len(CELL_SAMPLES)).mean((1, 3))
    return np.asarray(means > 0.5 * (square.inner_grey + square.outer_grey))


def _pose_of(corners: Array, shape: tuple[int, ...], target: PadTarget, focal_px: float) -> PlanePose | None:
    """The board's pose before the camera; None where a plain pad's corners are not those of a square."""
    middle = 0.5 * np.array([shape[1] - 1.0, shape[0] - 1.0])
    pose = plane_pose(corners_m(target), (corners - middle) / focal_px)
    if pose is None or target.coded:
        return pose
    allowed_px = SQUARE_PART * float(np.sqrt(squares.area(corners))) + 0.2
    return pose if pose.rms * focal_px <= allowed_px else None


def _fix(pose: PlanePose, corners: Array, axes: Array, target: PadTarget) -> PadFix | None:
    """The fix in body axes; None where the pad is not below."""
    forward, right, down = axes @ pose.place_m
    if not down > 1e-6:
        return None
    top = axes @ pose.rotation[:, 0]
    heading = float(np.arctan2(top[1], top[0]))
    if not target.coded:
        heading = (heading + 0.5 * np.pi) % np.pi - 0.5 * np.pi
    distance_m = float(np.linalg.norm(pose.place_m))
    return PadFix(float(forward / down), float(right / down), distance_m, heading, corners, target.coded, target.side_m)


# -- the pad as it is --------------------------------------------------------------------------------------------
WRONG_CENTRE, WRONG_DISTANCE = 0.5, 0.1  # of the pad's side, of the distance: a fix farther off is wrong, not noisy


class Truth(NamedTuple):
    """Tangents towards camera x and y, distance from the lens, heading, rays of the corners (4, 2) of the square that
    is looked for and of the whole board, which a tag's white ring belongs to; the height from which a level target
    looks as small straight above it (`sensors.pad_camera.reach_of`).
    """

    tan_forward: float
    tan_right: float
    distance_m: float
    heading_rad: float
    corner_rays: Array
    board_rays: Array
    reach_m: float


def truth_of(pose: Pose, target: PadTarget) -> Truth:
    """A perfect fix, camera axes taken as the body's."""
    rotation = np.array(pose[3:]).reshape(3, 3)
    forward, right, down = rotation.T @ np.array([-pose.x_m, -pose.y_m, pose.height_m])
    wider = target.board_m / target.side_m
    corners, board = (
        np.array([image_point(pose, x, y, 1.0) for x, y in of]) for of in (corners_m(target), wider * corners_m(target))
    )
    distance_m = float(np.sqrt(forward**2 + right**2 + down**2))
    heading = float(np.arctan2(rotation[0, 1], rotation[0, 0]))
    return Truth(
        float(forward / down), float(right / down), distance_m, heading, corners, board, distance_m**2 / pose.height_m
    )


def fix_error(fix: PadFix, truth: Truth) -> Array:
    """Across the sight forward and sideways [rad], distance as a part of it, heading [rad]: measured less true.

    The angles are those between the two lines of sight, taken apart along the triad of `estimation.laws.pad`.
    """
    a, b = truth.tan_forward, truth.tan_right
    level, length = np.sqrt(1.0 + a * a), np.sqrt(1.0 + a * a + b * b)
    along = (1.0 + a * fix.tan_forward + b * fix.tan_right) / length
    across = (fix.tan_forward - a) / level / along
    sideways = ((1.0 + a * a) * fix.tan_right - b * (1.0 + a * fix.tan_forward)) / (level * length) / along
    whole_turn = 2.0 * np.pi if fix.coded else np.pi
    heading = (fix.heading_rad - truth.heading_rad + 0.5 * whole_turn) % whole_turn - 0.5 * whole_turn
    return np.array([np.arctan(across), np.arctan(sideways), fix.distance_m / truth.distance_m - 1.0, heading])


def is_wrong(error: Array, truth: Truth, target: PadTarget) -> bool:
    """Whether something else was taken for the pad."""
    off_m = float(np.hypot(error[0], error[1])) * truth.distance_m
    return bool(abs(error[2]) > WRONG_DISTANCE or off_m > WRONG_CENTRE * target.side_m)
