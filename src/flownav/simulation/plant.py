"""The plant on lanes: Runge-Kutta steps of the helicopter, of the paper's helicopter, or the paper's linear truth."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import STAGES, Lanes, Work, equation
from flownav.simulation import layout
from flownav.simulation.onboard import Onboard
from flownav.simulation.records import Loads, RotorSpeed
from flownav.vehicle import helicopter, multirotor
from flownav.vehicle.airframe import AirMotion, air_motion, attitude, tail_sideslip
from flownav.vehicle.kinds import AnyState
from flownav.vehicle.motors import mixed, roots_of_shares
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.rotor import main_rotor, refine_induced_velocity, speed_ratio, tail_rotor, thrustless_inflow
from flownav.vehicle.state import (
    Controls,
    HelicopterState,
    Inflow,
    Outputs,
    after_stage,
    normalised,
)


class LinearTruth(NamedTuple):
    """x <- A x + B u over one attitude-loop step: transition (6, 6), input_matrix (6, 4), trim (4,) [rad].

    lateral_per_pedal is B_red's side acceleration per pedal [m/s2/rad], the only lateral control it has.
    """

    transition: NDArray[np.float64]
    input_matrix: NDArray[np.float64]
    trim: NDArray[np.float64]
    lateral_per_pedal: float


@equation
def runge_kutta_step(work: Work, lanes: Lanes, dt: float, onboard: Onboard | None) -> None:
    """One classical fourth-order step of every lane's helicopter; controls and surroundings held over the step.

    Inflow in balance is solved in full at the first stage; the other stages, half a step away, refine it with one
    Halley step each. The state differs by about 1e-9 from solving anew (tests/test_plant.py: `helicopter.step`).
    onboard None: the paper's helicopter, both inflows in balance at once and the rotor's speed constant.
    """
    for lane in range(len(lanes)):
        state, vehicle = layout.load_helicopter(work, lanes, lane), layout.vehicle_as_is(work, lanes, lane)
        layout.store_sum(work, lanes, lane, state)
        air = moving_air(work, lanes, lane, state)
        induced = solved_inflow(state, air, helicopter.blade_angles(state, vehicle), vehicle, onboard)
        layout.store_inflow(work, lanes, lane, induced)
        add_stage(work, lanes, lane, rate_at_inflow(work, lanes, lane, state, air, induced, vehicle, onboard), 0, dt)
    for stage in range(1, STAGES):
        for lane in range(len(lanes)):
            state, vehicle = layout.load_stage(work, lanes, lane), layout.vehicle_as_is(work, lanes, lane)
            air, guess = moving_air(work, lanes, lane, state), layout.load_inflow(work, lanes, lane)
            induced = refined_inflow(guess, state, air, helicopter.blade_angles(state, vehicle), vehicle, onboard)
            layout.store_inflow(work, lanes, lane, induced)
            rate = rate_at_inflow(work, lanes, lane, state, air, induced, vehicle, onboard)
            add_stage(work, lanes, lane, rate, stage, dt)
    for lane in range(len(lanes)):
        layout.store_helicopter(work, lanes, lane, normalised(layout.load_sum(work, lanes, lane)))


@equation
def rate_at_inflow(
    work: Work, lanes: Lanes, lane: int, state: HelicopterState, air: AirMotion, induced: Inflow,
    vehicle: VehicleParameters, onboard: Onboard | None,
) -> HelicopterState:  # fmt: skip
    """The rate of a state under this lane's controls, at these induced velocities."""
    controls, around = layout.load_controls(work, lanes, lane), layout.load_around(work, lanes, lane)
    if onboard is None:
        return helicopter.derivative_at_inflow(state, controls, air, attitude(state), induced, around, vehicle)
    return helicopter.derivative_at_tail(state, controls, air, attitude(state), induced.tail, around, vehicle)


@equation
def add_stage(work: Work, lanes: Lanes, lane: int, rate: HelicopterState, stage: int, dt: float) -> None:
    """A stage's rate into the step's sum, and the next stage's state (`after_stage`)."""
    start, total = layout.load_helicopter(work, lanes, lane), layout.load_sum(work, lanes, lane)
    total, following = after_stage(stage, start, total, rate, dt)
    layout.store_sum(work, lanes, lane, total)
    layout.store_stage(work, lanes, lane, following)


@equation
def solved_inflow(
    state: HelicopterState, air: AirMotion, blades: Controls, vehicle: VehicleParameters, onboard: Onboard | None
) -> Inflow:
    """The induced velocities that are in balance; the main rotor's is a state, but of the paper's helicopter."""
    if onboard is None:
        return helicopter.inflow(air, blades, 1.0, vehicle)
    return Inflow(0.0, helicopter.tail_inflow(air, blades, speed_ratio(state.speed, vehicle), vehicle))


@equation
def moving_air(work: Work, lanes: Lanes, lane: int, state: HelicopterState) -> AirMotion:
    """Motion of a state through this lane's air."""
    return air_motion(state, attitude(state), layout.load_around(work, lanes, lane))


@equation
def refined_inflow(
    guess: Inflow, state: HelicopterState, air: AirMotion, blades: Controls, vehicle: VehicleParameters,
    onboard: Onboard | None,
) -> Inflow:  # fmt: skip
    """The inflow of `solved_inflow`, one Halley step on from those of a neighbouring state."""
    tail_m_s = refined_tail_inflow(guess.tail, state, air, blades, vehicle)
    if onboard is not None:
        return Inflow(0.0, tail_m_s)
    main = main_rotor(vehicle, 1.0)
    inplane_sq = air.u * air.u + air.v * air.v
    free = thrustless_inflow(blades.col, inplane_sq, air.w, main)
    return Inflow(refine_induced_velocity(guess.main, free, inplane_sq, air.w, main), tail_m_s)


@equation
def refined_tail_inflow(
    guess: float, state: HelicopterState, air: AirMotion, blades: Controls, vehicle: VehicleParameters
) -> float:
    """The tail rotor's induced velocity, one Halley step on from that of a neighbouring state."""
    tail = tail_rotor(vehicle, speed_ratio(state.speed, vehicle))
    inplane_sq, sideslip = helicopter.tail_inplane_sq(air, vehicle), tail_sideslip(air, vehicle)
    free = thrustless_inflow(blades.ped, inplane_sq, sideslip, tail)
    return refine_induced_velocity(guess, free, inplane_sq, sideslip, tail)


@equation
def linear_step(work: Work, lanes: Lanes, model: LinearTruth) -> None:
    """One step of the paper's linear truth: earth position and body velocity; attitude stays level, no ground."""
    for lane in range(len(lanes)):
        layout.store_stage(work, lanes, lane, layout.load_helicopter(work, lanes, lane))
    for i in range(6):
        for lane in range(len(lanes)):
            total = 0.0
            for k in range(6):
                total += model.transition[i, k] * work[(layout.STAGE + k) * len(lanes) + lane]
            for k in range(4):
                control = work[(layout.CONTROLS + k) * len(lanes) + lane]
                total += model.input_matrix[i, k] * (control - model.trim[k])
            work[(layout.HELICOPTER + i) * len(lanes) + lane] = total


@equation
def observe_plant(work: Work, lanes: Lanes) -> None:
    """Thrust, skid load and power of the present state."""
    for lane in range(len(lanes)):
        around, vehicle = layout.load_around(work, lanes, lane), layout.vehicle_as_is(work, lanes, lane)
        note_outputs(work, lanes, lane, helicopter.outputs(layout.load_helicopter(work, lanes, lane), around, vehicle))


@equation
def observe_balanced(work: Work, lanes: Lanes) -> None:
    """Observe the plant of the paper's helicopter."""
    for lane in range(len(lanes)):
        around, vehicle = layout.load_around(work, lanes, lane), layout.vehicle_as_is(work, lanes, lane)
        state = layout.load_helicopter(work, lanes, lane)
        induced = helicopter.inflow(
            moving_air(work, lanes, lane, state), helicopter.blade_angles(state, vehicle), 1.0, vehicle
        )
        note_outputs(work, lanes, lane, helicopter.outputs_at_inflow(state, induced, around, vehicle))


@equation
def note_outputs(work: Work, lanes: Lanes, lane: int, seen: Outputs) -> None:
    """Store the plant's loads, as sensors and scores read them."""
    layout.store_loads(work, lanes, lane, Loads(seen.thrust_n, seen.contact_force_n, seen.power_w))


@equation
def midpoint_step(work: Work, lanes: Lanes, dt: float, rotors: tuple[int, ...]) -> None:
    """One step of every lane's multirotor; controls and surroundings held over the step (`multirotor.step`)."""
    hexa = len(rotors) > 4
    for lane in range(len(lanes)):
        state, vehicle = layout.load_multirotor(work, lanes, lane), layout.multirotor_as_is(work, lanes, lane)
        roots = roots_of_shares(mixed(layout.load_controls(work, lanes, lane), hexa, vehicle), hexa)
        layout.store_roots(work, lanes, lane, roots)
        middle = multirotor.middle_of_step(state, roots, layout.load_around(work, lanes, lane), dt, hexa, vehicle)
        layout.store_multirotor_stage(work, lanes, lane, middle)
    for lane in range(len(lanes)):
        middle, vehicle = layout.load_multirotor_stage(work, lanes, lane), layout.multirotor_as_is(work, lanes, lane)
        state, roots = layout.load_multirotor(work, lanes, lane), layout.load_roots(work, lanes, lane)
        around = layout.load_around(work, lanes, lane)
        after = multirotor.end_of_step(state, middle, roots, around, dt, hexa, vehicle)
        layout.store_multirotor(work, lanes, lane, after)


@equation
def observe_multirotor(work: Work, lanes: Lanes, rotors: tuple[int, ...]) -> None:
    """Thrust, load of the feet and power of the present state."""
    hexa = len(rotors) > 4
    for lane in range(len(lanes)):
        around, vehicle = layout.load_around(work, lanes, lane), layout.multirotor_as_is(work, lanes, lane)
        note_outputs(
            work, lanes, lane, multirotor.outputs(layout.load_multirotor(work, lanes, lane), around, hexa, vehicle)
        )


_, store_rotor_speed = layout.PLANT.access(RotorSpeed)


@equation
def place(work: Work, lanes: Lanes, lane: int, state: AnyState, rotors: tuple[int, ...] | None) -> None:
    """Put the vehicle of a lane where it starts; a helicopter's rotor has its own governed speed."""
    for field in range(len(state)):
        work[(layout.HELICOPTER + field) * len(lanes) + lane] = state[field]
    if rotors is None:
        store_rotor_speed(work, lanes, lane, RotorSpeed(layout.vehicle_as_is(work, lanes, lane).main_speed_rad_s))


@equation
def step_vehicle(work: Work, lanes: Lanes, dt: float, rotors: tuple[int, ...] | None, onboard: Onboard | None) -> None:
    """One step of every lane's vehicle; without sensors of its own it is the paper's helicopter."""
    if rotors is not None:
        midpoint_step(work, lanes, dt, rotors)
    else:
        runge_kutta_step(work, lanes, dt, onboard)


@equation
def observe_vehicle(work: Work, lanes: Lanes, rotors: tuple[int, ...] | None, onboard: Onboard | None) -> None:
    """Thrust, ground load and power of the present state."""
    if rotors is not None:
        observe_multirotor(work, lanes, rotors)
    elif onboard is None:
        observe_balanced(work, lanes)
    else:
        observe_plant(work, lanes)
