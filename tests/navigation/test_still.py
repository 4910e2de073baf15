"""Standing: the evidence of a window of readings that a vehicle stands, and the corrections that follow."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.compile import ONE_LANE
from flownav.navigation.attitude import AttitudeVariance
from flownav.navigation.kernel_settings import NO_HEADING, Equipment
from flownav.navigation.memory import MEMORY, STILL_CLOCK, new_work, set_lane, store_reading
from flownav.navigation.motion_records import ImuMemory, ImuWindow, SeenWindow, StandMemory
from flownav.navigation.reasons import FUSED, SILENT
from flownav.navigation.records import Reading, StartMemory
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.still import (
    GYRO_FLOOR_RAD_S,
    HOLD_S,
    REST_RAD,
    SETTLE_RAD,
    SLIDING_SIGMA_M_S,
    SLIP_RAD,
    WINDOW_S,
    offer_bias,
    offer_rest,
    stand_turning,
)
from flownav.navigation.usual import LOST_TILT_RAD, USUAL_TILT_RAD, offer_level
from flownav.navigation.verdicts import AxisBias, AxisVelocity
from flownav.navigation.windows import (
    CONTACT_M,
    MOVES,
    QUIET_ACCEL_M_S2,
    QUIET_GYRO_RAD_S,
    RESTS,
    SHAKEN,
    SPAN_SIGMAS,
    STEADY_RANGE_M,
    is_steady,
    judge_standing,
    open_windows,
    spreads,
    watch_flow,
    watch_gps_velocity,
    watch_imu,
    watch_range,
    with_imu,
    with_range,
)

load_imu_window, _ = MEMORY.access(ImuWindow)
load_seen_window, _ = MEMORY.access(SeenWindow)

NAN = math.nan
EMPTY = ImuWindow(*[0.0] * len(ImuWindow._fields))
UNSEEN = SeenWindow()
GROUNDED = SeenWindow(0.20, 0.21, flows=10.0)
BIAS = np.array([0.01, -0.01, 0.02])  # of a gyro [rad/s]
GRAVITY = np.array([0.3, -0.2, -9.8])


def reading(*values: float, **parts: float) -> Reading:
    said = {"quality": 255.0, "arrived": 1.0, "withheld": 0.0} | parts
    return Reading(*values, *[NAN] * (6 - len(values)), NAN, NAN, NAN, **said)


def window(gyro: float, accel: float, turn: np.ndarray = BIAS, count: int = 50) -> ImuWindow:
    """Inertial readings whose spreads are exactly so: alternately above and below their mean."""
    m = EMPTY
    for k in range(count):
        sign = 1.0 if k % 2 == 0 else -1.0
        w = turn + sign * gyro * np.array([0.6, 0.0, 0.8])
        f = GRAVITY + sign * accel * np.array([0.0, 0.8, 0.6])
        m = with_imu(reading(*w.tolist(), *f.tolist()), m)
    return m


QUIET, LOUD = window(0.002, 0.02), window(0.1, 1.0)


# -- windows -------------------------------------------------------------------------------------------------
def test_spreads_are_the_rms_about_the_mean_of_all_axes():
    random = np.random.default_rng(4)
    rows = random.normal([*BIAS, *GRAVITY], [0.01, 0.02, 0.03, 0.4, 0.5, 0.6], (60, 6))
    m = EMPTY
    for row in rows:
        m = with_imu(reading(*row.tolist()), m)
    gyro, accel = spreads(m)
    assert gyro == pytest.approx(np.sqrt(rows[:, :3].var(axis=0).sum()), rel=1e-9)
    assert accel == pytest.approx(np.sqrt(rows[:, 3:].var(axis=0).sum()), rel=1e-9)
    assert m.readings == 60.0
    assert [m.first_q + m.sum_q / 60, m.first_z + m.sum_z / 60] == pytest.approx(rows[:, [1, 5]].mean(axis=0))


def test_small_spreads_are_not_lost_beside_gravity():
    """Of sums of squares themselves, 96 +- 1e-9, nothing would be left."""
    assert spreads(window(1e-9, 1e-8)) == (pytest.approx(1e-9, rel=1e-3), pytest.approx(1e-8, rel=1e-3))
    assert spreads(EMPTY) == (0.0, 0.0)


def test_the_span_of_ranges():
    m = UNSEEN
    for range_m in (0.5, 0.2, 0.3):
        m = with_range(range_m, m)
    assert (m.range_low_m, m.range_high_m) == (0.2, 0.5)
    assert (m.range_m, m.ranges, m.range_jumps) == (0.3, 3.0, pytest.approx(0.3**2 + 0.1**2))
    assert m[5:] == UNSEEN[5:]


# -- verdicts ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("gyro", "seen", "contact_m", "does"), [
    (QUIET, GROUNDED, NAN, RESTS),
    (QUIET, UNSEEN, NAN, RESTS),  # an IMU alone tells it
    (LOUD, GROUNDED, NAN, SHAKEN),
    (LOUD, UNSEEN, NAN, MOVES),  # a loud IMU does not
    (window(0.9 * QUIET_GYRO_RAD_S, 0.9 * QUIET_ACCEL_M_S2), GROUNDED, NAN, RESTS),
    (window(1.1 * QUIET_GYRO_RAD_S, 0.0), GROUNDED, NAN, SHAKEN),
    (window(0.0, 1.1 * QUIET_ACCEL_M_S2), GROUNDED, NAN, SHAKEN),
    (window(0.0, 0.0, np.array([0.0, 0.0, 0.039])), GROUNDED, NAN, RESTS),
    (window(0.0, 0.0, np.array([0.0, 0.0, 0.041])), GROUNDED, NAN, MOVES),  # it turns: no gyro has such a bias
    (window(0.0, 0.0, np.array([0.03, 0.03, 0.03])), GROUNDED, NAN, MOVES),
    (window(0.0, 0.0, count=4), GROUNDED, NAN, MOVES),  # too few to know
    (window(0.0, 0.0, count=5), GROUNDED, NAN, RESTS),
])  # fmt: skip
def test_a_vehicle_rests_where_its_imu_is_quiet_and_its_gyro_reads_no_more_than_a_bias(gyro, seen, contact_m, does):
    assert judge_standing(gyro, seen, contact_m) == does


def ranged(low_m: float, high_m: float) -> SeenWindow:
    return GROUNDED._replace(range_low_m=low_m, range_high_m=high_m)


@pytest.mark.parametrize(("seen", "contact_m", "does"), [
    (ranged(0.30, 0.32), NAN, SHAKEN),
    (ranged(0.30, 0.34), NAN, MOVES),  # it rises
    (ranged(0.36, 0.36), NAN, MOVES),  # it hovers, as far as is known
    (ranged(0.60, 0.62), 0.60, SHAKEN),  # a tall vehicle, whose range at rest was seen
    (ranged(0.60, 0.64), 0.60, MOVES),
    (ranged(0.61, 0.64), 0.60, MOVES),  # steady, but above where it rested
    (ranged(0.30, 0.32), 0.10, SHAKEN),  # what was seen does not lower what is contact for all
    (UNSEEN._replace(flows=10.0), NAN, MOVES),  # without a range nothing shows the contact
    (GROUNDED._replace(flows=0.0), NAN, MOVES),  # nor without flow that it does not slide
    (GROUNDED._replace(flow_u_m_s=0.9), NAN, SHAKEN),  # the sum of ten: 0.09 m/s
    (GROUNDED._replace(flow_u_m_s=1.1), NAN, MOVES),
    (GROUNDED._replace(flow_v_m_s=-1.1), NAN, MOVES),
    (GROUNDED._replace(gps_m_s=0.9), NAN, SHAKEN),
    (GROUNDED._replace(gps_m_s=1.1), NAN, MOVES),
])  # fmt: skip
def test_one_whose_motors_run_stands_where_its_range_is_steady_at_contact_and_its_flow_shows_no_motion(
    seen, contact_m, does
):
    assert judge_standing(LOUD, seen, contact_m) == does


@pytest.mark.parametrize(("seen", "does"), [
    (ranged(0.014, 0.020)._replace(flows=0.0), SHAKEN),  # flow begins as it lifts off
    (ranged(0.014, 0.049)._replace(flows=0.0), MOVES),  # it rises
    (ranged(0.014, 0.020)._replace(flow_u_m_s=5.0), SHAKEN),  # a lens out of focus reads 0.5 m/s
    (ranged(0.045, 0.049)._replace(flow_v_m_s=-5.0), SHAKEN),
    (ranged(0.045, 0.051)._replace(flow_v_m_s=-5.0), MOVES),
    (ranged(0.045, 0.051)._replace(flows=0.0), MOVES),
    (ranged(0.014, 0.020)._replace(gps_m_s=1.1), MOVES),
])  # fmt: skip
def test_nearer_than_any_lens_focuses_the_range_alone_tells_that_a_vehicle_stands(seen, does):
    """Ten flights of a small drone whose flow was logged from lift-off on began with a velocity known to 2 m/s."""
    assert judge_standing(LOUD, seen, NAN) == does


@pytest.mark.parametrize("seen", [
    ranged(2.0, 2.0), GROUNDED._replace(gps_m_s=1.1), GROUNDED._replace(flow_u_m_s=3.1),
    UNSEEN._replace(gps_m_s=5.0), ranged(CONTACT_M + 0.01, CONTACT_M + 0.01),
])  # fmt: skip
def test_a_quiet_imu_is_not_believed_against_a_height_or_a_speed(seen):
    """A glider, a balloon, a vehicle that another carries."""
    assert judge_standing(QUIET, seen, NAN) == MOVES


# -- where no range is received ------------------------------------------------------------------------------------
@pytest.mark.parametrize(("gyro", "last_m", "does"), [
    (QUIET, NAN, RESTS),
    (QUIET, 0.2, RESTS),  # the ground was there
    (QUIET, 3.0, MOVES),  # a hover above what its range reaches
    (LOUD, 0.2, SHAKEN),
    (LOUD, 3.0, MOVES),
    (LOUD, NAN, MOVES),
])  # fmt: skip
def test_where_no_range_is_heard_the_last_one_tells_whether_the_ground_is_there(gyro, last_m, does):
    seen = UNSEEN._replace(flows=10.0, flow_u_m_s=0.5)
    assert judge_standing(gyro, seen, NAN, last_m) == does


def test_ranges_of_one_height_are_steady_whatever_their_noise_and_those_of_a_climb_are_not():
    noise = np.random.default_rng(2).normal(0.0, 0.02, 25)
    for rise_m, steady in ((0.0, True), (0.3, False)):
        m = UNSEEN
        for k, error_m in enumerate(noise):
            m = with_range(0.3 + rise_m * k / len(noise) + error_m, m)
        assert m.range_high_m - m.range_low_m > STEADY_RANGE_M
        assert bool(is_steady(m)) is steady, rise_m
    assert np.ptp(noise) / noise.std() - STEADY_RANGE_M / noise.std() < SPAN_SIGMAS


# -- what a stand teaches ------------------------------------------------------------------------------------------
PLACE = NavigatorSettingsFile().settings(Equipment(True, False, NO_HEADING, False, -math.inf)).place
RUNS, STILL_AT_5_CM = StartMemory(started=1.0), UNSEEN._replace(range_low_m=0.05, range_high_m=0.05)
CALM = AxisVelocity(0.0, 0.01)


def rest(does: float, seen: SeenWindow = STILL_AT_5_CM, velocity: AxisVelocity = CALM, axis: int = 0):
    return offer_rest.law(RUNS, seen, StandMemory(does, 0.05), velocity, ImuMemory(), axis=axis, s=PLACE)


def test_a_stand_is_worth_as_much_however_often_it_is_held():
    assert rest(RESTS).offer.variance == pytest.approx(PLACE.still_sigma_m_s**2 * WINDOW_S / HOLD_S)


def test_who_has_the_ground_below_slides_at_most_and_who_has_not_is_offered_nothing():
    sliding = rest(MOVES)
    assert sliding.offer.reason == FUSED
    assert sliding.offer.variance == pytest.approx(SLIDING_SIGMA_M_S**2 * WINDOW_S / HOLD_S)
    assert rest(MOVES, STILL_AT_5_CM._replace(range_high_m=0.2)).offer.reason == SILENT
    lifted = rest(RESTS, STILL_AT_5_CM._replace(range_high_m=0.5))  # a range contradicts what stood
    assert lifted.offer.reason == SILENT
    assert rest(RESTS, UNSEEN._replace(gps_m_s=2.0)).offer.reason == SILENT


def test_a_velocity_that_standing_contradicts_is_freed_and_the_accelerometer_that_made_it_is_doubted():
    fast = rest(RESTS, velocity=AxisVelocity(3.0, 0.01))
    assert fast.velocity.variance == 9.0
    assert fast.accel[0].variance == pytest.approx((3.0 / HOLD_S) ** 2)
    assert fast.imu.doubt_m_s2 > 0.0
    calm = rest(RESTS)
    assert (calm.velocity.variance, calm.accel[0].variance, calm.imu.doubt_m_s2) == (0.0, 0.0, 0.0)
    in_the_air = rest(SHAKEN, STILL_AT_5_CM._replace(range_high_m=0.3, range_low_m=0.3), AxisVelocity(3.0, 0.01))
    assert in_the_air.velocity.variance == 0.0


@pytest.mark.parametrize("bound", [SLIP_RAD, SETTLE_RAD, REST_RAD])
def test_windows_of_a_stand_add_up_to_one_bound_on_what_it_turned(bound):
    for count in (1, 4, 60):
        told = sum(1.0 / stand_turning(float(n), bound) for n in range(1, count + 1))
        assert 1.0 / math.sqrt(told) == pytest.approx(bound / (count * WINDOW_S))


def taught(does: float, bias: AxisBias, windows: float = 4.0):
    m = StandMemory(does, 0.05, windows=windows)
    return offer_bias.law(RUNS, QUIET, STILL_AT_5_CM, m, bias, axis=2)


def test_a_bias_is_opened_by_a_real_rest_only():
    wrong = AxisBias(-0.3, 1e-6)
    at_rest, shaken = taught(RESTS, wrong), taught(SHAKEN, wrong)
    assert at_rest.opened.variance == pytest.approx((BIAS[2] - wrong.rad_s) ** 2)
    assert shaken.opened.variance == 0.0
    assert taught(RESTS, AxisBias(BIAS[2], 1e-6)).opened.variance == 0.0
    assert at_rest.offer.variance < 8.0 * GYRO_FLOOR_RAD_S**2 + stand_turning(4.0, REST_RAD) < shaken.offer.variance


def test_one_quiet_window_is_not_taken_for_a_bias_and_ten_seconds_of_them_are():
    """A rotor that spools up turns a helicopter on its skids by 0.2 deg/s, as quietly as one at rest: heli_sitl."""
    assert taught(RESTS, AxisBias(0.0, 1e-4), windows=1.0).offer.variance > math.radians(0.2) ** 2
    told = sum(1.0 / taught(RESTS, AxisBias(0.0, 1e-4), windows=float(n)).offer.variance for n in range(1, 21))
    assert 1.0 / math.sqrt(told) < math.radians(0.02)
    known = AxisBias(BIAS[2] + math.radians(0.2), math.radians(0.13) ** 2)
    assert taught(RESTS, known, windows=1.0).opened.variance == 0.0


# -- what is usual -------------------------------------------------------------------------------------------------
def test_who_does_not_know_their_tilt_is_level_more_or_less_and_who_does_keeps_it():
    known = AttitudeVariance(*[0.0] * len(AttitudeVariance._fields))
    lost = known._replace(about_n=0.6 * LOST_TILT_RAD**2, about_e=0.6 * LOST_TILT_RAD**2)
    assert offer_level.law(RUNS, lost)[:3] == (0.0, USUAL_TILT_RAD**2, FUSED)
    assert offer_level.law(RUNS, known).reason == SILENT
    assert offer_level.law(StartMemory(), lost).reason == SILENT


# -- what is watched -----------------------------------------------------------------------------------------
def watched(watch, *readings: Reading) -> np.ndarray:
    work = new_work(ONE_LANE)
    open_windows(work, ONE_LANE)
    for one in readings:
        store_reading(work, ONE_LANE, 0, one)
        watch(work, ONE_LANE)
    return work


BAD = ({"arrived": 0.0}, {"withheld": 1.0}, {"quality": 0.0})


def test_only_readings_that_are_some_enter_a_window():
    good = reading(0.2, 0.3)
    bad = [good._replace(**change) for change in BAD] + [reading(NAN, 0.3), reading(math.inf, 0.3)]
    assert load_seen_window(watched(watch_range, *bad, reading(-1.0)), ONE_LANE, 0) == UNSEEN
    assert load_seen_window(watched(watch_range, *bad, good), ONE_LANE, 0)[:2] == (0.2, 0.2)
    assert load_seen_window(watched(watch_gps_velocity, *bad), ONE_LANE, 0) == UNSEEN
    assert load_seen_window(watched(lambda w, n: watch_flow(w, n, False), *bad), ONE_LANE, 0) == UNSEEN
    sound = reading(*BIAS.tolist(), *GRAVITY.tolist())
    broken = (sound._replace(arrived=0.0), sound._replace(withheld=1.0), sound._replace(value_5=NAN))
    assert load_imu_window(watched(watch_imu, *broken), ONE_LANE, 0) == EMPTY
    assert load_imu_window(watched(watch_imu, *broken, sound), ONE_LANE, 0).readings == 1.0


def test_the_fastest_level_velocity_of_gps_counts():
    work = watched(watch_gps_velocity, reading(0.3, 0.4, 9.0), reading(-0.6, 0.8, 0.0), reading(0.0, 0.0, 0.0))
    assert load_seen_window(work, ONE_LANE, 0).gps_m_s == pytest.approx(1.0)


def test_angular_flow_is_a_velocity_by_the_latest_range():
    work = watched(watch_range, reading(0.2))
    store_reading(work, ONE_LANE, 0, reading(0.5, -1.0))
    watch_flow(work, ONE_LANE, True)
    m = load_seen_window(work, ONE_LANE, 0)
    assert (m.flow_u_m_s, m.flow_v_m_s, m.flows) == (pytest.approx(0.1), pytest.approx(-0.2), 1.0)
    watch_flow(work, ONE_LANE, False)  # metric flow is one as it is
    m = load_seen_window(work, ONE_LANE, 0)
    assert (m.flow_u_m_s, m.flow_v_m_s, m.flows) == (pytest.approx(0.6), pytest.approx(-1.2), 2.0)


def test_open_windows_know_nothing():
    work = watched(watch_imu, reading(*BIAS.tolist(), *GRAVITY.tolist()))
    set_lane(work, ONE_LANE, STILL_CLOCK, 0, 1.0)
    open_windows(work, ONE_LANE)
    assert (load_imu_window(work, ONE_LANE, 0), load_seen_window(work, ONE_LANE, 0)) == (EMPTY, UNSEEN)
    fresh = new_work(ONE_LANE)
    assert (load_imu_window(fresh, ONE_LANE, 0), load_seen_window(fresh, ONE_LANE, 0)) == (EMPTY, UNSEEN)


def test_a_range_of_nothing_is_no_contact():
    """A flight beyond the range of its sensor, which says 0, with 1 rad/s of flow: nothing says that it stands."""
    work = watched(watch_range, reading(0.0))
    for _ in range(10):
        store_reading(work, ONE_LANE, 0, reading(1.0, 1.0))
        watch_flow(work, ONE_LANE, True)
    assert judge_standing(LOUD, load_seen_window(work, ONE_LANE, 0), NAN) == MOVES
