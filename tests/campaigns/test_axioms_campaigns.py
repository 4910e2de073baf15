"""Invariances of figures of many flights: order, company and mirrors."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaigns.tolerance import allowed, interval, joint, needed, risk, shown, tolerance_bound, verdict
from flownav.simulation.dispersion import drawn, uniforms

CASES = pytest.mark.parametrize(("probability", "confidence"), [(0.9, 0.95), (0.99, 0.9), (0.5, 0.99)])


@CASES
def test_more_flights_never_show_less_and_more_failures_never_more(probability, confidence):
    for failures in (0, 1, 4):
        fewest = needed(probability, confidence, failures)
        assert shown(fewest, failures, probability, confidence)
        assert not shown(fewest - 1, failures, probability, confidence)
        assert shown(fewest + 7, failures, probability, confidence)
        assert allowed(fewest, probability, confidence) == failures
        assert risk(fewest, failures, probability) <= 1.0 - confidence < risk(fewest - 1, failures, probability)
    assert allowed(needed(probability, confidence) - 1, probability, confidence) == -1


@CASES
def test_a_requirement_and_its_opposite_are_never_both_shown(probability, confidence):
    for failures in range(0, 61, 3):
        found, bounds = verdict(60, failures, probability, confidence), interval(60, failures, confidence)
        assert (found == "pass") == (bounds.low >= probability)
        assert (found == "fail") == (bounds.high < probability)
        mirror = interval(60, 60 - failures, confidence)  # what succeeds there fails here
        assert (mirror.low, mirror.high) == pytest.approx((1.0 - bounds.high, 1.0 - bounds.low), abs=1e-12)


def test_a_bound_does_not_hang_on_the_order_of_flights_nor_on_units_nor_on_the_sign():
    figures = np.random.default_rng(2).normal(size=120)
    bound = tolerance_bound(figures, 0.9, 0.95)
    assert tolerance_bound(figures[::-1], 0.9, 0.95) == bound
    assert tolerance_bound(3.28 * figures, 0.9, 0.95) == pytest.approx(3.28 * bound)
    assert tolerance_bound(-figures, 0.9, 0.95, upper=False) == -bound
    assert np.mean(figures <= bound) >= 0.9
    assert tolerance_bound(np.append(figures, 1e9), 0.9, 0.95) >= bound


def test_all_must_pass_and_one_that_fails_is_enough():
    for first in ("pass", "fail", "not shown"):
        for second in ("pass", "fail", "not shown"):
            assert joint([first, second]) == joint([second, first])
            assert (joint([first, second]) == "pass") == (first == second == "pass")
            assert (joint([first, second]) == "fail") == ("fail" in (first, second))


def test_nothing_drawn_is_what_is_believed_and_either_side_has_its_own_reach():
    assert drawn("offset", 0.0, 7.0, 1.0, 2.0) == drawn("factor", 1.0, 7.0, 1.0, 2.0) == 7.0
    assert drawn("uncertainty", 0.0, 7.0, 1.0, 2.0) == 7.0
    assert drawn("uncertainty", 1.0, 7.0, 1.0, 2.0) == 9.0
    assert drawn("uncertainty", -1.0, 7.0, 1.0, 2.0) == 6.0
    for draw in (-2.0, -0.5, 1.5):  # in a mirror the sides are exchanged
        assert drawn("uncertainty", -draw, -7.0, 2.0, 1.0) == -drawn("uncertainty", draw, 7.0, 1.0, 2.0)
    assert drawn("value", 3.0, 7.0, 1.0, 2.0) == 3.0


def test_a_flight_draws_the_same_alone_and_among_others():
    together = uniforms(5, range(100), "vehicle.body.mass_kg")
    assert [uniforms(5, [k], "vehicle.body.mass_kg")[0] for k in (0, 17, 99)] == together[[0, 17, 99]].tolist()
    assert abs(together.mean() - 0.5) < 0.1
    assert len(set(together) & set(uniforms(5, range(100), "wind.speed_20ft_m_s"))) == 0
    assert len(set(together) & set(uniforms(6, range(100), "vehicle.body.mass_kg"))) == 0
