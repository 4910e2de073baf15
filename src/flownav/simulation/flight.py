"""The closed loop: plant, sensors, filter and autopilot, a block of flights side by side.

`fly_block` is the one entry point: a block of one lane is a single flight, a block of `LANES` a slice of a
batch, and both are the same bytes. Rates: physics 500 Hz (Runge-Kutta), flow dynamics and attitude loop
250 Hz, outer loop 50 Hz; the paper's sensors and filter 50 Hz, the vehicle's own sensors by their datasheets.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.control.autopilot import grounded, hovering
from flownav.control.guidance import Reference, reference_at
from flownav.control.learnt_gains import loop_gains_of
from flownav.core.compile import Lanes, Work, equation, invoke, kernel, pointer, replacing
from flownav.estimation import paper_filter
from flownav.estimation.paper_filter import STATES, PaperModel, start
from flownav.navigation.tape import output_of
from flownav.sensors.gps_ins import NavSolution
from flownav.simulation import calls, layout, navigating
from flownav.simulation.block import Aboard, Block, Buffers, Progress, key_lanes, put_start
from flownav.simulation.epoch import (
    advance,
    advance_sensing,
    command,
    estimate_for_autopilot,
    inertial_parts,
    note_home,
    note_inputs,
)
from flownav.simulation.history import write_history
from flownav.simulation.layout import PLANT, store_autopilot, store_loop_gains
from flownav.simulation.learning import learn
from flownav.simulation.onboard import Onboard
from flownav.simulation.plan import NOTHING, PHYSICS_S, START_STEP, Flight, OwnParts
from flownav.simulation.plant import observe_vehicle, place
from flownav.simulation.records import Estimated, Measured, PaperState, PaperVariance, Spread
from flownav.simulation.sensing import EPOCH_S, draw_epoch, sense, start_sensors
from flownav.simulation.sensor_loops import draw_units, sample, start_onboard
from flownav.simulation.surroundings import Runs, draw_recirculation, slow_servos, start_surroundings, surround
from flownav.vehicle.state import HelicopterState


@equation
def draw_start(b: Block, flight: Flight, onboard: Onboard | None) -> None:
    """Every normal before the first epoch."""
    key_lanes(b.work, b.lanes, b.noise.streams, 0)
    draw_epoch(b.work, b.lanes, b.seed, b.first, START_STEP, flight.plan.draws)
    draw_recirculation(b.work, b.lanes, b.seed, b.first, START_STEP, flight.plan.draws.recirculation)
    if onboard is not None:
        draw_units(b.work, b.lanes, b.seed, b.first, START_STEP + 4)
    put_start(b.work, b.lanes, b.noise.start)


@equation
def start_block(b: Block, flight: Flight, onboard: Onboard | None) -> None:
    """Vehicle, surroundings, sensors and autopilot before the first epoch."""
    draw_start(b, flight, onboard)
    work, lanes = b.work, b.lanes
    for lane in range(len(lanes)):
        place(work, lanes, lane, flight.plan.start, flight.rotors)
        autopilot = grounded(flight.gains) if flight.plan.starts_on_ground else hovering(flight.gains)
        store_autopilot(work, lanes, lane, autopilot)
        store_loop_gains(work, lanes, lane, loop_gains_of(flight.gains))
    start_surroundings(work, lanes, flight.rotors)
    observe_start(work, lanes, flight, onboard, flight.own)
    start_sensors(work, lanes, flight.sensors)
    if onboard is not None:
        start_onboard(work, lanes, onboard)


@equation
def observe_start(work: Work, lanes: Lanes, flight: Flight, onboard: Onboard | None, own: OwnParts | None) -> None:
    """Thrust, ground load and power before the first epoch, for which a user's own vehicle begins."""
    if own is not None and own.step != 0:
        invoke(own.step, work, 0.0)
    else:
        observe_vehicle(work, lanes, flight.rotors, onboard)


@equation
def begin_epoch(b: Block, epoch: int, flight: Flight) -> Reference:
    """Noise, air, ground and engine of this epoch; where the path wants the vehicle."""
    t_s = epoch * EPOCH_S
    key_lanes(b.work, b.lanes, b.noise.streams, epoch)
    draw_epoch(b.work, b.lanes, b.seed, b.first, epoch, flight.plan.draws)
    happens, rotors = flight.plan.happens, flight.rotors
    now = Runs(
        0.0 if t_s >= happens.engine_cut_s else 1.0,
        1.0 if rotors is not None and t_s >= happens.motor_out_s else 0.0,
        1.0 if t_s >= happens.tail_stuck_s else 0.0,
    )
    surround(b.work, b.lanes, b.seed, b.first, epoch, rotors, flight.plan.draws.recirculation, now)
    if rotors is None and epoch == int(happens.servos_slow_s / EPOCH_S + 0.5):
        slow_servos(b.work, b.lanes)
    return reference_at(flight.path, t_s)


@equation
def decide_on_paper(b: Block, epoch: int, flight: Flight) -> Reference:
    """One epoch of the paper's sensors and its filter, or of no filter at all, up to the autopilot's commands."""
    work, lanes = b.work, b.lanes
    reference = begin_epoch(b, epoch, flight)
    sense(work, lanes, epoch, flight.sensors)
    if epoch == 0:
        start_filter(work, lanes, flight.initial_variance, flight.plan.start_known)
    run_filter(work, lanes, epoch, flight.paper)
    estimate_for_autopilot(work, lanes, flight.plan.fly_on_truth)
    note_home(work, lanes, epoch, reference, flight)
    command(work, lanes, epoch * EPOCH_S, reference, flight, None)
    return reference


@equation
def advance_on_paper(work: Work, lanes: Lanes, flight: Flight) -> None:
    """From that epoch to the next."""
    advance(work, lanes, flight, flight.linear)
    note_inputs(work, lanes, flight.gains)


def epochs_on_paper(note: Callable[..., None]) -> Callable[..., None]:
    """An equation: every epoch with the paper's sensors and its filter, or with no filter at all.

    note(work, lanes, epoch, reference, flight, onboard, into) keeps what an epoch shows.
    """

    @equation
    def fly_epochs(b: Block, flight: Flight, into: Any) -> None:
        for epoch in range(flight.plan.epochs):
            reference = decide_on_paper(b, epoch, flight)
            note(b.work, b.lanes, epoch, reference, flight, None, into)
            advance_on_paper(b.work, b.lanes, flight)

    return fly_epochs


@equation
def decide_navigated(
    b: Block, aboard: Aboard, flight: Flight, onboard: Onboard, table: navigating.Timetable, epoch: int, at: Progress
) -> tuple[Progress, Reference]:
    """One epoch of the vehicle's own sensors and the navigator, up to the autopilot's commands."""
    work, lanes, nav, t_s = b.work, b.lanes, aboard.nav, epoch * EPOCH_S
    ahead = table.horizon_epochs * inertial_parts(onboard)
    reference = begin_epoch(b, epoch, flight)
    taken = sample(work, lanes, b.seed, b.first, epoch, table.slots, at.taken, onboard, flight.fails)
    navigating.note_truth(work, lanes, navigating.truth_row(epoch, table))
    following = navigating.feed_due(work, lanes, epoch, at.following, aboard, table)
    ahead = ahead if at.inertial >= ahead else at.inertial
    navigating.carry_ahead(work, nav, lanes, at.inertial, ahead, onboard.inertial_steps * PHYSICS_S, table)
    reached, then = epoch >= table.horizon_epochs, navigating.truth_row(epoch - table.horizon_epochs, table)
    navigating.compare_at_horizon(work, lanes, reached, nav=nav, truth_row=then)
    navigating.note_normalised_error(work, nav, lanes, reached, then)
    if flight.plan.along_truth:
        navigating.put_on_truth(work, lanes, reached, nav=nav, truth_row=then)
    navigating.note_knowledge(work, lanes, nav)
    navigating.hand_to_autopilot(
        work, lanes, t_s < flight.plan.handover_s, at_start=flight.plan.home_at_start, reference=reference, nav=nav
    )
    estimate_for_autopilot(work, lanes, flight.plan.fly_on_truth)
    learn(work, lanes, epoch, flight.gains, flight.learns)
    command(work, lanes, t_s, reference, flight, onboard)
    return Progress(taken, following, at.inertial), reference


def epochs_navigated(note: Callable[..., None]) -> Callable[..., None]:
    """An equation: every epoch with the vehicle's own sensors and the navigator, whose estimate of now the autopilot
    uses.

    note: as of `epochs_on_paper`.
    """

    @equation
    def fly_epochs(
        b: Block, aboard: Aboard, flight: Flight, onboard: Onboard, table: navigating.Timetable, into: Any
    ) -> None:
        parts, at = inertial_parts(onboard), Progress(0, 0, 0)
        for epoch in range(flight.plan.epochs):
            at, reference = decide_navigated(b, aboard, flight, onboard, table, epoch, at)
            note(b.work, b.lanes, epoch, reference, flight, onboard, into)
            advance_sensing(b, flight, onboard, table, epoch, at, flight.own)
            at = Progress(at.taken + parts, at.following, at.inertial + parts)

    return fly_epochs


@equation
def note_history(
    work: Work, lanes: Lanes, epoch: int, reference: Reference, flight: Flight, onboard: Onboard | None,
    history: NDArray[np.float64],
) -> None:  # fmt: skip
    """Write an epoch into the flights' history."""
    write_history(work, lanes, epoch, reference, history)


fly_on_paper = epochs_on_paper(note_history)
fly_navigated = epochs_navigated(note_history)


@equation
def fly(
    b: Block, aboard: Aboard, flight: Flight, onboard: Onboard | None, table: navigating.Timetable | None,
    history: NDArray[np.float64],
) -> None:  # fmt: skip
    """A block of flights, whichever filter flies; the compiler drops the branch of the other."""
    start_block(b, flight, onboard)
    if onboard is None:
        fly_on_paper(b, flight, history)
    elif table is not None:
        fly_navigated(b, aboard, flight, onboard, table, history)


@kernel
def fly_block(flight: Flight, truth: NDArray[np.float64], block: Block, buffers: Buffers, take: int) -> None:
    """Fly the flights of a block, whose lane buffer is scratch, zeroed here.

    truth: `truth.packed_truth` of the lanes. The buffers' navigator, taken at the address `take`, is a new one; the
    tape, the readings fed and the history are filled.
    """
    lanes, tape, work = block.lanes, buffers.tape, block.work
    for i in range(work.size):
        work[i] = 0.0
    for i in range(truth.size):
        work[layout.AS_IS_BEGIN * len(lanes) + i] = truth[i]
    o = output_of(
        tape.estimate.reshape(-1), tape.innovation.reshape(-1), tape.event.reshape(-1), NOTHING, NOTHING, NOTHING,
        buffers.room, tape.used,
    )  # fmt: skip
    b = Block(pointer(work), lanes, block.seed, block.first, block.noise)
    aboard = Aboard(pointer(buffers.nav), take, pointer(flight.settings), o, pointer(buffers.fed.reshape(-1)))
    fly(b, aboard, flight, flight.onboard, flight.table, buffers.history)


at_position = replacing(PaperState, "pos_n_m", "pos_e_m", "pos_d_m")
with_motion = replacing(Estimated, *PaperState._fields)
with_attitude = replacing(Estimated, "qw", "qx", "qy", "qz")


@equation
def start_filter(work: Work, lanes: Lanes, variance: NDArray[np.float64], start_known: bool) -> None:
    """x: the known start, or the first GPS position; velocity zero. P = diag(variance)."""
    start(work, lanes, layout.FILTER, STATES, variance)
    start_position(work, lanes, start_known)


@PLANT.on_lanes(calls.start_position)
def start_position(x: PaperState, state: HelicopterState, measured: Measured, *, start_known: bool) -> PaperState:
    """The filter's state at the known start, or at the first GPS position."""
    return at_position(
        x,
        pos_n_m=state.pos_n if start_known else measured.pos_n_m,
        pos_e_m=state.pos_e if start_known else measured.pos_e_m,
        pos_d_m=state.pos_d if start_known else measured.pos_d_m,
    )


@equation
def run_filter(work: Work, lanes: Lanes, epoch: int, paper: PaperModel | None) -> None:
    """Predict over the last epoch, correct with this one's readings, and return the estimate.

    The compiler drops the branch where the filter is None.
    """
    if paper is not None:
        run_paper_filter(work, lanes, epoch, paper)
        say_state(work, lanes)
    say_ins_attitude(work, lanes)


@equation
def run_paper_filter(work: Work, lanes: Lanes, epoch: int, model: PaperModel) -> None:
    """Equations 24-30."""
    if epoch > 0:
        paper_filter.predict(work, lanes, layout.FILTER, layout.INPUT, model)
    paper_filter.update(work, lanes, layout.FILTER, layout.MEASURED, layout.ARRIVED, layout.INNOVATION, model)


class Stated(NamedTuple):
    """The filter's estimate and its spread."""

    estimated: Estimated
    spread: Spread


@PLANT.on_lanes(calls.say_state)
def say_state(stated: Estimated, x: PaperState, variance: PaperVariance) -> Stated:
    """The estimate is the state."""
    estimated = with_motion(
        stated, pos_n_m=x.pos_n_m, pos_e_m=x.pos_e_m, pos_d_m=x.pos_d_m, vel_u_m_s=x.vel_u_m_s, vel_v_m_s=x.vel_v_m_s,
        vel_w_m_s=x.vel_w_m_s,
    )  # fmt: skip
    return Stated(estimated, Spread(*variance))


@PLANT.on_lanes(calls.say_ins_attitude)
def say_ins_attitude(stated: Estimated, gps: NavSolution) -> Estimated:
    """A filter without an attitude of its own reports the INS's."""
    return with_attitude(stated, qw=gps.qw, qx=gps.qx, qy=gps.qy, qz=gps.qz)
