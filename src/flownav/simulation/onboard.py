"""The sensors that a vehicle carries, on lanes: drawn before a flight, read by their own clocks, put into the ring."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.compile import equation, lane_access, procedure
from flownav.control.autopilot import AutopilotState
from flownav.estimation.kalman import Lanes, Work
from flownav.frames import rotation_from_quaternion, to_earth
from flownav.navigation.memory import Reading
from flownav.sensors.barometer import (
    BarometerParameters,
    BarometerStartNormals,
    BarometerTruth,
    BarometerUnit,
    draw_barometer,
    start_barometer,
    step_barometer,
)
from flownav.sensors.beam import BeamHit, Ground, beam_distance
from flownav.sensors.flow import FlowParameters
from flownav.sensors.flow_camera import (
    FlowCameraParameters,
    FlowCameraStartNormals,
    FlowCameraTruth,
    FlowCameraUnit,
    draw_flow_camera,
    pad_texture,
    start_flow_camera,
    step_flow_camera,
)
from flownav.sensors.gps_receiver import (
    GpsReceiverParameters,
    GpsReceiverStartNormals,
    GpsReceiverTruth,
    GpsReceiverUnit,
    draw_gps_receiver,
    start_gps_receiver,
    step_gps_receiver,
)
from flownav.sensors.inertial import (
    InertialParameters,
    InertialStartNormals,
    InertialUnit,
    draw_inertial,
    start_inertial,
    step_inertial,
)
from flownav.sensors.magnetometer import (
    MagnetometerParameters,
    MagnetometerUnit,
    draw_magnetometer,
    read_magnetometer,
)
from flownav.sensors.pad_camera import PadCameraParameters, PadCameraUnit, draw_pad_camera, read_pad_camera
from flownav.sensors.range_sensor import (
    RangeSensorParameters,
    RangeSensorUnit,
    draw_range_sensor,
    start_range_sensor,
    step_range_sensor,
)
from flownav.sensors.skid_switch import (
    SkidSwitchParameters,
    SkidSwitchUnit,
    draw_skid_switch,
    start_skid_switch,
    step_skid_switch,
)
from flownav.simulation import layout
from flownav.simulation.layout import (
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
    store_baro,
    store_baro_unit,
    store_camera,
    store_camera_unit,
    store_inertial,
    store_inertial_unit,
    store_mag_unit,
    store_pad_unit,
    store_range_unit,
    store_ranger,
    store_receiver,
    store_receiver_unit,
    store_skid,
    store_skid_unit,
)
from flownav.simulation.noise import normal_pair
from flownav.simulation.ring import put_slot, reading_of
from flownav.vehicle.state import HelicopterState

EPOCH_S = 0.02
PHYSICS_PERIOD_S = 0.002
LEAST_HEIGHT_M = 0.1
SETTLED_S = 2.0  # the skids take the weight as the collective goes down


class Clock(NamedTuple):
    """When a sensor reads: every so many epochs from the first on; fitted 0: the vehicle has none."""

    fitted: int
    every: int
    first: int


class Place(NamedTuple):
    """Where a sensor's lens is, from the centre of gravity, body FRD [m]."""

    forward_m: float
    right_m: float
    down_m: float


class Onboard(NamedTuple):
    """Every sensor's coefficients, clock and place, and the ground that they look at."""

    inertial: InertialParameters
    inertial_steps: int  # physics steps an inertial period
    receiver: GpsReceiverParameters
    receiver_clock: Clock
    receiver_offers_velocity: int
    flow: FlowParameters
    camera: FlowCameraParameters
    camera_clock: Clock
    camera_place: Place
    ranger: RangeSensorParameters
    range_clock: Clock
    range_place: Place
    baro: BarometerParameters
    baro_clock: Clock
    mag: MagnetometerParameters
    mag_clock: Clock
    pad: PadCameraParameters
    pad_clock: Clock
    pad_place: Place
    skid: SkidSwitchParameters
    skid_clock: Clock
    ground: Ground
    rotor_above_cg_m: float
    texture_everywhere: float  # 0: only the pad has texture
    pad_half_size_m: float


# channels of the noise counter, pairs of normals; below 40 lie those of wind and of the paper's sensors
INERTIAL_CHANNEL, RECEIVER_CHANNEL, CAMERA_CHANNEL, RANGE_CHANNEL = 40, 110, 120, 130
BARO_CHANNEL, MAG_CHANNEL, PAD_CHANNEL, SKID_CHANNEL = 136, 138, 142, 148
(INERTIAL_START, RECEIVER_START, CAMERA_START, RANGE_START, BARO_START, MAG_START, PAD_START, SKID_START) = (
    160, 175, 183, 190, 192, 196, 205, 208,
)  # fmt: skip


@procedure
def draw(
    work: Work, lanes: Lanes, row: int, count: int, seed: int, flight: int, step: int, channel: int
) -> None:
    """`count` (even) standard normals into rows from `row` on, of the channels from `channel` on."""
    for pair in range(count // 2):
        for lane in range(len(lanes)):
            first, second = normal_pair(seed, flight + lane, step, channel + pair)
            work[(row + 2 * pair) * len(lanes) + lane] = first
            work[(row + 2 * pair + 1) * len(lanes) + lane] = second


drawn_inertial_unit, _ = lane_access(InertialUnit, layout.DRAWN)
drawn_inertial_start, _ = lane_access(InertialStartNormals, layout.DRAWN)
drawn_receiver_unit, _ = lane_access(GpsReceiverUnit, layout.DRAWN)
drawn_receiver_start, _ = lane_access(GpsReceiverStartNormals, layout.DRAWN)
drawn_camera_unit, _ = lane_access(FlowCameraUnit, layout.DRAWN)
drawn_camera_start, _ = lane_access(FlowCameraStartNormals, layout.DRAWN)
drawn_range_unit, _ = lane_access(RangeSensorUnit, layout.DRAWN)
drawn_baro_unit, _ = lane_access(BarometerUnit, layout.DRAWN)
drawn_baro_start, _ = lane_access(BarometerStartNormals, layout.DRAWN)
drawn_mag_unit, _ = lane_access(MagnetometerUnit, layout.DRAWN)
drawn_pad_unit, _ = lane_access(PadCameraUnit, layout.DRAWN)
drawn_skid_unit, _ = lane_access(SkidSwitchUnit, layout.DRAWN)


# -- before the flight ----------------------------------------------------------------------------------------
@procedure
def start_onboard(work: Work, lanes: Lanes, seed: int, flight: int, step: int, s: Onboard) -> None:
    """Every unit as it is on this flight, and its state at rest or from its stationary distribution."""
    start_inertials(work, lanes, seed, flight, step, s)
    start_receivers(work, lanes, seed, flight, step, s)
    start_cameras(work, lanes, seed, flight, step, s)
    start_rest(work, lanes, seed, flight, step, s)


@procedure
def start_inertials(work: Work, lanes: Lanes, seed: int, flight: int, step: int, s: Onboard) -> None:
    """The inertial units."""
    draw(work, lanes, layout.DRAWN, 28, seed, flight, step, INERTIAL_START)
    for lane in range(len(lanes)):
        store_inertial_unit(work, lanes, lane, draw_inertial(drawn_inertial_unit(work, lanes, lane), s.inertial))
    draw(work, lanes, layout.DRAWN, 10, seed, flight, step + 1, INERTIAL_START)
    for lane in range(len(lanes)):
        store_inertial(work, lanes, lane, start_inertial(drawn_inertial_start(work, lanes, lane), s.inertial))


@procedure
def start_receivers(work: Work, lanes: Lanes, seed: int, flight: int, step: int, s: Onboard) -> None:
    """The GPS receivers."""
    draw(work, lanes, layout.DRAWN, 4, seed, flight, step, RECEIVER_START)
    for lane in range(len(lanes)):
        store_receiver_unit(work, lanes, lane, draw_gps_receiver(drawn_receiver_unit(work, lanes, lane), s.receiver))
    draw(work, lanes, layout.DRAWN, 10, seed, flight, step + 1, RECEIVER_START)
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        normals = drawn_receiver_start(work, lanes, lane)
        store_receiver(work, lanes, lane, start_gps_receiver(receiver_truth(state), rotation, normals, s.receiver))


@procedure
def start_cameras(work: Work, lanes: Lanes, seed: int, flight: int, step: int, s: Onboard) -> None:
    """The flow cameras."""
    draw(work, lanes, layout.DRAWN, 10, seed, flight, step, CAMERA_START)
    for lane in range(len(lanes)):
        store_camera_unit(work, lanes, lane, draw_flow_camera(drawn_camera_unit(work, lanes, lane), s.camera))
    draw(work, lanes, layout.DRAWN, 2, seed, flight, step + 1, CAMERA_START)
    for lane in range(len(lanes)):
        store_camera(work, lanes, lane, start_flow_camera(drawn_camera_start(work, lanes, lane), s.camera))


@procedure
def start_rest(work: Work, lanes: Lanes, seed: int, flight: int, step: int, s: Onboard) -> None:
    """Rangefinders, barometers, magnetometers, pad cameras and skid switches."""
    draw(work, lanes, layout.DRAWN, 2, seed, flight, step, RANGE_START)
    for lane in range(len(lanes)):
        store_range_unit(work, lanes, lane, draw_range_sensor(drawn_range_unit(work, lanes, lane), s.ranger))
        hit = beam_of(load_helicopter(work, lanes, lane), s.range_place, s.ground)
        store_ranger(work, lanes, lane, start_range_sensor(hit, s.ranger))
    draw(work, lanes, layout.DRAWN, 4, seed, flight, step, BARO_START)
    for lane in range(len(lanes)):
        store_baro_unit(work, lanes, lane, draw_barometer(drawn_baro_unit(work, lanes, lane), s.baro))
    draw(work, lanes, layout.DRAWN, 2, seed, flight, step + 1, BARO_START)
    for lane in range(len(lanes)):
        truth, unit = baro_truth(work, lanes, lane, s), load_baro_unit(work, lanes, lane)
        store_baro(work, lanes, lane, start_barometer(truth, unit, drawn_baro_start(work, lanes, lane), s.baro))
    draw(work, lanes, layout.DRAWN, 16, seed, flight, step, MAG_START)
    for lane in range(len(lanes)):
        store_mag_unit(work, lanes, lane, draw_magnetometer(drawn_mag_unit(work, lanes, lane), s.mag))
    draw(work, lanes, layout.DRAWN, 4, seed, flight, step, PAD_START)
    for lane in range(len(lanes)):
        store_pad_unit(work, lanes, lane, draw_pad_camera(drawn_pad_unit(work, lanes, lane), s.pad))
    draw(work, lanes, layout.DRAWN, 2, seed, flight, step, SKID_START)
    for lane in range(len(lanes)):
        store_skid_unit(work, lanes, lane, draw_skid_switch(drawn_skid_unit(work, lanes, lane), s.skid))
        load_n = work[layout.CONTACT * len(lanes) + lane]
        store_skid(work, lanes, lane, start_skid_switch(load_n, s.skid))


# -- what sensors see -----------------------------------------------------------------------------------------
@equation
def receiver_truth(state: HelicopterState) -> GpsReceiverTruth:
    """How the vehicle moves, as its GPS receiver feels it."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
    return GpsReceiverTruth(
        state.pos_n, state.pos_e, state.pos_d, vel_n, vel_e, vel_d, state.p, state.q, state.r
    )  # fmt: skip


@equation
def place_of(state: HelicopterState, place: Place) -> tuple[float, float, float]:
    """Where a lens is, NED [m]."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    arm = to_earth(rotation, place.forward_m, place.right_m, place.down_m)
    return state.pos_n + arm[0], state.pos_e + arm[1], state.pos_d + arm[2]


@equation
def beam_of(state: HelicopterState, place: Place, ground: Ground) -> BeamHit:
    """What a lens looks at along body down."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    north, east, down = place_of(state, place)
    return beam_distance(north, east, -down, rotation, ground)


@equation
def baro_truth(work: Work, lanes: Lanes, lane: int, s: Onboard) -> BarometerTruth:
    """Altitude, height of the rotor, and its thrust."""
    state = load_helicopter(work, lanes, lane)
    return BarometerTruth(
        -state.pos_d, s.rotor_above_cg_m - state.pos_d, work[layout.THRUST * len(lanes) + lane]
    )


@equation
def due(clock: Clock, epoch: int) -> bool:
    """Whether a sensor reads in this epoch."""
    return clock.fitted > 0 and epoch >= clock.first and (epoch - clock.first) % clock.every == 0


# -- readings -------------------------------------------------------------------------------------------------
@procedure
def sample(
    work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slots: int, taken: int, s: Onboard
) -> int:
    """Every sensor whose clock says so, but the inertial one, in the order of `schedule`; how many were taken by now."""
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
            load_receiver(work, lanes, lane), load_receiver_unit(work, lanes, lane), receiver_truth(state), rotation,
            load_receiver_normals(work, lanes, lane), s.receiver,
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
            load_baro_normals(work, lanes, lane), s.baro,
        )  # fmt: skip
        store_baro(work, lanes, lane, after)
        put_slot(
            work, lanes, slot, lane, reading_of(read.alt_m, 0.0, 0.0, np.nan, np.nan, np.nan, read.quality, read.arrived)
        )


@procedure
def read_mag(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """A magnetic field."""
    draw(work, lanes, layout.MAG_NORMALS, 4, seed, flight, epoch, MAG_CHANNEL)
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        power_w, normals = work[layout.POWER * len(lanes) + lane], load_mag_normals(work, lanes, lane)
        read = read_magnetometer(load_mag_unit(work, lanes, lane), rotation, power_w, normals, s.mag)
        x, y, z = read.mag_x_gauss, read.mag_y_gauss, read.mag_z_gauss
        put_slot(work, lanes, slot, lane, reading_of(x, y, z, np.nan, np.nan, np.nan, read.quality, read.arrived))


@procedure
def read_range(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """A distance along the boresight."""
    draw(work, lanes, layout.RANGE_NORMALS, 6, seed, flight, epoch, RANGE_CHANNEL)
    for lane in range(len(lanes)):
        hit = beam_of(load_helicopter(work, lanes, lane), s.range_place, s.ground)
        after, read = step_range_sensor(
            load_ranger(work, lanes, lane), load_range_unit(work, lanes, lane), hit,
            load_range_normals(work, lanes, lane), s.ranger,
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
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        hit = beam_of(state, s.camera_place, s.ground)
        north, east, down = place_of(state, s.camera_place)
        on_pad = pad_texture(north, east, -down, rotation, s.pad_half_size_m, s.flow)
        row = layout.EXPOSED
        truth = FlowCameraTruth(
            s.flow.gain * flow.u1, s.flow.gain * flow.v1, s.flow.gain * flow.w1,
            share * work[row * len(lanes) + lane], share * work[(row + 1) * len(lanes) + lane],
            share * work[(row + 2) * len(lanes) + lane],
            hit.distance_m, -down, rotation[8], 1.0 if s.texture_everywhere > 0.5 else on_pad,
        )  # fmt: skip
        after, read = step_flow_camera(
            load_camera(work, lanes, lane), load_camera_unit(work, lanes, lane), truth,
            load_camera_normals(work, lanes, lane), s.flow, s.camera,
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
    """A fix of the pad."""
    draw(work, lanes, layout.PAD_NORMALS, 8, seed, flight, epoch, PAD_CHANNEL)
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        north, east, down = place_of(state, s.pad_place)
        speed = np.sqrt(state.u * state.u + state.v * state.v)
        image_rate = speed / (-down if -down > LEAST_HEIGHT_M else LEAST_HEIGHT_M)
        fix = read_pad_camera(
            load_pad_unit(work, lanes, lane), north, east, down, rotation, image_rate,
            load_pad_normals(work, lanes, lane), s.pad,
        )  # fmt: skip
        reading = reading_of(
            fix.tan_forward, fix.tan_right, fix.distance_m, fix.forward_variance, fix.right_variance,
            fix.distance_variance_m2, fix.quality, fix.arrived,
        )  # fmt: skip
        put_slot(work, lanes, slot, lane, reading)


@procedure
def read_skid(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """The skid switch, and what the vehicle says of it: on the ground, not about to fly, and settled."""
    draw(work, lanes, layout.SKID_NORMALS, 2, seed, flight, epoch, SKID_CHANNEL)
    for lane in range(len(lanes)):
        load_n = work[layout.CONTACT * len(lanes) + lane]
        after, read = step_skid_switch(
            load_skid(work, lanes, lane), load_skid_unit(work, lanes, lane), load_n,
            load_skid_normals(work, lanes, lane), s.skid,
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
            load_inertial_normals(work, lanes, lane), s.inertial,
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
