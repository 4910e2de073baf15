"""A recorded path flown again: it follows the log, and its attitude, rates and forces belong together."""

from __future__ import annotations

from dataclasses import replace as with_fields

import numpy as np
import pytest
from helpers.replay_logs import log_of_flight
from scipy.spatial.transform import Rotation

from flownav.core.errors import InputError
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import Sensor, Stream
from flownav.logs.csv_folder import read_csv_folder
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.studies.validation.drawn import load_flights
from flownav.studies.validation.path import Lean, lean_of, path_of, upright

VEHICLE = load_flights().vehicle


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return log_of_flight(60.0)


@pytest.fixture(scope="module")
def flown(made, tmp_path_factory):
    log = read_csv_folder(made.write(tmp_path_factory.mktemp("path") / "made"))
    return replay(log, ReplayOptions(), NavigatorSettingsFile(), smoothed=True)


@pytest.fixture(scope="module")
def path(flown):
    return path_of(flown, VEHICLE)


def test_it_follows_the_made_path(path, made):
    t_s = np.arange(10.0, 55.0, 0.5)
    truth = np.column_stack([np.interp(t_s, made.t_s, column) for column in made.position.T])
    moved = np.column_stack([np.interp(t_s, made.t_s, column) for column in made.velocity.T])
    off = path.position_m(t_s)[:, :2] - truth[:, :2]
    assert np.abs(off - off.mean(axis=0)).max() < 0.15
    assert np.abs(path.velocity_m_s(t_s) - moved).max() < 0.1


def test_it_leans_as_the_vehicle_did(path, flown):
    t_s = np.arange(10.0, 55.0, 0.5)
    logged = flown.log.streams[Sensor.ATTITUDE]
    nearest = np.searchsorted(logged.t_s, t_s)
    attitude = Rotation.from_quat(logged.value[nearest][:, [1, 2, 3, 0]])
    assert np.degrees((attitude.inv() * path.attitude(t_s)).magnitude()).max() < 1.5


def test_rates_and_forces_lead_along_the_path(path):
    """Strapdown integration of what the IMU would read, from the start's velocity, gives the path's own velocity."""
    step_s = 0.01
    t_s = np.arange(12.0, 32.0, step_s)
    rates, forces = path.turn_rad_s(t_s[1:], step_s), path.force_m_s2(t_s[1:], step_s)
    attitude, velocity = path.attitude(t_s[:1])[0], path.velocity_m_s(t_s[:1])[0]
    for rate, force in zip(rates, forces, strict=True):
        middle = attitude * Rotation.from_rotvec(0.5 * step_s * rate)
        velocity = velocity + step_s * (middle.apply(force) + np.array([0.0, 0.0, GRAVITY_M_S2]))
        attitude = attitude * Rotation.from_rotvec(step_s * rate)
    assert velocity == pytest.approx(path.velocity_m_s(t_s[-1:])[0], abs=2e-3)


def test_thrust_is_along_body_z_and_the_heading_is_kept():
    force = np.array([[0.0, 0.0, -9.8], [2.0, -1.0, -9.5]])
    attitude = upright(force, np.array([0.3, -2.0]))
    assert attitude.inv().apply(force)[:, :2] == pytest.approx(np.zeros((2, 2)), abs=1e-12)
    ahead = attitude.apply([1.0, 0.0, 0.0])
    assert np.arctan2(ahead[:, 1], ahead[:, 0]) == pytest.approx([0.3, -2.0], abs=1e-12)


def test_rotor_drag_and_wind_are_read_off_the_accelerometer(flown):
    drag, wind = 0.3, np.array([2.0, -1.0, 0.0])
    imu, rows = flown.log.streams[Sensor.IMU], flown.smoothed
    nearest = np.clip(np.searchsorted(rows[:, 0], imu.t_s), 0, len(rows) - 1)
    attitude = Rotation.from_quat(rows[nearest][:, [8, 9, 10, 7]])
    felt = imu.value.copy()
    felt[:, 3:5] = (-drag * attitude.inv().apply(rows[nearest, 17:20] - wind))[:, :2] + np.array([0.05, -0.02])
    dragged = with_fields(flown.log, streams=flown.log.streams | {Sensor.IMU: Stream.of(Sensor.IMU, imu.t_s, felt)})
    found = lean_of(dragged, rows)
    assert found.drag_1_s == pytest.approx(drag, abs=0.02)
    assert (found.wind_n_m_s, found.wind_e_m_s) == pytest.approx((2.0, -1.0), abs=0.15)
    still = with_fields(flown.log, streams={Sensor.GPS_POSITION: flown.log.streams[Sensor.GPS_POSITION]})
    assert lean_of(still, rows) == Lean(0.0, 0.0, 0.0)


def test_a_standing_vehicle_does_not_lean_on_the_wind(path):
    windy = path._replace(lean=Lean(0.3, 5.0, 0.0))
    lifted = windy._lifted(np.array([1.0, 30.0]))
    assert lifted == pytest.approx([0.0, 1.0], abs=1e-3)


def test_a_log_of_seconds_is_refused(flown):
    short = with_fields(flown, smoothed=flown.smoothed[:200])
    with pytest.raises(InputError, match="too short; 30 s"):
        path_of(short, VEHICLE)
