"""A receiver whose place leaves its own velocity, by its fixes alone."""

from __future__ import annotations

import math
import random

import pytest

from flownav.core.measurement import Measurement, Sensor
from flownav.live.walking import GOES_M_S, LOOK_S, WALKS_M_S, Walking

NAN3 = (math.nan,) * 3


def fixes(walking, seconds, place, velocity=lambda t_s: (0.0, 0.0), hz=5.0, noise_m=0.0, since_s=0.0, seed=1):
    """When a receiver of 5 Hz was found to walk off; place and velocity are of time."""
    chance, found = random.Random(seed), []
    for k in range(round(seconds * hz)):
        t_s = since_s + k / hz
        north, east = (value + chance.gauss(0.0, noise_m) for value in place(t_s))
        if walking.take(
            Measurement(t_s, Sensor.GPS_POSITION, (north, east, 0.0), NAN3),
            Measurement(t_s, Sensor.GPS_VELOCITY, (*velocity(t_s), 0.0), NAN3),
        ):
            found.append(t_s)
    return found


def walk(north_m_s, east_m_s=0.0, begin_s=10.0):
    return lambda t_s: (north_m_s * max(t_s - begin_s, 0.0), east_m_s * max(t_s - begin_s, 0.0))


@pytest.mark.parametrize(("speed_m_s", "within_s"), [(5.0, 0.8), (2.0, 1.2), (1.0, 1.6), (0.5, 3.0)])
@pytest.mark.parametrize("east", [False, True])
def test_one_that_walks_off_is_found_before_it_is_far(speed_m_s, within_s, east):
    walked = walk(0.0, speed_m_s) if east else walk(speed_m_s)
    found = fixes(Walking(), 20.0, walked)
    assert 10.0 < found[0] <= 10.0 + within_s
    assert found[-1] > 19.5


def test_one_that_flies_is_not():
    """A circle of 20 m at 5 m/s, and noise of half a metre."""

    def place(t_s):
        return 20.0 * math.sin(0.25 * t_s), 20.0 * math.cos(0.25 * t_s)

    def velocity(t_s):
        return 5.0 * math.cos(0.25 * t_s), -5.0 * math.sin(0.25 * t_s)

    assert not fixes(Walking(), 120.0, place, velocity)
    assert len(fixes(Walking(), 600.0, place, velocity, noise_m=0.5)) < 30


def test_noise_hides_a_slow_walk_and_not_a_fast_one():
    assert fixes(Walking(), 30.0, walk(2.0), noise_m=0.3)[0] < 13.0


def test_it_is_believed_again_once_it_stands_for_a_look():
    walking = Walking()
    fixes(walking, 20.0, walk(1.0))
    assert walking.walks
    back = fixes(walking, 10.0, lambda t_s: (10.0, 0.0), since_s=20.0)
    assert 0.6 * LOOK_S < back[-1] - 20.0 < LOOK_S + 0.5
    assert GOES_M_S < WALKS_M_S


def test_a_gap_and_a_velocity_that_is_none_begin_anew():
    walking = Walking()
    fixes(walking, 20.0, walk(1.0))
    assert not fixes(walking, 1.0, lambda t_s: (500.0, 0.0), since_s=40.0)
    assert not fixes(Walking(), 20.0, walk(1.0), velocity=lambda t_s: (math.nan, 0.0))
