"""Scores against numbers worked out by hand, and the paper's tables as data."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from flownav.core.frames import quaternion_from_euler
from flownav.scoring.errors import (
    SCORE_COLUMNS,
    attitude_block,
    attitude_rms,
    attitude_scores,
    error_statistics,
    percentile_of_paper,
    published,
    put_error_statistics,
    score_block,
    scores_of_flight,
    scores_of_flights,
)
from flownav.scoring.touchdown import TOUCHDOWN_COLUMNS


def statistics(error, counted=None):
    """Mean, std, RMS and largest of an error (epochs, 1, 1)."""
    counted = np.ones((len(error), 1)) if counted is None else counted
    return error_statistics(error, np.zeros_like(error), counted)[0, 0]


def test_statistics_of_a_known_error():
    error = np.array([1.0, -1.0, 3.0, 1.0]).reshape(-1, 1, 1)
    mean, std, rms, largest = statistics(error)
    assert (mean, rms, largest) == (1.0, pytest.approx(np.sqrt(3.0)), 3.0)
    assert std == pytest.approx(np.std(error))


def test_statistics_in_python_and_compiled_are_the_same_bytes():
    estimate, truth = np.random.default_rng(7).normal(size=(2, 200, 6, 1))
    counted = (np.arange(200.0) % 3.0 > 0.0)[:, None]
    in_python = np.empty((estimate.shape[2], estimate.shape[1], 4))
    put_error_statistics.py_func(estimate, truth, counted, in_python)
    assert in_python.tobytes() == error_statistics(estimate, truth, counted).tobytes()


def test_a_flight_of_which_nothing_counts_has_null_scores():
    zeros, nothing = np.zeros((50, 6, 2)), np.full((2, len(TOUCHDOWN_COLUMNS)), np.nan)
    nothing[:, TOUCHDOWN_COLUMNS.index("expected") :] = 0.0
    counted = np.zeros((50, 2))
    counted[:, 1] = 1.0
    rows = score_block(zeros, zeros, nothing, counted)
    scores = scores_of_flight(rows[0])
    assert scores["max_position_error_m"] is None
    assert set(scores["states"]["x"].values()) == {None}
    assert (scores["touchdown"], scores["crashed"]) == (None, False)
    assert scores_of_flight(rows[1])["max_position_error_m"] == 0.0
    assert scores_of_flights(rows[:1])["max_position_error_m"] is None
    assert scores_of_flights(rows)["max_position_error_m"]["median"] == 0.0


def test_many_flights_give_median_and_percentiles_in_the_same_layout():
    rows = np.tile(np.arange(101.0)[:, None], (1, len(SCORE_COLUMNS)))
    rows[:, SCORE_COLUMNS.index("touchdown.broken")] = 0.0
    rows[:, SCORE_COLUMNS.index("touchdown.beside")] = 0.0
    rows[:3, SCORE_COLUMNS.index("touchdown.broken")] = 1.0
    rows[3:5, SCORE_COLUMNS.index("touchdown.beside")] = 1.0
    scores = scores_of_flights(rows)
    assert scores["states"]["x"]["rms_error"] == {"median": 50.0, "p05": 5.0, "p95": 95.0}
    assert scores["touchdown"]["contact"]["sink_rate_m_s"]["median"] == 50.0
    assert (scores["landed"], scores["crashed"]) == (96, 3)


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


def test_attitude_errors_are_those_of_the_angles_that_were_laid_between_them():
    random = np.random.default_rng(5)
    roll, pitch, yaw = 0.3 * random.standard_normal((3, 200))
    yaw += np.pi  # about south, where an angle leaps by a turn
    off = np.radians([[2.0], [-1.0], [5.0]]) + 0.01 * random.standard_normal((3, 200))
    true = np.array([quaternion_from_euler(*angles) for angles in zip(roll, pitch, yaw, strict=True)])
    said = np.array([quaternion_from_euler(*angles) for angles in (np.array([roll, pitch, yaw]) + off).T])
    counted = np.ones(200)
    counted[::7], said[0], said[3] = 0.0, np.nan, np.nan
    found = attitude_scores(attitude_block(said[:, :, None], true[:, :, None], counted[:, None]))
    kept = np.degrees(off[:, (counted > 0.0) & (np.arange(200) != 3)])
    for angle, error in zip(("roll", "pitch", "yaw"), kept, strict=True):
        expected = error.mean(), error.std(), np.sqrt(np.mean(error**2)), np.abs(error).max()
        assert list(found[angle].values()) == pytest.approx(expected, abs=1e-9)
    assert attitude_scores(attitude_block(np.full((5, 4, 1), np.nan), true[:5, :, None], np.ones((5, 1)))) is None
    two = np.repeat(attitude_block(said[:, :, None], true[:, :, None], counted[:, None]), 2, axis=0)
    assert attitude_rms(two)["yaw"] == pytest.approx(found["yaw"]["rms_error"])
    assert attitude_rms(np.concatenate([two, 2.0 * two]))["yaw"] == pytest.approx(
        np.sqrt(2.5) * found["yaw"]["rms_error"]
    )
    assert attitude_rms(None) == dict.fromkeys(("roll", "pitch", "yaw"))
    assert attitude_scores(two)["yaw"]["rms_error"]["median"] == pytest.approx(found["yaw"]["rms_error"])
