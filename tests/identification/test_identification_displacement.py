"""The flow's track matched to the reference's, on tracks whose axes, scales and lateness are known."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.lab.identification.flight import Flight
from flownav.lab.identification.scale import match

STEP_S, REFERENCE_STEP_S, DURATION_S = 0.05, 0.1, 120.0


def flown(mixing: np.ndarray, *, late_s: float = 0.0, seed: int = 0, noise_m: float = 0.1) -> Flight:
    """Level flight facing north: the true body velocity is mixing @ the flow's; positions late and with white noise."""
    motion, random = np.random.default_rng(99), np.random.default_rng(seed)
    t_s = np.arange(0.0, DURATION_S, STEP_S)
    waves = zip(motion.uniform(0.1, 0.4, (8, 2)), motion.uniform(0.1, 1.5, (8, 2)), motion.uniform(0, 6, (8, 2)),
                strict=True)  # fmt: skip
    velocity = sum(a * np.sin(w * t_s[:, None] + p) for a, w, p in waves)
    travelled = np.vstack([np.zeros(2), np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * STEP_S, axis=0)])
    reference_t_s = np.arange(0.0, DURATION_S, REFERENCE_STEP_S)
    place = np.column_stack([np.interp(reference_t_s - late_s, t_s, column) for column in travelled.T])
    place = np.column_stack([place + noise_m * random.standard_normal(place.shape), np.zeros(len(place))])
    flow = velocity @ np.linalg.inv(mixing).T + 0.05 * random.standard_normal(velocity.shape)
    level = Stream.of(Sensor.ATTITUDE, t_s[[0, -1]], np.array([[1.0, 0.0, 0.0, 0.0]] * 2))
    return Flight(
        "made", t_s, flow, 0.0, np.full(len(t_s), 255.0), np.full(len(t_s), 2.0), np.ones(len(t_s), bool), level,
        None, "gps", reference_t_s, place, None, 1.0, (),
    )  # fmt: skip


def turn(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize(
    "mixing",
    [np.diag([0.8, 1.1]), turn(0.3), turn(-0.3) @ np.diag([1.2, 0.9]), np.array([[0.0, 1.0], [1.0, 0.0]]),
     np.array([[1.0, 0.2], [0.0, 0.9]])],
    ids=["scales", "turned right", "turned left", "swapped", "skewed"],
)  # fmt: skip
def test_scales_and_axes_are_found_as_they_are(mixing):
    found = match(flown(mixing, late_s=0.15), 0.0)
    sigmas = np.sqrt(np.diag(found.covariance))
    columns = mixing.T.ravel()  # m11, m21, m12, m22
    assert np.abs(found.mixing.T.ravel() - columns) == pytest.approx(np.zeros(4), abs=0.04)
    assert np.all(np.abs(found.mixing.T.ravel() - columns) < 4.0 * sigmas[:4])
    assert found.lag_s == pytest.approx(0.15, abs=4.0 * sigmas[4])


def test_a_flow_that_arrives_late_is_put_where_it_belongs():
    assert match(flown(np.eye(2), late_s=0.15), 0.1).lag_s == pytest.approx(0.25, abs=0.06)


def test_the_covariance_is_that_of_the_scatter():
    found = [match(flown(np.eye(2), seed=seed), 0.0) for seed in range(30)]
    scatter = np.std([[*one.mixing.T.ravel(), one.lag_s] for one in found], axis=0)
    stated = np.sqrt(np.mean([np.diag(one.covariance) for one in found], axis=0))
    assert np.all((scatter / stated > 0.6) & (scatter / stated < 1.6)), scatter / stated
