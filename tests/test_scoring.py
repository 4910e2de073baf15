"""Scores against numbers worked out by hand, and the paper's tables as data."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from flownav.scoring.errors import (
    SCORE_COLUMNS,
    error_statistics,
    score_block,
    scores_of_flight,
    scores_of_flights,
    touchdown,
)
from flownav.scoring.paper_tables import percentile_of_paper, published


def test_statistics_of_a_known_error():
    error = np.array([1.0, -1.0, 3.0, 1.0]).reshape(-1, 1, 1)
    mean, std, rms, largest = error_statistics(error, np.zeros_like(error))[0, 0]
    assert (mean, rms, largest) == (1.0, pytest.approx(np.sqrt(3.0)), 3.0)
    assert std == pytest.approx(np.std(error))


def test_touchdown_is_the_first_contact_after_flight_with_the_sink_rate_just_before():
    on_ground = np.array([1, 1, 0, 0, 1, 0, 1.0]).reshape(-1, 1)
    t_s, sink = np.arange(7.0), np.arange(7.0).reshape(-1, 1) / 10
    position = np.zeros((7, 3, 1))
    position[4, :2, 0] = 3.0, 4.0
    assert touchdown(t_s, position, sink, on_ground)[0] == pytest.approx([4.0, 5.0, 0.3])


def test_a_flight_that_never_lands_has_no_touchdown():
    zeros = np.zeros((5, 6, 1))
    row = score_block(np.arange(5.0), zeros, zeros, zeros[:, 0], np.zeros((5, 1)), lands=True)[0]
    assert scores_of_flight(row)["touchdown"] is None


def test_many_flights_give_median_and_percentiles_in_the_same_layout():
    rows = np.tile(np.arange(101.0)[:, None], (1, len(SCORE_COLUMNS)))
    scores = scores_of_flights(rows)
    assert scores["states"]["x"]["rms_error"] == {"median": 50.0, "p05": 5.0, "p95": 95.0}
    assert scores["landed"] == 101
    assert scores["touchdown"]["sink_rate_m_s"]["median"] == 50.0


@pytest.mark.parametrize(("scenario", "name"), [("takeoff", "table5_takeoff.csv"), ("landing", "table6_landing.csv")])
def test_published_tables_are_the_papers(paper_folder, scenario, name):
    with (paper_folder / name).open(encoding="utf-8") as file:
        rows = {row["state"]: row for row in csv.DictReader(file)}
    table = published(scenario)
    assert table["max_position_error_m"] == float(rows["max_position_difference_m"]["mean_error"])
    for state, unit in zip("xyzuvw", ["m"] * 3 + ["m_s"] * 3, strict=True):
        for statistic in ("mean_error", "std_error"):
            assert table["states"][state][statistic] == float(rows[f"{state}_{unit}"][statistic])


def test_the_papers_percentile_counts_flights_below_it():
    table = published("landing")
    rows = np.zeros((4, len(SCORE_COLUMNS)))
    rows[:, SCORE_COLUMNS.index("max_position_error_m")] = [0.1, 0.2, 0.3, 0.4]
    assert percentile_of_paper(rows, table)["max_position_error_m"] == 50.0
