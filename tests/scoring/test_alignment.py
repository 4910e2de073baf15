"""A reference turned and shifted onto an estimate: what was done to it is found again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.scoring.reference import Alignment, align, velocity_of

PATH = np.column_stack(
    [np.cos(np.arange(30.0)) * np.arange(30.0), np.sin(0.3 * np.arange(30.0)), 0.1 * np.arange(30.0)]
)


@given(st.floats(-3.1, 3.1), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-9.0, 9.0))
def test_a_turn_and_a_shift_are_undone(yaw, north, east, down):
    placed = Alignment(yaw, (north, east, down))
    path = PATH + np.array([100.0, -20.0, 3.0])
    found = align(placed.moved(path), path)
    assert found.yaw_rad == pytest.approx(yaw, abs=1e-9)
    assert found.shift_ned_m == pytest.approx((north, east, down), abs=1e-6)


def test_a_turn_is_clockwise_seen_from_above():
    north = np.array([[1.0, 0.0, 0.0]])
    assert Alignment(0.5 * np.pi, (0.0, 0.0, 0.0)).turned(north)[0] == pytest.approx((0.0, 1.0, 0.0))


def test_noise_is_left_over_by_the_least_squares():
    random = np.random.default_rng(3)
    noisy = Alignment(0.7, (1.0, 2.0, 3.0)).moved(PATH) + 0.3 * random.standard_normal(PATH.shape)
    best = align(noisy, PATH)

    def squares(one: Alignment) -> float:
        return float(np.sum((noisy - one.moved(PATH)) ** 2))

    for yaw in (-0.01, 0.01):
        assert squares(Alignment(best.yaw_rad + yaw, best.shift_ned_m)) > squares(best)
    for axis in range(3):
        shift = np.array(best.shift_ned_m)
        shift[axis] += 0.01
        assert squares(Alignment(best.yaw_rad, tuple(shift))) > squares(best)


def test_velocity_of_a_straight_path_is_its_slope_up_to_its_ends():
    t_s = np.arange(0.0, 2.0, 0.04)
    assert velocity_of(t_s, np.outer(t_s, (1.0, -2.0, 0.5))) == pytest.approx(np.tile((1.0, -2.0, 0.5), (len(t_s), 1)))


def test_the_yaw_of_a_vehicle_that_stays_is_not_shown():
    random = np.random.default_rng(5)
    stays = 0.05 * random.standard_normal((200, 3))
    wanders = np.cumsum(0.05 * random.standard_normal((200, 3)), axis=0)
    assert not align(wanders, stays).yaw_shown
    assert not align(stays, stays).yaw_shown
    assert align(PATH, PATH).yaw_shown
    unlike = PATH * np.array([[-1.0, 1.0, 1.0]]) + 30.0 * random.standard_normal(PATH.shape)
    assert not align(unlike, PATH).yaw_shown
