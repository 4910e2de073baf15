"""What a smoother needs of a run, written as it happens: predictions, corrections, resets, decays, and the estimates.

A journal of no rows is written nowhere and only counts; that is what a run without a smoother has. It is of one lane.
"""

from __future__ import annotations

from flownav.compile import Lanes, Work, procedure
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
from flownav.navigation.tape import (
    CORRECTED,
    DECAYED,
    ENTRIES,
    ENTRY,
    FORCE_AT,
    FORGOTTEN,
    GAIN_AT,
    INNOVATION_AT,
    JACOBIAN_AT,
    MIDDLE_AT,
    NOTED,
    NOTES,
    PREDICTED,
    STATE_AT,
    STEP,
    VARIANCE_AT,
    Output,
)


@procedure
def next_entry(kind: float, o: Output) -> int:
    """Where a new entry begins; -1 where the journal has no such row."""
    row = o.used[ENTRIES]
    o.used[ENTRIES] = row + 1
    if row >= o.room[3]:
        return -1
    o.entry[row * ENTRY] = kind
    return int(row * ENTRY)


@procedure
def note_prediction(work: Work, lanes: Lanes, dt_s: float, o: Output) -> None:
    """The prediction that was just made."""
    first = next_entry(PREDICTED, o)
    if first < 0:
        return
    o.entry[first + STEP] = dt_s
    for i in range(9):
        o.entry[first + MIDDLE_AT + i] = work[(MIDDLE + i) * len(lanes)]
    for i in range(3):
        o.entry[first + FORCE_AT + i] = work[(FORCE + i) * len(lanes)]


@procedure
def note_decay(dt_s: float, o: Output) -> None:
    """The Gauss-Markov errors went on by dt."""
    first = next_entry(DECAYED, o)
    if first >= 0:
        o.entry[first + STEP] = dt_s


@procedure
def note_correction(work: Work, lanes: Lanes, o: Output) -> None:
    """The correction that was just made, if one was; its Jacobian on the states that its law named."""
    if work[ACCEPTED * len(lanes)] == 0.0:
        return
    first = next_entry(CORRECTED, o)
    if first < 0:
        return
    o.entry[first + INNOVATION_AT] = work[INNOVATION * len(lanes)]
    o.entry[first + VARIANCE_AT] = work[INNOVATION_VARIANCE * len(lanes)]
    for i in range(STATES):
        o.entry[first + JACOBIAN_AT + i] = 0.0
        o.entry[first + GAIN_AT + i] = work[(GAIN + i) * len(lanes)]
    for i in range(int(work[OBSERVED * len(lanes)])):
        state = int(work[(OBSERVED + 1 + i) * len(lanes)])
        o.entry[first + JACOBIAN_AT + state] = work[(COEFFICIENT + i) * len(lanes)]


@procedure
def reset_state(work: Work, lanes: Lanes, lane: int, state: int, variance: float, o: Output) -> None:
    """A state of one lane loses its correlations and gets this variance."""
    forget_lane(work, lanes, states_of(lanes), state, lane, variance)
    if len(lanes) == 1:
        first = next_entry(FORGOTTEN, o)
        if first >= 0:
            o.entry[first + STATE_AT] = state


@procedure
def note_estimate(work: Work, lanes: Lanes, o: Output) -> None:
    """State, attitude and covariance of the estimate that was just written."""
    next_entry(NOTED, o)
    row = o.used[NOTES]
    o.used[NOTES] = row + 1
    if row >= o.room[4]:
        return
    for i in range(STATES):
        o.state[row * (STATES + 4) + i] = work[(STATE + i) * len(lanes)]
        for j in range(STATES):
            o.covariance[(row * STATES + i) * STATES + j] = covariance_of(work, lanes, i, j, 0)
    for i in range(4):
        o.state[row * (STATES + 4) + STATES + i] = work[(QUATERNION + i) * len(lanes)]
