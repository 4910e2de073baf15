"""Faults that may be there and are not modelled: the effect of one unit of each on the error, and the evidence of
innovations.

A hypothesis is a constant b that adds h_b b to a reading, or moves the filter by a steady specific force. The mean
error that it causes is s b, where s goes through the filter as a considered state's covariance does (Schmidt):

    s <- F s + g   over a step,      s <- s - K c,   c = k h s + h_b   with a reading,

in columns beside the covariance, which change nothing of the estimate. The innovation's mean is then c b, so that
innovations give b by a likelihood ratio: information J = sum c^2/S, score d = sum c nu/S, b = d/J (Willsky and Jones, A
Generalized Likelihood Ratio Approach to the Detection and Estimation of Jumps in Linear Systems, IEEE Transactions on
Automatic Control 21(1), 1976). What the filter estimates by itself leaves no trace in c: a flow scale that is learnt is
no fault.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, larger, procedure
from flownav.estimation.covariance import at, states_of
from flownav.estimation.states import (
    ACCEL_BIAS,
    ACCEPTED,
    CROSS,
    GYRO_BIAS,
    HYPOTHESES,
    INFORMATION,
    INNOVATION,
    INNOVATION_VARIANCE,
    SCORE,
    SHARE,
    SIGNATURE,
)

# what each hypothesis is, and its unit
FLOW_SCALE = 0  # flow too large; 1: twice
FLOW_AGE = 1  # flow older than stated [s]
RANGE_OFFSET = 2  # range too long [m]
GPS_DRIFT = 3  # 3: GPS position drifts off north, east, down [m/s]
HEADING_OFF = 6  # what is read as heading, too large [rad]
FORCE = 7  # 3: specific force, forward, right and down [m/s2]
TURNING = 10  # 2: body rate about the axes forward and right [rad/s]
# faults that are there (1) or are not
FLOW_SWAPPED = 12  # its channels
FLOW_REVERSED = 13  # both
COUNT = 14
LEFT = COUNT  # what faults that are over have left: a column of its own, of size 1
NAMES = (
    "flow scale", "flow age", "range offset", "GPS drift north", "GPS drift east", "GPS drift down", "heading off",
    "accelerometer forward", "accelerometer right", "accelerometer down", "gyro forward", "gyro right",
    "flow axes swapped", "flow reversed",
)  # fmt: skip


class Size(NamedTuple):
    """Estimate of a fault's size: estimate, standard deviation, and (estimate / standard deviation) squared."""

    size: float
    sigma: float
    evidence: float


@equation
def size_of(information: float, score: float, prior_sigma: float) -> Size:
    """The size by its innovations, and by what sizes such faults have (mean 0, prior_sigma)."""
    total = information + 1.0 / (prior_sigma * prior_sigma)
    return Size(score / total, 1.0 / np.sqrt(total), score * score / total)


@equation
def followed(work: Work, lanes: Lanes) -> int:
    """How many columns follow faults: COUNT and those of left effects, or 0."""
    return int(work[HYPOTHESES * len(lanes)])


@equation
def size_from_evidence(work: Work, lanes: Lanes, fault: int, lane: int, prior_sigma: float) -> Size:
    """Size of a fault in a lane by its innovations."""
    information, score = work[(INFORMATION + fault) * len(lanes) + lane], work[(SCORE + fault) * len(lanes) + lane]
    return size_of(information, score, prior_sigma)


@equation
def effect_of(work: Work, lanes: Lanes, n: int, fault: int, state: int, lane: int) -> float:
    """s: what one unit of a fault has done to a state's error in a lane."""
    value: float = work[at(state, n + fault) * len(lanes) + lane]
    return value


@procedure
def hold_unlearnt(work: Work, lanes: Lanes, n: int) -> None:
    """A fault of the IMU is a bias that the filter has not learnt, since it may have begun just now: s_bias <- 1."""
    if followed(work, lanes) > 0:
        for lane in range(len(lanes)):
            for axis in range(3):
                work[at(ACCEL_BIAS + axis, n + FORCE + axis) * len(lanes) + lane] = 1.0
            for axis in range(2):
                work[at(GYRO_BIAS + axis, n + TURNING + axis) * len(lanes) + lane] = 1.0


@procedure
def weigh(work: Work, lanes: Lanes, n: int, color: float) -> None:
    """Add the information of the innovation that was just fused to each fault; color: number of readings that err
    alike, in effect.
    """
    for k in range(followed(work, lanes)):
        for lane in range(len(lanes)):
            fused = work[ACCEPTED * len(lanes) + lane] > 0.0
            variance = color * work[INNOVATION_VARIANCE * len(lanes) + lane] if fused else 1.0
            cross = work[(CROSS + n + k) * len(lanes) + lane] if fused else 0.0
            innovation = work[INNOVATION * len(lanes) + lane] if fused else 0.0
            work[(INFORMATION + k) * len(lanes) + lane] += cross * cross / variance
            work[(SCORE + k) * len(lanes) + lane] += cross * innovation / variance
            work[(SIGNATURE + k) * len(lanes) + lane] = 0.0
            work[(SHARE + k) * len(lanes) + lane] = 1.0


@procedure
def fade(work: Work, lanes: Lanes, factor: float) -> None:
    """Forget old information, which may be of another fault: J <- factor J, d <- factor d."""
    for k in range(followed(work, lanes)):
        for lane in range(len(lanes)):
            work[(INFORMATION + k) * len(lanes) + lane] *= factor
            work[(SCORE + k) * len(lanes) + lane] *= factor


@procedure
def leave_lane(work: Work, lanes: Lanes, n: int, fault: int, lane: int, size: float) -> None:
    """Keep the effect of a fault of this size when it is over: s_left <- s_left + s b."""
    for i in range(n):
        work[at(i, n + LEFT) * len(lanes) + lane] += size * work[at(i, n + fault) * len(lanes) + lane]


@equation
def leave(work: Work, lanes: Lanes, state: int, lane: int, value: float) -> None:
    """A state of a lane may be wrong by so much beside what faults left before."""
    if followed(work, lanes) > 0:
        work[at(state, states_of(lanes) + LEFT) * len(lanes) + lane] += value


@procedure
def begin_lane_anew(work: Work, lanes: Lanes, n: int, fault: int, lane: int) -> None:
    """A fault that would begin now in this lane: it has done nothing yet, and nothing is known of it."""
    for i in range(n):
        work[at(i, n + fault) * len(lanes) + lane] = 0.0
    work[(INFORMATION + fault) * len(lanes) + lane] = 0.0
    work[(SCORE + fault) * len(lanes) + lane] = 0.0


@equation
def sign(work: Work, lanes: Lanes, fault: int, lane: int, value: float, share: float = 1.0) -> None:
    """h_b: what one unit of a fault adds to the reading at hand; k: the share of the state's error that it then shows.

    A reversed flow shows -1 of it: corrections push the state away, and a small error grows.
    """
    work[(SIGNATURE + fault) * len(lanes) + lane] = value
    work[(SHARE + fault) * len(lanes) + lane] = share


@equation
def sign_all(work: Work, lanes: Lanes, fault: int, value: float) -> None:
    """Write a fault's effect on an observation in every lane."""
    for lane in range(len(lanes)):
        sign(work, lanes, fault, lane, value)


@equation
def larger_axis(variance_n: float, variance_e: float, covariance: float) -> float:
    """The larger semi-axis of the ellipse of one sigma of two errors."""
    mean, half = 0.5 * (variance_n + variance_e), 0.5 * (variance_n - variance_e)
    semi_axis: float = np.sqrt(larger(mean + np.sqrt(half * half + covariance * covariance), 0.0))
    return semi_axis
