"""The GPS/INS: what its two models report, over many flights at once (arrays of flights through the equations)."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flownav.core.errors import InputError
from flownav.core.frames import euler_from_quaternion, quaternion_from_euler
from flownav.core.parameter_files import check
from flownav.sensors.gps_ins import (
    PERIOD_S,
    GpsInsNormals,
    NavSolution,
    attitude_with_error,
    start_gps_ins,
    step_gps_ins,
)
from flownav.sensors.settings import GpsInsSettings

FLIGHTS = 20_000
AT_PAD = NavSolution(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
SIGMA_PER_CEP = 1.0 / math.sqrt(2.0 * math.log(2.0))  # one axis of two equal normal ones: 1/1.1774
start, step = start_gps_ins, step_gps_ins


def horizontal_cep_m(settings: GpsInsSettings) -> float:
    """Circular error probable of the horizontal position."""
    return settings.position_sigma_m[0] / SIGMA_PER_CEP


def normals(draw: np.random.Generator, flights: int = FLIGHTS) -> GpsInsNormals:
    return GpsInsNormals(*draw.standard_normal((len(GpsInsNormals._fields), flights)))


def four_sigma_of_std(sigma: float, count: int = FLIGHTS) -> float:
    return 4.0 * sigma / math.sqrt(2.0 * count)


def test_two_metres_cep_is_1_699_metres_an_axis() -> None:
    assert pytest.approx(1.699, abs=5e-4) == 2.0 * SIGMA_PER_CEP


def test_the_midg_as_modelled_has_the_published_cep() -> None:
    assert horizontal_cep_m(GpsInsSettings()) == pytest.approx(2.0, rel=0.02)


def test_median_radius_over_many_flights_is_the_cep_from_the_first_reading_to_the_last() -> None:
    settings = GpsInsSettings()
    p, draw = settings.parameters(), np.random.default_rng(2)
    state = start(AT_PAD, normals(draw), p)
    for reading_number in range(60):
        state, reading = step(state, AT_PAD, normals(draw), p)
        if reading_number in (0, 59):
            radius = np.hypot(reading.pos_n_m, reading.pos_e_m)
            # the share of flights inside the CEP is binomial with p = 1/2
            inside = np.mean(radius < horizontal_cep_m(settings))
            assert inside == pytest.approx(0.5, abs=4.0 * 0.5 / math.sqrt(FLIGHTS))
            down = settings.position_sigma_m[2]
            assert np.std(reading.pos_d_m) == pytest.approx(down, abs=four_sigma_of_std(down))


def test_midg_position_error_is_smooth_while_white_error_is_not() -> None:
    draw = np.random.default_rng(3)
    changes = {}
    for model in ("white", "midg"):
        p = GpsInsSettings(model=model).parameters()
        state = start(AT_PAD, normals(draw), p)
        state, first = step(state, AT_PAD, normals(draw), p)
        state, second = step(state, AT_PAD, normals(draw), p)
        changes[model] = float(np.std(second.pos_n_m - first.pos_n_m))
    assert changes["white"] == pytest.approx(0.3 * math.sqrt(2.0), abs=four_sigma_of_std(0.3 * math.sqrt(2.0)))
    # expected: sigma sqrt(2 (1 - decay)) of the three processes and two roundings to 1 cm
    expected = math.sqrt(
        2.0 * 1.5**2 * -math.expm1(-0.02 / 300.0)
        + 2.0 * 0.75**2 * -math.expm1(-0.02 / 30.0)
        + 2.0 * 0.05**2 * -math.expm1(-0.02 / 0.3)
        + 2.0 * 0.01**2 / 12.0
    )
    assert changes["midg"] == pytest.approx(expected, rel=0.03)


def test_white_errors_are_independent_between_readings_and_spare_velocity_and_attitude() -> None:
    p, draw = GpsInsSettings(model="white", white_sigma_m=0.3).parameters(), np.random.default_rng(4)
    truth = NavSolution(1.0, -2.0, -3.0, 0.1, 0.2, -0.3, *quaternion_from_euler(0.1, -0.05, 2.0))
    state = start(truth, normals(draw), p)
    state, first = step(state, truth, normals(draw), p)
    state, second = step(state, truth, normals(draw), p)
    error, later = first.pos_e_m + 2.0, second.pos_e_m + 2.0
    assert np.std(error) == pytest.approx(0.3, abs=four_sigma_of_std(0.3))
    assert abs(np.mean(error * later)) < 4.0 * 0.3**2 / math.sqrt(FLIGHTS)
    assert np.all(second.vel_n_m_s == 0.1)
    assert np.all(second.vel_e_m_s == 0.2)
    assert np.all(second.vel_d_m_s == -0.3)
    np.testing.assert_allclose([q[0] for q in np.broadcast_arrays(*second[6:])], truth[6:], atol=1e-15)


def test_a_midg_reading_describes_the_vehicle_one_sample_earlier_and_a_white_one_now() -> None:
    silent = GpsInsNormals(*(0.0,) * len(GpsInsNormals._fields))
    for settings, age in ((GpsInsSettings(), 1), (GpsInsSettings(model="white"), 0), (GpsInsSettings(latency_s=0), 0)):
        assert settings.delay_s == age * PERIOD_S
        state = start(AT_PAD._replace(pos_n_m=100.0), silent, settings.parameters())
        for k in range(101, 110):
            truth = AT_PAD._replace(pos_n_m=float(k), vel_e_m_s=float(k))
            state, reading = step(state, truth, silent, settings.parameters())
            assert reading.pos_n_m == k - age
            assert reading.vel_e_m_s == (k - age if k > 101 or age == 0 else 0.0)


def test_midg_velocity_and_attitude_errors_have_their_size() -> None:
    settings = GpsInsSettings()
    p, draw = settings.parameters(), np.random.default_rng(5)
    state = start(AT_PAD, normals(draw), p)
    for _ in range(40):
        state, reading = step(state, AT_PAD, normals(draw), p)
    total = math.hypot(settings.velocity_sigma_total_m_s, 0.01 / math.sqrt(12.0))
    assert np.std(reading.vel_d_m_s) == pytest.approx(total, abs=four_sigma_of_std(total))
    w, x, y, z = reading.qw, reading.qx, reading.qy, reading.qz
    np.testing.assert_allclose(w**2 + x**2 + y**2 + z**2, 1.0, atol=1e-14)
    for angle, sigma_deg in ((2.0 * x, 0.4), (2.0 * y, 0.4), (2.0 * z, 1.5)):
        sigma = math.radians(sigma_deg)
        assert np.std(angle) == pytest.approx(sigma, abs=four_sigma_of_std(sigma) + 1e-3 * sigma)


@pytest.mark.parametrize("process", ["slow", "fast", "jitter", "velocity"])
def test_each_process_stays_at_its_own_size_on_each_axis(process: str) -> None:
    sizes = dict.fromkeys(
        ("slow_sigma_m", "slow_sigma_down_m", "fast_sigma_m", "fast_sigma_down_m", "jitter_sigma_m"), 0.0
    ) | {"velocity_sigma_m_s": 0.0, "velocity_white_m_s": 0.0}
    unit = "m_s" if process == "velocity" else "m"
    sizes[f"{process}_sigma_{unit}"] = 1.0
    down = 1.0
    if process in ("slow", "fast"):
        sizes[f"{process}_sigma_down_m"] = down = 2.0
    settings = GpsInsSettings.model_validate(sizes | {f"{process}_tau_s": 0.05})  # forgets its start in the test
    p, draw = settings.parameters(), np.random.default_rng(15)
    state = start(AT_PAD, normals(draw), p)
    for _ in range(20):
        state, reading = step(state, AT_PAD, normals(draw), p)
    axes = reading[3:6] if process == "velocity" else reading[:3]
    for axis, sigma in zip(axes, (1.0, 1.0, down), strict=True):
        assert np.std(axis) == pytest.approx(sigma, abs=four_sigma_of_std(sigma))


def test_midg_messages_come_in_whole_centimetres() -> None:
    p, draw = GpsInsSettings().parameters(), np.random.default_rng(6)
    state = start(AT_PAD, normals(draw, 100), p)
    _, reading = step(state, AT_PAD, normals(draw, 100), p)
    for value in reading[:6]:
        np.testing.assert_allclose(value * 100.0, np.rint(value * 100.0), atol=1e-9)


@given(
    roll=st.floats(-0.5, 0.5), pitch=st.floats(-0.5, 0.5), yaw=st.floats(-3.0, 3.0),
    errors=st.tuples(*[st.floats(-0.02, 0.02)] * 3),
)  # fmt: skip
def test_attitude_errors_are_small_rotations_about_body_x_y_and_earth_down(
    roll: float, pitch: float, yaw: float, errors: tuple[float, float, float]
) -> None:
    true = quaternion_from_euler(roll, pitch, yaw)
    got = attitude_with_error(true, *errors)

    def rotation(w: float, x: float, y: float, z: float) -> Rotation:
        return Rotation.from_quat([x, y, z, w])

    expected = (
        Rotation.from_rotvec([0, 0, errors[2]]) * rotation(*true) * Rotation.from_rotvec([errors[0], errors[1], 0])
    )
    assert (expected.inv() * rotation(*got)).magnitude() < 1e-5
    if roll == pitch == 0.0:  # level: the errors are those of the Euler angles
        euler = euler_from_quaternion(*got)
        np.testing.assert_allclose(euler, (errors[0], errors[1], yaw + errors[2]), atol=5e-4)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"slow_sigma_m": -1.0}, "here.toml: slow_sigma_m: Input should be greater than or equal to 0, got -1.0"),
        ({"white_sigma_m": 0.3}, 'here.toml: white_sigma_m: belongs to model = "white"'),
        ({"model": "white", "slow_tau_s": 1.0}, 'here.toml: slow_tau_s: belongs to model = "midg"'),
        ({"latency_s": 0.013}, "here.toml: latency_s: 0 or 0.02 (one reading at 50 Hz) is needed, got 0.013"),
        ({"sigma": 1.0}, "here.toml: sigma: unknown key; known here: fast_sigma_down_m"),
        ({"model": "perfect"}, "here.toml: model: Input should be 'white' or 'midg', got 'perfect'"),
    ],
)
def test_a_wrong_setting_is_one_line_with_its_key(entries: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as error:
        check(entries, GpsInsSettings, "here.toml")
    assert str(error.value).startswith(message)


SILENT = GpsInsNormals(*(0.0,) * len(GpsInsNormals._fields))
FINE = {"position_quantum_m": 0.0, "position_steps_per_m": 0.0, "velocity_quantum_m_s": 0.0,
        "velocity_steps_per_m_s": 0.0, "late": 0.0}  # fmt: skip
EVERYTHING = {"jitter_sigma_m": 0.3, "jitter_sigma_down_m": 0.4, "velocity_sigma_m_s": 0.2, "velocity_white_m_s": 0.1}


@pytest.mark.parametrize("name", GpsInsNormals._fields)
def test_a_normal_moves_the_axis_that_bears_its_name_and_no_other(name: str) -> None:
    """At the start, and in a step from a unit without error: so no two axes share their errors."""
    p = GpsInsSettings().parameters()._replace(**EVERYTHING, **FINE)
    one, truth = SILENT._replace(**{name: 1.0}), AT_PAD._replace(pos_n_m=3.0, vel_d_m_s=0.5)
    quiet = step(start(truth, SILENT, p), truth, SILENT, p)[1]
    kind, _, axis = name.partition("_")
    expected = [f"{'vel' if kind in ('velocity', 'white') else 'pos'}_{axis}"]
    if not axis:
        expected = [{"roll": "qx", "pitch": "qy", "heading": "qz"}[name]]
    for at_start, in_step in ((one, SILENT), (SILENT, one)):
        if kind == "white" and at_start is one:
            continue  # a white error of the start is forgotten by the next reading
        reading = step(start(truth, at_start, p), truth, in_step, p)[1]
        moved = [what for what, a, b in zip(NavSolution._fields, reading, quiet, strict=True) if abs(a - b) > 1e-6]
        assert [what.removesuffix("_m_s").removesuffix("_m") for what in moved if what != "qw"] == expected


def test_a_late_unit_holds_back_all_that_it_reports() -> None:
    p = GpsInsSettings().parameters()._replace(**FINE)._replace(late=1.0)
    flown = [NavSolution(*(i * k for i in range(1, 7)), *quaternion_from_euler(0.1 * k, -0.05 * k, 0.2 * k))
             for k in range(5)]  # fmt: skip
    state = start(flown[0], SILENT, p)
    for before, now in pairwise(flown):
        state, reading = step(state, now, SILENT, p)
        np.testing.assert_allclose(reading, before, atol=1e-12)
