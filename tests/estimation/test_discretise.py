"""The zero-order hold against scipy's matrix exponential."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from flownav.estimation.error_models import discretised
from flownav.vehicle.linearize import load_paper_model


@pytest.mark.parametrize("dt", [0.0, 0.004, 0.02, 1.0])
def test_hold_is_the_matrix_exponential(dt):
    model = load_paper_model()
    generator = np.zeros((10, 10))
    generator[:6, :6], generator[:6, 6:] = model.a, model.b
    exact = expm(generator * dt)
    transition, input_matrix = discretised(model.a, model.b, dt)
    assert transition == pytest.approx(exact[:6, :6], abs=1e-12)
    assert input_matrix == pytest.approx(exact[:6, 6:], rel=1e-11, abs=1e-12)


def test_papers_model_at_50_hz_is_as_the_reference_computed():
    """The eigenvalues of the printed matrix, held over 20 ms."""
    model = load_paper_model()
    transition, input_matrix = discretised(model.a, model.b, 0.02)
    block = [[0.99962, 0.00249, 0.00137], [-0.00252, 0.9994, 0.01074], [-0.00132, -0.01041, 0.9364]]
    assert transition[3:, 3:] == pytest.approx(np.array(block), abs=6e-6)
    assert input_matrix[5, 2] == pytest.approx(-5.703, abs=1e-3)
    assert input_matrix[4, 3] == pytest.approx(-0.3465, abs=1e-4)
