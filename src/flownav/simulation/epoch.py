"""The parts of one epoch of the closed loop: the autopilot's estimate, the outer and the attitude loop, the plant."""

from typing import NamedTuple

import numpy as np

from flownav.control.autopilot import AutopilotState, Estimate, inner_loop, landing_logic, outer_loop
from flownav.control.gains import AutopilotGains
from flownav.control.guidance import Knowledge, Reference
from flownav.control.learning import Stir
from flownav.control.learnt_gains import LoopGains, gains_with
from flownav.control.learnt_model import NominalModel
from flownav.core.compile import Lanes, Work, equation, invoke, procedure, replacing
from flownav.core.frames import GRAVITY_M_S2, Quaternion, quaternion_product, rotation_from_quaternion
from flownav.core.measurement import Sensor
from flownav.navigation.records import Reading
from flownav.sensors.flow import FlowParameters, FlowState, misread, step_flow
from flownav.sensors.geometry import Ground, ground_height
from flownav.sensors.gps_ins import GpsInsErrors, attitude_with_error
from flownav.sensors.range_sensor import slant_range
from flownav.simulation import calls
from flownav.simulation.block import Block, Progress
from flownav.simulation.fault_injection import Taken, strike
from flownav.simulation.layout import PAPERS, PLANT
from flownav.simulation.navigating import Timetable, inertial_row, keep_inertial
from flownav.simulation.onboard import Onboard
from flownav.simulation.plan import (
    ATTITUDE_S,
    ATTITUDE_STEPS,
    CONTACT_SHARE,
    PHYSICS_S,
    PHYSICS_STEPS,
    Flight,
    OwnParts,
)
from flownav.simulation.plant import LinearTruth, linear_step, observe_vehicle, step_vehicle
from flownav.simulation.records import AttitudeError, Estimated, Felt, Home, Landed, Loads, PaperInput
from flownav.simulation.sensing import EPOCH_S, lens_height, true_imu
from flownav.simulation.sensor_loops import INERTIAL_FAULT, read_inertial
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.state import Around, Controls, HelicopterState

over_home = replacing(Estimate, "pos_n", "pos_e", "pos_d")


@PLANT.on_lanes(calls.estimate_for_autopilot)
def estimate_for_autopilot(state: HelicopterState, stated: Estimated, felt: Felt, *, on_truth: bool) -> Estimate:
    """The outer loop's feedback: the filter's estimate or the truth, and the specific force read by the IMU."""
    return Estimate(
        state.pos_n if on_truth else stated.pos_n_m,
        state.pos_e if on_truth else stated.pos_e_m,
        state.pos_d if on_truth else stated.pos_d_m,
        state.u if on_truth else stated.vel_u_m_s,
        state.v if on_truth else stated.vel_v_m_s,
        state.w if on_truth else stated.vel_w_m_s,
        felt.mean_x_m_s2,
        felt.mean_y_m_s2,
        felt.mean_z_m_s2,
    )


@equation
def note_home(work: Work, lanes: Lanes, epoch: int, reference: Reference, flight: Flight) -> None:
    """Where the estimate puts the pad: noted at the start and for as long as the skids stay on it before take-off."""
    parked = epoch * EPOCH_S < flight.plan.takeoff_at_s and flight.plan.starts_on_ground
    if flight.plan.home_at_start and (epoch == 0 or parked):
        put_home(work, lanes, reference)


@PLANT.on_lanes(calls.put_home)
def put_home(estimate: Estimate, *, reference: Reference) -> Home:
    """Where the estimate puts the pad, if the vehicle is at the reference of its path."""
    return Home(estimate.pos_n - reference.pos_n, estimate.pos_e - reference.pos_e, estimate.pos_d - reference.pos_d)


@equation
def command(
    work: Work, lanes: Lanes, t_s: float, reference: Reference, flight: Flight, onboard: Onboard | None
) -> None:
    """Landing logic and outer loop; the filter's inputs for the coming epoch."""
    may_fly = 1.0 if t_s >= flight.plan.takeoff_at_s else 0.0
    may_land = 1.0 if t_s >= flight.plan.may_land_after_s else 0.0
    threshold_n = CONTACT_SHARE * flight.vehicle.mass_kg * flight.vehicle.gravity_m_s2
    mind_skids(work, lanes, may_fly, may_land=may_land, threshold_n=threshold_n, onboard=onboard)
    follow_path(work, lanes, may_land, reference, flight.gains, flight.learns)


@PLANT.on_lanes(calls.mind_skids)
def mind_skids(
    before: AutopilotState, loads: Loads, skids: Landed, *, may_fly: float, may_land: float, threshold_n: float,
    onboard: Onboard | None,
) -> AutopilotState:  # fmt: skip
    """The landing logic. With sensors of its own, the autopilot knows its skids by their switch only."""
    contact_n = loads.contact_n if onboard is None else 2.0 * threshold_n * skids.landed
    return landing_logic(before, contact_n, threshold_n, may_fly, may_land, EPOCH_S)


@PLANT.on_lanes(calls.follow_path)
def follow_path(
    before: AutopilotState, estimate: Estimate, home: Home, stated: Estimated, known: Knowledge, loops: LoopGains, *,
    may_land: float, reference: Reference, gains: AutopilotGains, learns: NominalModel | None,
) -> AutopilotState:  # fmt: skip
    """The outer loop, at the attitude by the filter or the INS."""
    relative = over_home(
        estimate, pos_n=estimate.pos_n - home.north_m, pos_e=estimate.pos_e - home.east_m,
        pos_d=estimate.pos_d - home.down_m,
    )  # fmt: skip
    rotation = rotation_from_quaternion(stated.qw, stated.qx, stated.qy, stated.qz)
    gains_now = gains if learns is None else gains_with(gains, loops)
    return outer_loop(before, reference, relative, known, rotation, gains_now, may_land, EPOCH_S)


@PLANT.on_lanes(calls.note_inputs)
def note_inputs(autopilot: AutopilotState, controls: Controls, *, gains: AutopilotGains) -> PaperInput:
    """U of the paper's filter: collective and pedal as perturbations from trim; zero where the skids touch."""
    flying = autopilot.flying > 0.0 and autopilot.contact_time_s == 0.0
    col, ped = controls.col - gains.collective_trim_rad, controls.ped - gains.pedal_trim_rad
    return PaperInput(0.0, 0.0, col if flying else 0.0, ped if flying else 0.0)


@equation
def steer(
    work: Work, lanes: Lanes, flight: Flight, linear: LinearTruth | None, onboard: Onboard | None, own: OwnParts | None
) -> None:
    """The attitude loop's controls for the next 4 ms, by ours or by a user's own controller."""
    if own is not None and own.steer != 0:
        invoke(own.steer, work)
    else:
        steer_blades(work, lanes, flight.gains, linear, onboard, flight.learns)


class Steered(NamedTuple):
    """The attitude loop's state and its commands."""

    autopilot: AutopilotState
    controls: Controls
    stir: Stir


@PLANT.on_lanes(calls.steer_blades)
def steer_blades(
    state: HelicopterState, before: AutopilotState, errors: GpsInsErrors, error: AttitudeError, loops: LoopGains,
    stir: Stir, around: Around, controls: Controls, *,
    gains: AutopilotGains, linear: LinearTruth | None, onboard: Onboard | None, learns: NominalModel | None,
) -> Steered:  # fmt: skip
    """The attitude loop: blade angles for the next 4 ms, on the flown attitude and the flybarless unit's gyros."""
    if onboard is None:
        qw, qx, qy, qz = ins_attitude(state, errors)
    else:
        qw, qx, qy, qz = own_attitude(state, error)
    rotation = rotation_from_quaternion(qw, qx, qy, qz)
    gains_now = gains if learns is None else gains_with(gains, loops)
    after, lon, lat, col, ped = inner_loop(before, rotation, state.p, state.q, state.r, gains_now, ATTITUDE_S)
    if linear is not None:
        ped = pedal_sideways(after, gains, linear)
    if around.tail_stuck > 0.0:
        ped = controls.ped
    if learns is not None:
        lon, lat = lon + stir.lon, lat + stir.lat
        stir = asked(stir, lon, lat)
    return Steered(after, Controls(lon, lat, col, ped), stir)


@equation
def asked(stir: Stir, lon: float, lat: float) -> Stir:
    """The stir with one more step of the attitude loop added to the cyclic commands of this epoch."""
    return Stir(
        stir.lon + stir.lon_step, stir.lat + stir.lat_step, stir.lon_step, stir.lat_step,
        stir.asked_lon + lon / ATTITUDE_STEPS, stir.asked_lat + lat / ATTITUDE_STEPS,
    )  # fmt: skip


@equation
def ins_attitude(state: HelicopterState, error: GpsInsErrors) -> Quaternion:
    """The paper's INS: the true attitude with its errors of this epoch."""
    return attitude_with_error(
        (state.qw, state.qx, state.qy, state.qz), error.roll_rad, error.pitch_rad, error.heading_rad
    )


@equation
def own_attitude(state: HelicopterState, error: AttitudeError) -> Quaternion:
    """The navigator's attitude of this epoch, turned on since then by the flybarless unit's gyros."""
    return quaternion_product((error.w, error.x, error.y, error.z), (state.qw, state.qx, state.qy, state.qz))


@equation
def pedal_sideways(state: AutopilotState, gains: AutopilotGains, linear: LinearTruth) -> float:
    """B_red answers to collective and pedal alone, so the pedal carries the lateral loop of the linear truth."""
    return gains.pedal_trim_rad + GRAVITY_M_S2 * (state.roll_sine - gains.roll_trim_sine) / linear.lateral_per_pedal


@PAPERS.on_lanes(calls.follow_flow)
def follow_flow(
    state: HelicopterState, before: FlowState, flow: FlowParameters, ground: Ground, vehicle: VehicleParameters,
    loads: Loads, *, lens_below_cg_m: float,
) -> FlowState:  # fmt: skip
    """The flow sensor's own dynamics, 4 ms on."""
    cosine = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)[8]
    over = lens_height(state, cosine, lens_below_cg_m)
    over -= ground_height(state.pos_n, state.pos_e, ground)
    distance = slant_range(over, cosine)
    thrust = loads.thrust_n / vehicle.mass_kg
    seen_u, seen_v = misread(state.u, state.v, state.w, state.p, state.q, distance, flow)
    return step_flow(before, seen_u, seen_v, state.w, distance, thrust, flow)


@equation
def move(work: Work, lanes: Lanes, dt: float, flight: Flight, onboard: Onboard | None, own: OwnParts | None) -> None:
    """One step of the vehicle, ours or a user's own."""
    if own is not None and own.step != 0:
        invoke(own.step, work, dt)
    else:
        step_vehicle(work, lanes, dt, flight.rotors, onboard)


@equation
def observe(work: Work, lanes: Lanes, flight: Flight, onboard: Onboard | None, own: OwnParts | None) -> None:
    """Thrust, ground load and power of the present state; a user's own vehicle has reported them as it moved."""
    if own is None or own.step == 0:
        observe_vehicle(work, lanes, flight.rotors, onboard)


@equation
def advance(work: Work, lanes: Lanes, flight: Flight, linear: LinearTruth | None) -> None:
    """From one epoch to the next."""
    for _ in range(ATTITUDE_STEPS):
        steer(work, lanes, flight, linear, None, None)
        follow_flow(work, lanes, flight.sensors.lens_below_cg_m)
        if linear is None:
            for _ in range(PHYSICS_STEPS):
                step_vehicle(work, lanes, PHYSICS_S, flight.rotors, None)
            observe_vehicle(work, lanes, flight.rotors, None)
        else:
            linear_step(work, lanes, linear)


@equation
def inertial_parts(onboard: Onboard) -> int:
    """Inertial readings of an epoch."""
    return ATTITUDE_STEPS * PHYSICS_STEPS // onboard.inertial_steps


@procedure
def advance_sensing(
    b: Block, flight: Flight, onboard: Onboard, table: Timetable, epoch: int, at: Progress, own: OwnParts | None
) -> None:
    """From one epoch to the next, with an inertial reading at the end of each of its periods."""
    work, lanes = b.work, b.lanes
    for step in range(ATTITUDE_STEPS * PHYSICS_STEPS):
        if step % PHYSICS_STEPS == 0:
            steer(work, lanes, flight, None, onboard, own)
            follow_flow(work, lanes, flight.sensors.lens_below_cg_m)
        move(work, lanes, PHYSICS_S, flight, onboard, own)
        if (step + 1) % PHYSICS_STEPS == 0:
            observe(work, lanes, flight, onboard, own)
        if (step + 1) % onboard.inertial_steps == 0:
            part = (step + 1) // onboard.inertial_steps - 1
            hear(b, onboard, table, epoch, at, part, flight.fails)


@equation
def hear(b: Block, onboard: Onboard, table: Timetable, epoch: int, at: Progress, part: int, fails: bool | None) -> None:
    """The inertial reading of the epoch's `part`-th period, which ends now."""
    work, lanes, period_s = b.work, b.lanes, onboard.inertial_steps * PHYSICS_S
    true_imu(work, lanes, period_s)
    slot = (at.taken + part) % table.slots
    read_inertial(work, lanes, b.seed, b.first, epoch, part, slot, onboard)
    if fails is not None:
        t_s = epoch * EPOCH_S + (part + 1) * onboard.inertial_steps * PHYSICS_S
        strike(work, lanes, b.seed, b.first, Taken(epoch, t_s, slot, Sensor.IMU, INERTIAL_FAULT + 3 * part, 0))
    keep_inertial(work, lanes, slot, inertial_row=inertial_row(at.inertial + part, period_s, table))
    feel(work, lanes, part, parts=inertial_parts(onboard), slot=slot)


@PLANT.on_lanes(calls.feel)
def feel(before: Felt, reading: Reading, *, part: int, parts: int) -> Felt:
    """The mean of the accelerometer's readings of this epoch with the one in a slot, the `part`-th of `parts`.

    One that reads nothing leaves what it read last.
    """
    x = reading.value_3 if np.isfinite(reading.value_3) else before.last_x_m_s2
    y = reading.value_4 if np.isfinite(reading.value_4) else before.last_y_m_s2
    z = reading.value_5 if np.isfinite(reading.value_5) else before.last_z_m_s2
    return Felt(
        (before.mean_x_m_s2 if part > 0 else 0.0) + x / parts,
        (before.mean_y_m_s2 if part > 0 else 0.0) + y / parts,
        (before.mean_z_m_s2 if part > 0 else 0.0) + z / parts,
        x,
        y,
        z,
        (before.mean_roll_rad_s if part > 0 else 0.0) + reading.value_0 / parts,
        (before.mean_pitch_rad_s if part > 0 else 0.0) + reading.value_1 / parts,
    )
