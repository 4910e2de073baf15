"""`pointer` and `invoke`: plain Python in Python, one address and one load in kernels."""

from __future__ import annotations

import re

import numpy as np
import pytest

from flownav.core.compile import LANES, ONE_LANE, equation, invoke, kernel, pointer, unit


@equation
def double_rows(work, lanes, rows):
    for row in range(rows):
        for lane in range(len(lanes)):
            work[row * len(lanes) + lane] = 2.0 * work[row * len(lanes) + lane] + 1.0


@kernel
def doubled(work, lanes, rows):
    work = pointer(work)
    double_rows(work, lanes, rows)


@kernel
def counted(numbers, i, value):
    p = pointer(pointer(numbers))
    p[i] = p[i] + value


def test_python_gets_the_array_itself():
    array = np.arange(3.0)
    assert pointer(array) is array


@pytest.mark.parametrize("lanes", [ONE_LANE, LANES])
def test_lane_code_is_the_same_on_a_pointer(lanes):
    work = np.random.default_rng(1).normal(size=5 * len(lanes))
    expected = work.copy()
    double_rows(expected, lanes, 5)
    doubled(work, lanes, 5)
    np.testing.assert_array_equal(work, expected)


def test_a_pointer_to_whole_numbers():
    numbers = np.array([1, 2, 3])
    counted(numbers, 1, 40)
    assert numbers.tolist() == [1, 42, 3]


def test_an_index_is_not_wrapped():
    """A negative index reaches before the start, and LLVM sees no select."""
    numbers = np.array([1, 2, 3])
    counted(numbers[1:], -1, 10)
    assert numbers.tolist() == [11, 2, 3]
    counted.dispatcher(numbers[1:], -1, 0)
    (llvm,) = counted.dispatcher.inspect_llvm().values()
    body = re.search(r"define [^\n]*counted[^\n]*\{.*?\n\}", llvm, re.S)
    assert body is not None
    assert "select" not in body.group(0)
    assert "getelementptr" in body.group(0)


@pytest.mark.parametrize("array", [np.zeros(4, np.float32), np.zeros((4, 4))[:, 1]])
def test_only_contiguous_64_bit_arrays_have_a_pointer(array):
    with pytest.raises(Exception, match="pointer"):
        counted(array, 0, 1)


def add(p, q, scale, count):
    for i in range(count):
        p[i] = p[i] + scale * q[i]


ADD = unit(add, "p q d i")


@kernel
def add_twice(address, p, q, scale):
    first, second = pointer(p), pointer(q)
    for _ in range(2):
        invoke(address, first, second, scale, len(p))


def test_a_kernel_invokes_a_unit():
    p, q = np.zeros(3), np.array([1, 2, 3])
    add_twice(ADD.address, p, q, 0.5)
    assert p.tolist() == [1.0, 2.0, 3.0]


def test_python_invokes_a_callable():
    p, q = np.zeros(3), np.array([1, 2, 3])
    add_twice.py_func(ADD.python, p, q, 0.5)
    assert p.tolist() == [1.0, 2.0, 3.0]
