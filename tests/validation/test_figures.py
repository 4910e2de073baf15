"""Figures on made series whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.studies.validation.figures import Smoothed, fit_flow, robust_sigma, run_length, slow_share

RNG = np.random.default_rng(5)


def _smoothed(t_s, velocity):
    rows = np.zeros((len(t_s), 20))
    rows[:, 0], rows[:, 4:7], rows[:, 7] = t_s, velocity, 1.0
    return Smoothed(rows)


def test_gain_lag_and_noise_of_a_flow_are_found():
    t_s = np.arange(0.0, 120.0, 0.02)
    velocity = np.column_stack([np.sin(0.9 * t_s), np.cos(0.7 * t_s), np.zeros_like(t_s)])
    at = np.arange(5.0, 115.0, 0.1)
    slant_m = 2.0 + 0.5 * np.sin(0.2 * at)
    late = np.column_stack([np.sin(0.9 * (at - 0.12)), np.cos(0.7 * (at - 0.12))])
    seen = 0.85 * late / slant_m[:, None] + RNG.normal(0.0, 0.03, late.shape)
    found = fit_flow(at, seen, slant_m, _smoothed(t_s, velocity))
    assert found.gain == pytest.approx(0.85, abs=0.01)
    assert found.lag_s == pytest.approx(0.12, abs=0.021)
    assert found.noise_rad_s == pytest.approx(0.03, rel=0.1)
    assert abs(found.noise_lag_one) < 0.1


def test_too_little_flow_says_nothing():
    t_s = np.arange(0.0, 2.0, 0.1)
    found = fit_flow(t_s, np.zeros((20, 2)), np.ones(20), _smoothed(t_s, np.ones((20, 3))))
    assert np.isnan(found).all()


def test_white_noise_has_a_tenth_of_its_power_below_a_tenth_of_the_spectrum():
    white = RNG.normal(size=20000)
    assert slow_share(white) == pytest.approx(0.1, abs=0.015)
    assert slow_share(np.cumsum(white)) > 0.9
    assert np.isnan(slow_share(white[:3]))


def test_strays_do_not_touch_the_robust_deviation():
    values = RNG.normal(0.0, 2.0, 10000)
    values[:1000] = 500.0
    assert robust_sigma(values) == pytest.approx(2.0, rel=0.2)


def test_runs_are_counted_by_their_length():
    assert run_length(np.array([1, 1, 0, 1, 0, 0, 1, 1, 1], bool)) == 2.0
    assert run_length(np.zeros(4, bool)) == 0.0
