"""The sensors on lanes: each epoch's normals, and every reading taken from the plant's state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.compile import Lanes, Work, equation
from flownav.frames import quaternion_product, rotation_from_quaternion, to_body, to_earth
from flownav.sensors.angular_flow import angular_flow
from flownav.sensors.flow import FlowParameters, engage_flow, read_flow, start_flow
from flownav.sensors.gps_ins import (
    GpsInsParameters,
    GpsInsState,
    NavSolution,
    start_gps_ins,
    step_gps_ins,
)
from flownav.sensors.imu import ImuReading
from flownav.sensors.rangefinder import RangefinderParameters, start_rangefinder, step_rangefinder
from flownav.simulation import layout
from flownav.simulation.draws import stream_of
from flownav.simulation.layout import (
    flow_as_is,
    load_flow,
    load_gps,
    load_gps_errors,
    load_gps_held,
    load_gps_normals,
    load_helicopter,
    load_rangefinder,
    store_flow,
    store_gps,
    store_gps_errors,
    store_gps_held,
    store_rangefinder,
    vehicle_as_is,
)
from flownav.simulation.noise import normal_pair
from flownav.vehicle.helicopter import HelicopterState

EPOCH_S = 0.02  # the GPS/INS unit, the published flow and the filters: 50 Hz
RANGE_EPOCHS = 5  # the rangefinder: 10 Hz


class SensorSuite(NamedTuple):
    """Every sensor's parameters and where they look from."""

    gps: GpsInsParameters
    flow: FlowParameters
    rangefinder: RangefinderParameters
    lens_below_cg_m: float
    pad_half_size_m: float
    gps_offers_velocity: bool  # the unit's own velocity serves while the flow sensor is not engaged


class Draws(NamedTuple):
    """Which groups of normals a scenario needs (those of a silent sensor are not drawn)."""

    paper: bool  # the paper's GPS/INS, flow and sonar fly
    gps_drift: bool  # everything of the GPS/INS but the position's jitter
    wind: bool
    recirculation: bool


@equation
def draw_normals(work: Work, lanes: Lanes, first_row: int, end_row: int, seed: int, flight: int, step: int) -> None:
    """Fill the rows from first_row to end_row; the channel of a pair is its place among all normals."""
    for pair in range((end_row - first_row) // 2):
        row = first_row + 2 * pair
        channel = (row - layout.GPS_NORMALS) // 2
        for lane in range(len(lanes)):
            first, second = normal_pair(seed, stream_of(work, lanes, flight, lane), step, channel)
            work[row * len(lanes) + lane] = first
            work[(row + 1) * len(lanes) + lane] = second


@equation
def draw_epoch(work: Work, lanes: Lanes, seed: int, flight: int, step: int, draws: Draws) -> None:
    """Every normal of one epoch; `flight` is the index of the first lane's flight."""
    if draws.paper:
        draw_normals(work, lanes, layout.GPS_JITTER, layout.GPS_JITTER + 4, seed, flight, step)
        draw_normals(work, lanes, layout.FLOW_NORMALS, layout.WIND_NORMALS, seed, flight, step)
    if draws.gps_drift:
        draw_normals(work, lanes, layout.GPS_NORMALS, layout.GPS_JITTER, seed, flight, step)
        draw_normals(work, lanes, layout.GPS_JITTER + 4, layout.FLOW_NORMALS, seed, flight, step)
    if draws.wind:
        draw_normals(work, lanes, layout.WIND_NORMALS, layout.NORMALS_END, seed, flight, step)


@equation
def true_solution(state: HelicopterState) -> NavSolution:
    """What a perfect GPS/INS would report."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
    return NavSolution(
        state.pos_n, state.pos_e, state.pos_d, vel_n, vel_e, vel_d, state.qw, state.qx, state.qy, state.qz
    )


@equation
def lens_height(state: HelicopterState, cosine: float, lens_below_cg_m: float) -> float:
    """Height of the lens and the sonar above the ground [m]."""
    return -state.pos_d - lens_below_cg_m * cosine


@equation
def true_imu(work: Work, lanes: Lanes, lane: int, period_s: float, gravity_m_s2: float) -> ImuReading:
    """Means over the last period in body axes, as an integrating IMU has them.

    Rate: the turn q0* q1 as a vector, over dt. Specific force: delta v / dt - g in the attitude of the middle.
    """
    state = load_helicopter(work, lanes, lane)
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
    row = layout.PREVIOUS_VELOCITY
    accel_n = (vel_n - work[row * len(lanes) + lane]) / period_s
    accel_e = (vel_e - work[(row + 1) * len(lanes) + lane]) / period_s
    accel_d = (vel_d - work[(row + 2) * len(lanes) + lane]) / period_s
    work[row * len(lanes) + lane] = vel_n
    work[(row + 1) * len(lanes) + lane] = vel_e
    work[(row + 2) * len(lanes) + lane] = vel_d
    row = layout.PREVIOUS_ATTITUDE
    w, x = work[row * len(lanes) + lane], work[(row + 1) * len(lanes) + lane]
    y, z = work[(row + 2) * len(lanes) + lane], work[(row + 3) * len(lanes) + lane]
    turn = quaternion_product((w, -x, -y, -z), (state.qw, state.qx, state.qy, state.qz))
    half_square = turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3]
    per_s = 2.0 * (1.0 + half_square / 6.0) / period_s
    w, x, y, z = w + state.qw, x + state.qx, y + state.qy, z + state.qz
    shrink = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    middle = rotation_from_quaternion(w * shrink, x * shrink, y * shrink, z * shrink)
    work[row * len(lanes) + lane] = state.qw
    work[(row + 1) * len(lanes) + lane] = state.qx
    work[(row + 2) * len(lanes) + lane] = state.qy
    work[(row + 3) * len(lanes) + lane] = state.qz
    force_x, force_y, force_z = to_body(middle, accel_n, accel_e, accel_d - gravity_m_s2)
    return ImuReading(per_s * turn[1], per_s * turn[2], per_s * turn[3], force_x, force_y, force_z)


@equation
def start_sensors(work: Work, lanes: Lanes, suite: SensorSuite) -> None:
    """Every sensor settled on the first state; error processes drawn from their stationary distributions."""
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        truth = true_solution(state)
        work[layout.PREVIOUS_VELOCITY * len(lanes) + lane] = truth.vel_n_m_s
        work[(layout.PREVIOUS_VELOCITY + 1) * len(lanes) + lane] = truth.vel_e_m_s
        work[(layout.PREVIOUS_VELOCITY + 2) * len(lanes) + lane] = truth.vel_d_m_s
        work[layout.PREVIOUS_ATTITUDE * len(lanes) + lane] = state.qw
        work[(layout.PREVIOUS_ATTITUDE + 1) * len(lanes) + lane] = state.qx
        work[(layout.PREVIOUS_ATTITUDE + 2) * len(lanes) + lane] = state.qy
        work[(layout.PREVIOUS_ATTITUDE + 3) * len(lanes) + lane] = state.qz
        gps = start_gps_ins(truth, load_gps_normals(work, lanes, lane), suite.gps)
        store_gps_errors(work, lanes, lane, gps.errors)
        store_gps_held(work, lanes, lane, gps.held)
        cosine = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)[8]
        height = lens_height(state, cosine, suite.lens_below_cg_m)
        store_rangefinder(work, lanes, lane, start_rangefinder(height, cosine, suite.rangefinder))
        thrust = work[layout.THRUST * len(lanes) + lane] / vehicle_as_is(work, lanes, lane).mass_kg
        flow = start_flow(state.u, state.v, state.w, thrust, flow_as_is(work, lanes, lane))
        store_flow(work, lanes, lane, flow)


@equation
def read_gps(work: Work, lanes: Lanes, suite: SensorSuite) -> None:
    """The GPS/INS reading of this epoch."""
    for lane in range(len(lanes)):
        state = GpsInsState(load_gps_errors(work, lanes, lane), load_gps_held(work, lanes, lane))
        truth = true_solution(load_helicopter(work, lanes, lane))
        after, reading = step_gps_ins(state, truth, load_gps_normals(work, lanes, lane), suite.gps)
        store_gps_errors(work, lanes, lane, after.errors)
        store_gps_held(work, lanes, lane, after.held)
        store_gps(work, lanes, lane, reading)


@equation
def read_rangefinder(work: Work, lanes: Lanes, suite: SensorSuite) -> None:
    """The sonar's reading (10 Hz)."""
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        cosine = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)[8]
        height = lens_height(state, cosine, suite.lens_below_cg_m)
        normal = work[(layout.FLOW_NORMALS + 3) * len(lanes) + lane]
        after, reading = step_rangefinder(
            load_rangefinder(work, lanes, lane), height, cosine, normal, suite.rangefinder
        )
        store_rangefinder(work, lanes, lane, after)
        work[layout.RANGE * len(lanes) + lane] = reading.range_m
        work[(layout.RANGE + 1) * len(lanes) + lane] = reading.valid


@equation
def read_flow_sensor(work: Work, lanes: Lanes, suite: SensorSuite) -> None:
    """Whether the flow sensor is engaged, and its reading (50 Hz)."""
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        height = lens_height(state, rotation[8], suite.lens_below_cg_m)
        distance = height if height > 0.05 else 0.05
        lens_n = state.pos_n + rotation[2] * suite.lens_below_cg_m
        lens_e = state.pos_e + rotation[5] * suite.lens_below_cg_m
        flow_x, flow_y = angular_flow(state.u, state.v, state.p, state.q, distance)
        sensor = flow_as_is(work, lanes, lane)
        flow = engage_flow(
            load_flow(work, lanes, lane), lens_n, lens_e, height, rotation, flow_x, flow_y,
            suite.pad_half_size_m, sensor,
        )  # fmt: skip
        store_flow(work, lanes, lane, flow)
        row = layout.FLOW_NORMALS
        reading = read_flow(
            flow,
            height,
            load_rangefinder(work, lanes, lane).rate_m_s,
            work[row * len(lanes) + lane],
            work[(row + 1) * len(lanes) + lane],
            work[(row + 2) * len(lanes) + lane],
            sensor,
        )
        work[layout.FLOW_READING * len(lanes) + lane] = reading.vel_u_m_s
        work[(layout.FLOW_READING + 1) * len(lanes) + lane] = reading.vel_v_m_s
        work[(layout.FLOW_READING + 2) * len(lanes) + lane] = reading.vel_w_m_s
        work[(layout.FLOW_READING + 3) * len(lanes) + lane] = reading.engaged
        work[layout.FLOW_SIGMA * len(lanes) + lane] = reading.sigma_m_s


@equation
def choose_velocity(work: Work, lanes: Lanes, suite: SensorSuite) -> None:
    """The velocity of the paper's measurement: flow where it is engaged, else the GPS/INS's own, turned to the body."""
    for lane in range(len(lanes)):
        gps = load_gps(work, lanes, lane)
        rotation = rotation_from_quaternion(gps.qw, gps.qx, gps.qy, gps.qz)
        ins = to_body(rotation, gps.vel_n_m_s, gps.vel_e_m_s, gps.vel_d_m_s)
        engaged = work[(layout.FLOW_READING + 3) * len(lanes) + lane] > 0.0
        for axis in range(3):
            flow = work[(layout.FLOW_READING + axis) * len(lanes) + lane]
            work[(layout.MEASURED + 3 + axis) * len(lanes) + lane] = flow if engaged else ins[axis]
            arrived = engaged or suite.gps_offers_velocity
            work[(layout.ARRIVED + 3 + axis) * len(lanes) + lane] = 1.0 if arrived else 0.0


@equation
def sense(work: Work, lanes: Lanes, epoch: int, suite: SensorSuite) -> None:
    """Every reading of one epoch, and which of them arrived."""
    read_gps(work, lanes, suite)
    if epoch % RANGE_EPOCHS == 0:
        read_rangefinder(work, lanes, suite)
    read_flow_sensor(work, lanes, suite)
    choose_velocity(work, lanes, suite)
    for component in range(3):
        for lane in range(len(lanes)):
            position = work[(layout.GPS + component) * len(lanes) + lane]
            work[(layout.MEASURED + component) * len(lanes) + lane] = position
            work[(layout.ARRIVED + component) * len(lanes) + lane] = 1.0
