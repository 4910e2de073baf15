"""How a navigator starts: a first attitude, and a fix or the local origin."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, arctan2, equation, procedure
from flownav.estimation.covariance import lagged, place, states_of
from flownav.estimation.hypotheses import COUNT, begin_lane_anew
from flownav.estimation.states import ACCEL_BIAS, ATTITUDE, FORCE, POSITION, QUATERNION, RATE, STATE, STATES, VELOCITY
from flownav.frames import GRAVITY_M_S2, Quaternion, quaternion_from_euler, rotation_from_quaternion
from flownav.measurement import Sensor
from flownav.navigation.lagged_flow import start_lag
from flownav.navigation.memory import (
    SCALE_DOUBT,
    SOUGHT,
    STEADY_FORCE,
    load_aid,
    load_heading,
    load_imu,
    load_reading,
    load_start,
    set_lane,
    store_aid,
    store_imu,
    store_start,
)
from flownav.navigation.offers import is_heard
from flownav.navigation.packed import START_SIGMA, load_filter_settings, load_flow_settings
from flownav.navigation.place import ON_GROUND
from flownav.navigation.records import AidMemory, Reading, StartMemory
from flownav.navigation.tape import START, Output, write_event
from flownav.navigation.told import FROM_MAG, FROM_YAW, NO_HEADING, Equipment
from flownav.navigation.vibration import with_reading

ORIGIN_SIGMA_M = 0.1  # the local origin, where the navigator's start defines it
LOST_SIGMA_M = 10.0  # the same where the log's fixes define it and came too late, and about a first fix
READ_TILT_RAD = 0.03  # an attitude that was read
STANDING_TILT_RAD = 0.07  # of a vehicle that stands, or hovers, before anything is read: 4 deg
LEVELLED_FLOOR_RAD = 0.005  # of one from the accelerometer
READ_HEADING_RAD = 0.1  # an autopilot's, whose compass is calibrated
UNKNOWN_RAD = 1.5  # one that is to be found from the course
COMPASS_HEADING_RAD = 0.3  # a raw magnetometer's
DATUM_HEADING_RAD = 1e-3  # the start defines the frame
UNTOLD_HEADING_RAD = 1.0  # the first heading that is told will
LEAST_LEVELLING, MOST_LEVELLING = 5.0, 100.0


@equation
def levelled(reading: Reading, m: StartMemory) -> StartMemory:
    """The mean specific force [m/s2], and how it is shaken, with one reading more."""
    share = 1.0 / min(m.readings + 1.0, MOST_LEVELLING)
    x, y, z = reading.value_3 - m.force_x, reading.value_4 - m.force_y, reading.value_5 - m.force_z
    square = (x * x + y * y + z * z) / 3.0 if m.readings > 0.0 else 0.0
    return StartMemory(
        m.started, m.attitude_s, m.qw, m.qx, m.qy, m.qz,
        m.force_x + share * x, m.force_y + share * y, m.force_z + share * z, m.readings + 1.0,
        m.shaken + share * (square - m.shaken),
    )  # fmt: skip


@procedure
def gather(work: Work, lanes: Lanes, t_s: float, sensor: int) -> None:
    """Before the start: the latest attitude, IMU reading, and the mean specific force."""
    for lane in range(len(lanes)):
        m, reading = load_start(work, lanes, lane), load_reading(work, lanes, lane)
        if m.started > 0.0 or reading.arrived == 0.0:
            continue
        if sensor == Sensor.ATTITUDE:
            square = reading.value_0**2 + reading.value_1**2 + reading.value_2**2 + reading.value_3**2
            size = np.sqrt(square)
            if size > 0.5 and size < 2.0:
                w, x, y, z = reading.value_0, reading.value_1, reading.value_2, reading.value_3
                after = StartMemory(
                    0.0,
                    t_s,
                    w / size,
                    x / size,
                    y / size,
                    z / size,
                    m.force_x,
                    m.force_y,
                    m.force_z,
                    m.readings,
                    m.shaken,
                )
                store_start(work, lanes, lane, after)
        elif sensor == Sensor.IMU:
            gyro = reading.value_0 + reading.value_1 + reading.value_2
            if np.isfinite(gyro + reading.value_3 + reading.value_4 + reading.value_5):
                store_imu(work, lanes, lane, with_reading(reading, t_s, load_imu(work, lanes, lane)))
                store_start(work, lanes, lane, levelled(reading, m))


@procedure
def try_start(work: Work, lanes: Lanes, t_s: float, sensor: int, fitted: Equipment, p: Work, o: Output) -> bool:
    """Start lanes at a fix, or at the local origin with the first flow, pose or range where no fix came in time.

    Whether any lane runs.
    """
    running = False
    position = sensor == Sensor.GPS_POSITION
    other = sensor == Sensor.FLOW_RATE or sensor == Sensor.FLOW_VELOCITY or sensor == Sensor.POSE
    for lane in range(len(lanes)):
        m, reading = load_start(work, lanes, lane), load_reading(work, lanes, lane)
        if m.started == 0.0 and (np.isfinite(m.attitude_s) or m.readings >= LEAST_LEVELLING):
            heard = is_heard(reading) and bool(np.isfinite(reading.value_0))
            at_fix = heard and position and bool(np.isfinite(reading.value_0 + reading.value_1 + reading.value_2))
            stands = sensor == Sensor.LANDED and reading.value_0 > ON_GROUND
            at_origin = heard and (other or stands) and t_s >= fitted.deadline_s
            if at_fix or at_origin:
                start_lane(work, lanes, lane, t_s, at_fix, reading, m, fitted, p)
                write_event(lanes, lane, t_s, START, 1.0 if at_fix else 0.0, o)
        running = running or load_start(work, lanes, lane).started > 0.0
    return running


@procedure
def start_lane(
    work: Work, lanes: Lanes, lane: int, t_s: float, at_fix: bool, reading: Reading, m: StartMemory,
    fitted: Equipment, p: Work,
) -> None:  # fmt: skip
    """State and covariance of one lane at its first instant."""
    read = bool(np.isfinite(m.attitude_s))
    doubt_m_s2 = np.sqrt(p[START_SIGMA + ACCEL_BIAS] ** 2 + m.shaken)
    believed = STANDING_TILT_RAD**2 / (STANDING_TILT_RAD**2 + (doubt_m_s2 / GRAVITY_M_S2) ** 2)
    field_rad = load_heading(work, lanes, lane).field_rad
    w, x, y, z = (m.qw, m.qx, m.qy, m.qz) if read else level(m, believed, field_rad, fitted)
    work[QUATERNION * len(lanes) + lane] = w
    work[(QUATERNION + 1) * len(lanes) + lane] = x
    work[(QUATERNION + 2) * len(lanes) + lane] = y
    work[(QUATERNION + 3) * len(lanes) + lane] = z
    lost = bool(np.isfinite(fitted.deadline_s))
    for j in range(STATES):
        work[(STATE + j) * len(lanes) + lane] = 0.0
        for i in range(j):
            work[place(i, j) * len(lanes) + lane] = 0.0
        sigma = p[START_SIGMA + j]
        work[place(j, j) * len(lanes) + lane] = sigma * sigma
    start_lag(work, lanes, lagged(lanes), lane, p[START_SIGMA + VELOCITY], load_flow_settings(p))
    tilt = READ_TILT_RAD if read else STANDING_TILT_RAD * np.sqrt(1.0 - believed) + LEVELLED_FLOOR_RAD
    known = fitted.heading == NO_HEADING and not lost
    unknown = fitted.heading == NO_HEADING and lost and not read
    turned = DATUM_HEADING_RAD if known else (READ_HEADING_RAD if read else COMPASS_HEADING_RAD)
    turned = UNKNOWN_RAD if unknown else turned
    set_lane(work, lanes, SOUGHT, lane, 1.0 if unknown else 0.0)
    turned = UNTOLD_HEADING_RAD if fitted.heading == FROM_YAW and not np.isfinite(field_rad) else turned
    spread = LOST_SIGMA_M if lost else ORIGIN_SIGMA_M
    for i in range(3):  # of a motion before the start nothing is known
        work[(RATE + i) * len(lanes) + lane] = 0.0
        work[(FORCE + i) * len(lanes) + lane] = 0.0
        work[(STEADY_FORCE + i) * len(lanes) + lane] = 0.0
        work[place(POSITION + i, POSITION + i) * len(lanes) + lane] = spread * spread
        angle = turned if i == 2 else tilt
        work[place(ATTITUDE + i, ATTITUDE + i) * len(lanes) + lane] = angle * angle
    work[(STATE + POSITION) * len(lanes) + lane] = reading.value_0 if at_fix else 0.0
    work[(STATE + POSITION + 1) * len(lanes) + lane] = reading.value_1 if at_fix else 0.0
    work[(STATE + POSITION + 2) * len(lanes) + lane] = reading.value_2 if at_fix else 0.0
    for i in range(3):
        bias_variance = doubt_m_s2 * doubt_m_s2
        work[place(ACCEL_BIAS + i, ACCEL_BIAS + i) * len(lanes) + lane] = bias_variance
    if not read and m.readings >= LEAST_LEVELLING:
        rotation = rotation_from_quaternion(w, x, y, z)
        work[(STATE + ACCEL_BIAS) * len(lanes) + lane] = m.force_x + GRAVITY_M_S2 * rotation[6]
        work[(STATE + ACCEL_BIAS + 1) * len(lanes) + lane] = m.force_y + GRAVITY_M_S2 * rotation[7]
    for fault in range(COUNT):
        begin_lane_anew(work, lanes, states_of(lanes), fault, lane)
    doubted = 0.0 if lost else load_filter_settings(p).flow_scale_sigma
    set_lane(work, lanes, SCALE_DOUBT, lane, doubted)
    store_start(work, lanes, lane, started(m))
    aid = load_aid(work, lanes, lane)
    store_aid(work, lanes, lane, AidMemory(t_s, 0.0, aid.height_s, aid.landed))


@equation
def started(m: StartMemory) -> StartMemory:
    """The filter runs."""
    return StartMemory(
        1.0, m.attitude_s, m.qw, m.qx, m.qy, m.qz, m.force_x, m.force_y, m.force_z, m.readings, m.shaken
    )  # fmt: skip


@equation
def level(m: StartMemory, believed: float, field_rad: float, fitted: Equipment) -> Quaternion:
    """Roll and pitch from the mean specific force as far as it is believed (1: wholly); heading from the magnetometer
    or what is told as one where that was heard, else north.

    The field was noted in the axes of a vehicle that takes itself to be level and to head north.
    """
    roll = believed * arctan2(-m.force_y, -m.force_z)
    pitch = believed * arctan2(m.force_x, np.sqrt(m.force_y * m.force_y + m.force_z * m.force_z))
    heard = (fitted.heading == FROM_MAG or fitted.heading == FROM_YAW) and bool(np.isfinite(field_rad))
    north_rad = fitted.declination_rad if fitted.heading == FROM_MAG else 0.0
    return quaternion_from_euler(roll, pitch, north_rad - field_rad if heard else 0.0)
