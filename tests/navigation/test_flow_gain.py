"""A flow sensor whose gain is not 1: the noise is that of its reports, and the filter is given its equivalent."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.navigation.flow import offer_component
from flownav.navigation.kernel_settings import NO_HEADING, NO_STATED_NOISE, Equipment, FlowSettings
from flownav.navigation.reasons import FUSED
from flownav.navigation.records import FlowMemory, Look, Reading
from flownav.navigation.settings_of import settings_of
from flownav.navigation.verdicts import Biases
from flownav.sensors.camera_sheets import FlowCameraSheet
from flownav.sensors.datasheet import FlowSensor, load_sensor
from flownav.sensors.flow import FlowParameters, FlowState, flow_noise_sigma, read_flow
from flownav.sensors.flow_camera import (
    FlowCameraNormals,
    FlowCameraReading,
    FlowCameraState,
    FlowCameraTruth,
    FlowCameraUnit,
    step_flow_camera,
)
from flownav.sensors.settings import FlowSettings as Chosen
from navigation_streams import circle, fly, navigate
from sensor_normals import silent

NAN = math.nan
GAINS = (0.5, 0.7, 1.0, 1.4, 2.0)
FITTED = Equipment(True, False, NO_HEADING, False, -math.inf)
CAMERA = FlowCameraSheet.read().parameters()._replace(quality_sigma=0.0)
DRAWS = 3000
RATE_X, RATE_Y = 0.1, -0.2  # of the vehicle [rad/s]
FORWARD_M_S, RIGHT_M_S = 0.3, -0.2
USUAL = FlowMemory(taken_s=0.98, usual=255.0)


def sensor_of(gain: float) -> FlowSensor:
    """The paper's sensor with another gain; its noise is what the file says, whatever the gain."""
    sensor = load_sensor()
    dynamics = sensor.dynamics.model_copy(update={"a_1_s2": gain * sensor.dynamics.c_1_s2})
    return sensor.model_copy(update={"dynamics": dynamics})


def simulated(gain: float) -> FlowParameters:
    """The simulator's parameters from that file; fast flow is not cut off."""
    made = Chosen(sonar_overscale=False).parameters(sensor_of(gain))
    return made._replace(max_flow_rad_s=100.0, max_height_m=100.0)


def told(gain: float, *, by_file: bool) -> FlowSettings:
    """The navigator's settings from it."""
    settings, noise = settings_of(sensor_of(gain), flow_noise_stated=by_file)
    return settings.settings(FITTED, noise if by_file else NO_STATED_NOISE).flow


def offered(
    reading: Reading, component: int, height_m: float, s: FlowSettings, *, angular: bool
) -> tuple[float, float]:
    """Measured value and variance of a component."""
    look = Look(RATE_X, RATE_Y, height_m, known=1.0, upright=1.0, reason=FUSED)
    found = offer_component.law(
        reading, look, Biases(*[0.0] * 6), USUAL, t_s=1.0, component=component, angular=angular, s=s
    )
    assert found.offer.reason == FUSED
    return found.measured.measured, found.offer.variance


def camera_reading(noise: tuple[float, float], height_m: float, flow: FlowParameters) -> FlowCameraReading:
    """Of a perfect camera but for the sensor file's gain and noise, above ground that moves past."""
    truth = FlowCameraTruth(
        flow.gain * flow.lag_rest * FORWARD_M_S, flow.gain * flow.lag_rest * RIGHT_M_S, 0.0, RATE_X, RATE_Y, 0.0,
        height_m, height_m, 1.0, 1.0,
    )  # fmt: skip
    normals = silent(FlowCameraNormals)._replace(noise_x=noise[0], noise_y=noise[1])
    state = FlowCameraState(1.0, 0.0, 0.0, 0.0)
    return step_flow_camera(state, silent(FlowCameraUnit, noise=1.0), truth, normals, flow, CAMERA)[1]


def nis(errors: list[float], variances: list[float]) -> float:
    return float(np.mean(np.square(errors) / variances))


@pytest.mark.parametrize("gain", GAINS)
@pytest.mark.parametrize("height_m", [0.7, 1.5])
def test_the_error_of_an_angular_flow_is_what_the_filter_is_told_of_it(gain, height_m):
    flow, s = simulated(gain), told(gain, by_file=True)
    expected = (-RIGHT_M_S / height_m, FORWARD_M_S / height_m)
    random = np.random.default_rng(5)
    for component in range(2):
        errors, variances = [], []
        for noise in random.normal(size=(DRAWS, 2)):
            r = camera_reading(tuple(noise), height_m, flow)
            reading = Reading(
                r.flow_x_rad_s, r.flow_y_rad_s, r.gyro_x_rad_s, r.gyro_y_rad_s, quality=255.0, arrived=1.0
            )
            measured, variance = offered(reading, component, height_m, s, angular=True)
            errors.append(measured - expected[component])
            variances.append(variance)
        assert abs(np.mean(errors)) < 4.0 * math.sqrt(variances[0] / DRAWS)  # the gain is off
        assert nis(errors, variances) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / DRAWS))


@pytest.mark.parametrize("gain", GAINS)
@pytest.mark.parametrize("states", [True, False])
def test_the_error_of_a_metric_flow_is_what_the_filter_is_told_of_it(gain, states):
    """A variance that the sensor states is of what it reports, too. Beside the model's stands that of a range."""
    flow, s = simulated(gain), told(gain, by_file=True)._replace(range_sigma_m=0.0, range_relative_sigma=0.0)
    state = FlowState(flow.lag_rest * FORWARD_M_S, 0.0, flow.lag_rest * RIGHT_M_S, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    random = np.random.default_rng(6)
    errors, variances = [], []
    for normal_u, normal_v in random.normal(size=(DRAWS, 2)):
        r = read_flow(state, 1.0, 0.0, normal_u, normal_v, 0.0, flow)
        stated = r.sigma_m_s**2 if states else NAN
        reading = Reading(
            r.vel_u_m_s, r.vel_v_m_s, NAN, variance_0=stated, variance_1=stated, variance_2=NAN, quality=255.0,
            arrived=1.0,
        )  # fmt: skip
        for component, true in ((0, FORWARD_M_S), (1, RIGHT_M_S)):
            measured, variance = offered(reading, component, 1.0, s, angular=False)
            errors.append(measured - true)
            variances.append(variance)
    assert nis(errors, variances) == pytest.approx(1.0, abs=4.0 * math.sqrt(1.0 / DRAWS))


def test_a_range_that_scaled_a_metric_flow_errs_by_its_share_of_the_speed_whatever_the_gain():
    for gain in GAINS:
        s = told(gain, by_file=True)._replace(range_sigma_m=0.0, range_relative_sigma=0.1)
        still, fast = (Reading(gain * v, 0.0, NAN, *[NAN] * 3, NAN, NAN, NAN, 255.0, 1.0) for v in (0.0, 3.0))
        beside = offered(fast, 0, 1.0, s, angular=False)[1] - offered(still, 0, 1.0, s, angular=False)[1]
        assert beside == pytest.approx((0.1 * 3.0) ** 2)


@pytest.mark.parametrize("by_file", [True, False])
def test_a_sensor_of_twice_the_gain_is_told_half_the_metric_sigma(by_file):
    """Also where the quality tells the noise: what a pixel more or less reports is half the motion."""
    reading = Reading(0.2, 0.1, RATE_X, RATE_Y, quality=200.0, arrived=1.0)
    sigma = {
        gain: 1.5 * math.sqrt(offered(reading, 1, 1.5, told(gain, by_file=by_file), angular=True)[1]) for gain in GAINS
    }
    for gain in GAINS:
        assert sigma[gain] * gain == pytest.approx(sigma[1.0])
    if by_file:
        assert (round(sigma[1.0], 3), round(sigma[2.0], 3)) == (0.231, 0.116)


@pytest.mark.parametrize("angular", [True, False])
def test_each_axis_has_the_noise_of_its_own_gain(angular):
    one, other = (told(1.0, by_file=True)._replace(flow_gain_x=x, flow_gain_y=y) for x, y in ((1.0, 1.0), (2.0, 0.5)))
    reading = Reading(0.0, 0.0, 0.0, *[NAN] * 3, NAN, NAN, NAN, 255.0, 1.0)
    forward = 1 if angular else 0  # flow_y shows the speed forward
    for component, gain in ((forward, 2.0), (1 - forward, 0.5)):
        plain, taken_off = (offered(reading, component, 1.5, s, angular=angular)[1] for s in (one, other))
        assert taken_off == pytest.approx(plain / gain**2)


@pytest.mark.parametrize("gain", [0.5, 1.0, 2.0])
def test_innovations_are_as_large_as_the_filter_says_whatever_the_gain(gain):
    """Laps of 2 m/s at 2 m, all else exact; how noisy the flow is is not followed, which would correct the stated
    noise.
    """
    sensor, flown = sensor_of(gain), fly(circle, 40.0)
    flow = flown.streams[Sensor.FLOW_RATE]
    height_m = -flown.at(flow.t_s, flown.position)[:, 2:]
    noise = flow_noise_sigma(2.0, simulated(gain)) * np.random.default_rng(7).normal(size=(len(flow.t_s), 2))
    value = flow.value.copy()
    value[:, :2] = gain * value[:, :2] + noise / height_m
    settings, law = settings_of(sensor, flow_noise_stated=True)
    keys = {name: getattr(settings, name) for name in settings.model_fields_set} | {"flow_noise_time_s": 1e9}
    found = navigate(flown.changed(Sensor.FLOW_RATE, value=value), noise=law, **keys)
    late = (found.offered.sensor == Sensor.FLOW_RATE) & (found.offered.t_s > 5.0)
    assert np.count_nonzero(late) > 1300
    assert np.mean(found.offered.innovation[late] ** 2 / found.offered.innovation_variance[late]) == pytest.approx(
        1.0, abs=0.12
    )


@pytest.mark.parametrize("gain", GAINS)
@pytest.mark.parametrize("lag_c_1_s2", [0.0, 200.0])
def test_what_a_gyros_bias_leaves_in_a_flow_is_over_the_gain_too_and_the_law_is_told_how_much(gain, lag_c_1_s2):
    """The law subtracts `share` times the bias; that of a sensor with states of its own knows of no bias."""
    s = told(gain, by_file=True)._replace(flow_lag_c_1_s2=lag_c_1_s2)
    bias, guessed = (0.02, -0.03), (0.015, -0.01)  # of the IMU's gyro: as it is, and as the filter has it [rad/s]
    turned = (RATE_X + bias[0] - guessed[0], RATE_Y + bias[1] - guessed[1])
    look = Look(*turned, 1.5, known=1.0, upright=1.0, reason=FUSED)
    seen = (RATE_X - gain * RIGHT_M_S / 1.5, RATE_Y + gain * FORWARD_M_S / 1.5)
    reading = Reading(*seen, 0.0, 0.0, RATE_X + bias[0], RATE_Y + bias[1], quality=255.0, arrived=1.0)
    for component, motion in ((0, -RIGHT_M_S / 1.5), (1, FORWARD_M_S / 1.5)):
        found = offer_component.law(
            reading, look, Biases(*guessed, *[0.0] * 4), USUAL, t_s=1.0, component=component, angular=True, s=s
        )
        off = guessed[component] if lag_c_1_s2 > 0.0 else 0.0  # the filter's own, taken off with the turning
        left = bias[component] - off
        assert found.measured.measured == pytest.approx(motion - left / gain)
        assert found.share.share == pytest.approx(0.0 if lag_c_1_s2 > 0.0 else 1.0 / gain)
