"""The outage error, by its definition, and the alignment of a turned truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flownav.scoring.reference import align, horizontal_rms, outage_error, velocity_of

T = np.arange(0.0, 100.0, 0.1)
PATH = np.column_stack([2.0 * T, -T])


def gps_of(t_s, delay):
    return np.column_stack([2.0 * (t_s - delay), -(t_s - delay)])


def test_a_perfect_estimate_has_no_error():
    gps_t = np.arange(0.0, 100.0, 0.2)
    found = outage_error(T, PATH, gps_t, gps_of(gps_t, 0.22), 0.22, 20.0, 40.0)
    assert found.horizontal_rms_m == pytest.approx(0.0, abs=1e-9)


@settings(deadline=None)
@given(st.floats(-5, 5), st.floats(-5, 5))
def test_a_constant_offset_does_not_count(north, east):
    gps_t = np.arange(0.0, 100.0, 0.2)
    found = outage_error(T, np.add(PATH, [north, east]), gps_t, gps_of(gps_t, 0.22), 0.22, 20.0, 40.0)
    assert found.horizontal_max_m == pytest.approx(0.0, abs=1e-9)


def test_a_drift_counts_from_the_mean_of_the_first_five():
    """0.1 m/s of drift east from 20 s: at GPS sample k the error is 0.02 (k - 2)."""
    gps_t = np.arange(0.0, 100.0, 0.2)
    drift = np.column_stack([0 * T, 0.1 * (T - 20.0)])
    found = outage_error(T, PATH + drift, gps_t, gps_of(gps_t, 0.22), 0.22, 20.0, 40.0)
    k = np.arange(np.count_nonzero((gps_t >= 20) & (gps_t < 40)))
    assert found.horizontal_rms_m == pytest.approx(np.sqrt(np.mean((0.02 * (k - 2)) ** 2)), rel=1e-9)
    assert found.horizontal_max_m == pytest.approx(0.02 * (k[-1] - 2), rel=1e-9)


def test_the_delay_matters_by_the_speed():
    gps_t = np.arange(0.0, 100.0, 0.2)
    turning = np.column_stack([np.cos(T), np.sin(T)])
    gps = np.column_stack([np.cos(gps_t - 0.22), np.sin(gps_t - 0.22)])
    right = outage_error(T, turning, gps_t, gps, 0.22, 20.0, 40.0)
    wrong = outage_error(T, turning, gps_t, gps, 0.0, 20.0, 40.0)
    assert right.horizontal_rms_m < 0.01
    assert wrong.horizontal_rms_m > 0.2


def test_windows_that_cannot_be_scored_are_nan():
    gps_t = np.array([20.0, 20.2, 20.4, 20.6, 20.8])
    assert np.isnan(outage_error(T, PATH, gps_t, gps_of(gps_t, 0.0), 0.0, 20.0, 40.0).horizontal_rms_m)
    assert np.isnan(outage_error(T, PATH, gps_t, gps_of(gps_t, 0.0), 0.0, 50.0, 60.0).horizontal_rms_m)
    assert np.isnan(outage_error(T[:0], PATH[:0], gps_t, gps_of(gps_t, 0.0), 0.0, 20.0, 40.0).horizontal_rms_m)


def test_horizontal_rms_is_of_lengths():
    assert horizontal_rms(T, np.add(PATH, [0.3, 0.4]), T, PATH) == pytest.approx(0.5)
    assert np.isnan(horizontal_rms(T, PATH, T + 1000.0, PATH))


@settings(deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(-50, 50), st.floats(-50, 50), st.floats(-5, 5))
def test_alignment_undoes_a_turn_and_a_shift(yaw, north, east, down):
    reference = np.column_stack([np.cos(0.3 * T), np.sin(0.5 * T), 0.1 * np.sin(T)])
    cosine, sine = np.cos(yaw), np.sin(yaw)
    estimate = reference @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]]) + [north, east, down]
    found = align(estimate, reference)
    assert found.yaw_rad == pytest.approx(yaw, abs=1e-9)
    assert found.moved(reference) == pytest.approx(estimate, abs=1e-9)


def test_velocity_of_a_path_is_its_slope():
    position = np.column_stack([2.0 * T, -T, 0.5 * T])
    assert velocity_of(T, position) == pytest.approx(np.tile([2.0, -1.0, 0.5], (len(T), 1)))
