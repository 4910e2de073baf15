"""A campaign of few flights prints no figure that its largest flight alone would be, and the number it needs."""

from __future__ import annotations

import pytest

from flownav.campaigns.measures import FIGURES, flights_needed
from flownav.cli.campaign_said import _of_figure


@pytest.mark.parametrize(("name", "needed"), [("r50_m", 2), ("r95_m", 20), ("r997_m", 334), ("landed", 1)])
def test_a_percentile_needs_more_flights_than_leave_the_largest_outside(name, needed):
    assert flights_needed(name) == needed
    share = FIGURES[name].share
    if share is not None:
        assert (needed - 1) * (1.0 - share) < 1.0 <= needed * (1.0 - share) + 1e-9


def test_too_few_flights_have_no_figure_and_say_how_many_it_needs():
    figures = {"r997_m": {"value": 0.1, "low": 0.09, "high": None}, "r95_m": {"value": 0.1, "low": 0.09, "high": 0.2}}
    few = {"flights": 32, "figures": figures}
    assert _of_figure("R99.7 [m]", "r997_m").cell(few) == "needs 334 flights"
    assert _of_figure("R95 [m]", "r95_m").cell(few) == "0.100 (0.090-0.200)"
    assert _of_figure("R99.7 [m]", "r997_m").cell(few | {"flights": 334}) == "0.100 (at least 0.090)"
    assert _of_figure("R99.7 [m]", "r997_m").cell({"flights": 9, "figures": {}}) == "-"
