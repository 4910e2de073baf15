"""The pieces that sensors are built from: Gauss-Markov processes, the exact second-order hold, quantisation."""

from __future__ import annotations

import csv
import math

import control
import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st

from flownav.core.parameter_files import shipped
from flownav.sensors.processes import (
    gauss_markov,
    gauss_markov_coefficients,
    hold_step,
    quantised,
    second_order_hold,
    steps_per_unit,
)

with shipped("paper_table1_identified_models.csv").open() as table:
    TABLE_1 = [(float(r["a"]), float(r["b"]), float(r["c"])) for r in csv.DictReader(table)]


# -- Gauss-Markov ----------------------------------------------------------------------------------------
@given(tau=st.floats(1e-3, 1e5), period=st.floats(1e-3, 10.0))
def test_a_unit_process_keeps_unit_variance(tau: float, period: float) -> None:
    decay, drive = gauss_markov_coefficients(tau, period)
    assert decay**2 + drive**2 == pytest.approx(1.0, abs=1e-14)
    # sqrt(1 - decay^2) itself would lose half the digits of a slow process
    assert drive == pytest.approx(math.sqrt(-math.expm1(-2.0 * period / tau)), rel=1e-14)


def test_variance_and_autocorrelation_of_many_processes_follow_the_exponential() -> None:
    count, sigma, tau, period, lag = 40_000, 1.7, 0.3, 0.02, 15
    decay, drive = gauss_markov_coefficients(tau, period)
    draw = np.random.default_rng(1)
    step = gauss_markov
    first = value = sigma * draw.standard_normal(count)
    for _ in range(lag):
        value = step(value, decay, drive * sigma, draw.standard_normal(count))
    expected = sigma**2 * math.exp(-lag * period / tau)
    # standard errors of a variance and of a covariance of jointly normal variables
    assert np.mean(value**2) == pytest.approx(sigma**2, abs=4.0 * sigma**2 * math.sqrt(2.0 / count))
    spread = math.sqrt((sigma**4 + expected**2) / count)
    assert np.mean(first * value) == pytest.approx(expected, abs=4.0 * spread)


def test_no_time_constant_is_white_noise() -> None:
    assert gauss_markov_coefficients(0.0, 0.02) == (0.0, 1.0)


@pytest.mark.parametrize(("tau", "period"), [(-1.0, 0.02), (1.0, 0.0)])
def test_an_impossible_time_constant_or_period_is_refused(tau: float, period: float) -> None:
    with pytest.raises(ValueError, match="are needed"):
        gauss_markov_coefficients(tau, period)


# -- the second-order hold -------------------------------------------------------------------------------
@pytest.mark.parametrize(("a", "b", "c"), TABLE_1)
def test_step_response_of_every_identified_model_is_exact(a: float, b: float, c: float) -> None:
    period, steps = 0.004, 250
    hold = second_order_hold(b, c, period)
    _, continuous = control.step_response(control.tf([a], [1.0, b, c]), np.arange(steps) * period)
    x1 = x2 = 0.0
    for k in range(steps):
        assert a * x1 == pytest.approx(continuous[k], abs=1e-12)
        x1, x2 = hold_step(x1, x2, 1.0, hold)


# underdamped, overdamped, critically damped, and undamped
@given(b=st.floats(0.0, 200.0), c=st.floats(1.0, 2000.0), period=st.floats(1e-3, 0.05))
def test_the_hold_equals_the_matrix_exponential(b: float, c: float, period: float) -> None:
    block = np.array([[0.0, 1.0, 0.0], [-c, -b, 1.0], [0.0, 0.0, 0.0]]) * period
    exact = scipy.linalg.expm(block)
    hold = second_order_hold(b, c, period)
    got = np.array([[hold.f11, hold.f12, hold.g1], [hold.f21, hold.f22, hold.g2]])
    scale = np.array([[1.0, 1.0 / math.sqrt(c), 1.0 / c], [math.sqrt(c), 1.0, 1.0 / math.sqrt(c)]])
    np.testing.assert_allclose(got / scale, exact[:2] / scale, atol=1e-12)


def test_critical_damping_is_the_limit_of_its_neighbours() -> None:
    critical = second_order_hold(20.0, 100.0, 0.004)
    for nearby in (second_order_hold(20.0 - 1e-9, 100.0, 0.004), second_order_hold(20.0 + 1e-9, 100.0, 0.004)):
        np.testing.assert_allclose(critical, nearby, rtol=1e-10)


@pytest.mark.parametrize(("c", "period"), [(0.0, 0.004), (-1.0, 0.004), (100.0, 0.0)])
def test_a_lag_that_has_no_rest_is_refused(c: float, period: float) -> None:
    with pytest.raises(ValueError, match="are needed"):
        second_order_hold(1.0, c, period)


def test_the_selected_model_has_the_published_gain_delay_and_peak() -> None:
    a, b, c = 196.9, 14.8, 191.9
    frequency = np.linspace(0.01, 40.0, 40_000)
    _, response = scipy.signal.freqs([a], [1.0, b, c], frequency)
    size = np.abs(response)
    assert size[0] == pytest.approx(1.0261, abs=1e-4)
    assert -np.angle(response[0]) / frequency[0] == pytest.approx(0.077, abs=5e-4)
    assert size.max() == pytest.approx(1.136, abs=1e-3)
    assert frequency[size.argmax()] == pytest.approx(9.1, abs=0.05)


# -- quantisation ----------------------------------------------------------------------------------------
@given(value=st.floats(-1e4, 1e4), quantum=st.sampled_from([0.001, 0.01, 0.25]))
def test_a_quantised_value_is_the_nearest_whole_step(value: float, quantum: float) -> None:
    got = quantised(value, quantum, steps_per_unit(quantum))
    assert abs(got - value) <= 0.5 * quantum * (1.0 + 1e-9)
    assert got / quantum == pytest.approx(round(got / quantum), abs=1e-6)


def test_no_quantum_leaves_every_bit() -> None:
    assert quantised(1.0 / 3.0, 0.0, steps_per_unit(0.0)) == 1.0 / 3.0
