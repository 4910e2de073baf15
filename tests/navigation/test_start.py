"""The first attitude: how far a mean force is believed, what a shaken vehicle doubts, where a compass heads."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters import SILENT, Filter, N
from flownav.core.compile import ONE_LANE
from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler, rotation_from_quaternion
from flownav.core.measurement import Sensor
from flownav.estimation.motion import predict
from flownav.estimation.states import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, IMU, VELOCITY
from flownav.navigation.before_start import felt, levelled
from flownav.navigation.kernel_settings import FROM_MAG, NO_HEADING, Equipment
from flownav.navigation.records import Reading, StartMemory
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.settings_of import RECTIFIED_SHARE
from flownav.navigation.start import (
    HOVERING_M_S2,
    LEVELLED_FLOOR_RAD,
    LEVELLING_S,
    STANDING_TILT_RAD,
    level,
    levelling,
    noise_of_mean,
    starts,
    tie_tilt,
)
from navigation_streams import Navigated, fly, navigate, still

NAN = math.nan
FITTED = Equipment(True, False, NO_HEADING, False, -math.inf)
COMPASS = FITTED._replace(heading=FROM_MAG)
EMPTY = StartMemory(*[0.0] * len(StartMemory._fields))._replace(attitude_s=-math.inf, qw=1.0)
ROLL, PITCH = 0.2, -0.1


def force_of(roll: float, pitch: float) -> tuple[float, float, float]:
    g = GRAVITY_M_S2
    return g * math.sin(pitch), -g * math.sin(roll) * math.cos(pitch), -g * math.cos(roll) * math.cos(pitch)


def heard(force: tuple[float, ...], m: StartMemory, t_s: float = 0.0) -> StartMemory:
    return levelled(Reading(0.0, 0.0, 0.0, *force, NAN, NAN, NAN, 255.0, 1.0, 0.0), m, t_s)


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


def test_what_is_felt_at_the_start_is_the_force_of_the_last_tenth_of_a_second_without_its_vibration():
    """At 200 Hz a second of rest and then 0.3 s of 2 m/s2, shaken by 3 m/s2 at 50 Hz; the mean has less of it."""
    m = StartMemory()
    for k in range(260):
        pushed = 2.0 * (k >= 200) + 3.0 * math.sin(0.5 * math.pi * k)
        reading = Reading(0.0, 0.0, 0.0, pushed, 0.0, -GRAVITY_M_S2, arrived=1.0)
        m = levelled(reading, felt(reading, m, 0.005), 0.005 * k)
    assert m.felt_x == pytest.approx(2.0 * (1.0 - math.exp(-3.0)), abs=0.15)
    assert (m.felt_y, m.felt_z) == (0.0, pytest.approx(-GRAVITY_M_S2))
    assert m.force_x < 1.0


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
    (NAN, 0.2, COMPASS, 0.0),  # none was received
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
    flown = fly(still, 1.6).only(Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE)
    imu = flown.streams[Sensor.IMU].value.copy()
    imu[:, 3:] = force_of(roll, 0.0)
    imu[:, 3:] += shaking_m_s2 * np.where(np.arange(len(imu)) % 2 == 0, 1.0, -1.0)[:, None]  # its mean is exact
    return navigate(flown.changed(Sensor.IMU, value=imu).cut(Sensor.FLOW_RATE, 0.0, 0.5).without(Sensor.RANGE))


def doubts_of(shaking_m_s2: float, readings: int, rectified: float = RECTIFIED_SHARE) -> tuple[float, float]:
    """The variance of what lasts in a mean force and of what its readings leave [m2/s4]."""
    lasting = 0.2**2 + (rectified * shaking_m_s2) ** 2  # `accel_bias_sigma_m_s2`
    return lasting, HOVERING_M_S2**2 + shaking_m_s2**2 / readings


@pytest.mark.parametrize("shaking_m_s2", [0.0, 0.5, 3.0])
def test_the_start_is_the_posterior_of_a_tilt_a_bias_and_a_noise(shaking_m_s2):
    """Of one axis: z = g theta + b + n, by the joint normal law, as if by a Kalman filter of two states."""
    m = EMPTY._replace(force_x=0.7, readings=50.0, shaken=shaking_m_s2**2)
    lasting, noise = doubts_of(shaking_m_s2, 50)
    prior = np.diag([STANDING_TILT_RAD**2, lasting])
    jacobian = np.array([GRAVITY_M_S2, 1.0])
    cross = prior @ jacobian
    total = jacobian @ cross + noise
    mean, after = cross / total * 0.7, prior - np.outer(cross, cross) / total
    found = levelling(m, 0.2, RECTIFIED_SHARE, False, False)
    assert found.believed * 0.7 / GRAVITY_M_S2 == pytest.approx(mean[0], rel=1e-12)
    assert found.bias_x == pytest.approx(mean[1], rel=1e-12)
    assert found.bias_variance == pytest.approx(after[1, 1], rel=1e-12)
    assert found.shared == pytest.approx(-after[0, 1], rel=1e-12)
    assert found.tilt_variance == pytest.approx(after[0, 0] + LEVELLED_FLOOR_RAD**2, rel=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 0.9, math.pi, -2.0])
def test_a_levelled_vehicle_knows_its_acceleration_better_than_its_tilt_or_its_bias(yaw):
    """Tilt and bias are tied by the signs with which both enter the motion, however the vehicle heads."""
    found = levelling(EMPTY._replace(readings=100.0), 0.2, RECTIFIED_SHARE, False, False)
    filter_ = Filter()
    filter_.q[:] = quaternion_from_euler(0.0, 0.0, yaw)
    filter_.rows(IMU, 6)[5] = -GRAVITY_M_S2
    spread = np.zeros((N, N))
    spread[range(ATTITUDE, ATTITUDE + 2), range(ATTITUDE, ATTITUDE + 2)] = found.tilt_variance
    spread[range(ACCEL_BIAS, ACCEL_BIAS + 2), range(ACCEL_BIAS, ACCEL_BIAS + 2)] = found.bias_variance
    filter_.p = spread
    rotation = rotation_from_quaternion(*filter_.q)
    tie_tilt(filter_.work, ONE_LANE, 0, tuple(float(each) for each in rotation), found.shared)
    predict(filter_.work, ONE_LANE, N, 1.0, SILENT)
    of_noise = HOVERING_M_S2**2 + (GRAVITY_M_S2 * LEVELLED_FLOOR_RAD) ** 2
    speed = np.diag(filter_.p)[VELOCITY : VELOCITY + 2]
    assert (speed < 1.1 * of_noise).all()
    assert (speed < 0.7 * found.bias_variance).all()


def test_a_shaken_vehicle_waits_a_second_for_its_mean_and_a_still_one_does_not():
    fix = Reading(0.0, 0.0, 0.0, NAN, NAN, NAN, NAN, NAN, NAN, 255.0, 1.0, 0.0)
    for shaken, first_s in ((0.0, 0.3), (1.5**2, LEVELLING_S)):
        m = EMPTY._replace(attitude_s=NAN, readings=30.0, shaken=shaken, since_s=0.0)
        assert starts(fix, m, first_s, Sensor.GPS_POSITION, math.inf)
        assert not starts(fix, m._replace(readings=4.0), first_s, Sensor.GPS_POSITION, math.inf)
    assert not starts(fix, m, 0.99 * LEVELLING_S, Sensor.GPS_POSITION, math.inf)


def test_the_noise_of_a_mean_falls_with_its_readings_down_to_how_a_hover_accelerates():
    few, many = (noise_of_mean(EMPTY._replace(readings=n, shaken=4.0)) for n in (10.0, 100.0))
    assert few - HOVERING_M_S2**2 == pytest.approx(10.0 * (many - HOVERING_M_S2**2))
    assert many == pytest.approx(HOVERING_M_S2**2 + 0.04)


@pytest.mark.parametrize("shaking_m_s2", [0.0, 0.5, 3.0])
def test_a_vehicle_on_a_slope_starts_aslant_and_what_is_left_covers_the_truth(shaking_m_s2):
    roll = 0.1
    run = started(shaking_m_s2, roll)
    lasting, noise = doubts_of(
        shaking_m_s2, 100 if shaking_m_s2 == 3.0 else 50, NavigatorSettingsFile().vibration_rectified_share
    )
    tilted = (GRAVITY_M_S2 * STANDING_TILT_RAD) ** 2
    believed = tilted / (tilted + lasting + noise)
    first = run.estimate_rows
    assert angles(first.quaternion[0])[0] == pytest.approx(believed * roll, rel=0.1, abs=2e-3)
    bias = -lasting / (tilted + lasting + noise) * GRAVITY_M_S2 * math.sin(roll)
    assert run.column(ACCEL_BIAS + 1)[0, 0] == pytest.approx(bias, rel=0.2, abs=5e-3)
    assert run.column(GYRO_BIAS)[0, 0] == pytest.approx(0.0, abs=1e-3)
    assert abs(angles(first.quaternion[0])[0] - roll) < 2.0 * first.std_tilt_ned_rad[0, 0]
