"""Trust in the accelerometer, as far as the innovations of flow and range are white.

Innovations of a filter whose model holds are white (Kailath, An Innovations Approach to Least-Squares Estimation, 1968;
Mehra, On the Identification of Variances and Adaptive Kalman Filtering, 1970). A sensor noisier than stated makes them
larger, not alike; motion that errs, as by an accelerometer that vibration rectifies, makes neighbours alike. So their
likeness over blocks of time, and not their size, moves the accelerometer's noise, up and down again.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, clamp, equation, exp, larger, replacing
from flownav.navigation import calls
from flownav.navigation.memory import MEMORY, holds, load_whiteness
from flownav.navigation.offers import FEW_STRAYS
from flownav.navigation.reasons import FUSED, INNOVATION_GATE
from flownav.navigation.records import EchoMemory, GpsMemory, RangeMemory, WhitenessMemory, WitnessMemory
from flownav.navigation.verdicts import Noise, Tested, on_lanes

# Chosen together: an accelerometer that comes to read 3 m/s2 too much moves the position by 0.1 m (test_hard_flights),
# white innovations of any size hardly raise the factor (test_trust: 1.26 in the mean square, 1.57 with the block before
# alone). Each but the largest, halved or doubled, fails test_trust, but for a pace half and a likeness twice as large.
BLOCK_S = 0.1
LONGEST_BLOCK_S = 1.0  # readings further apart are independent
FOLLOWING_BLOCKS = 10.0
BLOCKS_BEFORE = 3.0  # what a block is held against, exponentially
LIKENESS_ALLOWED = 0.15
FACTOR_PACE = 0.25  # by how much the factor grows or shrinks in a block, per likeness beyond what is allowed
LEAST_FACTOR = 0.7  # chosen: with 1 white innovations held it a tenth above 1 on average (landing-filter.md)
LARGEST_FACTOR = 30.0  # 1 carries that position half a kilometre off
NOISE_TIME_S = 20.0  # chosen: a noise is found within 15 % (test_trust)
FIRST_READINGS = 25.0  # the first few are followed sooner, as if this many had confirmed the stated noise: chosen
SMALLEST_NOISE, LARGEST_NOISE = 0.02, 25.0  # of the stated variance: chosen; the first is held by test_trust
SMALLEST_OF_BARO = 0.1  # wash and gusts last: chosen, not measured
# places of components whose noise is followed; GPS position and velocity have three
OF_RANGE, OF_BARO, OF_GPS = 0, 1, 2
# Innovations lean to one side before a range creeps out of its gate: where they are white, their exponential mean has a
# standard deviation of 0.58 and lies beyond CREPT_SIGMAS once in a hundred. The second refused is within JUMPED gates,
# not the first: a sonar over grass (outdoor-3) leaves its gate for one reading.
CREPT_SIGMAS, JUMPED = 1.5, 2.0
# A height errs by no more than this speed makes, where an accelerometer errs by 3 m/s2 for half a second; a table's
# edge below a cone that sees it late makes 5 m/s (made flights)
CREEPING_M_S, NOISE_SIGMAS = 1.5, 3.0

with_sum = replacing(WhitenessMemory, "since_s", "total", "readings")
with_factor = replacing(WhitenessMemory, "factor")
with_noise = replacing(WitnessMemory, "factor", "before", "received_s", "readings")


@equation
def with_innovation(innovation: float, variance: float, t_s: float, m: WhitenessMemory) -> WhitenessMemory:
    """The block's sum of innovations, in standard deviations of one; the first begins at its instant."""
    since_s, total = t_s if m.readings == 0.0 else m.since_s, m.total + innovation / np.sqrt(variance)
    return with_sum(m, since_s=since_s, total=total, readings=m.readings + 1.0)


@equation
def block_ended(t_s: float, m: WhitenessMemory) -> tuple[float, WhitenessMemory]:
    """How alike the block that ends and those before are, 1 on average where all are the same; and a new block."""
    block = clamp(m.total / np.sqrt(larger(m.readings, 1.0)), -5.0, 5.0)
    apart = t_s - m.ended_s > LONGEST_BLOCK_S
    square = m.square + (block * block - m.square) / FOLLOWING_BLOCKS
    likeness = 0.0 if apart else clamp(block * m.before / larger(square, 1.0), -1.0, 1.0)
    before = block if apart else m.before + (block - m.before) / BLOCKS_BEFORE
    return likeness, WhitenessMemory(t_s, 0.0, 0.0, before, square, t_s, m.factor)


@equation
def followed_factor(t_s: float, m: WhitenessMemory) -> WhitenessMemory:
    """A new block, and the factor by how alike those before it are."""
    likeness, after = block_ended(t_s, m)
    factor = m.factor * exp(FACTOR_PACE * (likeness - LIKENESS_ALLOWED))
    return with_factor(after, factor=clamp(factor, LEAST_FACTOR, LARGEST_FACTOR))


@on_lanes(calls.watch_whiteness)
def watch_whiteness(
    tested: Tested, echo: EchoMemory, gps: GpsMemory, m: WhitenessMemory, *, t_s: float, axis: int
) -> WhitenessMemory:
    """After the test of a component along body axis 0, 1 or 2: how alike its innovations are moves the factor."""
    strays = axis == 2 and echo.stray > FEW_STRAYS
    unheld = not holds(gps, t_s)  # else a flow that is refused is what is wrong
    refused = tested.reason == INNOVATION_GATE and axis < 2 and unheld  # a refused echo is as alike as a wrong height
    counts = not strays and (tested.reason == FUSED or refused)
    ends = counts and m.readings > 0.0 and t_s - m.since_s >= BLOCK_S - 1e-3
    block = followed_factor(t_s, m) if ends else m
    return with_innovation(tested.innovation, tested.total, t_s, block) if counts else m


class AccelFactors(NamedTuple):
    """Factors on the accelerometer's stated noise: level, in the worse axis, and down."""

    level: float
    down: float


@equation
def accel_factors(work: Work, lanes: Lanes, lane: int) -> AccelFactors:
    """How far a lane's accelerometer is trusted."""
    forward, right = load_whiteness(work, lanes, 0, lane), load_whiteness(work, lanes, 1, lane)
    down = load_whiteness(work, lanes, 2, lane)
    return AccelFactors(larger(larger(forward.factor, right.factor), 1.0), larger(down.factor, 1.0))


MEMORY.derive(AccelFactors, accel_factors)


# -- a range that leaves its gate -----------------------------------------------------------------------------
@equation
def creeps(tested: Tested, t_s: float, m: RangeMemory, gate_sigma: float) -> bool:
    """Whether a range has left its gate step by step: the motion errs then, where a step of the ground jumps out.

    What the motion errs by changes no faster than a velocity that errs can make it, since the last that was fused.
    """
    sigmas = tested.innovation / np.sqrt(tested.total)
    moved_m = abs(tested.innovation - m.off_m) - NOISE_SIGMAS * np.sqrt(tested.variance)
    follows = moved_m <= CREEPING_M_S * (t_s - m.taken_s)
    leans = m.sigmas * sigmas > 0.0 and abs(m.sigmas) > CREPT_SIGMAS
    return leans and abs(sigmas) < JUMPED * gate_sigma and follows


# -- a sensor's own noise -----------------------------------------------------------------------------------
@equation
def followed_noise(
    innovation: float, total: float, noise: float, smallest: float, gate_sigma: float, t_s: float, m: WitnessMemory
) -> WitnessMemory:
    """A component's noise by what changes in its innovation from one reading to the next: half the mean square over R.

    What lasts there is of the motion, or an error that the filter carries as a state.
    """
    step_s = t_s - m.received_s
    limit = gate_sigma * np.sqrt(2.0 * total)
    change = clamp(innovation - m.before, -limit, limit)
    share = 0.0 if step_s > LONGEST_BLOCK_S else larger(step_s / NOISE_TIME_S, 1.0 / (FIRST_READINGS + m.readings))
    factor = m.factor + share * (0.5 * change * change / noise - 1.0) * m.factor
    return with_noise(
        m,
        factor=clamp(factor, smallest, LARGEST_NOISE),
        before=innovation,
        received_s=t_s,
        readings=m.readings + 1.0,
    )


@on_lanes(calls.scale_noise)
def scale_noise(noise: Noise, m: WitnessMemory) -> Noise:
    """Before the test: the noise of the component of a place, as it was followed."""
    return Noise(noise.variance * m.factor)


@on_lanes(calls.follow_noise)
def follow_noise(
    tested: Tested, echo: EchoMemory, m: WitnessMemory, *, t_s: float, place: int, gate_sigma: float
) -> WitnessMemory:
    """After the test: a component that was fused teaches its noise."""
    smallest = SMALLEST_OF_BARO if place == OF_BARO else SMALLEST_NOISE
    strays = place == OF_RANGE and echo.stray > FEW_STRAYS
    if tested.reason != FUSED or strays:
        return m
    return followed_noise(tested.innovation, tested.total, tested.variance, smallest, gate_sigma, t_s, m)
