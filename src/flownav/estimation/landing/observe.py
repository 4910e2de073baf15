"""The landing filter's measurement laws: each sets an innovation and the coefficients of its Jacobian.

A law `observe_x(...)` is followed by `fuse(work, lanes, rows, X, gate)` with the states X that it names. Readings
lie in rows of the lane buffer; `offered` and `noise` (variance) are set by `offer`.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import equation, larger
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.landing.lag import LEAST_UPRIGHT, body_velocity_jacobian, lens_range
from flownav.estimation.landing.predict import attitude_before, attitude_of
from flownav.estimation.landing.states import (
    ATTITUDE,
    BARO,
    COMPASS,
    FLOW_LAG,
    FLOW_SCALE,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GROUND,
    INS_ERROR,
    POSITION,
    VELOCITY,
    VELOCITY_LAG,
    LandingRows,
)
from flownav.frames import GRAVITY_M_S2, Rotation, Vector, rotation_from_quaternion

# the states that each law reads, in the order of its coefficients
GPS_POSITION_STATES = (
    (POSITION, VELOCITY, GPS_SLOW, GPS_FAST),
    (POSITION + 1, VELOCITY + 1, GPS_SLOW + 1, GPS_FAST + 1),
    (POSITION + 2, VELOCITY + 2, GPS_SLOW + 2, GPS_FAST + 2),
)
GPS_VELOCITY_STATES = (
    (VELOCITY, GPS_VELOCITY, VELOCITY_LAG),
    (VELOCITY + 1, GPS_VELOCITY + 1, VELOCITY_LAG),
    (VELOCITY + 2, GPS_VELOCITY + 2, VELOCITY_LAG),
)
ATTITUDE_STATES = (
    (ATTITUDE, INS_ERROR, INS_ERROR + 1, INS_ERROR + 2),
    (ATTITUDE + 1, INS_ERROR, INS_ERROR + 1, INS_ERROR + 2),
    (ATTITUDE + 2, INS_ERROR, INS_ERROR + 1, INS_ERROR + 2),
)
HEADING_STATES = (ATTITUDE, ATTITUDE + 1, ATTITUDE + 2, INS_ERROR + 2, COMPASS, COMPASS + 1)
RANGE_STATES = (POSITION + 2, GROUND, ATTITUDE, ATTITUDE + 1)
BARO_STATES = (POSITION + 2, BARO)
LAGGED_FLOW_STATES = ((FLOW_LAG, FLOW_SCALE), (FLOW_LAG + 2, FLOW_SCALE))
BODY_VELOCITY_STATES = (
    VELOCITY, VELOCITY + 1, VELOCITY + 2, ATTITUDE, ATTITUDE + 1, ATTITUDE + 2, FLOW_SCALE,
)  # fmt: skip
FLOW_RATE_STATES = (*BODY_VELOCITY_STATES, POSITION + 2, GROUND)
STATE_ITSELF = tuple((state,) for state in range(6))


@equation
def offer(work: Work, lanes: Lanes, rows: LandingRows, variance: float, here: int) -> None:
    """One variance for every lane, offered where row `here` is above 0."""
    for lane in range(len(lanes)):
        work[rows.noise * len(lanes) + lane] = variance
        work[rows.offered * len(lanes) + lane] = work[here * len(lanes) + lane]


@equation
def rotation_of(work: Work, lanes: Lanes, rows: LandingRows, lane: int) -> Rotation:
    """R_EB of a lane's attitude."""
    attitude = attitude_of(work, lanes, rows, lane)
    return rotation_from_quaternion(attitude[0], attitude[1], attitude[2], attitude[3])


@equation
def column(rotation: Rotation, axis: int) -> Vector:
    """The body's forward, right or down axis in earth NED."""
    return (
        rotation[0] if axis == 0 else (rotation[1] if axis == 1 else rotation[2]),
        rotation[3] if axis == 0 else (rotation[4] if axis == 1 else rotation[5]),
        rotation[6] if axis == 0 else (rotation[7] if axis == 1 else rotation[8]),
    )


# -- position and velocity ----------------------------------------------------------------------------------
@equation
def observe_gps_position(work: Work, lanes: Lanes, rows: LandingRows, axis: int, measured: int, age_s: float) -> None:
    """z = p + slow + fast error, of now (age 0) or of one prediction ago, where p was p - v age less its change."""
    for lane in range(len(lanes)):
        late = age_s * work[(rows.state + VELOCITY + axis) * len(lanes) + lane]
        late += work[(rows.change + axis) * len(lanes) + lane] if age_s > 0.0 else 0.0
        predicted = (
            work[(rows.state + POSITION + axis) * len(lanes) + lane]
            - late
            + work[(rows.state + GPS_SLOW + axis) * len(lanes) + lane]
            + work[(rows.state + GPS_FAST + axis) * len(lanes) + lane]
        )
        work[rows.innovation * len(lanes) + lane] = work[measured * len(lanes) + lane] - predicted
        work[rows.coefficient * len(lanes) + lane] = 1.0
        work[(rows.coefficient + 1) * len(lanes) + lane] = -age_s
        work[(rows.coefficient + 2) * len(lanes) + lane] = 1.0
        work[(rows.coefficient + 3) * len(lanes) + lane] = 1.0


@equation
def observe_gps_velocity(work: Work, lanes: Lanes, rows: LandingRows, axis: int, measured: int, age_s: float) -> None:
    """z = v - lag a + Gauss-Markov error, of now or of one prediction ago; a is the acceleration of that prediction."""
    gravity = GRAVITY_M_S2 if axis == 2 else 0.0
    for lane in range(len(lanes)):
        late = work[(rows.change + 3 + axis) * len(lanes) + lane] if age_s > 0.0 else 0.0
        vel = work[(rows.state + VELOCITY + axis) * len(lanes) + lane] - late
        accel = work[(rows.force + axis) * len(lanes) + lane] + gravity
        lagging = work[(rows.state + VELOCITY_LAG) * len(lanes) + lane] * accel
        predicted = vel + work[(rows.state + GPS_VELOCITY + axis) * len(lanes) + lane] - lagging
        work[rows.innovation * len(lanes) + lane] = work[measured * len(lanes) + lane] - predicted
        work[rows.coefficient * len(lanes) + lane] = 1.0
        work[(rows.coefficient + 1) * len(lanes) + lane] = 1.0
        work[(rows.coefficient + 2) * len(lanes) + lane] = -accel


@equation
def observe_state(work: Work, lanes: Lanes, rows: LandingRows, state: int, measured: int) -> None:
    """z = a position or velocity state itself (an external pose; a vehicle at rest)."""
    for lane in range(len(lanes)):
        predicted = work[(rows.state + state) * len(lanes) + lane]
        work[rows.innovation * len(lanes) + lane] = work[measured * len(lanes) + lane] - predicted
        work[rows.coefficient * len(lanes) + lane] = 1.0


# -- attitude -----------------------------------------------------------------------------------------------
@equation
def observe_attitude(work: Work, lanes: Lanes, rows: LandingRows, axis: int, measured: int, age_s: float) -> None:
    """An external attitude (an INS): its rotation from the filter's, about one earth axis.

    q_read q^-1 = theta + e_heading down + R (e_roll, e_pitch, 0), small angles; the quaternion lies in four rows
    `measured`.
    """
    for lane in range(len(lanes)):
        rw, rx = work[measured * len(lanes) + lane], work[(measured + 1) * len(lanes) + lane]
        ry, rz = work[(measured + 2) * len(lanes) + lane], work[(measured + 3) * len(lanes) + lane]
        late = age_s > 0.0
        qw, qx, qy, qz = attitude_before(work, lanes, rows, lane) if late else attitude_of(work, lanes, rows, lane)
        w = rw * qw + rx * qx + ry * qy + rz * qz
        x = -rw * qx + rx * qw - ry * qz + rz * qy
        y = -rw * qy + rx * qz + ry * qw - rz * qx
        z = -rw * qz - rx * qy + ry * qx + rz * qw
        twice = 2.0 if w >= 0.0 else -2.0
        turn = twice * (x if axis == 0 else (y if axis == 1 else z))
        rotation = rotation_of(work, lanes, rows, lane)
        by_roll, by_pitch = rotation[3 * axis], rotation[3 * axis + 1]
        by_heading = 1.0 if axis == 2 else 0.0
        error = (
            by_roll * work[(rows.state + INS_ERROR) * len(lanes) + lane]
            + by_pitch * work[(rows.state + INS_ERROR + 1) * len(lanes) + lane]
            + by_heading * work[(rows.state + INS_ERROR + 2) * len(lanes) + lane]
        )
        work[rows.innovation * len(lanes) + lane] = turn - error
        work[rows.coefficient * len(lanes) + lane] = 1.0
        work[(rows.coefficient + 1) * len(lanes) + lane] = by_roll
        work[(rows.coefficient + 2) * len(lanes) + lane] = by_pitch
        work[(rows.coefficient + 3) * len(lanes) + lane] = by_heading


@equation
def observe_heading(work: Work, lanes: Lanes, rows: LandingRows, measured: int) -> None:
    """z = psi + A + B sin psi + C cos psi [rad], wrapped to half a turn: a compass, or an external heading (B = C = 0).

    A is the slow error of the heading (declination, mounting); B and C are the deviation that hard iron makes, which
    turns with the vehicle.
    """
    for lane in range(len(lanes)):
        rotation = rotation_of(work, lanes, rows, lane)
        forward_n, forward_e, forward_d = rotation[0], rotation[3], rotation[6]
        level = larger(forward_n * forward_n + forward_e * forward_e, LEAST_UPRIGHT * LEAST_UPRIGHT)
        cosine, sine = forward_n / np.sqrt(level), forward_e / np.sqrt(level)
        by_sine = work[(rows.state + COMPASS) * len(lanes) + lane]
        by_cosine = work[(rows.state + COMPASS + 1) * len(lanes) + lane]
        constant = work[(rows.state + INS_ERROR + 2) * len(lanes) + lane]
        heading = np.arctan2(forward_e, forward_n) + constant + by_sine * sine + by_cosine * cosine
        difference = work[measured * len(lanes) + lane] - heading
        by_heading = 1.0 + by_sine * cosine - by_cosine * sine
        work[rows.innovation * len(lanes) + lane] = np.arctan2(np.sin(difference), np.cos(difference))
        work[rows.coefficient * len(lanes) + lane] = -by_heading * forward_d * forward_n / level
        work[(rows.coefficient + 1) * len(lanes) + lane] = -by_heading * forward_d * forward_e / level
        work[(rows.coefficient + 2) * len(lanes) + lane] = by_heading
        work[(rows.coefficient + 3) * len(lanes) + lane] = 1.0
        work[(rows.coefficient + 4) * len(lanes) + lane] = sine
        work[(rows.coefficient + 5) * len(lanes) + lane] = cosine


# -- height -------------------------------------------------------------------------------------------------
@equation
def observe_range(work: Work, lanes: Lanes, rows: LandingRows, measured: int, lens_below_m: float) -> None:
    """z = (ground - p_d)/R_33 - lens: the distance along body down, over level ground."""
    for lane in range(len(lanes)):
        rotation = rotation_of(work, lanes, rows, lane)
        upright = larger(rotation[8], LEAST_UPRIGHT)
        height = work[(rows.state + GROUND) * len(lanes) + lane] - work[(rows.state + POSITION + 2) * len(lanes) + lane]
        slope = height / (upright * upright)
        work[rows.innovation * len(lanes) + lane] = work[measured * len(lanes) + lane] - (
            height / upright - lens_below_m
        )
        work[rows.coefficient * len(lanes) + lane] = -1.0 / upright
        work[(rows.coefficient + 1) * len(lanes) + lane] = 1.0 / upright
        work[(rows.coefficient + 2) * len(lanes) + lane] = -slope * rotation[5]
        work[(rows.coefficient + 3) * len(lanes) + lane] = slope * rotation[2]


@equation
def observe_baro(work: Work, lanes: Lanes, rows: LandingRows, measured: int) -> None:
    """z = -p_d + offset: pressure altitude."""
    for lane in range(len(lanes)):
        predicted = (
            work[(rows.state + BARO) * len(lanes) + lane] - work[(rows.state + POSITION + 2) * len(lanes) + lane]
        )
        work[rows.innovation * len(lanes) + lane] = work[measured * len(lanes) + lane] - predicted
        work[rows.coefficient * len(lanes) + lane] = -1.0
        work[(rows.coefficient + 1) * len(lanes) + lane] = 1.0


@equation
def height_range(work: Work, lanes: Lanes, rows: LandingRows, lane: int, lens_below_m: float) -> float:
    """The range that the state implies [m], at least LEAST_RANGE_M."""
    height = work[(rows.state + GROUND) * len(lanes) + lane] - work[(rows.state + POSITION + 2) * len(lanes) + lane]
    return lens_range(rotation_of(work, lanes, rows, lane), height, lens_below_m)[0]


# -- optical flow -------------------------------------------------------------------------------------------
@equation
def observe_lagged_flow(work: Work, lanes: Lanes, rows: LandingRows, channel: int, measured: int, gain: float) -> None:
    """z = (1 + scale) gain x1: metric flow of a sensor with identified dynamics, channel 0 forward, 1 right."""
    for lane in range(len(lanes)):
        unscaled = gain * work[(rows.state + FLOW_LAG + 2 * channel) * len(lanes) + lane]
        scale = 1.0 + work[(rows.state + FLOW_SCALE) * len(lanes) + lane]
        work[rows.innovation * len(lanes) + lane] = work[measured * len(lanes) + lane] - scale * unscaled
        work[rows.coefficient * len(lanes) + lane] = scale * gain
        work[(rows.coefficient + 1) * len(lanes) + lane] = unscaled


@equation
def observe_body_velocity(
    work: Work, lanes: Lanes, rows: LandingRows, component: int, measured: int, lever_m_s: int
) -> None:
    """z = (1 + scale) (R_BE v + w x lever): metric flow without dynamics; w x lever lies in row `lever_m_s`."""
    for lane in range(len(lanes)):
        along, axis, turn = body_speed(work, lanes, rows, lane, component)
        along += work[lever_m_s * len(lanes) + lane]
        scale = 1.0 + work[(rows.state + FLOW_SCALE) * len(lanes) + lane]
        work[rows.innovation * len(lanes) + lane] = work[measured * len(lanes) + lane] - scale * along
        for i in range(3):
            work[(rows.coefficient + i) * len(lanes) + lane] = scale * axis[i]
            work[(rows.coefficient + 3 + i) * len(lanes) + lane] = scale * turn[i]
        work[(rows.coefficient + 6) * len(lanes) + lane] = along


@equation
def body_speed(work: Work, lanes: Lanes, rows: LandingRows, lane: int, component: int) -> tuple[float, Vector, Vector]:
    """Body velocity of one component [m/s], and its Jacobians on velocity NED and attitude error."""
    axis = column(rotation_of(work, lanes, rows, lane), component)
    vel_n = work[(rows.state + VELOCITY) * len(lanes) + lane]
    vel_e = work[(rows.state + VELOCITY + 1) * len(lanes) + lane]
    vel_d = work[(rows.state + VELOCITY + 2) * len(lanes) + lane]
    along = axis[0] * vel_n + axis[1] * vel_e + axis[2] * vel_d
    return along, axis, body_velocity_jacobian(axis, vel_n, vel_e, vel_d)


@equation
def observe_flow_rate(
    work: Work, lanes: Lanes, rows: LandingRows, channel: int, measured: int, lever_m_s: int, lens_below_m: float
) -> None:
    """Flow less rotation: z_x = -(1 + scale) v/r (channel 0), z_y = (1 + scale) u/r (channel 1) [rad/s].

    PX4's convention; r along the boresight over level ground. The body velocity is that of the lens.
    """
    for lane in range(len(lanes)):
        component = 1 if channel == 0 else 0
        along, axis, turn = body_speed(work, lanes, rows, lane, component)
        along += work[lever_m_s * len(lanes) + lane]
        height = work[(rows.state + GROUND) * len(lanes) + lane] - work[(rows.state + POSITION + 2) * len(lanes) + lane]
        rotation = rotation_of(work, lanes, rows, lane)
        range_m, by_height, by_north, by_east = lens_range(rotation, height, lens_below_m)
        sign = -1.0 if channel == 0 else 1.0
        scale = 1.0 + work[(rows.state + FLOW_SCALE) * len(lanes) + lane]
        per_speed = sign * scale / range_m
        work[rows.innovation * len(lanes) + lane] = work[measured * len(lanes) + lane] - per_speed * along
        for i in range(3):
            work[(rows.coefficient + i) * len(lanes) + lane] = per_speed * axis[i]
            work[(rows.coefficient + 3 + i) * len(lanes) + lane] = per_speed * turn[i]
        by_range = -per_speed * along / range_m
        work[(rows.coefficient + 3) * len(lanes) + lane] += by_range * by_north
        work[(rows.coefficient + 4) * len(lanes) + lane] += by_range * by_east
        work[(rows.coefficient + 6) * len(lanes) + lane] = sign * along / range_m
        work[(rows.coefficient + 7) * len(lanes) + lane] = -by_range * by_height
        work[(rows.coefficient + 8) * len(lanes) + lane] = by_range * by_height
