"""Invariances of cameras and of poses found in their images: scale, quarter-turns and the way back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.lab.optics.camera import Lens, field_angle_rad, illumination, image_radius_px, pixels_of, rays_of
from flownav.lab.optics.projection import (
    FlightMotion,
    ground_point,
    homography,
    image_point,
    mapped,
    moved,
    part_time_s,
    plane_pose,
    pose_looking_down,
    row_time_s,
)
from optical_oracles import CameraMotion, motion_field

SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
WIDE = Lens(300.0, 2.0, -1.5, 0.05, 0.01)


def seen(rotation: np.ndarray, place: np.ndarray, size: float = 1.0) -> np.ndarray:
    points = size * SQUARE @ rotation[:, :2].T + size * place
    return points[:, :2] / points[:, 2:]


def tilt(about_x: float, about_y: float, about_z: float) -> np.ndarray:
    found = np.eye(3)
    for axis, angle in ((0, about_x), (1, about_y), (2, about_z)):
        c, s = math.cos(angle), math.sin(angle)
        turn = np.eye(3)
        one, two = (axis + 1) % 3, (axis + 2) % 3
        turn[one, one], turn[one, two], turn[two, one], turn[two, two] = c, -s, s, c
        found = turn @ found
    return found


@pytest.mark.parametrize("angles", [(0.3, -0.2, 0.5), (-0.1, 0.4, -2.0), (0.2, 0.2, 0.0)])
def test_a_figure_is_found_where_it_stands_in_a_turned_image_and_in_a_larger_world(angles):
    rotation, place = tilt(*angles), np.array([0.3, -0.2, 3.0])
    found = plane_pose(SQUARE, seen(rotation, place))
    assert found is not None
    np.testing.assert_allclose(found.rotation, rotation, atol=1e-6)
    np.testing.assert_allclose(found.place_m, place, atol=1e-6)
    large = plane_pose(7.0 * SQUARE, seen(rotation, place, 7.0))
    assert large is not None
    np.testing.assert_allclose(large.place_m, 7.0 * place, rtol=1e-6)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = plane_pose(SQUARE, seen(rotation, place) @ quarter[:2, :2].T)
    assert turned is not None
    np.testing.assert_allclose(turned.rotation, quarter @ rotation, atol=1e-6)
    np.testing.assert_allclose(turned.place_m, quarter @ place, atol=1e-6)


def test_a_projective_map_and_the_one_back_are_none():
    image = seen(tilt(0.3, 0.1, 0.2), np.array([0.1, 0.2, 2.0]))
    there, back = homography(SQUARE, image), homography(image, SQUARE)
    assert there is not None
    assert back is not None
    np.testing.assert_allclose(mapped(there, SQUARE), image, atol=1e-12)
    np.testing.assert_allclose(mapped(back, mapped(there, np.array([[0.1, 0.7]]))), [[0.1, 0.7]], atol=1e-9)


def test_a_wide_lens_and_the_way_back_are_none_whatever_its_scale():
    angles = np.linspace(0.0, 1.3, 40)
    np.testing.assert_allclose(field_angle_rad(WIDE, image_radius_px(WIDE, angles)), angles, atol=1e-9)
    rays = np.random.default_rng(1).normal(size=(50, 2))
    np.testing.assert_allclose(rays_of(WIDE, pixels_of(WIDE, rays)), rays, rtol=1e-6)
    middle = np.array([WIDE.centre_x_px, WIDE.centre_y_px])
    larger = WIDE._replace(focal_px=900.0)
    np.testing.assert_allclose(pixels_of(larger, rays) - middle, 3.0 * (pixels_of(WIDE, rays) - middle))
    turned = rays[:, [1, 0]] * [-1.0, 1.0]
    straight = pixels_of(WIDE, rays) - middle
    np.testing.assert_allclose(pixels_of(WIDE, turned) - middle, straight[:, [1, 0]] * [-1.0, 1.0], atol=1e-9)
    assert illumination(WIDE, 0.0) == pytest.approx(1.0)
    assert np.all(np.diff(illumination(WIDE, angles)) < 0.0)


@pytest.mark.parametrize("point", [(0.3, -0.2), (0.0, 0.0), (-0.6, 0.4)])
def test_a_camera_that_moves_sees_what_the_motion_field_says(point):
    """The image of a ground point under `moved`, by differences, in any attitude and motion."""
    pose = pose_looking_down(0.1, -0.2, 2.0, roll_rad=0.1, pitch_rad=-0.15, yaw_rad=0.7)
    motion = FlightMotion(0.4, -0.3, 0.2, 0.1, -0.25, 0.3)
    step_s, focal = 1e-6, 400.0
    before, after = (image_point(moved(pose, motion, sign * step_s), *point, focal) for sign in (-1.0, 1.0))
    speed = np.subtract(after, before) / (2.0 * step_s)
    rotation = np.reshape(pose[3:], (3, 3))
    own = rotation.T @ [0.4, -0.3, 0.2]
    x, y = image_point(pose, *point, focal)
    depth = ground_point(pose, x, y, focal)[2]
    assert speed == pytest.approx(motion_field(CameraMotion(*own, 0.1, -0.25, 0.3), depth, x, y, focal), rel=1e-5)
    assert ground_point(pose, x, y, focal)[:2] == pytest.approx(point)
    assert moved(pose, motion, 0.0) == pose


def test_rows_and_parts_lie_evenly_about_the_frame_s_instant():
    assert sum(row_time_s(float(k), 480, 0.02) for k in range(480)) == pytest.approx(0.0, abs=1e-12)
    assert row_time_s(479.0, 480, 0.02) - row_time_s(0.0, 480, 0.02) == pytest.approx(0.02 * 479 / 480)
    assert row_time_s(100.0, 480, 0.0) == 0.0
    assert sum(part_time_s(k, 5, 0.01) for k in range(5)) == pytest.approx(0.0, abs=1e-12)
    assert part_time_s(4, 5, 0.01) == pytest.approx(0.004)
