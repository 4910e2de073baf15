"""The difference of two estimates: its interval holds the true mean as often as it says, errors correlated or not."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.scoring.percentiles import BATCHES, LEAST_ROWS, mean_difference


def markov(random: np.random.Generator, count: int, keep: float) -> np.ndarray:
    noise = random.normal(size=count) * np.sqrt(1 - keep * keep)
    for row in range(1, count):
        noise[row] += keep * noise[row - 1]
    return noise


@pytest.mark.parametrize("keep", [0.0, 0.95], ids=["white", "correlated"])
def test_the_interval_holds_the_true_difference_as_often_as_it_says(keep: float) -> None:
    random = np.random.default_rng(5)
    t_s = np.arange(2000) * 0.02
    held = 0
    for _ in range(300):
        found = mean_difference(t_s, markov(random, 2000, keep), markov(random, 2000, keep) + 0.3)
        assert found is not None
        held += found.low <= 0.3 <= found.high
    assert 0.90 <= held / 300 <= 0.985  # 0.95 stated; three standard deviations of a share of 300 are 0.038


def test_a_constant_difference_is_found_exactly() -> None:
    t_s = np.arange(0.0, 50.0, 0.1)
    found = mean_difference(t_s, np.sin(t_s), np.sin(t_s) + 0.25)
    assert found == pytest.approx((0.25, 0.25, 0.25))


def test_instants_that_are_no_numbers_count_for_nothing() -> None:
    t_s = np.arange(400.0)
    other = np.where(t_s < 200.0, 1.0, np.nan)
    found = mean_difference(t_s, np.zeros(400), other)
    assert found is not None
    assert found.mean == 1.0
    assert mean_difference(t_s, np.zeros(400), np.full(400, np.nan)) is None


def test_too_few_instants_have_a_mean_and_no_interval() -> None:
    t_s = np.arange(float(BATCHES * LEAST_ROWS - 1))
    found = mean_difference(t_s, 0 * t_s, 0 * t_s + 2.0)
    assert found is not None
    assert found.mean == 2.0
    assert np.isnan(found.low)
    assert np.isnan(found.high)
