"""What only a simulator can do to the landing filter: compare it with the truth, or put it there."""

from __future__ import annotations

from flownav.compile import equation
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.landing.states import (
    ACCEL_BIAS,
    FLOW_LAG,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GYRO_BIAS,
    INS_ERROR,
    POSITION,
    STATES,
    VELOCITY,
)
from flownav.frames import rotation_from_quaternion, to_earth
from flownav.simulation import layout
from flownav.simulation.layout import load_flow, load_gps_errors, load_helicopter, load_imu

ROWS = layout.LANDING
SCORED = 6  # position and velocity NED


@equation
def put_state(work: Work, lanes: Lanes, lane: int, state: int, values: tuple[float, float, float]) -> None:
    """Three values of the nominal state."""
    work[(ROWS.state + state) * len(lanes) + lane] = values[0]
    work[(ROWS.state + state + 1) * len(lanes) + lane] = values[1]
    work[(ROWS.state + state + 2) * len(lanes) + lane] = values[2]


@equation
def take_truth(work: Work, lanes: Lanes) -> None:
    """The nominal state put on the truth, so that every Jacobian is taken there."""
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        put_state(work, lanes, lane, POSITION, (state.pos_n, state.pos_e, state.pos_d))
        put_state(work, lanes, lane, VELOCITY, to_earth(rotation, state.u, state.v, state.w))
        work[ROWS.attitude * len(lanes) + lane] = state.qw
        work[(ROWS.attitude + 1) * len(lanes) + lane] = state.qx
        work[(ROWS.attitude + 2) * len(lanes) + lane] = state.qy
        work[(ROWS.attitude + 3) * len(lanes) + lane] = state.qz
        imu = load_imu(work, lanes, lane)
        put_state(work, lanes, lane, GYRO_BIAS, (imu.gyro_bias_x, imu.gyro_bias_y, imu.gyro_bias_z))
        put_state(work, lanes, lane, ACCEL_BIAS, (imu.accel_bias_x, imu.accel_bias_y, imu.accel_bias_z))
        gps = load_gps_errors(work, lanes, lane)
        put_state(work, lanes, lane, GPS_SLOW, (gps.slow_n_m, gps.slow_e_m, gps.slow_d_m))
        put_state(work, lanes, lane, GPS_FAST, (gps.fast_n_m, gps.fast_e_m, gps.fast_d_m))
        put_state(work, lanes, lane, GPS_VELOCITY, (gps.velocity_n_m_s, gps.velocity_e_m_s, gps.velocity_d_m_s))
        put_state(work, lanes, lane, INS_ERROR, (gps.roll_rad, gps.pitch_rad, gps.heading_rad))
        flow = load_flow(work, lanes, lane)
        work[(ROWS.state + FLOW_LAG) * len(lanes) + lane] = flow.u1
        work[(ROWS.state + FLOW_LAG + 1) * len(lanes) + lane] = flow.u2
        work[(ROWS.state + FLOW_LAG + 2) * len(lanes) + lane] = flow.v1
        work[(ROWS.state + FLOW_LAG + 3) * len(lanes) + lane] = flow.v2


@equation
def note_nees(work: Work, lanes: Lanes) -> None:
    """Normalised estimation error squared e' P^-1 e of position and velocity NED, by elimination."""
    error, square = ROWS.cross, ROWS.scratch
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        velocity = to_earth(rotation, state.u, state.v, state.w)
        true = (state.pos_n, state.pos_e, state.pos_d, velocity[0], velocity[1], velocity[2])
        for i in range(SCORED):
            work[(error + i) * len(lanes) + lane] = work[(ROWS.state + i) * len(lanes) + lane] - true[i]
        work[layout.NEES * len(lanes) + lane] = 0.0
    for i in range(SCORED):
        for j in range(SCORED):
            for lane in range(len(lanes)):
                element = work[(ROWS.covariance + i * STATES + j) * len(lanes) + lane]
                work[(square + i * SCORED + j) * len(lanes) + lane] = element
    for k in range(SCORED):
        pivot = square + k * (SCORED + 1)
        for lane in range(len(lanes)):
            e = work[(error + k) * len(lanes) + lane]
            work[layout.NEES * len(lanes) + lane] += e * e / work[pivot * len(lanes) + lane]
        for i in range(k + 1, SCORED):
            factor = ROWS.gain
            for lane in range(len(lanes)):
                share = work[(square + i * SCORED + k) * len(lanes) + lane] / work[pivot * len(lanes) + lane]
                work[factor * len(lanes) + lane] = share
                work[(error + i) * len(lanes) + lane] -= share * work[(error + k) * len(lanes) + lane]
            for j in range(k + 1, SCORED):
                for lane in range(len(lanes)):
                    taken = work[factor * len(lanes) + lane] * work[(square + k * SCORED + j) * len(lanes) + lane]
                    work[(square + i * SCORED + j) * len(lanes) + lane] -= taken
