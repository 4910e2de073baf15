"""The filter's covariance on lanes: test, correct, forget, add noise.

P is symmetric, so only its upper triangle is kept, column by column: element (i, j), i <= j, lies at row
COVARIANCE + j (j + 1)/2 + i. Nothing can make it unsymmetric. The number of states `n` is an argument: 36, or 40 where
the flow sensor's dynamics are carried. Observations are scalars, fused one after the other, which for uncorrelated
noise is the joint update and inverts nothing. A lane that is not offered a reading, or refuses it, keeps every bit.
"""

from typing import cast

import numpy as np

from flownav.core.compile import Lanes, Work, equation, procedure
from flownav.estimation.states import (
    ACCEPTED,
    COEFFICIENT,
    CONSIDERED,
    CONSIDERS,
    COVARIANCE,
    CROSS,
    GAIN,
    HELD_BACK,
    HYPOTHESES,
    INNOVATION,
    INNOVATION_VARIANCE,
    MOST_CONSIDERED,
    NOISE,
    OBSERVED,
    OFFERED,
    REST,
    SHARE,
    SIGNATURE,
    STATE,
    STATES,
    STATES_WITH_LAG,
    TEST_RATIO,
    WEIGHT,
    fold_attitude,
)

HUBER_SIGMAS = 2.0  # an innovation counts as no more (Huber, Robust Estimation of a Location Parameter, 1964): chosen
LARGEST_VARIANCE = 1e30  # chosen: no reading is so poor, and its square is still finite


def with_lag(lanes: Lanes) -> Lanes:
    """The marker of these lanes for a filter of STATES_WITH_LAG states: of floats, which makes it another type."""
    return cast(Lanes, tuple(float(lane) for lane in lanes))


@equation
def lagged(lanes: Lanes) -> bool | None:
    """True for the lanes of `with_lag`, None for others.

    What only lagged lanes need stands behind `lag is None` of a parameter that is given this: of an argument None the
    compiler drops the branch before it types it. Behind a condition of any other type it would compile it for all.
    """
    if isinstance(lanes[0], float):
        return True
    return None


@equation
def states_of(lanes: Lanes) -> int:
    """How many states the filter of these lanes carries: a constant of the compiler."""
    return STATES if lagged(lanes) is None else STATES_WITH_LAG


@equation
def columns_of(work: Work, lanes: Lanes, n: int) -> int:
    """How many columns are kept: the n states', and the effects of the faults that are followed (`hypotheses`)."""
    return n + int(work[HYPOTHESES * len(lanes)])


@equation
def column(j: int) -> int:
    """Row of element (0, j). The mask changes nothing; it shows the compiler that j (j + 1)/2 is never negative.

    A fault's column has the states' rows alone: no fault is held against another.
    """
    whole = j if j < STATES_WITH_LAG else STATES_WITH_LAG
    return COVARIANCE + (whole * (whole + 1) // 2 + (j - whole) * STATES_WITH_LAG & 2047)


@equation
def at(i: int, j: int) -> int:
    """Row of element (i, j), i <= j."""
    return column(j) + i


@equation
def place(i: int, j: int) -> int:
    """Row of element (i, j) in either order."""
    return at(i, j) if i <= j else at(j, i)


# -- one reading ----------------------------------------------------------------------------------------------
@procedure
def fuse(work: Work, lanes: Lanes, n: int, gate_sigma: float) -> None:
    """Test and fuse the observation whose law, NOISE and OFFERED stand in their rows."""
    expect(work, lanes, n, True)
    settle(work, lanes, n, gate_sigma)


@procedure
def expect(work: Work, lanes: Lanes, n: int, always: bool) -> None:
    """c = P h', S = h c + R, and in ACCEPTED whether the reading may be tested at all: offered, of a sound variance.

    Where no lane offers it neither c nor S is computed, unless they are wanted `always`.
    """
    offering = 0
    for lane in range(len(lanes)):
        noise = work[NOISE * len(lanes) + lane]
        sound = noise >= 0.0 and noise < LARGEST_VARIANCE
        offered = sound and work[OFFERED * len(lanes) + lane] > 0.0
        work[ACCEPTED * len(lanes) + lane] = 1.0 if offered else 0.0
        work[INNOVATION_VARIANCE * len(lanes) + lane] = noise if sound else 1.0
        offering += 1 if offered else 0
    if offering == 0 and not always:
        return
    columns = columns_of(work, lanes, n)
    for j in range(columns):
        for lane in range(len(lanes)):
            work[(CROSS + j) * len(lanes) + lane] = 0.0
    for t in range(int(work[OBSERVED * len(lanes)])):
        observed = int(work[(OBSERVED + 1 + t) * len(lanes)])
        add_row(work, lanes, columns, observed, COEFFICIENT + t)
    for t in range(int(work[OBSERVED * len(lanes)])):
        observed = int(work[(OBSERVED + 1 + t) * len(lanes)])
        for lane in range(len(lanes)):
            product = work[(COEFFICIENT + t) * len(lanes) + lane] * work[(CROSS + observed) * len(lanes) + lane]
            work[INNOVATION_VARIANCE * len(lanes) + lane] += product
    for k in range(columns - n):
        for lane in range(len(lanes)):
            shown = work[(SHARE + k) * len(lanes) + lane] * work[(CROSS + n + k) * len(lanes) + lane]
            work[(CROSS + n + k) * len(lanes) + lane] = shown + work[(SIGNATURE + k) * len(lanes) + lane]


@equation
def add_row(work: Work, lanes: Lanes, n: int, i: int, factor: int) -> None:
    """c <- c + h_i P_i: a row of P, times the coefficient in row `factor`."""
    for j in range(i + 1):
        for lane in range(len(lanes)):
            product = work[factor * len(lanes) + lane] * work[at(j, i) * len(lanes) + lane]
            work[(CROSS + j) * len(lanes) + lane] += product
    for j in range(i + 1, n):
        for lane in range(len(lanes)):
            product = work[factor * len(lanes) + lane] * work[at(i, j) * len(lanes) + lane]
            work[(CROSS + j) * len(lanes) + lane] += product


@procedure
def settle(work: Work, lanes: Lanes, n: int, gate_sigma: float) -> None:
    """Test what `expect` left, nu^2 <= gate^2 S, and correct with what passes in the lanes that HELD_BACK lets."""
    for lane in range(len(lanes)):
        variance = work[INNOVATION_VARIANCE * len(lanes) + lane]
        innovation = work[INNOVATION * len(lanes) + lane]
        ratio = innovation * innovation / (gate_sigma * gate_sigma * variance)
        passes = variance > 0.0 and ratio <= 1.0 and work[HELD_BACK * len(lanes) + lane] == 0.0
        fused = work[ACCEPTED * len(lanes) + lane] > 0.0 and passes
        work[TEST_RATIO * len(lanes) + lane] = ratio
        work[ACCEPTED * len(lanes) + lane] = 1.0 if fused else 0.0
    correct(work, lanes, n)


@procedure
def correct(work: Work, lanes: Lanes, n: int) -> None:
    """x <- x + K nu and Joseph's P <- (I - K h) P (I - K h)' + K R K' in the lanes that accepted.

    Written out, with c = P h', S = h c + R and d = c - K S/2, it is P - (K d' + d K'), whatever the gain (Bucy and
    Joseph, Filtering for Stochastic Processes with Applications to Guidance, 1968). That of the considered states is 0:
    they stay as they are, and their uncertainty counts (Schmidt, Application of State-Space Methods to Navigation
    Problems, 1966). So is that of the hypotheses' columns, what one unit of a fault does to the error: with k = SHARE,
    s <- s - K (k h s + h_b) (`hypotheses`).
    """
    fused_lanes = 0
    for lane in range(len(lanes)):
        fused_lanes += 1 if work[ACCEPTED * len(lanes) + lane] > 0.0 else 0
    if fused_lanes == 0:
        return
    columns = columns_of(work, lanes, n)
    for lane in range(len(lanes)):
        sigmas = abs(work[INNOVATION * len(lanes) + lane]) / np.sqrt(work[INNOVATION_VARIANCE * len(lanes) + lane])
        fused = work[ACCEPTED * len(lanes) + lane] > 0.0
        strays = fused and sigmas > HUBER_SIGMAS and work[CONSIDERS * len(lanes)] > 0.0
        work[WEIGHT * len(lanes) + lane] = HUBER_SIGMAS / sigmas if strays else 1.0
    for i in range(columns):
        for lane in range(len(lanes)):
            fused = work[ACCEPTED * len(lanes) + lane] > 0.0
            variance = work[INNOVATION_VARIANCE * len(lanes) + lane] if fused else 1.0
            cross = work[(CROSS + i) * len(lanes) + lane] if fused else 0.0
            gain = work[WEIGHT * len(lanes) + lane] * cross / variance if i < n else 0.0
            work[(GAIN + i) * len(lanes) + lane] = gain
            work[(REST + i) * len(lanes) + lane] = cross - 0.5 * gain * variance
    for t in range(int(work[CONSIDERED * len(lanes)])):
        considered = int(work[(CONSIDERED + 1 + 2 * t) * len(lanes)])
        where = int(work[(CONSIDERED + 2 + 2 * t) * len(lanes)])
        for lane in range(len(lanes)):
            here = where == 0 or work[where * len(lanes) + lane] > 0.0
            left = here and work[ACCEPTED * len(lanes) + lane] > 0.0
            gain, rest = work[(GAIN + considered) * len(lanes) + lane], work[(REST + considered) * len(lanes) + lane]
            cross = work[(CROSS + considered) * len(lanes) + lane]
            work[(GAIN + considered) * len(lanes) + lane] = 0.0 if left else gain
            work[(REST + considered) * len(lanes) + lane] = cross if left else rest
    for i in range(n):
        for lane in range(len(lanes)):
            fused = work[ACCEPTED * len(lanes) + lane] > 0.0
            innovation = work[INNOVATION * len(lanes) + lane] if fused else 0.0
            before = work[(STATE + i) * len(lanes) + lane]
            after = before + work[(GAIN + i) * len(lanes) + lane] * innovation
            work[(STATE + i) * len(lanes) + lane] = after if fused else before
    for j in range(n):
        for i in range(j + 1):
            for lane in range(len(lanes)):
                gain_i, gain_j = work[(GAIN + i) * len(lanes) + lane], work[(GAIN + j) * len(lanes) + lane]
                rest_i, rest_j = work[(REST + i) * len(lanes) + lane], work[(REST + j) * len(lanes) + lane]
                work[at(i, j) * len(lanes) + lane] -= gain_i * rest_j + gain_j * rest_i
    for j in range(n, columns):
        for i in range(n):
            for lane in range(len(lanes)):
                gain_i, rest_j = work[(GAIN + i) * len(lanes) + lane], work[(REST + j) * len(lanes) + lane]
                work[at(i, j) * len(lanes) + lane] -= gain_i * rest_j
    fold_attitude(work, lanes)


@equation
def consider(work: Work, lanes: Lanes, state: int, where: int = 0) -> None:
    """One more state that corrections leave as it is, until `consider_none`; nothing where CONSIDERS is 0, or beyond
    MOST_CONSIDERED. where: in lanes whose row of that number is above 0; 0: in all.
    """
    count = min(int(work[CONSIDERED * len(lanes)]), MOST_CONSIDERED - 1)
    work[(CONSIDERED + 1 + 2 * count) * len(lanes)] = state
    work[(CONSIDERED + 2 + 2 * count) * len(lanes)] = where
    work[CONSIDERED * len(lanes)] = count + work[CONSIDERS * len(lanes)]


@equation
def consider_none(work: Work, lanes: Lanes) -> None:
    """Corrections concern all states."""
    work[CONSIDERED * len(lanes)] = 0.0


# -- single states --------------------------------------------------------------------------------------------
@equation
def add_noise(work: Work, lanes: Lanes, state: int, variance: float) -> None:
    """P_ii <- P_ii + variance, in every lane."""
    for lane in range(len(lanes)):
        work[at(state, state) * len(lanes) + lane] += variance


@equation
def add_noise_lane(work: Work, lanes: Lanes, state: int, lane: int, variance: float) -> None:
    """P_ii <- P_ii + variance, in one lane."""
    work[at(state, state) * len(lanes) + lane] += variance


@procedure
def decay(work: Work, lanes: Lanes, n: int, state: int, factor: float) -> None:
    """x_i <- factor x_i, in every lane: the transition of a Gauss-Markov error."""
    for lane in range(len(lanes)):
        work[(STATE + state) * len(lanes) + lane] *= factor
        work[at(state, state) * len(lanes) + lane] *= factor
    for j in range(state + 1):
        for lane in range(len(lanes)):
            work[at(j, state) * len(lanes) + lane] *= factor
    for j in range(state + 1, columns_of(work, lanes, n)):
        for lane in range(len(lanes)):
            work[at(state, j) * len(lanes) + lane] *= factor


@procedure
def forget_lane(work: Work, lanes: Lanes, n: int, state: int, lane: int, variance: float) -> None:
    """The state of one lane loses its correlations and gets this variance."""
    for j in range(columns_of(work, lanes, n)):
        work[place(state, j) * len(lanes) + lane] = 0.0
    work[at(state, state) * len(lanes) + lane] = variance


@procedure
def begin_lane(work: Work, lanes: Lanes, lane: int, sigma: Work, first: int) -> None:
    """x = 0 and a diagonal P of one lane, of the STATES standard deviations that lie at `first` in sigma."""
    for j in range(STATES):
        work[(STATE + j) * len(lanes) + lane] = 0.0
        for i in range(j):
            work[at(i, j) * len(lanes) + lane] = 0.0
        work[at(j, j) * len(lanes) + lane] = sigma[first + j] * sigma[first + j]


@equation
def set_variance(work: Work, lanes: Lanes, state: int, lane: int, variance: float) -> None:
    """P_ii of a lane is this; its correlations stay."""
    work[at(state, state) * len(lanes) + lane] = variance


@equation
def set_covariance(work: Work, lanes: Lanes, i: int, j: int, lane: int, covariance: float) -> None:
    """P_ij of a lane is this."""
    work[place(i, j) * len(lanes) + lane] = covariance


@equation
def variance_of(work: Work, lanes: Lanes, state: int, lane: int) -> float:
    """P_ii of a lane."""
    value: float = work[at(state, state) * len(lanes) + lane]
    return value


@equation
def covariance_of(work: Work, lanes: Lanes, i: int, j: int, lane: int) -> float:
    """P_ij of a lane."""
    value: float = work[place(i, j) * len(lanes) + lane]
    return value
