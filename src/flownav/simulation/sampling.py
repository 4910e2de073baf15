"""The sensors' readings on lanes, by their own clocks, put into the ring in the order of `schedule`."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, procedure
from flownav.frames import rotation_from_quaternion
from flownav.measurement import Sensor
from flownav.navigation.records import Reading
from flownav.sensors.barometer import step_barometer
from flownav.sensors.beam import ground_height
from flownav.sensors.flow_camera import FlowCameraTruth, pad_texture, step_flow_camera
from flownav.sensors.gps_receiver import step_gps_receiver
from flownav.sensors.inertial import step_inertial
from flownav.sensors.magnetometer import read_magnetometer
from flownav.sensors.range_sensor import step_range_sensor
from flownav.simulation import layout
from flownav.simulation.draws import (
    BARO_CHANNEL,
    CAMERA_CHANNEL,
    INERTIAL_CHANNEL,
    MAG_CHANNEL,
    RANGE_CHANNEL,
    RECEIVER_CHANNEL,
    draw,
)
from flownav.simulation.failing import Taken, strike
from flownav.simulation.landing_sensors import note_seen, read_pad, read_skid
from flownav.simulation.layout import (
    baro_as_is,
    camera_as_is,
    camera_flow_as_is,
    ground_as_is,
    inertial_as_is,
    late_as_is,
    load_baro,
    load_baro_normals,
    load_baro_unit,
    load_camera,
    load_camera_normals,
    load_camera_unit,
    load_flow,
    load_helicopter,
    load_inertial,
    load_inertial_normals,
    load_inertial_unit,
    load_mag_normals,
    load_mag_unit,
    load_range_normals,
    load_range_unit,
    load_ranger,
    load_receiver,
    load_receiver_normals,
    load_receiver_unit,
    load_true_imu,
    mag_as_is,
    ranger_as_is,
    receiver_as_is,
    store_baro,
    store_camera,
    store_inertial,
    store_ranger,
    store_receiver,
)
from flownav.simulation.onboard import (
    EPOCH_S,
    PHYSICS_PERIOD_S,
    Clock,
    Onboard,
    baro_truth,
    beam_of,
    earlier,
    place_of,
    receiver_truth,
)
from flownav.simulation.ring import put_slot, reading_of


@equation
def due(clock: Clock, epoch: int) -> bool:
    """Whether a sensor reads in this epoch."""
    return clock.fitted > 0 and epoch >= clock.first and (epoch - clock.first) % clock.every == 0


@procedure
def sample(
    work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slots: int, taken: int, s: Onboard, fails: bool | None
) -> int:
    """Every sensor whose clock says so, but the inertial one, in the order of `schedule`; how many were taken."""
    if due(s.receiver_clock, epoch):
        read_receiver(work, lanes, seed, flight, epoch, slots, taken, s)
        if fails is not None:
            strike_one(work, lanes, seed, flight, epoch, taken % slots, Sensor.GPS_POSITION, 0, s.receiver_clock)
            if s.receiver_offers_velocity > 0:
                following = (taken + 1) % slots
                strike_one(work, lanes, seed, flight, epoch, following, Sensor.GPS_VELOCITY, 1, s.receiver_clock)
        taken += 2 if s.receiver_offers_velocity > 0 else 1
    if due(s.baro_clock, epoch):
        read_baro(work, lanes, seed, flight, epoch, taken % slots, s)
        if fails is not None:
            strike_one(work, lanes, seed, flight, epoch, taken % slots, Sensor.BARO, 2, s.baro_clock)
        taken += 1
    if due(s.mag_clock, epoch):
        read_mag(work, lanes, seed, flight, epoch, taken % slots, s)
        if fails is not None:
            strike_one(work, lanes, seed, flight, epoch, taken % slots, Sensor.MAG, 3, s.mag_clock)
        taken += 1
    if due(s.range_clock, epoch):
        read_range(work, lanes, seed, flight, epoch, taken % slots, s)
        if fails is not None:
            strike_one(work, lanes, seed, flight, epoch, taken % slots, Sensor.RANGE, 4, s.range_clock)
        taken += 1
    if due(s.camera_clock, epoch):
        read_camera(work, lanes, seed, flight, epoch, taken % slots, s)
        if fails is not None:
            strike_one(work, lanes, seed, flight, epoch, taken % slots, Sensor.FLOW_RATE, 5, s.camera_clock)
        taken += 1
    if due(s.pad_clock, epoch):
        read_pad(work, lanes, seed, flight, epoch, taken % slots, s)
        if fails is not None:
            strike_one(work, lanes, seed, flight, epoch, taken % slots, Sensor.PAD, 6, s.pad_clock)
        note_seen(work, lanes, taken % slots)
        taken += 1
    if due(s.skid_clock, epoch):
        read_skid(work, lanes, seed, flight, epoch, taken % slots, s)
        if fails is not None:
            strike_one(work, lanes, seed, flight, epoch, taken % slots, Sensor.LANDED, 7, s.skid_clock)
        taken += 1
    return taken


@equation
def strike_one(
    work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, sensor: int, channel: int, clock: Clock
) -> None:
    """A reading that was just taken as each lane's fault has it."""
    taken = Taken(epoch, epoch * EPOCH_S, slot, sensor, channel, epoch // clock.every)
    strike(work, lanes, seed, flight, taken)


@procedure
def read_receiver(
    work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slots: int, taken: int, s: Onboard
) -> None:
    """A fix: position and, where it is offered, velocity, a slot each."""
    draw(work, lanes, layout.RECEIVER_NORMALS, 16, seed, flight, epoch, RECEIVER_CHANNEL)
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        after, fix = step_gps_receiver(
            load_receiver(work, lanes, lane), load_receiver_unit(work, lanes, lane), 
            receiver_truth(state, late_as_is(work, lanes, lane).receiver_s), rotation,
            load_receiver_normals(work, lanes, lane), receiver_as_is(work, lanes, lane),
        )  # fmt: skip
        store_receiver(work, lanes, lane, after)
        level, down = fix.horizontal_variance_m2, fix.vertical_variance_m2
        position = reading_of(fix.pos_n_m, fix.pos_e_m, fix.pos_d_m, level, level, down, fix.quality, fix.arrived)
        put_slot(work, lanes, taken % slots, lane, position)
        if s.receiver_offers_velocity > 0:
            speed = fix.speed_variance_m2_s2
            velocity = reading_of(
                fix.vel_n_m_s, fix.vel_e_m_s, fix.vel_d_m_s, speed, speed, speed, fix.quality, fix.arrived
            )
            put_slot(work, lanes, (taken + 1) % slots, lane, velocity)


@procedure
def read_baro(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """A pressure altitude."""
    draw(work, lanes, layout.BARO_NORMALS, 2, seed, flight, epoch, BARO_CHANNEL)
    for lane in range(len(lanes)):
        after, read = step_barometer(
            load_baro(work, lanes, lane), load_baro_unit(work, lanes, lane), baro_truth(work, lanes, lane, s),
            load_baro_normals(work, lanes, lane), baro_as_is(work, lanes, lane),
        )  # fmt: skip
        store_baro(work, lanes, lane, after)
        altitude = reading_of(read.alt_m, 0.0, 0.0, np.nan, np.nan, np.nan, read.quality, read.arrived)
        put_slot(work, lanes, slot, lane, altitude)


@procedure
def read_mag(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """A magnetic field."""
    draw(work, lanes, layout.MAG_NORMALS, 4, seed, flight, epoch, MAG_CHANNEL)
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        power_w, normals = work[layout.POWER * len(lanes) + lane], load_mag_normals(work, lanes, lane)
        unit, sensor = load_mag_unit(work, lanes, lane), mag_as_is(work, lanes, lane)
        read = read_magnetometer(unit, rotation, power_w, normals, sensor)
        x, y, z = read.mag_x_gauss, read.mag_y_gauss, read.mag_z_gauss
        put_slot(work, lanes, slot, lane, reading_of(x, y, z, np.nan, np.nan, np.nan, read.quality, read.arrived))


@procedure
def read_range(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """A distance along the boresight."""
    draw(work, lanes, layout.RANGE_NORMALS, 6, seed, flight, epoch, RANGE_CHANNEL)
    for lane in range(len(lanes)):
        seen = earlier(load_helicopter(work, lanes, lane), late_as_is(work, lanes, lane).range_s)
        hit = beam_of(seen, s.range_place, ground_as_is(work, lanes, lane))
        after, read = step_range_sensor(
            load_ranger(work, lanes, lane), load_range_unit(work, lanes, lane), hit,
            load_range_normals(work, lanes, lane), ranger_as_is(work, lanes, lane),
        )  # fmt: skip
        store_ranger(work, lanes, lane, after)
        distance = reading_of(read.range_m, 0.0, 0.0, np.nan, np.nan, np.nan, read.quality, read.arrived)
        put_slot(work, lanes, slot, lane, distance)


@procedure
def read_camera(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """Angular flow over the exposure, with the sensor's own gyro and the vehicle's over the same time beside it."""
    draw(work, lanes, layout.CAMERA_NORMALS, 12, seed, flight, epoch, CAMERA_CHANNEL)
    share = s.inertial_steps * PHYSICS_PERIOD_S / (s.camera_clock.every * EPOCH_S)  # of the exposure, an IMU period
    for lane in range(len(lanes)):
        state, flow = load_helicopter(work, lanes, lane), load_flow(work, lanes, lane)
        sensor, late_s = camera_flow_as_is(work, lanes, lane), late_as_is(work, lanes, lane).flow_s
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        ground = ground_as_is(work, lanes, lane)
        hit = beam_of(state, s.camera_place, ground)
        north, east, down = place_of(state, s.camera_place)
        height_m = -down - ground_height(north, east, ground)
        on_pad = pad_texture(north, east, height_m, rotation, s.pad_half_size_m, sensor)
        row = layout.EXPOSED
        truth = FlowCameraTruth(
            sensor.gain * (flow.u1 - late_s * flow.u2), sensor.gain * (flow.v1 - late_s * flow.v2),
            sensor.gain * (flow.w1 - late_s * flow.w2),
            share * work[row * len(lanes) + lane], share * work[(row + 1) * len(lanes) + lane],
            share * work[(row + 2) * len(lanes) + lane],
            hit.distance_m, height_m, rotation[8], 1.0 if s.texture_everywhere > 0.5 else on_pad,
        )  # fmt: skip
        after, read = step_flow_camera(
            load_camera(work, lanes, lane), load_camera_unit(work, lanes, lane), truth,
            load_camera_normals(work, lanes, lane), sensor, camera_as_is(work, lanes, lane),
        )  # fmt: skip
        store_camera(work, lanes, lane, after)
        reading = Reading(
            read.flow_x_rad_s, read.flow_y_rad_s, read.gyro_x_rad_s, read.gyro_y_rad_s,
            share * work[(row + 3) * len(lanes) + lane], share * work[(row + 4) * len(lanes) + lane],
            np.nan, np.nan, np.nan, read.quality, read.arrived, 0.0,
        )  # fmt: skip
        put_slot(work, lanes, slot, lane, reading)
        work[layout.SEES_FLOW * len(lanes) + lane] = 1.0 if read.quality > 0.0 else 0.0
        for i in range(5):
            work[(row + i) * len(lanes) + lane] = 0.0


@procedure
def read_inertial(
    work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, part: int, slot: int, s: Onboard
) -> None:
    """The inertial reading of the period that ends now, the `part`-th of the epoch."""
    channel = INERTIAL_CHANNEL + 6 * part
    draw(work, lanes, layout.INERTIAL_NORMALS, 12, seed, flight, epoch, channel)
    for lane in range(len(lanes)):
        truth = load_true_imu(work, lanes, lane)
        after, read = step_inertial(
            load_inertial(work, lanes, lane), load_inertial_unit(work, lanes, lane), truth,
            load_inertial_normals(work, lanes, lane), inertial_as_is(work, lanes, lane),
        )  # fmt: skip
        store_inertial(work, lanes, lane, after)
        reading = Reading(
            read.gyro_x_rad_s, read.gyro_y_rad_s, read.gyro_z_rad_s, read.accel_x_m_s2, read.accel_y_m_s2,
            read.accel_z_m_s2, np.nan, np.nan, np.nan, read.quality, read.arrived, 0.0,
        )  # fmt: skip
        put_slot(work, lanes, slot, lane, reading)
        row = layout.EXPOSED
        work[row * len(lanes) + lane] += truth.gyro_x_rad_s
        work[(row + 1) * len(lanes) + lane] += truth.gyro_y_rad_s
        work[(row + 2) * len(lanes) + lane] += truth.gyro_z_rad_s
        work[(row + 3) * len(lanes) + lane] += read.gyro_x_rad_s
        work[(row + 4) * len(lanes) + lane] += read.gyro_y_rad_s
