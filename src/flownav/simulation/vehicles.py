"""The plant of either kind of vehicle: which one is in the type of `rotors`, and the compiler drops the other."""

from __future__ import annotations

from flownav.compile import equation
from flownav.estimation.kalman import Lanes, Work
from flownav.simulation import layout
from flownav.simulation.multirotor_plant import midpoint_step, observe_multirotor
from flownav.simulation.plant import observe_plant, runge_kutta_step
from flownav.vehicle.kinds import AnyState


@equation
def place(work: Work, lanes: Lanes, lane: int, state: AnyState) -> None:
    """Put the vehicle of a lane where it starts."""
    for field in range(len(state)):
        work[(layout.HELICOPTER + field) * len(lanes) + lane] = state[field]


@equation
def step_vehicle(work: Work, lanes: Lanes, dt: float, rotors: tuple[int, ...] | None) -> None:
    """One step of every lane's vehicle."""
    if rotors is None:
        runge_kutta_step(work, lanes, dt)
    else:
        midpoint_step(work, lanes, dt, rotors)


@equation
def observe_vehicle(work: Work, lanes: Lanes, rotors: tuple[int, ...] | None) -> None:
    """Thrust, ground load and power of the present state."""
    if rotors is None:
        observe_plant(work, lanes)
    else:
        observe_multirotor(work, lanes, rotors)
