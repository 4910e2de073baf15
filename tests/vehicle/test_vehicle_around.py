"""Ground that is no plane at down = 0, and air that turns: what the vehicle's equations make of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.frames import rotation_from_quaternion
from flownav.vehicle import helicopter, multirotor
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.skids import support
from flownav.vehicle.state import CALM, Controls, below_plane, in_wind, plane_normal
from flownav.vehicle.trim import parked, trim, trim_multirotor

VEHICLE = load_vehicle()
HOVER = trim(VEHICLE)
WEIGHT = VEHICLE.mass_kg * VEHICLE.gravity_m_s2
IDLE = Controls(0.0, 0.0, 0.0, HOVER.pedal_rad)
LEVEL = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def sloping(degrees, uphill_deg=0.0):
    rise, uphill = math.tan(math.radians(degrees)), math.radians(uphill_deg)
    north, east = rise * math.cos(uphill), rise * math.sin(uphill)
    return CALM._replace(slope_n=north, slope_e=east, cosine=1.0 / math.sqrt(1.0 + rise * rise))


def settled(around, seconds=3.0, controls=IDLE, **changes):
    state = parked(VEHICLE, controls)._replace(**changes)
    for _ in range(round(seconds / 0.002)):
        state = helicopter.step(state, controls, around, 0.002, VEHICLE)
    return state


def tilt_of(state):
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    return math.degrees(math.atan2(rotation[7], rotation[8])), math.degrees(-math.asin(rotation[6]))


def test_the_planes_normal_and_depth_are_those_of_level_ground_without_a_slope():
    assert plane_normal(LEVEL, CALM) == (0.0, 0.0, 1.0)
    assert below_plane(3.0, -2.0, -1.5, CALM) == -1.5
    hill = sloping(10.0)
    assert np.linalg.norm(plane_normal(LEVEL, hill)) == pytest.approx(1.0)
    assert below_plane(1.0, 5.0, 0.0, hill) == pytest.approx(math.tan(math.radians(10.0)))  # the hill is above it


@pytest.mark.parametrize(("uphill", "roll", "pitch"), [(0.0, 0.0, 4.0), (180.0, 0.0, -4.0), (90.0, -4.0, 0.0)])
def test_on_a_slope_it_comes_to_rest_along_the_slope_and_stays(uphill, roll, pitch):
    """Uphill ahead the nose is up; uphill to the right it leans to the left, and 0.3 degrees more on its springs."""
    hill = sloping(4.0, uphill)
    level = tilt_of(settled(CALM))
    rest = settled(hill)
    assert np.subtract(tilt_of(rest), level) == pytest.approx((roll, pitch), abs=0.35)
    assert np.hypot(rest.u, rest.v) < 1e-3
    assert np.hypot(rest.pos_n, rest.pos_e) < 0.05
    assert helicopter.outputs(rest, hill, VEHICLE).contact_force_n == pytest.approx(WEIGHT, rel=0.01)


def test_on_a_slope_steeper_than_its_friction_it_slides_down():
    icy = VEHICLE._replace(skid_friction_coefficient=0.1)
    hill, state = sloping(15.0), parked(VEHICLE, IDLE)
    for _ in range(1000):
        state = helicopter.step(state, IDLE, hill, 0.002, icy)
    assert state.pos_n < -0.3  # uphill is north


def test_each_foot_has_its_own_ground():
    """A stone of 3 cm under one foot lifts that corner; a foot over a deck's edge hangs."""
    stone = settled(CALM._replace(foot_1_m=0.03))  # front right
    roll, pitch = np.subtract(tilt_of(stone), tilt_of(settled(CALM)))
    assert roll < -0.5
    assert pitch > 0.5
    for foot, x, y in ((1, 1, 1), (2, 1, -1), (3, -1, 1), (4, -1, -1)):
        over = CALM._replace(**{f"foot_{n}_m": -1.0 for n in range(1, 5) if n != foot})
        found = support(0.01 - VEHICLE.cg_above_skid_m, (0.0, 0.0, 1.0), (0.0,) * 3, (0.0,) * 3, over, VEHICLE)
        assert found.normal_n == pytest.approx(30.0)
        assert found.forward_n_m == pytest.approx(30.0 * x * VEHICLE.skid_half_length_m)
        assert found.right_n_m == pytest.approx(30.0 * y * VEHICLE.skid_half_track_m)


def test_ground_effect_goes_with_the_ground_under_the_rotor():
    low = HOVER.state._replace(pos_d=-0.5)
    over_deck, over_sea = (
        helicopter.outputs(low, CALM._replace(rotor_1_m=height), VEHICLE).thrust_n for height in (0.0, -50.0)
    )
    free = helicopter.outputs(low._replace(pos_d=-1e6), CALM, VEHICLE).thrust_n
    assert over_deck > 1.05 * free
    assert over_sea == pytest.approx(free, rel=1e-3)
    uphill = helicopter.outputs(low._replace(pos_n=1.0), sloping(8.0), VEHICLE).thrust_n
    assert uphill > over_deck


def test_a_quad_half_over_an_edge_is_rolled_towards_it():
    quad = load_vehicle("quad-450")
    hover = trim_multirotor(quad)
    low = hover.state._replace(pos_d=-0.17)
    edge = CALM._replace(rotor_1_m=-5.0, rotor_2_m=-5.0)  # both on the right
    level, rolled = (multirotor.derivative(low, hover.controls, one, False, quad) for one in (CALM, edge))
    assert rolled.p > level.p + 0.5
    assert rolled.q == pytest.approx(level.q, abs=0.3)


def test_air_that_turns_is_a_body_that_turns_the_other_way_but_for_gyroscopes():
    """The tail rotor in a yawing gust; a multirotor's rotors in a rolling one: each finds its own air."""
    turning = in_wind(0.0, 0.0)._replace(turn_d_rad_s=0.5)
    gust = helicopter.derivative(HOVER.state, HOVER.controls, turning, VEHICLE)
    assert gust.r > 0.2  # it is carried along
    own = helicopter.derivative(HOVER.state._replace(r=-0.5), HOVER.controls, CALM, VEHICLE)
    assert gust.r == pytest.approx(own.r, abs=0.02)
    quad = load_vehicle("quad-450")
    hover = trim_multirotor(quad)
    rolled = multirotor.derivative(hover.state, hover.controls, CALM._replace(turn_n_rad_s=0.5), False, quad)
    assert rolled.p > 0.5
    assert abs(rolled.q) < 0.05 * rolled.p


def test_a_gusts_gradient_is_cyclic_to_the_blades():
    """More air from above on the right of a rotor that turns to the right: the disc tilts back by p_g/Ω; q_g: left."""
    rolling = helicopter.derivative(HOVER.state, HOVER.controls, CALM._replace(turn_n_rad_s=0.3), VEHICLE)
    pitching = helicopter.derivative(HOVER.state, HOVER.controls, CALM._replace(turn_e_rad_s=0.3), VEHICLE)
    per_turn = VEHICLE.flap_rate_1_s * 0.3 / VEHICLE.main_speed_rad_s
    assert rolling.a1 == pytest.approx(per_turn, rel=1e-6)
    assert pitching.b1 == pytest.approx(-per_turn * math.cos(HOVER.roll_rad), rel=1e-6)
