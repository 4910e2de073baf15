"""Consistency and efficiency scores: chi-square bands, sums, bands of height, order statistics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from flownav.core.measurement import Sensor
from flownav.scoring.consistency import (
    HEIGHTS_M,
    ConsistencySums,
    ErrorSums,
    aloft,
    anees,
    band_name,
    chi_square_band,
    consistency_by_sensor,
    consistency_of,
    consistency_of_block,
    efficiency,
    efficiency_by_height,
    error_sums,
    inside_fraction,
    inside_steps,
    is_white,
    lag_one,
    largest_horizontal_error,
    over_stated,
    steps_in_flight,
    within_band,
)
from flownav.scoring.percentiles import percentile_with_interval
from flownav.scoring.sensor_verdict import MEANING, meanings, verdict


@pytest.mark.parametrize("flights", [1, 10, 1000])
def test_the_band_is_scipys_chi_square_quantile(flights):
    wanted = stats.chi2.ppf([0.025, 0.975], 6 * flights) / flights
    assert chi_square_band(flights) == pytest.approx(tuple(wanted), rel=1e-9)


def drawn(flights, epochs, scale=1.0, seed=1):
    """A block of independent errors whose filter states a unit covariance; `scale` makes it over-confident."""
    error = scale * np.random.default_rng(seed).standard_normal((epochs, 6, flights))
    zeros = np.zeros((epochs, flights))
    return consistency_of_block(error, np.ones_like(error), (error**2).sum(axis=1), zeros + 2.0, zeros)


def test_a_consistent_filter_is_inside_the_band_on_95_percent_of_the_steps():
    sums = drawn(50, 4000)
    assert inside_fraction([inside_steps(sums)]) == pytest.approx(0.95, abs=4.0 * np.sqrt(0.95 * 0.05 / 4000))
    assert anees(sums) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("scale", [0.8, 1.25])
def test_a_modest_and_an_overconfident_filter_are_outside(scale):
    sums = drawn(50, 400, scale)
    assert inside_fraction([inside_steps(sums)]) < 0.05
    assert anees(sums) == pytest.approx(scale**2, rel=0.02)


def test_which_state_is_stated_too_modestly_is_told():
    draw = np.random.default_rng(2)
    error, zeros = draw.standard_normal((400, 6, 50)), np.zeros((400, 50))
    sigma = np.ones_like(error)
    sigma[:, 2], sigma[:, 5] = 2.0, 0.5
    sums = consistency_of_block(error, sigma, (error**2).sum(axis=1), zeros + 2.0, zeros)
    assert list(over_stated(sums).values()) == pytest.approx([1.0, 1.0, 0.5, 1.0, 1.0, 2.0], rel=0.02)


def test_the_band_is_passed_by_who_states_the_right_size_at_each_step_and_not_by_who_does_on_average():
    draw = np.random.default_rng(7)
    zeros = np.zeros((600, 96))
    size = np.repeat([0.6, 1.0, 1.8], 200)  # of the variance, right at a third of the steps, and on average nearly

    def group():
        error = draw.standard_normal((600, 6, 96)) * np.sqrt(size)[:, None, None]
        return consistency_of_block(error, np.ones_like(error), (error**2).sum(axis=1), zeros + 2.0, zeros)

    groups = [group() for _ in range(20)]
    found = within_band(groups, sum(groups[1:], groups[0]))
    assert found.as_stated == pytest.approx(0.95 / 3.0, abs=0.02)
    assert found.sized < 0.4
    assert found.sized_at_each_step == pytest.approx(0.945, abs=0.01)  # the others' mean errs by a twentieth as much
    alone = within_band(groups[:1], groups[0])
    assert alone.as_stated == pytest.approx(found.as_stated, abs=0.03)
    assert np.isnan([alone.sized, alone.sized_at_each_step]).all()  # nobody else tells the size


def test_steps_on_the_ground_are_left_out():
    error = np.full((4, 6, 10), 100.0)
    nees = np.array([[600.0], [6.0], [6.0], [600.0]]) * np.ones((4, 10))
    on_ground = np.zeros((4, 10))
    on_ground[0], on_ground[2, 0], on_ground[3, :2] = 1.0, 1.0, 1.0  # all, one and two of ten flights
    sums = consistency_of_block(error, np.ones_like(error), nees, np.ones((4, 10)), on_ground)
    assert list(steps_in_flight(sums)) == [False, True, True, False]
    assert inside_steps(sums) == (2, 2)
    assert sums.errors.steps.sum() == 10 + 9 + 8
    grounded = ConsistencySums(10, sums.nees, sums.running, np.zeros(4), sums.errors, sums.over_stated)
    assert np.isnan(inside_fraction([inside_steps(grounded)]))
    assert inside_fraction([(1, 2), (2, 4), (3, 3), (0, 0)]) == pytest.approx(6 / 9)
    assert np.isnan(anees(grounded))


def test_steps_count_from_when_every_filter_runs():
    nees = np.full((4, 10), 6.0)
    nees[0], nees[1, 3] = np.nan, np.nan  # none has started; one has not
    error = np.where(np.isnan(nees)[:, None], np.nan, np.full((4, 6, 10), 2.0))
    sums = consistency_of_block(error, 0.5 * error, nees, np.ones((4, 10)), np.zeros((4, 10)))
    assert list(sums.running) == [0, 9, 10, 10]
    assert list(steps_in_flight(sums)) == [False, False, True, True]
    assert sums.errors.steps.sum() == 9 + 10 + 10
    assert sums.errors.root_mean_square() == pytest.approx(np.full(6, 2.0))
    assert over_stated(sums) == pytest.approx(dict.fromkeys("xyzuvw", 2.0))
    assert anees(sums) == pytest.approx(1.0)


@given(st.integers(0, 10**6), st.integers(1, 8), st.integers(1, 8))
@settings(max_examples=30, deadline=None)
def test_sums_of_blocks_are_the_sums_of_all(seed, left, right):
    draw = np.random.default_rng(seed)
    count = left + right
    error, sigma = draw.standard_normal((9, 6, count)), draw.uniform(0.5, 2.0, (9, 6, count))
    nees, height = draw.uniform(0.0, 12.0, (2, 9, count))
    on_ground = draw.integers(0, 2, (9, count)).astype(float)
    parts = [
        consistency_of_block(error[..., s], sigma[..., s], nees[:, s], height[:, s], on_ground[:, s])
        for s in (slice(0, left), slice(left, None))
    ]
    whole, both = consistency_of_block(error, sigma, nees, height, on_ground), parts[0] + parts[1]
    assert both.flights == whole.flights == count
    for name in ("nees", "running", "airborne"):
        assert getattr(both, name) == pytest.approx(getattr(whole, name))
    assert both.errors.squares == pytest.approx(whole.errors.squares)
    assert both.errors.steps == pytest.approx(whole.errors.steps)
    assert both.over_stated.squares == pytest.approx(whole.over_stated.squares)


def test_errors_fall_into_their_height_bands():
    heights = np.array([[-0.01], [0.29], [0.3], [0.99], [3.4], [3.5], [80.0]])
    squares = np.arange(1.0, 8.0)[:, None, None] * np.ones((7, 6, 1))
    sums = error_sums(squares, heights, np.ones((7, 1)))
    assert list(sums.steps) == [2, 2, 1, 2]
    assert list(sums.squares[:, 0]) == [1 + 2, 3 + 4, 5, 6 + 7]
    assert sums.root_mean_square() == pytest.approx(np.full(6, 2.0))
    assert [band_name(b) for b in range(len(HEIGHTS_M) - 1)] == ["0-0.3 m", "0.3-1 m", "1-3.5 m", "above 3.5 m"]


def test_efficiency_is_rmse_over_the_root_of_the_bound_and_skips_bands_that_hold_nearly_nothing():
    squares = np.array([[4.0] * 6, [90.0] * 6, [0.0] * 6, [0.9] * 6])
    errors = ErrorSums(squares, np.array([10.0, 1000.0, 0.0, 1.0]))
    bound = ErrorSums(squares / 4.0, np.array([10.0, 1000.0, 0.0, 1.0]))
    assert efficiency(errors, bound) == pytest.approx(dict.fromkeys("xyzuvw", 2.0))
    assert set(efficiency_by_height(errors, bound)) == {"0.3-1 m"}
    assert efficiency_by_height(errors, bound)["0.3-1 m"]["w"] == pytest.approx(2.0)


def test_the_largest_horizontal_error_is_relative_to_where_the_pad_was_noted():
    truth = np.zeros((4, 6, 2))
    estimate = truth.copy()
    estimate[:, 0, 0] = 9.0, 2.0, 2.0, 5.0
    estimate[:, 1, 0] = 0.0, 1.0, 1.0, 5.0
    estimate[:, 2] = 100.0  # height does not count
    every, late = np.ones((4, 2)), np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    assert largest_horizontal_error(estimate, truth, None, every) == pytest.approx([9.0, 0.0])
    assert largest_horizontal_error(estimate, truth, 1, every) == pytest.approx([np.hypot(7.0, -1.0), 0.0])
    assert largest_horizontal_error(estimate, truth, None, late)[0] == pytest.approx(np.hypot(2.0, 1.0))
    assert largest_horizontal_error(estimate, truth, 1, late)[0] == 0.0
    assert np.isnan(largest_horizontal_error(estimate, truth, 1, late)[1])


# -- order statistics --------------------------------------------------------------------------------------
def test_a_percentile_is_the_smallest_value_that_the_share_does_not_exceed():
    values = np.arange(1.0, 101.0)[::-1]
    assert percentile_with_interval(values, 0.95)[0] == 95.0
    assert percentile_with_interval(values, 0.5)[0] == 50.0
    assert percentile_with_interval(np.array([7.0]), 0.95) == (7.0, -np.inf, np.inf)  # one value bounds nothing
    assert percentile_with_interval(np.append(values[10:], [np.inf] * 10), 0.95)[0] == np.inf
    with pytest.raises(ValueError, match="no values"):
        percentile_with_interval(np.array([]), 0.95)


def test_the_interval_lies_between_the_binomial_order_statistics():
    values = np.arange(1.0, 1001.0)
    low, high = stats.binom.ppf([0.025, 0.975], 1000, 0.95)
    assert percentile_with_interval(values, 0.95)[1:] == (low, high + 1.0)


def test_the_interval_covers_the_true_percentile_as_often_as_it_says():
    draw, truth = np.random.default_rng(5), stats.rayleigh.ppf(0.95)
    covered = 0
    for _ in range(2000):
        _, low, high = percentile_with_interval(draw.rayleigh(size=200), 0.95)
        covered += low <= truth <= high
    assert covered / 2000 > 0.95 - 4.0 * np.sqrt(0.95 * 0.05 / 2000)
    assert covered / 2000 < 0.985


# -- one flight, by its innovations ------------------------------------------------------------------------
def lasting(count: int, share: float, seed: int = 3):
    """Unit noise of which this share stays from one to the next."""
    news = np.random.default_rng(seed).standard_normal(count)
    out = news.copy()
    for k in range(1, count):
        out[k] = share * out[k - 1] + np.sqrt(1.0 - share**2) * news[k]
    return out


@pytest.mark.parametrize("share", [-0.6, 0.0, 0.3, 0.9])
def test_autocorrelation_is_what_stays(share):
    assert lag_one(lasting(50_000, share)) == pytest.approx(share, abs=0.02)
    assert is_white(lasting(50_000, share)) == (share == 0.0)


def test_little_colour_and_few_readings_are_white():
    assert is_white(lasting(50_000, 0.15))
    assert not is_white(lasting(50_000, 0.25))
    assert is_white(np.ones(6))  # 5/6 of its power, but chance does that to six readings: within 2.58 / sqrt(6)
    assert not is_white(np.ones(40))  # a bias is colour
    assert is_white(np.zeros(0))
    assert is_white(np.zeros(9))


def test_chance_colours_one_white_sensor_in_a_hundred():
    draw = np.random.default_rng(4)
    white = sum(is_white(draw.standard_normal(50)) for _ in range(2000))
    assert white / 2000 == pytest.approx(0.99, abs=0.008)


def test_each_component_is_held_against_its_own_kind():
    """Two white components by turns with means of different size would look coloured, or hide a coloured one."""
    first, second = lasting(4000, 0.0), lasting(4000, 0.9, seed=8)
    component = np.tile([0.0, 1.0], 4000)
    both = np.column_stack([first, second]).ravel()
    found = consistency_of(component, 2.0 * both, np.full(8000, 4.0))
    assert found.samples == 8000
    assert found.nis_per_dof == pytest.approx(1.0, abs=0.1)
    assert not found.white
    assert consistency_of(np.zeros(4000), first, np.ones(4000)).white


def test_what_was_not_tested_does_not_count_and_may_leave_nothing():
    assert consistency_of(np.zeros(2), np.array([np.nan, 1.0]), np.array([1.0, np.nan])) is None
    assert consistency_of(np.zeros(3), np.array([2.0, 9.0, np.nan]), np.array([1.0, 0.0, 1.0])) == (4.0, 1, True, 0.0)


@pytest.mark.parametrize(("mean", "white", "refused", "said"), [
    (1.0, True, 0.0, "as expected"),
    (0.51, True, 0.05, "as expected"),
    (1.99, True, 0.0, "as expected"),
    (0.49, True, 0.0, "harmless: less scatter than the filter expects"),
    (2.01, True, 0.0, "act: 1.4 times the scatter that the filter expects"),
    (36.0, False, 0.25, "act: 6.0 times the scatter that the filter expects, 25 % of it refused in flight"),
    (0.1, True, 0.06, "act: 6 % of it refused in flight"),
    (1.0, False, 0.0, "harmless: its errors last"),
    (0.1, False, 0.0, "harmless: less scatter than the filter expects, its errors last"),
])  # fmt: skip
def test_the_verdict_in_words(mean, white, refused, said):
    assert verdict(mean, white=white, refused=refused) == said
    meant = meanings([said, "as expected"])
    assert [one.split(":")[0] for one in meant] == [word for word in MEANING if said.startswith(word)]
    assert all("--settings" in one for one in meant)


def test_what_was_refused_is_a_share_and_no_part_of_the_mean():
    """A range that reads 40 sigma off where it is refused, and what is stated where it is fused."""
    fused = np.arange(100) % 10 > 0
    innovation = np.where(fused, np.where(np.arange(100) % 2, 1.0, -1.0), 40.0)
    range_rows = {Sensor.RANGE: np.ones(100, bool)}
    found = consistency_by_sensor(
        lambda sensor: range_rows.get(sensor, np.zeros(100, bool)), fused, np.zeros(100), innovation, np.ones(100)
    )
    assert list(found) == ["range"]
    assert found["range"]["nis_per_dof"] == 1.0
    assert (found["range"]["samples"], found["range"]["refused"]) == (90, 0.1)


def test_in_flight_is_what_the_landed_signal_says():
    t_s, said_s = np.arange(6.0), np.array([0.0, 2.0, 4.0])
    assert aloft(t_s, said_s, np.array([1.0, 0.0, 1.0])).tolist() == [False, False, True, True, False, False]
    assert aloft(t_s, said_s, np.ones(3)).all()  # a signal that never says flight is no signal
    assert aloft(t_s, said_s[:0], said_s[:0]).all()


def test_a_sensor_that_was_refused_throughout_is_judged_by_what_was_refused():
    rows = {Sensor.GPS_POSITION: np.ones(50, bool)}
    found = consistency_by_sensor(
        lambda sensor: rows.get(sensor, np.zeros(50, bool)), np.zeros(50, bool), np.zeros(50), np.full(50, 9.0),
        np.ones(50),
    )  # fmt: skip
    assert found["gps_position"]["refused"] == 1.0
    assert found["gps_position"]["samples"] == 50
    assert "100 % of it refused in flight" in verdict(found["gps_position"]["nis_per_dof"], white=True, refused=1.0)
