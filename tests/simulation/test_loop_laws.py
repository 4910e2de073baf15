"""The loop in one lane, as functions of records: the state in use, its notes and its memory."""

from math import inf, nan

import numpy as np
import pytest

from flownav.control.autopilot import Estimate
from flownav.control.guidance import Knowledge, Reference
from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion, to_earth
from flownav.estimation.consistency import normalised_error
from flownav.estimation.named import Attitude, PositionNed, VelocityNed
from flownav.estimation.states import STATE, STATES
from flownav.navigation.memory import new_work
from flownav.navigation.records import GroundMemory, Reading, StartMemory, SuspicionMemory
from flownav.simulation.epoch import feel, put_home
from flownav.simulation.navigating import compare_at_horizon, find_place, hand_to_autopilot, note_knowledge, note_truth
from flownav.simulation.navigator_view import GroundEstimate, PadEstimate, PadVariance, StatedVariance
from flownav.simulation.records import Estimated, Felt, Loads, PadPlace
from flownav.simulation.sensing import motion_of, true_imu
from flownav.vehicle.state import CALM, HelicopterState
from packed_covariance import pack

STILL = HelicopterState(**dict.fromkeys(HelicopterState._fields, 0.0) | {"qw": 1.0})
RUNS, WAITS = StartMemory(started=1.0), StartMemory()
BEGINS = Reference(*(0.0,) * len(Reference._fields))._replace(pos_n=7.0, pos_e=8.0, pos_d=-9.0)
SAID = Estimated(1.0, 2.0, -3.0, 0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0)
IN_AIR, ON_SKIDS = Loads(50.0, 0.0, 300.0), Loads(0.0, 40.0, 0.0)
NO_PLACE = PadPlace(0.5, 0.25, 0.125)


def turned(state, roll, pitch, yaw):
    qw, qx, qy, qz = quaternion_from_euler(roll, pitch, yaw)
    return state._replace(qw=qw, qx=qx, qy=qy, qz=qz)


def test_a_hovering_imu_feels_gravity_and_a_turning_one_its_rate():
    leant = turned(STILL, 0.1, -0.2, 0.3)
    vehicle = type("Vehicle", (), {"gravity_m_s2": 9.8})
    still, now = true_imu.law(leant, motion_of(leant), vehicle, period_s=0.01)
    rotation = rotation_from_quaternion(leant.qw, leant.qx, leant.qy, leant.qz)
    assert to_earth(rotation, *still[3:]) == pytest.approx((0.0, 0.0, -9.8))
    assert still[:3] == pytest.approx((0.0, 0.0, 0.0))
    assert now == motion_of(leant)
    after = turned(STILL, 0.0, 0.0, 0.02)
    turning, _ = true_imu.law(after, motion_of(STILL), vehicle, period_s=0.01)
    assert turning[:3] == pytest.approx((0.0, 0.0, 2.0), rel=1e-6)


def test_what_is_felt_is_the_mean_of_the_epoch_and_outlives_a_silent_reading():
    nothing = Felt(*(9.0,) * 8)
    first = feel.law(nothing, Reading(0.2, 0.4, 0.0, 1.0, 2.0, 3.0), part=0, parts=2)
    second = feel.law(first, Reading(value_3=nan, value_4=4.0, value_5=5.0), part=1, parts=2)
    assert first == (0.5, 1.0, 1.5, 1.0, 2.0, 3.0, 0.1, 0.2)
    assert second == (1.0, 3.0, 4.0, 1.0, 4.0, 5.0, 0.1, 0.2)


def test_errors_at_the_horizon_are_said_once_the_navigator_runs_and_the_horizon_is_past_the_start():
    state = turned(STILL._replace(pos_n=1.0, u=2.0), 0.0, 0.0, 0.5)
    then = note_truth.law(state)
    told = (
        PositionNed(1.5, 0.0, 0.0), VelocityNed(then.vel_n_m_s, then.vel_e_m_s, 0.25), Attitude(*then[6:]),
        StatedVariance(1.0, 2.0, 3.0, 4.0, 5.0, 6.0), then,
    )  # fmt: skip
    found = compare_at_horizon.law(RUNS, *told, reached=True)
    assert found.error == pytest.approx((0.5, 0.0, 0.0, 0.0, 0.0, 0.25))
    assert found.stated == (1, 2, 3, 4, 5, 6)
    assert np.isnan(compare_at_horizon.law(WAITS, *told, reached=True).error).all()
    assert np.isnan(compare_at_horizon.law(RUNS, *told, reached=False).error).all()


def test_the_pad_is_where_camera_and_range_say_and_else_where_it_was_noted():
    pad, ground, below = PadEstimate(1.0, 4.0, 5.0), GroundMemory(known=1.0), GroundEstimate(6.0)
    assert find_place.law(NO_PLACE, pad, ground, below) == (4.0, 5.0, 6.0)
    assert find_place.law(NO_PLACE, pad._replace(known=0.0), ground, below) == (0.5, 0.25, 6.0)
    assert find_place.law(NO_PLACE, pad, ground._replace(known=0.0), below) == (4.0, 5.0, 0.125)


@pytest.mark.parametrize(("waiting", "loads"), [(True, IN_AIR), (True, ON_SKIDS), (False, IN_AIR)])
def test_until_the_hand_over_the_truth_is_flown_and_the_place_noted(waiting, loads):
    state = turned(STILL._replace(pos_n=10.0, u=3.0), 0.0, 0.0, 0.2)
    told = {"waiting": waiting, "at_start": True, "reference": BEGINS}
    place, flown, error = hand_to_autopilot.law(state, RUNS, loads, NO_PLACE, SAID, **told)
    if waiting:
        begun = (7.0, 8.0, -9.0) if loads is ON_SKIDS else (10.0, 0.0, 0.0)
        assert place == tuple(was + said - at for was, said, at in zip(NO_PLACE, SAID[:3], begun, strict=True))
        assert flown == (10.0, 0.0, 0.0, 3.0, 0.0, 0.0, state.qw, state.qx, state.qy, state.qz)
        assert error == pytest.approx((1.0, 0.0, 0.0, 0.0))
    else:
        assert place == NO_PLACE
        assert flown == SAID
        assert error == pytest.approx((state.qw, 0.0, 0.0, -state.qz))  # level and north are stated of a turned vehicle
    assert hand_to_autopilot.law(state, WAITS, loads, NO_PLACE, SAID, **told)[0] == NO_PLACE


def test_home_is_what_the_estimate_has_beyond_the_path():
    estimate = Estimate(8.0, 8.5, -9.0, *(0.0,) * 6)
    assert put_home.law(estimate, reference=BEGINS) == (1.0, 0.5, 0.0)


def test_a_vehicle_knows_its_place_over_the_pad_by_the_worse_axis():
    before, quiet = Knowledge(0.0, 0.0, 1.0, 0.0, 0.0), SuspicionMemory()
    variance, ground = PadVariance(1.0, 4.0, 9.0, 0.25), GroundMemory(known=1.0)
    found = note_knowledge.law(before, CALM, PadEstimate(1.0, 0.0, 0.0), variance, ground, quiet)
    assert found == (1.0, 1.0, pytest.approx(1.02), 3.0, 0.0, 0.0)
    unseen = note_knowledge.law(
        before, CALM, PadEstimate(0.0, 0.0, 0.0), variance, ground, quiet._replace(suspected=2.0)
    )
    assert unseen == (0.0, 1.0, pytest.approx(1.02), 2.0, 1.0, 0.0)
    lost = note_knowledge.law(before, CALM, PadEstimate(1.0, 0.0, 0.0), variance._replace(over_n_m2=nan), ground, quiet)
    assert lost.sigma_m == inf
    cut = CALM._replace(engine=0.0)
    told = note_knowledge.law(lost, cut, PadEstimate(1.0, 0.0, 0.0), variance, ground, quiet)
    assert told.powerless_s == pytest.approx(0.02)  # as the speed controller tells, epoch by epoch
    assert note_knowledge.law(told, cut, PadEstimate(1.0, 0.0, 0.0), variance, ground, quiet).powerless_s > 0.03


def test_the_normalised_error_is_that_of_the_joint_form():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(STATES, STATES))
    covariance, state, truth = root @ root.T + np.eye(STATES), rng.normal(size=6), rng.normal(size=6)
    work = new_work((0,))
    work[STATE : STATE + 6] = state
    pack(work, (0,), 0, STATES, covariance)
    joint = (state - truth) @ np.linalg.solve(covariance[:6, :6], state - truth)
    assert normalised_error(work, (0,), 0, tuple(truth)) == pytest.approx(joint, rel=1e-10)
