"""The parts of one epoch of the closed loop: what is flown on, the outer and the attitude loop, the plant."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, invoke, procedure
from flownav.control.autopilot import AutopilotState, Estimate, inner_loop, landing_logic, outer_loop
from flownav.control.gains import AutopilotGains
from flownav.control.guidance import Reference
from flownav.frames import GRAVITY_M_S2, Quaternion, Rotation, quaternion_product, rotation_from_quaternion
from flownav.measurement import Sensor
from flownav.sensors.beam import ground_height
from flownav.sensors.flow import misread, step_flow
from flownav.sensors.gps_ins import attitude_with_error
from flownav.sensors.rangefinder import slant_range
from flownav.simulation import layout
from flownav.simulation.failing import strike
from flownav.simulation.layout import (
    flow_as_is,
    ground_as_is,
    load_autopilot,
    load_estimate,
    load_flow,
    load_gps_errors,
    load_helicopter,
    load_known,
    store_autopilot,
    store_controls,
    store_flow,
    store_true_imu,
    vehicle_as_is,
)
from flownav.simulation.navigating import Timetable, keep_inertial
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
from flownav.simulation.plant import LinearTruth, linear_step
from flownav.simulation.ring import FIELDS, FIRST
from flownav.simulation.sampling import read_inertial
from flownav.simulation.sensing import EPOCH_S, lens_height, true_imu
from flownav.simulation.vehicles import observe_vehicle, step_vehicle
from flownav.vehicle.state import Controls


@equation
def estimate_for_autopilot(work: Work, lanes: Lanes, flight: Flight) -> None:
    """What the outer loop flies on: the filter's estimate or the truth, and the force that the IMU felt."""
    source = layout.HELICOPTER if flight.plan.fly_on_truth else layout.ESTIMATED
    for component in range(3):
        for lane in range(len(lanes)):
            value = work[(layout.FELT + component) * len(lanes) + lane]
            work[(layout.ESTIMATE + 6 + component) * len(lanes) + lane] = value
    for component in range(6):
        for lane in range(len(lanes)):
            value = work[(source + component) * len(lanes) + lane]
            work[(layout.ESTIMATE + component) * len(lanes) + lane] = value


@equation
def note_home(work: Work, lanes: Lanes, epoch: int, reference: Reference, flight: Flight) -> None:
    """Where the estimate puts the pad: noted at the start and for as long as the skids stay on it before take-off."""
    for lane in range(len(lanes)):
        parked = epoch * EPOCH_S < flight.plan.takeoff_at_s and flight.plan.starts_on_ground
        waiting = flight.plan.home_at_start and (epoch == 0 or parked)
        estimate = load_estimate(work, lanes, lane)
        home_n, home_e, home_d = (
            estimate.pos_n - reference.pos_n,
            estimate.pos_e - reference.pos_e,
            estimate.pos_d - reference.pos_d,
        )
        row = layout.HOME
        work[row * len(lanes) + lane] = home_n if waiting else work[row * len(lanes) + lane]
        work[(row + 1) * len(lanes) + lane] = home_e if waiting else work[(row + 1) * len(lanes) + lane]
        work[(row + 2) * len(lanes) + lane] = home_d if waiting else work[(row + 2) * len(lanes) + lane]


@equation
def command(
    work: Work, lanes: Lanes, t_s: float, reference: Reference, flight: Flight, onboard: Onboard | None
) -> None:
    """Landing logic and outer loop; the filter's inputs for the coming epoch."""
    plan, gains = flight.plan, flight.gains
    may_fly = 1.0 if t_s >= plan.takeoff_at_s else 0.0
    may_land = 1.0 if t_s >= plan.may_land_after_s else 0.0
    threshold = CONTACT_SHARE * flight.vehicle.mass_kg * flight.vehicle.gravity_m_s2
    for lane in range(len(lanes)):
        rotation = flown_attitude(work, lanes, lane)
        estimate = load_estimate(work, lanes, lane)
        relative = Estimate(
            estimate.pos_n - work[layout.HOME * len(lanes) + lane],
            estimate.pos_e - work[(layout.HOME + 1) * len(lanes) + lane],
            estimate.pos_d - work[(layout.HOME + 2) * len(lanes) + lane],
            estimate.u,
            estimate.v,
            estimate.w,
            estimate.force_x,
            estimate.force_y,
            estimate.force_z,
        )
        if onboard is None:
            contact = work[layout.CONTACT * len(lanes) + lane]
        else:  # the skid switch is all that the autopilot knows of its skids
            contact = 2.0 * threshold * work[layout.LANDED * len(lanes) + lane]
        state = landing_logic(load_autopilot(work, lanes, lane), contact, threshold, may_fly, may_land, EPOCH_S)
        known = load_known(work, lanes, lane)
        after = outer_loop(state, reference, relative, known, rotation, gains, may_land, EPOCH_S)
        store_autopilot(work, lanes, lane, after)


@equation
def flown_attitude(work: Work, lanes: Lanes, lane: int) -> Rotation:
    """R_EB that the outer loop takes the vehicle to have: what the filter, or the INS, says."""
    row = layout.ESTIMATED_ATTITUDE
    return rotation_from_quaternion(
        work[row * len(lanes) + lane], work[(row + 1) * len(lanes) + lane], work[(row + 2) * len(lanes) + lane],
        work[(row + 3) * len(lanes) + lane],
    )  # fmt: skip


@equation
def note_inputs(work: Work, lanes: Lanes, gains: AutopilotGains) -> None:
    """U of the paper's filter: collective and pedal as perturbations from trim; zero where the skids touch."""
    for lane in range(len(lanes)):
        autopilot = load_autopilot(work, lanes, lane)
        flying = autopilot.flying > 0.0 and autopilot.contact_time_s == 0.0
        col = work[(layout.CONTROLS + 2) * len(lanes) + lane] - gains.collective_trim_rad
        ped = work[(layout.CONTROLS + 3) * len(lanes) + lane] - gains.pedal_trim_rad
        work[layout.INPUT * len(lanes) + lane] = 0.0
        work[(layout.INPUT + 1) * len(lanes) + lane] = 0.0
        work[(layout.INPUT + 2) * len(lanes) + lane] = col if flying else 0.0
        work[(layout.INPUT + 3) * len(lanes) + lane] = ped if flying else 0.0


@equation
def steer(
    work: Work, lanes: Lanes, flight: Flight, linear: LinearTruth | None, onboard: Onboard | None, own: OwnParts | None
) -> None:
    """The attitude loop's controls for the next 4 ms, by ours or by a controller of somebody else's."""
    if own is not None and own.steer != 0:
        invoke(own.steer, work)
    else:
        steer_blades(work, lanes, flight, linear, onboard)


@equation
def steer_blades(work: Work, lanes: Lanes, flight: Flight, linear: LinearTruth | None, onboard: Onboard | None) -> None:
    """The attitude loop: blade angles for the next 4 ms, on the flown attitude and the flybarless unit's gyros."""
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        if onboard is None:
            qw, qx, qy, qz = ins_attitude(work, lanes, lane)
        else:
            qw, qx, qy, qz = own_attitude(work, lanes, lane)
        rotation = rotation_from_quaternion(qw, qx, qy, qz)
        after, lon, lat, col, ped = inner_loop(
            load_autopilot(work, lanes, lane), rotation, state.p, state.q, state.r, flight.gains, ATTITUDE_S
        )
        store_autopilot(work, lanes, lane, after)
        if linear is None:
            store_controls(work, lanes, lane, Controls(lon, lat, col, ped))
        else:
            store_controls(work, lanes, lane, Controls(lon, lat, col, pedal_sideways(after, flight.gains, linear)))


@equation
def ins_attitude(work: Work, lanes: Lanes, lane: int) -> Quaternion:
    """The paper's INS: the true attitude with its errors of this epoch."""
    state, error = load_helicopter(work, lanes, lane), load_gps_errors(work, lanes, lane)
    return attitude_with_error(
        (state.qw, state.qx, state.qy, state.qz), error.roll_rad, error.pitch_rad, error.heading_rad
    )


@equation
def own_attitude(work: Work, lanes: Lanes, lane: int) -> Quaternion:
    """The navigator's attitude of this epoch, turned on since then as the flybarless unit's gyros say."""
    state, row = load_helicopter(work, lanes, lane), layout.ATTITUDE_ERROR
    error = (
        work[row * len(lanes) + lane], work[(row + 1) * len(lanes) + lane], work[(row + 2) * len(lanes) + lane],
        work[(row + 3) * len(lanes) + lane],
    )  # fmt: skip
    return quaternion_product(error, (state.qw, state.qx, state.qy, state.qz))


@equation
def pedal_sideways(state: AutopilotState, gains: AutopilotGains, linear: LinearTruth) -> float:
    """B_red answers to collective and pedal alone, so the pedal carries the lateral loop of the linear truth."""
    return gains.pedal_trim_rad + GRAVITY_M_S2 * (state.roll_sine - gains.roll_trim_sine) / linear.lateral_per_pedal


@equation
def follow_flow(work: Work, lanes: Lanes, flight: Flight) -> None:
    """The flow sensor's own dynamics, 4 ms on."""
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        cosine = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)[8]
        over = lens_height(state, cosine, flight.sensors.lens_below_cg_m)
        over -= ground_height(state.pos_n, state.pos_e, ground_as_is(work, lanes, lane))
        distance = slant_range(over, cosine)
        thrust = work[layout.THRUST * len(lanes) + lane] / vehicle_as_is(work, lanes, lane).mass_kg
        before, flow = load_flow(work, lanes, lane), flow_as_is(work, lanes, lane)
        seen_u, seen_v = misread(state.u, state.v, state.w, state.p, state.q, distance, flow)
        after = step_flow(before, seen_u, seen_v, state.w, distance, thrust, flow)
        store_flow(work, lanes, lane, after)


@equation
def move(work: Work, lanes: Lanes, dt: float, flight: Flight, onboard: Onboard | None, own: OwnParts | None) -> None:
    """One step of the vehicle, ours or somebody else's."""
    if own is not None and own.step != 0:
        invoke(own.step, work, dt)
    else:
        step_vehicle(work, lanes, dt, flight.rotors, onboard)


@equation
def observe(work: Work, lanes: Lanes, flight: Flight, onboard: Onboard | None, own: OwnParts | None) -> None:
    """Thrust, ground load and power of the present state; somebody else's vehicle has said them as it moved."""
    if own is None or own.step == 0:
        observe_vehicle(work, lanes, flight.rotors, onboard)


@equation
def advance(work: Work, lanes: Lanes, flight: Flight, linear: LinearTruth | None) -> None:
    """From one epoch to the next."""
    for _ in range(ATTITUDE_STEPS):
        steer(work, lanes, flight, linear, None, None)
        follow_flow(work, lanes, flight)
        if linear is None:
            for _ in range(PHYSICS_STEPS):
                step_vehicle(work, lanes, PHYSICS_S, flight.rotors, None)
            observe_vehicle(work, lanes, flight.rotors, None)
        else:
            linear_step(work, lanes, linear)


@procedure
def advance_sensing(
    work: Work, lanes: Lanes, seed: int, first: int, epoch: int, taken: int, heard: int, flight: Flight,
    onboard: Onboard, table: Timetable, fails: bool | None, own: OwnParts | None,
) -> None:  # fmt: skip
    """From one epoch to the next, with an inertial reading at the end of each of its periods."""
    period_s = onboard.inertial_steps * PHYSICS_S
    for step in range(ATTITUDE_STEPS * PHYSICS_STEPS):
        if step % PHYSICS_STEPS == 0:
            steer(work, lanes, flight, None, onboard, own)
            follow_flow(work, lanes, flight)
        move(work, lanes, PHYSICS_S, flight, onboard, own)
        if (step + 1) % PHYSICS_STEPS == 0:
            observe(work, lanes, flight, onboard, own)
        if (step + 1) % onboard.inertial_steps == 0:
            for lane in range(len(lanes)):
                gravity_m_s2 = vehicle_as_is(work, lanes, lane).gravity_m_s2
                truth = true_imu(work, lanes, lane, period_s, gravity_m_s2)
                store_true_imu(work, lanes, lane, truth)
            part = (step + 1) // onboard.inertial_steps - 1
            slot = (taken + part) % table.slots
            read_inertial(work, lanes, seed, first, epoch, part, slot, onboard)
            if fails is not None:
                t_s = epoch * EPOCH_S + (step + 1) * PHYSICS_S
                strike(work, lanes, seed, first, epoch, t_s, slot, Sensor.IMU, 8 + part, 0)
            keep_inertial(work, lanes, slot, heard + part, period_s, table)
            feel(work, lanes, slot, part, ATTITUDE_STEPS * PHYSICS_STEPS // onboard.inertial_steps)


@equation
def feel(work: Work, lanes: Lanes, slot: int, part: int, parts: int) -> None:
    """Take the accelerometer's reading in a slot, the `part`-th of `parts` of this epoch, into their mean.

    One that reads nothing leaves what it read last.
    """
    for i in range(3):
        for lane in range(len(lanes)):
            before = work[(layout.FELT + i) * len(lanes) + lane] if part > 0 else 0.0
            reading = work[(FIRST + slot * FIELDS + 3 + i) * len(lanes) + lane]
            last = reading if np.isfinite(reading) else work[(layout.LAST_FELT + i) * len(lanes) + lane]
            work[(layout.LAST_FELT + i) * len(lanes) + lane] = last
            work[(layout.FELT + i) * len(lanes) + lane] = before + last / parts
