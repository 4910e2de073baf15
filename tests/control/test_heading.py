"""The heading that is held: north in a light wind, the nose into one that pushes, and the shorter way back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.control.gains import AutopilotGains
from flownav.control.heading import PUSHES_M_S2, TURN_RAD_S2, Facing, faced, heading_error
from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion

GAINS = AutopilotGains(into_wind_rad_s=0.17)
NORTH = Facing(1.0, 0.0, 0.0, 0.0, 0.0)
DT_S = 0.02


def flown(push_m_s2, from_deg, seconds, gains=GAINS, noise=0.0):
    """Headings that are held [rad], (n,), in a wind that pushes so hard from there, the vehicle following at once."""
    rng, facing, headings = np.random.default_rng(4), NORTH, []
    for _ in range(round(seconds / DT_S)):
        heading = math.atan2(facing.heading_east, facing.heading_north)
        towards = math.radians(from_deg) + math.pi - heading
        forward, right = push_m_s2 * math.cos(towards), push_m_s2 * math.sin(towards)
        facing = faced(facing, forward + noise * rng.normal(), right + noise * rng.normal(), True, gains, DT_S)
        headings.append(math.atan2(facing.heading_east, facing.heading_north))
    return np.array(headings), facing


@pytest.mark.parametrize("from_deg", [0.0, 90.0, 180.0, 270.0])
def test_a_wind_that_hardly_pushes_leaves_the_heading_north(from_deg):
    headings, facing = flown(0.9 * PUSHES_M_S2, from_deg, 30.0)
    assert (headings == 0.0).all()
    assert facing.heading_north == 1.0


@pytest.mark.parametrize("from_deg", [-150.0, -90.0, -40.0, 30.0, 120.0, 179.0, 181.0])
def test_the_nose_goes_into_a_wind_until_it_no_longer_pushes_from_the_side(from_deg):
    headings, facing = flown(1.0, from_deg, 60.0, noise=1.0)
    off = math.remainder(headings[-1] - math.radians(from_deg), 2.0 * math.pi)
    assert abs(math.sin(off)) < 1.1 * PUSHES_M_S2
    assert math.cos(off) > 0.0
    rates = np.diff(np.unwrap(headings)) / DT_S
    assert np.abs(rates).max() < 1.01 * GAINS.into_wind_rad_s
    assert np.abs(np.diff(rates)).max() < 1.1 * TURN_RAD_S2 * DT_S
    assert facing.heading_north**2 + facing.heading_east**2 == pytest.approx(1.0, abs=1e-9)
    turned = np.abs(np.unwrap(headings)[-1])
    assert turned < math.radians(181.0)  # the shorter way, and no second time round


def test_it_holds_north_where_it_may_not_turn_and_on_its_skids():
    headings, _ = flown(2.0, 120.0, 20.0, AutopilotGains())
    assert (headings == 0.0).all()
    turning = Facing(0.8, 0.6, 0.1, 0.5, 0.5)
    rests = faced(turning, 1.0, 1.0, False, GAINS, DT_S)
    assert rests[2:] == (0.0, 0.0, 0.0)


def test_the_error_of_the_heading_is_a_sine_and_never_less_beyond_a_right_angle():
    for held, heading in ((0.4, 0.1), (-0.2, 0.5), (2.0, 1.5), (3.1, -3.1)):
        rotation = rotation_from_quaternion(*quaternion_from_euler(0.1, -0.05, heading))
        assert heading_error(rotation, math.cos(held), math.sin(held)) == pytest.approx(math.sin(held - heading))
    about = rotation_from_quaternion(*quaternion_from_euler(0.0, 0.0, 2.5))
    assert heading_error(about, 1.0, 0.0) == -1.0
    assert heading_error(about, math.cos(-1.5), math.sin(-1.5)) == 1.0
