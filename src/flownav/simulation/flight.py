"""The closed loop: plant, sensors, filter and autopilot, a block of flights side by side.

`fly_block` is the one entry point: a block of one lane is a single flight, a block of `LANES` a slice of a
batch, and both are the same bytes. Rates: physics 500 Hz (Runge-Kutta), flow dynamics and attitude loop
250 Hz, outer loop 50 Hz; the paper's sensors and filter 50 Hz, the vehicle's own sensors by their datasheets.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.compile import Lanes, Work, equation, invoke, kernel, pointer
from flownav.control.autopilot import grounded, hovering
from flownav.control.guidance import Reference, reference_at
from flownav.navigation.tape import Output, output_of
from flownav.simulation import layout
from flownav.simulation.draws import Noise, key_lanes, put_start
from flownav.simulation.epoch import (
    advance,
    advance_sensing,
    command,
    estimate_for_autopilot,
    note_home,
    note_inputs,
)
from flownav.simulation.filtering import run_filter, start_filter
from flownav.simulation.history import write_history
from flownav.simulation.layout import store_autopilot
from flownav.simulation.navigating import (
    Timetable,
    carry_ahead,
    compare_at_horizon,
    feed_due,
    hand_to_autopilot,
    note_knowledge,
    note_truth,
    put_on_truth,
)
from flownav.simulation.onboard import Onboard
from flownav.simulation.plan import ATTITUDE_STEPS, NOTHING, PHYSICS_S, PHYSICS_STEPS, START_STEP, Flight, OwnParts
from flownav.simulation.sampling import sample
from flownav.simulation.sensing import EPOCH_S, draw_epoch, sense, start_sensors
from flownav.simulation.surroundings import draw_recirculation, start_surroundings, surround
from flownav.simulation.units import draw_units, start_onboard
from flownav.simulation.vehicles import observe_vehicle, place


@equation
def draw_start(
    work: Work, lanes: Lanes, seed: int, first: int, flight: Flight, onboard: Onboard | None, noise: Noise
) -> None:
    """Every normal before the first epoch."""
    key_lanes(work, lanes, noise.streams, 0)
    draw_epoch(work, lanes, seed, first, START_STEP, flight.plan.draws)
    draw_recirculation(work, lanes, seed, first, START_STEP, flight.plan.draws.recirculation)
    if onboard is not None:
        draw_units(work, lanes, seed, first, START_STEP + 4)
    put_start(work, lanes, noise.start)


@equation
def start_block(
    work: Work, lanes: Lanes, seed: int, first: int, flight: Flight, onboard: Onboard | None, noise: Noise
) -> None:
    """Vehicle, surroundings, sensors and autopilot before the first epoch."""
    draw_start(work, lanes, seed, first, flight, onboard, noise)
    for lane in range(len(lanes)):
        place(work, lanes, lane, flight.plan.start, flight.rotors)
        autopilot = grounded(flight.gains) if flight.plan.starts_on_ground else hovering(flight.gains)
        store_autopilot(work, lanes, lane, autopilot)
    start_surroundings(work, lanes, flight.rotors)
    observe_start(work, lanes, flight, onboard, flight.own)
    start_sensors(work, lanes, flight.sensors)
    if onboard is not None:
        start_onboard(work, lanes, onboard)


@equation
def observe_start(work: Work, lanes: Lanes, flight: Flight, onboard: Onboard | None, own: OwnParts | None) -> None:
    """Thrust, ground load and power before the first epoch, for which somebody else's vehicle begins."""
    if own is not None and own.step != 0:
        invoke(own.step, work, 0.0)
    else:
        observe_vehicle(work, lanes, flight.rotors, onboard)


@equation
def surround_now(work: Work, lanes: Lanes, seed: int, first: int, epoch: int, t_s: float, flight: Flight) -> None:
    """Air, ground and engine of this epoch."""
    engine = 0.0 if t_s >= flight.plan.engine_cut_s else 1.0
    surround(work, lanes, seed, first, epoch, flight.rotors, flight.plan.draws.recirculation, engine)


@equation
def decide_on_paper(
    work: Work, lanes: Lanes, seed: int, first: int, noise: Noise, epoch: int, flight: Flight
) -> Reference:
    """One epoch of the paper's sensors and its filter, or of no filter at all, up to what the autopilot asks for."""
    t_s = epoch * EPOCH_S
    reference = reference_at(flight.path, t_s)
    key_lanes(work, lanes, noise.streams, epoch)
    draw_epoch(work, lanes, seed, first, epoch, flight.plan.draws)
    surround_now(work, lanes, seed, first, epoch, t_s, flight)
    sense(work, lanes, epoch, flight.sensors)
    if epoch == 0:
        start_filter(work, lanes, flight.initial_variance, flight.plan.start_known)
    run_filter(work, lanes, epoch, flight.paper)
    estimate_for_autopilot(work, lanes, flight)
    note_home(work, lanes, epoch, reference, flight)
    command(work, lanes, t_s, reference, flight, None)
    return reference


@equation
def advance_on_paper(work: Work, lanes: Lanes, flight: Flight) -> None:
    """From that epoch to the next."""
    advance(work, lanes, flight, flight.linear)
    note_inputs(work, lanes, flight.gains)


@equation
def fly_on_paper(
    work: Work, lanes: Lanes, seed: int, first: int, noise: Noise, flight: Flight, history: NDArray[np.float64]
) -> None:
    """Every epoch with the paper's sensors and its filter, or with no filter at all."""
    for epoch in range(flight.plan.epochs):
        reference = decide_on_paper(work, lanes, seed, first, noise, epoch, flight)
        write_history(work, lanes, epoch, reference, history)
        advance_on_paper(work, lanes, flight)


@equation
def inertial_parts(onboard: Onboard) -> int:
    """Inertial readings of an epoch."""
    return ATTITUDE_STEPS * PHYSICS_STEPS // onboard.inertial_steps


@equation
def decide_navigated(
    work: Work, nav: Work, lanes: Lanes, seed: int, first: int, noise: Noise, epoch: int, taken: int, following: int,
    heard: int, flight: Flight, onboard: Onboard, table: Timetable, take: int, settings: Work, o: Output, fed: Work,
) -> tuple[int, int, Reference]:  # fmt: skip
    """One epoch of the vehicle's own sensors and the navigator, up to what the autopilot asks for.

    taken: the next slot's number; following: that of the next reading that the navigator takes; heard: how many
    inertial readings there were. Returns the first two as they are then.
    """
    t_s, period_s = epoch * EPOCH_S, onboard.inertial_steps * PHYSICS_S
    ahead = table.horizon_epochs * inertial_parts(onboard)
    reference = reference_at(flight.path, t_s)
    key_lanes(work, lanes, noise.streams, epoch)
    draw_epoch(work, lanes, seed, first, epoch, flight.plan.draws)
    surround_now(work, lanes, seed, first, epoch, t_s, flight)
    taken = sample(work, lanes, seed, first, epoch, table.slots, taken, onboard, flight.fails)
    note_truth(work, lanes, epoch, table)
    following = feed_due(work, nav, lanes, epoch, following, take, settings, o, fed, table)
    carry_ahead(work, nav, lanes, heard, ahead if heard >= ahead else heard, period_s, table)
    compare_at_horizon(work, nav, lanes, epoch, table)
    if flight.plan.along_truth:
        put_on_truth(work, nav, lanes, epoch, table)
    note_knowledge(work, nav, lanes)
    waiting = t_s < flight.plan.handover_s
    hand_to_autopilot(work, nav, lanes, waiting, flight.plan.home_at_start, reference)
    estimate_for_autopilot(work, lanes, flight)
    command(work, lanes, t_s, reference, flight, onboard)
    return taken, following, reference


@equation
def fly_navigated(
    work: Work, nav: Work, lanes: Lanes, seed: int, first: int, noise: Noise, flight: Flight, onboard: Onboard,
    table: Timetable, take: int, settings: Work, o: Output, fed: Work, history: NDArray[np.float64],
) -> None:  # fmt: skip
    """Every epoch with the vehicle's own sensors and the navigator, on whose estimate of now the autopilot flies."""
    parts = inertial_parts(onboard)
    taken, following, heard = 0, 0, 0
    for epoch in range(flight.plan.epochs):
        taken, following, reference = decide_navigated(
            work, nav, lanes, seed, first, noise, epoch, taken, following, heard, flight, onboard, table, take,
            settings, o, fed,
        )  # fmt: skip
        write_history(work, lanes, epoch, reference, history)
        advance_sensing(work, lanes, seed, first, epoch, taken, heard, flight, onboard, table, flight.fails, flight.own)
        taken += parts
        heard += parts


@equation
def fly(
    work: Work, nav: Work, lanes: Lanes, seed: int, first: int, noise: Noise, flight: Flight, onboard: Onboard | None,
    table: Timetable | None, take: int, settings: Work, o: Output, fed: Work, history: NDArray[np.float64],
) -> None:  # fmt: skip
    """A block of flights, whichever filter flies; the compiler drops the branch of the other."""
    start_block(work, lanes, seed, first, flight, onboard, noise)
    if onboard is None:
        fly_on_paper(work, lanes, seed, first, noise, flight, history)
    elif table is not None:
        fly_navigated(work, nav, lanes, seed, first, noise, flight, onboard, table, take, settings, o, fed, history)


@kernel
def fly_block(
    flight: Flight, truth: NDArray[np.float64], seed: int, first: int, noise: Noise, lanes: Lanes,
    work: NDArray[np.float64], nav: NDArray[np.float64], take: int, estimate: NDArray[np.float64],
    innovation: NDArray[np.float64], event: NDArray[np.float64], fed: NDArray[np.float64], room: NDArray[np.int64],
    used: NDArray[np.int64], history: NDArray[np.float64],
) -> None:  # fmt: skip
    """Fly `len(lanes)` flights, numbers `first` and up, of a campaign `seed`, in the noise of these or in another.

    truth: `truth.packed_truth` of the lanes. work (rows of `engine.buffers_of`, times lanes) is scratch, zeroed here;
    nav: a navigator that has heard nothing (`navigation.memory.new_work`), taken at the address `take`; its tape and
    what it is fed flattened; history (epochs, len(HISTORY), len(lanes)) is filled.
    """
    for i in range(work.size):
        work[i] = 0.0
    for i in range(truth.size):
        work[layout.AS_IS_BEGIN * len(lanes) + i] = truth[i]
    o = output_of(estimate, innovation, event, NOTHING, NOTHING, NOTHING, room, used)
    fly(
        pointer(work), pointer(nav), lanes, seed, first, noise, flight, flight.onboard, flight.table, take,
        pointer(flight.settings), o, pointer(fed), history,
    )  # fmt: skip
