"""The pendulum: equations 12 to 16, its motion, the excitations, the encoder."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ellipk

from flownav.core.errors import InputError
from flownav.lab.optics.projection import ground_point
from flownav.lab.rig.instruments import COUNTS_PER_REVOLUTION, SAMPLE_S, angle_and_rate, counts_of
from flownav.lab.rig.pendulum import (
    EXCITATIONS,
    GRAVITY_M_S2,
    LARGEST_ANGLE_RAD,
    STEP_S,
    half_sine,
    largest_speed,
    move,
    push_for,
    rod_length,
    sensor_place,
    sensor_pose,
    sensor_velocity,
    swing,
)

ANGLE = st.floats(-0.6, 0.6)


def swung(length_m: float, angle_rad: float, seconds: float, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """Angle and rate of a free swing after a push of one second from rest."""
    count = round(seconds / STEP_S)
    angle, rate = np.zeros(count), np.zeros(count)
    swing(half_sine(count, 0.0, 1.0, push_for(angle_rad, 1.0, length_m)), length_m, damping, angle, rate)
    return angle, rate


@given(ANGLE, st.floats(-3.0, 3.0), st.floats(0.2, 3.0), st.floats(0.2, 3.0))
def test_velocity_is_the_derivative_of_place(angle: float, rate: float, length: float, height: float) -> None:
    """Equations 14 and 15 against 12 and 13, by complex step."""
    x, z = sensor_place(angle + 1e-30j, length, height)  # type: ignore[arg-type]
    derivative = (x.imag * 1e30 * rate, z.imag * 1e30 * rate)  # type: ignore[attr-defined]
    assert sensor_velocity(angle, rate, length) == pytest.approx(derivative, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("height", [0.6, 0.8, 1.0, 1.5])
def test_equation_16_is_the_peak_speed_of_a_small_swing(height: float) -> None:
    length = 2.1 - height
    _, rate = swung(length, 0.03, 4.0, 0.0)
    assert length * np.abs(rate).max() == pytest.approx(largest_speed(0.03, 2.1, height), rel=2e-3)


def test_the_swing_keeps_its_energy_and_has_the_exact_period_of_a_large_pendulum() -> None:
    length = 1.5
    angle, rate = swung(length, 0.5, 30.0, 0.0)
    free = slice(round(1.0 / STEP_S) + 1, None)
    energy = 0.5 * (length * rate[free]) ** 2 - GRAVITY_M_S2 * length * np.cos(angle[free])
    assert np.ptp(energy) < 1e-9
    amplitude = np.abs(angle[free]).max()
    upward = np.flatnonzero((angle[:-1] < 0.0) & (angle[1:] >= 0.0))
    crossings = upward + angle[upward] / (angle[upward] - angle[upward + 1])
    crossings = crossings[crossings * STEP_S > 1.0]
    period = 4.0 * np.sqrt(length / GRAVITY_M_S2) * ellipk(np.sin(0.5 * amplitude) ** 2)
    assert np.diff(crossings).mean() * STEP_S == pytest.approx(period, rel=1e-6)


def test_damping_takes_the_amplitude_down_as_stated() -> None:
    angle, _ = swung(1.1, 0.08, 41.0, 0.04)
    late = [np.abs(angle[round(t / STEP_S) : round((t + 2.2) / STEP_S)]).max() for t in (5.0, 35.0)]
    assert late[1] / late[0] == pytest.approx(np.exp(-0.04 * 30.0), rel=0.03)


@given(ANGLE, st.booleans())
def test_the_camera_on_the_rod_looks_along_it(angle: float, along_x: bool) -> None:
    """Section 4.7: the pixel at angle alpha from the axis hits the ground at l sin(theta) + z tan(theta + alpha)."""
    length, height, alpha, focal = 1.5, 0.6, 0.04, 666.67
    pose = sensor_pose(angle, length, height, along_x, 0.0)
    pixel = focal * np.tan(alpha)
    x_m, y_m, _ = ground_point(pose, *((pixel, 0.0) if along_x else (0.0, pixel)), focal)
    z_m = height + length - length * np.cos(angle)
    assert x_m == pytest.approx(length * np.sin(angle) + z_m * np.tan(angle + alpha))
    assert y_m == pytest.approx(0.0, abs=1e-12)
    turn = np.array([pose[3:6], pose[6:9], pose[9:12]])
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)


# -- excitations ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", EXCITATIONS)
def test_every_excitation_starts_at_rest_and_moves_about_as_fast_as_the_swing(kind: str) -> None:
    motion = move(kind, 1.5, 0.09, 20.0, np.random.default_rng(1))
    resting = motion.time_s < 0.9
    assert not motion.rate_rad_s[resting].any()
    wanted = np.sqrt(GRAVITY_M_S2 / 1.5) * 0.09
    assert np.abs(motion.rate_rad_s).max() == pytest.approx(wanted, rel=0.15)
    assert np.abs(motion.angle_rad).max() < 1.1 * LARGEST_ANGLE_RAD


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_rate_is_the_derivative_of_angle(kind: str) -> None:
    motion = move(kind, 0.6, 0.09, 10.0, np.random.default_rng(1))
    slope = np.gradient(motion.angle_rad, motion.time_s)
    np.testing.assert_allclose(slope[1:-1], motion.rate_rad_s[1:-1], atol=0.01)


def test_a_chirp_fills_a_band_that_a_swing_leaves_empty() -> None:
    shares = {}
    for kind in ("swing", "chirp"):
        motion = move(kind, 1.5, 0.09, 30.0, np.random.default_rng(1))
        power = np.abs(np.fft.rfft(motion.rate_rad_s)) ** 2
        frequency = np.fft.rfftfreq(len(motion.rate_rad_s), STEP_S)
        shares[kind] = power[(frequency > 1.0) & (frequency < 4.0)].sum() / power.sum()
    assert shares["swing"] < 0.01
    assert shares["chirp"] > 0.5


def test_lengths_go_from_the_whole_rod_to_a_short_one_in_even_tones() -> None:
    lengths = [rod_length("lengths", 2.1, 0.6, run, 5) for run in range(1, 6)]
    assert lengths[0] == pytest.approx(1.5)
    assert lengths[-1] == pytest.approx(0.25)
    tones = np.sqrt(GRAVITY_M_S2 / np.array(lengths))
    np.testing.assert_allclose(np.diff(tones), np.diff(tones)[0], rtol=1e-9)
    assert rod_length("swing", 2.1, 0.6, 3, 5) == pytest.approx(1.5)


def test_an_unknown_excitation_is_refused() -> None:
    with pytest.raises(InputError, match="excitation"):
        move("wobble", 1.5, 0.09, 5.0, np.random.default_rng(1))


# -- encoder ----------------------------------------------------------------------------------------------------
@given(st.floats(-3.0, 3.0))
def test_a_count_is_a_forty_thousandth_of_a_turn(angle: float) -> None:
    assert COUNTS_PER_REVOLUTION == 40_000
    step = 2.0 * np.pi / COUNTS_PER_REVOLUTION
    count = int(counts_of(np.array([angle]))[0])
    assert count * step <= angle + 1e-12
    assert angle < (count + 1) * step + 1e-12


@pytest.mark.parametrize("frequency", [0.4, 4.0])
def test_the_rate_from_counts_is_right_within_two_milliradians_a_second_and_has_no_delay(frequency: float) -> None:
    t = np.arange(0.0, 10.0, SAMPLE_S)
    amplitude = 0.23 / (2.0 * np.pi * frequency)
    phase = 2.0 * np.pi * frequency * t
    angle, rate = angle_and_rate(counts_of(amplitude * np.sin(phase)))
    true_rate = 0.23 * np.cos(phase)
    inside = slice(50, -50)
    assert np.abs(angle - amplitude * np.sin(phase))[inside].max() < 2.0 * np.pi / COUNTS_PER_REVOLUTION
    assert (rate - true_rate)[inside].std() < 2e-3
    delay = np.sum((rate - true_rate)[inside] * np.sin(phase)[inside]) / np.sum(np.sin(phase)[inside] ** 2) / 0.23
    assert abs(delay) / (2.0 * np.pi * frequency) < 1e-4  # s
