"""The Kalman algebra as plain Python: what the gate lets through, what a rejected reading leaves, what is shown."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.core.compile import ONE_LANE
from flownav.estimation import paper_filter
from flownav.estimation.paper_filter import PaperModel

N = 3
ROWS = paper_filter.kalman_rows(0, N)
COUNT = paper_filter.kalman_row_count(N)


def filter_of(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A buffer with a state and a covariance, and both."""
    random = np.random.default_rng(seed)
    root = random.standard_normal((N, N + 2))
    state, covariance = random.standard_normal(N), root @ root.T
    work = np.zeros(COUNT)
    work[ROWS.state : ROWS.state + N] = state
    work[ROWS.covariance : ROWS.covariance + N * N] = covariance.ravel()
    return work, state, covariance


def offered(work: np.ndarray, component: int, innovation: float, noise: float, gate_sigma: float) -> bool:
    """Offer a reading of one state; whether it was fused."""
    work[[ROWS.innovation, ROWS.noise, ROWS.offered]] = innovation, noise, 1.0
    paper_filter.test_component(work, ONE_LANE, ROWS, N, component, gate_sigma)
    paper_filter.correct_state(work, ONE_LANE, ROWS, N)
    paper_filter.correct_covariance_short(work, ONE_LANE, ROWS, N)
    return bool(work[ROWS.accepted])


@given(st.integers(0, 1000), st.integers(0, N - 1), st.floats(0.01, 3.0), st.floats(1.5, 6.0))
def test_the_gate_lies_at_so_many_standard_deviations_of_the_innovation(seed, component, noise, gate_sigma):
    _, state, covariance = filter_of(seed)
    edge = gate_sigma * np.sqrt(covariance[component, component] + noise)
    for share in (0.999, -0.999):
        assert offered(filter_of(seed)[0], component, share * edge, noise, gate_sigma)
    for share in (1.001, -1.001):
        work = filter_of(seed)[0]
        assert not offered(work, component, share * edge, noise, gate_sigma)
        assert np.array_equal(work[ROWS.state : ROWS.state + N], state)
        assert np.array_equal(work[ROWS.covariance : ROWS.covariance + N * N], covariance.ravel())
        assert work[ROWS.test_ratio] == pytest.approx(1.001**2)


@given(st.integers(0, 1000), st.integers(0, N - 1), st.floats(-2.0, 2.0), st.floats(0.01, 3.0))
def test_a_fused_reading_adds_its_information(seed, component, innovation, noise):
    """The inverse covariance grows by h'h/R, and the state moves by P h'/R times the reading's rest."""
    work, state, covariance = filter_of(seed)
    assert offered(work, component, innovation, noise, 1e6)
    after = work[ROWS.covariance : ROWS.covariance + N * N].reshape(N, N)
    seen = np.zeros((N, N))
    seen[component, component] = 1.0 / noise
    assert after == pytest.approx(np.linalg.inv(np.linalg.inv(covariance) + seen), rel=1e-6, abs=1e-9)
    assert work[ROWS.state : ROWS.state + N] == pytest.approx(
        state + after[:, component] / noise * innovation, abs=1e-7
    )


def test_the_papers_filter_shows_every_components_innovation_and_its_variance():
    size = paper_filter.STATES
    rows, inputs = paper_filter.kalman_rows(0, size), paper_filter.kalman_row_count(size)
    measured, arrived, seen = inputs + 4, inputs + 4 + size, inputs + 4 + 2 * size
    random = np.random.default_rng(5)
    model = PaperModel(np.eye(size), np.zeros((size, 4)), np.full(size, 0.1), np.array([0.5, 0.4, 0.3, 0.2, 0.1, 0.6]))
    work = np.zeros(seen + 2 * size)
    state, readings = random.standard_normal(size), random.standard_normal(size)
    variances = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    paper_filter.start(work, ONE_LANE, rows, size, variances)
    work[rows.state : rows.state + size], work[measured:arrived], work[arrived:seen] = state, readings, 1.0
    paper_filter.update(work, ONE_LANE, rows, measured, arrived, seen, model)  # uncorrelated: none moves another
    assert work[seen : seen + size] == pytest.approx(readings - state)
    assert work[seen + size :] == pytest.approx(variances + model.measurement_noise)
