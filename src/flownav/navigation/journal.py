"""A smoother's journal of a run, written as it happens: predictions, corrections, resets, decays, and the estimates.

A journal of no rows is written nowhere and only counts; that is what a run without a smoother has. It is of one lane.
"""

from flownav.core.compile import ONE_LANE, Lanes, Work, gathering, procedure, row_of
from flownav.estimation.covariance import covariance_of, forget_lane, states_of
from flownav.estimation.states import (
    ACCEPTED,
    COEFFICIENT,
    FORCE,
    GAIN,
    INNOVATION,
    INNOVATION_VARIANCE,
    MIDDLE,
    OBSERVED,
    QUATERNION,
    STATE,
    STATES,
)
from flownav.navigation.entries import (
    CORRECTED,
    CORRECTION,
    DECAYED,
    ENTRY,
    FORGOTTEN,
    NOTED,
    PREDICTED,
    CorrectionEntry,
    DecayEntry,
    PredictionEntry,
    ResetEntry,
    store_correction,
    store_decay,
    store_prediction,
    store_reset,
)
from flownav.navigation.tape import ENTRIES, NOTES, Output

NO_STATES = (0.0,) * STATES
load_middle = gathering(row_of, range(MIDDLE, MIDDLE + 9))
load_force = gathering(row_of, range(FORCE, FORCE + 3))
load_gain = gathering(row_of, range(GAIN, GAIN + STATES))


@procedure
def next_entry(o: Output) -> int:
    """The row of a new entry; -1 where the journal has no such row."""
    row = o.used[ENTRIES]
    o.used[ENTRIES] = row + 1
    return int(row) if row < o.room[3] else -1


@procedure
def note_prediction(work: Work, lanes: Lanes, dt_s: float, o: Output) -> None:
    """The prediction that was just made."""
    row = next_entry(o)
    if row >= 0:
        entry = PredictionEntry(PREDICTED, dt_s, load_middle(work, lanes, 0), load_force(work, lanes, 0))
        store_prediction(o.entry, ONE_LANE, row, 0, entry)


@procedure
def note_decay(dt_s: float, o: Output) -> None:
    """The Gauss-Markov errors went on by dt."""
    row = next_entry(o)
    if row >= 0:
        store_decay(o.entry, ONE_LANE, row, 0, DecayEntry(DECAYED, dt_s))


@procedure
def note_correction(work: Work, lanes: Lanes, o: Output) -> None:
    """The correction that was just made, if one was; its Jacobian on the states that its law named."""
    if row_of(work, lanes, ACCEPTED, 0) == 0.0:
        return
    row = next_entry(o)
    if row < 0:
        return
    innovation, variance = row_of(work, lanes, INNOVATION, 0), row_of(work, lanes, INNOVATION_VARIANCE, 0)
    entry = CorrectionEntry(CORRECTED, innovation, variance, NO_STATES, load_gain(work, lanes, 0))
    store_correction(o.entry, ONE_LANE, row, 0, entry)
    for i in range(int(row_of(work, lanes, OBSERVED, 0))):
        state = int(row_of(work, lanes, OBSERVED + 1 + i, 0))
        o.entry[row * ENTRY + CORRECTION.jacobian + state] = row_of(work, lanes, COEFFICIENT + i, 0)


@procedure
def reset_state(work: Work, lanes: Lanes, lane: int, state: int, variance: float, o: Output) -> None:
    """A state of one lane loses its correlations and gets this variance."""
    forget_lane(work, lanes, states_of(lanes), state, lane, variance)
    if len(lanes) == 1:
        row = next_entry(o)
        if row >= 0:
            store_reset(o.entry, ONE_LANE, row, 0, ResetEntry(FORGOTTEN, state))


@procedure
def note_estimate(work: Work, lanes: Lanes, o: Output) -> None:
    """State, attitude and covariance of the estimate that was just written."""
    entry = next_entry(o)
    if entry >= 0:
        o.entry[entry * ENTRY] = NOTED
    row = o.used[NOTES]
    o.used[NOTES] = row + 1
    if row >= o.room[4]:
        return
    for i in range(STATES):
        o.state[row * (STATES + 4) + i] = row_of(work, lanes, STATE + i, 0)
        for j in range(STATES):
            o.covariance[(row * STATES + i) * STATES + j] = covariance_of(work, lanes, i, j, 0)
    for i in range(4):
        o.state[row * (STATES + 4) + STATES + i] = row_of(work, lanes, QUATERNION + i, 0)
