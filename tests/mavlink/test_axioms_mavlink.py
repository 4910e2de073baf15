"""Invariances of a vehicle's clock: any start, any number of wraps, and a wrap like no wrap."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.logs.mavlink.clock import WRAP_MS_S, ClockState, Stamp, align, received_unix_time, timesync_offset_s

BOOT, OTHER, UNIX = (1, 1, "boot"), (1, 158, "boot"), (1, 1, "unix")
UNIX_S = 1.8e9


def heard(start_s: float, arrival_s: float, steps: int = 60, step_s: float = 0.5):
    """A vehicle whose count of milliseconds begins here: its log times, and those of a companion's own clock."""
    state, own, beside, events = ClockState(BOOT), [], [], []
    rng = np.random.default_rng(1)
    waits = rng.uniform(0.0, 0.3, (steps, 2))
    for k in range(steps):
        t_s = start_s + step_s * k
        stamp = Stamp(BOOT, round((t_s % WRAP_MS_S) * 1e3) * 1e-3, WRAP_MS_S)
        state, aligned = align(state, arrival_s + step_s * k + waits[k, 0], stamp)
        own.append(aligned.t_s)
        events.append(aligned.event)
        companion = Stamp(OTHER, 50.0 + step_s * k)
        state, aligned = align(state, arrival_s + step_s * k + 0.01 + waits[k, 1], companion)
        beside.append(aligned.t_s)
    return np.array(own), np.array(beside), events, state


@pytest.mark.parametrize("arrival_s", [0.0, 1e6, -400.0])
@pytest.mark.parametrize("start_s", [7.0, WRAP_MS_S - 10.0, WRAP_MS_S - 0.001, WRAP_MS_S - 25.0])
def test_a_flight_through_the_wrap_is_a_flight(start_s, arrival_s):
    own, beside, events, _ = heard(start_s, arrival_s)
    known, known_beside, _, _ = heard(100.0, 0.0)
    np.testing.assert_allclose(own - start_s, known - 100.0, atol=2e-3)
    np.testing.assert_allclose(beside - start_s, known_beside - 100.0, atol=2e-3)
    assert events.count("wrapped") == int(start_s > 1000.0)
    assert "clock_jump" not in events


@pytest.mark.parametrize("step_s", [0.25, 1.75, 8.0])
@pytest.mark.parametrize("start_s", [0.125, 59.5])
def test_a_clock_may_turn_over_again_and_again(start_s, step_s):
    """A count that wraps every minute: a late stamp from before a wrap keeps its time, and turns nothing back."""
    state, wrap_s, wrapped = ClockState(BOOT), 64.0, 0
    for k in range(200):
        t_s = start_s + step_s * k
        state, aligned = align(state, 7.0 + step_s * k, Stamp(BOOT, t_s % wrap_s, wrap_s))
        assert aligned.t_s == pytest.approx(t_s)
        wrapped += aligned.event == "wrapped"
        late_s = t_s - 0.1
        if late_s > start_s:
            state, aligned = align(state, 7.01 + step_s * k, Stamp(BOOT, late_s % wrap_s, wrap_s))
            assert aligned.t_s == pytest.approx(late_s)
            assert aligned.event == ""
    assert wrapped == int((start_s + step_s * 199) / wrap_s)


@pytest.mark.parametrize("start_s", [20.0, WRAP_MS_S - 10.0])
def test_system_time_is_of_the_same_instant_before_and_after_a_wrap(start_s):
    """UNIX stamps that a GPS gives are laid on the log by SYSTEM_TIME, which says the count that has wrapped."""
    own, _, _, state = heard(start_s, 0.0)
    now_s = start_s + 0.5 * 59
    state = received_unix_time(state, UNIX, UNIX_S, now_s % WRAP_MS_S)
    _, aligned = align(state, 0.5 * 59 + 0.9, Stamp(UNIX, UNIX_S + 0.25))
    assert aligned.reason == ""
    assert aligned.t_s == pytest.approx(own[-1] + 0.25, abs=5e-3)


@pytest.mark.parametrize("theirs_s", [5.0, 1e9])
@pytest.mark.parametrize("ours_s", [0.0, 1e6])
def test_an_exchange_tells_the_difference_of_two_clocks_to_half_its_round_trip(theirs_s, ours_s):
    for there_s, back_s in ((0.1, 0.1), (0.3, 0.0), (0.0, 0.2)):
        tc1_ns = round((theirs_s + there_s) * 1e9)
        offset_s, trip_s = timesync_offset_s(tc1_ns, round(ours_s * 1e9), round((ours_s + there_s + back_s) * 1e9))
        assert trip_s == pytest.approx(there_s + back_s)
        assert abs(offset_s - (theirs_s - ours_s)) <= 0.5 * trip_s + 1e-6


@pytest.mark.parametrize("rate", [1.0, 1.0 - 150e-6, 1.0 + 150e-6])
def test_a_companion_s_crystal_that_is_slow_or_fast_is_followed(rate):
    """An hour on, a clock that loses or gains half a second has its messages where they came, to within the wait."""
    state = ClockState(BOOT)
    for k in range(7200):
        t_s = 10.0 + 0.5 * k
        state, _ = align(state, t_s, Stamp(BOOT, t_s, WRAP_MS_S))
        state, aligned = align(state, t_s + 0.01, Stamp(OTHER, 3.0 + rate * 0.5 * k))
        assert aligned.t_s == pytest.approx(t_s + 0.01, abs=0.02)
