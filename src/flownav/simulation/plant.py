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
    load_stage,
    load_sum,
    store_helicopter,
    store_stage,
    store_sum,
)
from flownav.vehicle.helicopter import derivative, outputs
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.state import add_scaled, normalised


class LinearTruth(NamedTuple):
    """x <- A x + B u over one attitude-loop step: transition (6, 6), input_matrix (6, 4), trim (4,) [rad].

    lateral_per_pedal is B_red's side acceleration per pedal [m/s2/rad], the only lateral control it has.
    """

    transition: NDArray[np.float64]
    input_matrix: NDArray[np.float64]
    trim: NDArray[np.float64]
    lateral_per_pedal: float


@equation
def runge_kutta_step(work: Work, lanes: Lanes, vehicle: VehicleParameters, dt: float) -> None:
    """One classical fourth-order step of every lane's helicopter; controls and wind held over the step."""
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        store_stage(work, lanes, lane, state)
        store_sum(work, lanes, lane, state)
    for stage in range(4):
        weight = dt / 6.0 if stage == 0 or stage == 3 else dt / 3.0
        reach = 0.5 * dt if stage < 2 else dt
        for lane in range(len(lanes)):
            wind = load_air(work, lanes, lane)
            rate = derivative(
                load_stage(work, lanes, lane),
                load_controls(work, lanes, lane),
                wind.wind_n_m_s,
                wind.wind_e_m_s,
                wind.wind_d_m_s,
                vehicle,
            )
            store_sum(work, lanes, lane, add_scaled(load_sum(work, lanes, lane), rate, weight))
            store_stage(work, lanes, lane, add_scaled(load_helicopter(work, lanes, lane), rate, reach))
    for lane in range(len(lanes)):
        store_helicopter(work, lanes, lane, normalised(load_sum(work, lanes, lane)))


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
def observe_plant(work: Work, lanes: Lanes, vehicle: VehicleParameters) -> None:
    """Thrust and skid load of the present state."""
    for lane in range(len(lanes)):
        air = load_air(work, lanes, lane)
        seen = outputs(load_helicopter(work, lanes, lane), air.wind_n_m_s, air.wind_e_m_s, air.wind_d_m_s, vehicle)
        work[layout.THRUST * len(lanes) + lane] = seen.thrust_n
        work[layout.CONTACT * len(lanes) + lane] = seen.contact_force_n
