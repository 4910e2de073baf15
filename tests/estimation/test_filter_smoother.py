"""The filter's steps run backwards, against dense transposes and the Rauch-Tung-Striebel smoother of FilterPy."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from filters import SETTINGS, Filter, N, transition_of
from flownav.core.compile import ONE_LANE
from flownav.estimation.motion import errors_in_motion
from flownav.estimation.smoother import (
    back_over_correction,
    back_over_decay,
    back_over_prediction,
    back_over_reset,
    decay_factors,
    smoothed_covariance,
)
from flownav.estimation.states import FORCE, MIDDLE, STATES
from smoother_oracles import dense_decay, dense_transition, smoother_gain


def some_motion(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """R_EB in the middle of a step, row by row, and a specific force NED."""
    return np.linalg.qr(random.normal(size=(3, 3)))[0].ravel(), random.normal(0.0, 8.0, 3)


def random_square(random: np.random.Generator) -> np.ndarray:
    root = random.normal(size=(STATES, STATES))
    square = root @ root.T
    return np.tril(square) + np.tril(square, -1).T


def test_the_dense_transition_is_the_filters_own():
    random = np.random.default_rng(1)
    middle, force = some_motion(random)
    filter_ = Filter()
    filter_.rows(MIDDLE, 9)[:], filter_.rows(FORCE, 3)[:] = middle, force
    ours = transition_of(filter_, lambda run: errors_in_motion(run.work, ONE_LANE, N, dt_s=0.3))
    assert np.allclose(ours[:STATES, :STATES], dense_transition(0.3, middle, force), rtol=0, atol=1e-12)


def test_a_prediction_backwards_is_its_dense_transpose():
    random = np.random.default_rng(2)
    middle, force = some_motion(random)
    vector, matrix = random.normal(size=STATES), random_square(random)
    transition = dense_transition(0.2, middle, force)
    wanted = transition.T @ vector, transition.T @ matrix @ transition
    back_over_prediction(vector, matrix, 0.2, middle, force)
    assert np.allclose(vector, wanted[0], rtol=0, atol=1e-12 * np.abs(wanted[0]).max())
    assert np.allclose(matrix, wanted[1], rtol=0, atol=1e-12 * np.abs(wanted[1]).max())
    assert np.array_equal(matrix, matrix.T)


def test_a_decay_backwards_is_its_dense_transpose():
    random = np.random.default_rng(3)
    vector, matrix = random.normal(size=STATES), random_square(random)
    decay = dense_decay(0.7, SETTINGS)
    assert np.diag(decay) == pytest.approx(decay_factors(0.7, SETTINGS), rel=1e-15)
    wanted = decay @ vector, decay @ matrix @ decay
    back_over_decay(vector, matrix, 0.7, SETTINGS)
    assert np.allclose(vector, wanted[0], rtol=1e-14)
    assert np.allclose(matrix, wanted[1], rtol=1e-14)
    assert np.array_equal(matrix, matrix.T)


def test_predictions_and_corrections_backwards_are_the_rts_smoother_of_filterpy():
    random = np.random.default_rng(5)
    steps, dt_s = 40, 0.2
    transitions, laws, motions = [], [], []
    for _ in range(steps):
        motions.append(some_motion(random))
        transitions.append(dense_decay(dt_s, SETTINGS) @ dense_transition(dt_s, *motions[-1]))
        laws.append(np.where(random.random(STATES) < 0.2, random.normal(size=STATES), 0.0))
    model = KalmanFilter(STATES, 1)
    model.x, model.P = np.zeros((STATES, 1)), np.diag(random.uniform(0.1, 2.0, STATES))
    noise, variance = np.diag(random.uniform(1e-3, 1e-2, STATES)), 0.3
    states, covariances, corrections = [], [], []
    for transition, law in zip(transitions, laws, strict=True):
        model.predict(F=transition, Q=noise)
        model.update(random.normal(0.0, 2.0), R=variance, H=law[None])
        states.append(model.x.copy())
        covariances.append(model.P.copy())
        corrections.append((law, model.K.ravel().copy(), float(model.y.item()), float(model.S.item())))
    wanted, wanted_covariance, *_ = model.rts_smoother(
        np.array(states), np.array(covariances), np.array(transitions), np.array([noise] * steps)
    )
    vector, matrix = np.zeros(STATES), np.zeros((STATES, STATES))
    for k in range(steps - 1, -1, -1):
        found = states[k].ravel() - covariances[k] @ vector
        assert found == pytest.approx(wanted[k].ravel(), rel=1e-7, abs=1e-7)
        assert smoothed_covariance(covariances[k], matrix) == pytest.approx(wanted_covariance[k], rel=1e-6, abs=1e-8)
        back_over_correction(vector, matrix, *corrections[k])
        back_over_decay(vector, matrix, dt_s, SETTINGS)
        back_over_prediction(vector, matrix, dt_s, *motions[k])
        assert (matrix == matrix.T).all()


def test_one_step_back_is_the_smoother_gain():
    """Of a prediction and one correction: C = P F' P_predicted^-1 in NumPy."""
    random = np.random.default_rng(6)
    motion, p = some_motion(random), random_square(random) / STATES
    f, h = dense_transition(0.1, *motion), np.where(random.random(STATES) < 0.2, random.normal(size=STATES), 0.0)
    predicted = f @ p @ f.T + 1e-3 * np.eye(STATES)
    variance, nu = h @ predicted @ h + 0.3, 1.7
    k = predicted @ h / variance
    corrected = predicted - np.outer(k, h @ predicted)
    gain = smoother_gain(p, f, predicted)
    vector, matrix = np.zeros(STATES), np.zeros((STATES, STATES))
    back_over_correction(vector, matrix, h, k, nu, variance)
    back_over_prediction(vector, matrix, 0.1, *motion)
    assert -p @ vector == pytest.approx(gain @ (k * nu), rel=1e-9, abs=1e-10)
    wanted = p + gain @ (corrected - predicted) @ gain.T
    assert np.allclose(smoothed_covariance(p, matrix), wanted, rtol=1e-9, atol=1e-10)


def test_a_reset_backwards_is_a_transition_that_forgets():
    random = np.random.default_rng(2)
    vector, matrix = random.normal(size=STATES), random_square(random)
    forgets = np.eye(STATES)
    forgets[7, 7] = 0.0
    wanted = forgets @ vector, forgets @ matrix @ forgets
    back_over_reset(vector, matrix, 7)
    assert (vector == wanted[0]).all()
    assert (matrix == wanted[1]).all()
