"""Invariances of a live session, time and north: lags and clocks that may begin anywhere, patience that ends,
covariance that turns with the vehicle.
"""

from __future__ import annotations

import errno
import fcntl
import math
import os

import numpy as np
import pymap3d
import pytest

from flownav.core.compile import ONE_LANE
from flownav.core.frames import euler_from_quaternion, quaternion_from_euler, quaternion_product
from flownav.core.measurement import Sensor
from flownav.estimation.states import ATTITUDE, GYRO_BIAS, POSITION, QUATERNION, STATES, VELOCITY
from flownav.live import writing
from flownav.live.answers import LONGEST_AHEAD_S, estimate_of, quality_of, why_withheld
from flownav.live.filtering import ROOM
from flownav.live.horizon import PATIENT_WINDOWS, WINDOW_S, Lags
from flownav.live.options import Limits
from flownav.live.origin import Origin
from flownav.live.vehicle_clock import COARSE_S, FRESH_S, VehicleClock
from flownav.live.vehicle_clock import WINDOW_S as LEADS_S
from flownav.live.writing import HEAD_EVERY_S, LOCK_WAIT_S, SYNC_S, Writer, claim, is_locked, journal_of
from flownav.navigation import waiting
from flownav.navigation.kernel_settings import NO_HEADING, Equipment
from flownav.navigation.loop import start_navigator
from flownav.navigation.memory import CLOCK, MEMORY, PROTECTION
from flownav.navigation.motion_records import ImuMemory
from flownav.navigation.records import AidMemory, StartMemory
from flownav.navigation.rings import Given, Rings, numbers_of
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tape import empty_tape
from mavlink_logs import made
from packed_covariance import pack

ANY_START_S = pytest.mark.parametrize("start_s", [0.0, 1e4, -3600.0, 2.0**32 * 1e-3])


# -- how far streams lag ------------------------------------------------------------------------------------------
@ANY_START_S
def test_a_lag_is_remembered_for_three_to_four_windows_and_then_forgotten(start_s):
    for late_at_s in (0.0, 1.3, 4.9):
        lags, forgotten_s = Lags(), None
        for k in range(400):
            t_s = start_s + 0.1 * k
            lags.received(Sensor.IMU, t_s)
            late = abs(0.1 * k - late_at_s) < 0.04
            lags.received(Sensor.RANGE, t_s - (0.5 if late else 0.1))
            if 0.1 * k > late_at_s + 0.05 and lags.by_sensor[Sensor.RANGE] < 0.4 and forgotten_s is None:
                forgotten_s = 0.1 * k - late_at_s
        assert forgotten_s is not None
        assert (PATIENT_WINDOWS - 1) * WINDOW_S - 0.15 <= forgotten_s <= PATIENT_WINDOWS * WINDOW_S + 0.15


@ANY_START_S
def test_one_that_falls_silent_is_waited_for_as_long_and_no_longer(start_s):
    lags, waited_s = Lags(), 0.0
    for k in range(400):
        lags.received(Sensor.IMU, start_s + 0.1 * k)
        if k < 30:
            lags.received(Sensor.RANGE, start_s + 0.1 * k - 0.4)
        elif Sensor.RANGE in lags.by_sensor:
            waited_s = 0.1 * k - 3.0
            assert lags.horizon_s(0.1, 0.05, 1.0) == pytest.approx(0.45)
    assert (PATIENT_WINDOWS - 1) * WINDOW_S - 0.15 <= waited_s <= PATIENT_WINDOWS * WINDOW_S + 0.15
    assert lags.horizon_s(0.1, 0.05, 1.0) == pytest.approx(0.1)


def test_a_lag_as_long_as_is_waited_for_counts_and_a_longer_one_does_not():
    for lag_s, counts in ((0.99, True), (1.01, False)):
        lags = Lags(most_s=1.0)
        lags.received(Sensor.IMU, 50.0)
        lags.received(Sensor.RANGE, 50.0 - lag_s)
        assert (lags.by_sensor.get(Sensor.RANGE, 0.0) == pytest.approx(lag_s)) is counts
        assert lags.newest_s == 50.0


@ANY_START_S
def test_the_horizon_takes_what_is_of_the_very_instant_that_it_has_released(start_s):
    """Several sensors speak of one instant: the last of them is no later than the first."""
    rings, settings = Rings(ROOM, 9), np.zeros(1000)

    def reading(t_s: float, sensor: Sensor = Sensor.BARO) -> Given:
        return Given(start_s + t_s + 0.25, int(sensor), numbers_of((1.0,), delay_s=0.25))

    assert rings.take(reading(1.0)) == waiting.TAKEN
    assert rings.release(settings, start_s + 1.0).queue.t_s.tolist() == [start_s + 1.0]
    assert rings.take(reading(1.0, Sensor.RANGE)) == waiting.TAKEN
    assert rings.take(reading(0.875, Sensor.RANGE)) == waiting.LATE
    assert rings.release(settings, start_s + 1.0).queue.sensor.tolist() == [Sensor.RANGE]
    assert len(rings) == 0


# -- the vehicle's clock ------------------------------------------------------------------------------------------
def stamped_clock(boot_s: float, ours_s: float, wait_s: float) -> VehicleClock:
    """A vehicle that has been up for boot_s when our clock shows ours_s, received for a second over a link."""
    clock = VehicleClock(1, 1)
    for k in range(50):
        stamp_ms = round((boot_s + 0.02 * k) * 1e3) % 2**32
        clock.stamped(made("ATTITUDE", time_boot_ms=stamp_ms), 1, 1, ours_s + 0.02 * k + wait_s)
    return clock


@pytest.mark.parametrize("boot_s", [5.0, 3600.0, 2.0**32 * 1e-3 - 0.5])
@pytest.mark.parametrize("ours_s", [0.0, 1e5])
@pytest.mark.parametrize("wait_s", [0.0, 0.03])
def test_any_honest_exchange_serves_whichever_way_was_the_slower(boot_s, ours_s, wait_s):
    """Both clocks begin anywhere, the vehicle's turns over in between: offset and time now are of the one instant."""
    for there_s, back_s in ((0.1, 0.0), (0.0, 0.1), (0.05, 0.05), (0.0, 0.0)):
        clock = stamped_clock(boot_s, ours_s, wait_s)
        asked_s = ours_s + 1.0
        tc1_ns = round((boot_s + 1.0 + there_s) * 1e9)  # 64 bits of nanoseconds turn over in centuries
        now_s = asked_s + there_s + back_s
        clock.exchanged(tc1_ns, round(asked_s * 1e9), now_s)
        assert clock.counts["timesync_refused"] == 0, (there_s, back_s)
        assert clock.now_s(now_s) == pytest.approx(boot_s + 1.0 + there_s + back_s, abs=0.5 * (there_s + back_s) + 2e-3)
        assert clock.boot_s(clock.now_s(now_s)) == pytest.approx(clock.now_s(now_s))
        assert clock.counts["clock_jump"] == 0


def test_an_exchange_that_puts_the_clock_before_its_own_stamps_does_not_serve():
    clock = stamped_clock(100.0, 7.0, 0.0)
    lie_s = COARSE_S + 0.01
    clock.exchanged(round((101.0 - lie_s) * 1e9), round(8.0 * 1e9), 8.0)
    assert clock.counts["timesync_refused"] == 1
    assert clock.now_s(8.0) == pytest.approx(101.0, abs=2e-3)


# -- patience of the journal ----------------------------------------------------------------------------------------
class Clock:
    """A clock that goes on only where it is waited on."""

    def __init__(self, start_s: float) -> None:
        self.now_s = self.start_s = start_s

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, for_s: float) -> None:
        self.now_s += for_s


@pytest.mark.parametrize("start_s", [0.0, 1e6])
@pytest.mark.parametrize("looks_for_s", [0.5, 5.0])
def test_one_that_only_looks_at_a_journal_is_waited_for_a_second_and_no_longer(
    tmp_path, monkeypatch, start_s, looks_for_s
):
    clock, real = Clock(start_s), fcntl.flock

    def flock(file: int, operation: int) -> None:
        if operation & fcntl.LOCK_EX and clock.now_s - clock.start_s < looks_for_s:
            raise OSError(errno.EWOULDBLOCK, "somebody looks")
        real(file, operation)

    monkeypatch.setattr(writing, "time", clock)
    monkeypatch.setattr(fcntl, "flock", flock)
    place = claim(tmp_path / "a.fnr", force=False)
    waited_s = clock.now_s - start_s
    assert waited_s == pytest.approx(min(looks_for_s, LOCK_WAIT_S), abs=0.03)
    monkeypatch.setattr(fcntl, "flock", real)
    assert is_locked(journal_of(place.record)) is (looks_for_s < LOCK_WAIT_S)
    os.close(place.file)


@pytest.mark.parametrize("start_s", [0.0, 1e6, -50.0])
def test_a_journal_is_forced_to_the_disk_and_its_head_repeated_on_time_whenever_it_begins(
    tmp_path, monkeypatch, start_s
):
    """Turn by turn of the writing thread, five a second: syncs and heads fall due by what has passed alone."""
    clock, synced, heads = Clock(start_s), [], []
    monkeypatch.setattr(writing, "time", clock)
    monkeypatch.setattr(writing.threading.Thread, "start", lambda self: None)
    monkeypatch.setattr(writing.os, "fsync", lambda file: synced.append(clock.now_s - start_s))
    monkeypatch.setattr(writing, "block", lambda number, said, rows: heads.append("head" in said) or b"x")
    file = os.open(tmp_path / "journal", os.O_WRONLY | os.O_CREAT)
    writer = Writer(file, {"journal": 1})
    turns = 5 * 150
    for k in range(1, turns + 1):
        clock.now_s = start_s + 0.2 * k
        assert not writer.turn(clock.now_s)
    os.close(file)
    waits = np.diff(synced)
    assert waits.min() >= SYNC_S - 1e-6
    assert waits.max() <= SYNC_S + 0.2 + 1e-6
    assert sum(heads) == 1 + int(0.2 * turns / HEAD_EVERY_S)


# -- what is sent -------------------------------------------------------------------------------------------------
def running(heading_rad: float, clock_s: float = 40.0):
    """A navigator whose covariance is of everything with everything, level, with its nose to a heading."""
    on = start_navigator(
        Equipment(True, False, NO_HEADING, False, -math.inf), NavigatorSettingsFile(), empty_tape(1, 1, 1)
    )
    factor = np.random.default_rng(4).normal(size=(STATES, STATES)) * 0.1
    covariance = factor @ factor.T
    pack(on.work, ONE_LANE, 0, STATES, covariance)
    on.work[QUATERNION : QUATERNION + 4] = quaternion_from_euler(0.0, 0.0, heading_rad)
    on.work[CLOCK], on.work[PROTECTION] = clock_s, 2.0
    for record, names in ((StartMemory, {"started": 1.0}), (AidMemory, {"aided_s": clock_s - 0.2}),
                          (ImuMemory, {"read_s": clock_s})):  # fmt: skip
        for name, value in names.items():
            on.work[MEMORY.row(record, name)] = value
    return on, covariance


@pytest.mark.parametrize("heading_rad", [0.0, 0.4, 0.5 * math.pi, -2.3, math.pi])
def test_what_is_sent_of_roll_and_pitch_errs_as_euler_angles_do(heading_rad):
    """The pose's covariance is J P J' with J by finite differences of small turns about the earth's axes."""
    on, covariance = running(heading_rad)
    sent = estimate_of(on, Rings(ROOM, 9).now(on.work, on.settings, 40.0), 40.0, 40.0, 0)
    q, small = quaternion_from_euler(0.0, 0.0, heading_rad), 1e-6
    slopes = np.zeros((6, 6))
    slopes[:3, :3] = np.eye(3)
    for axis in range(3):
        ways = []
        for sign in (1.0, -1.0):
            turn = [1.0, 0.0, 0.0, 0.0]
            turn[1 + axis] = 0.5 * sign * small
            ways.append(np.array(euler_from_quaternion(*quaternion_product(tuple(turn), q))))
        difference = ways[0] - ways[1]
        slopes[3:, 3 + axis] = (difference - 2.0 * math.pi * np.round(difference / (2.0 * math.pi))) / (2.0 * small)
    places = [*range(POSITION, POSITION + 3), *range(ATTITUDE, ATTITUDE + 3)]
    expected = slopes @ covariance[np.ix_(places, places)] @ slopes.T
    np.testing.assert_allclose(sent.pose_covariance, expected, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(
        sent.velocity_covariance[:3, :3], covariance[VELOCITY : VELOCITY + 3, VELOCITY : VELOCITY + 3]
    )
    np.testing.assert_allclose(
        sent.velocity_covariance[3:, 3:], covariance[GYRO_BIAS : GYRO_BIAS + 3, GYRO_BIAS : GYRO_BIAS + 3]
    )


def test_quality_is_of_the_instant_that_is_asked_for():
    """Without aid for longer it is less, and when the filter last ran matters to nobody."""
    limits, none = Limits(), np.zeros((6, 6))
    on, _ = running(0.0)
    found = [quality_of(on, none, none, 39.8 + since_s, limits) for since_s in (0.3, 0.9, 1.2)]
    assert found == [round(100.0 * (1.0 - since_s / limits.dead_reckoning_s)) for since_s in (0.3, 0.9, 1.2)]
    on.work[CLOCK] = 39.9
    assert quality_of(on, none, none, 41.0, limits) == found[2]


@pytest.mark.parametrize("shift_s", [0.0, 1024.0, -8192.0])
def test_nothing_that_withholds_an_estimate_hangs_on_the_zero_of_time(shift_s):
    on, _ = running(0.0, 40.0 + shift_s)
    t_s = 40.0 + shift_s
    for later_s, age_s, why in ((0.0, 0.1, ""), (0.0, 0.31, "stale"), (1.25, 0.1, ""), (1.375, 0.1, "dead_reckoning"),
                                (LONGEST_AHEAD_S + 0.125, 0.1, "stale")):  # fmt: skip
        assert why_withheld(on, t_s + later_s, t_s + later_s - age_s, Limits()) == why


def test_an_exchange_serves_for_as_long_as_crystals_agree():
    """For FRESH_S after it ended, at any zero of our clock; then the stamps' least wait is all there is."""
    for ours_s in (0.0, 1e5):
        clock = stamped_clock(100.0, ours_s, 0.03)
        clock.exchanged(round(101.0 * 1e9), round((ours_s + 1.0) * 1e9), ours_s + 1.0)
        assert clock.best(ours_s + 0.5 + FRESH_S) is not None
        assert clock.now_s(ours_s + 1.5) == pytest.approx(101.5, abs=2e-3)
        assert clock.best(ours_s + 1.5 + FRESH_S) is None
        late_s = ours_s + 1.5 + FRESH_S
        assert clock.now_s(late_s) == pytest.approx(late_s - ours_s + 100.0 - 0.03, abs=2e-3)


def test_the_least_wait_on_the_link_is_forgotten_after_two_windows():
    """A link that has become slower by 40 ms: what it waited before holds for two windows at most."""
    clock, forgotten_s = stamped_clock(100.0, 0.0, 0.0), None
    for k in range(1, 200):
        sent_s = 1.0 + 0.02 * k
        arrives_s = sent_s + 0.04
        clock.stamped(made("ATTITUDE", time_boot_ms=round((100.0 + sent_s) * 1e3)), 1, 1, arrives_s)
        behind_s = 100.0 + arrives_s - clock.now_s(arrives_s)
        if forgotten_s is None and behind_s > 0.035:
            forgotten_s = 0.02 * k
    assert forgotten_s is not None
    assert LEADS_S - 0.05 <= forgotten_s <= 2.0 * LEADS_S + 0.05


@pytest.mark.parametrize("told", [(25.0001, 55.0002, 13.0), (24.9995, 54.9999, 4.0)])
def test_a_place_is_the_same_in_the_navigator_s_frame_and_in_the_autopilot_s(told):
    """The origin that is sent later, north, east and higher or lower: with the offset it is one spot of the earth."""
    origin, fix = Origin(), (25.0, 55.0, 10.0)
    assert origin.fixed(fix) == ""
    assert origin.received(told) == "moved"
    assert origin.received(told) == ""  # again: nothing moves
    for here in ((0.0, 0.0, 0.0), (12.0, -7.0, -3.0)):
        there = np.add(here, origin.offset_ned_m)
        ours, theirs = pymap3d.ned2geodetic(*here, *fix), pymap3d.ned2geodetic(*there, *told)
        assert theirs[:2] == pytest.approx(ours[:2], abs=2e-7)
        assert theirs[2] == pytest.approx(ours[2], abs=0.01)
