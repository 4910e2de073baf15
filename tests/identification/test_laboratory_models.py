"""Output-error identification against systems that scipy simulates, and what its intervals and verdicts are worth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal, stats

from flownav.core.errors import InputError
from flownav.lab.identification.descent import Structure
from flownav.lab.identification.experiment import experiment
from flownav.lab.identification.first_look import judge, one_axis
from flownav.lab.identification.height_law import (
    NoisePoint,
    combined,
    fit_power_law,
    noise_by_height,
    paper_fit,
    paper_sigma,
)
from flownav.lab.identification.output_error import chi_square_tail, fit, fit_percent, information_criteria, whiteness
from flownav.lab.identification.quantities import Interval, choose, excitation, gain, latency, numerator, parse_order
from second_order import damping, natural_frequency

FINE_S = 0.001
DELAY = Structure(0)
FIRST, SECOND = Structure(1), Structure(2)


def chirp(t_s):
    """0.2 to 4 Hz over the time given, amplitude 0.4 m/s."""
    return 0.4 * signal.chirp(t_s, 0.2, t_s[-1], 4.0, phi=-90.0)


def tone(t_s):
    """The paper's pendulum."""
    return 0.32 * np.sin(2.0 * math.pi * 0.41 * t_s)


def run_of(
    wave, system, duration_s=20.0, delay_s=0.0, noise=0.0, offset=0.0, seed=0, step=10, jitter=False, gain_of=1.0
):
    """A run of what scipy makes of an input that is linear between its samples.

    system: (numerator, denominator), or None for a gain `gain_of`. Times are multiples of 1 ms: every `step`, or
    with jitter at random ones, input and readings each at its own.
    """
    random = np.random.default_rng(seed)
    count = round(duration_s / FINE_S) + 1
    fine = np.arange(count) * FINE_S
    if jitter:
        at_u = np.sort(random.choice(np.arange(1, count - 1), count // step, replace=False))
        at_u = np.concatenate([[0], at_u, [count - 1]])
        at_y = np.sort(random.choice(np.arange(count), count // step, replace=False))
    else:
        at_u = at_y = np.arange(0, count, step)
    u = wave(fine)[at_u]
    drive = np.interp(fine, fine[at_u], u)
    response = gain_of * drive if system is None else signal.lsim(system, drive, fine)[1]
    late = np.interp(fine - delay_s, fine, response)
    y = late[at_y] + offset + noise * random.standard_normal(len(at_y))
    return experiment("synthetic", fine[at_u], u, fine[at_y], y)


def of_second_order(gain_of, frequency_rad_s, damping_of):
    square = frequency_rad_s**2
    return [gain_of * square], [1.0, 2.0 * damping_of * frequency_rad_s, square]


def assert_recovers(interval, truth, relative_width):
    """Truth within twice the half-width of the 95 % interval (3.9 standard deviations), which is itself narrow."""
    assert interval.low < interval.value < interval.high
    half = max(interval.high - interval.value, interval.value - interval.low)
    assert half < relative_width * abs(truth)
    assert abs(interval.value - truth) < 2.0 * half


# Recovery


@pytest.mark.parametrize("jitter", [False, True], ids=["even", "irregular"])
@pytest.mark.parametrize(("true_gain", "delay_s"), [(0.93, 0.083), (-1.1, 0.241)])
def test_gain_and_delay_without_noise_are_found_to_a_millionth(true_gain, delay_s, jitter):
    model = fit([run_of(chirp, None, delay_s=delay_s, gain_of=true_gain, offset=0.05, jitter=jitter)], DELAY)
    assert model.point.gain == pytest.approx(true_gain, rel=1e-6)
    assert model.point.delay_s == pytest.approx(delay_s, abs=1e-6)
    assert model.fit_percent > 99.999


@pytest.mark.parametrize("jitter", [False, True], ids=["even", "irregular"])
@pytest.mark.parametrize("time_constant_s", [0.03, 0.1, 0.4])
def test_first_order_without_noise_is_found(time_constant_s, jitter):
    model = fit([run_of(chirp, ([0.9], [time_constant_s, 1.0]), jitter=jitter, offset=-0.02)], FIRST)
    assert model.point.gain == pytest.approx(0.9, rel=1e-5)
    assert latency(model).value == pytest.approx(time_constant_s, rel=1e-5)


@pytest.mark.parametrize("jitter", [False, True], ids=["even", "irregular"])
@pytest.mark.parametrize(("frequency", "damping_of"), [(25.0, 0.7), (12.0, 0.3), (18.0, 1.6)])
def test_second_order_without_noise_is_found(frequency, damping_of, jitter):
    model = fit([run_of(chirp, of_second_order(1.05, frequency, damping_of), jitter=jitter)], SECOND)
    assert model.point.gain == pytest.approx(1.05, rel=1e-5)
    assert natural_frequency(model).value == pytest.approx(frequency, rel=1e-4)
    assert damping(model).value == pytest.approx(damping_of, rel=1e-4)
    assert latency(model).value == pytest.approx(2.0 * damping_of / frequency, rel=1e-4)
    assert numerator(model).value == pytest.approx(1.05 * frequency**2, rel=1e-4)


def test_second_order_with_a_pure_delay_is_found():
    model = fit([run_of(chirp, of_second_order(1.0, 15.0, 0.6), delay_s=0.07)], Structure(2, True))
    assert model.point.delay_s == pytest.approx(0.07, abs=1e-5)
    assert natural_frequency(model).value == pytest.approx(15.0, rel=1e-4)
    assert latency(model).value == pytest.approx(0.07 + 1.2 / 15.0, rel=1e-4)


@pytest.mark.parametrize("jitter", [False, True], ids=["even", "irregular"])
def test_noisy_gain_and_delay_lie_in_narrow_intervals(jitter):
    model = fit([run_of(chirp, None, delay_s=0.083, gain_of=0.93, noise=0.05, jitter=jitter, seed=1)], DELAY)
    assert_recovers(gain(model), 0.93, 0.02)
    assert_recovers(latency(model), 0.083, 0.03)
    assert model.converged
    assert model.sigma == pytest.approx(0.05, rel=0.06)
    assert model.whiteness.white


@pytest.mark.parametrize("jitter", [False, True], ids=["even", "irregular"])
def test_noisy_second_order_lies_in_its_intervals(jitter):
    model = fit([run_of(chirp, of_second_order(0.95, 20.0, 0.5), noise=0.03, jitter=jitter, seed=2)], SECOND)
    assert_recovers(gain(model), 0.95, 0.02)
    assert_recovers(latency(model), 0.05, 0.05)
    assert_recovers(natural_frequency(model), 20.0, 0.05)
    assert_recovers(damping(model), 0.5, 0.08)
    assert model.whiteness.white


def test_runs_together_are_better_known_than_one():
    runs = [run_of(chirp, ([0.9], [0.1, 1.0]), noise=0.05, seed=s, offset=0.1 * s) for s in range(4)]
    one, all_four = fit(runs[:1], FIRST), fit(runs, FIRST)
    assert_recovers(latency(all_four), 0.1, 0.05)
    assert len(all_four.fits) == 4
    assert math.sqrt(one.white_covariance[0, 0] / all_four.white_covariance[0, 0]) == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize(
    ("system", "delay_s", "label"),
    [(None, 0.08, "delay"), (([1.0], [0.15, 1.0]), 0.0, "1"), (of_second_order(1.0, 12.0, 0.4), 0.0, "2")],
)
def test_the_order_chosen_is_the_systems_own(system, delay_s, label):
    choice = choose([run_of(chirp, system, delay_s=delay_s, noise=0.02, seed=3)])
    assert choice.best.structure.label == label
    assert choice.excitation.complete


def test_orders_are_read_and_wrong_ones_refused():
    assert parse_order("2+delay") == (Structure(2, True),)
    assert parse_order("delay") == (DELAY,)
    for wrong in ("0", "7", "two", "2+lag", ""):
        with pytest.raises(InputError, match="order"):
            parse_order(wrong)


def test_fit_percent_is_matlabs():
    random = np.random.default_rng(4)
    measured = 3.0 + random.standard_normal(200)
    predicted = measured + 0.3 * random.standard_normal(200) + 0.1
    expected = 100.0 * (1.0 - np.linalg.norm(measured - predicted) / np.linalg.norm(measured - measured.mean()))
    assert fit_percent(measured, predicted) == pytest.approx(expected, rel=1e-12)
    assert fit_percent(measured, np.full(200, measured.mean())) == pytest.approx(0.0, abs=1e-9)
    assert fit_percent(measured, measured) == 100.0


def test_a_models_fit_percent_is_that_of_its_predictions():
    run = run_of(chirp, None, delay_s=0.083, noise=0.1, seed=5)
    model = fit([run], DELAY)
    inside = (run.t_y >= 0.6 + run.t_u[0]) & (run.t_y + 0.1 <= run.t_u[-1])
    y = run.y[inside]
    expected = 100.0 * (1.0 - np.linalg.norm(y - model.predictions[0]) / np.linalg.norm(y - y.mean()))
    assert model.fit_percent == pytest.approx(expected, rel=1e-6)
    assert model.fits[0] == pytest.approx(expected, rel=1e-6)


def test_information_criteria_are_ljungs():
    aic, bic = information_criteria(12.0, 300, 4, 300.0)
    assert aic == pytest.approx(300.0 * math.log(12.0 / 300.0) + 8.0)
    assert bic == pytest.approx(300.0 * math.log(12.0 / 300.0) + 4.0 * math.log(300.0))


# Excitation


def test_a_tone_excites_two_of_three_parameters_and_a_chirp_all():
    system = of_second_order(1.0, 18.0, 0.6)
    swung = excitation(fit([run_of(tone, system, duration_s=25.0, noise=0.03, seed=6)], SECOND))
    swept = excitation(fit([run_of(chirp, system, duration_s=25.0, noise=0.03, seed=6)], SECOND))
    assert (swung.parameters, swung.identifiable, swung.complete) == (3, 2, False)
    assert (swept.parameters, swept.identifiable, swept.complete) == (3, 3, True)
    assert "2 of 3" in swung.verdict
    assert "natural frequency and damping are not identifiable" in swung.verdict
    assert "all 3 parameters" in swept.verdict


def test_a_longer_or_quieter_tone_excites_no_third_parameter():
    system = of_second_order(1.0, 18.0, 0.6)
    long = excitation(fit([run_of(tone, system, duration_s=100.0, noise=0.01, seed=7)], SECOND))
    assert long.identifiable == 2


def test_on_a_tone_gain_and_delay_are_chosen_and_right():
    choice = choose([run_of(tone, of_second_order(1.0, 18.0, 0.6), duration_s=25.0, noise=0.03, seed=8)])
    assert choice.best.structure == DELAY
    assert_recovers(latency(choice.best), 1.2 / 18.0, 0.05)
    assert_recovers(gain(choice.best), 1.0, 0.01)
    assert (choice.widest.parameters, choice.widest.identifiable) == (3, 2)


def test_on_a_tone_a_second_order_model_says_that_its_frequency_is_unknown():
    model = fit([run_of(tone, of_second_order(1.0, 18.0, 0.6), duration_s=25.0, noise=0.03, seed=8)], SECOND)
    frequency = natural_frequency(model)
    assert frequency.low < 1.0
    assert frequency.high > 100.0
    assert latency(model).value == pytest.approx(1.2 / 18.0, rel=0.05)


def test_noise_alone_fixes_nothing():
    shown = excitation(fit([run_of(lambda t: 0.001 * tone(t), None, delay_s=0.05, noise=0.2, seed=9)], DELAY))
    assert shown.identifiable == 0
    assert "fixes none" in shown.verdict


# The quality of the intervals


def monte_carlo(structure, system, delay_s, gain_of, fits):
    """Estimates (fits, 2) of gain and latency, reported variances, whether the intervals hold the truth; the bound.

    The Cramer-Rao bound is that of scipy's response, by central differences of the parameters and the offset.
    """
    random, noise = np.random.default_rng(10), 0.05
    lag_s = 0.0 if system is None else system[1][0]
    clean = run_of(chirp, system, delay_s=delay_s, gain_of=gain_of, duration_s=8.0, step=20)
    truth = np.array([gain_of, delay_s + lag_s])
    estimates, variances, held = np.zeros((fits, 2)), np.zeros((fits, 2)), np.zeros((fits, 2), bool)
    for k in range(fits):
        y = clean.y + noise * random.standard_normal(len(clean.y))
        model = fit([experiment("one of many", clean.t_u, clean.u, clean.t_y, y)], structure)
        found = (gain(model), latency(model))
        estimates[k] = [interval.value for interval in found]
        variances[k] = [((interval.high - interval.low) / (2.0 * 1.959964)) ** 2 for interval in found]
        held[k] = [interval.low <= true <= interval.high for interval, true in zip(found, truth, strict=True)]

    def response(gain_now, lag_now):
        moved = ([gain_now], [lag_now, 1.0]) if system is not None else None
        late = delay_s if system is not None else lag_now
        return run_of(chirp, moved, delay_s=late, gain_of=gain_now, duration_s=8.0, step=20).y

    step = FINE_S
    columns = [
        (response(gain_of + step, truth[1]) - response(gain_of - step, truth[1])) / (2.0 * step),
        (response(gain_of, truth[1] + step) - response(gain_of, truth[1] - step)) / (2.0 * step),
        np.ones(len(clean.y)),
    ]
    used = (clean.t_y >= 0.6) & (clean.t_y + 0.1 <= clean.t_u[-1])
    jacobian = np.column_stack(columns)[used]
    bound = noise**2 * np.diag(np.linalg.inv(jacobian.T @ jacobian))[:2]
    return estimates - truth, variances, held, bound


CASES = pytest.mark.parametrize(
    ("structure", "system", "delay_s", "gain_of"),
    [(DELAY, None, 0.083, 0.93), (FIRST, ([0.93], [0.1, 1.0]), 0.0, 0.93)],
    ids=["gain and delay", "first order"],
)


@CASES
def test_intervals_hold_the_truth_and_variances_are_those_of_the_estimates(structure, system, delay_s, gain_of):
    error, variances, held, _ = monte_carlo(structure, system, delay_s, gain_of, 60)
    coverage, ratio = held.mean(axis=0), error.var(axis=0, ddof=1) / variances.mean(axis=0)
    assert np.all((coverage >= 0.85) & (coverage <= 1.0)), coverage
    assert np.all((ratio > 0.6) & (ratio < 1.6)), ratio
    assert np.all(np.abs(error.mean(axis=0)) < 4.0 * np.sqrt(variances.mean(axis=0) / 60.0))


@pytest.mark.slow
@CASES
def test_estimates_reach_the_cramer_rao_bound(structure, system, delay_s, gain_of):
    error, variances, held, bound = monte_carlo(structure, system, delay_s, gain_of, 200)
    coverage, efficiency = held.mean(axis=0), np.mean(error**2, axis=0) / bound
    assert np.all((coverage >= 0.90) & (coverage <= 0.98)), coverage
    assert np.all(efficiency <= 1.2), efficiency
    assert variances.mean(axis=0) == pytest.approx(bound, rel=0.1)


# Whiteness


def coloured(random, count, pole):
    return signal.lfilter([1.0], [1.0, -pole], random.standard_normal(count))


def test_white_residuals_are_accepted_and_coloured_ones_rejected():
    random = np.random.default_rng(11)
    white = [whiteness([random.standard_normal(800)]) for _ in range(100)]
    assert sum(not verdict.white for verdict in white) <= 5  # 1 is expected
    for pole in (0.3, 0.9, -0.5):
        assert all(not whiteness([coloured(random, 800, pole)]).white for _ in range(10))


def test_runs_are_tested_together():
    random = np.random.default_rng(12)
    both = whiteness([random.standard_normal(500), random.standard_normal(500)])
    assert both.white
    assert both.lags == 50
    assert not whiteness([random.standard_normal(500), coloured(random, 500, 0.6)]).white


def test_readings_per_independent_one_is_that_of_an_autoregression():
    random = np.random.default_rng(13)
    inflation = np.median([whiteness([coloured(random, 4000, 0.8)]).readings_per_independent for _ in range(20)])
    assert inflation == pytest.approx((1.0 + 0.8) / (1.0 - 0.8), rel=0.2)


def test_the_chi_square_tail_is_scipys():
    for degrees in (3, 10, 25, 100):
        for share in (0.05, 0.01, 0.002):
            statistic = stats.chi2.isf(share, degrees)
            assert chi_square_tail(statistic, degrees) == pytest.approx(share, abs=1e-3)


def test_coloured_residuals_widen_the_intervals():
    clean = run_of(tone, None, delay_s=0.08, duration_s=25.0)
    noise = 0.02 * coloured(np.random.default_rng(14), len(clean.y), 0.9)
    model = fit([experiment("coloured", clean.t_u, clean.u, clean.t_y, clean.y + noise)], DELAY)
    assert not model.whiteness.white
    assert np.all(np.diag(model.covariance) > 4.0 * np.diag(model.white_covariance))
    assert_recovers(gain(model), 1.0, 0.2)


# Error by height


@pytest.mark.parametrize(("height_m", "accuracy"), [(0.6, 0.900), (0.8, 0.779), (1.0, 0.697), (1.5, 0.569)])
def test_the_papers_accuracy_by_height(height_m, accuracy):
    assert float(paper_fit(height_m)) == pytest.approx(accuracy, abs=6e-4)
    assert float(paper_sigma(height_m, 0.2)) == pytest.approx(0.2 * (1.0 - accuracy), abs=2e-4)


def test_the_papers_accuracy_is_at_most_one():
    assert float(paper_fit(0.3)) == 1.0
    assert float(paper_sigma(0.3, 0.2)) > 0.0


def test_a_power_law_is_recovered_exactly_from_its_own_points():
    heights = (0.6, 0.8, 1.0, 1.5)
    law = fit_power_law([NoisePoint(h, 0.035 * (h / 0.6) ** 2.06, 700) for h in heights])
    assert law.exponent.value == pytest.approx(2.06, rel=1e-9)
    assert law.at(0.6) == pytest.approx(0.035, rel=1e-9)
    assert law.at(0.1) == pytest.approx(0.035, rel=1e-9)  # held outside
    assert law.at(9.0) == pytest.approx(0.035 * 2.5**2.06, rel=1e-9)


def test_a_power_law_is_recovered_from_readings():
    random = np.random.default_rng(15)
    height = random.uniform(0.5, 3.0, 8000)
    error = 0.04 * height**1.4 * random.standard_normal(8000)
    law = fit_power_law(noise_by_height(error, height))
    assert_recovers(law.exponent, 1.4, 0.1)
    assert float(law.at(1.0)) == pytest.approx(0.04, rel=0.06)


def test_one_height_gives_a_constant():
    law = fit_power_law([NoisePoint(0.6, 0.03, 500)])
    assert law.exponent == Interval(0.0, 0.0, 0.0)
    assert law.at(2.0) == pytest.approx(0.03)


def test_combined_intervals_shrink_where_they_agree_and_widen_where_they_do_not():
    alike = combined([Interval.of(1.0, 0.1)] * 4)
    apart = combined([Interval.of(1.0, 0.01), Interval.of(2.0, 0.01)])
    assert (alike.value, alike.high - alike.value) == pytest.approx((1.0, 1.96 * 0.05), rel=1e-3)
    assert apart.value == pytest.approx(1.5)
    assert apart.low < 1.0 < 2.0 < apart.high


# The axis sentinel


@pytest.mark.parametrize(
    ("response", "words"),
    [
        ([[0.9, 0.05], [-0.03, 1.1]], "axes and signs are right"),
        ([[-0.9, 0.05], [0.03, 1.1]], "sign of x is inverted"),
        ([[0.9, 0.05], [0.03, -1.1]], "sign of y is inverted"),
        ([[-0.9, 0.05], [0.03, -1.1]], "180"),
        ([[0.1, 0.95], [0.9, -0.05]], "axes are swapped"),
        ([[0.1, -0.95], [0.9, -0.05]], "axes are swapped, sign of x is inverted"),
    ],
)
def test_the_sentinel_names_what_is_wrong(response, words):
    verdict = judge(np.array(response))
    assert verdict.clear
    assert words in verdict.verdict
    assert verdict.right == (words == "axes and signs are right")
    assert np.array_equal(np.sign(verdict.assignment), np.round(np.array(response)))


def test_a_turn_is_measured_and_half_a_quarter_is_unclear():
    def turned(degrees):
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        return np.array([[c, -s], [s, c]])

    slight = judge(turned(12.0))
    assert slight.right
    assert slight.turned_deg == pytest.approx(12.0)
    assert not judge(turned(45.0)).clear


def test_without_a_heading_only_a_mirrored_sensor_shows():
    assert "not mirrored" in judge(np.array([[0.0, -1.0], [1.0, 0.0]]), yaw_known=False).verdict
    assert judge(np.array([[0.0, 1.0], [1.0, 0.0]]), yaw_known=False).verdict.startswith("mirrored")


def test_one_axis_shows_its_sign():
    assert one_axis(0.9).right
    assert not one_axis(-0.9).right
    assert "inverted" in one_axis(-0.9).verdict
