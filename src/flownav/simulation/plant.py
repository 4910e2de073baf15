"""The plant on lanes: Runge-Kutta steps of the nonlinear helicopter, or the paper's linear truth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import equation
from flownav.estimation.kalman import Lanes, Work
from flownav.simulation import layout
from flownav.simulation.layout import (
    load_air,
    load_controls,
    load_helicopter,
    load_inflow,
    load_stage,
    load_sum,
    store_helicopter,
    store_inflow,
    store_stage,
    store_sum,
    vehicle_as_is,
)
from flownav.vehicle.airframe import AirMotion, tail_sideslip
from flownav.vehicle.helicopter import (
    air_motion,
    attitude,
    blade_angles,
    derivative_at_inflow,
    inflow,
    outputs,
    tail_inplane_sq,
)
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.rotor import main_rotor, refine_induced_velocity, tail_rotor, thrustless_inflow
from flownav.vehicle.state import Controls, HelicopterState, Inflow, add_scaled, normalised


class LinearTruth(NamedTuple):
    """x <- A x + B u over one attitude-loop step: transition (6, 6), input_matrix (6, 4), trim (4,) [rad].

    lateral_per_pedal is B_red's side acceleration per pedal [m/s2/rad], the only lateral control it has.
    """

    transition: NDArray[np.float64]
    input_matrix: NDArray[np.float64]
    trim: NDArray[np.float64]
    lateral_per_pedal: float


@equation
def runge_kutta_step(work: Work, lanes: Lanes, dt: float) -> None:
    """One classical fourth-order step of every lane's helicopter; controls and wind held over the step.

    The inflow is solved in full at the first stage; the other stages, half a step away, refine it with one
    Halley step each. The state differs by about 1e-9 from solving anew (tests/test_plant.py: `helicopter.step`).
    """
    for lane in range(len(lanes)):
        state, vehicle = load_helicopter(work, lanes, lane), vehicle_as_is(work, lanes, lane)
        store_sum(work, lanes, lane, state)
        air = moving_air(work, lanes, lane, state)
        induced = inflow(air, blade_angles(state, vehicle), vehicle)
        store_inflow(work, lanes, lane, induced)
        add_stage(work, lanes, lane, state, air, induced, dt / 6.0, 0.5 * dt, vehicle)
    for stage in range(3):
        weight = dt / 3.0 if stage < 2 else dt / 6.0
        reach = 0.5 * dt if stage < 1 else dt
        for lane in range(len(lanes)):
            state, vehicle = load_stage(work, lanes, lane), vehicle_as_is(work, lanes, lane)
            air = moving_air(work, lanes, lane, state)
            guess = load_inflow(work, lanes, lane)
            induced = refined_inflow(guess, air, blade_angles(state, vehicle), vehicle)
            store_inflow(work, lanes, lane, induced)
            add_stage(work, lanes, lane, state, air, induced, weight, reach, vehicle)
    for lane in range(len(lanes)):
        store_helicopter(work, lanes, lane, normalised(load_sum(work, lanes, lane)))


@equation
def moving_air(work: Work, lanes: Lanes, lane: int, state: HelicopterState) -> AirMotion:
    """Motion of a state through this lane's air."""
    wind = load_air(work, lanes, lane)
    return air_motion(state, attitude(state), wind.wind_n_m_s, wind.wind_e_m_s, wind.wind_d_m_s)


@equation
def add_stage(
    work: Work,
    lanes: Lanes,
    lane: int,
    state: HelicopterState,
    air: AirMotion,
    induced: Inflow,
    weight: float,
    reach: float,
    vehicle: VehicleParameters,
) -> None:
    """A stage's rate into the weighted sum, and the next stage's state `reach` from the step's start."""
    controls = load_controls(work, lanes, lane)
    rate = derivative_at_inflow(state, controls, air, attitude(state), induced, vehicle)
    store_sum(work, lanes, lane, add_scaled(load_sum(work, lanes, lane), rate, weight))
    store_stage(work, lanes, lane, add_scaled(load_helicopter(work, lanes, lane), rate, reach))


@equation
def refined_inflow(guess: Inflow, air: AirMotion, blades: Controls, vehicle: VehicleParameters) -> Inflow:
    """Both rotors' induced velocities, one Halley step on from those of a neighbouring state."""
    main, tail = main_rotor(vehicle), tail_rotor(vehicle)
    main_inplane, tail_inplane = air.u * air.u + air.v * air.v, tail_inplane_sq(air, vehicle)
    sideslip = tail_sideslip(air, vehicle)
    main_free = thrustless_inflow(blades.col, main_inplane, air.w, main)
    tail_free = thrustless_inflow(blades.ped, tail_inplane, sideslip, tail)
    return Inflow(
        refine_induced_velocity(guess.main, main_free, main_inplane, air.w, main),
        refine_induced_velocity(guess.tail, tail_free, tail_inplane, sideslip, tail),
    )


@equation
def linear_step(work: Work, lanes: Lanes, model: LinearTruth) -> None:
    """One step of the paper's linear truth: earth position and body velocity; attitude stays level, no ground."""
    for lane in range(len(lanes)):
        store_stage(work, lanes, lane, load_helicopter(work, lanes, lane))
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
    """Thrust and skid load of the present state."""
    for lane in range(len(lanes)):
        air, vehicle = load_air(work, lanes, lane), vehicle_as_is(work, lanes, lane)
        seen = outputs(load_helicopter(work, lanes, lane), air.wind_n_m_s, air.wind_e_m_s, air.wind_d_m_s, vehicle)
        work[layout.THRUST * len(lanes) + lane] = seen.thrust_n
        work[layout.CONTACT * len(lanes) + lane] = seen.contact_force_n
        work[layout.POWER * len(lanes) + lane] = seen.power_w
