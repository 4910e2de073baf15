"""The report's panel of protection levels."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.record import PROTECTION_LEVELS, Record
from flownav.report.figures_filter import protection
from flownav.report.html import render, sections
from report_records import flight, replay

LEVELS_M = (3.0, 1.25)


def with_levels(record: Record) -> Record:
    """The record with levels that rise from half of LEVELS_M to half as much again."""
    rows = len(record.tables["estimate"]["t_s"])
    for name, level_m in zip(PROTECTION_LEVELS, LEVELS_M, strict=True):
        record.tables["estimate"][name] = level_m * np.linspace(0.5, 1.5, rows)
    return record


def lines(panel) -> dict[tuple[str, str], np.ndarray]:
    """The drawn lines, by name and axis."""
    return {(trace.name, trace.yaxis or "y"): np.asarray(trace.y, float) for trace in panel.figure.data if trace.name}


def test_levels_stand_beside_the_errors_that_are_known():
    record = with_levels(flight())
    (panel,) = protection(record)
    drawn = lines(panel)
    assert set(drawn) == {(name, axis) for name in ("protection level", "error") for axis in ("y", "y2")}
    for axis, level_m in zip(("y", "y2"), LEVELS_M, strict=True):
        found = drawn["protection level", axis]
        assert (found[0], found[-1]) == pytest.approx((0.5 * level_m, 1.5 * level_m))
    truth, estimate = record.tables["truth"], record.tables["estimate"]
    north, east, down = (estimate[name] - truth[name] for name in ("pos_n_m", "pos_e_m", "pos_d_m"))
    assert drawn["error", "y"].max() == pytest.approx(np.hypot(north, east).max(), rel=1e-6)
    assert drawn["error", "y2"].max() == pytest.approx(abs(down).max(), rel=1e-6)
    assert drawn["error", "y2"].min() >= 0.0
    assert "3.00 m horizontally, 1.25 m vertically" in panel.caption
    assert panel.caption in panel.alt


def test_without_a_truth_the_levels_stand_alone():
    (panel,) = protection(with_levels(replay(60.0)))
    assert {name for name, _ in lines(panel)} == {"protection level"}


def test_a_record_without_levels_has_no_such_panel():
    unknown = with_levels(flight())
    for name in PROTECTION_LEVELS:
        unknown.tables["estimate"][name] = np.full(len(unknown.tables["estimate"]["t_s"]), np.nan)
    assert protection(flight()) == protection(unknown) == protection(Record()) == []


def test_the_page_shows_it_among_the_errors():
    record = with_levels(flight())
    (errors,) = (section for section in sections(record) if section.key == "uncertainty")
    assert [panel.key for panel in errors.panels][-1] == "protection"
    assert "How far off the position may be although nothing is noticed" in render(record)
