"""How far the accelerometer is trusted: as far as what the flow and the range say after it is white.

Innovations of a filter whose model holds are white (Kailath, An Innovations Approach to Least-Squares Estimation, 1968;
Mehra, On the Identification of Variances and Adaptive Kalman Filtering, 1970). A sensor noisier than told makes them
larger, not alike; motion that errs, as by an accelerometer that vibration rectifies, makes neighbours alike. So their
likeness over blocks of time, and not their size, moves the accelerometer's noise, up and down again.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, clamp, equation, exp, larger, procedure
from flownav.estimation.states import INNOVATION, INNOVATION_VARIANCE, NOISE
from flownav.navigation.memory import (
    ACCEL_FACTOR,
    REASON,
    held_by_gps,
    load_echo,
    load_noise,
    load_whiteness,
    store_noise,
    store_whiteness,
)
from flownav.navigation.reasons import FUSED, INNOVATION_GATE
from flownav.navigation.records import NoiseMemory, WhitenessMemory

BLOCK_S = 0.1
LONGEST_BLOCK_S = 1.0  # readings further apart say nothing of each other
FOLLOWING_BLOCKS = 10.0
LIKENESS_ALLOWED = 0.15
PACE = 0.2  # by how much the factor grows or shrinks in a block, per likeness beyond what is allowed
LARGEST_FACTOR = 30.0
NOISE_TIME_S = 20.0
SMALLEST_NOISE, LARGEST_NOISE = 0.02, 25.0  # of the variance that is said
SMALLEST_OF_BARO = 0.1  # wash and gusts last
# places of components whose noise is followed; GPS position and velocity have three
OF_RANGE, OF_BARO, OF_GPS = 0, 1, 2
STRAYS = 0.02  # a share of ranges that say nothing


@equation
def with_innovation(innovation: float, variance: float, t_s: float, m: WhitenessMemory) -> WhitenessMemory:
    """The block's sum of innovations, in standard deviations of one; the first begins at its instant."""
    return WhitenessMemory(
        t_s if m.readings == 0.0 else m.since_s, m.total + innovation / np.sqrt(variance), m.readings + 1.0, m.before,
        m.square, m.ended_s,
    )  # fmt: skip


@equation
def block_ended(t_s: float, m: WhitenessMemory) -> tuple[float, WhitenessMemory]:
    """How alike the block that ends and the one before are, 1 on average where all are the same; and a new block."""
    block = clamp(m.total / np.sqrt(larger(m.readings, 1.0)), -5.0, 5.0)
    apart = t_s - m.ended_s > LONGEST_BLOCK_S
    square = m.square + (block * block - m.square) / FOLLOWING_BLOCKS
    likeness = 0.0 if apart else clamp(block * m.before / larger(square, 1.0), -1.0, 1.0)
    return likeness, WhitenessMemory(t_s, 0.0, 0.0, block, square, t_s)


@procedure
def watch_whiteness(work: Work, lanes: Lanes, t_s: float, axis: int) -> None:
    """After the test of a component along body axis 0, 1 or 2: how alike its innovations are moves ACCEL_FACTOR."""
    for lane in range(len(lanes)):
        reason = work[REASON * len(lanes) + lane]
        strays = axis == 2 and load_echo(work, lanes, lane).stray > STRAYS
        held = held_by_gps(work, lanes, lane, t_s)  # then a flow that is refused is what is wrong
        refused = reason == INNOVATION_GATE and axis < 2 and not held  # a refused echo is as alike as a wrong height
        if strays or not (reason == FUSED or refused):
            continue
        m = load_whiteness(work, lanes, axis, lane)
        innovation, variance = work[INNOVATION * len(lanes) + lane], work[INNOVATION_VARIANCE * len(lanes) + lane]
        if m.readings > 0.0 and t_s - m.since_s >= BLOCK_S - 1e-3:
            likeness, m = block_ended(t_s, m)
            factor = work[(ACCEL_FACTOR + axis) * len(lanes) + lane] * exp(PACE * (likeness - LIKENESS_ALLOWED))
            work[(ACCEL_FACTOR + axis) * len(lanes) + lane] = clamp(factor, 1.0, LARGEST_FACTOR)
        store_whiteness(work, lanes, axis, lane, with_innovation(innovation, variance, t_s, m))


@equation
def accel_factors(work: Work, lanes: Lanes, lane: int) -> tuple[float, float]:
    """How many times the accelerometer's noise is what it was said to be: level, in the worse axis, and down."""
    level = larger(work[ACCEL_FACTOR * len(lanes) + lane], work[(ACCEL_FACTOR + 1) * len(lanes) + lane])
    return level, work[(ACCEL_FACTOR + 2) * len(lanes) + lane]


# -- a sensor's own noise -----------------------------------------------------------------------------------
@equation
def followed_noise(
    innovation: float, total: float, noise: float, smallest: float, gate_sigma: float, t_s: float, m: NoiseMemory
) -> NoiseMemory:
    """A component's noise by what changes in its innovation from one reading to the next: half the mean square over R.

    What lasts there is of the motion, or an error that the filter carries as a state.
    """
    step_s = t_s - m.heard_s
    limit = gate_sigma * np.sqrt(2.0 * total)
    change = clamp(innovation - m.before, -limit, limit)
    share = 0.0 if step_s > LONGEST_BLOCK_S else step_s / NOISE_TIME_S
    factor = m.factor + share * (0.5 * change * change / noise - 1.0) * m.factor
    return NoiseMemory(clamp(factor, smallest, LARGEST_NOISE), innovation, t_s)


@procedure
def scale_noise(work: Work, lanes: Lanes, place: int) -> None:
    """NOISE as it was followed, before the test."""
    for lane in range(len(lanes)):
        work[NOISE * len(lanes) + lane] *= load_noise(work, lanes, place, lane).factor


@procedure
def follow_noise(work: Work, lanes: Lanes, t_s: float, place: int, gate_sigma: float) -> None:
    """And after it."""
    smallest = SMALLEST_OF_BARO if place == OF_BARO else SMALLEST_NOISE
    for lane in range(len(lanes)):
        strays = place == OF_RANGE and load_echo(work, lanes, lane).stray > STRAYS
        if work[REASON * len(lanes) + lane] == FUSED and not strays:
            innovation, total = work[INNOVATION * len(lanes) + lane], work[INNOVATION_VARIANCE * len(lanes) + lane]
            noise, m = work[NOISE * len(lanes) + lane], load_noise(work, lanes, place, lane)
            store_noise(
                work, lanes, place, lane, followed_noise(innovation, total, noise, smallest, gate_sigma, t_s, m)
            )
