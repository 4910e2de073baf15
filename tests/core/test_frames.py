"""Rotations: the group's axioms, Euler angles there and back, rates against finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.core import frames

to_quaternion, to_euler = frames.quaternion_from_euler, frames.euler_from_quaternion
to_rotation, quaternion_rate = frames.rotation_from_quaternion, frames.quaternion_rate
to_earth, to_body = frames.to_earth, frames.to_body

angle = st.floats(-3.1, 3.1)
pitch = st.floats(-1.5, 1.5)
component = st.floats(-10, 10)
vector = st.tuples(component, component, component)
rotations = st.builds(lambda *euler: np.reshape(to_rotation(*to_quaternion(*euler)), (3, 3)), angle, pitch, angle)


@given(rotations)
def test_a_rotation_is_orthonormal_and_keeps_handedness(rotation):
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-14)


@given(rotations, vector)
def test_to_body_undoes_to_earth(rotation, v):
    assert to_body(tuple(rotation.ravel()), *to_earth(tuple(rotation.ravel()), *v)) == pytest.approx(v, abs=1e-13)


@given(angle, pitch, angle)
def test_euler_angles_go_and_come_back(roll, theta, yaw):
    assert to_euler(*to_quaternion(roll, theta, yaw)) == pytest.approx((roll, theta, yaw), abs=1e-7)


@given(angle, pitch, angle)
def test_the_matrix_is_equation_1_with_its_first_entry_corrected(roll, theta, yaw):
    c, s = np.cos, np.sin
    printed = [
        [
            c(theta) * c(yaw),
            c(yaw) * s(theta) * s(roll) - s(yaw) * c(roll),
            c(yaw) * s(theta) * c(roll) + s(yaw) * s(roll),
        ],
        [
            c(theta) * s(yaw),
            s(yaw) * s(theta) * s(roll) + c(yaw) * c(roll),
            s(yaw) * s(theta) * c(roll) - c(yaw) * s(roll),
        ],
        [-s(theta), c(theta) * s(roll), c(theta) * c(roll)],
    ]
    assert np.reshape(to_rotation(*to_quaternion(roll, theta, yaw)), (3, 3)) == pytest.approx(
        np.array(printed), abs=1e-13
    )


@given(angle, st.floats(-1.2, 1.2), angle, vector)
def test_quaternion_rate_is_equations_8_to_10(roll, theta, yaw, rates):
    p, q, r = rates
    euler_rate = np.array(
        [
            p + (q * np.sin(roll) + r * np.cos(roll)) * np.tan(theta),
            q * np.cos(roll) - r * np.sin(roll),
            (q * np.sin(roll) + r * np.cos(roll)) / np.cos(theta),
        ]
    )
    h = 1e-20
    moved = to_quaternion(*(np.array([roll, theta, yaw]) + 1j * h * euler_rate))
    by_complex_step = np.array([value.imag for value in moved]) / h
    assert quaternion_rate(*to_quaternion(roll, theta, yaw), p, q, r) == pytest.approx(by_complex_step, abs=1e-9)


@given(st.tuples(angle, pitch, angle), st.tuples(angle, pitch, angle))
def test_the_product_of_quaternions_is_that_of_their_rotations(first, second):
    a, b = to_quaternion(*first), to_quaternion(*second)
    product = np.reshape(to_rotation(*frames.quaternion_product(a, b)), (3, 3))
    expected = np.reshape(to_rotation(*a), (3, 3)) @ np.reshape(to_rotation(*b), (3, 3))
    assert product == pytest.approx(expected, abs=1e-13)


def test_hamilton_s_units_multiply_as_he_cut_them_into_the_bridge():
    one, i, j, k = (tuple(row) for row in np.eye(4))
    minus_one = tuple(-np.eye(4)[0])
    for left, right, is_ in ((i, i, minus_one), (j, j, minus_one), (k, k, minus_one), (i, j, k), (j, k, i), (k, i, j),
                             (one, k, k), (j, one, j)):  # fmt: skip
        assert frames.quaternion_product(left, right) == is_


@given(st.tuples(angle, st.floats(-1.2, 1.2), angle), st.floats(-1.5, 1.5), st.floats(0.1, 10.0))
def test_a_turn_about_down_adds_to_the_heading_and_its_conjugate_takes_it_back(euler, turn, scale):
    start = to_quaternion(*euler)
    after = frames.turned_about_down(start, turn)
    roll, pitch_, yaw = frames.euler_from_quaternion(*after)
    assert (roll, pitch_) == pytest.approx(frames.euler_from_quaternion(*start)[:2], abs=1e-7)
    assert np.cos(yaw - euler[2] - turn) == pytest.approx(1.0, abs=1e-9)
    assert frames.quaternion_product(after, frames.conjugate(after)) == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-12)
    assert frames.of_unit_length(tuple(scale * part for part in after)) == pytest.approx(after, abs=1e-12)
