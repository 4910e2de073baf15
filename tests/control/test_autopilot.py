"""Guidance and autopilot laws: straight legs, signs, limits, anti-windup, landing logic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.control import autopilot
from flownav.control.autopilot import AutopilotGains, Estimate, grounded, hovering, inner_loop, integrate, outer_loop
from flownav.control.guidance import Reference, path_through, reference_at
from flownav.frames import quaternion_from_euler, rotation_from_quaternion

GAINS = AutopilotGains()
LEVEL = rotation_from_quaternion(1.0, 0.0, 0.0, 0.0)
HERE = Estimate(0.0, 0.0, -3.0, 0.0, 0.0, 0.0)
HOLD = Reference(0.0, 0.0, -3.0, 0.0, 0.0, 0.0)
PATH = path_through([(0.0, 0.0, 0.0, -3.0), (10.0, 0.0, 0.0, -3.0), (20.0, 2.0, 0.0, 0.0)])


def flown(reference=HOLD, estimate=HERE, rotation=LEVEL, state=None):
    return outer_loop(state or hovering(GAINS), reference, estimate, rotation, GAINS, 0.02)


def test_between_knots_the_reference_moves_in_a_straight_line_at_constant_speed():
    middle = reference_at(PATH, 15.0)
    assert middle == pytest.approx((1.0, 0.0, -1.5, 0.2, 0.0, 0.3))
    assert reference_at(PATH, 5.0) == pytest.approx((0.0, 0.0, -3.0, 0.0, 0.0, 0.0))


def test_after_the_last_knot_the_reference_holds():
    assert reference_at(PATH, 99.0) == pytest.approx((2.0, 0.0, 0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("knots", [[(0.0, 0.0, 0.0, 0.0)], [(1.0, 0, 0, 0), (1.0, 0, 0, 0)]])
def test_a_path_needs_two_knots_in_time_order(knots):
    with pytest.raises(ValueError, match="two or more knots"):
        path_through(knots)


def test_a_target_ahead_pitches_down_one_to_the_right_rolls_right_one_above_climbs():
    assert flown(HOLD._replace(pos_n=1.0)).pitch_sine < 0.0
    assert flown(HOLD._replace(pos_e=1.0)).roll_sine > 0.0
    assert flown(HOLD._replace(pos_d=-4.0)).collective_command > GAINS.collective_trim_rad


def test_heading_east_a_target_east_lies_ahead():
    east = rotation_from_quaternion(*quaternion_from_euler(0.0, 0.0, np.pi / 2))
    state = flown(HOLD._replace(pos_e=1.0), rotation=east)
    assert state.pitch_sine < -1e-3
    assert state.roll_sine == pytest.approx(0.0, abs=1e-12)


@given(st.floats(-100, 100), st.floats(-100, 100), st.floats(-100, 100))
def test_commands_stay_within_their_limits(north, east, down):
    state = flown(Reference(north, east, down, 0.0, 0.0, 0.0))
    assert abs(state.pitch_sine) <= GAINS.tilt_limit
    assert abs(state.roll_sine) <= GAINS.tilt_limit
    assert abs(state.collective_command - GAINS.collective_trim_rad) <= GAINS.collective_limit_rad + 1e-15


def test_an_integrator_stops_at_its_limit_and_comes_back_at_once():
    assert integrate(0.5, 1.0, 1.0, 0.1, 2.0, 1.0) == 0.5
    assert integrate(0.5, -1.0, 1.0, 0.1, 2.0, 1.0) == pytest.approx(0.4)
    assert integrate(0.5, 1.0, 1.0, 0.1, 0.0, 1.0) == pytest.approx(0.6)


def test_on_the_skids_nothing_integrates_and_the_collective_settles_to_idle():
    state = grounded(GAINS)._replace(collective_command=0.05)
    for _ in range(100):
        state = flown(HOLD._replace(pos_n=5.0), state=state)
    assert (state.accel_forward, state.collective) == (0.0, 0.0)
    assert state.collective_command == GAINS.idle_collective_rad


def test_nose_up_and_roll_right_errors_are_pushed_back_and_a_turn_is_stopped():
    up = rotation_from_quaternion(*quaternion_from_euler(0.1, 0.1, 0.0))
    _, lon, lat, _, ped = inner_loop(hovering(GAINS), up, 0.0, 0.0, 0.3, GAINS, 0.004)
    assert lon < 0.0
    assert lat < 0.0
    assert ped < GAINS.pedal_trim_rad


def test_touchdown_needs_a_tenth_of_a_second_of_weight_and_is_final():
    def logic(state, force, may_land=1.0):
        return autopilot.landing_logic(state, force, 10.0, 1.0, may_land, 0.02)

    state = hovering(GAINS)
    for _ in range(4):
        state = logic(state, 20.0)
    assert state.flying == 1.0
    state = logic(logic(state, 20.0), 20.0)
    assert state.flying == 0.0
    assert logic(state, 0.0).flying == 0.0
    bounced = logic(hovering(GAINS)._replace(contact_time_s=0.08), 0.0)
    assert (bounced.flying, bounced.contact_time_s) == (1.0, 0.0)
    assert logic(hovering(GAINS)._replace(contact_time_s=9.0), 99.0, may_land=0.0).flying == 1.0
