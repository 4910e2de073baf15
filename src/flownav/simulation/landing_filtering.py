"""The landing filter's turn in each epoch of the simulator: predict, fuse what arrived, say what is estimated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import equation
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.landing.algebra import fuse
from flownav.estimation.landing.bias_limits import limit_biases
from flownav.estimation.landing.observe import (
    ATTITUDE_STATES,
    BODY_VELOCITY_STATES,
    GPS_POSITION_STATES,
    GPS_VELOCITY_STATES,
    LAGGED_FLOW_STATES,
    RANGE_STATES,
    STATE_ITSELF,
    observe_attitude,
    observe_body_velocity,
    observe_gps_position,
    observe_gps_velocity,
    observe_lagged_flow,
    observe_range,
    observe_state,
    offer,
    rotation_of,
)
from flownav.estimation.landing.observe_pad import PAD_STATES, observe_pad
from flownav.estimation.landing.predict import predict
from flownav.estimation.landing.settings import FlowLag, LandingSettings
from flownav.estimation.landing.states import ACCEL_BIAS, GROUND, POSITION, STATES, VELOCITY
from flownav.frames import to_body
from flownav.sensors.flow import FlowParameters, flow_noise_sigma
from flownav.simulation import layout
from flownav.simulation.consistency import note_nees, take_truth
from flownav.simulation.layout import load_autopilot
from flownav.simulation.sensing import EPOCH_S, PAD_EPOCHS, RANGE_EPOCHS

ROWS = layout.LANDING
START_POSITION_M = 10.0  # prior about a first GPS reading, before that reading is fused
START_ATTITUDE_RAD = 0.2  # the same about a first INS attitude
STILL_SIGMA_M_S = 0.003
SETTLING_S = 2.0  # the skids take the weight as the collective goes down


class LandingSetup(NamedTuple):
    """The landing filter in the simulator: settings, and the white part of each sensor's noise."""

    settings: LandingSettings
    lag: FlowLag | None  # None: the flow sensor is taken for a velocity without dynamics
    flow: FlowParameters  # the datasheet's noise against height
    start_variance: NDArray[np.float64]  # (STATES,); errors of position and velocity are drawn from it
    bias_known: bool  # the accelerometer's bias, too, is known to its start variance (the vehicle has flown before)
    gps_position_variance: NDArray[np.float64]  # (3,) white part, NED [m2]
    gps_velocity_variance: float  # infinite where the unit offers none [m2/s2]
    ins_variance: float  # [rad2]
    reading_age_s: float  # of the GPS/INS: 0 or one epoch
    range_variance: float  # [m2]
    sonar_floor_m: float
    lens_below_cg_m: float
    flow_min_height_m: float  # of the lens; flow is not fused nearer to the ground
    pad_angle_sigma_rad: float  # of the line of sight
    pad_distance_sigma: float  # of the distance
    fuse_flow: float  # 0: flow is not fused
    along_truth: bool  # the covariance alone, with every Jacobian at the truth: the posterior Cramér-Rao bound


# -- start ------------------------------------------------------------------------------------------------
@equation
def start_landing_filter(work: Work, lanes: Lanes, setup: LandingSetup, start_known: bool) -> None:
    """Nominal state at the known pad (with this flight's error) or the first GPS reading; diagonal covariance."""
    for i in range(STATES):
        for lane in range(len(lanes)):
            work[(ROWS.state + i) * len(lanes) + lane] = 0.0
        for j in range(STATES):
            variance = setup.start_variance[i] if i == j else 0.0
            for lane in range(len(lanes)):
                work[(ROWS.covariance + i * STATES + j) * len(lanes) + lane] = variance
    for lane in range(len(lanes)):
        work[layout.ALWAYS * len(lanes) + lane] = 1.0
    for i in range(4):
        for lane in range(len(lanes)):
            work[(ROWS.attitude + i) * len(lanes) + lane] = work[(layout.GPS + 6 + i) * len(lanes) + lane]
    for i in range(3):
        for lane in range(len(lanes)):
            known = work[(layout.HELICOPTER + i) * len(lanes) + lane]
            measured = work[(layout.GPS + i) * len(lanes) + lane]
            error = np.sqrt(setup.start_variance[POSITION + i]) * work[(layout.START_NORMALS + i) * len(lanes) + lane]
            work[(ROWS.state + POSITION + i) * len(lanes) + lane] = known + error if start_known else measured
            speed = (
                np.sqrt(setup.start_variance[VELOCITY + i]) * work[(layout.START_NORMALS + 3 + i) * len(lanes) + lane]
            )
            work[(ROWS.state + VELOCITY + i) * len(lanes) + lane] = speed
            bias = (
                np.sqrt(setup.start_variance[ACCEL_BIAS + i]) * work[(layout.START_NORMALS + 6 + i) * len(lanes) + lane]
            )
            true = work[(layout.IMU_BIAS + i) * len(lanes) + lane]
            work[(ROWS.state + ACCEL_BIAS + i) * len(lanes) + lane] = true + bias if setup.bias_known else 0.0
    for i in range(6):
        for lane in range(len(lanes)):
            work[(ROWS.imu_before + i) * len(lanes) + lane] = work[(layout.IMU_READING + i) * len(lanes) + lane]


# -- one epoch --------------------------------------------------------------------------------------------
@equation
def run_landing_filter(work: Work, lanes: Lanes, epoch: int, setup: LandingSetup) -> None:
    """Predict over the last epoch and fuse this one's readings."""
    settings, age_s = setup.settings, setup.reading_age_s if epoch > 0 else 0.0
    if epoch > 0:
        for i in range(6):
            for lane in range(len(lanes)):
                work[(ROWS.imu + i) * len(lanes) + lane] = work[(layout.IMU_READING + i) * len(lanes) + lane]
        predict(work, lanes, ROWS, EPOCH_S, settings, setup.lag)
    if setup.along_truth:
        take_truth(work, lanes)
    fuse_solution(work, lanes, age_s, setup)
    fuse_rest(work, lanes, settings)
    if setup.fuse_flow > 0.0:
        fuse_flow(work, lanes, setup, setup.lag)
    if epoch % RANGE_EPOCHS == 0:
        fuse_range(work, lanes, setup)
    if epoch % PAD_EPOCHS == 0:
        fuse_pad(work, lanes, setup)
    limit_biases(work, lanes, ROWS, settings)
    if setup.along_truth:
        take_truth(work, lanes)
    note_landing_estimate(work, lanes)
    note_nees(work, lanes)


@equation
def fuse_solution(work: Work, lanes: Lanes, age_s: float, setup: LandingSetup) -> None:
    """The GPS/INS: attitude, position, and velocity where it offers one."""
    gate = setup.settings.gate_sigma
    for axis in range(3):
        offer(work, lanes, ROWS, setup.ins_variance, layout.ALWAYS)
        observe_attitude(work, lanes, ROWS, axis, layout.GPS + 6, age_s)
        fuse(work, lanes, ROWS, ATTITUDE_STATES[axis], gate)
    for axis in range(3):
        offer(work, lanes, ROWS, setup.gps_position_variance[axis], layout.ARRIVED + axis)
        observe_gps_position(work, lanes, ROWS, axis, layout.GPS + axis, age_s)
        fuse(work, lanes, ROWS, GPS_POSITION_STATES[axis], gate)
        note_landing_innovation(work, lanes, axis)
    if setup.gps_velocity_variance < np.inf:
        for axis in range(3):
            offer(work, lanes, ROWS, setup.gps_velocity_variance, layout.ARRIVED + axis)
            observe_gps_velocity(work, lanes, ROWS, axis, layout.GPS + 3 + axis, age_s)
            fuse(work, lanes, ROWS, GPS_VELOCITY_STATES[axis], gate)


@equation
def fuse_rest(work: Work, lanes: Lanes, settings: LandingSettings) -> None:
    """A vehicle on its skids that has not been told to fly does not move, once it has settled after a landing."""
    for lane in range(len(lanes)):
        autopilot = load_autopilot(work, lanes, lane)
        settled = autopilot.contact_time_s == 0.0 or autopilot.contact_time_s > SETTLING_S
        resting = autopilot.flying == 0.0 and settled and work[layout.CONTACT * len(lanes) + lane] > 0.0
        work[layout.STILL * len(lanes) + lane] = 1.0 if resting else 0.0
    for axis in range(3):
        offer(work, lanes, ROWS, STILL_SIGMA_M_S * STILL_SIGMA_M_S, layout.STILL)
        observe_state(work, lanes, ROWS, VELOCITY + axis, layout.NOTHING)
        fuse(work, lanes, ROWS, STATE_ITSELF[VELOCITY + axis], settings.gate_sigma)


@equation
def fuse_flow(work: Work, lanes: Lanes, setup: LandingSetup, lag: FlowLag | None) -> None:
    """Both flow channels, with the datasheet's noise at the height that the filter believes."""
    for channel in range(2):
        for lane in range(len(lanes)):
            ground = work[(ROWS.state + GROUND) * len(lanes) + lane]
            height = ground - work[(ROWS.state + POSITION + 2) * len(lanes) + lane] - setup.lens_below_cg_m
            sigma = flow_noise_sigma(height, setup.flow)
            work[ROWS.noise * len(lanes) + lane] = sigma * sigma
            engaged = work[(layout.FLOW_READING + 3) * len(lanes) + lane] > 0.0
            work[ROWS.offered * len(lanes) + lane] = 1.0 if engaged and height > setup.flow_min_height_m else 0.0
        if lag is None:
            observe_body_velocity(work, lanes, ROWS, channel, layout.FLOW_READING + channel, layout.NOTHING)
            fuse(work, lanes, ROWS, BODY_VELOCITY_STATES, setup.settings.gate_sigma)
        else:
            observe_lagged_flow(work, lanes, ROWS, channel, layout.FLOW_READING + channel, lag.gain)
            fuse(work, lanes, ROWS, LAGGED_FLOW_STATES[channel], setup.settings.gate_sigma)
        note_landing_innovation(work, lanes, 3 + channel)


@equation
def fuse_range(work: Work, lanes: Lanes, setup: LandingSetup) -> None:
    """The sonar, above its floor."""
    for lane in range(len(lanes)):
        distance = work[layout.RANGE * len(lanes) + lane]
        valid = work[(layout.RANGE + 1) * len(lanes) + lane] > 0.0
        work[ROWS.noise * len(lanes) + lane] = setup.range_variance
        work[ROWS.offered * len(lanes) + lane] = 1.0 if valid and distance > setup.sonar_floor_m else 0.0
    observe_range(work, lanes, ROWS, layout.RANGE, setup.lens_below_cg_m)
    fuse(work, lanes, ROWS, RANGE_STATES, setup.settings.gate_sigma)


@equation
def fuse_pad(work: Work, lanes: Lanes, setup: LandingSetup) -> None:
    """The pad-relative fix: across its line of sight and along it."""
    for component in range(3):
        sigma = setup.pad_distance_sigma if component == 2 else setup.pad_angle_sigma_rad
        for lane in range(len(lanes)):
            spread = sigma * work[(layout.PAD_READING + 2) * len(lanes) + lane]
            work[ROWS.noise * len(lanes) + lane] = spread * spread
            work[ROWS.offered * len(lanes) + lane] = work[(layout.PAD_READING + 3) * len(lanes) + lane]
        observe_pad(work, lanes, ROWS, component, layout.PAD_READING, setup.lens_below_cg_m)
        fuse(work, lanes, ROWS, PAD_STATES, setup.settings.gate_sigma)


# -- what is said -------------------------------------------------------------------------------------------
@equation
def note_landing_innovation(work: Work, lanes: Lanes, component: int) -> None:
    """Keep the innovation of the component just fused, and its variance, for the history."""
    for lane in range(len(lanes)):
        row = layout.INNOVATION + component
        offered = work[ROWS.offered * len(lanes) + lane] > 0.0
        work[row * len(lanes) + lane] = work[ROWS.innovation * len(lanes) + lane]
        variance = work[ROWS.innovation_variance * len(lanes) + lane]
        work[(row + layout.SCORED) * len(lanes) + lane] = variance if offered else 0.0


@equation
def note_landing_estimate(work: Work, lanes: Lanes) -> None:
    """Position NED, body velocity, attitude, and variances: R_BE v and diag(R_BE P_vv R_EB)."""
    for i in range(4):
        for lane in range(len(lanes)):
            work[(layout.ESTIMATED_ATTITUDE + i) * len(lanes) + lane] = work[(ROWS.attitude + i) * len(lanes) + lane]
    for i in range(3):
        diagonal = ROWS.covariance + (POSITION + i) * (STATES + 1)
        for lane in range(len(lanes)):
            work[(layout.ESTIMATED + i) * len(lanes) + lane] = work[(ROWS.state + POSITION + i) * len(lanes) + lane]
            work[(layout.VARIANCE + i) * len(lanes) + lane] = work[diagonal * len(lanes) + lane]
    for lane in range(len(lanes)):
        rotation = rotation_of(work, lanes, ROWS, lane)
        body = to_body(
            rotation,
            work[(ROWS.state + VELOCITY) * len(lanes) + lane],
            work[(ROWS.state + VELOCITY + 1) * len(lanes) + lane],
            work[(ROWS.state + VELOCITY + 2) * len(lanes) + lane],
        )
        for i in range(3):
            work[(layout.ESTIMATED + 3 + i) * len(lanes) + lane] = body[i]
            variance = 0.0
            for j in range(3):
                for k in range(3):
                    element = ROWS.covariance + (VELOCITY + j) * STATES + VELOCITY + k
                    variance += rotation[3 * j + i] * work[element * len(lanes) + lane] * rotation[3 * k + i]
            work[(layout.VARIANCE + 3 + i) * len(lanes) + lane] = variance
