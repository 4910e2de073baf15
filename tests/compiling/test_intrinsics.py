"""Access to records in kernels, written as instructions: the results of plain Python, and the refused uses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numba.core.errors import TypingError

from flownav.core.compile import LANES, ONE_LANE, kernel, lane_access, pointer, replacing


class Record(NamedTuple):
    first: float
    second: float
    third: float


class Defaulted(NamedTuple):
    first: float
    second: float = 2.5
    third: float = float("nan")


class Other(NamedTuple):
    first: float
    third: float


load, store = lane_access(Record, 2)
load_scattered, store_scattered = lane_access(Record, (7, 1, 5))
load_stated_attitude, store_stated_attitude = lane_access(Record, None)
_, store_defaulted = lane_access(Defaulted, (7, 1, 5))
with_two = replacing(Record, "third", "first")


@kernel
def turned(buffer, lanes, row):
    work = pointer(buffer)
    for lane in range(len(lanes)):
        r = load(work, lanes, lane)
        s = load_scattered(work, lanes, lane)
        t = load_stated_attitude(work, lanes, row, lane)
        store_scattered(work, lanes, lane, with_two(r, first=t.second, third=s.first + lane))
        store_stated_attitude(work, lanes, row, lane, Record(s.third, True, 3))
        store(work, lanes, lane, t)


@kernel
def turned_array(buffer, lanes):
    for lane in range(len(lanes)):
        store(buffer, lanes, lane, load_scattered(buffer, lanes, lane))


@kernel
def said_in_part(buffer, lanes):
    for lane in range(len(lanes)):
        store_defaulted(pointer(buffer), lanes, lane, Defaulted(1.5 + lane))


@kernel
def misplaced(buffer, lanes):
    store(pointer(buffer), lanes, 0, Other(1.0, 2.0))


@pytest.mark.parametrize("lanes", [ONE_LANE, LANES])
def test_a_kernel_reads_and_writes_what_plain_python_does(lanes):
    start = np.random.default_rng(1).normal(size=12 * len(lanes))
    compiled, plain = start.copy(), start.copy()
    turned(compiled, lanes, 9)
    turned.py_func(plain, lanes, 9)
    np.testing.assert_array_equal(compiled, plain)
    assert np.count_nonzero(compiled != start) == 9 * len(lanes)


def test_an_array_serves_as_its_address_does():
    buffer = np.random.default_rng(2).normal(size=(12, 3))
    turned_array(buffer.reshape(-1), (0,) * 3)
    np.testing.assert_array_equal(buffer[[2, 3, 4]], buffer[[7, 1, 5]])


def test_what_is_no_flat_array_or_may_not_be_written_is_no_lane_buffer():
    sealed = np.zeros(12)
    sealed.flags.writeable = False
    for wrong in (np.zeros((12, 1)), np.zeros(24)[::2], np.zeros(12, np.float32), sealed):
        with pytest.raises(TypingError):
            turned_array(wrong, ONE_LANE)


@pytest.mark.parametrize("lanes", [ONE_LANE, LANES])
def test_fields_that_a_record_leaves_out_are_stored_by_their_defaults(lanes):
    """As Python makes them; Numba's tuple has only the given fields, and that did not compile."""
    compiled, plain = np.zeros(12 * len(lanes)), np.zeros(12 * len(lanes))
    said_in_part(compiled, lanes)
    said_in_part.py_func(plain, lanes)
    np.testing.assert_array_equal(compiled, plain)


def test_a_record_of_another_kind_is_not_stored():
    with pytest.raises(TypingError):
        misplaced(np.zeros(12), ONE_LANE)


def test_a_field_that_there_is_not_is_refused():
    with pytest.raises(ValueError, match="Record has no fourth"):
        replacing(Record, "fourth")
