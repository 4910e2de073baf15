"""Output-error identification beside a fit built on SciPy's `lsim`: one 15 000-sample second-order run, same start."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal
from scipy.optimize import least_squares

from flownav.identification.experiment import experiment
from flownav.identification.output_error import Structure, fit

SAMPLES, RATE_HZ = 15_000, 100.0
TRUE = (196.9, 14.8, 191.9)  # a, b, c of the paper's selected model


@pytest.fixture(scope="module")
def run():
    t_s = np.arange(SAMPLES) / RATE_HZ
    swing = 0.35 * np.exp(-0.01 * t_s) * np.sin(3.4 * t_s + 0.02 * t_s**2)
    a, b, c = TRUE
    _, response, _ = signal.lsim(([a], [1.0, b, c]), swing, t_s, interp=False)
    noise = 0.025 * np.random.default_rng(1).standard_normal(SAMPLES)
    return t_s, swing, response + noise


@pytest.mark.benchmark(group=f"second-order fit of {SAMPLES} samples")
def test_flownav(benchmark, run):
    t_s, swing, measured = run
    record = experiment("swing", t_s, swing, t_s, measured)
    found = benchmark(fit, [record], Structure(2))
    assert found.fit_percent > 80.0


@pytest.mark.benchmark(group=f"second-order fit of {SAMPLES} samples")
def test_scipy_lsim_and_least_squares(benchmark, run):
    t_s, swing, measured = run

    def residuals(logarithms):
        a, b, c = np.exp(logarithms)
        return signal.lsim(([a], [1.0, b, c]), swing, t_s, interp=False)[1] - measured

    start = np.log([100.0, 20.0, 100.0])
    found = benchmark.pedantic(least_squares, (residuals, start), rounds=1)
    assert np.exp(found.x) == pytest.approx(TRUE, rel=0.2)
