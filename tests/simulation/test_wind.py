"""Wind: MIL-F-8785C's profile, scales and spectra; nothing at all when off."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st

from flownav.core.errors import InputError
from flownav.core.parameter_files import check
from flownav.simulation.wind import (
    PERIOD_S,
    SQRT3,
    WindNormals,
    WindSettings,
    WindState,
    dryden_scales,
    start_wind,
    step_wind,
    wind_velocity,
)

start, step, velocity = start_wind, step_wind, wind_velocity
CALM = WindState(*[0.0] * len(WindState._fields))


def normals(draw: np.random.Generator, count: int) -> WindNormals:
    return WindNormals(*draw.standard_normal((6, count)))


# -- scales ----------------------------------------------------------------------------------------------
def test_scales_are_those_of_the_specification() -> None:
    at_100_ft = dryden_scales(15.0, 30.48)
    assert at_100_ft.sigma_down_m_s == pytest.approx(1.5)
    assert at_100_ft.length_down_m == pytest.approx(30.48)
    thinning = 0.177 + 0.0823
    assert at_100_ft.length_along_m == pytest.approx(30.48 / thinning**1.2)
    assert at_100_ft.sigma_along_m_s == pytest.approx(1.5 / thinning**0.4)
    at_1000_ft = dryden_scales(15.0, 304.8)  # where the low-altitude model meets the isotropic one
    assert at_1000_ft.sigma_along_m_s == pytest.approx(at_1000_ft.sigma_down_m_s)
    assert at_1000_ft.length_along_m == pytest.approx(at_1000_ft.length_down_m)


# -- the steady part -------------------------------------------------------------------------------------
def test_at_20_feet_the_wind_has_its_stated_speed_and_below_it_the_logarithmic_profile() -> None:
    p = WindSettings(speed_20ft_m_s=6.0, gusts=False).parameters()
    assert velocity(CALM, 6.096, p).wind_n_m_s == pytest.approx(-6.0)  # from the north: towards the south
    assert velocity(CALM, 3.0, p).wind_n_m_s == pytest.approx(-6.0 * math.log(3.0 / 0.04572) / math.log(20.0 / 0.15))
    assert velocity(CALM, 0.0457, p) == velocity(CALM, 0.0, p) == velocity(CALM, -1.0, p) == (0.0,) * 6
    assert -velocity(CALM, 0.22, p).wind_n_m_s == pytest.approx(6.0 * math.log(0.22 / 0.04572) / math.log(20.0 / 0.15))


def test_a_smoother_ground_has_more_wind_at_the_skids() -> None:
    settings = [WindSettings(speed_20ft_m_s=6.0, gusts=False, roughness_m=z0) for z0 in (0.1, 0.03, 0.005)]
    low = [-velocity(CALM, 0.3, one.parameters()).wind_n_m_s for one in settings]
    assert low == pytest.approx([6.0 * math.log(0.3 / z0) / math.log(6.096 / z0) for z0 in (0.1, 0.03, 0.005)])
    assert low == sorted(low)


def test_gusts_come_down_to_the_ground_with_the_wind_and_stay_above_the_reference_height() -> None:
    p = WindSettings(speed_20ft_m_s=6.0).parameters()
    gust = CALM._replace(along=-1.0, down1=0.5, roll=0.1)

    def share(height: float) -> list[float]:
        steady, whole = np.array(velocity(CALM, height, p)), np.array(velocity(gust, height, p))
        return list((whole - steady)[[0, 2, 3]] / np.array([1.0, 0.5, -0.1]))

    low = math.log(0.5 / 0.04572) / math.log(3.0 / 0.04572)
    assert share(0.5) == pytest.approx([low] * 3)
    assert share(3.0) == pytest.approx([1.0] * 3)
    assert share(10.0) == pytest.approx([1.0] * 3)
    assert share(0.04) == [0.0] * 3


@pytest.mark.parametrize(("direction", "north", "east"), [(0, -1, 0), (90, 0, -1), (225, 0.5**0.5, 0.5**0.5)])
def test_the_direction_is_where_it_blows_from(direction: float, north: float, east: float) -> None:
    p = WindSettings(speed_20ft_m_s=4.0, from_direction_deg=direction, gusts=False).parameters()
    np.testing.assert_allclose(velocity(CALM, 6.096, p), (4.0 * north, 4.0 * east, 0.0, 0.0, 0.0, 0.0), atol=1e-12)


def test_gusts_act_along_the_wind_to_its_right_and_down() -> None:
    p = WindSettings(speed_20ft_m_s=4.0, from_direction_deg=270.0).parameters()  # blows east, its right is south
    steady = np.array(velocity(CALM, 3.0, p)[:3])
    np.testing.assert_allclose(velocity(CALM._replace(along=1.0), 3.0, p)[:3] - steady, (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(velocity(CALM._replace(across1=1.0), 3.0, p)[:3] - steady, (-1, 0, 0), atol=1e-12)
    np.testing.assert_allclose(velocity(CALM._replace(across2=1.0), 3.0, p)[:3] - steady, (-SQRT3, 0, 0), atol=1e-12)
    np.testing.assert_allclose(velocity(CALM._replace(down1=1.0), 3.0, p)[:3] - steady, (0, 0, 1), atol=1e-12)


@pytest.mark.parametrize("direction", [0.0, 90.0, 200.0, -90.0])
def test_off_is_exactly_plus_zero(direction: float) -> None:
    p, draw = WindSettings(from_direction_deg=direction).parameters(), np.random.default_rng(11)
    state = start(normals(draw, 50), p)
    for height in (0.0, 0.5, 3.0, 100.0):
        state, wind = step(state, height, normals(draw, 50), p)
        for component in wind:
            assert np.all(component == 0.0)
            assert not np.any(np.signbit(component))


# -- gusts -----------------------------------------------------------------------------------------------
def gust_of(state: WindState, axis: str) -> np.ndarray:
    return {
        "along": state.along,
        "across": state.across1 + SQRT3 * state.across2,
        "down": state.down1 + SQRT3 * state.down2,
    }[axis]


@pytest.mark.parametrize("axis", ["along", "across", "down"])
def test_gusts_have_the_drydens_variance_and_correlation_length(axis: str) -> None:
    settings = WindSettings(speed_20ft_m_s=8.0)
    p, draw, count = settings.parameters(), np.random.default_rng(12), 20_000
    scales = dryden_scales(8.0, 3.0)
    carried = -velocity(CALM, 3.0, p).wind_n_m_s
    length = scales.length_down_m if axis == "down" else scales.length_along_m
    sigma = scales.sigma_down_m_s if axis == "down" else scales.sigma_along_m_s
    lag = round(0.5 * length / carried / PERIOD_S)  # half a scale length further on
    state = start(normals(draw, count), p)
    first = gust_of(state, axis)
    for _ in range(lag):
        state, _ = step(state, 3.0, normals(draw, count), p)
    later = gust_of(state, axis)
    x = lag * PERIOD_S * carried / length
    correlation = math.exp(-x) * (1.0 if axis == "along" else 1.0 - 0.5 * x)
    assert np.var(first) == pytest.approx(sigma**2, rel=4.0 * math.sqrt(2.0 / count))
    assert np.var(later) == pytest.approx(sigma**2, rel=4.0 * math.sqrt(2.0 / count))
    assert np.mean(first * later) == pytest.approx(
        correlation * sigma**2, abs=4.0 * sigma**2 * math.sqrt((1.0 + correlation**2) / count)
    )


@given(speed=st.floats(0.01, 30.0), height=st.floats(0.5, 300.0))
def test_the_sampled_filters_are_stationary_and_exact(speed: float, height: float) -> None:
    settings = WindSettings(speed_20ft_m_s=speed, reference_height_m=height)
    p = settings.parameters()
    assert p.along_decay**2 * p.along_sigma_m_s**2 + p.along_drive**2 == pytest.approx(p.along_sigma_m_s**2)
    scales = dryden_scales(speed, height)
    tau = scales.length_down_m / (speed * math.log(height / 0.04572) / math.log(20.0 / 0.15))
    f = np.array([[p.down_f11, p.down_f12], [p.down_f21, p.down_f22]])
    lower = np.array([[p.down_d11, 0.0], [p.down_d21, p.down_d22]])
    stationary = 0.25 * p.down_sigma_m_s**2 * np.eye(2)
    np.testing.assert_allclose(f @ stationary @ f.T + lower @ lower.T, stationary, atol=1e-13 * p.down_sigma_m_s**2)
    exact = scipy.linalg.expm(np.array([[0.0, 1.0], [-1.0, -2.0]]) * PERIOD_S / tau)
    np.testing.assert_allclose(f, exact, atol=1e-12)


def test_the_vertical_spectrum_is_the_drydens() -> None:
    p, draw = WindSettings(speed_20ft_m_s=8.0).parameters(), np.random.default_rng(13)
    series, samples = 400, 2048
    state = start(normals(draw, series), p)
    gusts = np.empty((samples, series))
    for k in range(samples):
        state, wind = step(state, 3.0, normals(draw, series), p)
        gusts[k] = wind.wind_d_m_s
    window = np.hanning(samples)[:, None]
    power = np.abs(np.fft.rfft(gusts * window, axis=0)) ** 2
    density = 2.0 * PERIOD_S * power.mean(axis=1) / np.sum(window**2)  # one-sided, (m/s)^2/Hz
    frequency = np.fft.rfftfreq(samples, PERIOD_S)
    tau = 3.0 / -velocity(CALM, 3.0, p).wind_n_m_s
    x = (2.0 * math.pi * frequency * tau) ** 2
    expected = 0.8**2 * 2.0 * tau * (1.0 + 3.0 * x) / (1.0 + x) ** 2
    band = (frequency > 0.1) & (frequency < 4.0)  # well below Nyquist, where sampling folds power back
    # a periodogram averaged over 400 series has a relative error of 5 %; 160 bins are compared
    np.testing.assert_allclose(density[band] / expected[band], 1.0, atol=0.25)
    assert np.mean(density[band] / expected[band]) == pytest.approx(1.0, abs=0.02)
    tail = (frequency > 2.0) & (frequency < 6.0)
    slope = np.polyfit(np.log(frequency[tail]), np.log(density[tail]), 1)[0]
    assert slope == pytest.approx(-2.0, abs=0.15)


def test_without_gusts_the_wind_is_steady() -> None:
    p, draw = WindSettings(speed_20ft_m_s=8.0, gusts=False).parameters(), np.random.default_rng(14)
    state = start(normals(draw, 20), p)
    for _ in range(3):
        state, wind = step(state, 2.0, normals(draw, 20), p)
        np.testing.assert_allclose(np.array(wind.wind_n_m_s), velocity(CALM, 2.0, p).wind_n_m_s, atol=1e-15)
        assert np.all(wind.wind_d_m_s == 0.0)


# -- gradients -------------------------------------------------------------------------------------------
def test_gradients_turn_about_the_wind_across_it_and_down() -> None:
    p = WindSettings(speed_20ft_m_s=4.0, from_direction_deg=270.0).parameters(2.0)  # blows east, its right is south
    turn = np.array(velocity(CALM._replace(roll=0.1), 3.0, p)[3:])
    np.testing.assert_allclose(turn, (0.0, 0.1, 0.0), atol=1e-15)
    rising = CALM._replace(down1=0.3, down_slow=0.1)  # w grows upstream of what has passed: it is greater there
    np.testing.assert_allclose(velocity(rising, 3.0, p)[3:], (-math.pi / 8.0 * 0.2, 0.0, 0.0), atol=1e-15)
    aside = CALM._replace(across1=0.3, across_slow=0.1)
    np.testing.assert_allclose(velocity(aside, 3.0, p)[3:], (0.0, 0.0, -math.pi / 6.0 * 0.2), atol=1e-15)


def test_the_gradients_have_the_specifications_spectra() -> None:
    """p by its own spectrum; q and r as derivatives of w and v, cut off where the vehicle averages over them."""
    span, speed = 1.78, 8.0
    p, draw = WindSettings(speed_20ft_m_s=speed, from_direction_deg=180.0).parameters(span), np.random.default_rng(15)
    series, samples = 300, 2048
    state = start(normals(draw, series), p)
    found = np.empty((3, samples, series))
    for k in range(samples):
        state, wind = step(state, 3.0, normals(draw, series), p)  # from the south: its axes are the earth's
        found[:, k] = wind.turn_n_rad_s, wind.turn_e_rad_s, wind.turn_d_rad_s
    window = np.hanning(samples)[:, None]
    power = np.abs(np.fft.rfft(found * window, axis=1)) ** 2
    density = 2.0 * PERIOD_S * power.mean(axis=2) / np.sum(window**2)  # one-sided, (rad/s)^2/Hz
    frequency = np.fft.rfftfreq(samples, PERIOD_S)
    carried, omega = velocity(CALM, 3.0, p).wind_n_m_s, 2.0 * math.pi * frequency
    scales = dryden_scales(speed, 3.0)
    low = 1.0 + (4.0 * span * omega / (math.pi * carried)) ** 2
    broad = (math.pi * 3.0 / (4.0 * span)) ** (1.0 / 3.0)
    rolled = scales.sigma_down_m_s**2 / (carried * 3.0) * 0.8 * broad / low * 2.0 * math.pi

    def dryden(sigma: float, length: float) -> np.ndarray:
        x = (omega * length / carried) ** 2
        return sigma**2 * 2.0 * length / carried * (1.0 + 3.0 * x) / (1.0 + x) ** 2

    pitched = (omega / carried) ** 2 / low * dryden(scales.sigma_down_m_s, 3.0)
    narrow = 1.0 + (3.0 * span * omega / (math.pi * carried)) ** 2
    yawed = (omega / carried) ** 2 / narrow * dryden(scales.sigma_along_m_s, scales.length_along_m)
    band = (frequency > 0.1) & (frequency < 1.0)
    for measured, expected in zip(density, (rolled, pitched, yawed), strict=True):
        assert np.mean(measured[band] / expected[band]) == pytest.approx(1.0, abs=0.06)


def test_a_wider_vehicle_feels_less_of_the_gradients() -> None:
    sigma = [WindSettings(speed_20ft_m_s=4.0).parameters(span).roll_sigma_rad_s for span in (0.7, 1.78, 12.0)]
    assert sigma[0] > 1.5 * sigma[1] > 5.0 * sigma[2]


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"speed_20ft_m_s": -1.0}, "f: speed_20ft_m_s: Input should be greater than or equal to 0, got -1.0"),
        ({"reference_height_m": 0.1}, "f: reference_height_m: Input should be greater than or equal to 0.5, got 0.1"),
        ({"speed_kt": 5}, "f: speed_kt: unknown key; known here: from_direction_deg"),
    ],
)
def test_a_wrong_setting_is_one_line_with_its_key(entries: dict[str, float], message: str) -> None:
    with pytest.raises(InputError) as error:
        check(entries, WindSettings, "f")
    assert str(error.value).startswith(message)
