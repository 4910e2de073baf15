"""One log clock: wraps, reboots, clocks that jump, stamps that stand still, messages without a stamp."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.logs.mavlink.clock import (
    CONFIRMATIONS,
    LONGEST_WAIT_S,
    WRAP_MS_S,
    ClockState,
    Stamp,
    align,
    received_unix_time,
    stamp_of,
    timesync_offset_s,
)
from mavlink_logs import made

BOOT, UNIX, OTHER = (1, 1, "boot"), (1, 1, "unix"), (1, 158, "boot")
UNIX_S = 1.8e9


def run(rows, state=None):
    """Rows (arrival, clock or None, stamp[, wrap]) through the aligner: the state and what each became."""
    state = state or ClockState(BOOT)
    results = []
    for arrival, clock, *stamp in rows:
        state, aligned = align(state, arrival, Stamp(clock, *stamp) if clock else None)
        results.append(aligned)
    return state, results


def times(rows, state=None):
    return [aligned.t_s for aligned in run(rows, state)[1]]


def test_the_autopilots_stamps_are_the_log_clock_whatever_the_link_does():
    assert times([(100.0, BOOT, 5.0), (100.9, BOOT, 5.1), (100.91, BOOT, 5.2)]) == [5.0, 5.1, 5.2]


@given(
    st.lists(st.floats(0.001, 0.5), min_size=1, max_size=30), st.lists(st.floats(0.0, 3.0), min_size=30, max_size=30)
)
def test_any_latency_leaves_the_stamps(steps, latency):
    stamps = [10.0 + sum(steps[: i + 1]) for i in range(len(steps))]
    assert times([(s + wait, BOOT, s) for s, wait in zip(stamps, latency, strict=False)]) == stamps


def test_nothing_has_a_time_before_the_first_stamp():
    _, (unstamped, other, first) = run([(1.0, None), (1.1, OTHER, 3.0), (1.2, BOOT, 7.0)])
    assert math.isnan(unstamped.t_s)
    assert unstamped.reason == other.reason == "no_clock"
    assert first.t_s == 7.0


def test_an_unstamped_message_follows_its_predecessor():
    rows = [(100.0, BOOT, 5.0), (100.02, None), (99.0, None), (200.0, None)]
    assert times(rows)[1:] == pytest.approx([5.02, 5.0, 5.0 + LONGEST_WAIT_S])


def test_milliseconds_wrap_and_go_on():
    end = WRAP_MS_S
    stamps = [(0.0, end - 0.1), (0.1, end - 0.05), (0.2, 0.05), (0.21, end - 0.01), (0.3, 0.15)]
    rows = [*((arrival, BOOT, stamp, end) for arrival, stamp in stamps), (0.32, BOOT, end + 0.17)]
    _, aligned = run(rows)
    expected = [end - 0.1, end - 0.05, end + 0.05, end - 0.01, end + 0.15, end + 0.17]
    assert [a.t_s for a in aligned] == pytest.approx(expected)
    assert [a.event for a in aligned] == ["", "", "wrapped", "", "", ""]


def test_a_reboot_is_believed_when_confirmed_and_time_goes_on_by_the_arrivals():
    rows = [(100.0, BOOT, 50.0), (100.1, BOOT, 50.1), *((110.0 + 0.1 * i, BOOT, 2.0 + 0.1 * i) for i in range(5))]
    state, aligned = run(rows)
    assert [a.reason for a in aligned] == ["", "", "stale_time", "stale_time", "", "", ""]
    assert [a.event for a in aligned].count("clock_jump") == 1
    assert [a.t_s for a in aligned[4:]] == pytest.approx([60.2, 60.3, 60.4])
    assert state.reference_s == pytest.approx(2.4)


def test_a_reboot_is_believed_of_messages_that_share_or_shuffle_their_stamps():
    stamps = [2.0, 2.0, 1.98, 2.0, 2.05, 2.05, 2.03, 2.1, 2.1, 2.08]
    rows = [(100.0, BOOT, 50.0), *((110.0 + stamp, BOOT, stamp) for stamp in stamps)]
    _, aligned = run(rows)
    assert [a.reason for a in aligned[1:]] == ["stale_time"] * 7 + [""] * 3
    assert [a.t_s for a in aligned[8:]] == pytest.approx([62.1, 62.1, 62.08])


def test_a_stamp_that_stands_still_is_no_reboot():
    rows = [(0.0, BOOT, 50.0)]
    for i in range(1, 40):
        rows += [(0.1 * i, BOOT, 50.0 + 0.1 * i), (0.1 * i + 0.01, BOOT, 20.0)]
    _, aligned = run(rows)
    assert [a.t_s for a in aligned if not a.reason] == pytest.approx([50.0 + 0.1 * i for i in range(40)])
    assert sum(a.reason == "stale_time" for a in aligned) == 39


def test_an_old_stamp_alone_never_becomes_a_clock():
    rows = [(0.0, BOOT, 50.0), *((0.1 * i, BOOT, 20.0) for i in range(1, 20))]
    assert [a.reason for a in run(rows)[1][1:]] == ["stale_time"] * 19


def test_a_late_reading_keeps_its_time_and_holds_nothing_back():
    assert times([(0.0, BOOT, 50.0), (0.1, BOOT, 49.5), (0.1, None), (0.2, BOOT, 50.1)]) == pytest.approx(
        [50.0, 49.5, 50.1, 50.1]
    )


def test_an_arrival_clock_that_jumps_or_stands_still_does_no_harm():
    jumps = [(100.0, BOOT, 5.0), (9000.0, BOOT, 5.1), (0.0, BOOT, 5.2), (0.0, BOOT, 5.3), (1e9, BOOT, 5.4)]
    assert times(jumps) == [5.0, 5.1, 5.2, 5.3, 5.4]
    assert times([*jumps, (0.0, None)])[-1] == 5.4


def test_a_pause_of_the_log_is_a_pause():
    assert times([(100.0, BOOT, 5.0), (400.0, BOOT, 305.0)]) == [5.0, 305.0]


def test_a_jump_ahead_of_the_vehicles_clock_is_closed():
    rows = [(100.0, BOOT, 5.0), *((100.1 + 0.1 * i, BOOT, 5000.0 + 0.1 * i) for i in range(4))]
    _, aligned = run(rows)
    assert [a.reason for a in aligned[1:CONFIRMATIONS]] == ["stale_time"] * (CONFIRMATIONS - 1)
    assert [a.t_s for a in aligned[CONFIRMATIONS:]] == pytest.approx([5.3, 5.4])


def test_a_reboot_beside_a_damaged_arrival_time_does_not_add_years():
    rows = [(0.0, BOOT, 50.0), *((1.8e9 + 0.1 * i, BOOT, 1.0 + 0.1 * i) for i in range(5))]
    assert times(rows)[-1] == pytest.approx(50.2)


@given(st.lists(st.floats(0.0, 0.2), min_size=40, max_size=40))
def test_another_clock_is_laid_on_ours_by_the_least_wait(waits):
    """Our own messages arrive at once; the other's wait. Its times are then never early, and late by the least wait."""
    rows, expected = [], []
    for i, wait in enumerate(waits):
        t = 10.0 + 0.25 * i
        rows += [(t, BOOT, t), (t + wait, OTHER, t - 7.0)]
        expected.append(t)
    found = times(rows)[1::2]
    for i, (t, true) in enumerate(zip(found, expected, strict=True)):
        assert -1e-9 <= t - true <= min(waits[: i + 1]) + 200e-6 * 10.0 + 1e-9


def test_another_clock_that_restarts_is_laid_anew():
    rows = [(10.0, BOOT, 10.0), (10.0, OTHER, 500.0)]
    for i in range(1, 8):
        rows += [(10.0 + 0.1 * i, BOOT, 10.0 + 0.1 * i), (10.0 + 0.1 * i, OTHER, 1.0 + 0.1 * i)]
    _, aligned = run(rows)
    other = aligned[3::2]
    assert [a.reason for a in other] == ["stale_time"] * 2 + [""] * 5
    assert [a.t_s for a in other[2:]] == pytest.approx([10.3, 10.4, 10.5, 10.6, 10.7])


@pytest.mark.parametrize("back_s", [0.3, 0.5, 1.9])
def test_another_clock_that_is_set_back_a_little_is_laid_anew_within_seconds(back_s):
    """NTP sets a companion's clock: its stamps are none that cannot be, and all of them were late for good."""
    rows = []
    for i in range(400):
        t = 10.0 + 0.01 * i
        rows += [(t, BOOT, t), (t + 0.003, OTHER, 500.0 + t - (back_s if i >= 100 else 0.0))]
    found = times(rows)[1::2]
    true = [10.003 + 0.01 * i for i in range(400)]
    assert found[:100] == pytest.approx(true[:100], abs=1e-3)
    assert found[250:] == pytest.approx(true[250:], abs=5e-3)


def test_unix_stamps_and_system_time():
    waited = times([(10.0, BOOT, 10.0), (10.3, UNIX, UNIX_S)])
    assert waited == pytest.approx([10.0, 10.3])
    state, _ = run([(10.0, BOOT, 10.0)])
    told = received_unix_time(state, UNIX, UNIX_S, 9.5)
    assert times([(10.3, UNIX, UNIX_S + 0.6)], told) == pytest.approx([10.1], abs=3e-4)
    assert received_unix_time(state, UNIX, 0.0, 9.5) == state
    assert received_unix_time(ClockState(BOOT), UNIX, UNIX_S, 9.5) == ClockState(BOOT)


# -- a message's own stamp ---------------------------------------------------------------------------------
def test_stamps_by_their_field():
    assert stamp_of(made("ATTITUDE", time_boot_ms=2500), 1, 1) == Stamp(BOOT, 2.5, WRAP_MS_S)
    assert stamp_of(made("RAW_IMU", time_usec=2_500_000), 1, 1) == Stamp(BOOT, 2.5)
    assert stamp_of(made("RAW_IMU", time_usec=1_800_000_000_000_000), 1, 1) == Stamp(UNIX, UNIX_S)
    assert stamp_of(made("VISION_POSITION_ESTIMATE", usec=2_500_000), 1, 158) == Stamp(OTHER, 2.5)


@pytest.mark.parametrize("name", ["SIM_STATE", "RANGEFINDER", "EXTENDED_SYS_STATE", "GPS_RAW_INT", "ATTITUDE"])
def test_no_stamp_and_zero_are_the_same(name):
    assert stamp_of(made(name), 1, 1) is None


def test_arducopters_flow_is_stamped_in_milliseconds():
    assert stamp_of(made("OPTICAL_FLOW", time_usec=62_500), 1, 1, 62.51) == Stamp(BOOT, 62.5, WRAP_MS_S)
    assert stamp_of(made("OPTICAL_FLOW", time_usec=62_500_000), 1, 1, 62.51) == Stamp(BOOT, 62.5)
    assert stamp_of(made("OPTICAL_FLOW", time_usec=62_500_000), 1, 1) == Stamp(BOOT, 62.5)


def test_timesync_offset_and_its_bound():
    offset, round_trip = timesync_offset_s(tc1_ns=7_010_000_000, ts1_ns=2_000_000_000, now_ns=2_020_000_000)
    assert (offset, round_trip) == pytest.approx((5.0, 0.02))


finite = st.floats(-1e12, 1e12)


@given(st.lists(st.tuples(finite, st.sampled_from([BOOT, UNIX, OTHER, None]), st.floats(0.0, 1e16),
                          st.sampled_from([0.0, WRAP_MS_S])), max_size=40))  # fmt: skip
def test_whatever_arrives_has_a_time_or_a_reason(rows):
    rows = [row if row[1] else row[:2] for row in rows]
    for aligned in run(rows)[1]:
        assert math.isfinite(aligned.t_s) == (aligned.reason == "")
        assert aligned.reason in ("", "no_clock", "stale_time")
