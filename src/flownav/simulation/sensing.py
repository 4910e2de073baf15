"""The sensors on lanes: each epoch's normals, and every reading taken from the plant's state."""

from typing import NamedTuple

from flownav.core.compile import Lanes, Work, equation
from flownav.core.frames import (
    angular_flow,
    conjugate,
    of_unit_length,
    quaternion_product,
    rotation_from_quaternion,
    to_body,
    to_earth,
)
from flownav.sensors import gps_ins
from flownav.sensors.flow import FlowParameters, FlowReading, FlowState, engage_flow, read_flow, start_flow
from flownav.sensors.geometry import LensPose
from flownav.sensors.inertial import ImuReading
from flownav.sensors.range_sensor import (
    RangefinderParameters,
    RangefinderState,
    RangeReading,
    start_rangefinder,
    step_rangefinder,
)
from flownav.simulation import calls, layout
from flownav.simulation.block import draw
from flownav.simulation.records import Arrived, Before, FlowNormals, Loads, Measured
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.state import HelicopterState

EPOCH_S = 0.02  # the GPS/INS unit, the published flow and the filters: 50 Hz
RANGE_EPOCHS = 5  # the rangefinder: 10 Hz


class SensorSuite(NamedTuple):
    """Every sensor's parameters and where they look from."""

    gps: gps_ins.GpsInsParameters
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
    draw(work, lanes, first_row, end_row - first_row, seed, flight, step, (first_row - layout.GPS_NORMALS) // 2)


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
def true_solution(state: HelicopterState) -> gps_ins.NavSolution:
    """Solution of a perfect GPS/INS."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
    return gps_ins.NavSolution(
        state.pos_n, state.pos_e, state.pos_d, vel_n, vel_e, vel_d, state.qw, state.qx, state.qy, state.qz
    )


@equation
def motion_of(state: HelicopterState) -> Before:
    """Velocity NED and attitude of a state."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
    return Before(vel_n, vel_e, vel_d, state.qw, state.qx, state.qy, state.qz)


@equation
def lens_height(state: HelicopterState, cosine: float, lens_below_cg_m: float) -> float:
    """Height of the lens and the sonar above the ground [m]."""
    return -state.pos_d - lens_below_cg_m * cosine


class Integrated(NamedTuple):
    """Output of an integrating IMU over a period, and the state from which the next one begins."""

    truth: ImuReading
    now: Before


@layout.PLANT.on_lanes(calls.true_imu)
def true_imu(state: HelicopterState, before: Before, vehicle: VehicleParameters, *, period_s: float) -> Integrated:
    """Means over the last period in body axes, as an integrating IMU has them.

    Rate: the turn q0* q1 as a vector, over dt. Specific force: delta v / dt - g in the attitude of the middle.
    """
    now = motion_of(state)
    accel_n = (now.vel_n_m_s - before.vel_n_m_s) / period_s
    accel_e = (now.vel_e_m_s - before.vel_e_m_s) / period_s
    accel_d = (now.vel_d_m_s - before.vel_d_m_s) / period_s
    w, x, y, z = before.qw, before.qx, before.qy, before.qz
    turn = quaternion_product(conjugate((w, x, y, z)), (state.qw, state.qx, state.qy, state.qz))
    half_square = turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3]
    per_s = 2.0 * (1.0 + half_square / 6.0) / period_s
    w, x, y, z = w + state.qw, x + state.qx, y + state.qy, z + state.qz
    w, x, y, z = of_unit_length((w, x, y, z))
    middle = rotation_from_quaternion(w, x, y, z)
    force_x, force_y, force_z = to_body(middle, accel_n, accel_e, accel_d - vehicle.gravity_m_s2)
    return Integrated(ImuReading(per_s * turn[1], per_s * turn[2], per_s * turn[3], force_x, force_y, force_z), now)


@layout.PLANT.on_lanes(calls.motion_now)
def motion_now(state: HelicopterState) -> Before:
    """Velocity NED and attitude, whence an inertial period begins."""
    return motion_of(state)


@layout.PLANT.on_lanes(calls.rest_rangefinder)
def rest_rangefinder(
    state: HelicopterState, *, lens_below_cg_m: float, sonar: RangefinderParameters
) -> RangefinderState:
    """The sonar settled on the first state."""
    cosine = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)[8]
    return start_rangefinder(lens_height(state, cosine, lens_below_cg_m), cosine, sonar)


@layout.PAPERS.on_lanes(calls.rest_flow)
def rest_flow(state: HelicopterState, loads: Loads, vehicle: VehicleParameters, flow: FlowParameters) -> FlowState:
    """The flow sensor settled on the first state."""
    return start_flow(state.u, state.v, state.w, loads.thrust_n / vehicle.mass_kg, flow)


@equation
def start_sensors(work: Work, lanes: Lanes, suite: SensorSuite) -> None:
    """Every sensor settled on the first state; error processes drawn from their stationary distributions."""
    motion_now(work, lanes)
    for lane in range(len(lanes)):
        truth = true_solution(layout.load_helicopter(work, lanes, lane))
        gps = gps_ins.start_gps_ins(truth, layout.load_gps_normals(work, lanes, lane), suite.gps)
        layout.store_gps_errors(work, lanes, lane, gps.errors)
        layout.store_gps_held(work, lanes, lane, gps.held)
    rest_rangefinder(work, lanes, suite.lens_below_cg_m, suite.rangefinder)
    rest_flow(work, lanes)


@equation
def read_gps(work: Work, lanes: Lanes, suite: SensorSuite) -> None:
    """The GPS/INS reading of this epoch."""
    for lane in range(len(lanes)):
        state = gps_ins.GpsInsState(layout.load_gps_errors(work, lanes, lane), layout.load_gps_held(work, lanes, lane))
        truth = true_solution(layout.load_helicopter(work, lanes, lane))
        after, reading = gps_ins.step_gps_ins(state, truth, layout.load_gps_normals(work, lanes, lane), suite.gps)
        layout.store_gps_errors(work, lanes, lane, after.errors)
        layout.store_gps_held(work, lanes, lane, after.held)
        layout.store_gps(work, lanes, lane, reading)


class Ranged(NamedTuple):
    """The sonar after a reading."""

    sonar: RangefinderState
    reading: RangeReading


@layout.PLANT.on_lanes(calls.read_rangefinder)
def read_rangefinder(
    state: HelicopterState, before: RangefinderState, normals: FlowNormals, *, lens_below_cg_m: float,
    sonar: RangefinderParameters,
) -> Ranged:  # fmt: skip
    """The sonar's reading (10 Hz)."""
    cosine = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)[8]
    height = lens_height(state, cosine, lens_below_cg_m)
    after, reading = step_rangefinder(before, height, cosine, normals.range, sonar)
    return Ranged(after, reading)


class Flowed(NamedTuple):
    """The flow sensor after a reading."""

    flow: FlowState
    reading: FlowReading


@layout.PAPERS.on_lanes(calls.read_flow_sensor)
def read_flow_sensor(
    state: HelicopterState, before: FlowState, sonar: RangefinderState, n: FlowNormals, sensor: FlowParameters, *,
    lens_below_cg_m: float, pad_half_size_m: float,
) -> Flowed:  # fmt: skip
    """Whether the flow sensor is engaged, and its reading (50 Hz)."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    height = lens_height(state, rotation[8], lens_below_cg_m)
    distance = height if height > 0.05 else 0.05
    lens_n = state.pos_n + rotation[2] * lens_below_cg_m
    lens_e = state.pos_e + rotation[5] * lens_below_cg_m
    lens = LensPose(lens_n, lens_e, height, rotation)
    flow_x, flow_y = angular_flow(state.u, state.v, state.p, state.q, distance)
    flow = engage_flow(before, lens, flow_x, flow_y, pad_half_size_m, sensor)
    return Flowed(flow, read_flow(flow, height, sonar.rate_m_s, n.u, n.v, n.w, sensor))


class ChosenMeasurement(NamedTuple):
    """The measurement of the paper's filter, and what of it came."""

    measured: Measured
    arrived: Arrived


@layout.PLANT.on_lanes(calls.choose_measurement)
def choose_measurement(gps: gps_ins.NavSolution, flow: FlowReading, *, gps_offers_velocity: bool) -> ChosenMeasurement:
    """The GPS/INS's position, and velocity by flow where it is engaged, else the GPS/INS's own, turned to the body."""
    rotation = rotation_from_quaternion(gps.qw, gps.qx, gps.qy, gps.qz)
    ins = to_body(rotation, gps.vel_n_m_s, gps.vel_e_m_s, gps.vel_d_m_s)
    engaged = flow.engaged > 0.0
    came = 1.0 if engaged or gps_offers_velocity else 0.0
    return ChosenMeasurement(
        Measured(
            gps.pos_n_m,
            gps.pos_e_m,
            gps.pos_d_m,
            flow.vel_u_m_s if engaged else ins[0],
            flow.vel_v_m_s if engaged else ins[1],
            flow.vel_w_m_s if engaged else ins[2],
        ),
        Arrived(1.0, 1.0, 1.0, came, came, came),
    )


@equation
def sense(work: Work, lanes: Lanes, epoch: int, suite: SensorSuite) -> None:
    """Every reading of one epoch, and which of them arrived."""
    read_gps(work, lanes, suite)
    if epoch % RANGE_EPOCHS == 0:
        read_rangefinder(work, lanes, suite.lens_below_cg_m, suite.rangefinder)
    read_flow_sensor(work, lanes, suite.lens_below_cg_m, pad_half_size_m=suite.pad_half_size_m)
    choose_measurement(work, lanes, suite.gps_offers_velocity)
