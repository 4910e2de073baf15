"""Plans, bounds and verdicts: the figures of NASA TP-2010-216447, SciPy's intervals, and honesty on known truths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, binomtest

from flownav.campaigns.tolerance import (
    allowed,
    flights_to_show,
    interval,
    joint,
    needed,
    risk,
    shown,
    tolerance_bound,
    verdict,
)


def chance_to_pass(flights: int, failure_rate: float, probability: float, confidence: float) -> float:
    """Probability that this number of flights passes when each fails at this rate."""
    most = allowed(flights, probability, confidence)
    return float(binom.cdf(most, flights, failure_rate)) if most >= 0 else 0.0


@pytest.mark.parametrize(
    ("probability", "plans"), [(0.95, (45, 77, 105)), (0.9973, (852, 1440, 1970)), (0.997, (767, 1296, 1773))]
)
def test_flights_needed_are_those_of_the_order_statistics(probability, plans):
    for failures, flights in enumerate(plans):
        assert needed(probability, 0.90, failures) == flights
        assert shown(flights, failures, probability, 0.90)
        assert not shown(flights - 1, failures, probability, 0.90)
        assert not shown(flights, failures + 1, probability, 0.90)
        assert allowed(flights, probability, 0.90) == failures
        assert allowed(flights - 1, probability, 0.90) == failures - 1


def test_too_much_asked_is_said():
    with pytest.raises(ValueError, match=r"needs more than 1,000,000,000 flights"):
        needed(1.0 - 1e-10, 0.9, 0)


@pytest.mark.parametrize(("flights", "failures"), [(45, 0), (77, 1), (500, 37), (20, 20)])
def test_bounds_are_scipys_one_sided_exact_intervals(flights, failures):
    low, high = interval(flights, failures, 0.9)
    below = binomtest(flights - failures, flights, alternative="greater").proportion_ci(0.9, method="exact")
    above = binomtest(flights - failures, flights, alternative="less").proportion_ci(0.9, method="exact")
    assert low == pytest.approx(below.low, abs=1e-12)
    assert high == pytest.approx(above.high, abs=1e-12)


def test_a_pass_is_a_lower_bound_at_the_probability_and_a_fail_an_upper_one_below_it():
    for flights in (45, 105, 300, 1000):
        for failures in range(0, 80, 3):
            if failures > flights:
                continue
            low, high = interval(flights, failures, 0.9)
            said = verdict(flights, failures, 0.95, 0.9)
            assert (said == "pass") == (low >= 0.95)
            assert (said == "fail") == (high < 0.95)
    assert verdict(44, 0, 0.95, 0.9) == "not shown"
    assert verdict(3, 3, 0.95, 0.9) == "fail"


def test_the_risk_is_that_of_a_share_at_the_edge_and_no_more_than_stated():
    for flights in (44, 45, 100, 767, 5000):
        most = allowed(flights, 0.95, 0.9)
        assert risk(flights, most, 0.95) == pytest.approx(binom.cdf(most, flights, 0.05) if most >= 0 else 0.0)
        assert risk(flights, most, 0.95) <= 0.1
        assert risk(flights, most + 1, 0.95) > 0.1


@pytest.mark.parametrize("truth", [0.90, 0.949, 0.95, 0.951, 0.99])
@pytest.mark.parametrize("flights", [105, 400])
def test_the_verdict_is_right_in_nine_of_ten_repeats_whatever_the_truth(truth, flights):
    failures = np.random.default_rng(int(1000 * truth) + flights).binomial(flights, 1.0 - truth, 2000)
    said = [verdict(flights, int(each), 0.95, 0.90) for each in failures]
    wrong = "fail" if truth >= 0.95 else "pass"
    for repeats in np.array(said).reshape(10, 200):
        assert (repeats != wrong).mean() >= 0.9 - 3.0 * np.sqrt(0.09 / 200)
    assert (np.array(said) != wrong).mean() >= 0.9


def test_a_clear_truth_is_found():
    rng = np.random.default_rng(5)
    good = [verdict(400, int(each), 0.95, 0.9) for each in rng.binomial(400, 0.01, 200)]
    bad = [verdict(400, int(each), 0.95, 0.9) for each in rng.binomial(400, 0.12, 200)]
    assert good.count("pass") >= 190
    assert bad.count("fail") >= 190


def test_flights_spread_evenly_over_unlike_cells_do_not_take_more_risk():
    """Two cells with failure rates 0 and 0.1, 0.05 together: fewer pass by luck than of a single rate."""
    rng, flights = np.random.default_rng(6), 105
    failures = rng.binomial(flights // 2, 0.0, 20_000) + rng.binomial(flights - flights // 2, 0.1, 20_000)
    assert (failures <= allowed(flights, 0.95, 0.9)).mean() <= 0.1


def test_together_all_must_pass_and_one_fails_them_all():
    assert joint(["pass", "pass"]) == "pass"
    assert joint(["pass", "not shown"]) == "not shown"
    assert joint(["not shown", "fail"]) == "fail"


def test_the_risk_of_a_joint_pass_is_that_of_one_requirement():
    """Three requirements of which one is only just not met: they pass together no more often than it alone."""
    rng = np.random.default_rng(7)
    at_edge, others = rng.binomial(105, 0.05, 5000), rng.binomial(105, 0.001, (2, 5000))
    passed = [
        joint(verdict(105, int(f), 0.95, 0.9) for f in flights) == "pass"
        for flights in zip(at_edge, *others, strict=True)
    ]
    assert np.mean(passed) <= 0.1 + 3.0 * np.sqrt(0.09 / 5000)


# -- tolerance bounds -------------------------------------------------------------------------------------
def test_the_tolerance_bound_holds_the_stated_share_as_often_as_stated():
    rng = np.random.default_rng(8)
    bounds = [tolerance_bound(rng.random(105), 0.95, 0.9) for _ in range(2000)]
    assert 0.9 <= np.mean(np.array(bounds) >= 0.95) <= 0.93
    lower = [tolerance_bound(rng.random(105), 0.95, 0.9, upper=False) for _ in range(2000)]
    assert 0.9 <= np.mean(np.array(lower) <= 0.05) <= 0.93


def test_the_tolerance_bound_agrees_with_the_verdict():
    rng = np.random.default_rng(9)
    for _ in range(200):
        figures = rng.gamma(2.0, 0.1, 150)
        bound = tolerance_bound(figures, 0.95, 0.9)
        assert (bound <= 0.5) == (verdict(150, int((figures > 0.5).sum()), 0.95, 0.9) == "pass")


def test_without_enough_flights_or_figures_there_is_no_bound():
    assert tolerance_bound(np.zeros(44), 0.95, 0.9) == np.inf
    assert tolerance_bound(np.zeros(44), 0.95, 0.9, upper=False) == -np.inf
    assert tolerance_bound(np.where(np.arange(105) < 3, np.inf, 0.0), 0.95, 0.9) == np.inf
    assert tolerance_bound(np.where(np.arange(105) < 2, np.inf, 0.0), 0.95, 0.9) == 0.0


# -- what more flights would show -------------------------------------------------------------------------
def test_the_plan_that_would_show_it_passes_as_often_as_it_says():
    flights = flights_to_show(0.02, 0.95, 0.9)
    assert chance_to_pass(flights, 0.02, 0.95, 0.9) >= 0.9
    fewer = needed(0.95, 0.9, allowed(flights, 0.95, 0.9) - 1)
    assert chance_to_pass(fewer, 0.02, 0.95, 0.9) < 0.9
    failures = np.random.default_rng(10).binomial(flights, 0.02, 2000)
    assert np.mean([verdict(flights, int(each), 0.95, 0.9) == "pass" for each in failures]) >= 0.88
    assert flights_to_show(0.0, 0.95, 0.9) == 45
    assert flights_to_show(0.05, 0.95, 0.9) is None
    assert flights_to_show(0.0499999, 0.95, 0.9) is None
