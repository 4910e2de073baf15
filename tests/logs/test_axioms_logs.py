"""Invariances of readers, time: a log whose clock is shifted, or wraps, is the same flight; ends are held."""

from __future__ import annotations

import numpy as np
import pytest

from blackbox_logs import AVERAGE_2, INC, LAST_TIME, NULL, PREVIOUS, SIGNED, STRAIGHT_LINE, UNSIGNED, ZERO, BlackboxLog
from flownav.core.frames import quaternion_from_euler
from flownav.core.measurement import Sensor, Stream
from flownav.logs.blackbox.format import headers
from flownav.logs.blackbox.frames import read_frames
from flownav.logs.log import attitude_at, attitude_rates, mean_over

WRAP_US = 1 << 32
STEP_US = 20_000_000  # some three and a half minutes between frames: so a few hundred of them see two wraps


def frames_of(start_us: int, steps_us: list[int]):
    """Frames that begin at such a count of the firmware's clock, with a fix a little before each fifth of them."""
    fields = [("loopIteration", UNSIGNED, INC, NULL), ("time", UNSIGNED, STRAIGHT_LINE, SIGNED),
              *((f"gyroADC[{k}]", SIGNED, AVERAGE_2, SIGNED) for k in range(3)),
              *((f"navPos[{k}]", SIGNED, PREVIOUS, SIGNED) for k in range(3))]  # fmt: skip
    log = BlackboxLog({"Firmware revision": "INAV 7.1.0"}, fields)
    log.gps_fields = [("time", LAST_TIME, UNSIGNED), ("GPS_numSat", ZERO, UNSIGNED)]
    times = start_us + np.cumsum([0, *steps_us])
    chance = np.random.default_rng(3)
    for k, time_us in enumerate(times):
        log.rows.append([k, int(time_us), *chance.integers(-900, 900, 6).tolist()])
    log.gps = [(int(times[k]), [k]) for k in range(5, len(times), 5)]
    content = np.frombuffer(log.content(), np.uint8)
    (header,) = headers(content.tobytes())
    return times, log, read_frames(content, header, frozenset(["time", "gyroADC[0]"]))


@pytest.mark.parametrize("start_us", [0, 5, WRAP_US - 50_000, WRAP_US - 1, WRAP_US // 2, WRAP_US // 2 - 7])
def test_a_blackbox_s_clock_of_32_bits_may_stand_anywhere_when_the_log_begins(start_us):
    times, log, frames = frames_of(start_us, [1000] * 400)
    np.testing.assert_array_equal(np.diff(frames.main["time"]), 1000)
    np.testing.assert_array_equal(frames.main["gyroADC[0]"], [row[2] for row in log.rows])
    assert frames.damaged_bytes == 0
    np.testing.assert_array_equal(frames.main["time"], times)
    np.testing.assert_array_equal(frames.gps["time"], times[frames.gps["GPS_numSat"]])
    assert len(frames.gps["time"]) == 80


def test_a_blackbox_s_clock_may_turn_over_again_and_again():
    times, _, frames = frames_of(1000, [STEP_US] * 700)
    assert times[-1] > 3 * WRAP_US
    np.testing.assert_array_equal(frames.main["time"], times)


def test_a_blackbox_s_frame_that_is_a_little_earlier_turns_no_clock_over():
    times, _, frames = frames_of(WRAP_US - 5000, [1000] * 20 + [-300, 1300] * 20)
    np.testing.assert_array_equal(frames.main["time"], times)


@pytest.mark.parametrize("shift_s", [0.0, 1000.0, -1e6, 2.0**31])
def test_means_and_rates_do_not_hang_on_the_zero_of_time(shift_s):
    rng = np.random.default_rng(2)
    t_s = np.cumsum(rng.uniform(0.01, 0.03, 60)) + shift_s
    value = rng.normal(size=(60, 2))
    start_s = shift_s + rng.uniform(-0.5, 2.0, 30)
    end_s = start_s + rng.uniform(0.01, 0.4, 30)
    rng = np.random.default_rng(2)
    known_s = np.cumsum(rng.uniform(0.01, 0.03, 60))
    rng.normal(size=(60, 2))
    at_zero = mean_over(known_s, value, start_s - shift_s, end_s - shift_s)
    assert mean_over(t_s, value, start_s, end_s) == pytest.approx(at_zero, abs=1e-4)
    q = np.column_stack(np.array([quaternion_from_euler(0.1 * k, 0.05, -0.2 * k) for k in np.linspace(0, 3, 60)]).T)
    rates = attitude_rates(Stream.of(Sensor.ATTITUDE, t_s, q), start_s, end_s)
    known = attitude_rates(Stream.of(Sensor.ATTITUDE, known_s, q), start_s - shift_s, end_s - shift_s)
    assert rates == pytest.approx(known, abs=1e-4)


def test_beyond_its_ends_a_mean_is_that_of_the_end():
    """Whole intervals and parts of them, on either side: as if the first and the last sample had been held for ever."""
    t_s, value = np.array([1.0, 2.0, 3.0]), np.array([[3.0, -1.0], [5.0, 0.0], [1.0, 4.0]])
    long_s, held = np.array([-9.0, 1.0, 2.0, 3.0, 13.0]), np.vstack([value[:1], value, value[-1:]])
    start_s, end_s = np.array([-5.0, -3.0, 0.5, 2.5, 3.5, -1.0]), np.array([-4.0, 1.5, 3.5, 6.0, 9.0, 5.0])
    assert mean_over(t_s, value, start_s, end_s) == pytest.approx(mean_over(long_s, held, start_s, end_s), abs=1e-12)
    for each in mean_over(t_s, value, start_s, end_s).T:
        assert each.min() >= value.min()
        assert each.max() <= value.max()


def test_beyond_its_ends_an_attitude_stands():
    q = np.array([quaternion_from_euler(0.1, 0.2, 0.3), quaternion_from_euler(-0.4, 0.1, 1.0)])
    attitude = Stream.of(Sensor.ATTITUDE, np.array([1.0, 2.0]), q)
    assert attitude_at(attitude, np.array([-5.0, 1.0, 2.0, 50.0])) == pytest.approx(q[[0, 0, 1, 1]])
    assert attitude_rates(attitude, np.array([-3.0, 2.5]), np.array([0.5, 9.0])) == pytest.approx(np.zeros((2, 3)))
