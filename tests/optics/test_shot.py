"""Frames as a real camera takes them: blur, shear, vignetting, light and noise measured in the frames themselves."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.lab.optics.camera import Camera, Exposure, Lens, illumination, pixel_grid, rays_of
from flownav.lab.optics.pad import PadTarget
from flownav.lab.optics.pad_fix import find_pad, fix_error, truth_of
from flownav.lab.optics.projection import FlightMotion, pose_looking_down
from flownav.lab.optics.scene import Gloss, Scene, Shadow, clear
from flownav.lab.optics.shot import Ground, Optic, Shot, blur_width_px, shoot, view_of

TAG = PadTarget(0.2)
PLAIN = Ground(np.full((64, 64), 0.35, np.float32), 0.01)
SHARP = Camera(320, 240, 6e-6, 156.0 * 6e-6, 2.8, 1.0, psf_px=0.3)
OPTIC = Optic(SHARP, Lens(156.0, k1=1.0 / 3.0, k2=2.0 / 15.0), 0.0)
STILL = FlightMotion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
QUIET = Exposure(0.004, 1.0, 200.0, 0.0, 0.0)


def shot(optic=OPTIC, pose=None, motion=STILL, exposure=QUIET, scene=None, target=TAG):  # type: ignore[no-untyped-def]
    pose = pose or pose_looking_down(height_m=0.6)
    taken = Shot(target, optic, view_of(optic), exposure, 1)
    return shoot(taken, PLAIN, scene or clear(), pose, motion, 0).astype(float)


def left_edge(row: np.ndarray) -> tuple[float, float]:
    """Place [px] and width (a box's) of the first rise from the tag's black ring to its white border, from the left."""
    rise = np.abs(np.diff(row[89:106]))
    rise[rise < 3.0] = 0.0  # the lens's own falling off towards the rim
    place = np.arange(len(rise)) + 89.5
    mean = float(rise @ place / rise.sum())
    return mean, float(np.sqrt(12.0 * (rise @ (place - mean) ** 2) / rise.sum()))


# at 0.25 m a cell is 15.6 px and the black square reaches 62.4 px either way of column 159.5: from column 97.1
LOW = pose_looking_down(height_m=0.25)


@pytest.mark.parametrize("motion", [STILL._replace(velocity_x_m_s=0.7), STILL._replace(rate_y_rad_s=-2.8)])
def test_motion_blur_is_as_wide_as_rate_times_exposure_times_focal_length(motion: FlightMotion) -> None:
    long = QUIET._replace(time_s=0.01)
    wanted = 2.8 * 0.01 * 156.0
    assert blur_width_px(OPTIC, LOW, motion, 0.01) == pytest.approx(wanted)
    off_axis = 62.4 / 156.0
    wanted *= 1.0 + off_axis**2 if motion.rate_y_rad_s else 1.0  # a turn moves what is off the axis more
    still, blurred = left_edge(shot(pose=LOW)[120])[1], left_edge(shot(pose=LOW, motion=motion, exposure=long)[120])[1]
    assert np.sqrt(blurred**2 - still**2) == pytest.approx(wanted, rel=0.08)


@pytest.mark.parametrize("readout_s", [0.01, 0.02])
def test_a_rolling_shutter_shears_the_pad_by_rate_times_readout_times_focal_length(readout_s: float) -> None:
    rolling, short = OPTIC._replace(readout_s=readout_s), QUIET._replace(time_s=1e-4)
    frame = shot(rolling, LOW, STILL._replace(velocity_x_m_s=0.3), short)
    top, bottom = (np.mean([left_edge(frame[row])[0] for row in rows]) for rows in ((79, 80, 81), (159, 160, 161)))
    assert bottom - top == pytest.approx(-0.3 / 0.25 * readout_s * 156.0 * 80 / 240, abs=0.06)
    still = shot(rolling, LOW, exposure=short)
    assert left_edge(still[80])[0] == pytest.approx(left_edge(still[160])[0], abs=0.02)


def test_the_rim_is_darker_as_the_lens_has_it() -> None:
    frame = shot()
    angle = np.arctan(np.hypot(*np.moveaxis(rays_of(OPTIC.lens, pixel_grid(240, 320)), -1, 0)))
    ground = angle > 0.5
    np.testing.assert_allclose(frame[ground], 200.0 * 0.35 * illumination(OPTIC.lens, angle[ground]), atol=1.0)


def test_defocus_softens_an_edge() -> None:
    far = OPTIC._replace(camera=SHARP._replace(f_number=0.12, focus_m=5.0))
    disc = 0.936e-3 / 0.12 * 0.936e-3 * abs(1.0 / 5.0 - 1.0 / 0.25) / 6e-6
    sharp, soft = left_edge(shot(pose=LOW)[120])[1], left_edge(shot(far, LOW)[120])[1]
    # the edge of a disc of diameter D has the variance D^2/16, that of a box of width w has w^2/12
    assert np.sqrt((soft**2 - sharp**2) / 12.0 * 16.0) == pytest.approx(disc, rel=0.08)


def test_noise_is_that_of_the_exposure() -> None:
    noisy = shot(exposure=Exposure(0.004, 1.0, 200.0, 3.0, 0.1)) - shot()
    middle = np.s_[200:235, 140:180]
    level = shot()[middle].mean()
    assert noisy[middle].std() == pytest.approx(np.sqrt(9.0 + 0.1 * level), rel=0.06)


def test_shadow_cover_and_glare_change_the_pad_where_they_are() -> None:
    plain = shot()
    shadow = Scene(np.array([Shadow(0.0, -0.1, 1.0, 0.0, 0.05, 1e3, 0.002, 0.5)]), np.zeros((0, 4)), clear().gloss)
    shaded = shot(scene=shadow)
    band = np.round(120.0 - 0.5 + 156.0 * -0.1 / 0.6).astype(int)  # y right of the image is down the rows
    np.testing.assert_allclose(shaded[band, 100:220], 0.5 * plain[band, 100:220], atol=2.0)
    np.testing.assert_allclose(shaded[160], plain[160])
    covered = shot(scene=clear()._replace(covers=np.array([[0.0, 0.0, 0.02, 0.6]])))
    assert covered[119, 159] == pytest.approx(120.0, abs=2.0)
    shine = Gloss(0.0, 0.0, -1.0, np.radians(3.0), 0.5, 0.0)
    shining = shot(scene=clear()._replace(gloss=shine)) - plain
    assert shining[119:121, 159:161].max() > 70.0
    assert shining[:60].max() == 0.0  # the ground does not shine
    veiled = shot(scene=clear(0.1)) - plain
    assert np.median(veiled) == pytest.approx(20.0, abs=1.0)


def test_a_frame_of_a_still_sharp_camera_gives_the_pose_that_it_was_taken_from() -> None:
    pose = pose_looking_down(0.05, -0.04, 0.5, roll_rad=0.08, pitch_rad=-0.06, yaw_rad=0.6)
    frame = shot(Optic(SHARP, Lens(156.0), 0.0), pose).astype(np.uint8)
    fix, reason = find_pad(frame, TAG, 156.0)
    assert fix is not None, reason
    error = fix_error(fix, truth_of(pose, TAG))
    assert np.hypot(error[0], error[1]) < 0.06 / 156.0
    assert abs(error[2]) < 4e-3
