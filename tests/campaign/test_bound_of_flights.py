"""The bound of simulated flights: that of the vertical channel alone, and of the landing filter only."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaign.accuracy import scenario_of
from flownav.campaign.judged import bound_of
from flownav.estimation.bound import posterior_bound
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario, with_filter


@pytest.fixture(scope="module")
def hover():
    """The first 8 s of the paper's landing in wind: hover at 3 m, sonar and white GPS."""
    scenario = scenario_of("landing")
    flight = scenario.flight.model_copy(update={"duration_s": 8.0})
    return assemble(scenario.model_copy(update={"flight": flight}))


def vertical_channel(landing, epochs):
    """Height, vertical speed and accelerometer bias as a model of its own: IMU, white GPS, sonar at 10 Hz."""
    s, dt = landing.settings, 0.02
    transition = np.array([[1.0, dt, -0.5 * dt * dt], [0.0, 1.0, -dt], [0.0, 0.0, 1.0]])
    walk, speed, bias = (x * x * dt for x in (s.position_walk_m_rt_s, s.accel_noise_m_s2_rt_hz, s.accel_walk_m_s2_rt_s))
    half = np.array([0.5 * dt, 1.0, 0.0])
    process = speed * np.outer(half, half) + np.diag([walk, 1e-16, bias])
    gps = (np.array([[1.0, 0.0, 0.0]]), np.array([[landing.gps_position_variance[2]]]))
    both = (np.array([[1.0, 0, 0], [1.0, 0, 0]]), np.diag([landing.gps_position_variance[2], landing.range_variance]))
    seen = [both if epoch % 5 == 0 else gps for epoch in range(1, epochs)]
    start = np.diag(landing.start_variance[[2, 5, 14]])
    return [transition] * (epochs - 1), [process] * (epochs - 1), [h for h, _ in seen], [r for _, r in seen], start


def test_the_simulators_bound_of_the_height_is_that_of_the_vertical_channel_alone(hover):
    bound = bound_of(hover, 1, 16).variance
    alone = posterior_bound(*vertical_channel(hover.flight.landing, len(bound)))
    late = slice(100, None)
    assert np.sqrt(bound[1:][late, 2]) == pytest.approx(np.sqrt(alone[late, 0, 0]), rel=0.05)


def test_the_bound_belongs_to_the_landing_filter():
    papers = assemble(with_filter(load_scenario("landing"), "paper"))
    with pytest.raises(ValueError, match="the bound is the landing filter's"):
        bound_of(papers, 1, 1)
