"""The IMU: bandwidth, noise of the published density, biases and range."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.sensors.inertial import ImuReading
from paper_imu import PERIOD_S, STANDARD_GRAVITY_M_S2, ImuNormals, ImuSettings, start_imu, step_imu

start, step = start_imu, step_imu
SILENT = ImuNormals(*(0.0,) * len(ImuNormals._fields))
HOVER = ImuReading(0.0, 0.0, 0.0, 0.0, 0.0, -STANDARD_GRAVITY_M_S2)


def test_table_4_densities_give_0_28_deg_s_and_8_2_mm_s2() -> None:
    p = ImuSettings().parameters()
    assert math.degrees(p.gyro_sigma_rad_s) == pytest.approx(0.28, abs=0.005)
    assert p.accel_sigma_m_s2 == pytest.approx(0.0082, abs=1e-4)


def readings(settings: ImuSettings, count: int, seed: int) -> np.ndarray:
    """(count, 6) readings of a hovering vehicle."""
    p, draw = settings.parameters(), np.random.default_rng(seed)
    normals = draw.standard_normal((count + 1, len(ImuNormals._fields)))
    state = start(HOVER, ImuNormals(*normals[0]), p)
    out = np.empty((count, 6))
    for k in range(count):
        state, out[k] = step(state, HOVER, ImuNormals(*normals[k + 1]), p)
    return out


def test_noise_has_its_size_and_the_filters_correlation() -> None:
    silent = {"gyro_bias_deg_s": 0, "gyro_walk_deg_s_rts": 0, "accel_bias_mg": 0, "accel_walk_mg_rts": 0}
    settings = ImuSettings.model_validate(silent | {"bandwidth_hz": 10.0})  # slow enough to be seen at 50 Hz
    p, count = settings.parameters(), 20_000
    noise = readings(settings, count, 9) - np.array(HOVER)
    sigma = np.repeat([p.gyro_sigma_rad_s, p.accel_sigma_m_s2], 3)
    np.testing.assert_allclose(noise.std(axis=0) / sigma, 1.0, atol=4.5 / math.sqrt(2.0 * count))
    lag_one = np.mean(noise[1:] * noise[:-1], axis=0) / sigma**2
    np.testing.assert_allclose(lag_one, math.exp(-2.0 * math.pi * 10.0 * PERIOD_S), atol=4.5 / math.sqrt(count))


def test_the_filter_answers_a_step_with_its_bandwidth() -> None:
    settings = ImuSettings(bandwidth_hz=2.0)
    p = settings.parameters()
    state = start(HOVER, SILENT, p)
    turning = HOVER._replace(gyro_x_rad_s=1.0)
    for k in range(1, 30):
        state, reading = step(state, turning, SILENT, p)
        assert reading.gyro_x_rad_s == pytest.approx(1.0 - math.exp(-2.0 * math.pi * 2.0 * k * PERIOD_S), rel=1e-12)
        assert reading.accel_z_m_s2 == pytest.approx(-STANDARD_GRAVITY_M_S2, rel=1e-14)


def test_a_steady_truth_is_read_from_the_start() -> None:
    p = ImuSettings().parameters()
    state = start(HOVER, SILENT, p)
    for _ in range(100):
        state, reading = step(state, HOVER, SILENT, p)
    np.testing.assert_allclose(reading, HOVER, rtol=1e-12)


def test_biases_start_with_their_size_and_walk_with_the_root_of_time() -> None:
    settings = ImuSettings(gyro_density_deg_s_rthz=0, gyro_bias_deg_s=0.5, gyro_walk_deg_s_rts=0.1)
    p, draw, flights, seconds = settings.parameters(), np.random.default_rng(10), 400, 2.0
    first, last = [], []
    for _ in range(flights):
        normals = draw.standard_normal((round(seconds / PERIOD_S) + 1, len(ImuNormals._fields)))
        state = start(HOVER, ImuNormals(*normals[0]), p)
        first.append(state.gyro_bias_y)
        for row in normals[1:]:
            state, reading = step(state, HOVER, ImuNormals(*row), p)
        last.append(reading.gyro_y_rad_s)
    tolerance = 4.0 / math.sqrt(2.0 * flights)
    assert np.std(first) == pytest.approx(math.radians(0.5), rel=tolerance)
    walked = np.std(np.array(last) - np.array(first))
    assert walked == pytest.approx(math.radians(0.1) * math.sqrt(seconds), rel=tolerance)


def test_readings_stop_at_the_range() -> None:
    p = ImuSettings().parameters()
    wild = ImuReading(9.0, -9.0, 0.0, 100.0, -100.0, 0.0)
    _, reading = step(start(wild, SILENT, p), wild, SILENT, p)
    rate, force = math.radians(300.0), 6.0 * STANDARD_GRAVITY_M_S2
    np.testing.assert_allclose(reading, (rate, -rate, 0.0, force, -force, 0.0))


@pytest.mark.parametrize("name", ImuNormals._fields)
def test_a_normal_moves_the_axis_that_bears_its_name_and_no_other(name: str) -> None:
    """At the start, and in a step from a settled state: so the axes are independent, each with noise of its own."""
    p = ImuSettings(bandwidth_hz=10.0, accel_walk_mg_rts=1.0, gyro_walk_deg_s_rts=0.1).parameters()
    one = SILENT._replace(**{name: 1.0})
    for at_start, in_step in ((one, SILENT), (SILENT, one)):
        _, reading = step(start(HOVER, at_start, p), HOVER, in_step, p)
        moved = [axis for axis, a, b in zip(ImuReading._fields, reading, HOVER, strict=True) if abs(a - b) > 1e-9]
        assert [axis.removesuffix("_rad_s").removesuffix("_m_s2") for axis in moved] == [name.replace("bias_", "")]


def test_a_bias_of_either_instrument_walks_by_its_own_step() -> None:
    p = ImuSettings(bandwidth_hz=10.0, accel_walk_mg_rts=1.0, gyro_walk_deg_s_rts=0.1).parameters()
    walking = SILENT._replace(**{name: 1.0 for name in ImuNormals._fields if "bias" in name})
    state, _ = step(start(HOVER, SILENT, p), HOVER, walking, p)
    gyro = math.radians(0.1) * math.sqrt(PERIOD_S)
    accel = 1e-3 * STANDARD_GRAVITY_M_S2 * math.sqrt(PERIOD_S)
    np.testing.assert_allclose(state[6:], (gyro,) * 3 + (accel,) * 3, rtol=1e-12)


def test_the_range_of_each_axis_is_its_own_instruments() -> None:
    p = ImuSettings().parameters()
    for k, axis in enumerate(ImuReading._fields):
        wild = HOVER._replace(**{axis: 1e3})
        _, reading = step(start(wild, SILENT, p), wild, SILENT, p)
        assert reading[k] == (p.gyro_range_rad_s if "gyro" in axis else p.accel_range_m_s2)
