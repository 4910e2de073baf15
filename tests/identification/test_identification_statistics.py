"""The whiteness test against its definition, term by term."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.lab.identification.output_error import whiteness


def ljung_box(residual, lags):
    """n(n + 2) Σ r_k²/(n - k), k = 1..lags (Ljung and Box 1978)."""
    n, centred = len(residual), residual - residual.mean()
    power = centred @ centred
    return n * (n + 2) * sum((centred[k:] @ centred[:-k] / power) ** 2 / (n - k) for k in range(1, lags + 1))


@pytest.mark.parametrize("count", [40, 130, 1000])
def test_the_statistic_is_ljungs_and_boxs(count):
    residual = np.random.default_rng(count).standard_normal(count)
    found = whiteness([residual])
    assert found.lags == min(25, count // 5)
    assert found.statistic == pytest.approx(ljung_box(residual, found.lags), rel=1e-9)


def test_the_statistic_of_white_residuals_has_the_mean_of_its_degrees_of_freedom():
    random = np.random.default_rng(3)
    statistics = [whiteness([random.standard_normal(60)]).statistic for _ in range(800)]
    assert np.mean(statistics) == pytest.approx(12.0, abs=4.0 * np.sqrt(2.0 * 12.0 / 800) + 0.1)
