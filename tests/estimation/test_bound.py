"""The posterior Cramér-Rao bound against Stone Soup and against the Riccati recursion."""

from __future__ import annotations

import datetime
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posterior_bound import posterior_bound


def riccati(transitions, process_noises, observations, measurement_noises, covariance):
    """Covariances of the Kalman filter, which attains the bound of a linear model."""
    found = []
    for f, q, h, r in zip(transitions, process_noises, observations, measurement_noises, strict=True):
        covariance = f @ covariance @ f.T + q
        gain = covariance @ h.T @ np.linalg.inv(h @ covariance @ h.T + r)
        covariance = (np.eye(len(q)) - gain @ h) @ covariance
        found.append(covariance)
    return np.array(found)


def random_model(seed, states, steps):
    """A time-varying model with one to three, and now and then no, observations a step."""
    draw = np.random.default_rng(seed)

    def covariance(size):
        root = draw.standard_normal((size, size + 2))
        return root @ root.T / (size + 2) + 0.05 * np.eye(size)

    observed = draw.integers(0, 4, steps)
    return (
        [np.eye(states) + 0.2 * draw.standard_normal((states, states)) for _ in range(steps)],
        [covariance(states) for _ in range(steps)],
        [draw.standard_normal((m, states)) for m in observed],
        [covariance(m) if m else np.zeros((0, 0)) for m in observed],
        covariance(states),
    )


@given(st.integers(0, 10**6), st.integers(1, 6), st.integers(1, 30))
@settings(max_examples=40, deadline=None)
def test_of_a_linear_model_it_is_what_the_kalman_filter_attains(seed, states, steps):
    model = random_model(seed, states, steps)
    assert posterior_bound(*model) == pytest.approx(riccati(*model), rel=1e-6, abs=1e-9)


@given(st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_another_observation_never_raises_it(seed):
    f, q, h, r, initial = random_model(seed, 4, 12)
    fewer = posterior_bound(f, q, [np.zeros((0, 4))] * 12, [np.zeros((0, 0))] * 12, initial)
    gap = fewer - posterior_bound(f, q, h, r, initial)
    assert np.linalg.eigvalsh(gap).min() > -1e-9 * np.abs(fewer).max()


def test_lists_of_different_length_are_refused():
    one = [np.eye(1)]
    with pytest.raises(ValueError, match="differ in length"):
        posterior_bound(one, one, one * 2, one, np.eye(1))


@pytest.mark.filterwarnings("ignore")
def test_it_is_stone_soups_posterior_bound_of_a_tracked_vehicle():
    """Near-constant velocity in the plane, position measured: its PCRBMetric, an implementation of others."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        soup = pytest.importorskip("stonesoup.metricgenerator.pcrbmetric")
        from stonesoup.metricgenerator.manager import MultiManager
        from stonesoup.models.measurement.linear import LinearGaussian
        from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
        from stonesoup.types.array import StateVectors
        from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState
        from stonesoup.types.state import GaussianState
    start, step = datetime.datetime(2026, 1, 1), datetime.timedelta(seconds=0.5)
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.3), ConstantVelocity(0.1)])
    seen = LinearGaussian(ndim_state=4, mapping=(0, 2), noise_covar=np.diag([0.25, 0.5]))
    initial = np.diag([4.0, 1.0, 9.0, 2.0])
    truth = GroundTruthPath([GroundTruthState([[0], [1], [0], [1]], timestamp=start + k * step) for k in range(25)])
    metric = soup.PCRBMetric(
        prior=GaussianState([[0], [1], [0], [1]], initial, timestamp=start),
        transition_model=motion,
        measurement_model=seen,
        sensor_locations=StateVectors([[0], [0]]),
        velocity_mapping=[1, 3],
    )
    manager = MultiManager([metric])
    manager.add_data({"groundtruth_paths": {truth}})
    theirs = np.array(metric.compute_metric(manager)[0].value["inverse_j"], float)
    count = len(truth) - 1
    ours = posterior_bound(
        [np.array(motion.matrix(time_interval=step), float)] * count,
        [np.array(motion.covar(time_interval=step), float)] * count,
        [np.array(seen.matrix(), float)] * count,
        [np.array(seen.noise_covar, float)] * count,
        initial,
    )
    assert ours == pytest.approx(theirs[1:], rel=1e-9, abs=1e-12)
