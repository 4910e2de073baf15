"""Guidance and autopilot laws: straight legs, signs, limits, anti-windup, landing logic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.control import autopilot, guidance
from flownav.control.autopilot import Estimate, grounded, hovering, inner_loop, integrate, outer_loop
from flownav.control.gains import AutopilotGains
from flownav.control.guidance import Knowledge, Reference, path_through, reference_at, rounded
from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler, rotation_from_quaternion

GAINS = AutopilotGains()
LEVEL = rotation_from_quaternion(1.0, 0.0, 0.0, 0.0)
HERE = Estimate(0.0, 0.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0, -GRAVITY_M_S2)
KNOWN = Knowledge(pad_found=1.0, ground_found=1.0, pad_unseen_s=0.0, sigma_m=0.0, doubted=0.0)
HOLD = Reference(0.0, 0.0, -3.0, 0.0, 0.0, 0.0)
PATH = path_through([(0.0, 0.0, 0.0, -3.0), (10.0, 0.0, 0.0, -3.0), (20.0, 2.0, 0.0, 0.0)])


def flown(reference=HOLD, estimate=HERE, rotation=LEVEL, state=None):
    return outer_loop(state or hovering(GAINS), reference, estimate, KNOWN, rotation, GAINS, 1.0, 0.02)


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


def test_a_vehicle_that_presses_on_lets_its_thrust_go_where_the_ground_holds_it_up():
    """Below the gate, from half a landing's speed less on; the attitude stays held, and in the air it flies on."""
    legs = GAINS._replace(presses_on=1.0, commit_height_m=0.05, land_height_m=1.0, land_speed_m_s=0.3)
    falls = Reference(0.0, 0.0, 1.0, 0.0, 0.0, 0.3)
    settled = GAINS.collective_trim_rad - 0.02 * GAINS.spool_rate_rad_s

    def after(gains=legs, height_m=0.01, sink_m_s=0.0, contact_time_s=0.0):
        state = hovering(gains)._replace(contact_time_s=contact_time_s)
        here = HERE._replace(pos_d=-height_m, w=sink_m_s)
        return outer_loop(state, falls, here, KNOWN, LEVEL, gains, 1.0, 0.02)

    held = after()
    assert held.collective_command == pytest.approx(settled)
    assert held.flying == 1.0
    assert after(sink_m_s=0.14).collective_command == pytest.approx(settled)
    assert after(sink_m_s=0.16).collective_command > settled
    assert after(height_m=0.06).collective_command > settled
    assert after(height_m=0.06, sink_m_s=0.3, contact_time_s=0.02).collective_command == pytest.approx(settled)
    assert after(legs._replace(presses_on=0.0)).collective_command > settled
    assert after(legs._replace(presses_on=0.0), contact_time_s=0.02).collective_command > settled


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


@given(st.floats(-3.1, 3.1), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_what_it_does_turns_with_the_heading(yaw, ahead, aside, u, v):
    """A target ahead and to the right is flown to alike, whichever way ahead and right point."""
    limits = GAINS._replace(horizontal_speed_limit_m_s=1e3)  # north and east are limited each on its own
    turned = rotation_from_quaternion(*quaternion_from_euler(0.0, 0.0, yaw))
    estimate = HERE._replace(u=u, v=v)
    north, east = np.cos(yaw) * ahead - np.sin(yaw) * aside, np.sin(yaw) * ahead + np.cos(yaw) * aside
    near, far = HOLD._replace(pos_n=ahead, pos_e=aside), HOLD._replace(pos_n=north, pos_e=east)
    one = outer_loop(hovering(limits), near, estimate, KNOWN, LEVEL, limits, 1.0, 0.02)
    other = outer_loop(hovering(limits), far, estimate, KNOWN, turned, limits, 1.0, 0.02)
    assert np.array(other) == pytest.approx(np.array(one), abs=1e-12)


def test_the_tilt_commanded_is_the_one_whose_weight_gives_the_acceleration():
    for error in (0.1, -0.4):
        moving = flown(HOLD._replace(vel_n=error, vel_e=error))
        assert -moving.pitch_sine * GRAVITY_M_S2 == pytest.approx(GAINS.forward_gain * error)
        assert moving.roll_sine * GRAVITY_M_S2 == pytest.approx(GAINS.forward_gain * error)


def test_a_target_far_above_or_below_is_approached_at_the_climb_limit():
    for far, speed in ((-100.0, -GAINS.climb_limit_m_s), (100.0, GAINS.climb_limit_m_s)):
        asked = flown(HOLD._replace(pos_d=HOLD.pos_d + far))
        assert asked.collective_command == pytest.approx(flown(HOLD._replace(vel_d=speed)).collective_command)


@pytest.mark.parametrize("reverse", [1.0, -1.0])
def test_a_body_rate_is_answered_against_itself_on_each_axis(reverse):
    def blades(p, q, r):
        return np.array(inner_loop(hovering(GAINS), LEVEL, p, q, r, GAINS, 0.004)[1:])

    still, rate = blades(0.0, 0.0, 0.0), 0.4 * reverse
    for axis, rates in ((0, (0.0, rate, 0.0)), (1, (rate, 0.0, 0.0)), (3, (0.0, 0.0, rate))):
        answer = (blades(*rates) - still) * reverse
        assert answer[axis] < -1e-3
        assert np.delete(answer, axis) == pytest.approx(np.zeros(3), abs=1e-15)


def test_a_nose_to_the_right_is_brought_back_to_north():
    for yaw in (0.3, -0.3, 2.5):
        turned = rotation_from_quaternion(*quaternion_from_euler(0.0, 0.0, yaw))
        pedal = inner_loop(hovering(GAINS), turned, 0.0, 0.0, 0.0, GAINS, 0.004)[4]
        assert (pedal - GAINS.pedal_trim_rad) * yaw < 0.0


# -- the last metres of a precision landing -----------------------------------------------------------------
PRECISE = GAINS._replace(
    pad_pos_d_m=-0.2, land_height_m=1.0, land_speed_m_s=0.25, align_height_m=1.6, align_radius_m=0.15,
    align_speed_m_s=0.2, align_patience_s=10.0, commit_height_m=0.4,
)  # fmt: skip
DOWN = Reference(0.0, 0.0, 0.0, 0.0, 0.0, 0.3)


def allowed(height, off_n=0.0, off_e=0.0, u=0.0, v=0.0, waited=0.0):
    """How fast it may descend with the skids so high over the pad, so far beside its middle."""
    waiting = guidance.misaligned(-off_n, -off_e, u, v, height, waited, PRECISE)
    return guidance.descent_limit(waiting, PRECISE.align_height_m, height, DOWN.vel_d, PRECISE)


def test_near_the_pad_the_descent_is_slow_and_above_it_the_references():
    assert allowed(0.9) == PRECISE.land_speed_m_s
    assert allowed(1.1) == pytest.approx(PRECISE.climb_limit_m_s + DOWN.vel_d)


@pytest.mark.parametrize(("off_n", "off_e"), [(0.16, 0.0), (-0.16, 0.0), (0.0, -0.16), (0.11, -0.11)])
def test_beside_the_pads_middle_it_waits_before_the_last_half_metre_and_then_goes_on(off_n, off_e):
    assert allowed(1.59999, off_n, off_e) == pytest.approx(0.0, abs=1e-4)
    assert allowed(0.5, off_n, off_e) == -PRECISE.land_speed_m_s  # back up to the gate
    assert allowed(0.3, off_n, off_e) == PRECISE.land_speed_m_s
    assert allowed(1.7, off_n, off_e) > 1.0


@pytest.mark.parametrize(("off_n", "off_e"), [(0.1, 0.1), (-0.1, -0.1), (0.14, 0.0)])
def test_over_the_pads_middle_it_goes_on_unless_it_is_fast(off_n, off_e):
    assert allowed(1.2, off_n, off_e) > 0.0
    assert allowed(1.2, off_n, off_e, u=-0.15, v=0.15) < 0.0


def test_what_counts_is_where_the_skids_will_touch():
    assert allowed(1.2, 0.3, 0.0, u=-0.19) > 0.0  # beside the middle, and on the way to it
    assert allowed(1.2, 0.1, 0.0, u=0.19) < 0.0  # above it, and on the way off
    assert allowed(1.2, 0.0, -0.3, v=0.19) > 0.0
    assert allowed(0.42, 0.1, 0.0, u=0.02) > 0.0


def test_without_a_pad_it_waits_at_the_height_from_which_it_searches():
    told = PRECISE._replace(search_height_m=2.0)

    def collective(height, found):
        at, known = HERE._replace(pos_d=PRECISE.pad_pos_d_m - height), KNOWN._replace(pad_found=found)
        after = outer_loop(hovering(told), DOWN, at, known, LEVEL, told, 1.0, 0.02)
        assert (after.searched_s > 0.0) == (found == 0.0 and height < 2.3)
        return after.collective_command - told.collective_trim_rad

    assert collective(1.9, 0.0) > 0.0
    assert collective(1.9, 1.0) < 0.0
    assert collective(2.4, 0.0) < 0.0


def test_going_around_it_climbs_and_comes_down_again():
    told = PRECISE._replace(go_around_height_m=3.0, landing_sigma_m=0.5, doubt_s=0.0, clear_s=0.1)
    low, high = (HERE._replace(pos_d=PRECISE.pad_pos_d_m - height) for height in (0.9, 3.0))
    unsure = KNOWN._replace(sigma_m=1.0)
    away = outer_loop(hovering(told), DOWN, low, unsure, LEVEL, told, 1.0, 0.02)
    assert (away.away, away.go_arounds) == (1.0, 1.0)
    assert away.collective_command > told.collective_trim_rad
    assert outer_loop(hovering(told), DOWN, low, unsure, LEVEL, told, 0.0, 0.02).away == 0.0  # it may not land yet
    state = away
    for _ in range(7):
        state = outer_loop(state, DOWN, high, KNOWN, LEVEL, told, 1.0, 0.02)
    assert (state.away, state.go_arounds) == (0.0, 1.0)
    assert state.collective_command < away.collective_command


def test_patience_widens_the_gate():
    assert allowed(1.2, 0.25) < 0.0
    assert allowed(1.2, 0.25, waited=5.0) < 0.0
    assert allowed(1.2, 0.25, waited=8.0) > 0.0
    assert allowed(1.2, 0.0, u=0.0, v=0.3, waited=12.0) > 0.0


def test_waiting_at_the_gate_is_counted():
    beside = Estimate(0.5, 0.0, PRECISE.pad_pos_d_m - 1.2, 0.0, 0.0, 0.0, 0.0, 0.0, -GRAVITY_M_S2)
    state = outer_loop(hovering(PRECISE), DOWN, beside, KNOWN, LEVEL, PRECISE, 1.0, 0.02)
    assert state.waited_s == pytest.approx(0.02)
    state = outer_loop(state, DOWN, beside._replace(pos_n=0.0), KNOWN, LEVEL, PRECISE, 1.0, 0.02)
    assert state.waited_s == pytest.approx(0.02)


def test_the_limit_holds_in_the_loop():
    beside = Estimate(0.5, 0.0, PRECISE.pad_pos_d_m - 1.2, 0.0, 0.0, 0.0, 0.0, 0.0, -GRAVITY_M_S2)
    over = beside._replace(pos_n=0.0)
    waiting = outer_loop(hovering(PRECISE), DOWN, beside, KNOWN, LEVEL, PRECISE, 1.0, 0.02)
    going = outer_loop(hovering(PRECISE), DOWN, over, KNOWN, LEVEL, PRECISE, 1.0, 0.02)
    assert waiting.collective_command > PRECISE.collective_trim_rad
    assert going.collective_command < PRECISE.collective_trim_rad


# -- gusts, torque, skids ---------------------------------------------------------------------------------------
def felt(push_n=0.0, push_e=0.0, yaw=0.0, roll=0.0, pitch=0.0, **gains):
    """The outer loop after a second of a push [m/s2] on a vehicle that hangs on its rotor; trim is level."""
    rotation = rotation_from_quaternion(*quaternion_from_euler(roll, pitch, yaw))
    earth = np.array([push_n, push_e, -GRAVITY_M_S2])
    if roll or pitch:  # what accelerates it: the thrust, along its own axis
        earth = np.reshape(rotation, (3, 3)) @ [0.0, 0.0, -GRAVITY_M_S2]
    force = np.reshape(rotation, (3, 3)).T @ earth
    told = GAINS._replace(gust_share=1.0, gust_decay_forward=0.9, gust_decay_right=0.9, forward_integral=0.0,
                          right_integral=0.0, **gains)  # fmt: skip
    state = hovering(told)
    for _ in range(50):
        estimate = HERE._replace(force_x=force[0], force_y=force[1], force_z=force[2])
        state = outer_loop(state, HOLD, estimate, KNOWN, rotation, told, 1.0, 0.02)
    return state


def test_a_push_is_answered_with_the_tilt_that_holds_against_it():
    north, east = felt(push_n=0.3), felt(push_e=0.3)
    assert north.pitch_sine == pytest.approx(0.3 / GRAVITY_M_S2, rel=0.01)  # nose up
    assert east.roll_sine == pytest.approx(-0.3 / GRAVITY_M_S2, rel=0.01)  # to the left
    assert felt(push_e=0.3, yaw=np.pi / 2).pitch_sine == pytest.approx(0.3 / GRAVITY_M_S2, rel=0.01)
    assert (north.roll_sine, east.pitch_sine) == pytest.approx((0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize(("roll", "pitch"), [(0.05, 0.0), (0.0, 0.05), (-0.03, 0.02)])
def test_what_the_tilt_explains_is_no_gust(roll, pitch):
    state = felt(roll=roll, pitch=pitch)
    assert (state.gust_forward, state.gust_right) == pytest.approx((0.0, 0.0), abs=0.01)


def test_less_collective_takes_less_pedal():
    told = GAINS._replace(pedal_per_collective=2.0)
    state = hovering(told)._replace(collective_command=told.collective_trim_rad - 0.01)
    pedal = inner_loop(state, LEVEL, 0.0, 0.0, 0.0, told, 0.004)[4]
    assert pedal == pytest.approx(told.pedal_trim_rad - 0.02)


def test_the_skids_hang_opposite_to_the_roll_and_it_is_they_that_are_flown_to_the_pad():
    told = GAINS._replace(skids_below_cg_m=0.2, roll_trim_sine=0.1, pitch_trim_sine=0.05)
    assert guidance.skids_beside(LEVEL, told) == pytest.approx((0.01, -0.02))
    east = rotation_from_quaternion(*quaternion_from_euler(0.0, 0.0, np.pi / 2))
    assert guidance.skids_beside(east, told) == pytest.approx((0.02, 0.01))
    rolled = rotation_from_quaternion(*quaternion_from_euler(0.1, 0.0, 0.0))  # what it says is where they are
    assert 0.2 * rolled[5] == pytest.approx(guidance.skids_beside(LEVEL, told)[1], rel=0.01)
    over = HERE._replace(pos_n=-0.01, pos_e=0.02)
    state = outer_loop(hovering(told), HOLD, over, KNOWN, LEVEL, told, 1.0, 0.02)
    assert (state.pitch_sine, state.roll_sine) == pytest.approx((0.05, 0.1))


def test_a_rounded_corner_is_passed_at_constant_acceleration_and_the_legs_stay():
    smooth = rounded(PATH, 2.0)
    for t_s in (0.0, 5.0, 8.99, 11.01, 15.0, 20.0):
        assert reference_at(smooth, t_s)[:3] == pytest.approx(reference_at(PATH, t_s)[:3], abs=1e-9)
    for t_s in (9.25, 9.5, 10.0, 10.75):  # at its own knots
        since = t_s - 9.0
        assert reference_at(smooth, t_s).pos_d == pytest.approx(-3.0 + 0.5 * 0.15 * since**2, abs=1e-9)
    speeds = [reference_at(smooth, t_s).vel_d for t_s in np.arange(8.9, 11.2, 0.05)]
    assert np.diff(speeds).max() < 0.3 / 7
    assert np.diff(speeds).min() >= -1e-9


def test_short_legs_keep_a_tenth_of_themselves():
    short = rounded(path_through([(0.0, 0, 0, 0), (1.0, 0, 0, -1.0), (2.0, 0, 0, -1.0), (9.0, 1, 0, -1.0)]), 5.0)
    assert np.all(np.diff(short.t_s) > 0.0)
    assert reference_at(short, 0.05).vel_d == pytest.approx(-1.0)
    assert reference_at(short, 1.5)[:3] == pytest.approx((0.0, 0.0, -1.0))
