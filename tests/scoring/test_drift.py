"""Where an estimate ends that was right at take-off."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import Array
from flownav.scoring.reference import Motion, end_drift, flight_of

NONE = np.zeros(0)


def walked(t_s: Array) -> Array:
    """On the ground for 5 s, up by a metre and along an arc, down again at 35 s and still for 5 s more."""
    u = np.clip((t_s - 5.0) / 30.0, 0.0, 1.0)
    return np.column_stack([10.0 * np.sin(2.0 * u), 4.0 * (1.0 - np.cos(2.0 * u)), -np.sin(np.pi * u)])


def turned(position: Array, yaw: float, shift=(0.0, 0.0, 0.0)) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return position @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + np.array(shift)


T_S = np.arange(0.0, 40.0, 0.01)
HEADING = 0.4 + 0.2 * T_S  # past half a turn
TRUTH = Motion(T_S, walked(T_S), T_S, (HEADING + np.pi) % (2 * np.pi) - np.pi)


def estimated(yaw: float, error: Array | float = 0.0) -> Motion:
    """The truth in a frame of its own, with an error north in the truth's frame."""
    moved = walked(T_S) + np.column_stack([error + 0.0 * T_S, 0.0 * T_S, 0.0 * T_S])
    return Motion(T_S, turned(moved, yaw, (7.0, -3.0, 1.0)), T_S, (HEADING + yaw) % (2 * np.pi))


def test_flight_lasts_while_the_height_is_not_that_of_the_start():
    down = np.where((T_S > 8.0) & (T_S < 30.0), -0.06, 0.01)
    assert flight_of(T_S, down) == pytest.approx((8.01, 29.99))
    assert flight_of(T_S, 0.04 * np.sin(T_S)) is None
    assert flight_of(NONE, NONE) is None


def test_a_right_path_in_another_frame_ends_where_the_truth_does():
    assert end_drift(estimated(2.0), TRUTH) == pytest.approx(0.0, abs=1e-9)


def test_what_was_gathered_in_flight_counts_and_nothing_else():
    flight = flight_of(TRUTH.t_s, TRUTH.position[:, 2])
    grown = 0.5 * np.clip((T_S - flight[0]) / (flight[1] - flight[0]), 0.0, 1.0)
    assert end_drift(estimated(2.0, grown), TRUTH) == pytest.approx(0.5)
    before = 3.0 * (T_S < 4.0) + 2.0 * (T_S > 36.0)  # while it stands
    assert end_drift(estimated(2.0, before), TRUTH) == pytest.approx(0.0, abs=1e-9)
    assert end_drift(estimated(2.0, 5.0), TRUTH) == pytest.approx(0.0, abs=1e-9)


def test_a_heading_that_is_wrong_at_take_off_is_no_drift_but_one_that_turns_away_is():
    wrong = estimated(2.0)._replace(heading_rad=TRUTH.heading_rad + 2.0 + 0.1)
    flown = walked(T_S)
    way = np.hypot(*(flown[3490] - flown[510])[:2])
    assert end_drift(wrong, TRUTH) == pytest.approx(2.0 * np.sin(0.05) * way, rel=0.02)


def test_the_heading_counts_at_take_off_alone():
    swung = estimated(2.0)._replace(heading_rad=TRUTH.heading_rad + 2.0 + 0.3 * (T_S > 20.0))
    assert end_drift(swung, TRUTH) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("bare", ["estimate", "truth"])
def test_without_a_heading_the_paths_are_turned_onto_each_other(bare):
    estimate, truth = estimated(2.0)._replace(heading_rad=0.0 * T_S), TRUTH
    if bare == "truth":
        truth = truth._replace(heading_t_s=NONE, heading_rad=NONE)
    else:
        estimate = estimate._replace(heading_t_s=NONE, heading_rad=NONE)
    assert end_drift(estimate, truth) == pytest.approx(0.0, abs=1e-9)


def test_an_estimate_that_starts_late_is_laid_on_where_it_starts():
    estimate = estimated(1.0, np.where(T_S < 12.0, 9.0, 0.0))
    late = Motion(*(column[1200:] for column in estimate))
    assert end_drift(late, TRUTH) == pytest.approx(0.0, abs=1e-9)


def test_no_flight_or_no_common_time_is_no_drift():
    assert end_drift(estimated(0.0), TRUTH._replace(position=0.0 * TRUTH.position)) is None
    assert end_drift(estimated(0.0)._replace(t_s=T_S + 100.0), TRUTH) is None
    assert end_drift(Motion(NONE, np.zeros((0, 3)), NONE, NONE), TRUTH) is None
