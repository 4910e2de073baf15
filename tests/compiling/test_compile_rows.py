"""Rows of a table as records: where fields stand, columns by name, the generated code that writes a lane's row."""

from typing import Annotated, Generic, NamedTuple, TypeVar

import numpy as np
import pytest

from flownav.core.compile import columns_of, equation, gathering, kernel, places_of, pointer, row_store, width_of

Value = TypeVar("Value")


class Fix(NamedTuple, Generic[Value]):
    t_s: Value
    pos_ned_m: Annotated[Value, 3]
    speed_m_s: Value


@equation
def row_of(work, lanes, row, lane):
    return work[row * len(lanes) + lane]


store_fix = row_store(Fix)
gathered = gathering(row_of, range(1, 4))


@kernel
def copy_lanes(work, lanes, row, table):
    rows = pointer(work)
    for lane in range(len(lanes)):
        fix = Fix(rows[lane], gathered(rows, lanes, lane), 7)
        store_fix(pointer(table), lanes, row, lane, fix)


def test_fields_stand_one_after_the_other_as_wide_as_they_say():
    assert places_of(Fix) == Fix(0, 1, 4)
    assert width_of(Fix) == 5


def test_columns_are_views_by_name():
    rows = np.arange(10.0).reshape(2, 5)
    columns = columns_of(Fix, rows)
    assert columns.t_s.tolist() == [0.0, 5.0]
    assert columns.pos_ned_m.tolist() == [[1.0, 2.0, 3.0], [6.0, 7.0, 8.0]]
    columns.speed_m_s[:] = -1.0
    assert rows[:, 4].tolist() == [-1.0, -1.0]


@pytest.mark.parametrize("run", [copy_lanes, copy_lanes.py_func], ids=["compiled", "python"])
def test_a_stored_row_is_read_back_by_name_in_its_lane_and_no_other_row_is_touched(run):
    lanes = (0, 0)
    work = np.array([[10.0, 20.0], [1.0, 4.0], [2.0, 5.0], [3.0, 6.0]])
    table = np.full((3, width_of(Fix), len(lanes)), np.nan)
    run(work.reshape(-1), lanes, 1, table.reshape(-1))
    for lane in range(2):
        found = columns_of(Fix, table[:, :, lane])
        assert found.t_s[1] == work[0, lane]
        assert found.pos_ned_m[1].tolist() == work[1:, lane].tolist()
        assert found.speed_m_s[1] == 7.0
    assert np.isnan(table[[0, 2]]).all()
