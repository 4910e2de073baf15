"""Attitude and heading readings: an external attitude where there is no IMU, a magnetometer, an external heading."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, arctan2, equation, larger, procedure
from flownav.estimation.covariance import consider, consider_none, variance_of
from flownav.estimation.hypotheses import HEADING_OFF, sign_all
from flownav.estimation.laws.attitude import attitude, bridged_attitude, heading, level
from flownav.estimation.laws.geometry import component
from flownav.estimation.motion import rotation_of
from flownav.estimation.states import (
    ATTITUDE,
    CONSIDERS,
    FLOW_LAG,
    GYRO_BIAS,
    INNOVATION,
    INS_ERROR,
    MEASURED,
    QUATERNION,
)
from flownav.frames import heading_from_quaternion, quaternion_product, rotation_from_quaternion, to_earth
from flownav.navigation.memory import (
    AIDED,
    COMPASS_OFF,
    LEVEL_READ,
    OBSERVATION,
    load_aid,
    load_bridge,
    load_heading,
    load_imu,
    load_reading,
    load_start,
    share,
    shared,
    store_bridge,
    store_heading,
    store_imu,
)
from flownav.navigation.offers import conclude, is_heard, put, usable_in_flight
from flownav.navigation.packed import load_attitude_settings
from flownav.navigation.reasons import FUSED, NO_HEADING, NOT_FINITE, SILENT
from flownav.navigation.records import BridgeMemory, HeadingMemory, ImuMemory, Reading
from flownav.navigation.tape import Output
from flownav.navigation.told import FROM_ATTITUDE, FROM_YAW, AttitudeSettings, Equipment

LEAST_FIELD_GAUSS = 1e-3
BRIDGE_SIGMA_RAD = 0.02
LEAST_STEP_S = 1e-3


# -- an external attitude -----------------------------------------------------------------------------------
@equation
def judge_attitude(reading: Reading, started: float) -> tuple[int, float]:
    """The verdict on a quaternion, and its length."""
    size = np.sqrt(reading.value_0**2 + reading.value_1**2 + reading.value_2**2 + reading.value_3**2)
    reason = usable_in_flight(reading, size, 0.0, started)
    sound = size > 0.5 and size < 2.0
    return NOT_FINITE if reason == FUSED and not sound else reason, size


@procedure
def take_attitude(work: Work, lanes: Lanes, t_s: float, sensor: int, fitted: Equipment, p: Work, o: Output) -> None:
    """An autopilot's or INS's attitude: all of it where no IMU serves, its heading where nothing else gives one."""
    s = load_attitude_settings(p)
    if fitted.use_attitude:
        for axis in range(3):
            put_attitude(work, lanes, s.ins_tilt_white_rad * s.ins_tilt_white_rad)
            attitude(work, lanes, axis)
            for lane in range(len(lanes)):
                work[OBSERVATION * len(lanes) + lane] = work[INNOVATION * len(lanes) + lane]
            conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)
        return
    bridge(work, lanes, t_s, sensor, s, o)
    if fitted.heading == FROM_ATTITUDE:
        for lane in range(len(lanes)):
            reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
            reason, size = judge_attitude(reading, started)
            w, x = reading.value_0 / size, reading.value_1 / size
            y, z = reading.value_2 / size, reading.value_3 / size
            read = heading_from_quaternion(w, x, y, z)
            put_heading(work, lanes, lane, t_s, read, np.nan, SILENT if reason != FUSED else reason, s)
        heading(work, lanes, 0)
        sign_all(work, lanes, HEADING_OFF, 1.0)
        conclude(work, lanes, t_s, sensor, 0, s.gate_sigma, o)
    take_level(work, lanes, t_s, sensor, s, o)


@procedure
def take_level(work: Work, lanes: Lanes, t_s: float, sensor: int, s: AttitudeSettings, o: Output) -> None:
    """Where an external attitude puts down, beside an IMU. While something horizontal aids the filter, it tells the
    reading's slow error and nothing else; where nothing does it is taken.
    """
    smoothing = work[CONSIDERS * len(lanes)] == 0.0  # no state is merely considered then: it would move them all
    if smoothing or t_s - shared(work, lanes, LEVEL_READ) < s.ins_tilt_time_s:
        return
    share(work, lanes, LEVEL_READ, t_s)
    consider_aided(work, lanes)
    for axis in range(2):
        put_level(work, lanes, axis, s.ins_tilt_white_rad * s.ins_tilt_white_rad)
        level(work, lanes, axis)
        for lane in range(len(lanes)):
            work[OBSERVATION * len(lanes) + lane] = work[INNOVATION * len(lanes) + lane]
        conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)


@equation
def consider_aided(work: Work, lanes: Lanes) -> None:
    """An aided filter knows its motion better than the autopilot's attitude does; and down tells no heading."""
    for lane in range(len(lanes)):
        work[AIDED * len(lanes) + lane] = 1.0 if load_aid(work, lanes, lane).flag < 2.0 else 0.0
    consider_none(work, lanes)
    for state in range(FLOW_LAG):
        heads = state == ATTITUDE + 2 or state == GYRO_BIAS + 2 or state == INS_ERROR + 2
        if state != INS_ERROR and state != INS_ERROR + 1:
            consider(work, lanes, state, 0 if heads else AIDED)


@equation
def put_level(work: Work, lanes: Lanes, axis: int, variance: float) -> None:
    """Down by the quaternion that was read, along a body axis, in the lanes where it is one; the others are silent."""
    for lane in range(len(lanes)):
        reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
        reason, size = judge_attitude(reading, started)
        w, x = reading.value_0 / size, reading.value_1 / size
        y, z = reading.value_2 / size, reading.value_3 / size
        rotation = rotation_from_quaternion(w, x, y, z)
        down = component((rotation[6], rotation[7], 0.0), axis)
        put(work, lanes, lane, down, variance, SILENT if reason != FUSED else reason)


@equation
def put_attitude(work: Work, lanes: Lanes, variance: float) -> None:
    """The quaternion that was read, of unit length, in the lanes where it is one; the others are silent."""
    for lane in range(len(lanes)):
        reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
        reason, size = judge_attitude(reading, started)
        put(work, lanes, lane, reading.value_0 / size, variance, SILENT if reason != FUSED else reason)
        work[(MEASURED + 1) * len(lanes) + lane] = reading.value_1 / size
        work[(MEASURED + 2) * len(lanes) + lane] = reading.value_2 / size
        work[(MEASURED + 3) * len(lanes) + lane] = reading.value_3 / size


@procedure
def bridge(work: Work, lanes: Lanes, t_s: float, sensor: int, s: AttitudeSettings, o: Output) -> None:
    """Across a gap of the IMU the filter turns as the read attitude did: q_before conj(read_before) read, measured.

    Its variance is what the filter's was before the gap, and BRIDGE_SIGMA_RAD for the time between the two.
    """
    crossed = False
    for lane in range(len(lanes)):
        crossed = note_bridge(work, lanes, lane) or crossed
    if not crossed:
        return
    for axis in range(3):
        put_bridged(work, lanes, axis)
        bridged_attitude(work, lanes, axis)
        for lane in range(len(lanes)):
            work[OBSERVATION * len(lanes) + lane] = work[INNOVATION * len(lanes) + lane]
        conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)
    for lane in range(len(lanes)):
        m = load_imu(work, lanes, lane)
        store_imu(work, lanes, lane, bridged(m))


@equation
def bridged(m: ImuMemory) -> ImuMemory:
    """No gap is open any more."""
    return ImuMemory(
        m.read_s, m.gyro_x, m.gyro_y, m.gyro_z, m.accel_x, m.accel_y, m.accel_z, m.vibration, m.doubt_m_s2, 0.0
    )


@procedure
def note_bridge(work: Work, lanes: Lanes, lane: int) -> bool:
    """Without a gap the filter's attitude and the read one are noted; whether this lane has a gap to cross."""
    reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
    reason, size = judge_attitude(reading, started)
    if reason != FUSED:
        return False
    if load_imu(work, lanes, lane).gap > 0.0:
        return True
    store_bridge(
        work, lanes, lane,
        BridgeMemory(
            work[QUATERNION * len(lanes) + lane], work[(QUATERNION + 1) * len(lanes) + lane],
            work[(QUATERNION + 2) * len(lanes) + lane], work[(QUATERNION + 3) * len(lanes) + lane],
            reading.value_0 / size, reading.value_1 / size, reading.value_2 / size, reading.value_3 / size,
            variance_of(work, lanes, ATTITUDE, lane), variance_of(work, lanes, ATTITUDE + 1, lane),
            variance_of(work, lanes, ATTITUDE + 2, lane),
        ),
    )  # fmt: skip
    return False


@procedure
def put_bridged(work: Work, lanes: Lanes, axis: int) -> None:
    """The attitude that the filter would have, had it turned over the gap as the read one did."""
    for lane in range(len(lanes)):
        reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
        reason, size = judge_attitude(reading, started)
        m = load_bridge(work, lanes, lane)
        open_gap = load_imu(work, lanes, lane).gap > 0.0 and np.isfinite(m.own_w) and reason == FUSED
        read = (reading.value_0 / size, reading.value_1 / size, reading.value_2 / size, reading.value_3 / size)
        back = (m.read_w, -m.read_x, -m.read_y, -m.read_z)
        turned = quaternion_product((m.own_w, m.own_x, m.own_y, m.own_z), quaternion_product(back, read))
        before = m.variance_n if axis == 0 else (m.variance_e if axis == 1 else m.variance_d)
        put(work, lanes, lane, turned[0], before + BRIDGE_SIGMA_RAD**2, FUSED if open_gap else SILENT)
        work[(MEASURED + 1) * len(lanes) + lane] = turned[1]
        work[(MEASURED + 2) * len(lanes) + lane] = turned[2]
        work[(MEASURED + 3) * len(lanes) + lane] = turned[3]


# -- headings -----------------------------------------------------------------------------------------------
@equation
def heading_variance(t_s: float, m: HeadingMemory, s: AttitudeSettings) -> float:
    """Variance of one heading [rad2] whose error lasts for many: 2 sigma^2 tau/dt, at least sigma^2."""
    step_s = larger(t_s - m.read_s, LEAST_STEP_S)
    return s.heading_noise_rad * s.heading_noise_rad * larger(1.0, 2.0 * s.heading_time_s / step_s)


@equation
def put_heading(
    work: Work, lanes: Lanes, lane: int, t_s: float, read_rad: float, stated: float, reason: int, s: AttitudeSettings
) -> None:
    """One lane's heading with the variance that is stated, or modelled from how often it is read."""
    m = load_heading(work, lanes, lane)
    modelled = not np.isfinite(stated)
    refuted = reason == FUSED and work[COMPASS_OFF * len(lanes) + lane] > 0.0
    reason = NO_HEADING if refuted else reason
    put(work, lanes, lane, read_rad, heading_variance(t_s, m, s) if modelled else stated, reason)
    store_heading(work, lanes, lane, HeadingMemory(t_s if modelled and reason != SILENT else m.read_s, m.field_rad))


@equation
def magnetic_heading(forward_n: float, forward_e: float, declination_rad: float, m: HeadingMemory) -> float:
    """The heading that the latest level field and the filter's tilt give, from true north [rad]."""
    angle: float = arctan2(forward_e, forward_n) - m.field_rad + declination_rad
    return angle


@procedure
def take_mag(work: Work, lanes: Lanes, t_s: float, sensor: int, fitted: Equipment, p: Work, o: Output) -> None:
    """A magnetometer: the level field points to magnetic north."""
    s = load_attitude_settings(p)
    for lane in range(len(lanes)):
        reading, start = load_reading(work, lanes, lane), load_start(work, lanes, lane)
        started = start.started
        waiting = rotation_from_quaternion(start.qw, start.qx, start.qy, start.qz)
        rotation = rotation_of(work, lanes, lane) if started > 0.0 else waiting
        north, east, _ = to_earth(rotation, reading.value_0, reading.value_1, reading.value_2)
        level = np.sqrt(north * north + east * east)
        m = load_heading(work, lanes, lane)
        seen = reading.arrived > 0.0 and level > LEAST_FIELD_GAUSS
        m = HeadingMemory(m.read_s, arctan2(east, north) if seen else m.field_rad)
        store_heading(work, lanes, lane, m)
        reason = usable_in_flight(reading, level, 0.0, started)
        read = magnetic_heading(rotation[0], rotation[3], fitted.declination_rad, m)
        put_heading(work, lanes, lane, t_s, read, np.nan, reason if seen else SILENT, s)
    heading(work, lanes, 0)
    sign_all(work, lanes, HEADING_OFF, 1.0)
    conclude(work, lanes, t_s, sensor, 0, s.gate_sigma, o)


@procedure
def take_yaw(work: Work, lanes: Lanes, t_s: float, sensor: int, fitted: Equipment, p: Work, o: Output) -> None:
    """An external heading; before the start it is noted as the angle to north, as that of a level field is."""
    s = load_attitude_settings(p)
    for lane in range(len(lanes)):
        reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
        reason = usable_in_flight(reading, reading.value_0, 0.0, started)
        heard = is_heard(reading)
        if started == 0.0 and heard and np.isfinite(reading.value_0) and fitted.heading == FROM_YAW:
            store_heading(work, lanes, lane, HeadingMemory(load_heading(work, lanes, lane).read_s, -reading.value_0))
        put_heading(work, lanes, lane, t_s, reading.value_0, reading.variance_0, reason, s)
    heading(work, lanes, 0)
    sign_all(work, lanes, HEADING_OFF, 1.0)
    conclude(work, lanes, t_s, sensor, 0, s.gate_sigma, o)
