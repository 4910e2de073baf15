"""A campaign of few flights prints no figure that its largest flight alone would be, and the number it needs."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from flownav.campaigns.measures import FIGURES, ROW_COLUMNS, flights_needed
from flownav.campaigns.summary import figures_of
from flownav.cli.campaign_output import _of_figure
from flownav.report.campaign import sentence as page_sentence
from flownav.report.campaign_figures import Touchdowns, common_reach_m, tails
from flownav.report.cloud_picture import cloud_picture


@pytest.mark.parametrize(("name", "needed"), [("r50_m", 2), ("r95_m", 20), ("r997_m", 334), ("landed", 1)])
def test_a_percentile_needs_more_flights_than_leave_the_largest_outside(name, needed):
    assert flights_needed(name) == needed
    share = FIGURES[name].share
    if share is not None:
        assert (needed - 1) * (1.0 - share) < 1.0 <= needed * (1.0 - share) + 1e-9


def figure_of(needed, high=0.2):
    return {"value": 0.1, "low": 0.09, "high": high, "confidence": 0.95, "flights_needed": needed}


def test_too_few_flights_have_no_figure_and_say_how_many_it_needs():
    few = {"flights": 32, "figures": {"r997_m": figure_of(334, None), "r95_m": figure_of(20)}}
    assert _of_figure("R99.7 [m]", "r997_m").cell(few) == "needs 334 flights"
    assert _of_figure("R95 [m]", "r95_m").cell(few) == "0.100 (0.090-0.200)"
    assert _of_figure("R99.7 [m]", "r997_m").cell(few | {"flights": 334}) == "0.100 (at least 0.090)"
    assert _of_figure("R99.7 [m]", "r997_m").cell({"flights": 9, "figures": {}}) == "-"


def rows_of(distances_m):
    """Flights that touched so far off, and rest there; what else a row holds is 0."""
    rows = np.zeros((len(distances_m), len(ROW_COLUMNS)))
    for name in ("touchdown.contact.distance_m", "touchdown.rest.distance_m"):
        rows[:, ROW_COLUMNS.index(name)] = distances_m
    rows[:, ROW_COLUMNS.index("touchdown.expected")] = 1.0
    return rows


@pytest.mark.parametrize(("flights", "known"), [(19, {"r50_m"}), (20, {"r50_m", "r95_m", "rest_r95_m"})])
def test_what_is_written_of_few_flights_has_no_percentile_that_is_their_largest(flights, known):
    found = figures_of(rows_of(np.linspace(0.01, 0.1, flights)), SimpleNamespace(until=None, flights=flights))
    radii = {name: found[name] for name in ("r50_m", "r95_m", "r997_m", "rest_r95_m")}
    assert {name for name, figure in radii.items() if figure["value"] is not None} == known
    assert {name: figure["flights_needed"] for name, figure in radii.items()} == {
        "r50_m": 2, "r95_m": 20, "r997_m": 334, "rest_r95_m": 20
    }  # fmt: skip
    assert found["landed"]["value"] == 1.0


def test_the_page_names_the_flights_that_a_figure_needs_and_why_there_is_no_radius():
    landed = {"value": 0.5, "low": 0.3, "high": 0.7, "flights_needed": 1}
    cell = {"label": "calm", "flights": 12, "figures": {"r95_m": dict.fromkeys(figure_of(20)) | {"flights_needed": 20}}}
    cell["figures"]["landed"] = landed
    assert "; the radius that 95 % touch within needs 20 flights." in page_sentence(cell)
    assert "no radius about the pad's centre holds 95 %" in page_sentence(cell | {"flights": 20})


def test_a_page_without_any_radius_shows_where_its_flights_touched():
    nothing = {name: dict.fromkeys(figure_of(20)) for name in ("r50_m", "r95_m", "r997_m")}
    cell = {"label": "storm", "flights": 40, "figures": nothing}
    touched = Touchdowns(np.array([-1.2, np.inf]), np.array([0.1, np.inf]), np.array([1.204, np.inf]), 3.0)
    assert common_reach_m([cell], [touched]) > 1.204
    assert "too few touched for a ring that holds half of all" in cloud_picture(cell, touched).words
    assert "where 1 flight first touched" in cloud_picture(cell, touched).svg
    (line,) = tails([cell], [touched]).drawing.data
    assert line["mode"] == "lines+markers"
