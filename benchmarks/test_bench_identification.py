"""Output-error identification beside what else a Python user has: one 15 000-sample second-order run, and a campaign.

The run is a chirp through the paper's selected model with 0.025 m/s of white noise. SciPy: `least_squares` on
`lsim` (same model, same hold, derivatives by differences). SysIdentPy, where it is installed: its polynomial ARX of
order two, which is quick because it fits one step ahead, and pays in its simulated fit (`extra_info`).
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal
from scipy.optimize import least_squares

from flownav.lab.identification.experiment import experiment
from flownav.lab.identification.output_error import Structure, fit, fit_percent
from flownav.lab.identification.quantities import choose

SAMPLES, RATE_HZ = 15_000, 100.0
TRUE = (196.9, 14.8, 191.9)  # a, b, c of the paper's selected model
GROUP = f"second-order fit of {SAMPLES} samples"
HEIGHTS, RUNS, RUN_SAMPLES = 4, 7, 2_500


def simulated(u: np.ndarray, t_s: np.ndarray, abc: tuple[float, float, float] = TRUE) -> np.ndarray:
    return signal.lsim(([abc[0]], [1.0, abc[1], abc[2]]), u, t_s, interp=True)[1]


@pytest.fixture(scope="module")
def run():
    t_s = np.arange(SAMPLES) / RATE_HZ
    chirp = 0.3 * np.sin(2.0 * np.pi * (0.2 * t_s + 0.016 * t_s**2))
    return t_s, chirp, simulated(chirp, t_s) + 0.025 * np.random.default_rng(1).standard_normal(SAMPLES)


@pytest.mark.benchmark(group=GROUP)
def test_flownav(benchmark, run):
    t_s, u, y = run
    found = benchmark(fit, [experiment("chirp", t_s, u, t_s, y)], Structure(2))
    benchmark.extra_info["fit_percent"] = found.fit_percent
    assert np.exp(found.point.log_a) == pytest.approx(TRUE[1:], rel=0.02)


@pytest.mark.benchmark(group=GROUP)
def test_scipy_lsim_and_least_squares(benchmark, run):
    t_s, u, y = run
    found = benchmark.pedantic(
        least_squares,
        (lambda logarithms: simulated(u, t_s, tuple(np.exp(logarithms))) - y, np.log([100.0, 20.0, 100.0])),
        rounds=1,
    )
    benchmark.extra_info["fit_percent"] = fit_percent(y, simulated(u, t_s, tuple(np.exp(found.x))))
    assert np.exp(found.x) == pytest.approx(TRUE, rel=0.02)


@pytest.mark.benchmark(group=GROUP)
def test_sysidentpy_arx(benchmark, run):
    selection = pytest.importorskip("sysidentpy.model_structure_selection", reason="pip install sysidentpy to compare")
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.parameter_estimation import LeastSquares

    _, u, y = run

    def identify():
        model = selection.FROLS(
            order_selection=False, n_terms=4, ylag=2, xlag=2, basis_function=Polynomial(degree=1),
            estimator=LeastSquares(),
        )  # fmt: skip
        return model.fit(X=u[:, None], y=y[:, None])

    model = benchmark(identify)
    predicted = model.predict(X=u[:, None], y=y[:, None])[:, 0]  # simulated: only the first readings are given
    benchmark.extra_info["fit_percent"] = fit_percent(y, predicted)


@pytest.mark.benchmark(group=f"campaign of {HEIGHTS} heights x {RUNS} runs x {RUN_SAMPLES} samples, with intervals")
def test_campaign(benchmark):
    """Six structures jointly at each height and the best of them; a second-order model of each run."""
    t_s = np.arange(RUN_SAMPLES) / RATE_HZ
    heights = []
    for height in range(HEIGHTS):
        swings = [0.35 * np.exp(-0.04 * t_s) * np.sin((2.6 + 0.2 * height) * t_s + phase) for phase in range(RUNS)]
        noise = np.random.default_rng(height).standard_normal((RUNS, RUN_SAMPLES)) * 0.025 * (1 + height)
        heights.append(
            [experiment("swing", t_s, u, t_s, simulated(u, t_s) + e) for u, e in zip(swings, noise, strict=True)]
        )

    def campaign():
        return [(choose(runs), [fit([one], Structure(2)) for one in runs]) for runs in heights]

    found = benchmark.pedantic(campaign, rounds=3, warmup_rounds=1)
    assert len(found) == HEIGHTS
