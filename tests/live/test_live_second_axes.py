"""Quality and refusal of an estimate by either horizontal axis, and round trips of TIMESYNC to their very ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.estimation.states import QUATERNION
from flownav.live.anchor import Base
from flownav.live.answers import RELATIVE_FLOOR_M, RELATIVE_S, as_relative, fault_of, quality_of
from flownav.live.options import Limits
from flownav.live.vehicle_clock import COARSE_S, LONGEST_ROUND_TRIP_S, MOST_UNSEEN_S, VehicleClock
from flownav.logs.mavlink import outgoing as say
from flownav.navigation.kernel_settings import NO_HEADING, Equipment
from flownav.navigation.loop import start_navigator
from flownav.navigation.memory import MEMORY, PROTECTION
from flownav.navigation.records import AidMemory
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tape import empty_tape
from mavlink_logs import made

LIMITS = Limits(sigma_m=4.0, sigma_m_s=2.0, protection_m=20.0, dead_reckoning_s=2.0, sigma_down_m=6.0)
SIZES = {0: 1.0, 1: 2.0, 2: 3.0}  # standard deviation of each axis in turn


def aided(since_s: float = 0.0):
    """A navigator that was last aided at 40 s less `since_s`, and that nothing threatens."""
    on = start_navigator(
        Equipment(True, False, NO_HEADING, False, -math.inf), NavigatorSettingsFile(), empty_tape(1, 1, 1)
    )
    on.work[QUATERNION], on.work[PROTECTION] = 1.0, 0.0
    on.work[MEMORY.row(AidMemory, "aided_s")] = 40.0 - since_s
    return on


def of_axis(axis: int, sigma: float) -> np.ndarray:
    """A covariance (6, 6) in which one axis has a standard deviation, and no other has any."""
    found = np.zeros((6, 6))
    found[axis, axis] = sigma * sigma
    return found


def estimate(pose: np.ndarray, velocity: np.ndarray) -> say.Estimate:
    return say.Estimate(0, (1.0, 2.0, -3.0), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, pose, velocity, 0, 100)


# -- either axis --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("axis", [0, 1])
def test_quality_falls_with_the_position_variance_of_either_horizontal_axis(axis):
    on, none = aided(), np.zeros((6, 6))
    assert quality_of(on, none, none, 40.0, LIMITS) == 100
    assert quality_of(on, of_axis(axis, 1.0), none, 40.0, LIMITS) == 75
    assert quality_of(on, of_axis(axis, 3.0), none, 40.0, LIMITS) == 25
    assert quality_of(on, of_axis(axis, 5.0), none, 40.0, LIMITS, Base(variance_m2=16.0)) == 25
    assert quality_of(on, of_axis(axis, 9.0), none, 40.0, LIMITS) == 1


@pytest.mark.parametrize("axis", [0, 1])
def test_quality_falls_with_the_velocity_variance_of_either_horizontal_axis(axis):
    on, none = aided(), np.zeros((6, 6))
    assert quality_of(on, none, of_axis(axis, 0.5), 40.0, LIMITS) == 75
    assert quality_of(on, none, of_axis(axis, 1.5), 40.0, LIMITS) == 25


def test_quality_is_of_the_nearest_limit_and_protection_counts_beyond_its_base():
    on, none = aided(since_s=0.5), np.zeros((6, 6))
    assert quality_of(on, of_axis(0, 0.4), none, 40.0, LIMITS) == 75  # a quarter of the patience is the nearest
    on.work[PROTECTION] = 12.0
    assert quality_of(on, none, none, 40.0, LIMITS) == 40
    assert quality_of(on, none, none, 40.0, LIMITS, Base(protection_m=4.0)) == 60
    on.work[PROTECTION] = math.nan
    assert quality_of(on, none, none, 40.0, LIMITS) == 1


@pytest.mark.parametrize(("axis", "reason"), [(0, "uncertain"), (1, "uncertain"), (2, "uncertain_down")])
def test_an_estimate_is_refused_by_any_axis_of_its_position(axis, reason):
    limit = LIMITS.sigma_down_m if axis == 2 else LIMITS.sigma_m
    none = np.zeros((6, 6))
    assert fault_of(estimate(of_axis(axis, 0.99 * limit), none), LIMITS) == ""
    assert fault_of(estimate(of_axis(axis, 1.01 * limit), none), LIMITS) == reason


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_estimate_is_refused_by_any_axis_of_its_velocity_and_by_none_of_its_rates(axis):
    none = np.zeros((6, 6))
    assert fault_of(estimate(none, of_axis(axis, 0.99 * LIMITS.sigma_m_s)), LIMITS) == ""
    assert fault_of(estimate(none, of_axis(axis, 1.01 * LIMITS.sigma_m_s)), LIMITS) == "too_fast"
    assert fault_of(estimate(none, of_axis(3 + axis, 2.0 * LIMITS.sigma_m_s)), LIMITS) == ""


def test_a_relative_place_has_the_drift_of_a_second_on_every_axis():
    velocity = sum(of_axis(axis, size) for axis, size in SIZES.items())
    pose = as_relative(estimate(np.full((6, 6), 7.0), velocity)).pose_covariance
    expected = [(RELATIVE_S * size) ** 2 + RELATIVE_FLOOR_M**2 for size in SIZES.values()]
    np.testing.assert_allclose(np.diag(pose)[:3], expected)
    assert not pose[:3, 3:].any()
    assert not pose[3:, :3].any()
    assert (pose[3:, 3:] == 7.0).all()


# -- round trips --------------------------------------------------------------------------------------------------
def clock_of(wait_s: float = 0.0) -> VehicleClock:
    """The clock of a vehicle whose time since boot is ours and 50 s, received for a second over a link."""
    clock = VehicleClock(1, 1)
    for k in range(51):
        clock.stamped(made("ATTITUDE", time_boot_ms=round(1e3 * (50.0 + 0.02 * k))), 1, 1, 0.02 * k + wait_s)
    return clock


def refuses(clock: VehicleClock, off_s: float, round_trip_s: float) -> bool:
    """Whether an exchange whose middle says that the vehicle's clock is `off_s` further on is refused."""
    before, asked_s = clock.counts["timesync_refused"], 2.0
    now_s = asked_s + round_trip_s
    theirs_s = 50.0 + 0.5 * (asked_s + now_s) + off_s
    clock.exchanged(round(1e9 * theirs_s), round(1e9 * asked_s), now_s)
    return clock.counts["timesync_refused"] > before


@pytest.mark.parametrize("round_trip_s", [0.1, 0.2, 0.4])
def test_an_exchange_may_be_early_by_half_its_round_trip_and_no_more(round_trip_s):
    """Its error is at most half the round trip; stamps are as coarse as COARSE_S."""
    early_s = 0.5 * round_trip_s + COARSE_S
    assert not refuses(clock_of(), -early_s + 0.002, round_trip_s)
    assert refuses(clock_of(), -early_s - 0.002, round_trip_s)


@pytest.mark.parametrize("round_trip_s", [0.1, 0.2, 0.4])
def test_an_exchange_may_be_late_by_a_whole_round_trip_and_the_age_of_a_reading(round_trip_s):
    late_s = round_trip_s + MOST_UNSEEN_S
    assert not refuses(clock_of(), late_s - 0.002, round_trip_s)
    assert refuses(clock_of(), late_s + 0.002, round_trip_s)


def test_a_round_trip_is_as_long_as_it_lasted_and_too_long_a_one_is_refused():
    clock = clock_of()
    assert not refuses(clock, 0.0, LONGEST_ROUND_TRIP_S - 0.001)
    assert clock.best(2.5).round_trip_s == pytest.approx(LONGEST_ROUND_TRIP_S - 0.001)
    assert clock.best(2.5).offset_s == pytest.approx(50.0)
    assert refuses(clock, 0.0, LONGEST_ROUND_TRIP_S + 0.001)


def test_of_several_exchanges_the_shortest_serves():
    clock = clock_of()
    for off_s, round_trip_s in ((0.01, 0.2), (0.002, 0.02), (0.03, 0.3)):
        assert not refuses(clock, off_s, round_trip_s)
    assert clock.best(2.5).offset_s == pytest.approx(50.002)
