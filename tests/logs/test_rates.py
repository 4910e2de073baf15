"""Mean rates over intervals: exact integrals of straight lines, and the turn between two attitudes against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flownav.core.measurement import Sensor, Stream
from flownav.logs.log import attitude_at, attitude_rates, mean_over


def turned(rotations: Rotation, t_s: np.ndarray) -> Stream:
    """Attitudes as a log has them, each quaternion of whatever sign."""
    x, y, z, w = rotations.as_quat().T
    signs = np.where(np.arange(len(t_s)) % 3 == 1, -1.0, 1.0)
    return Stream.of(Sensor.ATTITUDE, t_s, np.column_stack([w, x, y, z]) * signs[:, None])


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.integers(0, 18), st.integers(1, 20))
def test_from_one_sample_to_another_the_mean_of_a_straight_line_is_its_value_in_the_middle(slope, offset, first, count):
    t_s = np.sort(np.random.default_rng(1).uniform(0.0, 10.0, 40))
    start, end = t_s[[first]], t_s[[first + count]]
    found = mean_over(t_s, (offset + slope * t_s)[:, None], start, end)
    assert found[0] == pytest.approx(offset + slope * 0.5 * (start + end), abs=1e-9)


def test_outside_the_samples_the_nearest_one_holds():
    t_s, value = np.array([1.0, 2.0]), np.array([[3.0], [5.0]])
    found = mean_over(t_s, value, np.array([-1.0, 4.0, 0.0]), np.array([0.0, 6.0, 3.0]))
    assert found[:, 0] == pytest.approx([3.0, 5.0, 4.0])


@pytest.mark.parametrize("rate", [(0.5, 0.0, 0.0), (0.0, -1.2, 0.0), (0.3, 0.4, 2.0)])
def test_rates_are_the_turn_between_two_attitudes_in_body_axes(rate):
    t_s = np.arange(0.0, 3.0, 0.1)
    tilted = Rotation.from_euler("zyx", [1.0, 0.4, -0.3])
    attitude = turned(tilted * Rotation.from_rotvec(np.outer(t_s, rate)), t_s)
    found = attitude_rates(attitude, t_s[:-1], t_s[1:])
    assert found == pytest.approx(np.tile(rate, (len(found), 1)), abs=1e-9)


def test_between_two_attitudes_lies_their_middle_whatever_the_signs_of_their_quaternions():
    t_s = np.array([0.0, 1.0, 2.0, 3.0])
    rotations = Rotation.from_rotvec(np.outer(t_s, (0.2, -0.1, 0.3)))
    found = attitude_at(turned(rotations, t_s), np.array([0.5, 1.5, 2.5, 9.0]))
    expected = Rotation.from_rotvec(np.outer([0.5, 1.5, 2.5, 3.0], (0.2, -0.1, 0.3)))
    assert np.linalg.norm(found, axis=1) == pytest.approx(np.ones(4))
    between = (Rotation.from_quat(found[:, [1, 2, 3, 0]]).inv() * expected).magnitude()
    assert between == pytest.approx(np.zeros(4), abs=1e-3)
