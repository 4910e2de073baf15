"""The plant of either kind of vehicle: which one is in the type of `rotors`, and the compiler drops the other."""

from __future__ import annotations

from flownav.core.compile import Lanes, Work, equation
from flownav.simulation import layout
from flownav.simulation.layout import PLANT, vehicle_as_is
from flownav.simulation.multirotor_plant import midpoint_step, observe_multirotor
from flownav.simulation.onboard import Onboard
from flownav.simulation.plant import observe_balanced, observe_plant, runge_kutta_step
from flownav.simulation.records import RotorSpeed
from flownav.vehicle.kinds import AnyState

_, store_rotor_speed = PLANT.access(RotorSpeed)


@equation
def place(work: Work, lanes: Lanes, lane: int, state: AnyState, rotors: tuple[int, ...] | None) -> None:
    """Put the vehicle of a lane where it starts; a helicopter's rotor has its own governed speed."""
    for field in range(len(state)):
        work[(layout.HELICOPTER + field) * len(lanes) + lane] = state[field]
    if rotors is None:
        store_rotor_speed(work, lanes, lane, RotorSpeed(vehicle_as_is(work, lanes, lane).main_speed_rad_s))


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
