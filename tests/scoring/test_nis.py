"""Normalised innovations squared, against the distribution that they promise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from flownav.scoring.consistency import CHI_SQUARE_95, nis_of


def test_the_band_is_that_of_chi_square():
    assert pytest.approx(chi2.ppf(0.95, 1), rel=1e-14) == CHI_SQUARE_95


def test_innovations_as_large_as_expected_have_mean_one_and_95_percent_inside():
    random = np.random.default_rng(1)
    variance = random.uniform(0.01, 9.0, 200_000)
    found = nis_of(random.normal(size=200_000) * np.sqrt(variance), variance)
    assert found is not None
    assert found.mean == pytest.approx(1.0, abs=0.02)
    assert found.inside_fraction == pytest.approx(0.95, abs=0.003)


def test_a_filter_that_trusts_itself_twice_too_much_shows():
    random = np.random.default_rng(2)
    found = nis_of(2.0 * random.normal(size=50_000), np.ones(50_000))
    assert found is not None
    assert found.mean == pytest.approx(4.0, rel=0.03)
    assert found.inside_fraction < 0.7


def test_what_was_not_tested_does_not_count():
    assert nis_of(np.array([np.nan, 1.0]), np.array([1.0, np.nan])) is None
    found = nis_of(np.array([np.nan, 1.0, 5.0]), np.array([1.0, 1.0, 0.0]))
    assert found is not None
    assert found.tested == 1
