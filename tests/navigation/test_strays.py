"""Strays among ranges: how they are counted, and how little a range counts that may be one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flownav.navigation.height import MANY_STRAYS, STRAYS_OVER_RANGES, followed_echo
from flownav.navigation.offers import FEW_STRAYS, STRAY_SPAN_M, stray_variance
from flownav.navigation.records import EchoMemory

NAN = math.nan
EMPTY = EchoMemory(NAN, 0.0, NAN, 0.0, 0.0)


def strays_of(ranges, down=None, m: EchoMemory = EMPTY) -> list[float]:
    """The share after each range."""
    shares = []
    for k, range_m in enumerate(ranges):
        m = followed_echo(range_m, 0.0 if down is None else down[k], m)
        shares.append(m.stray)
    return shares


# -- counting ------------------------------------------------------------------------------------------------
def test_ranges_of_one_ground_are_no_strays_however_noisy_within_a_decimetre():
    random = np.random.default_rng(1)
    assert max(strays_of(2.0 + random.uniform(-0.05, 0.05, 200))) == 0.0


def test_the_first_two_ranges_are_not_judged():
    assert strays_of([2.0, 7.0]) == [0.0, 0.0]


def test_a_range_that_no_neighbour_confirms_is_one_of_twenty():
    assert strays_of([2.0, 2.0, 5.0]) == [0.0, 0.0, pytest.approx(1.0 / STRAYS_OVER_RANGES)]


def test_a_range_after_a_stray_is_confirmed_by_the_one_before_it():
    shares = strays_of([2.0, 2.0, 5.0, 2.0, 2.0])
    assert shares[3] == pytest.approx(shares[2] * (1.0 - 2.0 / STRAYS_OVER_RANGES))
    assert shares[4] < shares[3]


def test_the_share_of_strays_is_followed_and_forgotten():
    k = np.arange(400)
    mixed = np.where(k % 2 == 0, 2.0, 4.0 + 2.0 * (k % 3))  # every other one, and no two of those alike
    shares = strays_of(mixed)
    assert np.mean(shares[200:]) == pytest.approx(1.0 / 3.0, abs=0.02)  # where (1 - m)/20 is m/10
    assert min(shares[200:]) > MANY_STRAYS
    few = np.where(np.arange(400) % 40 == 39, 6.0, 2.0)
    assert max(strays_of(few)) < MANY_STRAYS
    m = EchoMemory(2.0, 0.0, 2.0, 0.0, shares[-1])
    assert strays_of([2.0] * 40, m=m)[-1] < FEW_STRAYS


def test_a_climb_is_no_stray_and_a_range_that_misses_it_is():
    """0.3 m between neighbours, all of it climbed: down falls as the range grows."""
    climbed = 0.3 * np.arange(15)
    assert max(strays_of(2.0 + climbed, -climbed)) == 0.0
    assert strays_of(2.0 + climbed, 0.0 * climbed)[-1] > MANY_STRAYS
    assert max(strays_of(np.full(15, 2.0), -climbed)) == 0.0  # a climb of the filter's alone makes none of sound ranges


def test_in_a_climb_too_a_range_after_a_stray_is_confirmed_by_the_one_before_it_and_the_next_by_that():
    """0.3 m a reading: the fourth is confirmed by the second, the fifth, which follows it, by the fourth alone."""
    climbed = 0.3 * np.arange(6)
    ranges = 2.0 + climbed
    ranges[2] = 7.0
    shares = strays_of(ranges, -climbed)
    assert shares[2:] == pytest.approx([0.9**k / STRAYS_OVER_RANGES for k in range(4)])


def test_what_confirms_grows_with_the_range():
    """0.1 m and 3 %."""
    assert strays_of([20.0, 20.0, 20.6])[-1] == 0.0
    assert strays_of([20.0, 20.0, 20.8])[-1] > 0.0
    assert strays_of([2.0, 2.0, 2.2])[-1] > 0.0


def test_a_step_of_the_ground_is_one_stray():
    shares = strays_of([2.0] * 10 + [0.8] * 10)
    assert shares[10] == pytest.approx(1.0 / STRAYS_OVER_RANGES)
    assert np.all(np.diff(shares[10:]) < 0.0)


# -- weighing ------------------------------------------------------------------------------------------------
def test_without_strays_a_range_counts_as_it_does():
    assert stray_variance(0.3, 0.2, 0.1, 0.0) == 0.1


def test_its_gain_is_that_of_the_probability_that_it_is_none():
    """beta K, beta = (1 - p) N(nu; S) / ((1 - p) N(nu; S) + p/W), written out apart from the package's."""
    innovation, total, variance, stray = 0.4, 0.09, 0.05, 0.2
    p = 0.3
    density = np.exp(-(innovation**2) / (2 * total)) / np.sqrt(2 * np.pi * total)
    beta = (1 - p) * density / ((1 - p) * density + p / STRAY_SPAN_M)
    cross = total - variance  # P_hh: the share of S that is not the range's own
    weighed = stray_variance(innovation, total, variance, stray)
    assert cross / (cross + weighed) == pytest.approx(beta * cross / total, rel=1e-4)


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, 20.0), st.floats(1e-4, 1.0), st.floats(0.01, 0.99), st.floats(0.021, 1.0))
def test_more_strays_and_further_ones_count_less_and_none_counts_more_than_it_does(nu, total, part, stray):
    variance = part * total
    weighed = stray_variance(nu, total, variance, stray)
    assert np.isfinite(weighed)
    assert weighed >= variance
    assert stray_variance(-nu, total, variance, stray) == weighed
    assert stray_variance(nu, total, variance, min(1.0, 1.2 * stray)) >= weighed
    assert stray_variance(nu + 0.1, total, variance, stray) >= weighed


def test_a_range_that_agrees_counts_almost_wholly_and_one_that_is_metres_off_not_at_all():
    total, variance = 0.02, 0.01
    assert stray_variance(0.0, total, variance, 0.3) < 1.5 * variance
    assert stray_variance(2.0, total, variance, 0.3) > 1e3 * variance
