"""Scores against numbers worked out by hand, and the paper's tables as data."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from flownav.scoring.errors import (
    SCORE_COLUMNS,
    error_statistics,
    first_contact,
    score_block,
    scores_of_flight,
    scores_of_flights,
)
from flownav.scoring.paper_tables import percentile_of_paper, published


def statistics(error, counted=None):
    """Mean, std, RMS and largest of an error (epochs, 1, 1)."""
    counted = np.ones((len(error), 1)) if counted is None else counted
    return error_statistics(error, np.zeros_like(error), counted)[0, 0]


def test_statistics_of_a_known_error():
    error = np.array([1.0, -1.0, 3.0, 1.0]).reshape(-1, 1, 1)
    mean, std, rms, largest = statistics(error)
    assert (mean, rms, largest) == (1.0, pytest.approx(np.sqrt(3.0)), 3.0)
    assert std == pytest.approx(np.std(error))


def contacts(pattern):
    """on_ground (epochs, 1) from runs of (value, epochs)."""
    return np.concatenate([np.full(count, float(value)) for value, count in pattern])[:, None]


def test_touchdown_is_the_first_contact_after_half_a_second_of_flight_with_the_sink_rate_just_before():
    on_ground = contacts([(1, 5), (0, 3), (1, 2), (0, 30), (1, 4), (0, 40), (1, 4)])  # flutter, flight, bounce
    epochs = len(on_ground)
    t_s, sink = np.arange(float(epochs)), np.arange(float(epochs))[:, None] / 100
    position = np.zeros((epochs, 3, 1))
    position[40, :2, 0] = 3.0, 4.0
    assert first_contact(t_s, position, sink, on_ground)[0] == pytest.approx([40.0, 5.0, 0.39])


def scored(on_ground, sink_m_s=0.1, may_land_after_s=0.0):
    epochs = len(on_ground)
    zeros = np.zeros((epochs, 6, 1))
    sink = np.full((epochs, 1), sink_m_s)
    row = score_block(np.arange(epochs) * 0.02, zeros, zeros, sink, on_ground, may_land_after_s=may_land_after_s)[0]
    return scores_of_flight(row)


def test_a_flight_that_never_lands_has_no_touchdown():
    assert (scored(contacts([(0, 50)]))["touchdown"], scored(contacts([(0, 50)]))["crashed"]) == (None, False)


def test_a_soft_contact_when_landing_is_allowed_is_a_touchdown():
    scores = scored(contacts([(0, 50), (1, 10)]))
    assert scores["touchdown"]["t_s"] == pytest.approx(1.0)
    assert not scores["crashed"]


def test_a_contact_before_landing_is_allowed_or_a_hard_one_is_a_crash():
    early = scored(contacts([(0, 50), (1, 10)]), may_land_after_s=5.0)
    assert (early["touchdown"], early["crashed"]) == (None, True)
    assert scored(contacts([(0, 50), (1, 10)]), sink_m_s=3.0)["crashed"]


def test_a_flight_of_which_nothing_counts_has_null_scores():
    zeros, on_ground = np.zeros((50, 6, 2)), np.zeros((50, 2))
    counted = np.zeros((50, 2))
    counted[:, 1] = 1.0
    rows = score_block(np.arange(50) * 0.02, zeros, zeros, on_ground, on_ground, may_land_after_s=0.0, counted=counted)
    scores = scores_of_flight(rows[0])
    assert scores["max_position_error_m"] is None
    assert set(scores["states"]["x"].values()) == {None}
    assert scores_of_flight(rows[1])["max_position_error_m"] == 0.0
    assert scores_of_flights(rows[:1])["max_position_error_m"] is None
    assert scores_of_flights(rows)["max_position_error_m"]["median"] == 0.0


def test_many_flights_give_median_and_percentiles_in_the_same_layout():
    rows = np.tile(np.arange(101.0)[:, None], (1, len(SCORE_COLUMNS)))
    scores = scores_of_flights(rows)
    assert scores["states"]["x"]["rms_error"] == {"median": 50.0, "p05": 5.0, "p95": 95.0}
    assert (scores["landed"], scores["crashed"]) == (1, 5050)  # the row numbers stand for every column
    assert scores["touchdown"]["sink_rate_m_s"]["median"] == 50.0


@pytest.mark.parametrize(("number", "name"), [(5, "table5_takeoff.csv"), (6, "table6_landing.csv")])
def test_published_tables_are_the_papers(paper_folder, number, name):
    with (paper_folder / name).open(encoding="utf-8") as file:
        rows = {row["state"]: row for row in csv.DictReader(file)}
    table = published(number)
    assert table["max_position_error_m"] == float(rows["max_position_difference_m"]["mean_error"])
    for state, unit in zip("xyzuvw", ["m"] * 3 + ["m_s"] * 3, strict=True):
        for statistic in ("mean_error", "std_error"):
            assert table["states"][state][statistic] == float(rows[f"{state}_{unit}"][statistic])


def test_the_papers_percentile_counts_flights_below_it():
    table = published(6)
    rows = np.zeros((4, len(SCORE_COLUMNS)))
    rows[:, SCORE_COLUMNS.index("max_position_error_m")] = [0.1, 0.2, 0.3, 0.4]
    assert percentile_of_paper(rows, table)["max_position_error_m"] == 50.0


def test_the_largest_error_is_so_on_either_side():
    error = np.array([1.0, -4.0, 3.0]).reshape(-1, 1, 1)
    assert statistics(error)[3] == 4.0
    assert statistics(-error)[3] == 4.0


def test_only_the_steps_that_count_are_scored_each_lane_by_itself():
    error = np.array([9.0, 1.0, -3.0, 9.0])[:, None, None] * np.array([1.0, 2.0, 1.0])
    counted = np.array([[0.0, 1.0, 1.0, 0.0]] * 2 + [[0.0] * 4]).T
    found = error_statistics(error, np.zeros_like(error), counted)[:, 0]
    assert found[0] == pytest.approx([-1.0, 2.0, np.sqrt(5.0), 3.0])
    assert found[1] == pytest.approx(2.0 * np.array([-1.0, 2.0, np.sqrt(5.0), 3.0]))
    assert np.isnan(found[2]).all()


@pytest.mark.parametrize(("epochs", "airborne"), [(24, False), (25, True)])
def test_half_a_second_without_contact_at_50_hz_is_a_flight(epochs, airborne):
    on_ground = contacts([(1, 5), (0, epochs), (1, 5)])
    t_s, zeros = np.arange(len(on_ground)) * 0.02, np.zeros((len(on_ground), 1))
    (contact,) = first_contact(t_s, np.zeros((len(on_ground), 3, 1)), zeros, on_ground)
    assert np.isfinite(contact[0]) == airborne
    assert not airborne or contact[0] == pytest.approx((5 + epochs) * 0.02)


def test_how_far_from_the_pad_it_touched_is_along_the_ground():
    on_ground = contacts([(0, 30), (1, 5)])
    position = np.tile(np.array([3.0, -4.0, -0.2])[:, None], (len(on_ground), 1, 1))
    (contact,) = first_contact(np.arange(35.0), position, np.zeros((35, 1)), on_ground)
    assert contact[1] == pytest.approx(5.0)
