"""The wide lens: where rays land and come from, how bright the image's rim is, what a wrong calibration costs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.lab.optics.camera import (
    PINHOLE_K1,
    PINHOLE_K2,
    Calibration,
    Lens,
    believed,
    field_angle_rad,
    illumination,
    image_radius_px,
    pixel_grid,
    pixels_of,
    rays_of,
    rectified,
    rectifier,
)

FISHEYE = Lens(312.0, 3.0, -2.0, -0.02, 0.002)
EQUIDISTANT = Lens(300.0, k1=0.0, k2=0.0)


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_a_ray_comes_back_from_where_it_lands(x: float, y: float) -> None:
    ray = np.array([x, y])
    np.testing.assert_allclose(rays_of(FISHEYE, pixels_of(FISHEYE, ray)), ray, atol=1e-9)


def test_radii_are_those_of_the_two_terms_and_of_opencvs_fisheye() -> None:
    angle = np.linspace(0.0, 1.2, 7)
    np.testing.assert_allclose(image_radius_px(FISHEYE, angle), 312.0 * (angle - 0.02 * angle**3 + 0.002 * angle**5))
    np.testing.assert_allclose(field_angle_rad(FISHEYE, image_radius_px(FISHEYE, angle)), angle, atol=1e-12)
    cv2 = pytest.importorskip("cv2")
    rays = np.array([[0.3, -0.2], [1.2, 0.4], [-0.1, 1.5]])
    matrix = np.array([[312.0, 0.0, 3.0], [0.0, 312.0, -2.0], [0.0, 0.0, 1.0]])
    theirs = cv2.fisheye.distortPoints(rays[:, None], matrix, np.array([-0.02, 0.002, 0.0, 0.0]))[:, 0]
    np.testing.assert_allclose(pixels_of(FISHEYE, rays), theirs, atol=1e-9)


def test_the_first_terms_of_a_pinhole_are_a_pinhole_near_the_axis() -> None:
    rays = np.array([[0.2, -0.1], [0.0, 0.3]])
    pinhole = Lens(555.0, k1=PINHOLE_K1, k2=PINHOLE_K2)
    np.testing.assert_allclose(pixels_of(pinhole, rays), 555.0 * rays, atol=0.01)


def test_a_pinholes_image_darkens_with_the_fourth_power_and_a_fisheyes_less() -> None:
    angle = np.linspace(0.01, 0.3, 6)
    np.testing.assert_allclose(illumination(Lens(555.0), angle), np.cos(angle) ** 4, rtol=4e-4)
    wide = np.array([0.5, 1.0])
    np.testing.assert_allclose(illumination(EQUIDISTANT, wide), np.cos(wide) * np.sin(wide) / wide)
    assert illumination(FISHEYE, 0.0) == pytest.approx(1.0)


def test_brightness_times_area_is_the_solid_angle_through_the_pupil() -> None:
    """The light of the whole image of an even scene is the integral of cos over the solid angle, whatever the lens."""
    angle = np.linspace(1e-4, 1.1, 4001)
    for lens in (FISHEYE, EQUIDISTANT, Lens(500.0)):
        radius = image_radius_px(lens, angle) / lens.focal_px
        light = np.trapezoid(illumination(lens, angle) * 2.0 * np.pi * radius, radius)
        assert light == pytest.approx(np.pi * np.sin(1.1) ** 2, rel=1e-4)


@pytest.mark.parametrize(
    ("normals", "shift"),
    [
        ((1.0, 0.0, 0.0, 0.0, 0.0), (-0.003 * 0.5, 0.0)),  # too long a focal length shows smaller tangents
        ((0.0, 1.0, 0.0, 0.0, 0.0), (-1.0 / 312.0, 0.0)),
        ((0.0, 0.0, 1.0, 0.0, 0.0), (0.0, -1.0 / 312.0)),
    ],
)
def test_a_wrong_calibration_moves_what_is_seen(normals: tuple[float, ...], shift: tuple[float, float]) -> None:
    lens = Lens(312.0, k1=PINHOLE_K1, k2=PINHOLE_K2)
    ray = np.array([0.5 if normals[0] else 0.0, 0.0])
    seen = rays_of(believed(lens, Calibration(), normals), pixels_of(lens, ray))
    np.testing.assert_allclose(seen - ray, shift, rtol=0.03, atol=1e-6)


def test_a_rectified_frame_is_a_pinholes() -> None:
    """A straight line on the ground is straight again, and as far from the middle as a pinhole would have it."""
    rays = rays_of(FISHEYE, pixel_grid(480, 640))
    frame = np.where(np.abs(rays[..., 0] - 0.8) < 0.05, 220, 30).astype(np.uint8)
    by = rectifier(FISHEYE, 480, 640)
    straight = rectified(frame, by)
    rows = np.flatnonzero((straight > 120).any(1))
    assert len(rows) > 500
    middle = 0.5 * (straight.shape[1] - 1)
    line = np.array([np.flatnonzero(straight[row] > 120).mean() - middle for row in rows])
    np.testing.assert_allclose(line / by.focal_px, 0.8, atol=0.004)
    column = np.flatnonzero(frame[10] > 120).mean() - np.flatnonzero(frame[240] > 120).mean()
    assert abs(column) > 10.0  # which the lens had bent
