"""The ground of a scenario: its law, what a foot and a rotor find, what does not fit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.parameter_files import check
from flownav.sensors.geometry import LEVEL, ground_height, roughness
from flownav.simulation.ground import GroundSettings, share_beyond, under_rotor

DECK = GroundSettings(step_m=-2.0, edge_north_m=1.5, edge_toward_deg=0.0).parameters()


def test_a_scenario_that_says_nothing_has_level_ground_at_the_pads_height():
    assert GroundSettings().parameters()[:5] == (0.0, 0.0, 0.0, 1.0, 0.0)
    for place in ((0.0, 0.0), (5.0, -3.0)):
        assert ground_height(*place, GroundSettings().parameters()) == 0.0


def test_a_slope_rises_towards_its_bearing():
    east = GroundSettings(slope_deg=3.0, uphill_deg=90.0).parameters()
    assert ground_height(0.0, 2.0, east) == pytest.approx(2.0 * math.tan(math.radians(3.0)))
    assert ground_height(4.0, 0.0, east) == pytest.approx(0.0, abs=1e-12)
    assert ground_height(0.0, -2.0, east) < 0.0


def test_beyond_a_decks_edge_the_ground_is_below_and_the_pad_is_on_the_deck():
    assert ground_height(1.49, 7.0, DECK) == 0.0
    assert ground_height(1.51, -7.0, DECK) == -2.0
    with pytest.raises(InputError, match="the pad lies beyond the edge"):
        check({"step_m": 0.2, "edge_north_m": -1.0, "edge_toward_deg": 0.0}, GroundSettings, "f")


def test_a_rough_surface_has_its_rms_and_its_length_and_moves_with_its_place():
    settings = GroundSettings(rough_rms_m=0.01, rough_length_m=0.4)
    ground = settings.parameters()
    generator = np.random.default_rng(1)
    places = generator.uniform(-50.0, 50.0, (20000, 2))
    heights = np.array([ground_height(n, e, ground) for n, e in places])
    assert heights.std() == pytest.approx(0.01, rel=0.03)
    assert abs(heights.mean()) < 3e-4
    near = np.array([ground_height(n + 0.02, e, ground) for n, e in places[:4000]])
    assert np.corrcoef(heights[:4000], near)[0, 1] > 0.85
    far = np.array([ground_height(n + 1.7, e + 0.9, ground) for n, e in places[:4000]])
    assert abs(np.corrcoef(heights[:4000], far)[0, 1]) < 0.6
    elsewhere = GroundSettings(rough_rms_m=0.01, rough_length_m=0.4, rough_place_m=3.3).parameters()
    moved = np.array([roughness(n, e, elsewhere) for n, e in places[:500]])
    assert np.abs(moved - heights[:500]).max() > 0.01


@pytest.mark.parametrize("beyond", [-1.2, -1.0, -0.6, -0.2, 0.0, 0.4, 0.9, 1.5])
def test_the_share_of_a_disc_beyond_an_edge_is_its_area(beyond):
    x = min(max(beyond, -1.0), 1.0)
    area = 0.5 + (x * math.sqrt(1.0 - x * x) + math.asin(x)) / math.pi
    assert share_beyond(1.5 + 0.8 * beyond, 3.0, 0.8, DECK) == pytest.approx(area, abs=0.012)


def test_half_over_the_edge_a_rotor_has_the_mean_of_both_images():
    radius, height = 0.89, 0.6
    near = height - under_rotor(0.0, 0.0, height, radius, DECK)
    far = height - under_rotor(5.0, 0.0, height, radius, DECK)
    between = height - under_rotor(1.5, 0.0, height, radius, DECK)
    assert (near, far) == pytest.approx((0.6, 2.6))
    assert between**-2 == pytest.approx(0.5 * (near**-2 + far**-2))
    assert under_rotor(1.5, 0.0, height, radius, LEVEL) == 0.0
