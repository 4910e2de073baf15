"""The barometer: drift, ramp, wash of the rotor near the ground, lag, noise, its datasheet."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.parameter_files import check
from flownav.sensors.barometer import (
    BarometerNormals,
    BarometerSheet,
    BarometerStartNormals,
    BarometerTruth,
    BarometerUnit,
    draw_barometer,
    start_barometer,
    step_barometer,
    wash_error,
)
from sensor_normals import draws, moved_by, silent

SHEET = BarometerSheet.read()
RADIUS_M, DENSITY = 0.89, 1.225
P = SHEET.parameters(RADIUS_M, DENSITY)
PLAIN = BarometerUnit(0.0, 0.0, 1.0, 1.0)
QUIET, SETTLED = silent(BarometerNormals), silent(BarometerStartNormals)
GLIDING = BarometerTruth(10.0, 10.0, 0.0)


def test_without_errors_it_reads_the_altitude() -> None:
    state = start_barometer(GLIDING, PLAIN, SETTLED, P)
    _, reading = step_barometer(state, PLAIN, GLIDING, QUIET, P)
    assert reading == pytest.approx((10.0, 255.0, 1.0))


def test_thrust_raises_the_pressure_and_the_ground_more_so() -> None:
    weight_n = 77.5
    loading_m = weight_n / (math.pi * RADIUS_M**2) / (DENSITY * GRAVITY_M_S2)  # disk loading as altitude
    high, low = (wash_error(BarometerTruth(0.0, height, weight_n), PLAIN, P) for height in (50.0, 0.0))
    assert high == pytest.approx(-0.15 * loading_m, rel=2e-3)
    assert low == pytest.approx(-0.55 * loading_m)
    at_radius = wash_error(BarometerTruth(0.0, RADIUS_M, weight_n), PLAIN, P)
    assert at_radius == pytest.approx(-(0.15 + 0.20) * loading_m)
    assert wash_error(BarometerTruth(0.0, RADIUS_M, 2.0 * weight_n), PLAIN, P) == pytest.approx(2.0 * at_radius)
    assert wash_error(BarometerTruth(0.0, -0.5, weight_n), PLAIN, P) == low
    twice = PLAIN._replace(wash=2.0, ground=3.0)
    assert wash_error(BarometerTruth(0.0, RADIUS_M, weight_n), twice, P) == pytest.approx(-(0.30 + 0.60) * loading_m)


def test_a_climb_is_late_by_the_lag() -> None:
    p = P._replace(resolution_m=0.0)
    state = start_barometer(silent(BarometerTruth), PLAIN, SETTLED, p)
    for k in range(1, 60):
        truth = BarometerTruth(0.05 * k, 50.0, 0.0)  # 1 m/s at 20 Hz
        state, reading = step_barometer(state, PLAIN, truth, QUIET, p)
    assert reading.alt_m - truth.altitude_m == pytest.approx(-SHEET.lag_s, rel=1e-6)


def test_drift_is_gauss_markov_and_noise_is_white() -> None:
    sheet = check(SHEET.model_dump() | {"drift_tau_s": 1.0, "lag_s": 0, "resolution_m": 0}, BarometerSheet, "b")
    p, count = sheet.parameters(RADIUS_M, DENSITY), 30_000
    state, out = start_barometer(GLIDING, PLAIN, SETTLED, p), np.empty(count)
    for k, n in enumerate(draws(BarometerNormals, count, 16)):
        state, reading = step_barometer(state, PLAIN, GLIDING, n, p)
        out[k] = reading.alt_m - 10.0
    drift, noise = 0.5**2, 0.1**2
    assert out.var() == pytest.approx(drift + noise, rel=0.1)
    for lag in (1, 20):
        expected = drift * math.exp(-lag * 0.05)
        assert np.mean(out[lag:] * out[:-lag]) == pytest.approx(expected, abs=0.02)


def test_each_normal_moves_its_own_output_alone() -> None:
    state = start_barometer(GLIDING, PLAIN, SETTLED, P)
    after = moved_by(BarometerNormals, lambda n: step_barometer(state, PLAIN, GLIDING, n, P)[0])
    assert after == {"drift": {"drift_m", "before_m", "lagged_m"}, "noise": set()}
    for name, fields in moved_by(BarometerUnit, lambda n: draw_barometer(n, P)).items():
        assert fields == {name}
    started = moved_by(BarometerStartNormals, lambda n: start_barometer(GLIDING, PLAIN, n, P))
    assert started == {"drift": {"drift_m", "before_m", "lagged_m"}, "spare": set()}
    assert start_barometer(GLIDING, PLAIN, BarometerStartNormals(1.0, 0.0), P).drift_m == pytest.approx(0.5)


def test_units_differ_by_the_sheets_figures() -> None:
    assert draw_barometer(BarometerUnit(1.0, 1.0, 1.0, -1.0), P) == pytest.approx((0.3, 6.0 / 3600 / 20, 1.4, 1 / 1.4))


def test_a_ramp_makes_its_metres_an_hour() -> None:
    unit = PLAIN._replace(offset_m=0.2, ramp_step_m=6.0 / 3600 / 20)
    state = start_barometer(GLIDING, unit, SETTLED, P)
    assert state.lagged_m == pytest.approx(10.2)
    for _ in range(20 * 60):
        state, reading = step_barometer(state, unit, GLIDING, QUIET, P)
    assert reading.alt_m == pytest.approx(10.3, abs=0.01)


def test_what_the_datasheet_refuses() -> None:
    for changes, message in (
        ({"lag_s": -1}, "lag_s: Input should be greater than or equal to 0"),
        ({"wash_share": 3}, "wash_share: Input should be less than or equal to 2"),
        ({"jitter_s": 0.2}, "jitter_s: at most latency_s = 0.03 is needed"),
    ):
        with pytest.raises(InputError, match=f"^baro.toml: {message}"):
            check(SHEET.model_dump() | changes, BarometerSheet, "baro.toml")
