"""Named tuples in flat buffers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from flownav.core.compile import equation, flat_access, kernel, lane_access, passing, pointer, replacing, stepping


class Wheel(NamedTuple):
    radius_m: float
    spokes: int


class Cart(NamedTuple):
    mass_kg: float
    left: Wheel
    braked: bool
    right: Wheel
    axle: tuple[float, float]


class Named(NamedTuple):
    name: str


CART = Cart(12.5, Wheel(0.25, 8), True, Wheel(0.5, 9), (1.0, 2.0))
SIZE, pack, load = flat_access(Cart)


@kernel
def rolled(p, first, out):
    cart = load(pointer(p), first)
    out[0] = cart.mass_kg * cart.right.radius_m + (100.0 if cart.braked else 0.0)
    out[1] = cart.left.spokes // 3 + cart.right.spokes % 2 + cart.axle[1]


def test_packing_and_loading_give_the_same_tuple():
    packed = pack(CART)
    assert SIZE == len(packed) == 8
    again = load(packed)
    assert again == CART
    assert [type(again.left.spokes), type(again.braked), type(again.left)] == [int, bool, Wheel]
    assert load(np.concatenate([[7.0, 7.0], packed]), 2) == CART


def test_a_kernel_loads_ints_as_ints_and_truths_as_truths():
    out = np.zeros(2)
    rolled(np.concatenate([[7.0], pack(CART)]), 1, out)
    assert out.tolist() == [12.5 * 0.5 + 100.0, 8 // 3 + 9 % 2 + 2.0]


def test_what_is_no_number_is_refused():
    with pytest.raises(TypeError, match="not <class 'str'>"):
        flat_access(Named)


def test_a_tuple_of_another_size_is_refused():
    with pytest.raises(ValueError, match="8 numbers, not 2"):
        pack(CART.left)


def test_lanes_load_what_they_store():
    load_wheel, store_wheel = lane_access(Wheel, 3)
    lanes = (0, 0)
    work = np.zeros(5 * 2)
    store_wheel(work, lanes, 1, Wheel(0.5, 4))
    assert load_wheel(work, lanes, 1) == Wheel(0.5, 4)
    assert work.tolist() == [0, 0, 0, 0, 0, 0, 0, 0.5, 0, 4.0]


def test_rows_are_taken_where_none_is_told():
    load_row, store_row = lane_access(Wheel, None)
    load_third, _ = lane_access(Wheel, 3)
    lanes = (0, 0)
    work = np.zeros(5 * 2)
    store_row(work, lanes, 3, 1, Wheel(0.5, 4))
    assert load_row(work, lanes, 3, 1) == load_third(work, lanes, 1) == Wheel(0.5, 4)
    assert load_row(work, lanes, 0, 1) == Wheel(0.0, 0.0)


@equation
def spin(wheel):
    return wheel.radius_m * wheel.spokes


@kernel
def spun(p, out):
    out[0] = spin(load(pointer(p)).left)


def test_a_part_of_a_bundle_is_a_bundle():
    out = np.zeros(1)
    spun(pack(CART), out)
    assert out[0] == 2.0


class Point(NamedTuple):
    x: float
    y: float
    z: float


moved_across = replacing(Point, "z", "x")
stepped = stepping(Point)


@equation
def halved(value):
    return 0.5 * value


halved_across = passing(Point, halved, "x", "z")


@kernel
def changed(values, dt):
    """A point replaced and stepped in a kernel."""
    start = Point(values[0], values[1], values[2])
    after = stepped(moved_across(start, x=5.0, z=7.0), start, dt)
    values[0], values[1], values[2] = after.x, after.y, after.z


def test_fields_are_replaced_by_name_and_the_others_kept():
    assert moved_across(Point(1.0, 2.0, 3.0), x=5.0, z=7.0) == Point(5.0, 2.0, 7.0)
    with pytest.raises(TypeError, match="x"):
        moved_across(Point(1.0, 2.0, 3.0), z=7.0)
    with pytest.raises(ValueError, match="Point has no speed, w"):
        replacing(Point, "w", "x", "speed")


def test_the_named_fields_pass_through_an_equation_and_the_others_stay():
    assert halved_across(Point(1.0, 2.0, 3.0)) == Point(0.5, 2.0, 1.5)
    assert halved_across(Point(2j, 2.0, 3.0)).x == 1j
    with pytest.raises(ValueError, match="Point has no w"):
        passing(Point, halved, "x", "w")


def test_a_step_adds_a_rate_to_every_field():
    assert stepped(Point(1.0, 2.0, 3.0), Point(10.0, 20.0, 30.0), 0.5) == Point(6.0, 12.0, 18.0)
    assert stepped(Point(1.0, 2.0, 3.0), Point(1j, 0.0, 0.0), 2.0).x == 1.0 + 2j


def test_kernels_replace_and_step_alike():
    values = np.array([1.0, 2.0, 3.0])
    changed(values, 0.5)
    assert values.tolist() == [5.5, 3.0, 8.5]
