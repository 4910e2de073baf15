"""The navigator on flights of known truth: what it learns, what aids it, what it starts from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import Sensor, Stream
from flownav.estimation.states import ACCEL_BIAS, COMPASS, INS_ERROR, PAD, VELOCITY_LAG
from flownav.navigation.pad import FIXES_THAT_FIND, MANY_STRAYS
from navigation_streams import circle, fly, navigate, still

GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)


def test_it_starts_level_from_the_accelerometer_alone():
    """As far as vehicles stand aslant (0.1 rad), beside a bias (0.2 m/s2) and a hover (0.15 m/s2)."""
    flown = fly(still, 3.0).without(Sensor.ATTITUDE, Sensor.MAG)
    roll, pitch = 0.1, -0.06  # it stands on a slope
    imu = flown.streams[Sensor.IMU].value.copy()
    g = -imu[:, 5]
    imu[:, 3:] = np.column_stack([g * np.sin(pitch), -g * np.sin(roll) * np.cos(pitch),
                                  -g * np.cos(roll) * np.cos(pitch)])  # fmt: skip
    flown = flown.changed(Sensor.IMU, value=imu)
    for sensor in (*GPS, Sensor.FLOW_RATE):  # later than the accelerometer's first readings
        flown = flown.cut(sensor, 0.0, 0.5)
    run = navigate(flown)
    w, x, y, _ = run.estimate_rows.quaternion[0]
    tilted, lasting, noise = (0.1 * GRAVITY_M_S2) ** 2, 0.2**2, 0.15**2
    believed = tilted / (tilted + lasting + noise)
    assert believed > 0.9
    assert 2 * np.arctan2(x, w) == pytest.approx(believed * roll, abs=1e-3)
    assert 2 * np.arctan2(y, w) == pytest.approx(believed * pitch, abs=1e-3)
    left_x, left_y = run.column(ACCEL_BIAS, 2)[0] / GRAVITY_M_S2  # of the rest the lasting part is the accelerometer's
    biased = lasting / (tilted + lasting + noise)
    assert [left_x, left_y] == pytest.approx([biased * pitch, -biased * roll], abs=1e-3)
    assert np.abs(run.velocity_error).max() < 0.02
    assert run.events("filter", "start")[:, 1] == pytest.approx([1.0])


def test_without_imu_an_attitude_of_50_hz_serves():
    run = navigate(fly(circle, 30.0, 0.2).without(Sensor.IMU, Sensor.MAG))
    late = run.t_s > 10.0
    assert np.abs(run.error[late, :2]).max() < 0.5
    assert np.abs(run.yaw_error[late]).max() < 0.05
    assert run.reasons(Sensor.ATTITUDE)["fused"] > 4000


def test_neither_attitude_nor_imu_is_no_start():
    run = navigate(fly(still, 3.0).without(Sensor.IMU, Sensor.ATTITUDE))
    assert len(run.estimate) == 0
    assert set(run.reasons(Sensor.GPS_POSITION)) == {"before_start"}


def test_laps_teach_the_compass_deviation():
    """A + B sin + C cos: GPS and the IMU tell the heading while the vehicle accelerates, and the compass its error."""
    flown = fly(circle, 120.0, 0.3).without(Sensor.ATTITUDE)
    a, b, c = 0.12, 0.10, -0.08
    t_s = flown.streams[Sensor.MAG].t_s
    yaw = np.interp(t_s, flown.t_s, flown.yaw)
    wrong = yaw + a + b * np.sin(yaw) + c * np.cos(yaw)
    field = np.column_stack([0.21 * np.cos(wrong), -0.21 * np.sin(wrong), 0 * wrong + 0.43])
    run = navigate(flown.changed(Sensor.MAG, value=field))
    assert np.abs(run.yaw_error[run.t_s > 90.0]).max() < 0.01
    assert run.state(INS_ERROR + 2) == pytest.approx(a, abs=0.02)
    for state, truth in ((COMPASS, b), (COMPASS + 1, c)):  # slowly: flow, which errs as motion does, tells no heading
        assert run.sigma(state) < 0.02
        assert abs(run.state(state) - truth) < 2.5 * run.sigma(state)


def test_the_lag_of_gps_velocity_is_learned():
    flown = fly(circle, 90.0)
    late = flown.at(flown.streams[Sensor.GPS_VELOCITY].t_s - 0.15, flown.velocity)
    run = navigate(flown.changed(Sensor.GPS_VELOCITY, value=late))
    assert run.state(VELOCITY_LAG) == pytest.approx(0.15, abs=0.04)
    assert np.abs(run.velocity_error[run.t_s > 60.0]).max() < 0.05


def test_a_gap_of_the_imu_is_bridged_by_the_logged_attitude():
    """Three seconds of turning at half a radian per second without an IMU."""
    flown = fly(circle, 30.0, 0.5).cut(Sensor.IMU, 15.0, 18.0)
    run = navigate(flown)
    lost = run.events("imu", "lost")
    assert lost[:, 1] == pytest.approx([3.0], abs=0.03)
    after = run.t_s > 18.2
    assert np.abs(run.yaw_error[after]).max() < 0.05
    assert np.abs(run.error[after, :2]).max() < 0.5
    alone = navigate(flown.without(Sensor.ATTITUDE, Sensor.MAG, Sensor.FLOW_RATE))  # nor what else shows a heading
    just = (alone.t_s > 18.05) & (alone.t_s < 18.15)
    assert np.abs(alone.yaw_error[just]).min() > 1.0


def test_a_gap_ends_once_whichever_of_two_readings_of_one_instant_comes_first():
    """The attitude that ends the gap stands before the IMU's first reading after it."""
    flown = fly(circle, 20.0, 0.5).cut(Sensor.IMU, 15.0, 15.5)
    attitude_first = dict(sorted(flown.streams.items(), key=lambda entry: entry[0] != Sensor.ATTITUDE))
    for streams in (flown.streams, attitude_first):
        offers = navigate(replace(flown, streams=streams)).offers
        heads = (offers[:, 1] == Sensor.ATTITUDE) & (offers[:, 2] == 2)  # level it is held against all along
        bridged = offers[heads, 0]
        assert [bridged[0], bridged[-1]] == pytest.approx([15.26, 15.5])  # from where the IMU is stale


def test_zero_velocity_on_the_ground_holds_the_place():
    """A biased accelerometer on the ground, no other aid: LANDED keeps it still, and so does a quiet IMU."""
    flown = fly(lambda t: 0.0 * still(t), 20.0).without(Sensor.FLOW_RATE, Sensor.RANGE)
    quiet = flown.streams[Sensor.IMU].value + np.array([0, 0, 0, 0.15, -0.1, 0.05])
    shaken = quiet + np.random.default_rng(4).normal(0.0, 1.0, quiet.shape) * [0.02, 0.02, 0.02, 0.2, 0.2, 0.2]
    resting = flown.changed(Sensor.IMU, value=quiet)
    flown = flown.changed(Sensor.IMU, value=shaken)  # its rotor turns
    for sensor in GPS:
        flown, resting = flown.cut(sensor, 3.0, 99.0), resting.cut(sensor, 3.0, 99.0)
    rested = navigate(resting)
    assert rested.events("filter", "standing")[:, 1] == pytest.approx([2.0])
    assert np.abs(rested.velocity_error[rested.t_s > 1.0]).max() < 0.01
    assert np.abs(rested.error[-1, :2]).max() < 0.02
    t_s = np.arange(0.0, 20.0, 0.1)
    landed = flown.added(Stream.of(Sensor.LANDED, t_s, np.ones((len(t_s), 1))))
    held, free = navigate(landed), navigate(flown)
    assert np.abs(held.velocity_error[held.t_s > 10.0]).max() < 0.03
    assert np.abs(held.error[-1, :2]).max() < 0.1
    assert np.abs(free.error[-1, :2]).max() > 2.0
    assert len(held.events("filter", "dead_reckoning")) == 0
    flying = navigate(flown.added(Stream.of(Sensor.LANDED, t_s, np.zeros((len(t_s), 1)))))
    assert flying.reasons(Sensor.LANDED) == {}
    assert np.abs(flying.error[-1, :2]).max() > 2.0


@pytest.mark.parametrize(("without", "m_s"), [((), 0.75), ((Sensor.RANGE, Sensor.FLOW_RATE), 1.5), (GPS, 0.75)])
def test_landed_that_is_said_in_flight_is_refused_by_what_says_that_it_flies(without, m_s):
    """5 m up: by range, flow and GPS together, by GPS alone, and without it."""
    flown = fly(lambda t: np.column_stack([0.0 * t, m_s * t, 0.0 * t - 5.0]), 20.0).without(*without)
    t_s = np.arange(8.0, 14.0, 0.2)
    lied, honest = navigate(flown.added(Stream.of(Sensor.LANDED, t_s, np.ones((len(t_s), 1))))), navigate(flown)
    for axis in range(2):
        beside = np.interp(lied.t_s, honest.t_s, honest.error[:, axis])
        assert np.abs(lied.error[:, axis] - beside).max() < 0.05
    assert set(lied.reasons(Sensor.LANDED)) == {"innovation_gate"}


def test_pad_fixes_pull_the_position_to_centimetres():
    """GPS is half a metre off; the pad's place is a state, and from it the vehicle's place is known to centimetres."""
    flown = fly(still, 30.0).without(Sensor.FLOW_RATE, Sensor.BARO)
    random = np.random.default_rng(3)
    noisy = flown.streams[Sensor.GPS_POSITION].value + random.normal(0.0, 0.5, (150, 3))
    flown = flown.changed(Sensor.GPS_POSITION, value=noisy)
    t_s = np.arange(1.0, 30.0, 0.1)
    fixes = np.column_stack([0 * t_s, 0 * t_s, 0 * t_s + 2.0])
    run = navigate(flown.added(Stream.of(Sensor.PAD, t_s, fixes, variance=np.full((len(t_s), 3), 1e-6))))
    late = run.t_s > 5.0
    from_pad = run.estimate_rows.pos_ned_m[late] - run.column(PAD, 3)[late]
    assert np.abs(from_pad - [0.0, 0.0, -2.0]).max() < 0.01
    in_earth_m = run.estimate_rows.std_pos_ned_m[-1, 0]
    assert run.sigma(PAD) == pytest.approx(in_earth_m, rel=0.01)  # it is no better known there
    assert run.sigma(PAD) > 0.2
    assert len(run.events("pad", "found")) == 1
    assert run.reasons(Sensor.PAD) == {"datum": 6, "fused": 864}  # two fixes that the third confirms


@pytest.mark.parametrize(("wrong_first", "axis"), [(1, 0), (2, 0), (5, 0), (5, 1)])
def test_a_pad_first_seen_where_there_is_none_is_found_where_it_is(wrong_first, axis):
    """The first fixes are of something else, 2 m beside: too few to find a pad, or as many as do; one stray later on
    moves nothing.
    """
    flown = fly(still, 30.0, 0.3)
    t_s = np.arange(1.0, 30.0, 0.1)
    fixes = np.column_stack([0 * t_s, 0 * t_s, 0 * t_s + 2.0])
    fixes[:wrong_first, axis], fixes[200, 1] = 1.0, -1.0
    run = navigate(flown.added(Stream.of(Sensor.PAD, t_s, fixes, variance=np.full((len(t_s), 3), 1e-6))))
    late = run.t_s > 3.0
    from_pad = run.estimate_rows.pos_ned_m[late] - run.column(PAD, 3)[late]
    assert np.abs(from_pad - [0.0, 0.0, -2.0]).max() < 0.02
    found_s = run.events("pad", "found")[:, 0]
    first_true_s = 1.0 + 0.1 * wrong_first
    if wrong_first < FIXES_THAT_FIND:
        assert found_s == pytest.approx([first_true_s + 0.2], abs=0.05)
        assert run.reasons(Sensor.PAD)["innovation_gate"] == 3  # of the stray alone
    else:
        assert found_s == pytest.approx([1.2, first_true_s + 0.1 * MANY_STRAYS], abs=0.05)


def test_an_external_pose_is_enough():
    flown = fly(circle, 20.0, 0.2).only(Sensor.IMU)
    t_s = np.arange(0.2, 20.0, 0.05)
    run = navigate(flown.added(Stream.of(Sensor.POSE, t_s, flown.at(t_s, flown.position - flown.position[1000]))))
    truth = flown.at(run.t_s, flown.position - flown.position[1000])
    assert np.abs(run.estimate_rows.pos_ned_m - truth).max() < 0.1
    assert np.abs(run.velocity_error[run.t_s > 10.0]).max() < 0.05
    assert run.events("filter", "start")[:, 1] == pytest.approx([0.0])


def test_a_pose_that_is_50_m_off_to_the_north_and_2_to_the_east_is_refused_as_a_whole():
    """Axis by axis, its east would be believed after a second without one."""
    flown = fly(circle, 20.0, 0.2).only(Sensor.IMU)
    t_s = np.concatenate([np.arange(0.2, 12.0, 0.05), [14.0], np.arange(15.0, 20.0, 0.05)])
    pose = flown.at(t_s, flown.position - flown.position[1000]) + np.where(t_s == 14.0, 1.0, 0.0)[:, None] * [
        50.0,
        2.0,
        0.0,
    ]
    run = navigate(flown.added(Stream.of(Sensor.POSE, t_s, pose)))
    truth = flown.at(run.t_s, flown.position - flown.position[1000])
    assert np.abs(run.estimate_rows.pos_ned_m - truth)[:, 1].max() < 0.5
    assert run.reasons(Sensor.POSE)["innovation_gate"] == 2


def test_an_external_heading_is_taken():
    """With an earth frame and without, after the start and, however far it is from north, before it."""
    flown = late = fly(still, 20.0, 0.3).without(Sensor.ATTITUDE, Sensor.MAG)
    for sensor in (*GPS, Sensor.FLOW_RATE):
        late = late.cut(sensor, 0.0, 1.0)
    t_s = np.arange(0.0, 20.0, 0.2)
    for off, heard in ((0.5, flown), (0.5, flown.without(*GPS)), (2.5, late), (-2.5, late.without(*GPS))):
        yaw = np.interp(t_s, flown.t_s, flown.yaw) + off
        run = navigate(heard.added(Stream.of(Sensor.YAW, t_s, yaw[:, None], variance=np.full((len(t_s), 1), 1e-4))))
        assert set(run.reasons(Sensor.YAW)) <= {"before_start", "fused"}
        assert run.yaw_error[run.t_s > 5.0] == pytest.approx(off, abs=0.01)
        assert abs(run.state(INS_ERROR + 2)) < 1e-3


def test_vibration_at_take_off_leaves_the_height_right():
    """3 m/s2 of rectified vibration from take-off on, and a range alone to tell the height."""

    def climb(t):
        up = np.clip((t - 5.0) / 6.0, 0.0, 1.0)
        return np.column_stack([0 * t, 0 * t, -0.05 - 2.0 * up**3 * (10 - 15 * up + 6 * up**2)])

    flown = fly(climb, 20.0).without(Sensor.BARO, *GPS)
    imu = flown.streams[Sensor.IMU]
    flying = imu.t_s > 5.0
    value = imu.value + np.where(flying[:, None], [0, 0, 0, 0, 0, 3.0], 0.0)
    run = navigate(flown.changed(Sensor.IMU, value=value))
    off = run.error[:, 2] - run.error[0, 2]  # the start is the origin
    assert np.abs(off[run.t_s > 8.0]).max() < 0.3
    assert run.state(ACCEL_BIAS + 2) == pytest.approx(3.0, abs=0.5)
