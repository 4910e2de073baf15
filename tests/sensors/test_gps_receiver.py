"""The GPS receiver: antenna lever, errors and their correlation, smoothing, what it states, outages, its datasheet."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from flownav.core.errors import InputError
from flownav.core.parameter_files import check
from flownav.sensors.gps_receiver import (
    GpsReceiverNormals,
    GpsReceiverParameters,
    GpsReceiverReading,
    GpsReceiverStartNormals,
    GpsReceiverState,
    GpsReceiverTruth,
    GpsReceiverUnit,
    draw_gps_receiver,
    start_gps_receiver,
    step_gps_receiver,
)
from flownav.sensors.sheets import GpsReceiverSheet
from sensor_normals import draws, moved_by, silent

SHEET = GpsReceiverSheet.read()
PLAIN = GpsReceiverUnit(1.0, 1.0, 1.0, 1.0)
QUIET = silent(GpsReceiverNormals)
UPRIGHT = tuple(float(x) for x in np.eye(3).ravel())
STILL = silent(GpsReceiverTruth)
AXES = ("n", "e", "d")


def exact(**given: float) -> GpsReceiverParameters:
    """Without lever, steps and smoothing, unless given."""
    plain = dict.fromkeys(("lever_x_m", "lever_y_m", "lever_z_m", "position_quantum_m", "velocity_quantum_m_s"), 0.0)
    plain |= {"smoothing_keep": 0.0, "smoothing_before": 0.0, "smoothing_now": 1.0}
    return SHEET.parameters()._replace(**plain | given)


def start(p: GpsReceiverParameters, truth: GpsReceiverTruth = STILL) -> GpsReceiverState:
    return start_gps_receiver(truth, UPRIGHT, silent(GpsReceiverStartNormals), p)


def read(p: GpsReceiverParameters, n: GpsReceiverNormals = QUIET, unit: GpsReceiverUnit = PLAIN) -> GpsReceiverReading:
    return step_gps_receiver(start(p), unit, STILL, UPRIGHT, n, p)[1]


def test_without_errors_it_reads_the_antenna() -> None:
    lever, rates = np.array([-0.3, 0.2, -0.1]), np.array([0.4, -0.6, 0.9])
    p = exact(lever_x_m=lever[0], lever_y_m=lever[1], lever_z_m=lever[2])
    turn = Turn.from_euler("ZYX", [2.0, 0.3, -0.2])
    rotation = tuple(float(x) for x in turn.as_matrix().ravel())
    truth = GpsReceiverTruth(10.0, -20.0, -5.0, 1.0, 2.0, -0.5, *rates)
    state = start_gps_receiver(truth, rotation, silent(GpsReceiverStartNormals), p)
    _, reading = step_gps_receiver(state, PLAIN, truth, rotation, QUIET, p)
    np.testing.assert_allclose(reading[:3], np.array(truth[:3]) + turn.apply(lever), rtol=1e-12)
    np.testing.assert_allclose(reading[3:6], np.array(truth[3:6]) + turn.apply(np.cross(rates, lever)), rtol=1e-12)
    assert reading[-2:] == (255.0, 1.0)


def test_each_normal_moves_its_own_axis_alone() -> None:
    p = exact()
    for name, fields in moved_by(GpsReceiverNormals, lambda n: read(p, n)).items():
        kind, _, axis = name.rpartition("_")
        expected = {
            "slow": f"pos_{axis}_m", "fast": f"pos_{axis}_m", "white": f"pos_{axis}_m",
            "velocity": f"vel_{axis}_m_s", "velocity_white": f"vel_{axis}_m_s",
        }  # fmt: skip
        assert fields == ({expected[kind]} if name != "outage" else set())
    for name, fields in moved_by(
        GpsReceiverStartNormals, lambda n: start_gps_receiver(STILL, UPRIGHT, n, p)
    ).items():  # fmt: skip
        unit = "m_s" if name.startswith("velocity") else "m"
        assert fields == (set() if name == "spare" else {f"{name}_{unit}"})


def test_each_error_has_its_own_size() -> None:
    p = exact()
    e, v = SHEET.position, SHEET.velocity
    slow, fast, velocity = (math.sqrt(-math.expm1(-2 * 0.2 / tau)) for tau in (e.slow_tau_s, e.fast_tau_s, v.tau_s))
    sizes = {
        "slow_e": ("pos_e_m", slow * e.slow_sigma_m), "slow_d": ("pos_d_m", slow * e.slow_sigma_down_m),
        "fast_e": ("pos_e_m", fast * e.fast_sigma_m), "fast_d": ("pos_d_m", fast * e.fast_sigma_down_m),
        "white_e": ("pos_e_m", e.white_sigma_m), "white_d": ("pos_d_m", e.white_sigma_down_m),
        "velocity_e": ("vel_e_m_s", velocity * v.sigma_m_s), "velocity_d": ("vel_d_m_s", velocity * v.sigma_down_m_s),
        "velocity_white_e": ("vel_e_m_s", v.white_m_s), "velocity_white_d": ("vel_d_m_s", v.white_down_m_s),
    }  # fmt: skip
    for name, (field, size) in sizes.items():
        assert getattr(read(p, silent(GpsReceiverNormals, **{name: 1.0})), field) == pytest.approx(size, rel=1e-9)


def test_processes_start_stationary() -> None:
    p = exact()
    e, v = SHEET.position, SHEET.velocity
    started = start_gps_receiver(STILL, UPRIGHT, GpsReceiverStartNormals(*(1.0,) * 10), p)
    expected = [e.slow_sigma_m] * 2 + [e.slow_sigma_down_m] + [e.fast_sigma_m] * 2 + [e.fast_sigma_down_m]
    expected += [v.sigma_m_s] * 2 + [v.sigma_down_m_s]
    np.testing.assert_allclose(started[:9], expected)


def test_errors_have_their_spread_and_correlation_at_the_receivers_own_period() -> None:
    silent_ones = dict.fromkeys(("fast_sigma_m", "fast_sigma_down_m", "white_sigma_m", "white_sigma_down_m"), 0.0)
    position = SHEET.position.model_dump() | silent_ones | {"slow_tau_s": 2.0, "quantum_m": 0.0}
    unfiltered = {"tau_s": 1.0, "white_m_s": 0, "white_down_m_s": 0, "smoothing_tau_s": 0.0, "quantum_m_s": 0.0}
    changes = {"position": position, "velocity": SHEET.velocity.model_dump() | unfiltered, "antenna": {}}
    quick = check(SHEET.model_dump() | changes, GpsReceiverSheet, "quick")
    p, count = quick.parameters(), 20_000
    state, out = start(p), np.empty((count, 6))
    for k, n in enumerate(draws(GpsReceiverNormals, count, 4)):
        state, reading = step_gps_receiver(state, PLAIN, STILL, UPRIGHT, n, p)
        out[k] = reading[:6]
    sigma = [1.5, 1.5, 2.2, 0.05, 0.05, 0.08]
    np.testing.assert_allclose(out.std(axis=0) / sigma, 1.0, atol=0.08)
    together = np.corrcoef(out.T) - np.eye(6)
    assert np.abs(together).max() < 0.12
    lag = np.array([np.mean(out[5:, i] * out[:-5, i]) / out[:, i].var() for i in range(6)])
    np.testing.assert_allclose(lag, [math.exp(-0.5)] * 3 + [math.exp(-1.0)] * 3, atol=0.06)


def test_the_receivers_velocity_is_late_by_its_smoothing() -> None:
    p = exact(
        **dict(zip(("smoothing_keep", "smoothing_before", "smoothing_now"), SHEET.parameters()[19:22], strict=True))
    )
    state = start(p)
    for k in range(1, 40):
        truth = STILL._replace(vel_n_m_s=0.2 * k, vel_e_m_s=-0.1 * k, vel_d_m_s=0.05 * k)  # 1, -0.5, 0.25 m/s2
        state, reading = step_gps_receiver(state, PLAIN, truth, UPRIGHT, QUIET, p)
    late = np.array(reading[3:6]) - np.array(truth[3:6])
    np.testing.assert_allclose(late, [-0.1, 0.05, -0.025], rtol=1e-9)


def test_what_it_states_is_wrong_by_a_share() -> None:
    p = exact()
    plain = read(p)
    np.testing.assert_allclose(plain[6:9], [p.horizontal_sigma_m**2, p.vertical_sigma_m**2, p.speed_sigma_m_s**2])
    assert p.horizontal_sigma_m == pytest.approx(math.hypot(1.5, 0.75, 0.03))
    assert p.vertical_sigma_m == pytest.approx(math.hypot(2.2, 1.2, 0.05))
    assert p.speed_sigma_m_s == pytest.approx(math.hypot(0.05, 0.03))
    unit = draw_gps_receiver(GpsReceiverUnit(0.0, 1.0, -1.0, 2.0), p)
    np.testing.assert_allclose(unit, [1.0, 1.3, 1 / 1.3, 1.6])
    np.testing.assert_allclose(np.array(read(p, unit=unit)[6:9]) / plain[6:9], [1.3**2, 1.3**-2, 1.6**2])


def test_a_bad_day_is_a_factor_of_the_position_errors_alone() -> None:
    p, n = exact(), GpsReceiverNormals(*(0.7,) * 16)
    one, two = np.array(read(p, n)[:9]), np.array(read(p, n, PLAIN._replace(errors=2.0))[:9])
    np.testing.assert_allclose(two / one, [2.0] * 3 + [1.0] * 6)


def test_outages_fill_their_share() -> None:
    sheet = check(SHEET.model_dump() | {"outage": {"share": 0.2, "mean_s": 1.0}}, GpsReceiverSheet, "outages")
    p = sheet.parameters()
    state, arrived, quality = start(p), [], []
    for n in draws(GpsReceiverNormals, 20_000, 5):
        state, reading = step_gps_receiver(state, PLAIN, STILL, UPRIGHT, n, p)
        arrived.append(reading.arrived)
        quality.append(reading.quality)
    assert np.mean(arrived) == pytest.approx(0.8, abs=0.03)
    ends = np.count_nonzero(np.diff(arrived) > 0)
    assert (len(arrived) - sum(arrived)) / ends * sheet.period_s == pytest.approx(1.0, rel=0.1)
    assert np.array_equal(np.array(quality), 255.0 * np.array(arrived))


def test_readings_come_in_whole_steps() -> None:
    p = SHEET.parameters()
    reading = step_gps_receiver(start(p), PLAIN, STILL, UPRIGHT, GpsReceiverNormals(*(0.7,) * 16), p)[1]
    steps = np.array(reading[:6]) / ([0.01] * 3 + [0.001] * 3)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert np.all(steps != 0.0)


def test_the_shipped_receiver_is_the_2_m_of_its_class() -> None:
    assert 1.1774 * SHEET.horizontal_sigma_m == pytest.approx(2.0, abs=0.05)
    assert SHEET.latency_s + SHEET.velocity.smoothing_tau_s == pytest.approx(0.22)


def test_what_the_datasheet_refuses() -> None:
    for changes, message in (
        ({"rate_hz": 100}, "rate_hz: Input should be less than or equal to 50"),
        ({"jitter_s": 0.3}, "jitter_s: at most latency_s = 0.12 is needed"),
        ({"outage": {"share": 0.7}}, "outage.share: Input should be less than or equal to 0.5"),
        ({"antenna": {"up_m": 0.1}}, "antenna.up_m: unknown key; known here: down_m, forward_m, right_m"),
        ({"schema_version": 2}, "schema_version: Input should be 1"),
    ):
        with pytest.raises(InputError, match=f"^gps.toml: {message}"):
            check(SHEET.model_dump() | changes, GpsReceiverSheet, "gps.toml")
