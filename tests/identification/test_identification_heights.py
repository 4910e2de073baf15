"""How the sensor's error grows with height, and one value for several: against published figures and plain sums."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from flownav.lab.identification.height_law import NoisePoint, combined, fit_power_law, spread
from flownav.lab.identification.output_error import Z_95
from flownav.lab.identification.quantities import Interval

# log relative risk and its variance in 13 trials of the BCG vaccine (Colditz and others, JAMA 271, 1994)
BCG = [(-0.8893, 0.3256), (-1.5854, 0.1946), (-1.3481, 0.4154), (-1.4416, 0.0200), (-0.2175, 0.0512),
       (-0.7861, 0.0069), (-1.6209, 0.2230), (0.0120, 0.0040), (-0.4694, 0.0564), (-1.3713, 0.0730),
       (-0.3394, 0.0124), (0.4459, 0.5325), (-0.0173, 0.0714)]  # fmt: skip


def sigma_of(interval: Interval) -> float:
    return (interval.high - interval.low) / (2.0 * Z_95)


def test_several_trials_combine_to_what_dersimonian_and_laird_publish():
    """The R package metafor prints -0.7141 (standard error 0.1787) for these trials by their method."""
    found = combined([Interval.of(value, math.sqrt(variance)) for value, variance in BCG])
    assert (found.value, sigma_of(found)) == pytest.approx((-0.7141, 0.1787), abs=5e-5)


@given(st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=12), st.floats(0.01, 5.0))
def test_equally_known_values_have_the_error_of_their_mean_or_what_each_states_if_that_is_more(values, sigma):
    """With one variance s² for all, the estimate of what lies between them is their sample variance less s²."""
    found = combined([Interval.of(value, sigma) for value in values])
    assert found.value == pytest.approx(np.mean(values), abs=1e-9)
    expected = math.sqrt(max(float(np.var(values, ddof=1)), sigma**2) / len(values))
    assert sigma_of(found) == pytest.approx(expected, rel=1e-6)


def test_five_robust_deviations_of_a_normal_error_are_five_of_its_standard_deviations():
    """The median deviation of a normal error is 0.6745 of its standard deviation (Rousseeuw and Croux 1993)."""
    normal = stats.norm.ppf((np.arange(4000) + 0.5) / 4000)
    inside, outside = 0.3 * np.append(normal, 4.8), 0.3 * np.append(normal, [4.8, 5.2])
    assert spread(inside) == pytest.approx(np.std(inside - np.median(inside)), rel=1e-9)
    assert spread(outside) == pytest.approx(spread(inside), rel=1e-4)
    assert spread(inside) > 1.001 * spread(0.3 * normal)


def noisy_points(random, heights, readings, scatter=0.0):
    """Standard deviations as this number of normal readings gives them, of the law 0.05 h^1.5, each off by a factor."""
    return [
        NoisePoint(h, float(0.05 * h**1.5 * np.exp(scatter * random.standard_normal()) *
                            np.std(random.standard_normal(readings))), readings)
        for h in heights
    ]  # fmt: skip


@pytest.mark.parametrize("scatter", [0.0, 0.3])
def test_the_power_laws_intervals_hold_as_often_as_they_say_and_are_no_wider(scatter):
    random, held, fits = np.random.default_rng(21), np.zeros(2), 400
    exponents, sigmas = [], []
    for _ in range(fits):
        law = fit_power_law(noisy_points(random, np.geomspace(0.4, 4.0, 12), 100, scatter))
        truth = 0.05 * law.reference_m**1.5
        held += [law.exponent.low <= 1.5 <= law.exponent.high, law.sigma_m_s.low <= truth <= law.sigma_m_s.high]
        exponents.append(law.exponent.value)
        sigmas.append(sigma_of(law.exponent))
    assert np.all((held / fits > 0.89) & (held / fits < 0.99))
    assert np.mean(sigmas) == pytest.approx(np.std(exponents), rel=0.2)


def test_two_heights_say_as_much_of_the_exponent_as_their_readings_do():
    """A standard deviation of n normal readings is known to 1/sqrt(2n); no scatter is left to learn it from."""
    random = np.random.default_rng(22)
    laws = [fit_power_law(noisy_points(random, (0.5, 2.0), 100)) for _ in range(600)]
    scatter = np.std([law.exponent.value for law in laws])
    assert scatter == pytest.approx(sigma_of(laws[0].exponent), rel=0.12)
    assert sigma_of(laws[0].exponent) == pytest.approx(0.1 / math.log(4.0), rel=1e-9)


def test_the_power_law_is_held_outside_the_heights_it_was_fitted_to():
    law = fit_power_law([NoisePoint(h, 0.05 * h**2, 1000) for h in (0.5, 1.0, 2.0)])
    assert law.at([0.1, 0.5, 2.0, 9.0]) == pytest.approx([0.0125, 0.0125, 0.2, 0.2])
