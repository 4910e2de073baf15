"""Standing: what a window of readings must show before a vehicle is said to stand, and what that teaches."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.compile import ONE_LANE
from flownav.navigation.memory import MEMORY, STILL_CLOCK, new_work, set_lane, store_reading
from flownav.navigation.motion_records import ImuWindow, SeenWindow
from flownav.navigation.records import Reading
from flownav.navigation.still import (
    CONTACT_M,
    MOVES,
    QUIET_ACCEL_M_S2,
    QUIET_GYRO_RAD_S,
    RESTS,
    SHAKEN,
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
UNSEEN = SeenWindow(1e9, -1.0, 0.0, 0.0, 0.0, 0.0)
GROUNDED = SeenWindow(0.20, 0.21, 0.0, 0.0, 10.0, 0.0)
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
    assert m[2:] == UNSEEN[2:]


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


@pytest.mark.parametrize("seen", [
    ranged(2.0, 2.0), GROUNDED._replace(gps_m_s=1.1), GROUNDED._replace(flow_u_m_s=3.1),
    UNSEEN._replace(gps_m_s=5.0), ranged(CONTACT_M + 0.01, CONTACT_M + 0.01),
])  # fmt: skip
def test_a_quiet_imu_is_not_believed_against_a_height_or_a_speed(seen):
    """A glider, a balloon, a vehicle that another carries."""
    assert judge_standing(QUIET, seen, NAN) == MOVES


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
