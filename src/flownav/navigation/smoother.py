"""The best estimate after the flight: the navigator's run smoothed backwards over all of its readings.

The run is deterministic and all it knows lies in three arrays, so it is not kept but repeated: forward once with a
copy of them every CHUNK events, then, from the last chunk to the first, forward again with a journal and backward
through that. Memory is a copy a chunk, one chunk's journal, and the result.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import ONE_LANE, kernel
from flownav.estimation.landing.algebra import fold_attitude
from flownav.estimation.landing.backward import (
    back_over_correction,
    back_over_prediction,
    back_over_reset,
    smoothed_covariance,
)
from flownav.estimation.landing.states import STATES
from flownav.measurement import Array, EventQueue
from flownav.navigation.journal import (
    CORRECTED,
    FORCE,
    FORGOTTEN,
    GAIN,
    INNOVATION,
    INNOVATION_VARIANCE,
    JACOBIAN,
    MIDDLE,
    PREDICTED,
    STATE,
    STEP,
    new_journal,
)
from flownav.navigation.loop import run
from flownav.navigation.state import ROWS, WORK_ROWS, Running, empty_tape, new_memory, write_estimate

CHUNK = 2048  # events


class Mark(NamedTuple):
    """A running navigator before a chunk of events."""

    work: Array
    memory: Array
    used: NDArray[np.int64]
    written: NDArray[np.int64]  # rows of the journal that were used or counted


def smooth(queue: EventQueue, running: Running, chunk: int = CHUNK) -> Array:
    """Run a navigator that has heard nothing through a queue; its estimates smoothed, (n, ESTIMATE_COLUMNS).

    The rows are those of the tape's estimate, at the same instants. The tape is left as `run` leaves it.
    """
    chunks = [_part(queue, first, first + chunk) for first in range(0, len(queue.t_s), chunk)]
    marks = [_mark(running)]
    for part in chunks:
        run(part, running)
        marks.append(_mark(running))
    count = int(running.tape.used[0])
    smoothed = running._replace(work=np.zeros(WORK_ROWS), memory=new_memory(), tape=empty_tape(count, 0, 0))
    vector, matrix = np.zeros(STATES), np.zeros((STATES, STATES))
    for part, before, after in zip(chunks[::-1], marks[-2::-1], marks[:0:-1], strict=True):
        again = running._replace(journal=new_journal(*(after.written - before.written).tolist()))
        again.work[:], again.memory[:], again.tape.used[:] = before.work, before.memory, before.used
        run(part, again)
        go_back(again, vector, matrix, smoothed)
    running.work[:], running.memory[:], running.tape.used[:] = marks[-1].work, marks[-1].memory, marks[-1].used
    return smoothed.tape.estimate[::-1].copy()


def _part(queue: EventQueue, first: int, last: int) -> EventQueue:
    rows = slice(first, last)
    return EventQueue(
        queue.t_s[rows], queue.sensor[rows], queue.value[rows], queue.variance[rows], queue.quality[rows],
        queue.row[rows],
    )  # fmt: skip


def _mark(running: Running) -> Mark:
    return Mark(running.work.copy(), running.memory.copy(), running.tape.used.copy(), running.journal.used.copy())


@kernel
def go_back(on: Running, vector: Array, matrix: Array, smoothed: Running) -> None:
    """Backward through a journal, lambda and Lambda with it; each estimate, the last first, smoothed onto a tape."""
    journal = on.journal
    estimate = journal.used[1]
    for row in range(journal.used[0] - 1, -1, -1):
        line = journal.entry[row]
        kind = line[0]
        if kind == PREDICTED:
            middle, force = line[MIDDLE : MIDDLE + 9], line[FORCE : FORCE + 3]
            back_over_prediction(vector, matrix, line[STEP], middle, force, on.settings.filter)
        elif kind == CORRECTED:
            jacobian, gain = line[JACOBIAN : JACOBIAN + STATES], line[GAIN : GAIN + STATES]
            back_over_correction(vector, matrix, jacobian, gain, line[INNOVATION], line[INNOVATION_VARIANCE])
        elif kind == FORGOTTEN:
            back_over_reset(vector, matrix, int(line[STATE]))
        else:
            estimate -= 1
            put_smoothed(journal.state[estimate], journal.covariance[estimate], vector, matrix, smoothed.work)
            write_estimate(on.tape.estimate[on.tape.used[0] - journal.used[1] + estimate, 0], smoothed)


@kernel
def put_smoothed(state: Array, covariance: Array, vector: Array, matrix: Array, work: Array) -> None:
    """x - P lambda, its attitude part turned onto the quaternion, and P - P Lambda P, in a lane buffer of one lane."""
    change = covariance @ vector
    better = smoothed_covariance(covariance, matrix)
    for i in range(STATES):
        work[ROWS.state + i] = state[i] - change[i]
        for j in range(STATES):
            work[ROWS.covariance + i * STATES + j] = better[i, j]
    for i in range(4):
        work[ROWS.attitude + i] = state[STATES + i]
    fold_attitude(work, ONE_LANE, ROWS)
