"""Rows out of order, repeated or far from all others: which go, which stay, and that they are counted."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from flownav.logs.assembly import Rows, drop_duplicates, drop_strays, longest_ordered


def rows_of(t_s, values) -> Rows:
    return Rows(np.asarray(t_s, float), {"x": np.asarray(values, float)})


def test_what_is_said_again_at_the_same_time_goes_and_another_reading_of_that_time_stays():
    rows = rows_of([0.0, 1.0, 1.0, 1.0, 2.0, 2.0], [5.0, 6.0, 6.0, 7.0, np.nan, np.nan])
    drop_duplicates(rows)
    assert rows.t_s.tolist() == [0.0, 1.0, 1.0, 2.0]
    assert rows.columns["x"][:3].tolist() == [5.0, 6.0, 7.0]
    assert rows.rejected == {"duplicate": 2}


def test_a_value_that_does_not_change_is_no_duplicate():
    rows = rows_of([0.0, 1.0, 2.0], [5.0, 5.0, 5.0])
    drop_duplicates(rows)
    assert len(rows) == 3
    assert rows.rejected == {}


def longest(times: list[float]) -> int:
    """Length of the longest subsequence that never runs back, by trying for each row all rows before it."""
    best: list[int] = []
    for k, t in enumerate(times):
        best.append(1 + max((best[i] for i in range(k) if times[i] <= t), default=0))
    return max(best, default=0)


@given(st.lists(st.integers(0, 12).map(float), max_size=40))
def test_the_rows_kept_run_forward_and_no_larger_set_does(times):
    keep = longest_ordered(np.array(times))
    kept = np.array(times)[keep]
    assert np.all(np.diff(kept) >= 0.0)
    assert len(kept) == longest(times)


def test_a_few_rows_that_many_minutes_part_from_the_rest_go_at_either_end():
    t_s = np.concatenate([[-5000.0], np.arange(100.0), [9000.0, 9001.0]])
    rows = rows_of(t_s, t_s)
    drop_strays(rows)
    assert rows.t_s.tolist() == list(range(100))
    assert rows.rejected == {"clock_jump": 3}


def test_two_halves_of_a_log_are_no_strays():
    t_s = np.concatenate([np.arange(100.0), 5000.0 + np.arange(100.0)])
    rows = rows_of(t_s, t_s)
    drop_strays(rows)
    assert len(rows) == 200
