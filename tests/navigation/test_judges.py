"""Judges and laws of the navigator as pure functions of plain floats: verdicts, variances, what is remembered."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from flownav.core.frames import GRAVITY_M_S2
from flownav.estimation.named import PositionNed, VelocityNed
from flownav.estimation.states import BARO
from flownav.navigation.attitude import read_attitude
from flownav.navigation.baro import judge_baro
from flownav.navigation.flow_judge import judge_look, turning_of
from flownav.navigation.flow_noise import alike, flow_variance, followed_agreement, lasting_doubt, wrong_since
from flownav.navigation.gps import LAG_LEFT, LEAPT_RATIO, add_lag, follow_fix_noise, judge_fix, judge_rejections, leaps
from flownav.navigation.heading import heading_variance, magnetic_heading
from flownav.navigation.height import range_variance, range_verdict, repeats
from flownav.navigation.inertial import motion_between, motion_of, sound
from flownav.navigation.kernel_settings import NO_HEADING as HEADLESS
from flownav.navigation.kernel_settings import Equipment
from flownav.navigation.motion_records import ImuMemory, SteadyForce
from flownav.navigation.pad import judge_pad, late_variance
from flownav.navigation.place import judge_pose
from flownav.navigation.reasons import (
    BEFORE_START,
    FUSED,
    INNOVATION_GATE,
    NEAR_GROUND,
    NO_DATA,
    NO_HEADING,
    NO_HEIGHT,
    NOT_FINITE,
    OUT_OF_RANGE,
    OUTAGE,
    SILENT,
    STUCK,
    TILTED,
    component_of,
    judged,
    objecting,
    stated_or,
    usable,
    usable_in_flight,
)
from flownav.navigation.records import (
    FlowMemory,
    HeadingMemory,
    LevelMemory,
    Look,
    RangeMemory,
    Reading,
    StartMemory,
    WitnessMemory,
)
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tape import BARO_FOUND
from flownav.navigation.trust import CREEPING_M_S, OF_GPS, creeps
from flownav.navigation.verdicts import Event, Height, Noise, Offer, Reset
from flownav.navigation.verdicts import Tested as Outcome
from flownav.navigation.vibration import followed_vibration, vibration_beyond, with_reading

NAN = math.nan
FITTED = Equipment(True, False, HEADLESS, False, -math.inf)
TOLD = NavigatorSettingsFile().settings(FITTED)
FRESH_FLOW = FlowMemory(-math.inf, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -math.inf, 0.0)
SEEN = Look(0.0, 0.0, 2.0, known=1.0, upright=1.0)
KEPT, SEARCHED = HeadingMemory(sought=0.0), HeadingMemory(sought=1.0)
RUNS = StartMemory(started=1.0)


def told(**keys):
    return NavigatorSettingsFile(**keys).settings(FITTED)


def reading(*values: float, variance=(), quality=255.0, arrived=1.0, withheld=0.0) -> Reading:
    return Reading(
        *values, *[NAN] * (6 - len(values)), *variance, *[NAN] * (3 - len(variance)), quality, arrived, withheld
    )


# -- any reading ---------------------------------------------------------------------------------------------
def test_what_is_said_of_any_reading_stands_in_this_order():
    """No reading at all before no start, that before the user's will, that before no data, that before no number."""
    bad = {"quality": 0.0, "withheld": 1.0}
    assert usable(reading(1.0), 1.0, 1.0, 1.0) == FUSED
    assert usable(reading(1.0), NAN, 1.0, 1.0) == NOT_FINITE
    assert usable(reading(1.0), 1.0, math.inf, 1.0) == NOT_FINITE
    assert usable(reading(1.0, quality=0.0), NAN, 1.0, 1.0) == NO_DATA
    assert usable(reading(1.0, **bad), NAN, 1.0, 1.0) == OUTAGE
    assert usable(reading(1.0, **bad), NAN, 1.0, 0.0) == BEFORE_START
    assert usable(reading(1.0, arrived=0.0, **bad), NAN, 1.0, 0.0) == SILENT
    assert usable_in_flight(reading(1.0), 1.0, 1.0, 0.0) == SILENT
    assert usable_in_flight(reading(1.0), 1.0, 1.0, 1.0) == FUSED


def test_one_judge_gives_the_first_objection_in_its_order():
    """Unusable before out of reach, that before a repetition, and that before what other evidence has against it."""
    assert judged(NO_DATA, TILTED, True, INNOVATION_GATE) == NO_DATA
    assert judged(SILENT, TILTED, True, INNOVATION_GATE) == SILENT
    assert judged(FUSED, TILTED, True, INNOVATION_GATE) == TILTED
    assert judged(FUSED, FUSED, True, INNOVATION_GATE) == STUCK
    assert judged(FUSED, FUSED, False, INNOVATION_GATE) == INNOVATION_GATE
    assert judged(FUSED, FUSED, False, FUSED) == FUSED
    assert [objecting(before, True, TILTED) for before in (FUSED, STUCK)] == [TILTED, STUCK]
    assert objecting(FUSED, False, TILTED) == FUSED
    assert [stated_or(stated, 4.0) for stated in (0.25, NAN, math.inf)] == [0.25, 4.0, 4.0]


# -- GPS -----------------------------------------------------------------------------------------------------
PUSHED = SteadyForce(3.0, 0.0, -GRAVITY_M_S2 - 4.0)  # by 5 m/s2


def judged_fix(fix: Reading, axis: int, *, level_ratio: float = 0.0, position=True, alone=False):
    memory = LevelMemory(level_ratio)
    return judge_fix.law(fix, StartMemory(1.0), memory, axis=axis, position=position, alone=alone, s=TOLD.gps)


def test_the_noise_of_a_fix_is_its_white_part_and_a_share_of_what_it_states():
    s = TOLD.gps
    fix = reading(1.0, 2.0, 3.0, variance=(4.0, 9.0, 16.0))
    white = (s.gps_white_sigma_m, s.gps_white_sigma_m, s.gps_white_sigma_down_m)
    for axis in range(3):
        variance = pytest.approx(white[axis] ** 2 + 0.09 * (axis + 2) ** 2)
        assert judged_fix(fix, axis) == (axis + 1.0, variance, FUSED)
    no_velocity = reading(1.0, 2.0, 3.0)
    for axis, sigma in ((2, s.gps_velocity_white_down_m_s), (0, s.gps_velocity_white_m_s)):
        assert judged_fix(no_velocity, axis, position=False) == (axis + 1.0, pytest.approx(sigma**2), FUSED)


def test_a_velocity_errs_by_what_a_receivers_lag_leaves_over_and_that_is_not_learnt_away():
    s = TOLD.gps
    lagging = (LAG_LEFT * s.gps_velocity_lag_sigma_s * 5.0) ** 2
    assert add_lag.law(Noise(0.04), StartMemory(1.0), PUSHED, s=s).variance == pytest.approx(0.04 + lagging)
    assert add_lag.law(Noise(0.04), StartMemory(0.0), PUSHED, s=s).variance == 0.04

    def followed(place: int) -> float:
        """The factor after 40 s in which a noise of 0.2 m/s has its stated size."""
        m, rng = WitnessMemory(), np.random.default_rng(1)
        for i, nu in enumerate(0.2 * rng.standard_normal(200)):
            total = 0.04 * m.factor + (lagging if place > OF_GPS + 2 else 0.0)
            tested = Outcome(FUSED, nu, total + 0.01, total)
            m = follow_fix_noise.law(tested, StartMemory(1.0), PUSHED, m, t_s=0.2 * i, place=place, s=s)
        return m.factor

    assert followed(OF_GPS + 3) == pytest.approx(
        followed(OF_GPS), rel=1e-12
    )  # of a velocity as of a place, which does not lag
    assert followed(OF_GPS) == pytest.approx(1.0, abs=0.15)
    refused = Outcome(INNOVATION_GATE, 9.0, 0.05, 0.04)
    m = WitnessMemory()
    assert follow_fix_noise.law(refused, StartMemory(1.0), PUSHED, m, t_s=1.0, place=OF_GPS, s=s) == m


def test_an_external_pose_that_jumps_along_one_axis_is_refused_along_both_and_keeps_its_height():
    def reason(axis: int, ratio: float = 1.1, alone: bool = False) -> int:
        judged = judge_pose.law(
            reading(1.0, 2.0, 3.0), StartMemory(1.0), LevelMemory(ratio), axis=axis, alone=alone, s=TOLD.place
        )
        return judged.reason

    assert [reason(axis) for axis in range(3)] == [INNOVATION_GATE, INNOVATION_GATE, FUSED]
    assert reason(0, alone=True) == FUSED
    assert reason(0, 1.0) == FUSED


def test_a_fix_that_jumps_along_one_axis_is_refused_along_both_and_keeps_its_height():
    fix = reading(1.0, 2.0, 3.0)
    spoilt = [judged_fix(fix, axis, level_ratio=1.1).reason for axis in range(3)]
    assert spoilt == [INNOVATION_GATE, INNOVATION_GATE, FUSED]
    assert judged_fix(fix, 0, level_ratio=1.1, alone=True).reason == FUSED
    assert judged_fix(fix, 0, level_ratio=1.0).reason == FUSED
    assert judged_fix(reading(1.0, 2.0, 3.0, withheld=1.0), 0, level_ratio=1.1).reason == OUTAGE


def test_gps_is_believed_once_it_was_refused_often_and_for_long():
    m = WitnessMemory()
    for t_s in (10.0, 10.3, 10.6, 10.9):  # a second will do where flow is doubted, and five refusals
        reset, m = judge_rejections(2.0, True, True, t_s, m, TOLD.gps)
        assert not reset
    assert judge_rejections(2.0, True, True, 11.2, m, TOLD.gps)[0]
    assert not judge_rejections(2.0, True, False, 11.2, m, TOLD.gps)[0]
    m, times = WitnessMemory(), []
    for t_s in np.arange(10.0, 30.0, 0.5).tolist():
        reset, m = judge_rejections(2.0, True, False, t_s, m, TOLD.gps)
        times += [t_s] * reset
    assert times == [17.0, 24.5]  # 7 s each, and the count begins anew
    m = WitnessMemory()
    for t_s in (10.0, 14.0, 17.5, 20.0):  # long, and not often
        reset, m = judge_rejections(2.0, True, False, t_s, m, TOLD.gps)
        assert not reset
    assert judge_rejections(2.0, True, False, 21.0, m, TOLD.gps)[0]
    assert judge_rejections(0.0, True, False, 21.0, m, TOLD.gps) == (False, WitnessMemory(since_s=21.0))  # until then


def test_a_velocity_that_leapt_out_of_its_gate_is_not_followed_while_flow_holds():
    """One that jumps is the receiver's; one that creeps out may be led away by a flow of the wrong sign."""
    for first, followed in ((1.5, True), (2.0 * LEAPT_RATIO, False)):
        m, resets = WitnessMemory(fused_s=9.8), []
        for t_s in np.arange(10.0, 13.0, 0.2).tolist():
            ratio = first if t_s == 10.0 else 50.0
            leapt = leaps(Outcome(INNOVATION_GATE, 1.0, 1.0, 0.04), ratio, False, 0.01, t_s - m.fused_s)
            reset, m = judge_rejections(ratio, False, False, t_s, m, TOLD.gps, seen=True, leapt_now=leapt)
            resets.append(reset)
        assert any(resets) == followed


# -- flow ----------------------------------------------------------------------------------------------------
def test_noise_of_flow_falls_as_its_quality_rises_and_grows_with_the_range():
    """(sigma(q) r)^2 + floor^2, sigma from that of no quality to that of full."""
    s = TOLD.flow
    assert flow_variance(2.0, 0.0, 255.0, True, s) == pytest.approx((0.05 * 2.0) ** 2 + 0.03**2)
    assert flow_variance(2.0, 0.0, 0.0, True, s) == pytest.approx((0.5 * 2.0) ** 2 + 0.03**2)
    assert flow_variance(4.0, 0.0, 51.0, True, s) == pytest.approx((0.41 * 4.0) ** 2 + 0.03**2)


def test_a_metric_flow_is_as_sure_as_the_range_that_scaled_it():
    s = TOLD.flow
    beside = flow_variance(2.0, 3.0, 255.0, False, s) - flow_variance(2.0, 0.0, 255.0, False, s)
    assert beside == pytest.approx(9.0 * range_variance(2.0, s.range_sigma_m, s.range_relative_sigma) / 4.0)
    assert flow_variance(2.0, 3.0, 255.0, True, s) == flow_variance(2.0, 0.0, 255.0, True, s)


@pytest.mark.parametrize(("change", "view", "reason"), [
    ({}, SEEN, FUSED),
    ({}, SEEN._replace(known=0.0), NO_HEIGHT),
    ({}, SEEN._replace(upright=math.cos(0.81)), TILTED),
    ({}, SEEN._replace(upright=math.cos(0.79)), FUSED),
    ({}, SEEN._replace(range_m=0.29), NEAR_GROUND),
    ({}, SEEN._replace(range_m=0.31), FUSED),
    ({}, SEEN._replace(range_m=0.31, upright=0.9), NEAR_GROUND),  # the height counts, not the slant
    ({"quality": 0.0}, SEEN, NO_DATA),
    ({"withheld": 1.0}, SEEN, OUTAGE),
    ({"arrived": 0.0}, SEEN, SILENT),
])  # fmt: skip
def test_verdicts_on_flow(change, view, reason):
    seen = reading(0.2, -0.3, 0.0, 0.0, 0.0, 0.0, **change)
    s = told(flow_min_height_m=0.3).flow
    assert judge_look.law(seen, RUNS, KEPT, view, angular=True, s=s) == view._replace(reason=reason)
    waiting = (
        NO_HEADING if reason == FUSED else reason
    )  # a sought heading is reported only of readings that may be fused
    assert judge_look.law(seen, RUNS, SEARCHED, view, angular=True, s=s).reason == waiting


def test_flow_that_no_sensor_measures_and_flow_that_is_no_number():
    judged = [
        judge_look.law(reading(x, y), RUNS, KEPT, SEEN._replace(turning_x=turning), angular=True, s=TOLD.flow).reason
        for x, y, turning in ((10.0, 0.0, 0.0), (0.0, -9.85, 0.0), (9.7, -9.7, 0.0), (NAN, 0.0, 0.0), (0.0, 0.0, NAN))
    ]
    assert judged == [OUT_OF_RANGE, OUT_OF_RANGE, FUSED, NOT_FINITE, NOT_FINITE]
    blind = SEEN._replace(turning_x=NAN, turning_y=NAN, known=0.0)
    metric = judge_look.law(reading(20.0, 0.0), RUNS, KEPT, blind, angular=False, s=TOLD.flow)
    assert metric.reason == FUSED  # it needs no turning and no height, and its limit is another


def test_the_turning_is_taken_from_the_imu_less_the_filters_bias_or_from_the_sensor_less_its_own():
    seen = reading(0.0, 0.0, 0.5, 0.6, 0.3, 0.2)
    assert turning_of(seen, 1.0, 0.01, 0.02, True, FRESH_FLOW, TOLD.flow) == (
        pytest.approx(0.29), pytest.approx(0.18), FRESH_FLOW
    )  # fmt: skip
    x, y, m = turning_of(seen, 1.0, 0.01, 0.02, False, FRESH_FLOW, TOLD.flow)
    assert (m.bias_x, m.bias_y, m.bias_count) == (pytest.approx(0.21), pytest.approx(0.42), 1.0)  # the first tells all
    assert (x, y) == (pytest.approx(0.29), pytest.approx(0.18))
    alone = reading(0.0, 0.0, 0.5, 0.6, NAN, NAN)
    assert turning_of(alone, 1.0, 0.01, 0.02, True, m, TOLD.flow) == (pytest.approx(0.29), pytest.approx(0.18), m)


def test_the_bias_of_a_flow_sensors_gyro_is_followed_at_its_pace_and_not_where_it_has_no_data():
    known = FlowMemory(1.0, 1.0, 0.1, 0.0, 1e6, 1.0, 0.0, 0.0, -math.inf, 0.0)
    seen = reading(0.0, 0.0, 0.5, 0.0, 0.0, 0.0)
    _, _, m = turning_of(seen, 1.5, 0.0, 0.0, False, known, TOLD.flow)
    assert m.bias_x == pytest.approx(0.1 + (1.0 - math.exp(-0.5 / 10.0)) * 0.4)
    assert turning_of(seen._replace(quality=0.0), 1.5, 0.0, 0.0, False, known, TOLD.flow)[2] == known


def test_flow_that_agrees_is_not_doubted_and_flow_that_does_not_is_for_long():
    m = FlowMemory(1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -math.inf, 0.0)
    assert followed_agreement(1.0, 1.1, m) == pytest.approx(1.0)
    assert followed_agreement(25.0, 1.1, m) == pytest.approx(1.0 + 0.05 * 24.0)
    assert followed_agreement(25.0, 9.0, m) == pytest.approx(1.0 + 0.5 * 24.0)


def test_a_flow_is_doubted_above_one_ratio_and_trusted_below_a_smaller_one():
    assert [lasting_doubt(0.0, ratio) for ratio in (1.0, 3.9, 4.1)] == [0.0, 0.0, 1.0]
    assert [lasting_doubt(1.0, ratio) for ratio in (3.9, 2.1, 1.9)] == [1.0, 1.0, 0.0]


def test_a_flow_that_is_wrong_in_the_same_way_is_so_until_it_has_agreed_for_5_s():
    never = -np.inf
    assert [wrong_since(9.0, likeness, never) for likeness in (3.9, 4.1)] == [never, 9.0]
    assert [wrong_since(9.0, likeness, 8.0) for likeness in (1.1, 0.9)] == [9.0, 8.0]
    assert [wrong_since(t_s, 0.0, 8.0) for t_s in (13.0, 13.1)] == [8.0, never]


def test_innovations_are_alike_where_they_are_wrong_in_the_same_way_and_not_where_they_are_noise():
    assert alike(2.0, 3.0, 4.0) == 1.5
    assert alike(-50.0, -50.0, 1.0) == 6.25
    random = np.random.default_rng(4).normal(0.0, 10.0, 4000)
    noise = [alike(now, before, 1.0) for before, now in pairwise(random.tolist())]
    assert abs(np.mean(noise)) < 0.3


# -- height --------------------------------------------------------------------------------------------------
def test_a_range_states_its_variance_or_has_a_floor_and_a_share():
    m, height = range_memory(), Height(-2.0, 0.1, 1.0)
    stated = range_verdict(reading(2.0, variance=(0.25,)), 1.0, 1.0, height, False, m, TOLD.height)
    modelled = range_verdict(reading(2.0), 1.0, 1.0, height, False, m, TOLD.height)
    assert stated[:2] == (FUSED, 0.25)
    assert modelled[:2] == (FUSED, pytest.approx(0.05**2 + 0.04**2))


def range_memory(**parts) -> RangeMemory:
    empty = {
        "taken_s": -math.inf,
        "tested_s": -math.inf,
        "refused_s": NAN,
        "last_m": NAN,
        "same_s": NAN,
        "down_m": 0.0,
        "stuck_s": NAN,
    }
    return RangeMemory(**{name: 0.0 for name in RangeMemory._fields} | empty | parts)


@pytest.mark.parametrize(("before", "refused", "crept"), [
    (1.6, 5.1, True), (-1.6, -5.1, True), (4.9, 9.9, True),
    (1.4, 5.1, False),  # it jumped out
    (-1.6, 5.1, False), (1.6, -5.1, False),  # to the other side
    (4.9, 10.1, False),  # no motion is so wrong between two readings
    (0.0, 5.1, False),  # none was fused yet
])  # fmt: skip
@pytest.mark.parametrize("sigma_m", [0.02, 1.0])
def test_a_range_creeps_out_of_its_gate_or_jumps(before, refused, crept, sigma_m):
    tested = Outcome(INNOVATION_GATE, refused * sigma_m, sigma_m**2, 0.5 * sigma_m**2)
    m = range_memory(sigmas=before, taken_s=0.0)
    assert creeps(tested, 1e3, m, 5.0) == crept
    slow = creeps(tested._replace(variance=0.0), 0.9 * abs(refused) * sigma_m / CREEPING_M_S, m, 5.0)
    assert not slow  # nothing that moves leaves its gate so fast


@pytest.mark.parametrize(("range_m", "upright", "reason"), [
    (0.01, 1.0, OUT_OF_RANGE), (0.03, 1.0, FUSED), (99.0, 1.0, FUSED), (101.0, 1.0, OUT_OF_RANGE),
    (2.0, math.cos(0.81), TILTED), (NAN, 1.0, NOT_FINITE),
])  # fmt: skip
def test_verdicts_on_a_range(range_m, upright, reason):
    height = Height(-2.0, 0.1, upright)
    assert range_verdict(reading(range_m), 1.0, 1.0, height, False, range_memory(), TOLD.height)[0] == reason


def test_a_range_that_repeats_itself_weighs_ever_less_and_is_stuck_once_the_vehicle_has_moved():
    """A still hover over a sensor of 1 cm, and one that sticks while the vehicle climbs by 0.12 m."""
    for climb_m, verdicts in ((0.02, [FUSED] * 5), (0.12, [FUSED, FUSED, FUSED, STUCK, STUCK])):
        m, reasons, variances = range_memory(taken_s=9.9), [], []
        for t_s in (10.0, 10.2, 10.4, 10.5, 10.6):
            height = Height(-2.0 if t_s == 10.0 else -2.0 - climb_m, 0.1, 1.0)
            reason, variance, m = range_verdict(reading(2.0), t_s, 1.0, height, False, m, TOLD.height)
            reasons.append(reason)
            variances.append(variance)
        assert reasons == verdicts
        fresh = 0.05**2 + 0.04**2
        assert variances[0] == pytest.approx(fresh)
        assert variances[2] == pytest.approx(fresh + 0.4**2)  # 1 m/s may have gone unseen
        assert (m.last_m, m.same_s, m.down_m) == (2.0, 10.0, -2.0)
    reason, variance, m = range_verdict(reading(2.001), 10.7, 1.0, height, False, m, TOLD.height)
    assert (reason, m.same_s) == (FUSED, 10.7)
    assert variance < 0.005


def test_a_range_that_says_the_same_from_the_first_on_or_for_long_is_no_news():
    """Beyond its reach a sensor may read its greatest range for ever: that is no ground."""
    height = Height(-2.0, 0.1, 1.0)
    for memory, refused_from in ((range_memory(), 0.5), (range_memory(taken_s=9.9), 2.0)):
        m, reasons = memory, {}
        for t_s in np.arange(10.0, 12.6, 0.1):
            reasons[t_s], _, m = range_verdict(reading(2.0), float(t_s), 1.0, height, False, m, TOLD.height)
        stuck = [t_s - 10.0 for t_s, reason in reasons.items() if reason == STUCK]
        assert min(stuck) == pytest.approx(refused_from, abs=0.11)
        assert len(stuck) == sum(t_s - 10.0 >= min(stuck) for t_s in reasons)


def test_the_only_range_is_believed_until_the_height_travels():
    m = range_memory(last_m=2.0, same_s=10.0, down_m=-2.0, taken_s=9.9)
    s = TOLD.height
    assert not repeats(11.0, m, Height(-2.09, 0.1, 1.0), False, s)
    assert repeats(11.0, m, Height(-2.11, 0.1, 1.0), False, s)
    assert not repeats(10.4, m, Height(-2.11, 0.1, 1.0), False, s)
    assert not repeats(11.0, m, Height(-2.0, 0.1, 1.0), True, s)
    assert not repeats(11.0, m, Height(-2.79, 0.1, 1.0), True, s)  # 5 x 0.1 m and three standard deviations of drift
    assert repeats(11.0, m, Height(-2.81, 0.1, 1.0), True, s)
    for lasting_s in (0.6, 2.0, 5.0):  # the drift is that of a constant speed
        least = 0.5 + 3.0 * 0.1 * lasting_s
        assert not repeats(10.0 + lasting_s, m, Height(-2.0 - least + 0.01, 0.1, 1.0), True, s)
        assert repeats(10.0 + lasting_s, m, Height(-2.0 - least - 0.01, 0.1, 1.0), True, s)


def test_pressure_height():
    def judged(given: Reading, known: float = 1.0, started: float = 1.0, factor: float = 1.0):
        start = StartMemory(*[started, *StartMemory()[1:]])
        return judge_baro.law(
            given, start, PositionNed(0.0, 0.0, -3.0), WitnessMemory(factor, known=known), s=TOLD.height
        )

    assert judged(reading(100.0)) == (WitnessMemory(known=1.0), (-1, 97.0, 1e4), (-1, 97.0), Offer(100.0, 1.0, FUSED))
    assert judged(reading(100.0, variance=(0.04,))).offer == Offer(100.0, 0.04, FUSED)
    assert judged(reading(100.0), factor=9.0).offer == Offer(100.0, 9.0, FUSED)
    assert judged(reading(100.0), started=0.0).offer.reason == SILENT
    first = judged(reading(100.0), known=0.0)
    assert (first.baro, first.reset, first.found) == (
        WitnessMemory(known=1.0),
        Reset(BARO, 97.0, 1e4),
        Event(BARO_FOUND, 97.0),
    )
    assert judged(reading(NAN), known=0.0).baro == WitnessMemory(known=0.0)


# -- attitude and heading --------------------------------------------------------------------------------------
def test_a_quaternion_of_any_sensible_length_is_one():
    assert read_attitude(reading(0.0, 0.6, 0.0, 0.8), 1.0) == (True, pytest.approx((0.0, 0.6, 0.0, 0.8)))
    assert read_attitude(reading(0.9, 0.0, 0.0, -1.2), 1.0) == (True, pytest.approx((0.6, 0.0, 0.0, -0.8)))
    assert not read_attitude(reading(0.0, 0.6, 0.0, 0.8), 0.0)[0]
    for bad in ((0.0, 0.1, 0.0, 0.1), (3.0, 0.0, 0.0, 0.0), (NAN, 0.0, 0.0, 0.0)):
        assert not read_attitude(reading(*bad), 1.0)[0]


def test_headings_whose_error_lasts_count_once_in_its_time():
    """2 sigma^2 tau/dt of one in dt, so that however many are read, what they say together stays the same."""
    s = TOLD.attitude
    assert heading_variance(10.1, HeadingMemory(10.0, NAN), s) == pytest.approx(0.04**2 * 2.0 * 5.0 / 0.1)
    assert heading_variance(10.05, HeadingMemory(10.0, NAN), s) == pytest.approx(0.04**2 * 2.0 * 5.0 / 0.05)
    assert heading_variance(99.0, HeadingMemory(10.0, NAN), s) == pytest.approx(0.04**2)


def test_a_magnetic_heading_is_that_of_the_nose_less_that_of_the_field_and_true_by_the_declination():
    assert magnetic_heading(0.0, 1.0, 0.0, HeadingMemory(0.0, 0.3)) == pytest.approx(math.pi / 2 - 0.3)
    assert magnetic_heading(1.0, 0.0, 0.2, HeadingMemory(0.0, 0.0)) == pytest.approx(0.2)  # the needle points east
    assert magnetic_heading(0.0, 1.0, -0.2, HeadingMemory(0.0, 0.3)) == pytest.approx(math.pi / 2 - 0.5)


# -- the pad -------------------------------------------------------------------------------------------------
def test_noise_of_a_pad_fix_grows_with_its_distance():
    s = TOLD.place
    fix = reading(0.1, -0.2, 2.0)
    across, along = (s.pad_angle_sigma_rad * 2.0) ** 2, (s.pad_distance_sigma * 2.0) ** 2
    judged = [judge_pad(fix, component, 1.0, s) for component in range(3)]
    assert judged == [(FUSED, pytest.approx(across)), (FUSED, pytest.approx(across)), (FUSED, pytest.approx(along))]
    assert judge_pad(reading(0.0, 0.0, 0.04), 0, 1.0, s)[0] == OUT_OF_RANGE
    assert judge_pad(reading(0.0, NAN, 2.0), 0, 1.0, s)[0] == NOT_FINITE


def test_what_a_pad_fix_states_of_its_distance_is_taken_as_it_is():
    fix = reading(0.0, 0.0, 2.0, variance=(1e-4, 1e-4, 0.01))
    assert judge_pad(fix, 2, 1.0, TOLD.place) == (FUSED, 0.01)


def test_what_lasts_of_a_pad_fix_is_no_noise_of_it_and_some_noise_is_always_left():
    """Of 10 mrad stated at 2 m, 8 last; of a fix that states less than lasts, a fiftieth is noise."""
    s = TOLD.place._replace(pad_boresight_sigma_rad=0.008, pad_scale_sigma=0.02)
    fix = reading(0.0, 0.0, 2.0, variance=(1e-4, 1e-6, 0.01))
    judged = [judge_pad(fix, component, 1.0, s)[1] for component in range(3)]
    assert judged == pytest.approx([4.0 * (1e-4 - 0.008**2), 0.02 * 4e-6, 0.01 - 0.04**2])


def test_a_fix_that_is_stamped_wrongly_errs_by_how_far_the_pad_passes_by_meanwhile():
    """10 ms, at 3 m/s and 4 m away at 0.5 rad/s: 30 and 20 mm; along the sight, turning moves nothing."""
    s, m = TOLD.place._replace(pad_time_sigma_s=0.01), imu_memory(gyro_x=0.3, gyro_y=-0.4, gyro_z=9.0)
    moving = VelocityNed(2.0, -1.0, 2.0)
    assert late_variance(moving, m, 4.0, 0, s) == pytest.approx(0.03**2 + 0.02**2)
    assert late_variance(moving, m, 4.0, 1, s) == pytest.approx(0.03**2 + 0.02**2)
    assert late_variance(moving, m, 4.0, 2, s) == pytest.approx(0.03**2)
    assert late_variance(moving, m, 4.0, 0, TOLD.place) == 0.0


def test_components():
    value = reading(1.0, 2.0, 3.0, variance=(4.0, 5.0, 6.0))
    assert [component_of(value, k) for k in range(3)] == [(1.0, 4.0), (2.0, 5.0), (3.0, 6.0)]


# -- inertial readings ---------------------------------------------------------------------------------------
def test_between_two_readings_their_mean_stands_or_the_later_of_a_unit_that_integrates():
    before, now = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0), (1.0, 3.0, 5.0, 7.0, 9.0, 11.0)
    assert motion_between(before, now, 0.0) == (0.5, 2.0, 3.5, 5.0, 6.5, 8.0)
    assert motion_between(before, now, 1.0) == now


def test_a_sound_reading_is_finite_arrived_and_not_withheld():
    assert sound(reading(*[0.1] * 6))
    assert motion_of(reading(*range(6))) == (0, 1, 2, 3, 4, 5)
    for bad in (reading(*[0.1] * 5, NAN), reading(*[0.1] * 6, arrived=0.0), reading(*[0.1] * 6, withheld=1.0)):
        assert not sound(bad)


def imu_memory(**parts) -> ImuMemory:
    return ImuMemory(**{name: 0.0 for name in ImuMemory._fields} | parts)


def test_the_vibration_of_white_noise_is_its_variance():
    """Jumps of x, y, z: their mean square over 6, followed over a second."""
    m = imu_memory(accel_x=1.0, accel_y=-1.0, accel_z=2.0)
    jumped = reading(0.0, 0.0, 0.0, 3.0, 2.0, 8.0)
    assert followed_vibration(jumped, m, 2.0) == pytest.approx((4.0 + 9.0 + 36.0) / 6.0)
    assert followed_vibration(jumped, m._replace(vibration=1.0), 0.1) == pytest.approx(0.9 + 0.1 * 49.0 / 6.0)
    random, sigma, m = np.random.default_rng(2), 1.7, imu_memory()
    followed = []
    for k in range(20000):
        noise = reading(0.0, 0.0, 0.0, *random.normal(0.0, sigma, 3).tolist())
        m = with_reading(noise, 0.01 * k, m._replace(vibration=followed_vibration(noise, m, 0.01)))
        followed.append(m.vibration)
    assert np.mean(followed[1000:]) == pytest.approx(sigma**2, rel=0.02)


def test_vibration_up_to_the_harmless_does_no_harm():
    assert vibration_beyond(imu_memory(vibration=0.9), TOLD.imu) == 0.0
    assert vibration_beyond(imu_memory(vibration=9.0), TOLD.imu) == pytest.approx(2.0)
    assert vibration_beyond(imu_memory(vibration=9.0), told(vibration_free_m_s2=3.5).imu) == 0.0
