"""One flight on a CUDA device: the thread that flies it, and its scores as it flies.

A thread flies the scalar build, `ONE_LANE`, of the same equations as the CPU; its rows lie among those of its warp
(`compile.strided`). No history leaves the device: scores are kept epoch by epoch (`scoring.running`).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.control.guidance import Reference
from flownav.core.compile import ONE_LANE, WARP, Lanes, Work, equation, pointer, procedure, strided
from flownav.core.measurement import Array
from flownav.navigation.take import navigate
from flownav.navigation.tape import output_of
from flownav.scoring.running import RUNNING_ROWS, Shown, Terms, begin_scores, note_shown, write_scores
from flownav.sensors.geometry import ground_height
from flownav.simulation import layout
from flownav.simulation.block import Aboard, Block, Noise
from flownav.simulation.flight import epochs_navigated, epochs_on_paper, start_block
from flownav.simulation.layout import (
    ground_as_is,
    load_autopilot,
    load_estimated,
    load_helicopter,
    load_loads,
)
from flownav.simulation.onboard import Onboard
from flownav.simulation.plan import Flight
from flownav.simulation.sensing import EPOCH_S

Integers = NDArray[np.int64]

TAPE_COUNTS = 8  # what a tape counts of one lane, and room to spare


@equation
def begin_flight(work: Array, rows: int, truth: Array, flights: int, flight: int) -> Any:
    """The rows of a device's `flight`-th flight, zero but for its truth. work: rows of whole warps.

    truth: (TRUTH_ROWS, flights) flattened, or of one flight, for all.
    """
    own = strided(work, (flight // WARP) * rows * WARP + flight % WARP)
    apart, column = (1, 0) if len(truth) == layout.AS_IS_END - layout.AS_IS_BEGIN else (flights, flight)
    for row in range(rows):
        own[row] = 0.0
    for row in range(layout.AS_IS_END - layout.AS_IS_BEGIN):
        own[layout.AS_IS_BEGIN + row] = truth[row * apart + column]
    begin_scores(own, ONE_LANE, rows - RUNNING_ROWS)
    return own


@equation
def fly_paper_flight(
    thread: int, flights: int, seed: int, first: int, noise: Noise, flight: Flight, truth: Array, home: int, rows: int,
    work: Array, scores: Array,
) -> None:  # fmt: skip
    """Flight `first + thread` on the paper's filter. rows: of `work` for one flight, the last are the scores'.

    noise: `draws.plain_noise(1)`, each flight's own.
    home: the epoch to whose errors horizontal ones are relative; -1: to none. scores (RUNNING_COLUMNS, flights).
    """
    own, row = begin_flight(work, rows, truth, flights, thread), rows - RUNNING_ROWS
    block = Block(own, ONE_LANE, seed, first + thread, noise)
    start_block(block, flight, None)
    score_on_paper(block, flight, (row, home))
    finish(own, row, flight, scores, thread)


@equation
def fly_navigated_flight(
    thread: int, flights: int, seed: int, first: int, noise: Noise, flight: Flight, truth: Array, rows: int,
    work: Array, fresh: Array, nav: Array, nothing: Array, room: Integers, used: Integers, take: Any, scores: Array,
) -> None:  # fmt: skip
    """Flight `first + thread` on the navigator, which writes no tape.

    fresh: a new navigator (`navigation.memory.new_work`); nav: such rows for whole warps. nothing,
    room, used (flights * TAPE_COUNTS,): a tape without room, which only counts. take: how the flight calls the
    navigator; on a device the marker of its build, see `take_here`.
    """
    own, row = begin_flight(work, rows, truth, flights, thread), rows - RUNNING_ROWS
    mind = strided(nav, (thread // WARP) * len(fresh) * WARP + thread % WARP)
    for i in range(len(fresh)):
        mind[i] = fresh[i]
    counted = used[thread * TAPE_COUNTS : (thread + 1) * TAPE_COUNTS]
    for i in range(TAPE_COUNTS):
        counted[i] = 0
    o = output_of(nothing, nothing, nothing, nothing, nothing, nothing, room, counted)
    aboard = Aboard(mind, take, pointer(flight.settings), o, pointer(nothing))
    block = Block(own, ONE_LANE, seed, first + thread, noise)
    start_block(block, flight, flight.onboard)
    score_navigated(block, aboard, flight, flight.onboard, flight.table, (row, -1))
    finish(own, row, flight, scores, thread)


@procedure
def take_here(
    lanes: Lanes, work: Work, p: Work, estimate: Work, innovation: Work, event: Work, entry: Work, state: Work,
    covariance: Work, room: Integers, used: Integers, t_s: float, sensor: int,
) -> None:  # fmt: skip
    """The navigator called as it is, not through an address. lanes: the marker of its build (`covariance.with_lag`)."""
    o = output_of(estimate, innovation, event, entry, state, covariance, room, used)
    navigate(work, lanes, p, o, t_s, sensor)


# -- scores -------------------------------------------------------------------------------------------------------
@equation
def note_epoch(
    work: Work, lanes: Lanes, epoch: int, reference: Reference, flight: Flight, onboard: Onboard | None,
    into: tuple[int, int],
) -> None:  # fmt: skip
    """Add this epoch to the scores of this flight. into: their first row; the epoch of `home`."""
    row, home = into
    state, says = load_helicopter(work, ONE_LANE, 0), load_estimated(work, ONE_LANE, 0)
    ground_m = ground_height(state.pos_n, state.pos_e, ground_as_is(work, ONE_LANE, 0))
    grounded, t_s = load_loads(work, ONE_LANE, 0).contact_n > 0.0, epoch * EPOCH_S
    error_n, error_e = says.pos_n_m - state.pos_n, says.pos_e_m - state.pos_e
    flies = not flight.plan.fly_on_truth
    counts = is_counted(onboard, grounded, t_s, flight.plan.handover_s)
    shown = Shown(
        state.pos_n, state.pos_e, state.pos_d, state.u, state.v, state.w, state.qw, state.qx, state.qy, state.qz,
        state.r, ground_m, grounded, load_autopilot(work, ONE_LANE, 0).away > 0.0,
        error_n, error_e, says.pos_d_m - state.pos_d, says.vel_u_m_s - state.u, says.vel_v_m_s - state.v,
        says.vel_w_m_s - state.w,
        error_n if flies else 0.0, error_e if flies else 0.0,
        counts, not grounded and epoch >= home, sees_pad(onboard, -state.pos_d, epoch, home, flight.plan.handover_s),
        epoch == home,
    )  # fmt: skip
    note_shown(work, ONE_LANE, row, 0, epoch, shown, flight.vehicle.cg_above_skid_m)


score_on_paper = epochs_on_paper(note_epoch)
score_navigated = epochs_navigated(note_epoch)


@equation
def is_counted(onboard: Onboard | None, grounded: bool, t_s: float, handover_s: float) -> bool:
    """Whether this step's errors are scored, as `campaign.local.counted_steps`."""
    return True if onboard is None else t_s >= handover_s and not grounded


@equation
def sees_pad(onboard: Onboard | None, cg_height_m: float, epoch: int, home: int, handover_s: float) -> bool:
    """Whether the pad's place was to be seen or noted, as `campaign.local.pad_to_be_seen`."""
    if onboard is None:
        return epoch <= (home if home > 0 else 0)
    lens_m = cg_height_m - onboard.carried.pad_camera.place.down_m
    inside = lens_m >= onboard.carried.pad_camera.p.min_height_m and lens_m <= onboard.carried.pad_camera.p.max_height_m
    return inside if onboard.carried.pad_camera.clock.fitted else epoch * EPOCH_S <= handover_s


@equation
def finish(work: Work, row: int, flight: Flight, scores: Array, thread: int) -> None:
    """The flight's column of scores."""
    plan = flight.plan
    terms = Terms(plan.epochs, EPOCH_S, plan.may_land_after_s, flight.limits)
    write_scores(work, ONE_LANE, row, 0, terms, scores, thread)
