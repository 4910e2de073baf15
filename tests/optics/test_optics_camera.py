"""The camera: lens facts of section 4.1, blur, exposure, the motion field, frames of pads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import j1

from flownav.core.errors import InputError
from flownav.lab.optics.camera import (
    Camera,
    box_transfer,
    defocus_px,
    disc_transfer,
    effective_focal_px,
    exposed,
    gauss_transfer,
    light_named,
    refocused,
)
from flownav.lab.optics.pad import BLACK, WHITE, Pad, checker, pad_named, stripes, texture
from flownav.lab.optics.projection import ground_point, image_point, pose_looking_down
from flownav.lab.optics.render import film, seen, stripe_harmonics, stripe_row
from optical_oracles import CameraMotion, motion_field

SMALL = st.floats(-0.3, 0.3)
SPEED = st.floats(-2.0, 2.0)
PIXEL = st.floats(-32.0, 32.0)
FOCAL = 666.67


# -- the lens --------------------------------------------------------------------------------------------------
def test_refocusing_enlarges_the_image_as_in_the_table() -> None:
    gains = [effective_focal_px(Camera(focus_m=h)) / Camera().nominal_focal_px for h in (0.6, 0.8, 1.0, 1.5, 3.0)]
    np.testing.assert_allclose(gains, [1.027, 1.020, 1.016, 1.011, 1.005], atol=5e-4)


def test_defocus_grows_as_in_the_table() -> None:
    blur = [defocus_px(Camera(), h) for h in (0.6, 0.8, 1.0, 1.5, 3.0)]
    np.testing.assert_allclose(blur, [0.0, 2.2, 3.6, 5.3, 7.1], atol=0.3)


def test_refocusing_halfway_halves_the_blur() -> None:
    whole, half = defocus_px(Camera(), 1.5), defocus_px(refocused(Camera(), 1.5, 0.5), 1.5)
    assert half == pytest.approx(0.5 * whole, rel=0.02)
    assert defocus_px(refocused(Camera(), 1.5, 1.0), 1.5) == pytest.approx(0.0, abs=1e-12)


def test_a_blurs_transfer_is_the_mean_of_the_pattern_over_it() -> None:
    place = np.linspace(-20.0, 20.0, 40_001)
    normal = np.exp(-0.5 * (place / 1.3) ** 2)
    box = (np.abs(place) <= 1.25).astype(float)
    for frequency in (0.0, 0.05, 0.2, 0.45):
        pattern = np.cos(2.0 * np.pi * frequency * place)
        assert gauss_transfer(frequency, 1.3) == pytest.approx(np.average(pattern, weights=normal), abs=1e-9)
        assert box_transfer(frequency, 2.5) == pytest.approx(np.average(pattern, weights=box), abs=1e-3)


def test_the_transfer_of_a_blur_disc_is_the_bessel_function() -> None:
    frequency = np.linspace(0.01, 2.0, 50)
    x = np.pi * 5.5 * frequency
    np.testing.assert_allclose(disc_transfer(frequency, 5.5), 2.0 * j1(x) / x, atol=1e-12)
    assert disc_transfer(0.2, 0.0) == pytest.approx(1.0)


def test_exposure_follows_the_light_as_far_as_it_can() -> None:
    low, normal, intense = (exposed(Camera(), light_named(name)) for name in ("low", "normal", "intense"))
    assert intense.time_s < normal.time_s < low.time_s
    assert normal.white_grey == intense.white_grey == pytest.approx(180.0)
    assert low.white_grey < normal.white_grey
    assert low.read_noise_grey > normal.read_noise_grey
    with pytest.raises(InputError, match="light"):
        light_named("dusk")


# -- the motion field --------------------------------------------------------------------------------------------
@settings(max_examples=200)
@given(SMALL, SMALL, st.floats(-3.0, 3.0), st.floats(0.3, 5.0), *(SPEED,) * 6, PIXEL, PIXEL)
def test_the_motion_field_is_the_derivative_of_the_projection(  # type: ignore[no-untyped-def]
    roll, pitch, yaw, height, vx, vy, vz, wx, wy, wz, x, y
) -> None:
    """A ground point is held fixed while the camera moves for a short time, forth and back."""
    pose = pose_looking_down(0.2, -0.1, height, roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw)
    point_x, point_y, depth = ground_point(pose, x, y, FOCAL)
    turn = np.array([pose[3:6], pose[6:9], pose[9:12]])
    spin = np.array([[0.0, -wz, wy], [wz, 0.0, -wx], [-wy, wx, 0.0]])

    def moved(dt: float) -> np.ndarray:
        place = np.array([pose.x_m, pose.y_m, -pose.height_m]) + turn @ np.array([vx, vy, vz]) * dt
        later = turn @ (np.eye(3) + spin * dt + 0.5 * spin @ spin * dt**2)
        then = type(pose)(place[0], place[1], -place[2], *later.ravel())
        return np.array(image_point(then, point_x, point_y, FOCAL))

    dt = 1e-5
    expected = (moved(dt) - moved(-dt)) / (2.0 * dt)
    speed = motion_field(CameraMotion(vx, vy, vz, wx, wy, wz), depth, x, y, FOCAL)
    np.testing.assert_allclose(speed, expected, rtol=1e-5, atol=1e-2)


@given(SMALL, SMALL, st.floats(-3.0, 3.0), st.floats(0.3, 5.0), PIXEL, PIXEL)
def test_projecting_a_ground_point_returns_its_pixel(
    roll: float, pitch: float, yaw: float, height: float, x: float, y: float
) -> None:
    pose = pose_looking_down(0.2, -0.1, height, roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw)
    east, north, _ = ground_point(pose, x, y, FOCAL)
    assert image_point(pose, east, north, FOCAL) == pytest.approx((x, y), abs=1e-9)


# -- pads and frames ----------------------------------------------------------------------------------------------
def test_the_papers_pad_has_seven_millimetre_gaps() -> None:
    pad = stripes()
    assert pad.stripe_pitch_m == pytest.approx(0.014)
    row = pad.reflectance[0]
    assert len(row) * pad.texel_m == pytest.approx(0.014)
    assert (row == np.float32(WHITE)).sum() == (row == np.float32(BLACK)).sum() == len(row) // 2
    assert pad_named("stripes-3.5").stripe_pitch_m == pytest.approx(0.007)


@pytest.mark.parametrize("pad", [texture(3), checker(3)], ids=["texture", "checker"])
def test_pads_in_two_dimensions_have_contrast_along_both_axes_and_no_seam(pad: Pad) -> None:
    assert 0.0 <= pad.reflectance.min() < pad.reflectance.max() <= 1.0
    for axis in (0, 1):
        steps = np.abs(np.diff(pad.reflectance, axis=axis)).mean()
        seam = np.abs(pad.reflectance.take(0, axis) - pad.reflectance.take(-1, axis)).mean()
        assert steps > 0.003
        assert seam < 12.0 * steps or pad.name == "checker"


@pytest.mark.parametrize("text", ["grass", "stripes-x", "stripes-0.1", "nowhere.png:0.5", "pad.png:wide", "pad.png:0"])
def test_an_unknown_pad_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"pad|no such file"):
        pad_named(text)


def test_a_users_picture_becomes_a_pad(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    picture = (np.indices((40, 80)).sum(axis=0) % 16 * 16).astype(np.uint8)
    image.fromarray(picture).save(tmp_path / "pad.png")
    pad = pad_named(f"{tmp_path / 'pad.png'}:0.4")
    assert pad.texel_m == pytest.approx(0.005)
    np.testing.assert_allclose(pad.reflectance * 255.0, picture, atol=1e-4)


@pytest.mark.parametrize("height", [0.6, 1.0, 1.5])
@pytest.mark.parametrize("pitch", [0.0, 0.1])
def test_stripes_in_closed_form_equal_the_raster_under_the_same_blur(height: float, pitch: float) -> None:
    pad, camera = stripes(), refocused(Camera(), height, 0.5)
    pose = pose_looking_down(0.0123, 0.0, height, pitch_rad=pitch)
    row = np.empty(64)
    harmonics = stripe_harmonics(pad.stripe_pitch_m, camera, height)
    stripe_row(pose, True, effective_focal_px(camera), pad.stripe_pitch_m, harmonics, 0.0, row)
    level = pose_looking_down(0.0, 0.0, height)
    raster = seen(pad, camera, level)[0]
    places = [ground_point(pose, n - 31.5, 0.0, effective_focal_px(camera))[0] for n in range(64)]
    texels = (np.arange(len(raster)) + 0.5) * pad.texel_m
    expected = np.interp(np.mod(places, 0.014), texels, raster, period=0.014)
    np.testing.assert_allclose(row, expected, atol=0.012)


def test_blur_keeps_the_mean_and_takes_the_contrast() -> None:
    pad = texture(2)
    sharp = seen(pad, Camera(focus_m=1.5), pose_looking_down(height_m=1.5))
    blurred = seen(pad, Camera(focus_m=0.6), pose_looking_down(height_m=1.5))
    assert sharp.mean() == pytest.approx(pad.reflectance.mean(), abs=1e-4)
    assert blurred.mean() == pytest.approx(pad.reflectance.mean(), abs=1e-4)
    assert blurred.std() < sharp.std() < pad.reflectance.std()


def test_a_moving_camera_smears_the_image_along_its_way() -> None:
    start, end = pose_looking_down(0.0, 0.0, 0.6), pose_looking_down(0.003, 0.0, 0.6)
    still = film(texture(2), [start])[0].astype(float)
    moving = film(texture(2), [start], closing_poses=[end])[0].astype(float)
    assert np.abs(np.diff(moving, axis=1)).mean() < 0.9 * np.abs(np.diff(still, axis=1)).mean()
    assert np.abs(np.diff(moving, axis=0)).mean() > 0.9 * np.abs(np.diff(still, axis=0)).mean()


def test_noise_has_the_size_that_the_exposure_says() -> None:
    blank = Pad("blank", np.full((4, 4), 0.5, np.float32), 0.01)
    frames = film(blank, [pose_looking_down(height_m=1.0)] * 20, seed=4).astype(float)
    exposure = exposed(Camera(), 1.0)
    sigma = np.sqrt(exposure.read_noise_grey**2 + exposure.photon_noise_grey * frames.mean() + 1.0 / 12.0)
    assert frames.mean() == pytest.approx(0.5 * exposure.white_grey, abs=0.1)
    assert frames.std() == pytest.approx(sigma, rel=0.03)
    assert abs(np.corrcoef(frames[0].ravel(), frames[1].ravel())[0, 1]) < 0.06


def test_frames_are_the_same_for_the_same_seed_and_differ_for_another() -> None:
    poses = [pose_looking_down(0.01 * k, 0.0, 0.8) for k in range(3)]
    first, again, other = (film(texture(2), poses, seed=seed) for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()


def test_a_camera_that_does_not_look_down_is_refused() -> None:
    with pytest.raises(InputError, match="look down"):
        film(stripes(), [pose_looking_down(height_m=1.0, pitch_rad=1.5)])
    with pytest.raises(InputError, match="closing"):
        film(stripes(), [pose_looking_down()], closing_poses=[])
