"""The consequences of a reading's fate, as functions of plain records: resets, aids, a pad, a compass, a start."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.estimation.named import Attitude, PositionNed, VelocityNed
from flownav.estimation.states import ACCEL_BIAS, ATTITUDE, GPS_FAST, GPS_SLOW, GPS_VELOCITY, PAD, POSITION, VELOCITY
from flownav.navigation import verdicts
from flownav.navigation.compass import check_compass
from flownav.navigation.course import FOUND_RAD, LEAST_TRAVEL_M, find_heading
from flownav.navigation.gps import AlongAxis, judge_fate
from flownav.navigation.kernel_settings import NO_HEADING, Equipment
from flownav.navigation.motion_records import CourseMemory, ImuMemory, PushMemory
from flownav.navigation.offers import compare_level, note_aid, note_aid_age, note_height
from flownav.navigation.pad import (
    FIXES_THAT_FIND,
    LEFT,
    MANY_STRAYS,
    NEVER_STOOD,
    SEEN,
    STOOD_ON,
    Pad,
    count_refusals,
    find_pad,
    judge_sight,
)
from flownav.navigation.place import stand_on_pad
from flownav.navigation.reasons import DATUM, FUSED, INNOVATION_GATE, SILENT
from flownav.navigation.records import (
    AidMemory,
    FixMemory,
    FlowMemory,
    GpsMemory,
    HeadingMemory,
    LevelMemory,
    PadMemory,
    RangeMemory,
    Reading,
    StartMemory,
    WitnessMemory,
)
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.start import start_lanes
from flownav.navigation.tape import (
    AIDED_AGAIN,
    COMPASS_REFUTED,
    DEAD_RECKONING,
    GPS_RESET,
    HEADING_FOUND,
    PAD_FOUND,
    POSITION_INVALID,
)
from flownav.navigation.trust import OF_GPS
from flownav.navigation.verdicts import UNKNOWN_M, Fate, Offer

NAN = math.nan
FITTED = Equipment(True, False, NO_HEADING, False, -math.inf)
TOLD = NavigatorSettingsFile().settings(FITTED)
RUNS = StartMemory(1.0)
NORTH = Attitude(1.0, 0.0, 0.0, 0.0)
QUARTER = Attitude(math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
BESIDE = PositionNed(1.0, 2.0, -3.0)


def reading(*values: float, arrived=1.0) -> Reading:
    return Reading(*values, *[NAN] * (6 - len(values)), NAN, NAN, NAN, 255.0, arrived, 0.0)


def placed(resets) -> list[tuple[int, float]]:
    """Places and values of the states that are reset."""
    return [(reset.state, reset.value) for reset in resets if reset.state >= 0]


# -- GPS -----------------------------------------------------------------------------------------------------
REFUSED = verdicts.Tested(INNOVATION_GATE, 1e3, 1.0, 0.25)
OFTEN = WitnessMemory(times=30.0, since_s=0.0)


def fate(
    tested=REFUSED, axis=1, position=True, flow=None, ranged=None, pad=0.0, arrived=1.0, often=OFTEN,
    agreed_s=-math.inf, agrees_since_s=-math.inf,
):  # fmt: skip
    along = AlongAxis(2.0, 3.0, 0.01, 1.5, agreed_s, agrees_since_s, 0.5, 0.04)
    return judge_fate.law(
        tested, reading(10.0, 20.0, 30.0, arrived=arrived), along, flow or FlowMemory(),
        ranged or RangeMemory(), FixMemory(often, GpsMemory(moved_n_m=1.0, moved_e_m=2.0), PadMemory(pad)), t_s=99.0,
        place=OF_GPS + (axis if position else 3 + axis), s=TOLD.gps,
    )  # fmt: skip


def test_a_position_that_is_refused_for_long_goes_to_the_fix_and_its_lasting_errors_are_forgotten():
    s, found = TOLD.gps, fate()
    assert placed(found.goes) == [(GPS_SLOW + 1, 0.0), (GPS_FAST + 1, 0.0), (POSITION + 1, 20.0)]
    lasting = s.gps_slow_sigma_m**2 + s.gps_fast_sigma_m**2
    assert found.goes[2].variance == pytest.approx(lasting + 0.25)
    assert found.event == (GPS_RESET, 18.0)
    assert (found.memory.gps.moved_n_m, found.memory.gps.moved_e_m) == (1.0, 20.0)
    assert found.memory.witness.times == 0.0


def test_a_velocity_that_is_refused_for_long_goes_to_the_fix_and_moves_no_position():
    found = fate(axis=2, position=False)
    assert placed(found.goes) == [(GPS_VELOCITY + 2, 0.0), (VELOCITY + 2, 30.0)]
    assert found.goes[2].variance == pytest.approx(TOLD.gps.gps_velocity_sigma_down_m_s**2 + 0.25)
    assert found.event == (GPS_RESET, 27.0)
    assert (found.memory.gps.moved_n_m, found.memory.gps.moved_e_m) == (1.0, 2.0)


@pytest.mark.parametrize("position", [True, False])
def test_what_leapt_along_down_is_not_followed_while_the_range_holds_the_height(position):
    """A range that is refused too holds nothing, and neither does flow; what crept is followed."""
    leapt = WitnessMemory(times=30.0, since_s=80.0, fused_s=79.0, leapt=1.0)
    held, refused = RangeMemory(taken_s=98.9), RangeMemory(taken_s=98.9, refused_s=90.0)
    assert placed(fate(axis=2, position=position, ranged=held, often=leapt).goes) == []
    assert placed(fate(axis=2, position=position, ranged=refused, often=leapt).goes)
    assert placed(fate(axis=2, position=position, flow=FlowMemory(taken_s=98.9), often=leapt).goes)
    assert placed(fate(axis=1, position=position, ranged=held, often=leapt).goes)
    crept = leapt._replace(leapt=0.0)
    assert placed(fate(axis=2, position=position, ranged=held, often=crept).goes)
    first = fate(axis=2, position=position, ranged=held, often=WitnessMemory(fused_s=97.6))
    late = fate(axis=2, position=position, ranged=held, often=WitnessMemory(fused_s=97.4))
    assert (first.memory.witness.leapt, late.memory.witness.leapt) == (1.0, 0.0)


DOUBTED = FlowMemory(taken_s=98.9, doubted=1.0)  # flow that carries the state, and is doubted
LEAPT = WitnessMemory(times=300.0, since_s=35.0, fused_s=34.8, leapt=1.0)  # JUMPED_S ago, and a moment before fused


def test_a_position_whose_velocity_agrees_is_off_itself_and_its_slow_error_takes_it():
    """The position and the pad stay, the level holds nothing of it, and no reset is written."""
    found = fate(often=LEAPT, agreed_s=98.8, flow=DOUBTED, pad=LEFT)
    assert placed(found.goes) == [(GPS_SLOW + 1, 1001.5)]
    assert found.goes[0].variance == pytest.approx(TOLD.gps.gps_slow_sigma_m**2)
    assert found.event.kind == -1
    assert not found.pad_goes
    assert found.tie.reason == SILENT
    assert (found.memory.gps.moved_n_m, found.memory.gps.moved_e_m) == (1.0, 2.0)
    assert (found.memory.witness.times, found.memory.witness.fused_s) == (0.0, 99.0)
    early = fate(often=LEAPT._replace(since_s=40.0), agreed_s=98.8, flow=DOUBTED)
    assert placed(early.goes) == []
    assert early.memory.witness.fused_s == 34.8


def test_who_is_off_is_decided_by_flow_where_the_velocity_is_silent_or_was_refused_itself():
    flows, slow, all_of_it = FlowMemory(taken_s=98.9), [GPS_SLOW + 1], [GPS_SLOW + 1, GPS_FAST + 1, POSITION + 1]

    def gone(**case) -> list[int]:
        return [state for state, _ in placed(fate(often=LEAPT, **case).goes)]

    assert gone(flow=flows) == slow
    assert gone(agreed_s=97.0, flow=DOUBTED) == all_of_it
    assert gone(agreed_s=98.8, agrees_since_s=35.0, flow=DOUBTED) == all_of_it
    assert gone(agreed_s=98.8, agrees_since_s=34.0, flow=DOUBTED) == slow


def test_a_receiver_alone_is_followed_where_no_flow_carries_the_state():
    all_of_it = [GPS_SLOW + 1, GPS_FAST + 1, POSITION + 1]
    for flow in (FlowMemory(), FlowMemory(taken_s=97.4), FlowMemory(taken_s=97.4, doubted=1.0)):
        found = fate(often=LEAPT, agreed_s=98.8, flow=flow)
        assert [state for state, _ in placed(found.goes)] == all_of_it
    assert [state for state, _ in placed(fate(axis=2, often=LEAPT, agreed_s=98.8, flow=DOUBTED).goes)] != [GPS_SLOW + 2]
    held = RangeMemory(taken_s=97.6, refused_s=60.0)
    found = fate(axis=2, often=LEAPT, agreed_s=98.8, ranged=held)
    assert [state for state, _ in placed(found.goes)] == [GPS_SLOW + 2]


def test_what_a_velocity_could_have_moved_unseen_is_no_fault_of_the_receiver():
    """0.1 m/s for 20 s are 2 m; the gate of 5 sigma of them and of 1 m is 11.2 m."""
    quiet = WitnessMemory(fused_s=79.0)
    silent = fate(verdicts.Tested(INNOVATION_GATE, 11.4, 1.0, 0.25), often=quiet, flow=FlowMemory(taken_s=98.9))
    assert silent.memory.witness.leapt == 0.0  # flow, which may have failed meanwhile
    for innovation_m, blamed in ((11.0, 0.0), (11.4, 1.0), (-11.4, 1.0)):
        refused = verdicts.Tested(INNOVATION_GATE, innovation_m, 1.0, 0.25)
        for often in (quiet, quiet._replace(times=3.0, since_s=80.0)):
            assert fate(refused, often=often, agreed_s=98.8, flow=DOUBTED).memory.witness.leapt == blamed
        later = fate(refused, often=quiet._replace(times=3.0, since_s=80.0, leapt=1.0))
        assert later.memory.witness.leapt == 1.0


def test_an_axis_that_is_refused_for_the_others_sake_alone_does_not_count():
    found = fate(verdicts.Tested(INNOVATION_GATE, 0.1, 1.0, 0.25))
    assert placed(found.goes) == []
    assert found.memory.witness.times == 0.0
    assert fate(arrived=0.0).memory.witness == OFTEN


@pytest.mark.parametrize(("pad", "flow", "goes"), [
    (LEFT, FlowMemory(), True), (0.0, FlowMemory(), False), (LEFT, FlowMemory(doubted=1.0), False),
    (LEFT, FlowMemory(wrong_s=98.0), False),
])  # fmt: skip
def test_the_pad_goes_along_with_the_position_where_it_is_known_and_nobody_doubts_the_flow(pad, flow, goes):
    found = fate(pad=pad, flow=flow)
    assert found.pad_goes == goes
    assert found.pad == ((PAD + 1, 20.5, UNKNOWN_M**2) if goes else (-1, 20.5, UNKNOWN_M**2))
    assert found.tie == (Offer(0.5, 0.04, FUSED) if goes else Offer(0.0, 1.0, SILENT))


def test_gps_tells_where_north_or_east_is_fused():
    for axis, reason, told_s in ((0, FUSED, 99.0), (1, FUSED, 99.0), (2, FUSED, -math.inf), (0, SILENT, -math.inf)):
        assert fate(verdicts.Tested(reason, 0.0, 1.0, 1.0), axis=axis).memory.gps.last_fix_s == told_s


def test_the_level_ratio_is_the_larger_of_north_and_east_of_one_fix():
    def ratio(innovation: float, axis: int, before: float, reason: int = FUSED) -> float:
        tested = verdicts.Tested(reason, innovation * TOLD.gps.gate_sigma, 1.0, 1.0)
        return float(compare_level.law(tested, LevelMemory(before), axis=axis, gate_sigma=TOLD.gps.gate_sigma).ratio)

    assert ratio(2.0, 0, 9.0) == pytest.approx(4.0)  # that of the fix before does not count
    assert ratio(1.0, 1, 4.0) == 4.0
    assert ratio(3.0, 1, 4.0) == pytest.approx(9.0)
    assert ratio(3.0, 1, 4.0, SILENT) == 4.0


# -- aids ----------------------------------------------------------------------------------------------------
def test_an_aid_ends_dead_reckoning_and_says_after_how_long():
    fresh = AidMemory(4.0, 2.0, 1.0, 1.0)
    aided = note_aid.law(Fate(FUSED), fresh, t_s=9.0)
    assert (aided.aid, aided.again) == (AidMemory(9.0, 0.0, 1.0, 1.0), (AIDED_AGAIN, 5.0))
    assert note_aid.law(Fate(INNOVATION_GATE), fresh, t_s=9.0).aid == fresh
    assert note_aid.law(Fate(FUSED), AidMemory(4.0), t_s=9.0).again.kind < 0
    assert note_height.law(Fate(FUSED), fresh, t_s=9.0) == fresh._replace(height_s=9.0)
    assert note_height.law(Fate(SILENT), fresh, t_s=9.0) == fresh


def test_what_is_not_aided_reckons_and_is_then_invalid():
    s, told, aid = TOLD.aid, [], AidMemory(0.0)
    for t_s in (0.5 * s.dead_reckoning_s, s.dead_reckoning_s + 0.1, s.dead_reckoning_s + 0.2, s.invalid_s + 0.1):
        found = note_aid_age.law(aid, t_s=t_s, s=s)
        told += [event.kind for event in (found.reckoning, found.invalid) if event.kind >= 0]
        aid = found.aid
    assert told == [DEAD_RECKONING, POSITION_INVALID]
    assert aid.flag == 2.0
    assert note_aid_age.law(AidMemory(), t_s=1e9, s=s).aid.flag == 0.0  # not before the start
    at_once = note_aid_age.law(AidMemory(0.0), t_s=1e9, s=s)
    assert (at_once.reckoning.kind, at_once.invalid.kind) == (DEAD_RECKONING, POSITION_INVALID)


# -- the pad -------------------------------------------------------------------------------------------------
LENS = TOLD.place._replace(pad_forward_m=0.5, pad_right_m=0.0, pad_below_m=0.0)


def looked(fixes, m):
    """The results of `find_pad` of these fixes (forward, right, distance), one after the other."""
    found = []
    for fix in fixes:
        found.append(find_pad.law(reading(*fix), RUNS, BESIDE, QUARTER, m, s=LENS))
        m = found[-1].pad
    return found


def test_a_pad_that_fixes_see_at_one_place_is_found_there_by_the_last_of_them():
    fixes = [(0.0, 0.0, 4.0 + 0.01 * k) for k in range(int(FIXES_THAT_FIND) + 1)]
    *before, last, after = looked(fixes, PadMemory(LEFT))
    assert [(one.pad.known, placed(one.place), one.found.kind) for one in before] == [(LEFT, [], -1)] * len(before)
    assert last.pad.known == SEEN
    away = 0.01 * (FIXES_THAT_FIND - 1)
    assert placed(last.place) == [
        (PAD, pytest.approx(1.0)),
        (PAD + 1, pytest.approx(2.5)),
        (PAD + 2, pytest.approx(1.0 + away)),
    ]
    assert last.found == (PAD_FOUND, pytest.approx(math.sqrt(1.0 + 6.25 + (1.0 + away) ** 2)))
    assert (after.pad.known, placed(after.place), after.found.kind) == (SEEN, [], -1)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_fixes_that_see_something_elsewhere_each_time_find_no_pad(axis):
    """From 4 m places agree within 0.6 m: 0.55 m apart they do, 0.65 m apart they do not."""
    for apart_m, known in ((0.55, SEEN), (0.65, LEFT)):
        fixes = np.tile([0.0, 0.0, 4.0], (8, 1))
        fixes[1::2, axis] += apart_m if axis == 2 else apart_m / 4.0
        if axis < 2:
            fixes[1::2, 2] = 4.0 * math.sqrt(1.0 + (apart_m / 4.0) ** 2)
        assert looked(fixes, PadMemory(LEFT))[-1].pad.known == known


def test_a_fix_that_cannot_be_used_neither_agrees_nor_interrupts():
    before = looked([(0.0, 0.0, 4.0)], PadMemory(LEFT))[-1].pad
    assert looked([(0.0, 0.0, 0.0)], before)[-1].pad == before


def test_a_fix_corrects_nothing_before_the_pad_is_found():
    seen = (reading(0.1, -0.2, 4.0), RUNS, VelocityNed(0.0, 0.0, 0.0), ImuMemory(), LevelMemory())
    for pad, expected in ((PadMemory(LEFT), DATUM), (PadMemory(0.0), DATUM), (PadMemory(SEEN), FUSED)):
        judged = judge_sight.law(*seen, pad, component=1, alone=True, s=TOLD.place)
        assert judged.offer.reason == expected


def test_the_law_of_a_pad_fix_reads_all_of_it_and_what_one_component_refuses_none_is_fused_of():
    seen = (reading(0.1, -0.2, 4.0), RUNS, VelocityNed(0.0, 0.0, 0.0), ImuMemory())
    pad = PadMemory(SEEN)
    judged = judge_sight.law(*seen, LevelMemory(0.9), pad, component=1, alone=False, s=TOLD.place)
    assert (judged.offer.measured, judged.offer.reason, judged.sight) == (-0.2, FUSED, (0.1, -0.2, 4.0))
    for component in range(3):
        apart = judge_sight.law(*seen, LevelMemory(1.1), pad, component=component, alone=False, s=TOLD.place)
        alone = judge_sight.law(*seen, LevelMemory(1.1), pad, component=component, alone=True, s=TOLD.place)
        assert (apart.offer.reason, alone.offer.reason) == (INNOVATION_GATE, FUSED)


def refused(fixes, m):
    """The memory after these fixes, each refused by the filter."""
    for fix in fixes:
        m = count_refusals.law(Fate(INNOVATION_GATE), looked([fix], m)[0].pad)
    return m


def test_a_pad_that_is_seen_at_one_other_place_again_and_again_is_not_where_it_was_seen_first():
    elsewhere = [(0.5, 0.0, 4.0)] * int(MANY_STRAYS)
    assert refused(elsewhere[:-1], PadMemory(SEEN)).known == SEEN
    m = refused(elsewhere, PadMemory(SEEN))
    assert m.known == LEFT
    assert looked(elsewhere[:1], m)[0].pad.known == SEEN  # the next of them finds it there


def test_false_fixes_all_over_the_view_move_no_pad():
    rng = np.random.default_rng(8)
    level = np.column_stack([1.7 * np.cos(2.4 * np.arange(40)), np.sin(2.4 * np.arange(40)), rng.uniform(3.9, 4.1, 40)])
    assert refused(level, PadMemory(SEEN)).known == SEEN


def test_a_fix_that_is_fused_ends_the_count_and_one_that_is_not_there_does_not():
    m = PadMemory(SEEN, 3.0)
    assert count_refusals.law(Fate(FUSED), m).agreeing == 0.0
    assert count_refusals.law(Fate(SILENT), m).agreeing == 3.0


@pytest.mark.parametrize(("known", "off_m", "landed", "after", "moves", "stands"), [
    (0.0, 5.0, 1.0, STOOD_ON, True, True),
    (0.0, 5.0, 0.0, NEVER_STOOD, False, False),
    (NEVER_STOOD, 5.0, 1.0, NEVER_STOOD, False, False),  # where it lands is no pad
    (STOOD_ON, 0.05, 1.0, STOOD_ON, False, True),
    (STOOD_ON, 0.15, 1.0, STOOD_ON, True, True),  # carried about
    (STOOD_ON, 0.15, 0.0, LEFT, False, False),
    (LEFT, 5.0, 1.0, LEFT, False, False),
    (SEEN, 5.0, 1.0, SEEN, False, False),
])  # fmt: skip
def test_the_place_of_take_off_is_the_pad_until_a_camera_sees_one(known, off_m, landed, after, moves, stands):
    pad = Pad(BESIDE.pos_n + off_m, BESIDE.pos_e, BESIDE.pos_d)
    found = stand_on_pad.law(reading(landed), RUNS, BESIDE, pad, PadMemory(known, aloft_s=1.0), t_s=6.0)
    assert (found.pad.known, found.stands) == (after, stands)
    assert placed(found.place) == ([(PAD, 1.0), (PAD + 1, 2.0), (PAD + 2, -3.0)] if moves else [])


# -- a heading that is wrong, or sought ------------------------------------------------------------------------
FLOWN = CourseMemory(0.0, 90.0, 90.0, 90.0, 2.0 * LEAST_TRAVEL_M, 9.9, 9.9, 1.0, 0.0)  # v is w, a quarter turn on
PUSHED = PushMemory(0.0, 0.0, 0.0, 0.0, 9.9, 0.0, 4.0, 4.0, 4.0)


def test_where_the_way_says_how_the_heading_errs_it_is_turned_and_sought_no_more():
    found = find_heading.law(reading(0.0, 1.0, 0.0), HeadingMemory(sought=1.0), NORTH, FLOWN, t_s=10.0)
    assert found.attitude == pytest.approx(QUARTER)
    assert (found.heading.sought, found.found) == (0.0, (HEADING_FOUND, pytest.approx(0.5 * math.pi)))
    assert found.reset.state == ATTITUDE + 2
    assert math.isnan(found.reset.value)
    assert found.reset.variance == FOUND_RAD**2


def test_a_heading_that_is_not_sought_stays_and_so_does_one_whose_way_was_short():
    known = find_heading.law(reading(0.0, 1.0, 0.0), HeadingMemory(), NORTH, FLOWN, t_s=10.0)
    assert known == (FLOWN, HeadingMemory(), NORTH, known.reset, known.found)
    assert (known.reset.state, known.found.kind) == (-1, -1)
    short = FLOWN._replace(travel_m=0.5 * LEAST_TRAVEL_M)
    waits = find_heading.law(reading(0.0, 1.0, 0.0), HeadingMemory(sought=1.0), NORTH, short, t_s=10.0)
    assert (waits.attitude, waits.heading.sought, waits.found.kind) == (NORTH, 1.0, -1)
    assert waits.course.travel_m > short.travel_m


def test_a_compass_that_both_witnesses_refute_is_dismissed_and_the_heading_sought_once_more():
    found = check_compass.law(reading(0.0, 1.0, 0.0), HeadingMemory(), NORTH, FLOWN, PUSHED, t_s=10.0)
    assert found.refuted == (COMPASS_REFUTED, pytest.approx(0.5 * math.pi))
    assert (found.heading.refuted, found.heading.sought) == (1.0, 1.0)
    assert found.attitude == pytest.approx(QUARTER)
    assert [reset.state for reset in found.freed] == [ATTITUDE + 2, ATTITUDE, ACCEL_BIAS, ATTITUDE + 1, ACCEL_BIAS + 1]
    assert [reset.value for reset in found.freed if reset.state >= ACCEL_BIAS] == [0.0, 0.0]
    assert 0.0 < found.course.travel_m < LEAST_TRAVEL_M


def test_one_witness_alone_refutes_no_compass():
    other = PUSHED._replace(across=-4.0)
    for push, heading in ((other, HeadingMemory()), (PUSHED, HeadingMemory(refuted=1.0))):
        found = check_compass.law(reading(0.0, 1.0, 0.0), heading, NORTH, FLOWN, push, t_s=10.0)
        assert (found.heading, found.attitude, found.refuted.kind) == (heading, NORTH, -1)
        assert {reset.state for reset in found.freed} == {-1}
    assert found.course == FLOWN  # one that was refuted is not asked again


# -- the start -------------------------------------------------------------------------------------------------
STANDS = StartMemory(force_z=-9.80665, readings=20.0)


def begun(m=STANDS, sensor=Sensor.GPS_POSITION, fitted=FITTED, values=(1.0, 2.0, -3.0)):
    return start_lanes.law(
        reading(*values),
        m,
        AidMemory(flag=2.0),
        HeadingMemory(),
        t_s=5.0,
        sensor=sensor,
        fitted=fitted,
        bias_sigma=0.1,
        rectified=0.1,
    )


def test_a_lane_starts_at_a_fix_or_at_the_origin():
    at_fix = begun()
    assert at_fix.first.starts
    assert at_fix.first.position == (1.0, 2.0, -3.0)
    assert (at_fix.start.started, at_fix.aid.aided_s, at_fix.aid.flag, at_fix.event.value) == (1.0, 5.0, 0.0, 1.0)
    at_origin = begun(sensor=Sensor.FLOW_RATE)
    assert at_origin.first.starts
    assert (at_origin.first.position, at_origin.event.value) == ((0.0, 0.0, 0.0), 0.0)


@pytest.mark.parametrize(("m", "sensor", "values"), [
    (STANDS._replace(started=1.0), Sensor.GPS_POSITION, (1.0, 2.0, -3.0)),
    (STANDS._replace(readings=4.0), Sensor.GPS_POSITION, (1.0, 2.0, -3.0)),
    (STANDS, Sensor.GPS_POSITION, (1.0, 2.0, NAN)),
    (STANDS, Sensor.RANGE, (1.0, 0.0, 0.0)),
    (STANDS, Sensor.LANDED, (0.0, 0.0, 0.0)),
])  # fmt: skip
def test_a_lane_that_runs_knows_no_attitude_or_reads_no_place_does_not_start(m, sensor, values):
    waits = begun(m, sensor, values=values)
    assert not waits.first.starts
    assert (waits.start, waits.aid, waits.heading, waits.event.kind) == (m, AidMemory(flag=2.0), HeadingMemory(), -1)


def test_a_heading_is_sought_where_none_is_read_and_the_start_does_not_define_it():
    lost = FITTED._replace(deadline_s=2.0)
    assert begun(fitted=lost).heading.sought == 1.0
    assert begun().heading.sought == 0.0
    assert begun(STANDS._replace(attitude_s=4.0), fitted=lost).heading.sought == 0.0
    assert (begun().first.scale_unstated, begun(fitted=lost).first.scale_unstated) == (True, False)


def test_a_vehicle_flies_when_it_is_said_to_for_five_seconds_and_a_bounce_is_no_flight():
    pad, m = Pad(0.0, 0.0, 0.0), PadMemory()
    for t_s, landed, known in ((1.0, 0.0, 0.0), (5.5, 0.0, 0.0), (5.7, 1.0, STOOD_ON)):
        m = stand_on_pad.law(reading(landed), RUNS, BESIDE, pad, m, t_s=t_s).pad
        assert m.known == known
    m = PadMemory()
    for t_s, landed, known in ((1.0, 0.0, 0.0), (6.0, 0.0, NEVER_STOOD), (7.0, 1.0, NEVER_STOOD)):
        m = stand_on_pad.law(reading(landed), RUNS, BESIDE, pad, m, t_s=t_s).pad
        assert m.known == known
