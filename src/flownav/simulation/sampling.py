"""The sensors' readings on lanes, by their own clocks, put into the ring in the order of `schedule`."""

from __future__ import annotations

import numpy as np

from flownav.compile import equation, procedure, replacing
from flownav.control.autopilot import AutopilotState
from flownav.control.go_around import Knowledge
from flownav.estimation.kalman import Lanes, Work
from flownav.frames import rotation_from_quaternion
from flownav.navigation.records import Reading
from flownav.optics.shutter import image_rate_rad_s
from flownav.sensors.barometer import step_barometer
from flownav.sensors.flow_camera import FlowCameraTruth, pad_texture, step_flow_camera
from flownav.sensors.gps_receiver import step_gps_receiver
from flownav.sensors.inertial import step_inertial
from flownav.sensors.magnetometer import read_magnetometer
from flownav.sensors.pad_camera import read_pad_camera, stated_fix
from flownav.sensors.range_sensor import step_range_sensor
from flownav.sensors.skid_switch import step_skid_switch
from flownav.simulation import layout
from flownav.simulation.draws import (
    BARO_CHANNEL,
    CAMERA_CHANNEL,
    INERTIAL_CHANNEL,
    MAG_CHANNEL,
    PAD_CHANNEL,
    RANGE_CHANNEL,
    RECEIVER_CHANNEL,
    SKID_CHANNEL,
    draw,
)
from flownav.simulation.layout import (
    baro_as_is,
    camera_as_is,
    camera_flow_as_is,
    inertial_as_is,
    late_as_is,
    load_autopilot,
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
    load_known,
    load_mag_normals,
    load_mag_unit,
    load_pad_normals,
    load_pad_unit,
    load_range_normals,
    load_range_unit,
    load_ranger,
    load_receiver,
    load_receiver_normals,
    load_receiver_unit,
    load_skid,
    load_skid_normals,
    load_skid_unit,
    load_true_imu,
    mag_as_is,
    pad_as_is,
    ranger_as_is,
    receiver_as_is,
    skid_as_is,
    store_baro,
    store_camera,
    store_inertial,
    store_known,
    store_ranger,
    store_receiver,
    store_skid,
)
from flownav.simulation.onboard import (
    EPOCH_S,
    LEAST_HEIGHT_M,
    PAD_SEEN,
    PHYSICS_PERIOD_S,
    SETTLED_S,
    Clock,
    Onboard,
    baro_truth,
    beam_of,
    earlier,
    place_of,
    receiver_truth,
)
from flownav.simulation.ring import put_slot, reading_of

with_unseen = replacing(Knowledge, "pad_unseen_s")


@equation
def due(clock: Clock, epoch: int) -> bool:
    """Whether a sensor reads in this epoch."""
    return clock.fitted > 0 and epoch >= clock.first and (epoch - clock.first) % clock.every == 0


@procedure
def sample(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slots: int, taken: int, s: Onboard) -> int:
    """Every sensor whose clock says so, but the inertial one, in the order of `schedule`; how many were taken."""
    if due(s.receiver_clock, epoch):
        read_receiver(work, lanes, seed, flight, epoch, slots, taken, s)
        taken += 2 if s.receiver_offers_velocity > 0 else 1
    if due(s.baro_clock, epoch):
        read_baro(work, lanes, seed, flight, epoch, taken % slots, s)
        taken += 1
    if due(s.mag_clock, epoch):
        read_mag(work, lanes, seed, flight, epoch, taken % slots, s)
        taken += 1
    if due(s.range_clock, epoch):
        read_range(work, lanes, seed, flight, epoch, taken % slots, s)
        taken += 1
    if due(s.camera_clock, epoch):
        read_camera(work, lanes, seed, flight, epoch, taken % slots, s)
        taken += 1
    if due(s.pad_clock, epoch):
        read_pad(work, lanes, seed, flight, epoch, taken % slots, s)
        taken += 1
    if due(s.skid_clock, epoch):
        read_skid(work, lanes, seed, flight, epoch, taken % slots, s)
        taken += 1
    return taken


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
        hit = beam_of(seen, s.range_place, s.ground)
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
        hit = beam_of(state, s.camera_place, s.ground)
        north, east, down = place_of(state, s.camera_place)
        on_pad = pad_texture(north, east, -down, rotation, s.pad_half_size_m, sensor)
        row = layout.EXPOSED
        truth = FlowCameraTruth(
            sensor.gain * (flow.u1 - late_s * flow.u2), sensor.gain * (flow.v1 - late_s * flow.v2),
            sensor.gain * (flow.w1 - late_s * flow.w2),
            share * work[row * len(lanes) + lane], share * work[(row + 1) * len(lanes) + lane],
            share * work[(row + 2) * len(lanes) + lane],
            hit.distance_m, -down, rotation[8], 1.0 if s.texture_everywhere > 0.5 else on_pad,
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
        for i in range(5):
            work[(row + i) * len(lanes) + lane] = 0.0


@procedure
def read_pad(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """A fix of the pad: by the model, or what was seen in this frame where the flight's frames were rendered."""
    seen = (epoch - s.pad_clock.first) // s.pad_clock.every * PAD_SEEN
    draw(work, lanes, layout.PAD_NORMALS, 8, seed, flight, epoch, PAD_CHANNEL)
    for lane in range(len(lanes)):
        state = earlier(load_helicopter(work, lanes, lane), late_as_is(work, lanes, lane).pad_s)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        north, east, down = place_of(state, s.pad_place)
        above = -down if -down > LEAST_HEIGHT_M else LEAST_HEIGHT_M
        ahead, aside = image_rate_rad_s(state.u, state.v, state.p, state.q, above)
        rate = np.sqrt(ahead * ahead + aside * aside)
        fix = read_pad_camera(
            load_pad_unit(work, lanes, lane), north, east, down, rotation, rate,
            load_pad_normals(work, lanes, lane), pad_as_is(work, lanes, lane), s.pad,
        )  # fmt: skip
        if seen + PAD_SEEN <= len(s.pad_seen):
            shown_m = s.pad_seen[seen + 3]
            fix = stated_fix(
                load_pad_unit(work, lanes, lane), s.pad_seen[seen], s.pad_seen[seen + 1], s.pad_seen[seen + 2],
                1.0 if shown_m > 0.0 else 0.0, shown_m, rate, s.pad,
            )  # fmt: skip
        reading = reading_of(
            fix.tan_forward, fix.tan_right, fix.distance_m, fix.forward_variance, fix.right_variance,
            fix.distance_variance_m2, fix.quality, fix.arrived,
        )  # fmt: skip
        put_slot(work, lanes, slot, lane, reading)
        known = load_known(work, lanes, lane)
        unseen_s = 0.0 if fix.arrived > 0.0 else known.pad_unseen_s
        store_known(work, lanes, lane, with_unseen(known, pad_unseen_s=unseen_s))


@procedure
def read_skid(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """The skid switch, and what the vehicle says of it: on the ground, not about to fly, and settled."""
    draw(work, lanes, layout.SKID_NORMALS, 2, seed, flight, epoch, SKID_CHANNEL)
    for lane in range(len(lanes)):
        load_n = work[layout.CONTACT * len(lanes) + lane]
        after, read = step_skid_switch(
            load_skid(work, lanes, lane), load_skid_unit(work, lanes, lane), load_n,
            load_skid_normals(work, lanes, lane), skid_as_is(work, lanes, lane),
        )  # fmt: skip
        store_skid(work, lanes, lane, after)
        work[layout.LANDED * len(lanes) + lane] = read.landed
        landed = 1.0 if at_rest(read.landed, load_autopilot(work, lanes, lane)) else 0.0
        reading = reading_of(landed, 0.0, 0.0, np.nan, np.nan, np.nan, read.quality, read.arrived)
        put_slot(work, lanes, slot, lane, reading)


@equation
def at_rest(switch: float, autopilot: AutopilotState) -> bool:
    """The switch is closed, the autopilot does not fly, and after a landing the skids have taken the weight."""
    settled = autopilot.contact_time_s == 0.0 or autopilot.contact_time_s > SETTLED_S
    return switch > 0.5 and autopilot.flying == 0.0 and settled


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
