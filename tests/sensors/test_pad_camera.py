"""The pad camera: boresight, missed and false fixes, what it states, limits, its datasheet."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from flownav.core.errors import InputError
from flownav.core.frames import Rotation
from flownav.core.parameter_files import check
from flownav.sensors.camera_sheets import PadCameraSheet
from flownav.sensors.geometry import LensPose
from flownav.sensors.pad_camera import (
    PadCameraNormals,
    PadCameraParameters,
    PadCameraReading,
    PadCameraUnit,
    draw_pad_camera,
    reach_of,
    read_pad_camera,
)
from sensor_normals import draws, moved_by, silent

SHEET = check(
    PadCameraSheet.read().model_dump()
    | {
        "angle": {"floor_mrad": 5.0},
        "distance": {"floor_percent": 2.0},
        "min_height_m": 0.15,
        "max_height_m": 3.0,
        "half_view_deg": 60.0,
        "half_view_right_deg": 60.0,
        "side_m": 0.0,
        "ratio": 1.0,
        "boresight_deg": 0.4,
        "scale_percent": 0.5,
        "hidden_share": 0.0,
        "stated_spread": 0.3,
        "false_share": 0.001,
        "missed": {"share": 0.02, "share_at_max_height": 0.2, "share_at_blur": 0.5, "blur_rad_s": 2.0},
    },
    PadCameraSheet,
    "test",
)
P = SHEET.parameters()
PERFECT, QUIET = PadCameraUnit(0.0, 0.0, 0.0, 1.0, 0.0, 0.0), silent(PadCameraNormals)
TURN = Turn.from_euler("ZYX", [0.6, 0.1, -0.15])
ROTATION = tuple(float(x) for x in TURN.as_matrix().ravel())
LENS = np.array([0.4, -0.3, -2.0])


def pose(ned_m: np.ndarray, rotation: Rotation) -> LensPose:
    """A lens at a place from the pad's centre, NED."""
    north, east, down = map(float, ned_m)
    return LensPose(north, east, -down, rotation)


def read(
    n: PadCameraNormals = QUIET,
    unit: PadCameraUnit = PERFECT,
    lens: np.ndarray = LENS,
    rate: float = 0.0,
    p: PadCameraParameters = P,
    datasheet: PadCameraParameters | None = None,
) -> PadCameraReading:
    return read_pad_camera(unit, pose(lens, ROTATION), rate, n, p, p if datasheet is None else datasheet)


def test_a_perfect_camera_sees_where_the_pad_is() -> None:
    ahead, right, below = TURN.inv().apply(-LENS)
    reading = read()
    assert reading[:3] == pytest.approx((ahead / below, right / below, np.linalg.norm(LENS)))
    assert reading[-2:] == (255.0, 1.0)


def test_a_turned_camera_is_off_by_its_angles() -> None:
    angles = np.array([0.006, -0.009, 0.012])
    ahead, right, below = (TURN * Turn.from_rotvec(angles)).inv().apply(-LENS)
    reading = read(unit=PadCameraUnit(*angles, 1.0, 0.0, 0.0))
    assert reading[:2] == pytest.approx((ahead / below, right / below), abs=3e-4)
    assert abs(reading.tan_forward - read().tan_forward) > 0.005
    assert draw_pad_camera(PadCameraUnit(1.0, -1.0, 2.0, 1.0, 2.0, 9.0), P) == pytest.approx(
        (math.radians(0.4), -math.radians(0.4), math.radians(0.8), 1.3, 0.01, 0.0)
    )


def test_a_focal_length_believed_too_long_shows_smaller_tangents_and_longer_distances() -> None:
    right, long = read(), read(unit=PERFECT._replace(longer=0.01))
    assert long[:2] == pytest.approx((0.99 * right.tan_forward, 0.99 * right.tan_right))
    assert long.distance_m == pytest.approx(1.01 * right.distance_m)


LAW = P._replace(
    angle_floor_rad=1e-3,
    angle_per_m=5e-4,
    angle_per_rad_s=2e-3,
    distance_floor=3e-3,
    distance_per_m=4e-3,
    distance_per_rad_s=5e-3,
    boresight_rad=0.0,
    scale=0.0,
    false_above=1e3,
    missed_above=1e3,
)


@pytest.mark.parametrize(("height", "rate"), [(0.5, 0.0), (2.5, 0.0), (0.5, 1.5)])
def test_noise_grows_with_height_and_image_rate_and_is_stated_so(height: float, rate: float) -> None:
    lens = np.array([0.0, 0.0, -height])
    level = tuple(float(x) for x in np.eye(3).ravel())
    readings = np.array(
        [read_pad_camera(PERFECT, pose(lens, level), rate, n, LAW, LAW) for n in draws(PadCameraNormals, 6000, 3)]
    )
    across = math.sqrt(1e-3**2 + (5e-4 * height) ** 2 + (2e-3 * rate) ** 2)
    along = math.sqrt(3e-3**2 + (4e-3 * height) ** 2 + (5e-3 * rate) ** 2)
    np.testing.assert_allclose(readings[:, :2].std(0), across, rtol=0.04)
    assert readings[:, 2].std() == pytest.approx(along * height, rel=0.04)
    np.testing.assert_allclose(readings[:, 3:5].mean(0), across**2, rtol=0.01)
    assert readings[:, 5].mean() == pytest.approx((along * height) ** 2, rel=0.02)


def test_a_mark_far_to_the_side_looks_as_small_as_from_its_reach_above() -> None:
    assert reach_of(0.0, 0.0, 2.0) == 2.0
    assert reach_of(2.0, 0.0, 2.0) == pytest.approx(4.0)
    level = tuple(float(x) for x in np.eye(3).ravel())

    def at(north: float, height: float, p: PadCameraParameters) -> PadCameraReading:
        return read_pad_camera(PERFECT, LensPose(north, 0.0, height, level), 0.0, QUIET, p, p)

    assert [at(x, 2.0, LAW).arrived for x in (1.40, 1.42)] == [1.0, 0.0]  # (4 + 2)/2 = 3 m
    aside, above = at(1.3, 2.0, LAW), at(0.0, reach_of(1.3, 0.0, 2.0), LAW)
    assert aside.distance_variance_m2 / aside.distance_m**2 == pytest.approx(
        above.distance_variance_m2 / above.distance_m**2
    )


def test_a_larger_mark_round_it_serves_where_the_inner_does_not() -> None:
    level = tuple(float(x) for x in np.eye(3).ravel())
    nested = LAW._replace(side_m=0.25, ratio=5.0)

    def at(height: float, p: PadCameraParameters) -> PadCameraReading:
        return read_pad_camera(PERFECT, LensPose(0.0, 0.0, height, level), 0.0, QUIET, p, p)

    share = [at(h, nested).distance_variance_m2 / h**2 for h in (2.9, 3.1, 14.5)]
    assert share[1] < 0.5 * share[0] == pytest.approx(0.5 * share[2])  # of the outer at 3.1 m as of the inner at 0.62
    assert [at(h, nested).arrived for h in (0.16, 2.9, 14.9, 15.1)] == [1.0, 1.0, 1.0, 0.0]
    assert [at(h, nested._replace(ratio=1.0)).arrived for h in (2.9, 3.1)] == [1.0, 0.0]


def test_a_camera_that_is_worse_than_its_datasheet_states_the_datasheet() -> None:
    worse = P._replace(angle_floor_rad=3.0 * P.angle_floor_rad, distance_floor=2.0 * P.distance_floor)
    n = silent(PadCameraNormals, forward=1.0, distance=1.0)
    assert read(n, p=worse, datasheet=P)[3:6] == pytest.approx(read(n, p=P)[3:6], rel=0.05)
    assert abs(read(n, p=worse).tan_forward - read().tan_forward) > 2.5 * abs(read(n).tan_forward - read().tan_forward)


def test_what_is_stated_holds_the_datasheets_bias() -> None:
    still = P._replace(boresight_rad=0.0, scale=0.0)
    across, along = (np.array(read(datasheet=P)[3:6]) - np.array(read(datasheet=still)[3:6]))[[0, 2]]
    assert across == pytest.approx(read(datasheet=still).forward_variance * (P.boresight_rad / P.angle_floor_rad) ** 2)
    assert along == pytest.approx((P.scale * read().distance_m) ** 2)


def test_what_hides_the_pad_does_so_at_any_height() -> None:
    p = check(SHEET.model_dump() | {"hidden_share": 0.3}, PadCameraSheet, "hidden").parameters()
    low = np.array([0.0, 0.0, -0.3])
    there = [read(n, lens=low, p=p._replace(false_above=1e3)).arrived for n in draws(PadCameraNormals, 6000, 21)]
    assert np.mean(there) == pytest.approx(0.7 * 0.98, abs=0.02)
    assert SHEET.angle_sigma_mrad == 5.0


def test_stated_variances_are_those_of_the_readings() -> None:
    p = P._replace(missed_above=1e3, false_above=1e3, boresight_rad=0.0, scale=0.0)
    lens = np.array([1.2, -1.0, -1.0])  # far off axis
    readings = np.array([read(n, lens=lens, p=p) for n in draws(PadCameraNormals, 8000, 18)])
    np.testing.assert_allclose(readings[:, :3].var(axis=0) / readings[:, 3:6].mean(axis=0), 1.0, atol=0.08)
    wrong = read(unit=PERFECT._replace(stated=1.5))
    np.testing.assert_allclose(np.array(wrong[3:6]) / read()[3:6], 2.25)
    assert wrong[:3] == read()[:3]


def share_missed(height: float, rate: float, count: int = 6000) -> float:
    lens = np.array([0.0, 0.0, -height])
    p = P._replace(false_above=1e3)
    return 1.0 - float(
        np.mean([read(n, lens=lens, rate=rate, p=p).arrived for n in draws(PadCameraNormals, count, 19)])
    )


def test_fixes_are_missed_with_the_sheets_shares() -> None:
    assert share_missed(0.16, 0.0) == pytest.approx(0.02, abs=0.01)
    assert share_missed(2.999, 0.0) == pytest.approx(0.2, abs=0.02)
    assert share_missed(0.16, 2.0) == pytest.approx(0.5, abs=0.04)
    assert share_missed(2.999, 2.0) > 0.8
    missed = read(silent(PadCameraNormals, missed=5.0))
    assert missed[-2:] == (0.0, 0.0)


def test_false_fixes_come_anywhere_in_the_view_and_without_the_pad() -> None:
    false = silent(PadCameraNormals, false=4.0, false_forward=0.6, false_right=-0.4, missed=9.0)
    edge = math.tan(math.radians(60.0))
    reading = read(false)
    assert reading[:2] == pytest.approx((0.3 * edge, -0.2 * edge))
    assert reading.distance_m == pytest.approx(2.0 * math.hypot(1.0, 0.3 * edge, 0.2 * edge))
    assert reading[-2:] == (255.0, 1.0)
    far = np.array([50.0, 0.0, -2.0])
    assert read(lens=far)[-2:] == (0.0, 0.0)
    assert read(false, lens=far)[-1] == 1.0
    assert read(false, lens=np.array([0.0, 0.0, -3.5]))[-1] == 0.0
    assert read(false._replace(false_forward=9.0)).tan_forward == edge
    p = check(SHEET.model_dump() | {"false_share": 0.1}, PadCameraSheet, "false").parameters()
    there = [read(n, lens=far, p=p).arrived for n in draws(PadCameraNormals, 5000, 20)]
    assert np.mean(there) == pytest.approx(0.1, abs=0.02)


def test_there_are_fixes_between_the_heights_and_within_the_view() -> None:
    for height, there in ((0.14, 0.0), (0.16, 1.0), (2.99, 1.0), (3.01, 0.0)):
        assert read(lens=np.array([0.0, 0.0, -height])).arrived == there
    for name in ("half_view_forward_tangent", "half_view_right_tangent"):
        assert read(p=P._replace(**{name: 0.05})).arrived == 0.0


def test_each_normal_moves_its_own_output_alone() -> None:
    plain = P._replace(missed_above=1.0)
    moved = moved_by(PadCameraNormals, lambda n: read(n, lens=np.array([0.0, 0.0, -2.0]), p=plain)._replace(
        forward_variance=0.0, right_variance=0.0))  # fmt: skip
    assert moved["forward"] == {"tan_forward", "tan_right"}  # across a tilted sight
    assert moved["right"] == {"tan_forward", "tan_right"}
    assert moved["distance"] == {"distance_m", "distance_variance_m2"}
    assert moved["missed"] == {"quality", "arrived"}
    assert not moved["false"] | moved["false_forward"] | moved["false_right"] | moved["hidden"]
    for name, fields in moved_by(PadCameraUnit, lambda n: draw_pad_camera(n, P)).items():
        assert fields == ({name} if name != "spare" else set())


def test_what_the_datasheet_refuses() -> None:
    missed = SHEET.missed.model_dump()
    for changes, message in (
        ({"max_height_m": 0.1}, "max_height_m: more than min_height_m = 0.15 is needed"),
        ({"missed": missed | {"share_at_blur": 0.01}}, "missed.share_at_blur: at least share = 0.02 is needed"),
        (
            {"missed": missed | {"share_at_max_height": 0.01}},
            "missed.share_at_max_height: at least share = 0.02 is needed",
        ),
        ({"angle": {"floor_mrad": -1.0}}, "angle.floor_mrad: Input should be greater than or equal to 0"),
        ({"half_view_deg": 85}, "half_view_deg: Input should be less than 80"),
    ):
        with pytest.raises(InputError, match=f"^pad.toml: {message}"):
            check(SHEET.model_dump() | changes, PadCameraSheet, "pad.toml")
