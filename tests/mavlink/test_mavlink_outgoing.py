"""Round trips: a measurement or an estimate, to a message, to bytes, and back, within the message's resolution."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion
from flownav.core.measurement import Measurement, Sensor
from flownav.logs.mavlink import outgoing
from flownav.logs.mavlink.converted import Context
from flownav.logs.mavlink.framing import coder
from flownav.logs.mavlink.messages import measurements, sim_state
from flownav.logs.mavlink.outgoing import Estimate
from flownav.logs.mavlink.position_messages import LOCAL_NED
from mavlink_logs import made, through_bytes

MAV = coder(1, 1)
ORIGIN = (47.0, 8.5, 400.0)
NAN = math.nan
AUTOPILOT, COMPANION = Context(origin_deg_m=ORIGIN), Context(autopilot=False)


def number(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


angle = number(-3.0, 3.0)
quaternions = st.builds(
    lambda r, p, y: tuple(float(q) for q in quaternion_from_euler(r, p, y)), angle, number(-1.5, 1.5), angle
)
vectors = st.tuples(number(-50, 50), number(-50, 50), number(-50, 50))


@st.composite
def covariances(draw):
    root = np.array(draw(st.lists(number(-1.0, 1.0), min_size=36, max_size=36))).reshape(6, 6)
    return root @ root.T + 0.01 * np.eye(6)


def back(message, context=AUTOPILOT) -> dict[Sensor, Measurement]:
    outcomes = measurements(through_bytes(message), 1.0, context)
    assert all(isinstance(outcome, Measurement) for outcome in outcomes), outcomes
    return {outcome.sensor: outcome for outcome in outcomes}


def close(values, expected, **tolerance):
    assert values == pytest.approx(expected, nan_ok=True, **({"rel": 1e-6, "abs": 1e-6} | tolerance))


def full(triangle) -> np.ndarray:
    matrix = np.zeros((6, 6))
    matrix[np.triu_indices(6)] = triangle
    return matrix + np.triu(matrix, 1).T


# -- the estimate ------------------------------------------------------------------------------------------
@settings(max_examples=60, deadline=None)
@given(vectors, vectors, quaternions, covariances(), covariances(), st.integers(0, 1000), st.integers(-1, 100))
def test_odometry(position, velocity, quaternion, pose, speed, resets, quality):
    estimate = Estimate(123_456_789, position, velocity, quaternion, (0.1, 0.2, 0.3), pose, speed, resets, quality)
    message = through_bytes(outgoing.odometry(MAV, estimate, frame=LOCAL_NED))
    rotation = np.reshape(rotation_from_quaternion(*quaternion), (3, 3))
    close([message.x, message.y, message.z], position)
    close(message.q, quaternion)
    close(rotation @ [message.vx, message.vy, message.vz], velocity, abs=1e-4)
    close([message.rollspeed, message.pitchspeed, message.yawspeed], (0.1, 0.2, 0.3))
    close(full(message.pose_covariance), pose, abs=1e-5)
    block = np.eye(6)
    block[:3, :3] = rotation
    close(block @ full(message.velocity_covariance) @ block.T, speed, abs=1e-4)
    assert (message.frame_id, message.child_frame_id, message.time_usec) == (1, 12, 123_456_789)
    assert (message.reset_counter, message.quality) == (resets % 256, quality)
    found = measurements(message, 1.0, COMPANION)
    if quality >= 0:
        readings = {m.sensor: m for m in found}
        close(readings[Sensor.POSE].value, position)
        close(readings[Sensor.POSE].variance, np.diag(pose)[:3], abs=1e-5)
        close(readings[Sensor.YAW].variance, [pose[5, 5]], abs=1e-5)


def test_what_is_unknown_is_nan_in_every_entry():
    message = through_bytes(outgoing.odometry(MAV, Estimate(1, (0, 0, 0), (0, 0, 0), (1, 0, 0, 0))))
    assert np.isnan(message.pose_covariance).all()
    assert np.isnan(message.velocity_covariance).all()
    assert math.isnan(message.rollspeed)
    assert message.frame_id == 20  # LOCAL_FRD
    infinite = Estimate(1, (0, 0, 0), (0, 0, 0), (1, 0, 0, 0), pose_covariance=np.full((6, 6), np.inf))
    assert np.isnan(through_bytes(outgoing.odometry(MAV, infinite)).pose_covariance).all()


@settings(max_examples=40, deadline=None)
@given(vectors, angle, number(-1.5, 1.5), angle, covariances())
def test_vision_position_estimate(position, roll, pitch, yaw, pose):
    quaternion = tuple(float(q) for q in quaternion_from_euler(roll, pitch, yaw))
    estimate = Estimate(5, position, (0.0, 0.0, 0.0), quaternion, pose_covariance=pose, reset_counter=300)
    message = through_bytes(outgoing.vision_position_estimate(MAV, estimate))
    close([message.roll, message.pitch, message.yaw], (roll, pitch, yaw), abs=1e-5)
    assert message.reset_counter == 44
    found = back(message, COMPANION)
    close(found[Sensor.POSE].value, position)
    close(found[Sensor.POSE].variance, np.diag(pose)[:3], abs=1e-5)
    close(found[Sensor.YAW].value, [yaw], abs=1e-5)


def test_vision_speed_estimate_is_the_whole_matrix():
    speed = np.diag([1.0, 2.0, 3.0, 9.0, 9.0, 9.0])
    speed[0, 1] = speed[1, 0] = 0.5
    estimate = Estimate(5, (0, 0, 0), (1.0, -2.0, 0.5), (1, 0, 0, 0), velocity_covariance=speed)
    message = through_bytes(outgoing.vision_speed_estimate(MAV, estimate))
    assert (message.x, message.y, message.z) == (1.0, -2.0, 0.5)
    assert list(message.covariance) == [1.0, 0.5, 0.0, 0.5, 2.0, 0.0, 0.0, 0.0, 3.0]
    unknown = through_bytes(outgoing.vision_speed_estimate(MAV, Estimate(5, (0, 0, 0), (0, 0, 0), (1, 0, 0, 0))))
    assert np.isnan(unknown.covariance).all()


@settings(max_examples=60, deadline=None)
@given(number(-1.5, 1.5), number(-1.5, 1.5), number(0.05, 50.0))
def test_landing_target(forward, right, distance):
    message = through_bytes(outgoing.landing_target(MAV, 9, forward, right, distance))
    close(back(message)[Sensor.PAD].value, (forward, right, distance), rel=1e-5, abs=1e-5)
    message.position_valid = 0
    close(back(message)[Sensor.PAD].value, (forward, right, distance), rel=1e-5, abs=1e-5)


def test_landing_target_without_a_distance():
    message = through_bytes(outgoing.landing_target(MAV, 9, 0.1, -0.2, NAN))
    assert (message.position_valid, message.distance) == (0, 0.0)
    close(back(message)[Sensor.PAD].value, (0.1, -0.2, NAN))


# -- what an autopilot sends -------------------------------------------------------------------------------
def reading(sensor, *value, variance=None, quality=255.0):
    return Measurement(1.0, sensor, value, variance or (NAN,) * len(value), 0.0, quality)


@settings(max_examples=40, deadline=None)
@given(st.tuples(*[number(-10, 10)] * 3), st.tuples(*[number(-100, 100)] * 3), number(-400, 4000))
def test_highres_imu(rates, force, altitude):
    imu = reading(Sensor.IMU, *rates, *force)
    found = back(outgoing.highres_imu(MAV, 7, imu, mag_gauss=(0.2, 0.0, 0.4), altitude_m=altitude))
    close(found[Sensor.IMU].value, imu.value)
    close(found[Sensor.MAG].value, (0.2, 0.0, 0.4))
    close(found[Sensor.BARO].value, [altitude], abs=2e-3)  # a float's last digit at 1000 hPa is 0.5 mm
    assert set(back(outgoing.highres_imu(MAV, 7, imu))) == {Sensor.IMU}


@settings(max_examples=40, deadline=None)
@given(quaternions, st.integers(0, 2**40))
def test_attitude_quaternion(quaternion, boot_ms):
    message = through_bytes(outgoing.attitude_quaternion(MAV, boot_ms, quaternion, (0.1, 0.2, 0.3)))
    assert message.time_boot_ms == boot_ms % 2**32
    close(back(message)[Sensor.ATTITUDE].value, quaternion)


@settings(max_examples=60, deadline=None)
@given(number(-0.01, 0.01), number(-0.01, 0.01), number(0, 800), number(-20, 20), number(-20, 20), number(0.01, 20.0))
def test_gps_raw_int(north_deg, east_deg, altitude, north, east, sigma):
    import pymap3d

    fix = (ORIGIN[0] + north_deg, ORIGIN[1] + east_deg, altitude)
    velocity = reading(Sensor.GPS_VELOCITY, north, east, NAN, variance=(sigma**2, sigma**2, NAN))
    message = outgoing.gps_raw_int(MAV, 3, fix, velocity, horizontal_sigma_m=sigma, vertical_sigma_m=2 * sigma)
    found = back(message)
    close(found[Sensor.GPS_POSITION].value, pymap3d.geodetic2ned(*fix, *ORIGIN), abs=0.02)
    close(np.sqrt(found[Sensor.GPS_POSITION].variance), (sigma, sigma, 2 * sigma), abs=1e-3)
    close(found[Sensor.GPS_VELOCITY].value, velocity.value, abs=0.01)
    close(np.sqrt(found[Sensor.GPS_VELOCITY].variance[:2]), (sigma, sigma), abs=1e-3)


@settings(max_examples=40, deadline=None)
@given(st.tuples(number(-5, 5), number(-5, 5)), st.one_of(st.just((NAN, NAN)), st.tuples(number(-5, 5), number(-5, 5))),
       st.floats(0.002, 0.5), st.integers(0, 255), st.one_of(st.just(-1.0), number(0.05, 30.0)))  # fmt: skip
def test_optical_flow_rad(flow, gyro, interval, quality, distance):
    sent = reading(Sensor.FLOW_RATE, *flow, *gyro, quality=float(quality))
    found = back(outgoing.optical_flow_rad(MAV, 3, sent, interval, distance_m=distance))
    close(found[Sensor.FLOW_RATE].value, sent.value, rel=3e-4)  # half a microsecond of two milliseconds
    assert found[Sensor.FLOW_RATE].quality == quality
    close(found[Sensor.FLOW_RATE].delay_s, interval / 2, abs=1e-6)
    assert (Sensor.RANGE in found) == (distance > 0.0)


@settings(max_examples=40, deadline=None)
@given(number(0.1, 40.0), st.one_of(st.just(NAN), number(1e-4, 0.02)), number(10, 255))
def test_distance_sensor(distance, variance, quality):
    sent = reading(Sensor.RANGE, distance, variance=(variance,), quality=quality)
    found = back(outgoing.distance_sensor(MAV, 3, sent, (0.05, 45.0)))[Sensor.RANGE]
    close(found.value, [distance], abs=0.00501)
    close(found.variance, [variance], abs=0.51e-4)
    close(found.quality, quality, abs=1.3)


@pytest.mark.parametrize("landed", [True, False])
def test_extended_sys_state(landed):
    found = back(outgoing.extended_sys_state(MAV, landed=landed))
    assert found[Sensor.LANDED].value == (float(landed),)


@settings(max_examples=40, deadline=None)
@given(vectors, quaternions, number(-80, 80), number(-170, 170), number(-100, 4000))
def test_sim_state(velocity, quaternion, latitude, longitude, altitude):
    message = outgoing.sim_state(
        MAV, (latitude, longitude, altitude), velocity, quaternion, (0.0, 0.0, 0.0), (0.1, 0.2, 0.3), (0.0, 0.0, -9.8)
    )
    state = sim_state(through_bytes(message))
    close(state.position_deg_m[:2], (latitude, longitude), abs=1e-5 if abs(latitude * longitude) < 1e-9 else 0.6e-7)
    close(state.position_deg_m[2], altitude, abs=1e-3)
    close(state.vel_ned_m_s, velocity)
    close(state.quaternion, quaternion)
    close(state.rate_frd_rad_s, (0.1, 0.2, 0.3))


def test_heartbeat_says_helicopter_and_armed():
    message = through_bytes(outgoing.heartbeat(MAV, armed=True))
    assert (message.type, message.autopilot, message.base_mode, message.system_status) == (4, 0, 128, 4)
    assert through_bytes(outgoing.heartbeat(MAV, armed=False)).base_mode == 0


def test_timesync_is_answered_once():
    reply = through_bytes(outgoing.timesync_reply(MAV, made("TIMESYNC", tc1=0, ts1=42), 1234))
    assert (reply.tc1, reply.ts1) == (1234, 42)
    assert outgoing.timesync_reply(MAV, reply, 9999) is None
