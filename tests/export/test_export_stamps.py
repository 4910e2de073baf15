"""Whole numbers of time: rounded to the nearest, never negative, in order."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.core.record import Record
from flownav.export.trajectory import finite_rows, shift_needed_s, stamps


@given(st.floats(0.0, 1e5), st.sampled_from([1e3, 1e6, 1e9]))
def test_a_stamp_is_within_half_a_unit_of_its_time(t_s, per_second):
    (stamp,) = stamps(np.array([t_s]), per_second)
    assert abs(float(stamp) - t_s * per_second) <= 0.5 + 1e-9 * t_s * per_second


def test_a_stamp_of_a_time_that_binary_cannot_say_is_the_nearest():
    assert stamps(np.array([0.3, 1.1, 2.3]), 1e3).tolist() == [300, 1100, 2300]
    assert stamps(np.array([0.0019999]), 1e3).tolist() == [2]


@pytest.mark.parametrize(("earliest", "shift"), [(0.0, 0.0), (3.0, 0.0), (-0.2, 1.0), (-1.0, 1.0), (-1.3, 2.0)])
def test_whole_seconds_are_added_so_that_no_time_is_negative(earliest, shift):
    record = Record()
    record.add("truth", {"t_s": np.array([5.0, 6.0])})
    record.add("innovation", {"t_s": np.array([earliest, np.nan])})
    assert shift_needed_s(record) == shift


def test_rows_without_a_time_go_and_the_rest_come_in_order():
    assert finite_rows(np.array([2.0, np.nan, 1.0, np.inf, 1.0])).tolist() == [2, 4, 0]
