"""Streams and their order in time: what a reading says where a source says nothing, and when it was true."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.core.measurement import COLUMNS, MAX_VALUES, Sensor, Stream, merge

TIMES = st.lists(st.floats(0.0, 100.0), max_size=20).map(sorted)
UNITS = ("_m", "_m_s", "_rad_s", "_m_s2", "_gauss", "_rad")


def ranges(t_s, value=1.0, **more):
    return Stream.of(Sensor.RANGE, np.asarray(t_s, float), np.full((len(t_s), 1), value), **more)


def baro(t_s, value=2.0, **more):
    return Stream.of(Sensor.BARO, np.asarray(t_s, float), np.full((len(t_s), 1), value), **more)


def test_what_a_source_does_not_state_is_neither_zero_nor_bad():
    (reading,) = ranges([1.5])
    assert (reading.t_s, reading.sensor, reading.value, reading.delay_s) == (1.5, Sensor.RANGE, (1.0,), 0.0)
    assert math.isnan(reading.variance[0])
    assert reading.quality == 255.0


def test_what_a_source_states_is_kept():
    stated = ranges([1.0, 2.0], variance=[[0.1], [0.2]], quality=[7.0, 0.0], delay_s=0.3, rejected={"stuck": 4})
    assert [(r.variance, r.quality, r.delay_s) for r in stated] == [((0.1,), 7.0, 0.3), ((0.2,), 0.0, 0.3)]
    assert stated.rejected == {"stuck": 4}


def test_a_value_too_many_is_refused():
    with pytest.raises(ValueError, match="RANGE takes 1 values a reading, got 2"):
        Stream.of(Sensor.RANGE, np.zeros(3), np.zeros((3, 2)))


def test_readings_come_in_the_order_of_the_instants_that_they_describe():
    queue = merge([ranges([1.0, 2.0], delay_s=0.5), baro([0.6, 1.4])])
    assert queue.t_s == pytest.approx([0.5, 0.6, 1.4, 1.5])
    assert queue.sensor.tolist() == [Sensor.RANGE, Sensor.BARO, Sensor.BARO, Sensor.RANGE]
    assert queue.row.tolist() == [0, 0, 1, 1]


def test_readings_of_one_instant_keep_the_order_of_their_streams():
    for streams in ([ranges([1.0, 1.0]), baro([1.0])], [baro([1.0]), ranges([1.0, 1.0])]):
        queue = merge(streams)
        expected = [int(stream.sensor) for stream in streams for _ in range(len(stream))]
        assert queue.sensor.tolist() == expected
    assert queue.row.tolist() == [0, 0, 1]


@given(TIMES, TIMES, st.floats(0.0, 5.0))
def test_no_reading_is_lost_or_changed(first, second, delay_s):
    streams = [ranges(first, 3.0, delay_s=delay_s), baro(second, 4.0)]
    queue = merge(streams)
    assert len(queue.t_s) == len(first) + len(second)
    assert np.all(np.diff(queue.t_s) >= 0.0)
    assert queue.value.shape == (len(queue.t_s), MAX_VALUES)
    for stream in streams:
        mine = queue.sensor == int(stream.sensor)
        assert queue.t_s[mine] == pytest.approx(stream.t_s - stream.delay_s)
        assert np.array_equal(queue.value[mine, :1], stream.value)
        assert np.isnan(queue.value[mine, 1:]).all()
        assert np.array_equal(queue.row[mine], np.arange(len(stream)))


def test_every_sensor_has_columns_with_units():
    assert set(COLUMNS) == set(Sensor)
    unitless = {"qw", "qx", "qy", "qz", "tan_forward", "tan_right", "landed"}
    for names in COLUMNS.values():
        assert all(name in unitless or name.endswith(UNITS) for name in names)
