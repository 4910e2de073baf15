"""The first attitude: how far a mean force is believed, what a shaken vehicle doubts, where a compass heads."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import Sensor
from flownav.estimation.states import ACCEL_BIAS, GYRO_BIAS
from flownav.navigation.records import Reading, StartMemory
from flownav.navigation.start import STANDING_TILT_RAD, level, levelled
from flownav.navigation.told import FROM_MAG, NO_HEADING, Equipment
from navigation_streams import Navigated, fly, navigate, still

NAN = math.nan
FITTED = Equipment(True, False, NO_HEADING, False, -math.inf)
COMPASS = FITTED._replace(heading=FROM_MAG)
EMPTY = StartMemory(*[0.0] * len(StartMemory._fields))._replace(attitude_s=-math.inf, qw=1.0)
ROLL, PITCH = 0.2, -0.1


def force_of(roll: float, pitch: float) -> tuple[float, float, float]:
    g = GRAVITY_M_S2
    return g * math.sin(pitch), -g * math.sin(roll) * math.cos(pitch), -g * math.cos(roll) * math.cos(pitch)


def heard(force: tuple[float, ...], m: StartMemory) -> StartMemory:
    return levelled(Reading(0.0, 0.0, 0.0, *force, NAN, NAN, NAN, 255.0, 1.0, 0.0), m)


def angles(q: tuple[float, ...]) -> tuple[float, float, float]:
    w, x, y, z = q
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)), math.asin(2.0 * (w * y - x * z)),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )  # fmt: skip


def on_a_slope() -> StartMemory:
    m = EMPTY
    for _ in range(10):
        m = heard(force_of(ROLL, PITCH), m)
    return m


# -- pure laws -----------------------------------------------------------------------------------------------
def test_the_mean_force_is_that_of_all_readings_whatever_sways():
    x, y, z = force_of(ROLL, PITCH)
    m = EMPTY
    for sway in (0.5, -0.5, 0.5, -0.5):
        m = heard((x + sway, y, z - sway), m)
    assert m[6:10] == pytest.approx((x, y, z, 4.0))


def test_what_is_not_shaken_is_not_said_to_be():
    assert on_a_slope().shaken == pytest.approx(0.0, abs=1e-24)


def test_how_a_vehicle_is_shaken_is_the_mean_square_of_an_axis():
    random, sigma, m, seen = np.random.default_rng(1), 1.5, EMPTY, []
    for _ in range(8000):
        m = heard(tuple(random.normal(force_of(ROLL, PITCH), sigma).tolist()), m)
        seen.append(m.shaken)
    assert np.mean(seen[1000:]) == pytest.approx(sigma**2, rel=0.05)


@pytest.mark.parametrize("believed", [1.0, 0.5, 0.0])
def test_roll_and_pitch_are_those_of_the_mean_force_as_far_as_it_is_believed(believed):
    assert angles(level(on_a_slope(), believed, NAN, FITTED)) == pytest.approx((believed * ROLL, believed * PITCH, 0.0))


@pytest.mark.parametrize(("field_rad", "declination_rad", "fitted", "heading"), [
    (0.7, 0.0, FITTED, 0.0),  # no compass is fitted
    (NAN, 0.2, COMPASS, 0.0),  # none was heard
    (0.7, 0.0, COMPASS, -0.7),  # the field lies right of the nose, so the nose left of north
    (0.7, 0.2, COMPASS, -0.5),  # and north is left of the needle
    (-0.7, -0.2, COMPASS, 0.5),
])  # fmt: skip
def test_the_first_heading_is_true_north_by_field_and_declination(field_rad, declination_rad, fitted, heading):
    q = level(on_a_slope(), 1.0, field_rad, fitted._replace(declination_rad=declination_rad))
    assert angles(q) == pytest.approx((ROLL, PITCH, heading))


# -- a lane's start ------------------------------------------------------------------------------------------
def started(shaking_m_s2: float, roll: float) -> Navigated:
    """A vehicle on a slope, shaken by so much; flow begins after half a second."""
    flown = fly(still, 0.6).only(Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE)
    imu = flown.streams[Sensor.IMU].value.copy()
    imu[:, 3:] = force_of(roll, 0.0)
    imu[:, 3:] += shaking_m_s2 * np.where(np.arange(len(imu)) % 2 == 0, 1.0, -1.0)[:, None]  # its mean is exact
    return navigate(flown.changed(Sensor.IMU, value=imu).cut(Sensor.FLOW_RATE, 0.0, 0.5).without(Sensor.RANGE))


def believed_of(shaking_m_s2: float) -> float:
    doubt = 0.2**2 + shaking_m_s2**2  # `accel_bias_sigma_m_s2`
    return STANDING_TILT_RAD**2 / (STANDING_TILT_RAD**2 + doubt / GRAVITY_M_S2**2)


@pytest.mark.parametrize("shaking_m_s2", [0.0, 0.5, 3.0])
def test_a_shaken_vehicle_takes_itself_for_level_and_its_force_for_a_bias(shaking_m_s2):
    roll = 0.1
    run = started(shaking_m_s2, roll)
    believed = believed_of(shaking_m_s2)
    assert angles(run.said.quaternion[0])[0] == pytest.approx(believed * roll, rel=0.1, abs=1e-3)
    left = GRAVITY_M_S2 * (math.sin(believed * roll) - math.sin(roll))
    assert run.column(ACCEL_BIAS + 1)[0, 0] == pytest.approx(left, rel=0.1, abs=5e-3)
    assert run.column(GYRO_BIAS)[0, 0] == pytest.approx(0.0, abs=1e-3)


def test_what_is_left_of_the_tilts_doubt_is_stated_and_covers_the_truth():
    for shaking_m_s2 in (0.0, 0.5, 3.0):
        first = started(shaking_m_s2, 0.1).said
        off = abs(angles(first.quaternion[0])[0] - 0.1)
        assert first.std_tilt_ned_rad[0, 0] == pytest.approx(
            STANDING_TILT_RAD * math.sqrt(1.0 - believed_of(shaking_m_s2)) + 0.005, rel=0.1
        )
        assert off < 3.0 * first.std_tilt_ned_rad[0, 0]
