"""The outage error, worked out by hand: where it is anchored, at which instants, over which samples."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.scoring.path import Path, References, outage_of
from flownav.scoring.reference import difference_at, horizontal_rms, outage_error

T_S = np.arange(0.0, 20.0, 0.1)
STRAIGHT = np.column_stack([2.0 * T_S, -1.0 * T_S])  # 2 m/s north, 1 m/s west


def test_an_estimate_that_is_off_by_a_constant_has_no_outage_error():
    gps_t_s = np.arange(1.0, 19.0, 0.5)
    gps = np.column_stack([2.0 * gps_t_s, -1.0 * gps_t_s])
    found = outage_error(T_S, STRAIGHT + np.array([30.0, -4.0]), gps_t_s, gps, 0.0, 5.0, 15.0)
    assert (found.horizontal_rms_m, found.horizontal_max_m) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_fix_is_compared_with_where_the_vehicle_was_when_it_was_taken():
    gps_t_s = np.arange(1.0, 19.0, 0.5)
    late = np.column_stack([2.0 * (gps_t_s - 0.3), -1.0 * (gps_t_s - 0.3)])
    error = difference_at(T_S, STRAIGHT, gps_t_s - 0.3, late)
    assert error == pytest.approx(np.zeros_like(error), abs=1e-9)
    bent = np.column_stack([np.maximum(T_S, 10.0), np.zeros(len(T_S))])
    fixes = np.column_stack([np.maximum(gps_t_s - 0.3, 10.0), np.zeros(len(gps_t_s))])
    found = outage_error(T_S, bent, gps_t_s, fixes, 0.3, 5.0, 15.0)
    assert found.horizontal_max_m == pytest.approx(0.0, abs=1e-9)


def test_drift_counts_from_the_mean_of_the_first_five_fixes():
    gps_t_s = np.arange(5.0, 15.0, 1.0)
    drifted = STRAIGHT + np.column_stack([np.maximum(T_S - 9.0, 0.0), np.zeros(len(T_S))])
    fixes = np.column_stack([2.0 * gps_t_s, -1.0 * gps_t_s])
    found = outage_error(T_S, drifted, gps_t_s, fixes, 0.0, 5.0, 15.0)
    assert found.horizontal_max_m == pytest.approx(5.0)
    assert found.horizontal_rms_m == pytest.approx(np.sqrt((1 + 4 + 9 + 16 + 25) / 10))


def test_too_few_fixes_say_nothing():
    gps_t_s = np.arange(5.0, 10.0, 1.0)
    assert np.isnan(outage_error(T_S, STRAIGHT, gps_t_s, np.zeros((5, 2)), 0.0, 5.0, 15.0).horizontal_rms_m)


def test_nothing_is_said_outside_the_estimates_time():
    reference_t_s = np.array([-1.0, 3.05, 19.85, 25.0])
    error = difference_at(T_S, STRAIGHT, reference_t_s, np.zeros((4, 2)))
    assert error == pytest.approx(np.array([[6.1, -3.05], [39.7, -19.85]]))
    assert len(difference_at(np.zeros(0), np.zeros((0, 2)), reference_t_s, np.zeros((4, 2)))) == 0
    assert np.isnan(horizontal_rms(T_S, STRAIGHT, np.array([99.0]), np.zeros((1, 2))))


# -- against the truth ----------------------------------------------------------------------------------------
AWAY = np.array([3.0, -7.0])
TURN = np.array([[0.6, 0.8], [-0.8, 0.6]])  # the truth's own north is turned by 53 degrees


def weaving(t_s: np.ndarray) -> np.ndarray:
    """North and east of a path that shows its heading, (n, 2) [m]."""
    return np.column_stack([8.0 * np.sin(0.4 * t_s), 5.0 * np.cos(0.3 * t_s)])


def known(truth_ne: np.ndarray | None, truth_t_s: np.ndarray, gps_walk_m_s: float) -> References:
    fixes_t_s = np.arange(0.5, 20.0, 0.2)
    way, since_s = weaving(fixes_t_s - 0.3), fixes_t_s - fixes_t_s.mean()
    along = (way - way.mean(axis=0)).T @ since_s  # a walk in this direction turns nothing
    walked = way + gps_walk_m_s * np.outer(since_s, along / np.linalg.norm(along))
    truth = None if truth_ne is None else {
        "t_s": truth_t_s, "pos_n_m": truth_ne[:, 0], "pos_e_m": truth_ne[:, 1], "pos_d_m": np.zeros(len(truth_t_s)),
    }  # fmt: skip
    return References((fixes_t_s, np.column_stack([walked, np.zeros(len(walked))])), None, 0.3, (), truth, "capture")


def flown(drift_m_s: float) -> Path:
    """A path that drifts north between 5 and 15 s, as GPS cut from 5.3 to 15.3 s on leaves it, and is right after."""
    away = drift_m_s * np.clip(T_S - 5.0, 0.0, 10.0) * (T_S < 15.0)
    position = np.column_stack([weaving(T_S), np.zeros(len(T_S))]) + np.column_stack([away, 0.0 * T_S, 0.0 * T_S])
    return Path(T_S, position, np.full((len(T_S), 2), np.nan))


def test_where_a_log_has_a_truth_the_slow_error_of_gps_is_no_drift():
    truth_t_s = np.arange(0.0, 19.9, 0.05)
    truth = (weaving(truth_t_s) + AWAY) @ TURN
    found = outage_of(flown(0.0), known(truth, truth_t_s, 0.2), 5.3, 15.3)
    assert found.horizontal_max_m < 0.01  # of the path's samples, 0.1 s apart
    against_gps = outage_of(flown(0.0), known(None, truth_t_s, 0.2), 5.3, 15.3)
    assert against_gps.horizontal_max_m == pytest.approx(0.2 * 9.4, abs=0.15)


def test_drift_against_a_truth_is_that_of_the_cut_alone():
    """The cut begins and ends with the instants that GPS describes: what GPS mends behind it does not count."""
    truth_t_s = np.arange(0.0, 19.9, 0.05)
    found = outage_of(flown(0.1), known((weaving(truth_t_s) + AWAY) @ TURN, truth_t_s, 0.2), 5.3, 15.3)
    assert found.horizontal_max_m == pytest.approx(0.1 * 10.0, abs=0.02)
    assert found.horizontal_rms_m == pytest.approx(0.1 * 10.0 / np.sqrt(3.0), abs=0.02)


def test_a_heading_that_is_wrong_in_a_cut_or_all_the_time_is_an_error_of_the_cut():
    """No turn of the truth onto the estimate takes it away: GPS shows the truth's north, and no estimate bends that."""
    truth_t_s = np.arange(0.5, 20.0, 0.2) - 0.3  # at the instants that GPS describes
    against, angle = known((weaving(truth_t_s) + AWAY) @ TURN, truth_t_s, 0.0), np.radians(20.0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    wrong = flown(0.0)
    wrong.position[:, :2] = wrong.position[:, :2] @ turn
    expected = outage_of(wrong, against._replace(truth=None), 5.3, 15.3)
    found = outage_of(wrong, against, 5.3, 15.3)
    assert expected.horizontal_max_m > 3.0
    assert found.horizontal_max_m == pytest.approx(expected.horizontal_max_m, abs=1e-6)
    late = flown(0.0)
    late.position[T_S > 5.0, :2] = wrong.position[T_S > 5.0, :2]
    assert outage_of(late, against, 5.3, 15.3).horizontal_max_m == pytest.approx(found.horizontal_max_m, abs=1e-9)


def test_an_outage_without_any_reference_is_an_error():
    with pytest.raises(ValueError, match="against a truth or GPS"):
        outage_of(flown(0.0), References(), 5.0, 15.0)
