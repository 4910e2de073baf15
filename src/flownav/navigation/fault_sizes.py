"""Sizes of undetected faults: the prior, the estimate from innovations, and the effect so far."""

import numpy as np

from flownav.core.compile import Lanes, Work, equation, smaller
from flownav.estimation.covariance import states_of
from flownav.estimation.hypotheses import (
    FLOW_AGE,
    FLOW_SCALE,
    FLOW_SWAPPED,
    FORCE,
    GPS_DRIFT,
    HEADING_OFF,
    RANGE_OFFSET,
    TURNING,
    Size,
    effect_of,
    size_from_evidence,
)
from flownav.estimation.states import POSITION

SIZE_SIGMAS = 3.0  # of a fault's size: 0.3 % of a normal one lies beyond; 2.4 leaves flow_scale of 60 s beyond


@equation
def prior_sigma(fault: int) -> float:
    """Prior standard deviation of a fault's size, in the fault's unit."""
    if fault == FLOW_SCALE:
        return 0.3
    if fault == FLOW_AGE:
        return 0.05
    if fault == RANGE_OFFSET:
        return 0.1
    if fault <= HEADING_OFF:  # GPS drift [m/s], and heading [rad]
        return 0.5 if fault < HEADING_OFF else 0.2
    if fault < TURNING:
        return 0.1
    return 0.01 if fault < FLOW_SWAPPED else 1.0


@equation
def least_size(fault: int) -> float:
    """Largest size that is not yet a fault. A scale that a filter learns in flight, and a gyro that warms up, are
    larger than the prior (`flownav replay` of quad-px4flow-outdoor).
    """
    if fault == FLOW_SCALE:
        return 0.5
    if fault >= GPS_DRIFT and fault < HEADING_OFF:
        return 0.2
    if fault >= FORCE and fault < FLOW_SWAPPED:
        return 0.2 if fault < TURNING else 0.015
    return prior_sigma(fault) if fault < FLOW_SWAPPED else 0.5


@equation
def size_in(work: Work, lanes: Lanes, fault: int, lane: int) -> Size:
    """Estimated size of a fault in a lane, with its standard deviation and evidence."""
    return size_from_evidence(work, lanes, fault, lane, prior_sigma(fault))


@equation
def largest_size(fault: int, found: Size) -> float:
    """Largest size of a fault that its innovations leave possible; one that is there or is not has a size of 1."""
    size = abs(found.size) + SIZE_SIGMAS * found.sigma
    return size if fault < FLOW_SWAPPED else smaller(size, 1.0)


@equation
def evidence_of(work: Work, lanes: Lanes, fault: int, lane: int) -> float:
    """The evidence of a fault that is large enough to be one; a drift of GPS north and east is one fault, and of those
    of the IMU, which look alike, the most evident one is meant.
    """
    found = size_in(work, lanes, fault, lane)
    size, evidence = abs(found.size), found.evidence
    if fault == GPS_DRIFT or fault == GPS_DRIFT + 1:
        beside = size_in(work, lanes, 2 * GPS_DRIFT + 1 - fault, lane)
        size = np.sqrt(size * size + beside.size * beside.size)
        evidence = evidence + beside.evidence if evidence >= beside.evidence else 0.0
    if fault >= FORCE and fault < FLOW_SWAPPED:
        for other in range(FORCE, FLOW_SWAPPED):
            evidence = 0.0 if size_in(work, lanes, other, lane).evidence > found.evidence else evidence
    return evidence if size > least_size(fault) else 0.0


@equation
def moved_by(work: Work, lanes: Lanes, fault: int, axis: int, lane: int) -> float:
    """How far one unit of a fault has moved the position along an axis, NED [m]."""
    return effect_of(work, lanes, states_of(lanes), fault, POSITION + axis, lane)


@equation
def level_effect(work: Work, lanes: Lanes, fault: int, lane: int) -> float:
    """How far one unit of a fault has moved the position horizontally [m]."""
    north, east = moved_by(work, lanes, fault, 0, lane), moved_by(work, lanes, fault, 1, lane)
    moved_m: float = np.sqrt(north * north + east * east)
    return moved_m
