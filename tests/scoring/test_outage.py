"""The outage error, worked out by hand: where it is anchored, at which instants, over which samples."""

from __future__ import annotations

import numpy as np
import pytest

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
