"""Invariances of the filter's laws as plain functions: north, scale and time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.frames import (
    of_unit_length,
    quaternion_from_euler,
    quaternion_product,
    rotation_from_quaternion,
    turned_about_down,
)
from flownav.estimation.hypotheses import larger_axis, size_of
from flownav.estimation.lag import Lagged, LagMove, lag_of_step, lag_over, moved_lag, seen_velocity
from flownav.estimation.laws import LEAST_RANGE_M, along_axis, cross, lens_range, turning
from flownav.estimation.laws.flow import body_velocity, flow_rate
from flownav.estimation.motion import errors_in_motion, turned
from flownav.estimation.named import (
    AccelBias,
    Attitude,
    BodyRate,
    FlowMount,
    ForceNed,
    GyroBias,
    GyroLeft,
    Height,
    Lever,
    Middle,
    PositionNed,
    Tilt,
    VelocityNed,
)

SEEDS = pytest.mark.parametrize("seed", range(6))
SMALL = 1e-6


def floats(rng: np.random.Generator, count: int, size: float = 1.0) -> tuple[float, ...]:
    return tuple(float(x) for x in size * rng.normal(size=count))


def attitude(rng: np.random.Generator):
    return quaternion_from_euler(*floats(rng, 2, 0.3), float(rng.uniform(-3.0, 3.0)))


def about_down(vector, angle):
    cosine, sine = math.cos(angle), math.sin(angle)
    return (cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1], *vector[2:])


def tilted(q, about: int, by_rad: float):
    """The attitude after a small turn about an axis of the earth."""
    turn = [1.0, 0.0, 0.0, 0.0]
    turn[1 + about] = 0.5 * by_rad
    return of_unit_length(quaternion_product(tuple(turn), q))


def slope_of(law, q, about: int) -> float:
    """A law's derivative on the attitude's error about an axis, by differences."""
    return (law(tilted(q, about, SMALL)) - law(tilted(q, about, -SMALL))) / (2.0 * SMALL)


# -- slopes ------------------------------------------------------------------------------------------------------
@SEEDS
def test_a_lens_s_range_has_the_slopes_that_it_says_wherever_the_lens_sits(seed):
    """Ahead of the vehicle, beside it and below it at once, in any attitude."""
    rng = np.random.default_rng(seed)
    q, lens, height = attitude(rng), floats(rng, 3, 0.3), 3.0
    range_m, by_height, by_north, by_east = lens_range(rotation_from_quaternion(*q), height, lens)

    def range_of(q, height: float = height) -> float:
        return lens_range(rotation_from_quaternion(*q), height, lens)[0]

    assert (by_north, by_east) == pytest.approx([slope_of(range_of, q, about) for about in (0, 1)], abs=1e-7)
    assert slope_of(range_of, q, 2) == pytest.approx(0.0, abs=1e-7)
    assert by_height == pytest.approx((range_of(q, 3.0 + SMALL) - range_of(q, 3.0 - SMALL)) / (2.0 * SMALL), rel=1e-7)
    assert lens_range(rotation_from_quaternion(*q), 0.0, (0.0, 0.0, 0.0)) == (LEAST_RANGE_M, 0.0, 0.0, 0.0)
    place = np.reshape(rotation_from_quaternion(*q), (3, 3)) @ np.add(lens, (0.0, 0.0, range_m))
    assert place[2] == pytest.approx(height)  # it ends on the ground


@SEEDS
@pytest.mark.parametrize("height", [0.2, 3.0])
def test_what_a_sensor_sees_has_the_slopes_that_it_says_above_and_below_its_sonar_s_floor(seed, height):
    rng = np.random.default_rng(seed)
    q, velocity, swing = attitude(rng), floats(rng, 3), float(rng.normal())
    for channel in (0, 1):

        def seen(q, velocity=velocity, height=height, channel=channel):
            rotation = rotation_from_quaternion(*q)
            return seen_velocity(rotation, VelocityNed(*velocity), height, channel, 0.5, 0.05, swing)

        found = seen(q)
        assert found.turn == pytest.approx(
            [slope_of(lambda q: seen(q).value, q, about) for about in range(3)], abs=1e-6
        )
        steps = [(seen(q, height=height + sign * SMALL).value) for sign in (1.0, -1.0)]
        assert found.height == pytest.approx((steps[0] - steps[1]) / (2.0 * SMALL), abs=1e-6)
        for axis in range(3):
            ahead, behind = (np.add(velocity, sign * SMALL * np.eye(3)[axis]) for sign in (1.0, -1.0))
            slope = (seen(q, tuple(ahead)).value - seen(q, tuple(behind)).value) / (2.0 * SMALL)
            assert found.vel[axis] == pytest.approx(slope, abs=1e-6)


@SEEDS
def test_a_vector_that_turns_with_the_body_has_the_slopes_of_its_cross_product(seed):
    rng = np.random.default_rng(seed)
    q, velocity, arm = attitude(rng), floats(rng, 3), floats(rng, 3)
    rotation = rotation_from_quaternion(*q)
    for axis in range(3):
        _, _, slopes = along_axis(rotation, axis, velocity, 0.4)
        along = [slope_of(lambda q, axis=axis: along_axis(rotation_from_quaternion(*q), axis, velocity, 0.4)[1], q, k)
                 for k in range(3)]  # fmt: skip
        assert slopes == pytest.approx(along, abs=1e-7)
        expected = [np.cross(np.eye(3)[k], arm)[axis] for k in range(3)]
        assert turning(arm, axis) == pytest.approx(expected)
    assert cross(velocity, arm) == pytest.approx(np.cross(velocity, arm))


# -- the turn of north ---------------------------------------------------------------------------------------------
@SEEDS
@pytest.mark.parametrize("angle", [0.5 * math.pi, -2.0])
def test_what_is_seen_below_does_not_hang_on_north(seed, angle):
    """Flow, body velocity and range of a turned world; and the slopes turn along."""
    rng = np.random.default_rng(seed)
    q, velocity, rate = attitude(rng), floats(rng, 3), BodyRate(*floats(rng, 3))
    mount, lever = FlowMount(0.2, -0.1, 0.1, 0.15), Lever(0.2, -0.1, 0.1)

    def seen(turn: float, size: float = 1.0):
        attitude_ = Attitude(*turned_about_down(q, turn))
        moving = VelocityNed(*np.multiply(about_down(velocity, turn), size))
        height = Height(-3.0 * size, 0.2 * size)
        scaled = FlowMount(*np.multiply(mount, size))
        rates = [
            flow_rate.law(axis, moving, height, 0.1, attitude_, rate, GyroLeft(0.0, 0.0), mount=scaled)
            for axis in (0, 1)
        ]
        speeds = [body_velocity.law(axis, moving, 0.1, attitude_, rate, lever=lever) for axis in range(3)]
        return rates, speeds

    here, there = seen(0.0), seen(angle)
    for one, two in zip((*here[0], *here[1]), (*there[0], *there[1]), strict=True):
        assert two[0] == pytest.approx(one[0])
        for names in (("vel_n", "vel_e"), ("tilt_n", "tilt_e")):
            before = [getattr(one[1], name) for name in names]
            assert [getattr(two[1], name) for name in names] == pytest.approx(about_down(before, angle))
    for one, two in zip(here[0], seen(0.0, 8.0)[0], strict=True):
        assert two[0] == pytest.approx(one[0])  # eight times as high and as fast is the same flow


@SEEDS
def test_errors_move_alike_in_a_turned_world_and_none_makes_none(seed):
    rng = np.random.default_rng(seed)
    pos, vel, tilt, force = (floats(rng, 3) for _ in range(4))
    biases, angle, dt_s = (GyroBias(*floats(rng, 3)), AccelBias(*floats(rng, 3))), 1.1, 0.3
    q = attitude(rng)

    def moved(turn: float, size: float = 1.0):
        around = (np.multiply(about_down(each, turn), size) for each in (pos, vel, tilt))
        p, v, t = around
        middle = Middle(*rotation_from_quaternion(*turned_about_down(q, turn)))
        gyro, accel = (type(bias)(*np.multiply(bias, size)) for bias in biases)
        return errors_in_motion.law(
            PositionNed(*p), VelocityNed(*v), Tilt(*t), gyro, accel, ForceNed(*about_down(force, turn)), middle,
            dt_s=dt_s,
        )  # fmt: skip

    here, there = moved(0.0), moved(angle)
    for first in (0, 3, 6):
        assert there[first : first + 3] == pytest.approx(about_down(here[first : first + 3], angle))
    assert moved(0.0, 3.0) == pytest.approx(np.multiply(here, 3.0))
    assert moved(0.0, 0.0) == (0.0,) * 9


@SEEDS
def test_an_ellipse_is_as_long_whichever_way_it_lies(seed):
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(2, 2))
    covariance = factor @ factor.T
    for angle in (0.0, 0.7, 0.5 * math.pi, -2.0):
        turn = np.column_stack([about_down((1.0, 0.0), angle), about_down((0.0, 1.0), angle)])
        both = turn @ covariance @ turn.T
        found = larger_axis(both[0, 0], both[1, 1], both[0, 1])
        assert found == pytest.approx(math.sqrt(np.linalg.eigvalsh(covariance)[-1]))


# -- steps that add up -----------------------------------------------------------------------------------------------
@SEEDS
def test_two_half_steps_of_a_sensor_s_dynamics_are_a_whole_one(seed):
    """While the seen velocity goes in a straight line; and both ways to the coefficients are one."""
    rng = np.random.default_rng(seed)
    x, first, last = Lagged(*floats(rng, 4)), floats(rng, 2), floats(rng, 2)
    middle = 0.5 * np.add(first, last)

    def stepped(x: Lagged, start, end, dt_s: float) -> Lagged:
        lag = lag_over(196.9, 14.8, 191.9, dt_s, 0.0, 0.0)
        x = moved_lag(x, *start, LagMove(lag.f11, lag.f12, lag.f21, lag.f22, lag.start_1, lag.start_2))
        return moved_lag(x, *end, LagMove(1.0, 0.0, 0.0, 1.0, lag.end_1, lag.end_2))

    whole = stepped(x, first, last, 0.02)
    assert stepped(stepped(x, first, middle, 0.01), middle, last, 0.01) == pytest.approx(whole, rel=1e-9, abs=1e-12)
    for b, c in ((14.8, 191.9), (40.0, 191.9)):  # swings, and creeps
        one, two = lag_over(c, b, c, 0.02, 0.0, 0.0), lag_of_step(b, c, 0.02, 0.0, 0.0, 0.0)
        assert two[:8] == pytest.approx(one[:8], rel=1e-9, abs=1e-12)


@SEEDS
def test_a_turn_and_the_same_turn_back_is_none_and_two_halves_are_a_whole(seed):
    rng = np.random.default_rng(seed)
    q, turn = attitude(rng), floats(rng, 3, 0.02)
    assert turned(turned(q, *turn), *np.negative(turn)) == pytest.approx(q, abs=1e-12)
    half = np.multiply(turn, 0.5)
    assert turned(turned(q, *half), *half) == pytest.approx(turned(q, *turn), abs=1e-8)
    assert turned(q, 0.0, 0.0, 0.0) == pytest.approx(q, abs=1e-15)


def test_what_tells_nothing_leaves_a_fault_its_prior_and_units_do_not_matter():
    assert size_of(0.0, 0.0, 0.3) == pytest.approx((0.0, 0.3, 0.0))
    metres, feet = size_of(4.0, 1.2, 0.3), size_of(4.0 / 3.28**2, 1.2 / 3.28, 0.3 * 3.28)
    assert (feet.size, feet.sigma) == pytest.approx((3.28 * metres.size, 3.28 * metres.sigma))
    assert feet.evidence == pytest.approx(metres.evidence)
