"""The best estimate after the flight: the navigator's run smoothed backwards over all of its readings.

The run is deterministic and all it knows lies in its lane buffer, so it is not kept but repeated: forward once with a
copy of that buffer every EVENTS_AT_ONCE events, then, from the last chunk to the first, forward again with a journal
and backward through that. Memory is a copy a chunk, one chunk's journal, and the result.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import ONE_LANE, kernel, pointer
from flownav.core.errors import InputError
from flownav.core.measurement import Array, EventQueue
from flownav.estimation.covariance import at
from flownav.estimation.error_models import FilterSettings
from flownav.estimation.smoother import (
    back_over_correction,
    back_over_decay,
    back_over_prediction,
    back_over_reset,
    smoothed_covariance,
)
from flownav.estimation.states import CONSIDERS, QUATERNION, STATE, STATES, fold_attitude
from flownav.navigation.entries import (
    CORRECTED,
    DECAYED,
    FORGOTTEN,
    PREDICTED,
    view_correction,
    view_decay,
    view_prediction,
    view_reset,
)
from flownav.navigation.kernel_settings import carries_lag
from flownav.navigation.loop import Running, run
from flownav.navigation.memory import SCALE_DOUBT, new_work, store_start
from flownav.navigation.records import StartMemory
from flownav.navigation.tape import (
    ENTRIES,
    ESTIMATES,
    NOTES,
    Journal,
    Tape,
    empty_tape,
    output_of,
    room_of,
    write_estimate,
)

EVENTS_AT_ONCE = 2048  # events


class Mark(NamedTuple):
    """A running navigator before a chunk of events."""

    work: Array
    used: NDArray[np.int64]


class Backward(NamedTuple):
    """lambda (STATES,) and Lambda (STATES, STATES): the information of later readings on the error state."""

    vector: Array
    matrix: Array


def smooth(queue: EventQueue, running: Running, chunk: int = EVENTS_AT_ONCE) -> Array:
    """Run a new navigator through a queue; its estimates smoothed, (n, ESTIMATE_COLUMNS).

    The rows are those of the tape's estimate, at the same instants. No state is merely considered in this run: what
    goes back over a correction is that of the gain P h'/S. The tape is left as such a run leaves it.
    """
    if carries_lag(running.given.flow):
        raise InputError("the smoother knows no flow sensor's dynamics; it needs settings of flow_lag_c_1_s2 = 0")
    running.work[CONSIDERS] = 0.0
    chunks = [part_of(queue, first, first + chunk) for first in range(0, len(queue.t_s), chunk)]
    marks = [_mark(running)]
    for part in chunks:
        run(part, running)
        marks.append(_mark(running))
    found = empty_tape(int(running.tape.used[ESTIMATES]), 0, 0)
    work = new_work(ONE_LANE)
    store_start(work, ONE_LANE, 0, StartMemory(1.0, *[0.0] * (len(StartMemory._fields) - 1)))
    work[SCALE_DOUBT] = running.work[SCALE_DOUBT]
    later = Backward(np.zeros(STATES), np.zeros((STATES, STATES)))
    for part, before, after in zip(chunks[::-1], marks[-2::-1], marks[:0:-1], strict=True):
        tape = _repeated(part, running, before, after)
        estimates = tape.estimate[before.used[ESTIMATES] : after.used[ESTIMATES], 0, 0]
        _go_back(tape, estimates, running.given.filter, later, work, found)
    running.work[:], running.tape.used[:] = marks[-1]
    return found.estimates()[::-1].copy()


def part_of(queue: EventQueue, first: int, last: int) -> EventQueue:
    """Rows first to last of a queue."""
    columns: dict[str, Any] = {name: column[first:last] for name, column in queue._asdict().items()}
    return EventQueue(**columns)


def _mark(running: Running) -> Mark:
    return Mark(running.work.copy(), running.tape.used.copy())


def _repeated(part: EventQueue, running: Running, before: Mark, after: Mark) -> Tape:
    """The tape after the part was fed again, with a journal of it."""
    entries, notes = (int(after.used[place] - before.used[place]) for place in (ENTRIES, NOTES))
    tape = running.tape._replace(journal=empty_tape(0, 0, 0, journal=(entries, notes)).journal, used=before.used.copy())
    tape.used[[ENTRIES, NOTES]] = 0
    run(part, running._replace(work=before.work.copy(), tape=tape))
    return tape


def _go_back(tape: Tape, t_s: Array, given: FilterSettings, later: Backward, work: Array, found: Tape) -> None:
    """Backward through a tape's journal; each of its estimates, the last first, smoothed onto the tape `found`."""
    estimate = found.estimate.reshape(-1)
    go_back(tape.journal, np.ascontiguousarray(t_s), given, later, work, estimate, room_of(found), found.used)


@kernel
def go_back(
    journal: Journal, t_s: Array, given: FilterSettings, later: Backward, work: Array, found: Array,
    room: NDArray[np.int64], used: NDArray[np.int64],
) -> None:  # fmt: skip
    """Backward through a journal, lambda and Lambda with it; t_s: the instants of its estimates."""
    entry, state, covariance = journal
    vector, matrix = later
    output = output_of(found, found, found, found, found, found, room, used)
    estimate = len(t_s)
    for row in range(len(entry) - 1, -1, -1):
        line = entry[row]
        kind = line[0]
        if kind == PREDICTED:
            p = view_prediction(line)
            back_over_prediction(vector, matrix, p.dt_s, p.middle, p.force_ned_m_s2)
        elif kind == DECAYED:
            back_over_decay(vector, matrix, view_decay(line).dt_s, given)
        elif kind == CORRECTED:
            c = view_correction(line)
            back_over_correction(vector, matrix, c.jacobian, c.gain, c.innovation, c.variance)
        elif kind == FORGOTTEN:
            back_over_reset(vector, matrix, int(view_reset(line).state))
        else:
            estimate -= 1
            put_smoothed(state[estimate], covariance[estimate], vector, matrix, work)
            write_estimate(pointer(work), ONE_LANE, t_s[estimate], output)


@kernel
def put_smoothed(state: Array, covariance: Array, vector: Array, matrix: Array, work: Array) -> None:
    """x - P lambda, its attitude part turned onto the quaternion, and P - P Lambda P, in a lane buffer of one lane.

    A variance that rounding leaves below zero, after minutes without an aid, stays as the filter had it.
    """
    change = covariance @ vector
    better = smoothed_covariance(covariance, matrix)
    for j in range(STATES):
        work[STATE + j] = state[j] - change[j]
        for i in range(j + 1):
            work[at(i, j)] = better[i, j]
        if not better[j, j] > 0.0:
            work[at(j, j)] = covariance[j, j]
    for i in range(4):
        work[QUATERNION + i] = state[STATES + i]
    fold_attitude(pointer(work), ONE_LANE)
