"""The motion of a path: which speeds are a climb and a transit, whichever way it goes, and over how long."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.record import Record
from flownav.scoring.phases import (
    CLIMB_M_S,
    GRID_S,
    LONGEST_CONTACT_GAP_S,
    NAMES,
    TRANSIT_M_S,
    WINDOW_S,
    motion_of,
    phases_of,
)


def steady(north_m_s: float, east_m_s: float, climb_m_s: float) -> str:
    """The name of the middle of a straight path of 20 s at a steady velocity."""
    path = np.outer(GRID_S * np.arange(200), (north_m_s, east_m_s, -climb_m_s))
    return NAMES[motion_of(path)[100]]


@pytest.mark.parametrize("course_deg", [0.0, 37.0, 90.0, 180.0, 270.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_transit_may_rise_and_sink_by_a_fifth_of_its_speed(course_deg, side):
    north, east = np.cos(np.radians(course_deg)), np.sin(np.radians(course_deg))
    for speed in (2.0, 5.0, 10.0):
        assert steady(speed * north, speed * east, side * 0.19 * speed) == "transit"
        assert steady(speed * north, speed * east, side * 0.21 * speed) == ("climb" if side > 0.0 else "descent")


@pytest.mark.parametrize("course_deg", [0.0, 37.0, 90.0, 180.0, 270.0])
def test_a_transit_is_faster_than_its_threshold_over_the_ground_whichever_way(course_deg):
    north, east = np.cos(np.radians(course_deg)), np.sin(np.radians(course_deg))
    for share, name in ((0.98, "hover"), (1.02, "transit")):
        assert steady(share * TRANSIT_M_S * north, share * TRANSIT_M_S * east, 0.0) == name


@pytest.mark.parametrize(("side", "name"), [(1.0, "climb"), (-1.0, "descent")])
def test_a_climb_is_faster_than_its_threshold(side, name):
    assert steady(0.0, 0.0, side * 0.98 * CLIMB_M_S) == "hover"
    assert steady(0.0, 0.0, side * 1.02 * CLIMB_M_S) == name


def test_a_climb_is_a_change_of_height_over_the_whole_window():
    """A step of height is seen for as long before and after as half the window: its climb lasts the window."""
    t_s = GRID_S * np.arange(200)
    for step_m, climbs in ((0.9 * CLIMB_M_S * WINDOW_S, False), (1.1 * CLIMB_M_S * WINDOW_S, True)):
        path = np.column_stack([0.0 * t_s, 0.0 * t_s, np.where(t_s > 10.0, -step_m, 0.0)])
        names = [NAMES[label] for label in motion_of(path)]
        assert GRID_S * names.count("climb") == pytest.approx(WINDOW_S if climbs else 0.0, abs=0.5 * GRID_S)
    assert WINDOW_S == 2.0  # the module's words, and those of the report, are of two seconds


def test_skids_flutter_for_so_long_and_a_longer_gap_is_flight():
    """On the ground at both ends; 10 s aloft; and one gap in the contact before them."""
    t_s = np.arange(0.0, 40.0, 0.01)
    aloft = (t_s > 20.0) & (t_s < 30.0)
    height = np.where(aloft, 3.0, 0.0)
    for gap_s, flies in ((LONGEST_CONTACT_GAP_S - 0.1, False), (LONGEST_CONTACT_GAP_S + 0.2, True)):
        gap = (t_s > 8.0) & (t_s < 8.0 + gap_s)
        record = Record()
        record.add("truth", {"t_s": t_s, "pos_n_m": 0.0 * t_s, "pos_e_m": 0.0 * t_s, "pos_d_m": -height,
                             "on_ground": ~(aloft | gap)})  # fmt: skip
        early = [phase for phase in phases_of(record) if phase.t0 < 15.0]
        assert (len(early) > 1) is flies, (gap_s, early)
