"""The quality of a second-order fit's estimates and intervals, against a bound computed without flownav."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from flownav.lab.identification.descent import DELAY_RANGE_S, Structure
from flownav.lab.identification.experiment import experiment
from flownav.lab.identification.output_error import fit
from flownav.lab.identification.quantities import coefficients, gain, latency, numerator
from second_order import damping, natural_frequency

A, B, C = 196.9, 14.8, 191.9  # the paper's selected model
TRUE = np.array([A / C, B / C, np.sqrt(C), B / (2.0 * np.sqrt(C))])  # gain, latency, natural frequency, damping
SIGMA = 0.03
T_S = np.arange(0.0, 20.0, 0.02)
U = 0.4 * np.sin(2.0 * np.pi * (0.1 * T_S + 0.05 * T_S**2))
USED = (DELAY_RANGE_S[1] <= T_S) & (T_S[-1] + DELAY_RANGE_S[0] >= T_S)


def output(values, start=(0.0, 0.0)):
    """SciPy's response of gain, latency, natural frequency and damping; start in the output and its rate."""
    gain_of, _, frequency, ratio = values
    system = signal.StateSpace(
        [[0.0, 1.0], [-(frequency**2), -2.0 * ratio * frequency]], [[0.0], [gain_of * frequency**2]], [[1.0, 0.0]],
        [[0.0]],
    )  # fmt: skip
    return signal.lsim(system, U, T_S, X0=list(start))[1]


def bound():
    """Cramer-Rao variances of gain, latency, frequency and damping, start and offset unknown."""
    columns = []
    for i in (0, 2, 3):
        step = np.zeros(4)
        step[i] = 1e-4
        columns.append((output(TRUE + step) - output(TRUE - step)) / 2e-4)
    still = output(TRUE)
    columns += [output(TRUE, (1.0, 0.0)) - still, output(TRUE, (0.0, 1.0)) - still, np.ones(len(T_S))]
    jacobian = np.column_stack(columns)[USED]
    covariance = SIGMA**2 * np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-9)[:3, :3]
    latency_by = np.array([0.0, -2.0 * TRUE[3] / TRUE[2] ** 2, 2.0 / TRUE[2]])  # 2 zeta/omega
    frequency, ratio = covariance[1, 1], covariance[2, 2]
    return np.array([covariance[0, 0], latency_by @ covariance @ latency_by, frequency, ratio])


def monte_carlo(fits, colour=0.0):
    """Errors (fits, 4) of the four quantities and whether their intervals hold the truth."""
    random, clean = np.random.default_rng(3), output(TRUE, (0.05, 0.3))
    errors, held = np.zeros((fits, 4)), np.zeros((fits, 4), bool)
    for k in range(fits):
        noise = signal.lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], random.standard_normal(len(T_S)))
        model = fit([experiment("one of many", T_S, U, T_S, clean + SIGMA * noise)], Structure(2))
        found = (gain(model), latency(model), natural_frequency(model), damping(model))
        errors[k] = [interval.value - true for interval, true in zip(found, TRUE, strict=True)]
        held[k] = [interval.low <= true <= interval.high for interval, true in zip(found, TRUE, strict=True)]
    return errors, held


def test_second_order_estimates_are_near_the_bound_and_intervals_hold():
    errors, held = monte_carlo(60)
    assert np.all(np.mean(errors**2, axis=0) < 1.6 * bound())
    assert np.all(held.mean(axis=0) >= 0.85)


@pytest.mark.slow
def test_second_order_estimates_reach_the_cramer_rao_bound():
    errors, held = monte_carlo(400)
    efficiency = np.mean(errors**2, axis=0) / bound()
    assert np.all(efficiency <= 1.2), efficiency
    coverage = held.mean(axis=0)
    assert np.all((coverage >= 0.90) & (coverage <= 0.98)), coverage


@pytest.mark.slow
def test_intervals_hold_with_coloured_noise():
    """Noise that a PX4FLOW's quantum makes is not white: an interval for white noise would hold half the time."""
    _, held = monte_carlo(200, colour=0.8)
    assert np.all(held.mean(axis=0) >= 0.85), held.mean(axis=0)


def test_the_variance_stated_is_the_bound():
    """With little noise the estimate is the truth, and so is where the information is taken."""
    noise = 1e-4 * np.random.default_rng(0).standard_normal(len(T_S))
    model = fit([experiment("one", T_S, U, T_S, output(TRUE) + noise)], Structure(2))
    stated = model.white_covariance * (SIGMA / model.sigma) ** 2
    assert stated[2, 2] == pytest.approx(bound()[0], rel=0.01)
    assert 0.25 * stated[1, 1] == pytest.approx(bound()[2] / TRUE[2] ** 2, rel=0.01)  # omega = sqrt(c)


def test_a_b_and_c_are_the_papers():
    model = fit([experiment("clean", T_S, U, T_S, output(TRUE))], Structure(2))
    b, c = coefficients(model)
    assert (numerator(model).value, b.value, c.value) == pytest.approx((A, B, C), rel=1e-5)
