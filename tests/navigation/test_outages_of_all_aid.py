"""Made logs in which nothing tells the velocity for a while: no texture, no GPS and no flow, a landing."""

from __future__ import annotations

import numpy as np
import pytest
from test_hard_flights import OWN, added_to, from_the_ground, noisy

from flownav.core.measurement import Sensor
from flownav.estimation.states import ACCEL_BIAS, INS_ERROR
from flownav.navigation.flow_noise import blindness, followed_quality
from flownav.navigation.windows import MOVES, RESTS
from navigation_streams import Flown, circle, fly, navigate

GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)


# -- ground without texture ------------------------------------------------------------------------------------
def without_texture(flown: Flown, usual: float, seen: float, t0_s: float, t1_s: float) -> Flown:
    """Flow that reads a fifth of what it should, with a poor quality, as of asphalt in the shade."""
    flow = flown.streams[Sensor.FLOW_RATE]
    poor = (flow.t_s >= t0_s) & (flow.t_s < t1_s)
    value = flow.value.copy()
    value[poor, :2] *= 0.2
    return flown.changed(Sensor.FLOW_RATE, value=value, quality=np.where(poor, seen, usual))


@pytest.mark.parametrize(("usual", "seen"), [(255.0, 30.0), (120.0, 14.0)])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_ground_without_texture_is_not_taken_for_standing_still(usual, seen, seed):
    """4 s at 2 m/s: 6 m lost by what the flow says; by the quality's own scale, whatever that is."""
    flown = without_texture(noisy(fly(circle, 30.0), seed).only(*OWN), usual, seen, 15.0, 19.0)
    found = navigate(flown)
    error = np.abs(found.error[:, :2])
    assert error.max() < 1.3
    assert (error < 3.0 * found.estimate_rows.std_pos_ned_m[:, :2]).mean() > 0.99


def test_a_sensor_that_always_says_poor_quality_is_believed():
    """ArduPilot's simulator says 51 of 255 all along."""
    flown = noisy(fly(circle, 30.0)).only(*OWN)
    full = navigate(flown)
    flow = flown.streams[Sensor.FLOW_RATE]
    poor = navigate(flown.changed(Sensor.FLOW_RATE, quality=np.full(len(flow), 51.0)))
    assert np.abs(poor.error[:, :2]).max() < 2.0 * np.abs(full.error[:, :2]).max()


def test_how_blind_a_flow_sensor_is():
    assert [blindness(q, 200.0) for q in (200.0, 100.0, 50.0, 0.0)] == [0.0, 0.0, 0.5, 1.0]
    assert blindness(0.0, 0.0) == 1.0
    usual = 0.0
    for _ in range(40):
        usual = followed_quality(100.0, 0.1, usual)
    assert usual == pytest.approx(100.0, abs=2.0)  # after 4 s
    for _ in range(40):
        usual = followed_quality(0.0, 0.1, usual)
    assert usual > 80.0  # and after 4 s of nothing


# -- an autopilot's attitude while nothing else tells the tilt ---------------------------------------------------
def off_level(flown: Flown, roll_rad: float) -> Flown:
    """An attitude that is off by a constant roll."""
    attitude = flown.streams[Sensor.ATTITUDE]
    w, x, y, z = attitude.value.T
    half = 0.5 * roll_rad
    turned = np.column_stack([w - half * x, x + half * w, y + half * z, z - half * y])
    return flown.changed(Sensor.ATTITUDE, value=turned / np.linalg.norm(turned, axis=1)[:, None])


def test_without_gps_and_flow_an_attitude_holds_the_tilt_and_its_own_error_is_known_from_before():
    """A minute in which a gyro that comes to read 0.1 deg/s too much would lose it."""
    with_it, without = [], []
    for seed in range(1, 6):
        flown = off_level(noisy(fly(circle, 100.0), seed), 0.01).without(Sensor.FLOW_RATE)
        flown = added_to(flown, Sensor.IMU, [0.002, -0.001], 40.0)
        for sensor in GPS:
            flown = flown.cut(sensor, 40.0, 101.0)
        held, alone = navigate(flown), navigate(flown.without(Sensor.ATTITUDE))
        with_it.append(np.hypot(*held.error[-1, :2]))
        without.append(np.hypot(*alone.error[-1, :2]))
        assert with_it[-1] < 3.0 * np.hypot(*held.estimate_rows.std_pos_ned_m[-1, :2])
    assert np.mean(with_it) < 0.75 * np.mean(without)  # whose tilt and bias were separated before the outage


def test_while_something_aids_the_filter_an_attitude_moves_nothing_but_its_own_error():
    flown = off_level(noisy(fly(circle, 30.0)), 0.03)
    with_it, without = navigate(flown), navigate(flown.cut(Sensor.ATTITUDE, 2.0, 31.0))
    at = np.linspace(2.5, 29.0, 50)
    level = [np.interp(at, run.t_s, run.error[:, 0]) for run in (with_it, without)]
    assert level[0] == pytest.approx(level[1], abs=1e-6)
    assert with_it.state(INS_ERROR) > 0.005


# -- coming to rest ----------------------------------------------------------------------------------------------
def test_one_that_rests_again_gives_up_a_velocity_that_it_was_sure_of():
    """Its accelerometer read 2 m/s2 too much while the motors ran, and reads right when they stop: 5 m/s in 2.5 s. What
    is left is what the bias, half of which is still believed, gains between two beliefs in rest."""
    duration_s = 40.0
    flown = noisy(fly(lambda t: from_the_ground(np.minimum(t, duration_s - 4.0 - t + 4.0)), duration_s).only(*OWN))
    flown = added_to(flown, Sensor.IMU, [0.0, 0.0, 0.0, 1.5, -1.5, 0.0], 5.0, 1.0)
    flown = added_to(flown, Sensor.IMU, [0.0, 0.0, 0.0, -1.5, 1.5, 0.0], duration_s - 4.0)
    found = navigate(flown)
    assert found.events("filter", "standing")[-1, 1] == RESTS
    assert MOVES in found.events("filter", "standing")[:, 1]
    assert np.abs(found.velocity_error[found.t_s > duration_s - 3.0]).max() < 0.08
    assert found.column(ACCEL_BIAS, 2)[-1] == pytest.approx([0.0, 0.0], abs=0.7)
