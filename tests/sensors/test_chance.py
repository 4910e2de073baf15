"""Events, spells and factors of chance: their probabilities, lengths and medians."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.sensors.processes import factor, level_of, spell, spell_levels


def test_a_normal_exceeds_its_level_with_the_probability() -> None:
    for probability in (1e-6, 0.01, 0.3, 0.5, 0.9):
        assert 0.5 * math.erfc(level_of(probability) / math.sqrt(2.0)) == pytest.approx(probability, rel=1e-9)
    largest = math.sqrt(-2.0 * math.log(2.0**-52))  # what the generator can draw
    assert level_of(0.0) > largest
    assert level_of(1.0) < -largest


@pytest.mark.parametrize("probability", [-0.1, 1.1, math.nan])
def test_no_probability_is_refused(probability: float) -> None:
    with pytest.raises(ValueError, match="a probability from 0 to 1 is needed"):
        level_of(probability)


@pytest.mark.parametrize("share", [-0.1, 0.6])
def test_a_spell_fills_half_of_the_time_at_most(share: float) -> None:
    with pytest.raises(ValueError, match=r"a share from 0 to 0\.5 is needed"):
        spell_levels(share, 1.0, 0.1)


@pytest.mark.parametrize(("share", "mean_s"), [(0.2, 1.0), (0.5, 0.3), (0.05, 0.01)])
def test_spells_fill_their_share_and_last_their_mean(share: float, mean_s: float) -> None:
    period_s, count = 0.1, 60_000
    begins, ends = spell_levels(share, mean_s, period_s)
    now, series = 0.0, np.empty(count)
    for k, normal in enumerate(np.random.default_rng(1).standard_normal(count)):
        now = series[k] = spell(now, float(normal), begins, ends)
    assert set(series) <= {0.0, 1.0}
    assert series.mean() == pytest.approx(share, rel=0.1)
    beginnings = np.count_nonzero(np.diff(series) > 0)
    assert series.sum() / beginnings * period_s == pytest.approx(max(mean_s, period_s / (1.0 - share)), rel=0.12)


def test_a_spell_of_no_share_never_begins() -> None:
    begins, ends = spell_levels(0.0, 1.0, 0.1)
    assert spell(0.0, 8.6, begins, ends) == 0.0


def test_a_factor_is_positive_its_median_is_one_and_its_reciprocal_as_likely() -> None:
    assert factor(0.3, 0.0) == 1.0
    for normal in (0.1, 1.0, 4.0):
        assert factor(0.3, normal) == pytest.approx(1.0 + 0.3 * normal)
        assert factor(0.3, -normal) == pytest.approx(1.0 / factor(0.3, normal))
    assert factor(2.0, -8.0) > 0.0
