"""The filter's turn in each epoch: the paper's or the kinematic one, on the readings of the lane buffer.

Which filter flies is part of the flight's type (the other one's parameters are None), so that a kernel holds
the code of its own filter alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import equation
from flownav.estimation import kinematic_filter, paper_filter
from flownav.estimation.kalman import Lanes, Work, start
from flownav.estimation.kinematic_settings import KinematicSettings
from flownav.estimation.paper_filter import STATES, PaperModel
from flownav.frames import rotation_from_quaternion, to_body
from flownav.simulation import layout
from flownav.simulation.landing_filtering import LandingSetup, run_landing_filter, start_landing_filter
from flownav.simulation.layout import load_gps, load_imu_reading
from flownav.simulation.sensing import EPOCH_S, RANGE_EPOCHS

OFFERED = layout.OFFER + 2
VARIANCE = layout.OFFER + 1


class KinematicSetup(NamedTuple):
    """The kinematic filter in the simulator: its settings, and the accuracies that the GPS/INS reports."""

    settings: KinematicSettings
    gps_position_variance: NDArray[np.float64]  # (3,) NED [m2]
    gps_velocity_variance: NDArray[np.float64]  # (3,) NED [m2/s2]; infinite where the unit offers no velocity
    lens_below_cg_m: float
    sonar_floor_m: float


@equation
def start_filter(
    work: Work, lanes: Lanes, variance: NDArray[np.float64], start_known: bool, landing: LandingSetup | None
) -> None:
    """x: the known start, or the first GPS position; velocity zero. P = diag(variance), or the landing filter's own."""
    if landing is None:
        start(work, lanes, layout.FILTER, STATES, variance)
        for component in range(3):
            for lane in range(len(lanes)):
                known = work[(layout.HELICOPTER + component) * len(lanes) + lane]
                measured = work[(layout.MEASURED + component) * len(lanes) + lane]
                position = known if start_known else measured
                work[(layout.FILTER.state + component) * len(lanes) + lane] = position
    else:
        start_landing_filter(work, lanes, landing, start_known)


@equation
def run_filter(
    work: Work,
    lanes: Lanes,
    epoch: int,
    paper: PaperModel | None,
    kinematic: KinematicSetup | None,
    landing: LandingSetup | None,
) -> None:
    """Predict over the last epoch, correct with this one's readings, and say what is estimated.

    The compiler drops a branch whose filter is None, for which the tests must stand nested as they do.
    """
    if landing is None:
        if paper is None:
            if kinematic is not None:
                run_kinematic_filter(work, lanes, epoch, kinematic)
        else:
            run_paper_filter(work, lanes, epoch, paper)
        say_ins_attitude(work, lanes)
    else:
        run_landing_filter(work, lanes, epoch, landing)


@equation
def say_ins_attitude(work: Work, lanes: Lanes) -> None:
    """A filter without an attitude of its own says the INS's."""
    for i in range(4):
        for lane in range(len(lanes)):
            work[(layout.ESTIMATED_ATTITUDE + i) * len(lanes) + lane] = work[(layout.GPS + 6 + i) * len(lanes) + lane]


# -- the paper's ------------------------------------------------------------------------------------------
@equation
def run_paper_filter(work: Work, lanes: Lanes, epoch: int, model: PaperModel) -> None:
    """Equations 24-30; the estimate is the state."""
    if epoch > 0:
        paper_filter.predict(work, lanes, layout.FILTER, layout.INPUT, model)
    paper_filter.update(work, lanes, layout.FILTER, layout.MEASURED, layout.ARRIVED, layout.INNOVATION, model)
    for i in range(STATES):
        diagonal = layout.FILTER.covariance + i * (STATES + 1)
        for lane in range(len(lanes)):
            work[(layout.ESTIMATED + i) * len(lanes) + lane] = work[(layout.FILTER.state + i) * len(lanes) + lane]
            work[(layout.VARIANCE + i) * len(lanes) + lane] = work[diagonal * len(lanes) + lane]


# -- the kinematic one --------------------------------------------------------------------------------------
@equation
def run_kinematic_filter(work: Work, lanes: Lanes, epoch: int, setup: KinematicSetup) -> None:
    """INS attitude and accelerometer move it; GPS, flow and range correct it."""
    take_attitude(work, lanes)
    if epoch > 0:
        kinematic_filter.predict(work, lanes, layout.KINEMATIC, EPOCH_S, setup.settings)
    for axis in range(3):
        offer(work, lanes, layout.MEASURED + axis, setup.gps_position_variance[axis], layout.ARRIVED + axis)
        fuse_state(work, lanes, axis, setup.settings)
        note_innovation(work, lanes, axis)
    if setup.gps_velocity_variance[0] < np.inf:
        for axis in range(3):
            offer(work, lanes, layout.GPS + 3 + axis, setup.gps_velocity_variance[axis], layout.ARRIVED + axis)
            fuse_state(work, lanes, 3 + axis, setup.settings)
    for axis in range(2):
        offer_flow(work, lanes, axis)
        kinematic_filter.observe_body_velocity(work, lanes, layout.KINEMATIC, axis, layout.OFFER, VARIANCE, OFFERED)
        kinematic_filter.correct(work, lanes, layout.KINEMATIC, setup.settings, 1.0 / setup.settings.trim_time_s)
        note_innovation(work, lanes, 3 + axis)
    if epoch % RANGE_EPOCHS == 0:
        offer_height(work, lanes, setup)
        fuse_state(work, lanes, 2, setup.settings)
    note_estimate(work, lanes)


@equation
def take_attitude(work: Work, lanes: Lanes) -> None:
    """INS attitude and specific force into the filter's rows."""
    rows = layout.KINEMATIC
    for lane in range(len(lanes)):
        gps = load_gps(work, lanes, lane)
        work[rows.attitude * len(lanes) + lane] = gps.qw
        work[(rows.attitude + 1) * len(lanes) + lane] = gps.qx
        work[(rows.attitude + 2) * len(lanes) + lane] = gps.qy
        work[(rows.attitude + 3) * len(lanes) + lane] = gps.qz
        imu = load_imu_reading(work, lanes, lane)
        work[rows.force * len(lanes) + lane] = imu.accel_x_m_s2
        work[(rows.force + 1) * len(lanes) + lane] = imu.accel_y_m_s2
        work[(rows.force + 2) * len(lanes) + lane] = imu.accel_z_m_s2


@equation
def offer(work: Work, lanes: Lanes, value: int, variance: float, here: int) -> None:
    """A reading from row `value` with one variance, offered where row `here` is 1."""
    for lane in range(len(lanes)):
        work[layout.OFFER * len(lanes) + lane] = work[value * len(lanes) + lane]
        work[VARIANCE * len(lanes) + lane] = variance
        work[OFFERED * len(lanes) + lane] = work[here * len(lanes) + lane]


@equation
def offer_flow(work: Work, lanes: Lanes, axis: int) -> None:
    """A flow velocity with the variance that the sensor's own law gives at this height."""
    for lane in range(len(lanes)):
        sigma = work[layout.FLOW_SIGMA * len(lanes) + lane]
        work[layout.OFFER * len(lanes) + lane] = work[(layout.FLOW_READING + axis) * len(lanes) + lane]
        work[VARIANCE * len(lanes) + lane] = sigma * sigma
        work[OFFERED * len(lanes) + lane] = work[(layout.FLOW_READING + 3) * len(lanes) + lane]


@equation
def offer_height(work: Work, lanes: Lanes, setup: KinematicSetup) -> None:
    """The sonar's range as the position's down component; not offered at or below the sonar's floor."""
    for lane in range(len(lanes)):
        gps = load_gps(work, lanes, lane)
        cosine = rotation_from_quaternion(gps.qw, gps.qx, gps.qy, gps.qz)[8]
        distance = work[layout.RANGE * len(lanes) + lane]
        above_floor = distance > setup.sonar_floor_m and work[(layout.RANGE + 1) * len(lanes) + lane] > 0.0
        work[layout.OFFER * len(lanes) + lane] = -(distance + setup.lens_below_cg_m) * cosine
        variance = kinematic_filter.range_variance(distance, setup.settings)
        work[VARIANCE * len(lanes) + lane] = variance
        work[OFFERED * len(lanes) + lane] = 1.0 if above_floor else 0.0


@equation
def fuse_state(work: Work, lanes: Lanes, index: int, settings: KinematicSettings) -> None:
    """Fuse the offered reading of a state, position or velocity NED."""
    kinematic_filter.observe_state(work, lanes, layout.KINEMATIC, index, layout.OFFER, VARIANCE, OFFERED)
    kinematic_filter.correct(work, lanes, layout.KINEMATIC, settings, 1.0 / settings.trim_time_s)


@equation
def note_innovation(work: Work, lanes: Lanes, component: int) -> None:
    """Keep the innovation of the component just fused, and its variance, for the history."""
    for lane in range(len(lanes)):
        work[(layout.INNOVATION + component) * len(lanes) + lane] = work[layout.FILTER.innovation * len(lanes) + lane]
        variance = work[layout.FILTER.innovation_variance * len(lanes) + lane]
        work[(layout.INNOVATION + STATES + component) * len(lanes) + lane] = variance


@equation
def note_estimate(work: Work, lanes: Lanes) -> None:
    """Position NED and body velocity, and their variances: R_BE v, and diag(R_BE P_vv R_EB)."""
    rows = layout.FILTER
    for lane in range(len(lanes)):
        gps = load_gps(work, lanes, lane)
        rotation = rotation_from_quaternion(gps.qw, gps.qx, gps.qy, gps.qz)
        body = to_body(
            rotation,
            work[(rows.state + 3) * len(lanes) + lane],
            work[(rows.state + 4) * len(lanes) + lane],
            work[(rows.state + 5) * len(lanes) + lane],
        )
        for i in range(3):
            work[(layout.ESTIMATED + i) * len(lanes) + lane] = work[(rows.state + i) * len(lanes) + lane]
            work[(layout.ESTIMATED + 3 + i) * len(lanes) + lane] = body[i]
            diagonal = rows.covariance + i * (STATES + 1)
            work[(layout.VARIANCE + i) * len(lanes) + lane] = work[diagonal * len(lanes) + lane]
            variance = 0.0
            for j in range(3):
                for k in range(3):
                    entry = work[(rows.covariance + (3 + j) * STATES + 3 + k) * len(lanes) + lane]
                    variance += rotation[3 * j + i] * rotation[3 * k + i] * entry
            work[(layout.VARIANCE + 3 + i) * len(lanes) + lane] = variance
