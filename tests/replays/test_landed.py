"""Landed is a state until take-off, in logs too: a vehicle that stands with its motors running does not run away."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.logs.log import Log
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import HELD_S, ReplayOptions, held
from flownav.replays.session import replay

GRAVITY = 9.80665
END_S = 80.0
LANDED_S = 12.0


def landed(*rows: tuple[float, float]) -> Stream:
    t_s, value = np.array(rows, float).reshape(-1, 2).T
    return Stream.of(Sensor.LANDED, t_s, value[:, None])


def test_a_state_that_is_told_once_is_held_until_the_next_or_the_end():
    stream = held(landed((0.0, 1.0), (3.0, 0.0), (10.0, 1.0)), 12.0)
    assert np.all(np.diff(stream.t_s) > 0.0)
    on_ground = stream.value[:, 0] > 0.5
    assert np.all(on_ground == ((stream.t_s < 3.0) | (stream.t_s >= 10.0)))
    assert np.count_nonzero(~on_ground) == 1
    told = np.array([*stream.t_s[stream.t_s < 3.0], 3.0]), np.array([*stream.t_s[stream.t_s >= 10.0], 12.0])
    for times in told:
        assert np.diff(times).max() <= 1.5 * HELD_S


def test_a_log_that_repeats_the_state_itself_is_taken_as_it_is():
    often = landed(*((0.25 * k, float(k > 40)) for k in range(80)))
    stream = held(often, 20.0)
    assert np.array_equal(stream.t_s, often.t_s)
    assert np.array_equal(stream.value, often.value)
    assert len(held(landed(), 1.0)) == 0


@pytest.fixture(scope="module")
def standing() -> Log:
    """On the ground, motors running: an IMU that shakes by 1 m/s2, GPS for 12 s, and one event that says `landed`."""
    chance = np.random.default_rng(5)
    imu_s = np.arange(0.0, END_S, 0.02)
    force = np.array([0.05, -0.03, -GRAVITY]) + chance.normal(0.0, 1.0, (len(imu_s), 3))
    imu = np.hstack([chance.normal(0.0, 0.1, (len(imu_s), 3)), force])
    gps_s = np.arange(0.0, LANDED_S, 0.2)
    fixes = chance.normal(0.0, 0.3, (len(gps_s), 3))
    compass_s = np.arange(0.0, END_S, 0.1)
    field = np.tile([0.2, 0.0, 0.4], (len(compass_s), 1))
    streams = [
        Stream.of(Sensor.IMU, imu_s, imu),
        Stream.of(Sensor.GPS_POSITION, gps_s, fixes),
        Stream.of(Sensor.GPS_VELOCITY, gps_s, 0.1 * fixes),
        Stream.of(Sensor.MAG, compass_s, field),
        landed((LANDED_S, 1.0)),
    ]
    return Log(Path("standing"), {stream.sensor: stream for stream in streams})


def wander_m(log: Log) -> float:
    """How far the estimate goes after the landing."""
    estimate = replay(log, ReplayOptions(), NavigatorSettingsFile()).estimate
    after = estimate[estimate[:, 0] > LANDED_S, 1:3]
    return float(np.hypot(*(after - after[0]).T).max())


def test_a_vehicle_that_stands_with_its_motors_running_does_not_run_away(standing):
    assert wander_m(standing) < 3.0


def test_without_the_event_it_would(standing):
    streams = {sensor: stream for sensor, stream in standing.streams.items() if sensor != Sensor.LANDED}
    assert wander_m(Log(standing.path, streams)) > 20.0
