"""The bound of simulated flights: that of the vertical channel alone, and of the navigator only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flownav.campaigns.accuracy import scenario_of
from flownav.campaigns.judged import bound_of
from flownav.campaigns.local import fly_recorded
from flownav.core.measurement import Sensor
from flownav.simulation.assemble import assemble
from flownav.simulation.fitting import refitted
from flownav.simulation.onboard import without
from flownav.simulation.scenario import load_scenario, with_filter
from flownav.simulation.sensing import EPOCH_S
from posterior_bound import posterior_bound

IMU_S, GPS_EVERY = 0.01, 2
BESIDE = ("flow_camera", "range_sensor", "barometer")


@pytest.fixture(scope="module")
def hover():
    """The first 8 s of the paper's landing in wind: hover at 3 m on IMU, compass and white GPS at 50 Hz alone."""
    scenario = scenario_of("landing")
    flight = scenario.flight.model_copy(update={"duration_s": 8.0})
    setup = assemble(scenario.model_copy(update={"flight": flight}))
    onboard = setup.fitted.onboard
    fewer = without(onboard, *BESIDE)
    fitted = refitted(setup.fitted, setup.flight.plan.epochs, onboard=fewer)
    table = fitted.schedule
    return replace(setup, fitted=fitted, flight=setup.flight._replace(onboard=fewer, table=table))


def gps_variance(setup):
    """Of one height, as the navigator has it: the white part, and its share of what the receiver states."""
    settings, fed = setup.fitted.given.settings, fly_recorded(setup, 1).tables["fed"]
    stated = fed["variance_2"][fed["sensor"] == Sensor.GPS_POSITION][0]
    return settings.gps_white_sigma_down_m**2 + settings.gps_white_share**2 * stated


def start_bias_variance(setup):
    """Variance of the accelerometer's bias at the start, as the navigator has it: the stated one, and that of shaken
    readings.
    """
    spread = fly_recorded(setup, 1).tables["states"]["std_accel_bias_z_m_s2"][0]
    assert spread > setup.fitted.given.settings.accel_bias_sigma_m_s2
    return spread**2


def first_epoch(setup):
    """At which the navigator has started, a horizon behind."""
    start_s = fly_recorded(setup, 1).tables["events"]["t_s"][0]
    return int(np.ceil(start_s / EPOCH_S)) - setup.fitted.schedule.horizon_epochs


def vertical_channel(setup, steps):
    """Height, vertical speed and accelerometer bias as a model of its own, at the IMU's steps."""
    s = setup.fitted.given.settings
    dt, noise, none = IMU_S, gps_variance(setup), (np.zeros((0, 3)), np.zeros((0, 0)))
    transition = np.array([[1.0, dt, -0.5 * dt * dt], [0.0, 1.0, -dt], [0.0, 0.0, 1.0]])
    vertical = s.accel_noise_m_s2_rt_hz * s.accel_noise_down_share
    walk, speed, bias = (x * x * dt for x in (s.position_walk_m_rt_s, vertical, s.accel_walk_m_s2_rt_s))
    half = np.array([0.5 * dt, 1.0, 0.0])
    process = speed * np.outer(half, half) + np.diag([walk, 1e-16, bias])
    gps = (np.array([[1.0, 0.0, 0.0]]), np.array([[noise]]))
    seen = [gps if step % GPS_EVERY == 0 else none for step in range(steps)]
    start = np.diag([noise, s.start_velocity_sigma_m_s**2, start_bias_variance(setup)])
    return [transition] * steps, [process] * steps, [h for h, _ in seen], [r for _, r in seen], start


def test_the_simulators_bound_of_the_height_is_that_of_the_vertical_channel_alone(hover):
    bound = bound_of(hover, 1, 16).variance[first_epoch(hover) :]
    alone = posterior_bound(*vertical_channel(hover, GPS_EVERY * len(bound)))[::GPS_EVERY]
    late = slice(100, None)
    assert np.sqrt(bound[late, 2]) == pytest.approx(np.sqrt(alone[late, 0, 0]), rel=0.02)
    speed = np.sqrt(bound[late, 5] / alone[late, 1, 1])
    assert speed[:100] == pytest.approx(1.0, abs=0.08)
    assert np.all((speed > 1.0) & (speed < 1.3))  # innovations that are alike for a while free the accelerometer's bias


def test_the_bound_is_the_navigators():
    papers = assemble(with_filter(load_scenario("landing"), "paper"))
    with pytest.raises(ValueError, match="the bound is the navigator's, and it does not fly"):
        bound_of(papers, 1, 1)
