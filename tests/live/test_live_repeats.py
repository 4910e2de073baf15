"""Copies of a reading: ArduPilot's streams are faster than its sensors, and stamp each copy anew."""

from __future__ import annotations

import pytest

from flownav.core.measurement import Sensor
from flownav.live.horizon import Source
from flownav.live.repeats import EARLY, LONGEST_S, Repeats
from flownav.logs.mavlink.framing import coder
from recorded_link import arrivals, play

FLOW, RANGE, FIX = Source("OPTICAL_FLOW", 0), Source("DISTANCE_SENSOR", 0), Source("GPS_RAW_INT", 0)
MAV = coder()


def flow(value, height=1.0):
    return MAV.optical_flow_encode(0, 0, 0, 0, value, value, 51, height, value, value)


def taken(repeats, source, messages, step_s, since_s=0.0):
    """Which of a stream's messages are taken."""
    return [not repeats.is_old(message, source, since_s + step_s * k) for k, message in enumerate(messages)]


def test_one_of_five_copies_is_taken_once_the_pace_is_known():
    """10 Hz sent at 50, and a height of the filter's that differs in each copy."""
    messages = [flow(0.01 * (k // 5), 1.0 + 0.001 * k) for k in range(500)]
    found = taken(Repeats(), FLOW, messages, 0.02)
    assert found[::5] == [True] * 100
    assert sum(found[100:]) == 80


def test_a_sensor_that_reads_the_same_is_heard_at_its_own_pace():
    """On the ground nothing moves: copies go, and readings do not."""
    repeats = Repeats()
    taken(repeats, FLOW, [flow(0.01 * (k // 5)) for k in range(100)], 0.02)
    found = taken(repeats, FLOW, [flow(9.0)] * 500, 0.02, since_s=2.0)
    assert 80 <= sum(found) <= 112  # ten a second, to within the stream's own step


def test_what_never_changes_is_never_a_copy():
    assert all(taken(Repeats(), FLOW, [flow(0.0)] * 50, 0.02))


def test_a_pace_slower_than_any_sensor_s_is_none():
    """A range that changes once a second stands still; its readings go on."""
    repeats = Repeats()
    messages = [MAV.distance_sensor_encode(0, 5, 4000, 100 + k // 25, 0, 0, 25, 255) for k in range(500)]
    assert all(taken(repeats, RANGE, messages, 0.04))
    assert repeats.usual_s(RANGE) == 0.0
    assert LONGEST_S < 1.0


def test_inertial_readings_of_one_instant_are_one_reading():
    """A flood of 20 000 a second, stamped to the millisecond; what comes a thousand times a second is all taken."""
    repeats, imu = Repeats(), Source("HIGHRES_IMU", 0)
    assert sum(not repeats.is_crowded(imu, 1e-3 * (k // 20)) for k in range(20_000)) == 1000
    assert not any(repeats.is_crowded(imu, 1.0 + 1e-3 * k) for k in range(1000))
    assert not repeats.is_crowded(Source("SCALED_IMU", 0), 1.999)  # each source for itself


def test_a_fix_is_known_by_the_time_of_its_measuring():
    def fix(number, east=0):
        return MAV.gps_raw_int_encode(1_000_000 * number, 3, 470000000, 85000000 + east, 0, 0, 0, 0, 0, 9)

    repeats = Repeats()
    assert taken(repeats, FIX, [fix(1), fix(1), fix(2), fix(2, 1)], 1.0) == [True, False, True, True]


def test_each_source_has_a_pace_of_its_own_and_a_clock_that_goes_back_begins_anew():
    repeats = Repeats()
    messages = [flow(0.01 * (k // 5)) for k in range(100)]
    taken(repeats, FLOW, messages, 0.02)
    assert repeats.usual_s(FLOW) == pytest.approx(0.1)
    assert repeats.usual_s(Source("OPTICAL_FLOW", 1)) == 0.0
    assert taken(repeats, FLOW, messages[:2], 0.02, since_s=-50.0) == [True, True]
    assert EARLY < 1.0


def test_on_the_link_to_ardupilot_flow_is_fused_as_often_as_it_is_measured(data_folder):
    """5745 messages are 1150 readings; each then looks for 100 ms, not 20."""
    frames = arrivals(data_folder / "ardupilot-live" / "flow-noise-silence", 75.0)
    session, _ = play(frames)
    dropped = session.dropped["flow_rate: repeated"]
    read = session.intake.readings[Sensor.FLOW_RATE]
    assert read + dropped == pytest.approx(50.0 * (frames[-1].now_s - frames[0].now_s), rel=0.2)
    assert 3.5 < dropped / read < 4.2
