"""Notches: what is steady and what is noise passes, a tone does not, and its frequency and the noise are found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.navigation.kernel_settings import NO_HEADING, Equipment, ImuSettings
from flownav.navigation.motion_records import ToneMemory
from flownav.navigation.notch import tracked_tones
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.settings_of import of_inertial
from flownav.sensors.sheets import InertialSheet
from navigation_streams import Flown, circle, fly, navigate

ROTOR_HZ, BLADES_HZ, PERIOD_S = 24.0, 48.0, 0.01
TOLD = NavigatorSettingsFile().settings(Equipment(True, False, NO_HEADING, False, -np.inf))


def told(rotor_hz: float = ROTOR_HZ, blades_hz: float = BLADES_HZ) -> ImuSettings:
    return TOLD.imu._replace(notch_rotor_hz=rotor_hz, notch_blades_hz=blades_hz)


def shaken(t_s: np.ndarray, faster: float = 0.0) -> np.ndarray:
    """Specific force of a rotor out of balance, seen in quadrature, and of its blades, (n, 3)."""
    rotor, blades = (2.0 * np.pi * hz * (1.0 + faster) * t_s for hz in (ROTOR_HZ, BLADES_HZ))
    return np.column_stack(
        [
            1.5 * np.cos(rotor) + 0.5 * np.cos(blades + 1.0),
            1.5 * np.sin(rotor) + 0.5 * np.sin(blades + 1.0),
            0.5 * np.cos(rotor) + 1.0 * np.cos(blades + 1.0),
        ]
    )


def passed(force: np.ndarray, s: ImuSettings, start: ToneMemory | None = None) -> tuple[np.ndarray, ToneMemory]:
    """Readings (n, 3) at PERIOD_S less their tones, and the memory after the last."""
    m, left = start or ToneMemory(), [(0.0, 0.0, 0.0)]
    for x, y, z in force:
        m = tracked_tones((x, y, z), left[-1], m, PERIOD_S, s)
        left.append((x - m.taken_x, y - m.taken_y, z - m.taken_z))
    return np.array(left[1:]), m


INSTANTS_S = np.arange(1000) * PERIOD_S
HOVER = np.array([0.3, -1.0, -9.8])


@pytest.mark.parametrize("faster", [-0.03, 0.0, 0.01, 0.03])
def test_a_tone_is_followed_and_taken_off_whatever_the_rotors_speed(faster: float):
    left, m = passed(HOVER + shaken(INSTANTS_S, faster), told())
    assert np.abs(left[-200:] - HOVER).max() < 0.05
    assert m.rotor_off_hz == pytest.approx(ROTOR_HZ * faster, abs=0.02)
    assert m.blades_off_hz == pytest.approx(BLADES_HZ * faster, abs=0.1)


def test_what_is_steady_passes_whole_and_a_jolt_comes_back():
    """The velocity that a jolt gives is what it was, after a few turns of the rotor."""
    jolt = np.tile(HOVER, (1000, 1))
    jolt[500] += [0.0, 0.0, 50.0]
    left, _ = passed(jolt, told())
    assert left[499] == pytest.approx(HOVER, abs=1e-6)
    assert (left[500:] - HOVER).sum(axis=0) == pytest.approx([0.0, 0.0, 50.0], abs=0.5)
    assert left[500, 2] - HOVER[2] > 30.0  # most of it at once


def test_a_vehicle_without_tones_is_left_alone_to_the_bit():
    force = HOVER + np.random.default_rng(1).normal(size=(100, 3)) + shaken(INSTANTS_S[:100])
    left, m = passed(force, told(0.0, 0.0))
    assert np.array_equal(left, force)
    assert (m.taken_x, m.taken_y, m.taken_z, m.rotor_off_hz, m.blades_off_hz) == (0.0,) * 5


@pytest.mark.parametrize("sigma", [0.02, 0.2])
def test_the_noise_beside_the_tones_is_found_and_motion_is_none(sigma: float):
    """White noise of variance sigma^2 at a period T has the density sigma sqrt(T); a sway of 1 m/s2 adds none."""
    rng = np.random.default_rng(7)
    sway = np.outer(np.sin(2.0 * np.pi * INSTANTS_S), [1.0, 1.0, 0.0])
    _, m = passed(HOVER + sway + shaken(INSTANTS_S) + rng.normal(0.0, sigma, (1000, 3)), told())
    assert np.sqrt(m.noise_power) == pytest.approx(sigma * np.sqrt(PERIOD_S), rel=0.25)


def test_two_tones_at_once_pull_neither_frequency():
    """In a cascade the blades' tone beats with the rotor's notch, 0.1 Hz off."""
    _, m = passed(HOVER + shaken(INSTANTS_S), told())
    assert m.rotor_off_hz == pytest.approx(0.0, abs=0.005)


def test_a_turned_vehicle_hears_the_turned_tones():
    """A quarter turn about the vertical: x to y, y to -x."""

    def turned(force: np.ndarray) -> np.ndarray:
        return np.column_stack([-force[:, 1], force[:, 0], force[:, 2]])

    force = HOVER + shaken(INSTANTS_S[:300], 0.01)
    left, m = passed(force, told())
    left_turned, m_turned = passed(turned(force), told())
    assert left_turned == pytest.approx(turned(left), abs=1e-12)
    assert m_turned.rotor_off_hz == pytest.approx(m.rotor_off_hz, abs=1e-12)


def rms_velocity(flown: Flown, after_s: float, **keys: Any) -> float:
    result = navigate(flown, **keys)
    return float(np.sqrt(np.mean(result.velocity_error[result.t_s > after_s] ** 2)))


def shaken_flight(every: int = 1, times: float = 1.0) -> Flown:
    """Laps in a vehicle that shakes `times` times as much; of its inertial readings (100 Hz) every such one arrives."""
    flown = fly(circle, 20.0)
    imu = flown.streams[Sensor.IMU]
    value, kept = imu.value.copy(), slice(None, None, every)
    value[:, 3:6] += times * shaken(imu.t_s, 0.01)
    names = ("t_s", "variance", "quality")
    return flown.changed(Sensor.IMU, value=value[kept], **{name: getattr(imu, name)[kept] for name in names})


def test_a_navigator_that_is_told_the_rotor_flies_as_if_it_did_not_shake():
    shaky = shaken_flight(times=4.0)
    calm, untold = rms_velocity(fly(circle, 20.0), 10.0), rms_velocity(shaky, 10.0)
    freed = rms_velocity(shaky, 10.0, notch_rotor_hz=ROTOR_HZ, notch_blades_hz=BLADES_HZ)
    assert untold > 2.0 * calm
    assert freed < calm + 0.25 * (untold - calm)


@pytest.mark.parametrize("every", [1, 2, 3, 4])
def test_fewer_readings_than_the_sheets_rate_are_no_worse_off_with_the_notches(every: int):
    """50 readings a second, as a serial line carries, show the blades at 2 Hz: a notch there takes the vehicle's own
    motion, and gravity near it (2 m/s of vertical velocity).
    """
    flown = shaken_flight(every)
    told = rms_velocity(flown, 5.0, notch_rotor_hz=ROTOR_HZ, notch_blades_hz=BLADES_HZ)
    assert told < 1.1 * rms_velocity(flown, 5.0)


@pytest.mark.parametrize("period_s", [0.01, 0.02, 0.03, 0.04])
@pytest.mark.parametrize("tone_hz", np.arange(10.0, 210.0, 10.0))
def test_gravity_passes_whatever_the_tone_and_the_rate(tone_hz: float, period_s: float):
    m, left = ToneMemory(), (0.0, 0.0, 0.0)
    for _ in range(300):
        m = tracked_tones((0.3, -1.0, -9.8), left, m, period_s, told(tone_hz, 2.0 * tone_hz))
        left = (0.3 - m.taken_x, -1.0 - m.taken_y, -9.8 - m.taken_z)
    assert left == pytest.approx((0.3, -1.0, -9.8), abs=1e-6)


def test_a_tone_that_was_heard_fades_where_the_readings_become_fewer():
    _, m = passed(HOVER + shaken(INSTANTS_S), told())
    left = (0.3, -1.0, -9.8)
    for _ in range(500):
        m = tracked_tones((0.3, -1.0, -9.8), left, m, 0.02, told())
        left = (0.3 - m.taken_x, -1.0 - m.taken_y, -9.8 - m.taken_z)
    assert left == pytest.approx((0.3, -1.0, -9.8), abs=1e-3)


def test_the_sheets_rotor_is_told_at_the_frequency_at_which_it_is_read():
    sheet = InertialSheet.read()
    keys = of_inertial(sheet, (24.0, 48.0))
    assert (keys["notch_rotor_hz"], keys["notch_blades_hz"]) == (24.0, 48.0)
    assert of_inertial(sheet, (90.0, 180.0))["notch_rotor_hz"] == pytest.approx(10.0)  # at 100 Hz
    assert "notch_rotor_hz" not in of_inertial(sheet, (97.0, 194.0))  # read at 3 Hz it is the vehicle's own motion
    assert "notch_rotor_hz" not in of_inertial(sheet)
