"""The IMU: noise by Allan deviation, walk, errors of a unit, vibration that aliases, clipping, its datasheet."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.parameter_files import check
from flownav.sensors.inertial import (
    ImuReading,
    InertialNormals,
    InertialParameters,
    InertialStartNormals,
    InertialState,
    InertialUnit,
    draw_inertial,
    start_inertial,
    step_inertial,
)
from flownav.sensors.sheets import InertialSheet
from sensor_normals import draws, moved_by, silent

HOVER = ImuReading(0.0, 0.0, 0.0, 0.0, 0.0, -GRAVITY_M_S2)
PERFECT = silent(InertialUnit, vibration=1.0)
QUIET = silent(InertialNormals)
ROTOR_RAD_S, BLADES = 152.4, 2
SHEET = InertialSheet.read()


def parameters(sheet: InertialSheet = SHEET, **given: float) -> InertialParameters:
    """The sheet's, with some replaced; without vibration unless given."""
    p = sheet.parameters(ROTOR_RAD_S, BLADES)
    still = {name: 0.0 for name in p._fields if name.startswith(("rev_", "blade_")) and name.endswith("_s2")}
    still |= {name: 0.0 for name in p._fields if name.startswith(("rev_", "blade_")) and name.endswith("rad_s")}
    return p._replace(**still | given)


def settled(p: InertialParameters) -> InertialState:
    return start_inertial(silent(InertialStartNormals, rev_one=1.0, blade_one=1.0), p)


def series(p: InertialParameters, count: int, seed: int, truth: ImuReading = HOVER) -> np.ndarray:
    """(count, 6) errors of a perfect unit's readings."""
    state, out = settled(p), np.empty((count, 6))
    for k, n in enumerate(draws(InertialNormals, count, seed)):
        state, reading = step_inertial(state, PERFECT, truth, n, p)
        out[k] = reading[:6]
    return out - np.array(truth)


def test_a_perfect_unit_reads_the_truth() -> None:
    p, truth = parameters(), ImuReading(0.1, -0.2, 0.3, 1.0, 2.0, -9.0)
    _, reading = step_inertial(settled(p), PERFECT, truth, QUIET, p)
    assert reading == (*truth, 255.0, 1.0)


def test_noise_has_the_allan_deviation_of_its_density() -> None:
    p = parameters(gyro_walk_rad_s=0.0, accel_walk_m_s2=0.0)
    errors = series(p, 20_000, 1)
    density = np.repeat([math.radians(0.004), 100e-6 * GRAVITY_M_S2], 3)
    for readings in (1, 10, 100):
        means = errors.reshape(-1, readings, 6).mean(axis=1)
        allan = np.sqrt(0.5 * np.mean(np.diff(means, axis=0) ** 2, axis=0))
        seconds = readings * SHEET.period_s
        np.testing.assert_allclose(allan, density / math.sqrt(2.0 * seconds), rtol=5.0 / math.sqrt(len(means)))


def test_each_normal_moves_its_own_axis_alone() -> None:
    p = parameters()
    for name, fields in moved_by(InertialNormals, lambda n: step_inertial(settled(p), PERFECT, HOVER, n, p)[1]).items():
        quantity, axis = name.replace("_bias", "").split("_")
        assert fields == {f"{quantity}_{axis}_{'rad_s' if quantity == 'gyro' else 'm_s2'}"}
    for name, fields in moved_by(InertialNormals, lambda n: step_inertial(settled(p), PERFECT, HOVER, n, p)[0]).items():
        assert fields == ({name} if "bias" in name else set())


def test_biases_start_with_their_size_and_walk_with_the_root_of_time() -> None:
    p, count, steps = parameters(), 400, 100
    start = np.array([start_inertial(n, p)[:6] for n in draws(InertialStartNormals, count, 2)])
    sizes = np.repeat([math.radians(0.1), 5e-3 * GRAVITY_M_S2], 3)
    np.testing.assert_allclose(start.std(axis=0) / sizes, 1.0, atol=4.0 / math.sqrt(2.0 * count))
    walked = []
    for flight in range(150):
        state = settled(p)
        for n in draws(InertialNormals, steps, 100 + flight):
            state, _ = step_inertial(state, PERFECT, HOVER, n, p)
        walked.append(state[:6])
    root_s = math.sqrt(steps * SHEET.period_s)
    sizes = np.repeat([math.radians(0.002), 0.05e-3 * GRAVITY_M_S2], 3) * root_s
    np.testing.assert_allclose(np.std(walked, axis=0) / sizes, 1.0, atol=4.0 / math.sqrt(300.0))


def test_errors_of_a_unit_are_matrices_of_rate_and_force() -> None:
    p = parameters()
    unit = InertialUnit(*(1e-3 * (i + 1.0) for i in range(27)), 1.0, 0.0)
    truth = ImuReading(0.1, -0.2, 0.3, 1.0, 2.0, -9.0)
    _, reading = step_inertial(settled(p), unit, truth, QUIET, p)
    scale, force, stretch = (np.array(unit[9 * i : 9 * i + 9]).reshape(3, 3) for i in range(3))
    rate, specific = np.array(truth[:3]), np.array(truth[3:])
    np.testing.assert_allclose(reading[:3], rate + scale @ rate + force @ specific, rtol=1e-14)
    np.testing.assert_allclose(reading[3:6], specific + stretch @ specific, rtol=1e-14)


def test_units_are_drawn_with_the_sheets_sizes() -> None:
    p = parameters()
    unit = draw_inertial(InertialUnit(*(1.0,) * 29), p)
    diagonal = {"xx", "yy", "zz"}
    for name, value in unit._asdict().items():
        kind, _, place = name.partition("_")
        expected = {
            "gyro": 0.005 if place in diagonal else math.radians(0.3),
            "force": math.radians(0.02) / GRAVITY_M_S2,
            "accel": 0.003 if place in diagonal else math.radians(0.3),
            "vibration": 1.3,
            "faster": 0.01,
        }[kind]
        assert value == pytest.approx(expected), name
    for name, fields in moved_by(InertialUnit, lambda n: draw_inertial(n, p)).items():
        assert fields == {name}


def tones(p: InertialParameters, count: int) -> np.ndarray:
    state, out = settled(p), np.empty((count, 6))
    for k in range(count):
        state, reading = step_inertial(state, PERFECT, HOVER, QUIET, p)
        out[k] = reading[:6]
    return out - np.array(HOVER)


@pytest.mark.parametrize("tone", ["rev", "blade"])
def test_vibration_is_the_mean_of_the_tone_over_each_period(tone: str) -> None:
    whole = SHEET.parameters(ROTOR_RAD_S, BLADES)
    p = parameters(**{name: value for name, value in whole._asdict().items() if name.startswith(tone)})
    amplitudes = SHEET.vibration.rotor if tone == "rev" else SHEET.vibration.blades
    speed = ROTOR_RAD_S * (1 if tone == "rev" else BLADES)
    through = 1.0 / math.hypot(1.0, speed / (2 * math.pi) / SHEET.bandwidth_hz)
    middle = speed * SHEET.period_s * np.arange(1, 41)
    inside = speed * SHEET.period_s * (np.arange(2000) + 0.5 - 1000) / 2000
    cosine = np.cos(middle[:, None] + inside).mean(axis=1)
    sine = np.sin(middle[:, None] + inside).mean(axis=1)
    tilt, yaw = math.radians(amplitudes.tilt_deg_s), math.radians(amplitudes.yaw_deg_s)
    expected = through * np.column_stack(
        [tilt * cosine, tilt * sine, yaw * cosine,
         amplitudes.level_m_s2 * cosine, amplitudes.level_m_s2 * sine, amplitudes.vertical_m_s2 * cosine]
    )  # fmt: skip
    np.testing.assert_allclose(tones(p, 40), expected, atol=1e-6)


def test_a_tone_beyond_half_the_rate_appears_at_its_alias() -> None:
    speed = 2.0 * math.pi * 97.0 / 2  # blades at 97 Hz, sampled at 100
    p = SHEET.parameters(speed, 2)._replace(rev_vertical_m_s2=0.0)
    heave = tones(p, 1000)[:, 5]
    spectrum = np.abs(np.fft.rfft(heave)) / 500
    assert np.argmax(spectrum) == 30  # 3 Hz in 10 s
    mean = math.sin(math.pi * 0.97) / (math.pi * 0.97)
    assert spectrum[30] == pytest.approx(2.0 * abs(mean) / math.hypot(1.0, 97.0 / 98.0), rel=1e-6)


def test_a_rotor_that_turns_faster_shakes_at_its_own_frequency() -> None:
    """By 3 %: after 1000 periods the tone is where the exact turn of each period has brought it, as large as before."""
    p = SHEET.parameters(ROTOR_RAD_S, BLADES)
    state = settled(p)
    for _ in range(1000):
        state, _ = step_inertial(state, PERFECT._replace(faster=0.03), HOVER, QUIET, p)
    for cosine, sine, speed in (
        (state.rev_cosine, state.rev_sine, ROTOR_RAD_S), (state.blade_cosine, state.blade_sine, BLADES * ROTOR_RAD_S)
    ):  # fmt: skip
        turned = np.exp(1j * 1.03 * speed * SHEET.period_s * 1000)
        assert abs((cosine + 1j * sine) - turned) < 1e-4


def test_a_flights_vibration_is_its_factor_times_the_sheets() -> None:
    p = SHEET.parameters(ROTOR_RAD_S, BLADES)
    _, plain = step_inertial(settled(p), PERFECT, HOVER, QUIET, p)
    _, strong = step_inertial(settled(p), PERFECT._replace(vibration=1.7), HOVER, QUIET, p)
    ratio = (np.array(strong[:6]) - np.array(HOVER)) / (np.array(plain[:6]) - np.array(HOVER))
    np.testing.assert_allclose(ratio, 1.7, rtol=1e-9)


def test_phases_start_anywhere_and_stay_on_the_circle() -> None:
    p = SHEET.parameters(ROTOR_RAD_S, BLADES)
    starts = [start_inertial(n, p) for n in draws(InertialStartNormals, 4000, 3)]
    angles = np.arctan2([s.rev_sine for s in starts], [s.rev_cosine for s in starts])
    assert abs(np.exp(1j * angles).mean()) < 4.0 / math.sqrt(4000)
    assert abs(np.exp(2j * angles).mean()) < 4.0 / math.sqrt(4000)
    other = np.arctan2([s.blade_sine for s in starts], [s.blade_cosine for s in starts])
    assert abs(np.exp(1j * (angles - other)).mean()) < 4.0 / math.sqrt(4000)
    state = starts[0]
    for _ in range(20_000):
        state, _ = step_inertial(state, PERFECT, HOVER, QUIET, p)
    assert math.hypot(state.rev_cosine, state.rev_sine) == pytest.approx(1.0, abs=1e-11)
    assert math.hypot(state.blade_cosine, state.blade_sine) == pytest.approx(1.0, abs=1e-11)


def test_readings_stop_at_the_range_with_the_vibration_in_them() -> None:
    p = SHEET.parameters(ROTOR_RAD_S, BLADES)._replace(rev_level_m_s2=1e4)
    beyond = ImuReading(100.0, -100.0, 100.0, 0.0, 300.0, -300.0)
    readings = []
    state = settled(p)
    for _ in range(20):
        state, reading = step_inertial(state, PERFECT, beyond, QUIET, p)
        readings.append(reading[:6])
    rate, force = math.radians(2000.0), 16.0 * GRAVITY_M_S2
    np.testing.assert_allclose(np.max(readings, axis=0)[[0, 2, 3, 4]], [rate, rate, force, force])
    np.testing.assert_allclose(np.min(readings, axis=0)[[1, 3, 5]], [-rate, -force, -force])


def sheet_with(**changes: object) -> InertialSheet:
    return check(SHEET.model_dump() | changes, InertialSheet, "imu.toml")


def test_what_the_datasheet_refuses() -> None:
    for changes, message in (
        ({"rate_hz": 50}, "rate_hz: Input should be greater than or equal to 100"),
        ({"jitter_s": 0.01}, "jitter_s: at most latency_s = 0.005 is needed"),
        ({"bandwidth_hz": 0}, "bandwidth_hz: Input should be greater than 0"),
        ({"colour": "red"}, "colour: unknown key; known here: "),
        ({"gyro": {"density_deg_s_rthz": 0.004}}, "gyro.bias_deg_s: missing; add it"),
    ):
        with pytest.raises(InputError, match=f"^imu.toml: {message}"):
            sheet_with(**changes)


def test_noise_of_a_reading_grows_with_the_rate_and_the_walks_step_shrinks() -> None:
    fast, slow = (sheet_with(rate_hz=rate).parameters(ROTOR_RAD_S, BLADES) for rate in (400, 100))
    assert fast.gyro_sigma_rad_s == pytest.approx(2.0 * slow.gyro_sigma_rad_s)
    assert fast.accel_sigma_m_s2 == pytest.approx(2.0 * slow.accel_sigma_m_s2)
    assert fast.gyro_walk_rad_s == pytest.approx(0.5 * slow.gyro_walk_rad_s)
    assert fast.accel_walk_m_s2 == pytest.approx(0.5 * slow.accel_walk_m_s2)
