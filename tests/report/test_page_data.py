"""The page's data: what is unpacked is what the record holds, each column once, long series keep their extremes."""

from __future__ import annotations

import base64
import gzip
import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from flownav.report.chart import LINE_POINTS, Stack
from flownav.report.html import HERE
from flownav.report.page_data import DECIMALS, SMALLEST, Columns, chart_data


def unpacked(columns: Columns) -> list[np.ndarray]:
    """The columns as the page's script has them: byte planes, folded differences, steps."""
    data, found, at = gzip.decompress(base64.b64decode(columns.text())), [], 0
    for step, count in zip(columns.steps, columns.counts, strict=True):
        planes = np.frombuffer(data[at : at + 4 * count], np.uint8).reshape(4, count)
        folded = np.ascontiguousarray(planes.T).view("<u4").ravel().astype(np.int64)
        whole = np.cumsum((folded >> 1) ^ -(folded & 1))
        whole = (whole + 2**31) % 2**32 - 2**31
        found.append(np.where(whole == -(2**31), np.nan, whole * step))
        at += 4 * count
    assert at == len(data)
    return found


NUMBERS = st.floats(-1e12, 1e12) | st.just(float("nan")) | st.just(float("inf")) | st.just(0.0)


@settings(deadline=None)
@example([np.array([5e-324, 0.0])])
@given(st.lists(st.integers(0, 60).flatmap(lambda n: arrays(float, n, elements=NUMBERS)), max_size=5))
def test_every_column_comes_back_to_a_millionth_of_its_largest_value(given_columns: list[np.ndarray]) -> None:
    columns = Columns()
    places = [columns.add(values) for values in given_columns]
    found = unpacked(columns)
    for place, values in zip(places, given_columns, strict=True):
        finite = np.isfinite(values)
        largest = np.abs(values[finite]).max(initial=0.0)
        assert np.array_equal(np.isnan(found[place]), ~finite)
        assert (
            np.abs(found[place][finite] - values[finite]).max(initial=0.0) <= 0.51 * largest / 10.0**DECIMALS + SMALLEST
        )


def test_the_same_values_are_kept_once() -> None:
    columns = Columns()
    t_s = np.arange(100.0)
    assert columns.add(t_s, time=True) == columns.add(t_s.copy(), time=True) != columns.add(t_s + 1.0, time=True)
    assert len(columns.steps) == 2


def test_times_are_kept_to_the_microsecond() -> None:
    t_s = np.sort(np.random.default_rng(1).uniform(0.0, 2000.0, 500))
    columns = Columns()
    columns.add(t_s, time=True)
    assert unpacked(columns)[0] == pytest.approx(t_s, abs=0.51e-6)


def test_a_long_line_keeps_its_extremes_at_their_own_instants() -> None:
    t_s = np.arange(50_000) * 0.02
    values = np.sin(t_s)
    values[31_234] = 9.0
    stack = Stack(["x (m)"])
    stack.line(1, "estimate", "estimate", t_s, values)
    columns = Columns()
    one = chart_data(stack.chart((0.0, 1000.0)), columns, (0.0, 1000.0))["rows"][0]["series"][0]
    t_kept, kept = unpacked(columns)[one["t"]], unpacked(columns)[one["v"]]
    assert len(kept) <= LINE_POINTS
    assert t_kept[np.argmax(kept)] == pytest.approx(t_s[31_234])
    assert kept.max() == pytest.approx(9.0)


def test_a_chart_of_the_whole_flight_has_no_window_and_a_close_up_has_its_own() -> None:
    stack = Stack(["x (m)"])
    stack.line(1, "estimate", "estimate", np.arange(3.0), np.arange(3.0))
    assert chart_data(stack.chart((0.0, 2.0)), Columns(), (0.0, 2.0))["window"] is None
    assert chart_data(stack.chart((0.5, 2.0)), Columns(), (0.0, 2.0))["window"] == [0.5, 2.0]


def test_the_library_that_draws_is_the_version_that_its_note_names_and_brings_its_licence() -> None:
    vendor = HERE / "vendor"
    note = (vendor / "README.md").read_text(encoding="utf-8")
    version = re.search(r"`uplot`, version ([0-9.]+) ", note)
    assert version is not None
    assert f"(v{version[1]})" in (vendor / "uPlot.iife.min.js").read_text(encoding="utf-8")[:100]
    assert "MIT License" in (vendor / "uPlot.LICENSE").read_text(encoding="utf-8")
