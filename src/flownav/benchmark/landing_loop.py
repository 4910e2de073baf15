"""A bare loop of landing-filter steps, for timing."""

from __future__ import annotations

from flownav.compile import kernel
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.landing.algebra import fuse
from flownav.estimation.landing.observe import (
    ATTITUDE_STATES,
    GPS_POSITION_STATES,
    GPS_VELOCITY_STATES,
    LAGGED_FLOW_STATES,
    RANGE_STATES,
    observe_attitude,
    observe_gps_position,
    observe_gps_velocity,
    observe_lagged_flow,
    observe_range,
    offer,
)
from flownav.estimation.landing.predict import predict
from flownav.estimation.landing.settings import FlowLag, LandingSettings
from flownav.estimation.landing.states import LANDING_ROW_COUNT, landing_rows

FILTER = landing_rows(0)
ATTITUDE_READ = LANDING_ROW_COUNT  # quaternion
POSITION_READ = ATTITUDE_READ + 4
VELOCITY_READ = POSITION_READ + 3
FLOW_READ = VELOCITY_READ + 3  # forward, right [m/s]
RANGE_READ = FLOW_READ + 2
ARRIVED = RANGE_READ + 1
ROWS = ARRIVED + 1
SCALARS = 12  # fused in a step
STEP_S = 0.02
ATTITUDE_VARIANCE, POSITION_VARIANCE, VELOCITY_VARIANCE = 1e-4, 0.04, 1e-3
FLOW_VARIANCE, RANGE_VARIANCE, LENS_BELOW_M = 1e-3, 1e-4, 0.1


@kernel
def run_landing_filter(
    work: Work, lanes: Lanes, steps: int, age_s: float, settings: LandingSettings, lag: FlowLag
) -> None:
    """Predict and fuse attitude, GPS position and velocity, flow and range, `steps` times; work (ROWS * len(lanes),).

    Row ARRIVED says where the readings are offered; GPS and attitude are of one prediction ago where age_s > 0.
    """
    gate = settings.gate_sigma
    for _ in range(steps):
        predict(work, lanes, FILTER, STEP_S, settings, lag)
        for axis in range(3):
            offer(work, lanes, FILTER, ATTITUDE_VARIANCE, ARRIVED)
            observe_attitude(work, lanes, FILTER, axis, ATTITUDE_READ, age_s)
            fuse(work, lanes, FILTER, ATTITUDE_STATES[axis], gate)
        for axis in range(3):
            offer(work, lanes, FILTER, POSITION_VARIANCE, ARRIVED)
            observe_gps_position(work, lanes, FILTER, axis, POSITION_READ + axis, age_s)
            fuse(work, lanes, FILTER, GPS_POSITION_STATES[axis], gate)
        for axis in range(3):
            offer(work, lanes, FILTER, VELOCITY_VARIANCE, ARRIVED)
            observe_gps_velocity(work, lanes, FILTER, axis, VELOCITY_READ + axis, age_s)
            fuse(work, lanes, FILTER, GPS_VELOCITY_STATES[axis], gate)
        for channel in range(2):
            offer(work, lanes, FILTER, FLOW_VARIANCE, ARRIVED)
            observe_lagged_flow(work, lanes, FILTER, channel, FLOW_READ + channel, lag.gain)
            fuse(work, lanes, FILTER, LAGGED_FLOW_STATES[channel], gate)
        offer(work, lanes, FILTER, RANGE_VARIANCE, ARRIVED)
        observe_range(work, lanes, FILTER, RANGE_READ, LENS_BELOW_M)
        fuse(work, lanes, FILTER, RANGE_STATES, gate)
