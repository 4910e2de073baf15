"""The multirotor on lanes: the midpoint rule, two evaluations a step, for its motors are slower than servos."""

from __future__ import annotations

from flownav.core.compile import Lanes, Work, equation
from flownav.simulation.layout import (
    load_around,
    load_controls,
    load_multirotor,
    load_multirotor_stage,
    load_roots,
    multirotor_as_is,
    store_multirotor,
    store_multirotor_stage,
    store_roots,
)
from flownav.simulation.plant import note_outputs
from flownav.vehicle.motors import mixed, roots_of_shares
from flownav.vehicle.multirotor import derivative_at_roots, outputs
from flownav.vehicle.state import moved, of_unit_attitude


@equation
def midpoint_step(work: Work, lanes: Lanes, dt: float, rotors: tuple[int, ...]) -> None:
    """One step of every lane's multirotor; controls and surroundings held over the step (`multirotor.step`)."""
    hexa = len(rotors) > 4
    for lane in range(len(lanes)):
        state, vehicle = load_multirotor(work, lanes, lane), multirotor_as_is(work, lanes, lane)
        roots = roots_of_shares(mixed(load_controls(work, lanes, lane), hexa, vehicle), hexa)
        store_roots(work, lanes, lane, roots)
        rate = derivative_at_roots(state, roots, load_around(work, lanes, lane), hexa, vehicle)
        store_multirotor_stage(work, lanes, lane, moved(state, rate, 0.5 * dt))
    for lane in range(len(lanes)):
        state, vehicle = load_multirotor_stage(work, lanes, lane), multirotor_as_is(work, lanes, lane)
        roots = load_roots(work, lanes, lane)
        rate = derivative_at_roots(state, roots, load_around(work, lanes, lane), hexa, vehicle)
        before = load_multirotor(work, lanes, lane)
        store_multirotor(work, lanes, lane, of_unit_attitude(moved(before, rate, dt)))


@equation
def observe_multirotor(work: Work, lanes: Lanes, rotors: tuple[int, ...]) -> None:
    """Thrust, load of the feet and power of the present state."""
    hexa = len(rotors) > 4
    for lane in range(len(lanes)):
        around, vehicle = load_around(work, lanes, lane), multirotor_as_is(work, lanes, lane)
        note_outputs(work, lanes, lane, outputs(load_multirotor(work, lanes, lane), around, hexa, vehicle))
