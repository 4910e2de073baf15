"""What a smoother needs of a run, written as it happens: predictions, corrections, resets, and the estimates.

A journal of no rows is written nowhere and only counts; that is what a run without a smoother has.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import ONE_LANE, procedure
from flownav.estimation.landing.algebra import forget
from flownav.estimation.landing.states import STATES
from flownav.navigation.state import OBSERVED, ROWS, VALUE, Journal, Running

# kinds of entry, and where their numbers stand in it
PREDICTED, CORRECTED, FORGOTTEN, WRITTEN = 0.0, 1.0, 2.0, 3.0
STEP, MIDDLE, FORCE = 1, 2, 11  # a prediction: dt [s], R_EB in its middle (9), specific force NED (3)
INNOVATION, INNOVATION_VARIANCE, JACOBIAN, GAIN = 1, 2, 3, 3 + STATES  # a correction: nu, S, h, K
STATE = 1  # a reset: which
ENTRY = 3 + 2 * STATES


def new_journal(entries: int, estimates: int) -> Journal:
    """A journal of so many rows."""
    return Journal(
        np.zeros((entries, ENTRY)),
        np.zeros((estimates, STATES + 4)),
        np.zeros((estimates, STATES, STATES)),
        np.zeros(2, np.int64),
    )


@procedure
def next_entry(kind: float, on: Running) -> int:
    """The row of a new entry; -1 where the journal has no such row."""
    journal = on.journal
    row = journal.used[0]
    journal.used[0] = row + 1
    if row >= len(journal.entry):
        return -1
    journal.entry[row, 0] = kind
    return int(row)


@procedure
def note_prediction(dt_s: float, on: Running) -> None:
    """The prediction that was just made."""
    row = next_entry(PREDICTED, on)
    if row < 0:
        return
    line = on.journal.entry[row]
    line[STEP] = dt_s
    for i in range(9):
        line[MIDDLE + i] = on.work[ROWS.middle + i]
    for i in range(3):
        line[FORCE + i] = on.work[ROWS.force + i]


@procedure
def note_correction(on: Running) -> None:
    """The correction that was just made, its Jacobian on the states that `offers.put` named."""
    row = next_entry(CORRECTED, on)
    if row < 0:
        return
    line, work = on.journal.entry[row], on.work
    line[INNOVATION], line[INNOVATION_VARIANCE] = work[ROWS.innovation], work[ROWS.innovation_variance]
    for i in range(STATES):
        line[JACOBIAN + i], line[GAIN + i] = 0.0, work[ROWS.gain + i]
    for i in range(int(work[OBSERVED])):
        line[JACOBIAN + int(work[OBSERVED + 1 + i])] = work[ROWS.coefficient + i]


@procedure
def reset_state(state: int, variance: float, on: Running) -> None:
    """A state loses its correlations and gets this variance."""
    on.work[VALUE] = 1.0
    forget(on.work, ONE_LANE, ROWS, state, variance, VALUE)
    row = next_entry(FORGOTTEN, on)
    if row >= 0:
        on.journal.entry[row, STATE] = state


@procedure
def note_estimate(on: Running) -> None:
    """State, attitude and covariance of the estimate that was just written."""
    next_entry(WRITTEN, on)
    journal, work = on.journal, on.work
    row = journal.used[1]
    journal.used[1] = row + 1
    if row >= len(journal.state):
        return
    for i in range(STATES):
        journal.state[row, i] = work[ROWS.state + i]
        for j in range(STATES):
            journal.covariance[row, i, j] = work[ROWS.covariance + i * STATES + j]
    for i in range(4):
        journal.state[row, STATES + i] = work[ROWS.attitude + i]
