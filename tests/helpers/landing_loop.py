"""Bare loops of the landing filter's steps and of their parts, for timing and for very long runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import Lanes, Work, equation, kernel, pointer
from flownav.estimation.covariance import expect, settle
from flownav.estimation.error_models import FilterSettings, propagate_gauss_markov, propagate_walks
from flownav.estimation.lag import FlowLag, lag_ends, lag_starts
from flownav.estimation.laws.attitude import attitude
from flownav.estimation.laws.flow import flow_rate, lagged_flow
from flownav.estimation.laws.gps import gps_position, gps_velocity
from flownav.estimation.laws.height import range_along_boresight
from flownav.estimation.motion import errors_in_motion, predict
from flownav.estimation.states import FILTER_ROWS, MEASURED, NOISE, OFFERED, STATES, STATES_WITH_LAG
from flownav.studies.benchmark.vehicles import standing

ATTITUDE_READ = FILTER_ROWS  # quaternion
POSITION_READ = ATTITUDE_READ + 4
VELOCITY_READ = POSITION_READ + 3
FLOW_READ = VELOCITY_READ + 3  # forward, right [m/s] where the sensor has dynamics, else rates about x, y [rad/s]
RANGE_READ = FLOW_READ + 2
ARRIVED = RANGE_READ + 1  # above 0 where the readings are offered
ROWS = ARRIVED + 1
SCALARS = 12  # fused in a step
STEP_S = 0.02
ATTITUDE_VARIANCE, POSITION_VARIANCE, VELOCITY_VARIANCE = 1e-4, 0.04, 1e-3
FLOW_VARIANCE, RANGE_VARIANCE, LENS_BELOW_M = 1e-3, 1e-4, 0.1


@equation
def offer(work: Work, lanes: Lanes, read: int, count: int, variance: float) -> None:
    """The reading in `count` rows from `read` on, of one variance, where it arrived."""
    for i in range(count):
        for lane in range(len(lanes)):
            work[(MEASURED + i) * len(lanes) + lane] = work[(read + i) * len(lanes) + lane]
    for lane in range(len(lanes)):
        work[NOISE * len(lanes) + lane] = variance
        work[OFFERED * len(lanes) + lane] = work[ARRIVED * len(lanes) + lane]


@equation
def take(work: Work, lanes: Lanes, n: int, gate_sigma: float) -> None:
    """Test and fuse what was observed."""
    expect(work, lanes, n, False)
    settle(work, lanes, n, gate_sigma)


@kernel
def run_landing_filter(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings, lag: FlowLag | None) -> None:
    """Predict and fuse attitude, GPS position and velocity, flow and range, `steps` times; (ROWS * len(lanes),)."""
    work = pointer(buffer)
    n = STATES if lag is None else STATES_WITH_LAG
    gate = settings.gate_sigma
    for _ in range(steps):
        if lag is not None:
            lag_starts(work, lanes, lag)
        predict(work, lanes, n, STEP_S, settings)
        propagate_walks(work, lanes, STEP_S, settings)
        propagate_gauss_markov(work, lanes, n, STEP_S, settings)
        if lag is not None:
            lag_ends(work, lanes, lag)
        for axis in range(3):
            offer(work, lanes, ATTITUDE_READ, 4, ATTITUDE_VARIANCE)
            attitude(work, lanes, axis)
            take(work, lanes, n, gate)
        for axis in range(3):
            offer(work, lanes, POSITION_READ + axis, 1, POSITION_VARIANCE)
            gps_position(work, lanes, axis, 0.0, 0.0, 0.0)
            take(work, lanes, n, gate)
        for axis in range(3):
            offer(work, lanes, VELOCITY_READ + axis, 1, VELOCITY_VARIANCE)
            gps_velocity(work, lanes, axis, 0.0, 0.0, 0.0)
            take(work, lanes, n, gate)
        for axis in range(2):
            offer(work, lanes, FLOW_READ + axis, 1, FLOW_VARIANCE)
            if lag is not None:
                lagged_flow(work, lanes, axis, lag.gain)
            else:
                flow_rate(work, lanes, axis, 0.0, 0.0, LENS_BELOW_M, LENS_BELOW_M)
            take(work, lanes, n, gate)
        offer(work, lanes, RANGE_READ, 1, RANGE_VARIANCE)
        range_along_boresight(work, lanes, 0, LENS_BELOW_M, 0.0, 0.0)
        take(work, lanes, n, gate)


def hovering(lanes: Lanes, n: int = STATES) -> NDArray[np.float64]:
    """A buffer of filters that hover 5 m above the ground, with readings that agree."""
    rows = np.zeros((ROWS, len(lanes)))
    rows[:FILTER_ROWS] = standing(lanes, n).reshape(FILTER_ROWS, len(lanes))
    rows[ATTITUDE_READ] = rows[ARRIVED] = 1.0
    rows[POSITION_READ + 2], rows[RANGE_READ] = -5.0, 4.9
    return rows.reshape(-1)


# -- parts of a step -----------------------------------------------------------------------------------------
@kernel
def expect_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """P h' and S of a law that reads nine states."""
    work = pointer(buffer)
    for _ in range(steps):
        expect(work, lanes, STATES, True)


@kernel
def observe_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """The law of a flow rate."""
    work = pointer(buffer)
    for step in range(steps):
        flow_rate(work, lanes, step % 2, 0.1, 0.0, 0.1, 0.1)


@kernel
def move_covariance(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """The covariance of one prediction."""
    work = pointer(buffer)
    for _ in range(steps):
        errors_in_motion(work, lanes, STATES, 1e-4)


@kernel
def decay_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """The Gauss-Markov errors, of which one step serves for several predictions."""
    work = pointer(buffer)
    for _ in range(steps):
        propagate_gauss_markov(work, lanes, STATES, 1e-4, settings)
