"""MAVLink messages to measurements: units, traps, and what is dropped and why."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion, to_earth
from flownav.core.measurement import Measurement, Sensor
from flownav.logs.mavlink.converted import OPTIONAL, Context, Dropped, Pose
from flownav.logs.mavlink.framing import coder
from flownav.logs.mavlink.messages import (
    CONVERTERS,
    global_position_int,
    hil_state_quaternion,
    instance_of,
    local_position_ned,
    measurements,
    sim_state,
)
from flownav.logs.mavlink.sensor_messages import pressure_altitude_m, pressure_hpa
from mavlink_logs import arbitrary_payload, made, packed_payload

ORIGIN = (47.0, 8.5, 400.0)
ARDUPILOT = Context(ardupilot=True, origin_deg_m=ORIGIN)
PX4 = Context(origin_deg_m=ORIGIN)
COMPANION = Context(autopilot=False)


def readings(message, context=PX4) -> dict[Sensor, Measurement]:
    outcomes = measurements(message, 12.5, context)
    assert not [outcome for outcome in outcomes if isinstance(outcome, Dropped)], outcomes
    assert all(outcome.t_s == 12.5 for outcome in outcomes)
    return {outcome.sensor: outcome for outcome in outcomes}


def drops(message, context=PX4) -> list[tuple[Sensor, str]]:
    return [(d.sensor, d.reason) for d in measurements(message, 0.0, context) if isinstance(d, Dropped)]


# -- flow and range ----------------------------------------------------------------------------------------
def test_arducopter_hides_the_gyro_between_its_two_flow_fields():
    message = made(
        "OPTICAL_FLOW", quality=51, flow_rate_x=0.5, flow_rate_y=-0.25, flow_comp_m_x=0.3, flow_comp_m_y=-0.3
    )
    found = readings(message, ARDUPILOT)
    assert set(found) == {Sensor.FLOW_RATE}
    assert found[Sensor.FLOW_RATE].value == pytest.approx((0.5, -0.25, 0.2, 0.05), abs=1e-7)
    assert found[Sensor.FLOW_RATE].quality == 51


def test_arducopters_ground_distance_is_no_range():
    assert Sensor.RANGE not in readings(made("OPTICAL_FLOW", quality=9, ground_distance=3.0), ARDUPILOT)


def test_a_px4flow_gives_velocity_and_range_without_pixels():
    message = made("OPTICAL_FLOW", quality=120, flow_x=77, flow_y=-9, flow_comp_m_x=1.5, flow_comp_m_y=-0.5,
                   ground_distance=2.25)  # fmt: skip
    found = readings(message)
    assert set(found) == {Sensor.FLOW_VELOCITY, Sensor.RANGE}
    assert found[Sensor.FLOW_VELOCITY].value == pytest.approx((1.5, -0.5, math.nan), nan_ok=True)
    assert found[Sensor.RANGE].value == (2.25,)


def test_flow_rates_of_another_sender_come_without_a_gyro():
    found = readings(made("OPTICAL_FLOW", quality=120, flow_rate_x=0.5))
    assert found[Sensor.FLOW_RATE].value == pytest.approx((0.5, 0.0, math.nan, math.nan), nan_ok=True)


def test_an_unknown_ground_distance_is_no_range():
    assert Sensor.RANGE not in readings(made("OPTICAL_FLOW", quality=1, ground_distance=-1.0))


def test_integrals_are_divided_by_their_time():
    message = made("OPTICAL_FLOW_RAD", integration_time_us=20_000, integrated_x=0.02, integrated_y=-0.01,
                   integrated_xgyro=0.004, integrated_ygyro=math.nan, quality=255, distance=1.5,
                   time_delta_distance_us=3000)  # fmt: skip
    found = readings(message)
    flow = found[Sensor.FLOW_RATE]
    assert flow.value == pytest.approx((1.0, -0.5, 0.2, math.nan), nan_ok=True)
    assert flow.delay_s == pytest.approx(0.01)
    assert (found[Sensor.RANGE].value, found[Sensor.RANGE].delay_s) == ((1.5,), pytest.approx(0.003))


@pytest.mark.parametrize("interval_us", [0, 1_500_000])
def test_an_integration_without_a_time_is_dropped(interval_us):
    message = made("OPTICAL_FLOW_RAD", integration_time_us=interval_us, integrated_x=0.02, distance=-1.0)
    assert drops(message) == [(Sensor.FLOW_RATE, "no_interval")]
    assert len(measurements(message, 0.0, PX4)) == 1


def test_distance_in_centimetres_with_its_variance():
    message = made("DISTANCE_SENSOR", orientation=25, min_distance=20, max_distance=700, current_distance=123,
                   covariance=16, signal_quality=100)  # fmt: skip
    reading = readings(message)[Sensor.RANGE]
    assert (reading.value, reading.variance, reading.quality) == ((1.23,), pytest.approx((0.0016,)), 255.0)


@pytest.mark.parametrize(("percent", "quality"), [(0, 255.0), (2, 5.1), (50, 127.5), (100, 255.0), (200, 255.0)])
def test_signal_quality_in_percent(percent, quality):
    message = made("DISTANCE_SENSOR", orientation=25, current_distance=123, signal_quality=percent)
    assert readings(message)[Sensor.RANGE].quality == pytest.approx(quality)


@pytest.mark.parametrize("covariance", [0, 255])
def test_an_unknown_distance_variance_is_unstated(covariance):
    message = made("DISTANCE_SENSOR", orientation=25, current_distance=123, covariance=covariance)
    assert math.isnan(readings(message)[Sensor.RANGE].variance[0])


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"current_distance": 5}, "outside_limits"),
        ({"current_distance": 800}, "outside_limits"),
        ({"current_distance": 0, "min_distance": 0, "max_distance": 0}, "outside_limits"),
        ({"current_distance": 100, "signal_quality": 1}, "invalid"),
    ],
)
def test_a_distance_that_is_none_is_dropped(fields, reason):
    message = made("DISTANCE_SENSOR", **({"orientation": 25, "min_distance": 20, "max_distance": 700} | fields))
    assert drops(message) == [(Sensor.RANGE, reason)]


@pytest.mark.parametrize("orientation", [0, 2, 4, 24])
def test_a_distance_to_the_side_or_above_is_not_ours(orientation):
    assert measurements(made("DISTANCE_SENSOR", orientation=orientation, current_distance=100), 0.0, PX4) == ()


def test_rangefinder_in_metres():
    assert readings(made("RANGEFINDER", distance=3.5))[Sensor.RANGE].value == (3.5,)
    assert drops(made("RANGEFINDER", distance=0.0)) == [(Sensor.RANGE, "outside_limits")]


# -- inertial ----------------------------------------------------------------------------------------------
IMU = {"xacc": 1.0, "yacc": 2.0, "zacc": -9.5, "xgyro": 0.1, "ygyro": 0.2, "zgyro": 0.3, "xmag": 0.2, "ymag": 0.0,
       "zmag": 0.4, "abs_pressure": 1000.0}  # fmt: skip


def test_highres_imu_is_si_and_gyro_first():
    found = readings(made("HIGHRES_IMU", fields_updated=0xFFF, **IMU))
    assert found[Sensor.IMU].value == pytest.approx((0.1, 0.2, 0.3, 1.0, 2.0, -9.5), rel=1e-6)
    assert found[Sensor.MAG].value == pytest.approx((0.2, 0.0, 0.4), rel=1e-6)
    assert found[Sensor.BARO].value == pytest.approx((pressure_altitude_m(1000.0),))


@pytest.mark.parametrize(
    ("updated", "sensors"), [(0x03F, {Sensor.IMU}), (0x1C0, {Sensor.MAG}), (0x200, {Sensor.BARO}), (0, set())]
)
def test_highres_imu_gives_what_is_new(updated, sensors):
    assert set(readings(made("HIGHRES_IMU", fields_updated=updated, **IMU))) == sensors


def test_half_an_imu_is_dropped():
    assert drops(made("HIGHRES_IMU", fields_updated=0x007, **IMU)) == [(Sensor.IMU, "incomplete")]


RAW = {"xacc": 100, "yacc": 0, "zacc": -1000, "xgyro": 500, "ygyro": -250, "zgyro": 1, "xmag": 200, "zmag": -400}


@pytest.mark.parametrize("name", ["SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3", "RAW_IMU"])
def test_scaled_imu_is_thousandths(name):
    found = readings(made(name, **RAW), ARDUPILOT)
    assert found[Sensor.IMU].value == pytest.approx((0.5, -0.25, 0.001, 0.980665, 0.0, -9.80665))
    assert found[Sensor.MAG].value == pytest.approx((0.2, 0.0, -0.4))


def test_raw_imu_of_others_is_counts():
    assert drops(made("RAW_IMU", **RAW), PX4) == [(Sensor.IMU, "raw_counts")]


def test_no_magnetometer_is_no_field():
    assert set(readings(made("SCALED_IMU", zacc=-1000))) == {Sensor.IMU}


@pytest.mark.parametrize("name", ["SCALED_IMU3", "RAW_IMU"])
def test_six_zeros_are_no_imu(name):
    """ArduPilot sends SCALED_IMU3 of a vehicle with two; taken for one, it served when the first was stuck."""
    assert drops(made(name), ARDUPILOT) == [(Sensor.IMU, "no_data")]


def test_attitude_and_its_quaternion_say_the_same():
    expected = [float(q) for q in quaternion_from_euler(0.3, -0.2, 2.0)]
    angles = readings(made("ATTITUDE", roll=0.3, pitch=-0.2, yaw=2.0))[Sensor.ATTITUDE].value
    q1, q2, q3, q4 = expected
    quaternion = readings(made("ATTITUDE_QUATERNION", q1=q1, q2=q2, q3=q3, q4=q4))[Sensor.ATTITUDE].value
    assert angles == pytest.approx(expected, abs=1e-6)
    assert quaternion == pytest.approx(expected, abs=1e-6)


def test_a_quaternion_of_another_length_is_dropped():
    assert drops(made("ATTITUDE_QUATERNION", q1=0.7)) == [(Sensor.ATTITUDE, "not_unit")]
    assert drops(made("ATTITUDE_QUATERNION")) == [(Sensor.ATTITUDE, "not_unit")]


def test_pressure_altitude_is_the_standard_atmospheres():
    assert pressure_altitude_m(1013.25) == 0.0
    assert pressure_altitude_m(898.746) == pytest.approx(1000.0, abs=0.5)  # ISO 2533 table
    assert pressure_altitude_m(540.199) == pytest.approx(5000.0, abs=2.0)
    assert pressure_altitude_m(pressure_hpa(321.0)) == pytest.approx(321.0)


def test_scaled_pressure_is_hectopascal():
    assert readings(made("SCALED_PRESSURE", press_abs=1001.25))[Sensor.BARO].value == pytest.approx((100.2,), abs=0.3)
    assert drops(made("SCALED_PRESSURE", press_abs=0.0)) == [(Sensor.BARO, "out_of_range")]
    assert drops(made("SCALED_PRESSURE", press_abs=101325.0)) == [(Sensor.BARO, "out_of_range")]  # pascal


# -- position ----------------------------------------------------------------------------------------------
FIX = {"fix_type": 3, "lat": 470000899, "lon": 85000000, "alt": 395500, "vel": 250, "cog": 9000, "eph": 120, "epv": 200}


def test_gps_units_and_accuracies():
    found = readings(made("GPS_RAW_INT", h_acc=300, v_acc=700, vel_acc=250, **FIX))
    assert found[Sensor.GPS_POSITION].value == pytest.approx((10.0, 0.0, 4.5), abs=0.01)
    assert found[Sensor.GPS_POSITION].variance == pytest.approx((0.09, 0.09, 0.49))
    assert found[Sensor.GPS_VELOCITY].value == pytest.approx((0.0, 2.5, math.nan), nan_ok=True, abs=1e-9)
    assert found[Sensor.GPS_VELOCITY].variance[:2] == pytest.approx((0.0625, 0.0625))


def test_gps_falls_back_on_dilution():
    variance = readings(made("GPS_RAW_INT", **FIX))[Sensor.GPS_POSITION].variance
    assert variance == pytest.approx(((1.2 * 2.1) ** 2, (1.2 * 2.1) ** 2, (2.0 * 2.1) ** 2))


def test_gps_without_any_accuracy_states_none():
    found = readings(made("GPS_RAW_INT", **(FIX | {"eph": 65535, "epv": 65535})))
    assert np.isnan(found[Sensor.GPS_POSITION].variance).all()
    assert np.isnan(found[Sensor.GPS_VELOCITY].variance).all()


@pytest.mark.parametrize("unknown", [{"vel": 65535}, {"cog": 65535}])
def test_an_unknown_speed_or_course_is_no_velocity(unknown):
    assert set(readings(made("GPS_RAW_INT", **(FIX | unknown)))) == {Sensor.GPS_POSITION}


@pytest.mark.parametrize("fix", [0, 1, 2])
def test_no_fix_is_no_position(fix):
    assert drops(made("GPS_RAW_INT", **(FIX | {"fix_type": fix}))) == [(Sensor.GPS_POSITION, "no_fix")]


def test_a_fix_needs_an_origin():
    assert drops(made("GPS_RAW_INT", **FIX), Context()) == [(Sensor.GPS_POSITION, "no_origin")]


@pytest.mark.parametrize("place", [{"lat": 910000000}, {"lon": -1810000000}])
def test_a_fix_beyond_the_pole_or_the_date_line_is_out_of_range(place):
    assert drops(made("GPS_RAW_INT", **(FIX | place))) == [(Sensor.GPS_POSITION, "out_of_range")]


def test_a_fix_at_zero_zero_is_out_of_range():
    assert drops(made("GPS_RAW_INT", **(FIX | {"lat": 0, "lon": 0}))) == [(Sensor.GPS_POSITION, "out_of_range")]


@pytest.mark.parametrize(("yaw", "expected"), [(36000, 0.0), (9000, math.pi / 2), (0, None), (65535, None)])
def test_gps_heading(yaw, expected):
    found = readings(made("GPS_RAW_INT", yaw=yaw, hdg_acc=100000, **FIX))
    if expected is None:
        assert Sensor.YAW not in found
    else:
        assert found[Sensor.YAW].value == pytest.approx((expected,))
        assert found[Sensor.YAW].variance == pytest.approx((math.radians(1.0) ** 2,))


COVARIANCE = [0.0] * 21
for place, value in zip((0, 6, 11, 15, 18, 20), (0.1, 0.2, 0.3, 0.01, 0.02, 0.03), strict=True):
    COVARIANCE[place] = value


def odometry(**fields):
    q = [float(v) for v in quaternion_from_euler(0.1, 0.0, -1.0)]
    given_fields = {"frame_id": 1, "child_frame_id": 12, "x": 1.0, "y": 2.0, "z": -3.0, "q": q, "quality": 50}
    return made("ODOMETRY", pose_covariance=COVARIANCE, **(given_fields | fields))


def test_a_companions_odometry_is_a_pose():
    found = readings(odometry(), COMPANION)
    assert found[Sensor.POSE].value == (1.0, 2.0, -3.0)
    assert found[Sensor.POSE].variance == pytest.approx((0.1, 0.2, 0.3))
    assert found[Sensor.POSE].quality == pytest.approx(127.5)
    assert found[Sensor.YAW].value == pytest.approx((-1.0,), abs=1e-6)
    assert found[Sensor.YAW].variance == pytest.approx((0.03,))


def test_an_autopilots_own_odometry_is_no_measurement():
    assert measurements(odometry(), 0.0, PX4) == ()


def test_a_frame_that_is_not_from_north_has_no_heading():
    assert set(readings(odometry(frame_id=20), COMPANION)) == {Sensor.POSE}


def test_failed_odometry_and_other_frames_are_dropped():
    assert drops(odometry(quality=-1), COMPANION) == [(Sensor.POSE, "failed")]
    assert drops(odometry(frame_id=4), COMPANION) == [(Sensor.POSE, "unknown_frame")]


def test_vision_position_and_its_unknown_covariance():
    unknown = [math.nan] + [0.0] * 20
    found = readings(made("VISION_POSITION_ESTIMATE", x=1.0, y=2.0, z=3.0, yaw=0.5, covariance=unknown), COMPANION)
    assert found[Sensor.POSE].value == (1.0, 2.0, 3.0)
    assert np.isnan(found[Sensor.POSE].variance).all()
    assert found[Sensor.YAW].value == (0.5,)


def test_landing_target_angles_are_of_the_image():
    found = readings(made("LANDING_TARGET", angle_x=0.2, angle_y=-0.1, distance=2.0))[Sensor.PAD]
    assert found.value == pytest.approx((math.tan(0.1), math.tan(0.2), 2.0), rel=1e-6)


def test_landing_target_without_a_distance():
    assert math.isnan(readings(made("LANDING_TARGET", angle_x=0.2))[Sensor.PAD].value[2])


def test_landing_target_in_the_earth_is_seen_from_the_vehicle():
    quaternion = tuple(float(q) for q in quaternion_from_euler(0.1, -0.2, 1.0))
    in_body = (0.4, -0.3, 2.5)
    offset = to_earth(rotation_from_quaternion(*quaternion), *in_body)
    north, east, down = (a + b for a, b in zip((10.0, 20.0, -5.0), offset, strict=True))
    message = made("LANDING_TARGET", position_valid=1, frame=1, x=north, y=east, z=down)
    context = Context(pose=Pose((10.0, 20.0, -5.0), quaternion))
    expected = (0.4 / 2.5, -0.3 / 2.5, math.sqrt(0.4**2 + 0.3**2 + 2.5**2))
    assert readings(message, context)[Sensor.PAD].value == pytest.approx(expected, abs=1e-5)
    assert drops(message, Context()) == [(Sensor.PAD, "no_pose")]
    body = made("LANDING_TARGET", position_valid=1, frame=12, x=0.4, y=-0.3, z=2.5)
    assert readings(body)[Sensor.PAD].value == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"angle_x": 1.6}, "out_of_range"),
        ({"angle_y": math.nan}, "out_of_range"),
        ({"position_valid": 1, "frame": 12, "z": -1.0}, "out_of_range"),
        ({"position_valid": 1, "frame": 12, "z": math.nan}, "not_finite"),
        ({"position_valid": 1, "frame": 4, "z": 1.0}, "unknown_frame"),
    ],
)
def test_a_landing_target_that_cannot_be(fields, reason):
    assert drops(made("LANDING_TARGET", **fields)) == [(Sensor.PAD, reason)]


@pytest.mark.parametrize(("state", "landed"), [(1, 1.0), (2, 0.0), (3, 0.0), (4, 0.0)])
def test_landed_state(state, landed):
    assert readings(made("EXTENDED_SYS_STATE", landed_state=state))[Sensor.LANDED].value == (landed,)


def test_an_undefined_landed_state_is_dropped():
    assert drops(made("EXTENDED_SYS_STATE")) == [(Sensor.LANDED, "undefined")]


# -- states ------------------------------------------------------------------------------------------------
def test_sim_state_takes_the_integers():
    fields = {"q1": 1.0, "alt": 12.5, "vn": 1.0, "xgyro": 0.5}
    for degrees in ({"lat": 47.0, "lon": 8.5}, {"lat": 470000000.0, "lon": 85000000.0}):
        state = sim_state(made("SIM_STATE", lat_int=470000123, lon_int=85000456, **fields, **degrees))
        assert state.position_deg_m == pytest.approx((47.0000123, 8.5000456, 12.5), abs=1e-9)
        fallback = sim_state(made("SIM_STATE", **fields, **degrees))
        assert fallback.position_deg_m == pytest.approx((47.0, 8.5, 12.5), abs=1e-5)
    assert (state.vel_ned_m_s, state.rate_frd_rad_s) == ((1.0, 0.0, 0.0), (0.5, 0.0, 0.0))


def test_states_that_cannot_be_are_none():
    assert sim_state(made("SIM_STATE", q1=0.2, lat_int=1)) is None
    assert sim_state(made("SIM_STATE", q1=1.0, alt=math.nan)) is None
    assert local_position_ned(made("LOCAL_POSITION_NED", x=math.inf)) is None
    assert local_position_ned(made("LOCAL_POSITION_NED", vx=3e38)) is None
    assert global_position_int(made("GLOBAL_POSITION_INT", alt=180)) is None
    assert global_position_int(made("GLOBAL_POSITION_INT", lat=910000000)) is None
    assert sim_state(made("SIM_STATE", q1=1.0, lat_int=910000000)) is None


def test_units_of_the_other_states():
    state = global_position_int(made("GLOBAL_POSITION_INT", lat=470000000, lon=85000000, alt=1500, vx=250, vz=-10))
    assert state.position_deg_m == pytest.approx((47.0, 8.5, 1.5))
    assert state.vel_ned_m_s == pytest.approx((2.5, 0.0, -0.1))
    true = hil_state_quaternion(made("HIL_STATE_QUATERNION", attitude_quaternion=[0, 1, 0, 0], lat=470000000, alt=1500,
                                     lon=85000000, vx=100, rollspeed=0.25))  # fmt: skip
    assert true.quaternion == (0.0, 1.0, 0.0, 0.0)
    assert true.position_deg_m == pytest.approx((47.0, 8.5, 1.5))
    assert (true.vel_ned_m_s[0], true.rate_frd_rad_s[0]) == (1.0, 0.25)


def decoded(name, payload):
    return coder().decode(bytearray(packed_payload(name, payload)))


# -- anything at all ---------------------------------------------------------------------------------------
@settings(max_examples=400, deadline=None)
@given(data=st.data(), name=st.sampled_from(sorted(CONVERTERS)))
def test_no_payload_yields_a_value_that_cannot_be(data, name):
    message = decoded(name, data.draw(arbitrary_payload(name)))
    context = data.draw(st.sampled_from([PX4, ARDUPILOT, COMPANION]))
    assert instance_of(message) >= 0
    for outcome in measurements(message, 1.0, context):
        if isinstance(outcome, Dropped):
            continue
        optional = OPTIONAL.get(outcome.sensor, frozenset())
        for column, value in enumerate(outcome.value):
            assert math.isfinite(value) or column in optional
        assert all(math.isnan(variance) or variance > 0.0 for variance in outcome.variance)
        assert 0.0 <= outcome.quality <= 255.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e30])
def test_attitude_angles_that_cannot_be(bad):
    reason = "out_of_range" if math.isfinite(bad) else "not_finite"
    assert drops(made("ATTITUDE", pitch=bad)) == [(Sensor.ATTITUDE, reason)]


@settings(max_examples=200, deadline=None)
@given(data=st.data(), name=st.sampled_from(["SIM_STATE", "HIL_STATE_QUATERNION", "LOCAL_POSITION_NED"]))
def test_no_payload_yields_a_state_that_cannot_be(data, name):
    convert = {"SIM_STATE": sim_state, "HIL_STATE_QUATERNION": hil_state_quaternion,
               "LOCAL_POSITION_NED": local_position_ned}[name]  # fmt: skip
    state = convert(decoded(name, data.draw(arbitrary_payload(name))))
    assert state is None or np.isfinite(np.concatenate([np.ravel(values) for values in state])).all()
