"""The landing pad in a frame: geometry against the projection, OpenCV as oracle, and what must not be found."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import typer
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from typer.testing import CliRunner

from flownav.cli import pad as pad_command
from flownav.core.errors import InputError
from flownav.core.measurement import COLUMNS, Sensor
from flownav.lab.optics import pad_fix
from flownav.lab.optics.camera import Camera, effective_focal_px
from flownav.lab.optics.pad import (
    CODES_36H11,
    Pad,
    PadTarget,
    code_cells,
    corners_m,
    ground,
    laid_out,
    picture_cells,
    print_target,
    printed_cells,
)
from flownav.lab.optics.pad_fix import PadSearch, find_pad, fix_error, is_wrong, truth_of
from flownav.lab.optics.projection import Pose, homography, plane_pose, pose_looking_down
from flownav.lab.optics.render import film

CLEAN = {"read_noise_grey": 0.0, "photon_noise_grey": 0.0}
SMALL = Camera(200, 150, 9.6e-6, 200 * 4.8e-6 / np.tan(np.radians(30.0)), 2.8, 1.5, **CLEAN)  # 60 degrees, sharp
FOCAL = effective_focal_px(SMALL)
TAG = PadTarget(0.2, "tag", 3)


def shot(target: PadTarget, pose: Pose, camera: Camera = SMALL, seed: int = 1) -> np.ndarray:
    pad = laid_out(target, 2.0 * pose.height_m + 0.3, pose.height_m / effective_focal_px(camera) / 2.0, seed)
    return film(pad, [pose], camera=camera, seed=seed)[0]


def corners_of(pose: Pose, target: PadTarget = TAG) -> np.ndarray:
    """The square's corners (4, 2) as SMALL has them, column and row."""
    return truth_of(pose, target).corner_rays * FOCAL + 0.5 * np.array([SMALL.width_px - 1.0, SMALL.height_px - 1.0])


def found(search: PadSearch) -> pad_fix.PadFix:
    assert search.fix is not None, search.reason
    assert search.reason == "found"
    return search.fix


def turned(pose: Pose) -> Pose:
    """The same view from the far end of the pad: half a turn about the pad's middle."""
    rotation = np.diag([-1.0, -1.0, 1.0]) @ np.array(pose[3:]).reshape(3, 3)
    return Pose(-pose.x_m, -pose.y_m, pose.height_m, *rotation.ravel())


# -- the target ------------------------------------------------------------------------------------------------------
def test_codes_are_those_of_the_family_as_opencv_prints_them() -> None:
    """OpenCV prints this family upside down; the codes differ in 11 cells or more at every turn."""
    aruco = pytest.importorskip("cv2").aruco
    family = aruco.getPredefinedDictionary(aruco.DICT_APRILTAG_36h11)
    for code in range(len(CODES_36H11)):
        picture = aruco.generateImageMarker(family, code, 80, borderBits=1)
        np.testing.assert_array_equal(
            picture_cells(PadTarget(code=code))[1:-1, 1:-1], picture[5::10, 5::10][::-1, ::-1] > 0
        )
    words = [np.rot90(code_cells(k), t) for k in range(len(CODES_36H11)) for t in range(4)]
    assert min((a != b).sum() for i, a in enumerate(words) for b in words[:i]) >= 11


def test_the_board_lies_centred_on_the_origin_at_its_true_size() -> None:
    pad = laid_out(TAG, 1.0, 0.003)
    size = len(pad.reflectance)
    assert size * pad.texel_m >= 1.0
    assert pad.texel_m <= 0.003
    half = TAG.side_m / 2.0

    def level(x_m: float, y_m: float) -> float:
        return float(pad.reflectance[int(np.floor(y_m / pad.texel_m)) % size, int(np.floor(x_m / pad.texel_m)) % size])

    inside, outside = 0.999 * half, 1.001 * half
    for x, y in ((inside, 0.0), (-inside, 0.0), (0.0, inside), (0.0, -inside)):
        assert level(x, y) == pytest.approx(0.167)
    for x, y in ((outside, 0.0), (-outside, 0.0), (0.0, outside), (0.0, -outside)):
        assert level(x, y) == pytest.approx(0.833)
    cells = code_cells(TAG.code)
    top_left = level(2.5 * TAG.cell_m, -2.5 * TAG.cell_m)  # x towards the top, y to the right
    assert (top_left > 0.5) == cells[0, 0]
    row, column = np.argwhere(cells != cells[::-1])[0]
    assert (level((2.5 - row) * TAG.cell_m, (column - 2.5) * TAG.cell_m) > 0.5) == cells[row, column]


@pytest.mark.parametrize(
    ("target", "message"),
    [
        (PadTarget(0.2, "circle"), "unknown; known are tag, nested, checker, stripes"),
        (PadTarget(0.0), "side of 0 m"),
        (PadTarget(0.2, "tag", 16), "code 16"),
    ],
)
def test_a_target_that_is_none_is_refused(target: PadTarget, message: str) -> None:
    with pytest.raises(InputError, match=message):
        picture_cells(target)
    with pytest.raises(InputError, match=message):
        find_pad(np.zeros((100, 100), np.uint8), target, FOCAL)


def test_a_target_too_fine_for_a_raster_is_refused() -> None:
    with pytest.raises(InputError, match="larger target"):
        laid_out(TAG, 50.0, 1e-4)


def test_the_printed_target_has_its_size_and_is_read_by_opencv(tmp_path: Path) -> None:
    cv2, image = pytest.importorskip("cv2"), pytest.importorskip("PIL.Image")
    print_target(PadTarget(0.16, "tag", 5), tmp_path / "tag.png")
    with image.open(tmp_path / "tag.png") as picture:
        dots = np.asarray(picture)
        assert dots.shape[0] / picture.info["dpi"][0] * 0.0254 == pytest.approx(0.16 * 10 / 8, rel=1e-3)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    _, codes, _ = detector.detectMarkers(np.pad(dots[::4, ::4], 20, constant_values=255))
    assert codes.ravel().tolist() == [5]
    with pytest.raises(InputError, match="cannot be written"):
        print_target(TAG, tmp_path)


# -- pose of a plane -------------------------------------------------------------------------------------------------
TILT = st.floats(-0.5, 0.5)


@settings(max_examples=60, deadline=None)
@given(TILT, TILT, st.floats(-3.1, 3.1), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0.3, 5.0))
def test_a_pose_is_recovered_from_its_projection(roll, pitch, yaw, x, y, height) -> None:  # type: ignore[no-untyped-def]
    pose = pose_looking_down(x * height, y * height, height, roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw)
    truth = truth_of(pose, TAG)
    solved = plane_pose(corners_m(TAG), truth.corner_rays)
    assert solved is not None
    place = solved.place_m
    assert np.linalg.norm(place) == pytest.approx(truth.distance_m, rel=1e-6)
    assert place[:2] / place[2] == pytest.approx([truth.tan_forward, truth.tan_right], abs=1e-8)
    np.testing.assert_allclose(solved.rotation.T @ solved.rotation, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(solved.rotation, np.array(pose[3:]).reshape(3, 3).T, atol=1e-3)


@pytest.mark.parametrize("seed", range(12))
def test_the_pose_is_no_worse_than_opencvs_with_noise_on_the_corners(seed: int) -> None:
    cv2 = pytest.importorskip("cv2")
    rng = np.random.default_rng(seed)
    pose = pose_looking_down(
        *rng.uniform(-0.3, 0.3, 2),
        1.2,
        roll_rad=rng.uniform(-0.25, 0.25),
        pitch_rad=rng.uniform(-0.25, 0.25),
        yaw_rad=2.0,
    )
    tangents = truth_of(pose, TAG).corner_rays + rng.normal(0.0, 0.1, (4, 2)) / FOCAL
    solved = plane_pose(corners_m(TAG), tangents)
    assert solved is not None
    figure = np.column_stack([corners_m(TAG), np.zeros(4)])
    poses = cv2.solvePnPGeneric(figure, tangents, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    starts = list(zip(poses[1], poses[2], strict=True))
    theirs = [
        cv2.solvePnP(figure, tangents, np.eye(3), None, r.copy(), t.copy(), True, cv2.SOLVEPNP_ITERATIVE)[1:]
        for r, t in starts
    ]
    errors = [
        np.sqrt(np.mean((cv2.projectPoints(figure, r, t, np.eye(3), None)[0][:, 0] - tangents) ** 2)) for r, t in theirs
    ]
    assert solved.rms <= min(errors) * (1.0 + 1e-6)
    best = theirs[int(np.argmin(errors))][1].ravel()
    np.testing.assert_allclose(solved.place_m, best, rtol=1e-4, atol=1e-5)


def test_points_on_a_line_have_no_map_and_no_pose() -> None:
    line = np.column_stack([np.arange(4.0), np.arange(4.0)])
    assert homography(line, corners_m(TAG)) is None
    assert plane_pose(corners_m(TAG), np.zeros((4, 2))) is None


# -- geometry ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("yaw", [0.0, 0.4, 1.6, 3.0, -1.2, -2.5])
def test_a_clean_frame_gives_the_projections_corners_to_a_fortieth_of_a_pixel(yaw: float) -> None:
    pose = pose_looking_down(0.05, -0.08, 0.8, roll_rad=0.12, pitch_rad=-0.1, yaw_rad=yaw)
    fix = found(find_pad(shot(TAG, pose), TAG, FOCAL))
    assert np.abs(fix.corners_px - corners_of(pose)).max() < 0.04
    error = fix_error(fix, truth_of(pose, TAG))
    assert np.abs(error[:2]).max() < 0.03 / FOCAL
    assert abs(error[2]) < 1e-3
    assert abs(error[3]) < 3e-3
    assert fix.coded
    assert len(COLUMNS[Sensor.PAD]) == 3
    assert fix._fields[:3] == COLUMNS[Sensor.PAD]


@pytest.mark.parametrize("pattern", ["checker", "stripes"])
def test_a_plain_pad_is_found_by_its_outline_and_looks_alike_after_half_a_turn(pattern: str) -> None:
    target = PadTarget(0.3, pattern)
    pose = pose_looking_down(0.03, 0.02, 0.8, roll_rad=0.1, pitch_rad=-0.08, yaw_rad=0.5)
    first, second = (found(find_pad(shot(target, p), target, FOCAL)) for p in (pose, turned(pose)))
    error = fix_error(first, truth_of(pose, target))
    assert np.abs(error[:2]).max() < 0.15 / FOCAL
    assert abs(error[2]) < 5e-3
    assert abs(error[3]) < 0.02
    assert not first.coded
    assert first.heading_rad == pytest.approx(second.heading_rad, abs=0.02)


def test_the_fix_follows_the_mounting_and_keeps_the_distance() -> None:
    pose = pose_looking_down(0.05, -0.08, 0.8, yaw_rad=0.3)
    frame = shot(TAG, pose)
    plain = found(find_pad(frame, TAG, FOCAL))
    image_x_right = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    mounted = found(find_pad(frame, TAG, FOCAL, image_x_right))
    assert (mounted.tan_forward, mounted.tan_right) == pytest.approx((-plain.tan_right, plain.tan_forward))
    assert mounted.distance_m == pytest.approx(plain.distance_m)
    assert np.cos(mounted.heading_rad - plain.heading_rad - np.pi / 2) == pytest.approx(1.0)


def test_corners_agree_with_opencvs_refined_apriltag_corners() -> None:
    cv2 = pytest.importorskip("cv2")
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    pose = pose_looking_down(0.03, 0.05, 0.7, roll_rad=0.1, yaw_rad=0.7)
    frame = shot(TAG, pose)
    corners, codes, _ = cv2.aruco.ArucoDetector(family, parameters).detectMarkers(frame)
    assert codes.ravel().tolist() == [TAG.code]
    ours = found(find_pad(frame, TAG, FOCAL)).corners_px
    theirs = np.roll(corners[0][0], -2, 0)  # OpenCV's pictures stand upside down
    truth = corners_of(pose)
    assert np.abs(ours - theirs).max() < 0.6
    assert np.abs(ours - truth).max() < np.abs(theirs - truth).max()


# -- what must not be found --------------------------------------------------------------------------------------------
def test_another_code_is_not_this_target() -> None:
    frame = shot(TAG, pose_looking_down(height_m=0.8))
    assert find_pad(frame, TAG._replace(code=4), FOCAL).reason == pad_fix.OTHER


def test_a_target_cut_by_the_frames_edge_is_refused() -> None:
    frame = shot(TAG, pose_looking_down(height_m=0.5))
    whole = found(find_pad(frame, TAG, FOCAL)).corners_px
    left = int(whole[:, 0].min())
    assert find_pad(frame[:, left + 3 :], TAG, FOCAL) == PadSearch(None, pad_fix.CUT)
    assert find_pad(frame[int(whole[:, 1].min()) + 3 :], TAG, FOCAL).fix is None


def test_far_and_dark_and_blurred_are_told_apart() -> None:
    assert find_pad(shot(TAG, pose_looking_down(height_m=4.0)), TAG, FOCAL).fix is None
    dark = (shot(TAG, pose_looking_down(height_m=0.8)) // 20).astype(np.uint8)
    assert find_pad(dark, TAG, FOCAL).reason == pad_fix.TOO_DARK
    near = SMALL._replace(focus_m=0.05, f_number=0.3)
    assert find_pad(shot(TAG, pose_looking_down(height_m=0.8), near), TAG, FOCAL).fix is None


@pytest.mark.parametrize("target", [TAG, PadTarget(0.3, "checker")])
def test_ground_without_a_target_gives_no_fix(target: PadTarget) -> None:
    camera = SMALL._replace(read_noise_grey=1.4, photon_noise_grey=0.02)
    bare = [Pad("ground", ground(512, seed), 0.004) for seed in range(4)]
    poses = [pose_looking_down(0.3 * k, 0.1, 1.0, yaw_rad=0.5) for k in range(15)]
    frames = np.concatenate([film(pad, poses, camera=camera) for pad in bare])
    assert len(frames) == 60
    assert [find_pad(frame, target, FOCAL).reason for frame in frames].count("found") == 0


FRAMES = arrays(np.uint8, array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=40))


@settings(max_examples=80, deadline=None)
@given(FRAMES, st.sampled_from([TAG, PadTarget(0.3, "checker"), PadTarget(0.3, "stripes")]))
def test_no_frame_raises(frame: np.ndarray, target: PadTarget) -> None:
    search = find_pad(frame, target, FOCAL)
    assert search.fix is None
    assert search.reason in pad_fix.REASONS


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(24, 90), st.integers(24, 90), st.integers(1, 40), st.integers(1, 255))
def test_no_frame_of_blocks_raises(seed: int, height: int, width: int, block: int, top: int) -> None:
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, top + 1, (height // block + 1, width // block + 1), np.uint8)
    frame = np.repeat(np.repeat(coarse, block, 0), block, 1)[:height, :width]
    for target in (TAG, PadTarget(0.3, "checker")):
        assert find_pad(frame, target, FOCAL).fix is None


@pytest.mark.parametrize("level", [0, 255])
def test_black_and_saturated_frames_are_without_contrast(level: int) -> None:
    assert find_pad(np.full((90, 120), level, np.uint8), TAG, FOCAL).reason == pad_fix.TOO_DARK
    assert find_pad(np.full((90, 120), float(level)), TAG, FOCAL).reason == pad_fix.NO_FRAME


# -- a tag within a tag ------------------------------------------------------------------------------------------------
NESTED = PadTarget(1.0, "nested", 3)


def test_a_nested_tag_is_found_by_its_inner_one_and_from_afar_by_its_outer() -> None:
    low = pose_looking_down(0.04, -0.03, 0.6, yaw_rad=0.7)
    high = pose_looking_down(0.3, 0.4, 5.0, pitch_rad=0.1, yaw_rad=-2.0)
    for pose, side_m in ((low, 0.2), (high, 1.0)):
        fix = found(find_pad(shot(NESTED, pose), NESTED, FOCAL))
        assert fix.side_m == side_m
        error = fix_error(fix, truth_of(pose, NESTED))
        assert np.hypot(*error[:2]) < 0.1 / FOCAL
        assert abs(error[2]) < 0.02
        assert abs(error[3]) < 0.02
    assert find_pad(shot(NESTED, high), NESTED._replace(code=7), FOCAL).fix is None


def test_a_nested_picture_holds_both_tags() -> None:
    cells = printed_cells(NESTED)
    assert cells.shape == (50, 50)
    outer = cells[2::5, 2::5]
    np.testing.assert_array_equal(outer[[0, 1, 2, 8, 9]], picture_cells(NESTED)[[0, 1, 2, 8, 9]])
    np.testing.assert_array_equal(outer[1:-1, 1:-1][1:3, 1:-1], code_cells(4)[:2])
    np.testing.assert_array_equal(cells[20:30, 20:30], picture_cells(PadTarget(0.2, "tag", 3)))
    assert NESTED.inner == PadTarget(0.2, "tag", 3)
    assert NESTED.board_m == pytest.approx(1.25)
    assert TAG.inner == TAG
    with pytest.raises(InputError, match="from 0 to 14"):
        picture_cells(NESTED._replace(code=15))


# -- errors -----------------------------------------------------------------------------------------------------------
@given(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.floats(-0.03, 0.03), st.floats(-0.03, 0.03))
def test_an_error_is_the_angle_between_the_sights(x: float, y: float, off_x: float, off_y: float) -> None:
    truth = truth_of(pose_looking_down(-x, -y, 1.0), TAG)
    fix = pad_fix.PadFix(x + off_x, y + off_y, 1.1 * truth.distance_m, 0.1, np.zeros((4, 2)), True, 0.2)
    one, two = (np.array([*v, 1.0]) / np.linalg.norm([*v, 1.0]) for v in ((x, y), (x + off_x, y + off_y)))
    error = fix_error(fix, truth)
    assert np.hypot(*error[:2]) == pytest.approx(np.arcsin(np.linalg.norm(np.cross(one, two))), abs=2e-5)
    assert error[2] == pytest.approx(0.1)
    assert error[3] == pytest.approx(0.1)
    assert (error[0] > 0) == (off_x > 0) or abs(off_x) < abs(off_y) + 1e-9


def test_a_fix_half_a_side_off_is_wrong() -> None:
    truth = truth_of(pose_looking_down(height_m=2.0), TAG)
    for off_m, wrong in ((0.09, False), (0.11, True)):
        assert is_wrong(np.array([off_m / 2.0, 0.0, 0.0, 0.0]), truth, TAG) is wrong
    assert is_wrong(np.array([0.0, 0.0, -0.11, 0.0]), truth, TAG)


# -- the command -----------------------------------------------------------------------------------------------------
def run(*arguments: object) -> dict:
    app = typer.Typer()
    app.command()(pad_command.command)
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_the_command_finds_the_pad_in_pictures(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    pose = pose_looking_down(0.05, -0.08, 0.8, yaw_rad=0.3)
    image.fromarray(shot(TAG, pose)).save(tmp_path / "0.png")
    image.fromarray(np.zeros((150, 200), np.uint8)).save(tmp_path / "1.png")
    facts = run(tmp_path, "--focal", FOCAL, "--code", 3)
    assert (facts["frames"], facts["found"]) == (2, 1)
    first, second = facts["per_frame"]
    assert first["distance_m"] == pytest.approx(truth_of(pose, TAG).distance_m, rel=1e-3)
    assert second == {"frame": 1, "reason": pad_fix.TOO_DARK}
    right = run(tmp_path, "--focal", FOCAL, "--code", 3, "--image-x-deg", 90)["per_frame"][0]
    assert right["tan_right"] == pytest.approx(first["tan_forward"])
    with pytest.raises(InputError, match="--focal"):
        run(tmp_path)


def test_the_command_prints_the_target(tmp_path: Path) -> None:
    assert run("--print", tmp_path / "pad.png")["picture"].endswith("pad.png")
    assert (tmp_path / "pad.png").is_file()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--camera", "nikon"), "--camera nikon: choose from wide120, wide60, px4flow"),
        (("--heights", "low"), "--heights low: a number is needed"),
        (("--heights", "0"), "--heights 0"),
        (("--speeds", "fast"), "--speeds fast: a number is needed"),
        (("--frames", "0"), "--frames 0"),
        (("--flights", "1"), "--flights 1"),
        (("--mounting-deg", "9"), "--mounting-deg"),
        (("--tilt-deg", "60"), "--tilt-deg"),
        (("--focus", "0"), "--focus"),
    ],
)
def test_the_command_refuses_in_one_line(arguments: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        run(*arguments)
