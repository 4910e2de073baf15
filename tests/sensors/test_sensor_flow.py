"""The flow sensor: its lag, noise, sonar scale, lift-off shake, vertical channel and angular form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.core.frames import angular_flow, velocity_from_flow
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.flow import (
    PERIOD_S,
    FlowParameters,
    FlowState,
    flow_noise_sigma,
    misread,
    read_flow,
    sonar_overscale,
    start_flow,
    step_flow,
)
from flownav.sensors.noise_law import WORST_FIT, accuracy_law, fit_noise_law, power_law
from flownav.sensors.settings import FlowSettings

SENSOR = load_sensor()
G = 9.81
start, step, read = start_flow, step_flow, read_flow
sigma_at, overscale = flow_noise_sigma, sonar_overscale


def parameters(**settings: object) -> FlowParameters:
    return FlowSettings.model_validate(settings).parameters(SENSOR)


def quiet(state: FlowState, p: FlowParameters) -> tuple[float, float, float]:
    """The noise-free velocities."""
    reading = read(state, 1.0, 0.0, 0.0, 0.0, 0.0, p)
    return reading.vel_u_m_s, reading.vel_v_m_s, reading.vel_w_m_s


# -- dynamics --------------------------------------------------------------------------------------------
def test_a_steady_motion_starts_without_transient_at_the_identified_gain() -> None:
    p = parameters()
    state = start(0.5, -0.3, 0.2, G, p)
    for _ in range(500):
        np.testing.assert_allclose(quiet(state, p), np.array([0.5, -0.3, 0.2]) * 196.9 / 191.9, rtol=1e-10)
        state = step(state, 0.5, -0.3, 0.2, 1.0, G, p)


def test_a_ramp_arrives_late_by_b_over_c_and_half_a_period() -> None:
    p = parameters(shake=False)
    state = start(0.0, 0.0, 0.0, G, p)
    for k in range(1000):
        state = step(state, k * PERIOD_S, 0.0, 0.0, 1.0, G, p)
    behind = 1000 * PERIOD_S - quiet(state, p)[0] / SENSOR.dynamics.gain
    assert behind == pytest.approx(14.8 / 191.9 + 0.5 * PERIOD_S, abs=1e-6)


def test_channels_do_not_mix() -> None:
    p = parameters(shake=False)
    state = start(0.0, 0.0, 0.0, G, p)
    for _ in range(100):
        state = step(state, 0.0, 1.0, 0.0, 1.0, G, p)
    u, v, w = quiet(state, p)
    assert u == w == 0.0
    assert v > 1.0


def test_a_scenario_may_choose_any_of_the_28_identified_models() -> None:
    p = parameters(identified_height_m=1.5, identified_model=3)
    assert p.gain == 314.15
    assert p.lag_rest == 1.0 / 261.66


# -- noise -----------------------------------------------------------------------------------------------
@given(height=st.floats(0.6, 1.5))
def test_shipped_noise_follows_the_power_law_between_the_identified_heights(height: float) -> None:
    assert sigma_at(height, parameters()) == pytest.approx(0.0350 * (height / 0.6) ** 2.06, rel=1e-9)


def test_noise_is_not_extrapolated() -> None:
    p = parameters()
    assert sigma_at(0.1, p) == sigma_at(0.6, p)
    assert sigma_at(3.0, p) == sigma_at(1.5, p)
    assert sigma_at(3.0, p) == pytest.approx(0.231, abs=1e-3)


def test_the_papers_accuracy_rule_loses_ten_per_cent_of_the_signal_at_60_cm_and_43_at_150() -> None:
    law = accuracy_law(0.9, 0.6, 1.0)
    np.testing.assert_allclose(law(np.array([0.6, 0.8, 1.0, 1.5])), [0.1, 0.221, 0.303, 0.431], atol=5e-4)
    noise = {"law": "accuracy", "signal_sigma_m_s": 0.35, "min_height_m": 0.6, "max_height_m": 1.5}
    sensor = SENSOR.model_copy(update={"noise": type(SENSOR.noise).model_validate(noise)})
    p = FlowSettings().parameters(sensor)
    assert sigma_at(1.0, p) == pytest.approx(0.35 * 0.303, abs=2e-4)


def test_the_noise_floor_holds_where_the_law_is_below_it() -> None:
    noise = SENSOR.noise.model_copy(update={"floor_m_s": 0.05})
    p = FlowSettings().parameters(SENSOR.model_copy(update={"noise": noise}))
    assert sigma_at(0.6, p) == 0.05
    assert sigma_at(1.5, p) == pytest.approx(0.231, abs=1e-3)


@pytest.mark.parametrize("constant", [0.09, 0.0])
def test_a_constant_noise_may_replace_the_law(constant: float) -> None:
    p = parameters(constant_noise_m_s=constant)
    assert sigma_at(0.1, p) == sigma_at(1.0, p) == sigma_at(9.0, p) == constant


@given(
    low=st.floats(0.05, 2.0), ratio=st.floats(1.0, 30.0),
    exponent=st.floats(-1.0, 3.0), sigma=st.floats(0.001, 1.0),
)  # fmt: skip
def test_the_polynomial_follows_any_power_law_up_to_a_height_ratio_of_30(
    low: float, ratio: float, exponent: float, sigma: float
) -> None:
    fit = fit_noise_law(power_law(sigma, 0.6, exponent), low, low * ratio)
    assert fit.worst < WORST_FIT


@pytest.mark.parametrize(
    ("law", "low", "high", "message"),
    [
        (accuracy_law(0.9, 0.6, 0.3), 0.3, 1.5, "not positive from 0.3 to 1.5 m; raise the lower height"),
        (power_law(0.03, 0.6, -4.0), 0.05, 50.0, "too steep from 0.05 to 50 m; narrow the heights"),
    ],
)
def test_a_law_that_cannot_be_followed_is_refused(law: object, low: float, high: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fit_noise_law(law, low, high)


def test_published_noise_is_white_independent_and_of_the_stated_size() -> None:
    p, draw, count = parameters(), np.random.default_rng(7), 40_000
    state = start(0.0, 0.0, 0.0, G, p)
    reading = read(state, 1.0, 0.0, *draw.standard_normal((3, count)), p)
    sigma = reading.sigma_m_s
    assert sigma == sigma_at(1.0, p)
    channels = np.array([reading.vel_u_m_s, reading.vel_v_m_s, reading.vel_w_m_s])
    np.testing.assert_allclose(channels.std(axis=1), sigma, atol=4.0 * sigma / math.sqrt(2.0 * count))
    assert np.abs(np.corrcoef(channels) - np.eye(3)).max() < 4.0 / math.sqrt(count)


# -- the sonar's part ------------------------------------------------------------------------------------
def test_below_the_sonars_floor_velocity_is_over_scaled_by_floor_over_range() -> None:
    p = parameters()
    assert overscale(0.15, p) == 2.0
    assert overscale(0.3, p) == overscale(2.0, p) == 1.0
    assert overscale(-0.01, p) == pytest.approx(30.0)  # on the ground: large, not infinite
    state = start(0.0, 0.0, 0.0, G, p)
    for _ in range(1000):
        state = step(state, 0.1, 0.0, 0.1, 0.15, G, p)
    u, _, w = quiet(state, p)
    assert u == pytest.approx(0.2 * SENSOR.dynamics.gain)
    assert w == pytest.approx(0.1 * SENSOR.dynamics.gain)  # no range stands in the vertical channel


@pytest.mark.parametrize("range_m", [0.05, 0.15, 0.29, 0.5, 2.0])
def test_forward_and_sideways_are_one_sensor_turned_by_a_quarter(range_m: float) -> None:
    """Over-scale and shake are the sonar's and the mount's, which know no direction."""
    p = parameters()
    ahead, aside = start(0.0, 0.0, 0.0, 0.0, p), start(0.0, 0.0, 0.0, 0.0, p)
    for _ in range(100):
        ahead = step(ahead, 0.4, -0.1, 0.0, range_m, G, p)
        aside = step(aside, -0.1, 0.4, 0.0, range_m, G, p)
    (u, v, w), (u_aside, v_aside, w_aside) = quiet(ahead, p), quiet(aside, p)
    assert (u, v, w) == (v_aside, u_aside, w_aside)
    assert u != v


def test_the_over_scaling_can_be_switched_off() -> None:
    assert overscale(0.05, parameters(sonar_overscale=False)) == 1.0


def test_the_vertical_channel_is_synthetic_or_the_sonars() -> None:
    for vertical, expected in (("synthetic", 0.4 * SENSOR.dynamics.gain), ("sonar", 0.25)):
        p = parameters(vertical=vertical)
        state = start(0.0, 0.0, 0.4, G, p)
        reading = read(state, 1.0, -0.25, 0.0, 0.0, 0.0, p)  # the range shrinks: the vehicle descends
        assert reading.vel_w_m_s == pytest.approx(expected, rel=1e-12)


# -- lift-off shake --------------------------------------------------------------------------------------
def shaken_by_a_step(p: FlowParameters, seconds: float = 3.0) -> np.ndarray:
    """u, v, w readings of a sensor at rest whose rotor thrust steps from nothing to one g."""
    state = start(0.0, 0.0, 0.0, 0.0, p)
    readings = []
    for _ in range(round(seconds / PERIOD_S)):
        readings.append(quiet(state, p))
        state = step(state, 0.0, 0.0, 0.0, 1.0, G, p)
    return np.array(readings)


def test_a_step_of_thrust_shakes_the_vertical_channel_by_decimetres_a_second_and_dies_out() -> None:
    u, v, w = shaken_by_a_step(parameters()).T
    assert 0.1 < np.abs(w).max() < 0.5
    assert np.abs(w[-50:]).max() < 0.01
    np.testing.assert_allclose(u, 0.2 * w, atol=1e-15)
    np.testing.assert_allclose(v, 0.2 * w, atol=1e-15)


def test_the_mount_answers_a_step_as_its_closed_form() -> None:
    p = parameters()
    state = start(0.0, 0.0, 0.0, 0.0, p)
    mode, zeta = 2.0 * math.pi * 4.0, 0.1
    damped = mode * math.sqrt(1.0 - zeta**2)
    for k in range(200):
        t = k * PERIOD_S
        expected = G / damped * math.exp(-zeta * mode * t) * math.sin(damped * t)
        assert state.mount_m_s == pytest.approx(expected, abs=1e-12)
        state = step(state, 0.0, 0.0, 0.0, 1.0, G, p)


def test_a_steady_thrust_shakes_nothing_and_the_shake_can_be_switched_off() -> None:
    p = parameters()
    state = start(0.0, 0.0, 0.0, G, p)
    for _ in range(250):
        state = step(state, 0.0, 0.0, 0.0, 1.0, G, p)
    np.testing.assert_allclose(quiet(state, p), 0.0, atol=1e-12)
    assert np.all(shaken_by_a_step(parameters(shake=False), 0.5) == 0.0)


# -- angular flow ----------------------------------------------------------------------------------------
velocity, rate, distance = st.floats(-5.0, 5.0), st.floats(-3.0, 3.0), st.floats(0.1, 10.0)


@given(u=velocity, v=velocity, p=rate, q=rate, r=distance)
def test_metric_and_angular_flow_are_each_others_inverse(u: float, v: float, p: float, q: float, r: float) -> None:
    flow_x, flow_y = angular_flow(u, v, p, q, r)
    np.testing.assert_allclose(velocity_from_flow(flow_x - p, flow_y - q, r), (u, v), atol=1e-12)


def test_angular_flow_has_px4s_signs() -> None:
    assert angular_flow(1.0, 0.0, 0.0, 0.0, 2.0) == (0.0, 0.5)  # forward: positive about y
    assert angular_flow(0.0, 1.0, 0.0, 0.0, 2.0) == (-0.5, 0.0)  # right: negative about x
    assert angular_flow(0.0, 0.0, 0.3, -0.2, 2.0) == (0.3, -0.2)  # turning: the body rates themselves


def test_a_gyro_that_shows_too_little_lets_rotation_read_as_velocity():
    leaking = parameters(rotation_leak=0.128)
    assert misread(1.0, 2.0, 0.0, 0.3, 0.5, 2.0, leaking) == pytest.approx((1.0 + 0.128, 2.0 - 0.0768))
    assert misread(1.0, 2.0, 0.4, 0.3, 0.5, 2.0, parameters()) == (1.0, 2.0)


def test_an_old_range_scales_by_the_height_that_was():
    late = parameters(sonar_lag_s=0.1)
    assert misread(1.0, -2.0, 0.5, 0.0, 0.0, 1.0, late) == pytest.approx((1.05, -2.1))  # it descends
    assert misread(1.0, -2.0, -0.5, 0.0, 0.0, 1.0, late) == pytest.approx((0.95, -1.9))
    assert misread(1.0, 0.0, -20.0, 0.0, 0.0, 1.0, late)[0] >= 0.0
