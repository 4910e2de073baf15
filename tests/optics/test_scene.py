"""Shadows, covers and glare on the pad, each where optics puts it."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.lab.optics.projection import pose_looking_down
from flownav.lab.optics.scene import (
    SHADOW,
    SUN_RAD,
    Cover,
    Gloss,
    Scene,
    Shadow,
    clear,
    covered,
    drawn_scene,
    in_shadow_of_vehicle,
    lit,
    mirrored,
    penumbra_m,
    shadow_of_vehicle,
)

BAND = Shadow(0.1, 0.0, 0.0, 1.0, 0.05, 1e3, 0.02, 0.7)  # along y, about x = 0.1


def test_a_shadow_is_dark_within_and_its_edge_as_wide_as_the_suns_image() -> None:
    assert lit(BAND, 0.1, 3.0) == pytest.approx(0.3)
    assert lit(BAND, 0.1 + 0.05, -2.0) == pytest.approx(1.0 - 0.7 / 2)  # half the sun at the edge
    assert lit(BAND, 0.1 - 0.0601, 0.0) == 1.0
    assert lit(BAND, 0.1 - 0.0399, 0.0) == pytest.approx(0.3)
    assert penumbra_m(2.0) == pytest.approx(2.0 * SUN_RAD) == pytest.approx(0.0186)
    sharp = np.array([lit(BAND._replace(penumbra_m=penumbra_m(0.5)), x, 0.0) for x in np.linspace(0.12, 0.18, 6001)])
    edge = (sharp > 0.301) & (sharp < 0.999)
    assert edge.sum() * 1e-5 == pytest.approx(0.5 * SUN_RAD, rel=0.01)


def test_a_shadow_ends_where_what_throws_it_ends() -> None:
    short = BAND._replace(half_length_m=0.3)
    assert lit(short, 0.1, 0.28) == pytest.approx(0.3)
    assert lit(short, 0.1, 0.3) == pytest.approx(0.65)
    assert lit(short, 0.1, -0.32) == 1.0


@pytest.mark.parametrize("high_deg", [30.0, 60.0])
def test_the_vehicles_shadow_falls_away_from_the_sun_by_height_over_the_tangent_of_its_elevation(
    high_deg: float,
) -> None:
    high = np.radians(high_deg)
    north = Gloss(np.cos(high), 0.0, -np.sin(high), 0.1, 1.0, 0.0)
    pose = pose_looking_down(0.2, -0.1, 1.5, yaw_rad=0.5)
    shadow = shadow_of_vehicle(pose, north)
    assert (shadow.x_m, shadow.y_m) == pytest.approx((0.2 - 1.5 / np.tan(high), -0.1))
    assert shadow.penumbra_m == pytest.approx(SUN_RAD * 1.5 / np.sin(high))
    assert (shadow.along_x, shadow.along_y) == pytest.approx((np.cos(0.5), np.sin(0.5)))
    scene = Scene(np.zeros((0, SHADOW)), np.zeros((0, 4)), north)
    assert len(in_shadow_of_vehicle(scene, pose).shadows) == 1
    assert not len(in_shadow_of_vehicle(clear(), pose).shadows)


def test_a_cover_hides_its_disc() -> None:
    leaf = Cover(0.2, -0.1, 0.03, 0.2)
    assert covered(leaf, 0.2, -0.071)
    assert not covered(leaf, 0.2, -0.069)


@pytest.mark.parametrize("high_deg", [20.0, 45.0, 90.0])
def test_glare_is_where_the_mirrored_ray_meets_the_sun(high_deg: float) -> None:
    high = np.radians(high_deg)
    sun = Gloss(np.cos(high), 0.0, -np.sin(high), np.radians(5.0), 2.0, 0.0)
    towards = np.cos(high), 0.0, np.sin(high)  # a ray down that the ground throws back up to the sun
    assert mirrored(sun, *towards) == pytest.approx(2.0)
    assert mirrored(sun, *(3.0 * np.array(towards))) == pytest.approx(2.0)
    turned = np.cos(high - 0.0873), 0.0, np.sin(high - 0.0873)
    assert mirrored(sun, *turned) == pytest.approx(2.0 * np.exp(-0.5), rel=0.01)
    assert mirrored(sun, -0.9, 0.3, 0.1) < 2.0


def test_scenes_repeat_and_the_sun_alone_throws_shadows() -> None:
    clouded = [drawn_scene(np.random.default_rng(k), 0.2, sunny=False) for k in range(40)]
    sunny = [drawn_scene(np.random.default_rng(k), 0.2, sunny=True) for k in range(40)]
    assert not any(len(scene.shadows) or scene.gloss.strength for scene in clouded)
    assert 1 <= sum(len(scene.shadows) for scene in sunny) <= 12
    assert all(scene.gloss.strength > 0.0 and scene.gloss.sun_z < 0.0 for scene in sunny)
    assert 1 <= sum(len(scene.covers) > 0 for scene in clouded) <= 10
    again = drawn_scene(np.random.default_rng(7), 0.2, sunny=True)
    np.testing.assert_array_equal(again.shadows, sunny[7].shadows)
    assert not len(clear().covers)
