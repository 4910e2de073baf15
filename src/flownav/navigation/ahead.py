"""From the filter's instant to a later one: its state carried on by the IMU readings in between.

A live navigator is fed with a delay, so that readings of old instants find their place; what is sent must be of now.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import ONE_LANE, kernel
from flownav.estimation.landing.predict import attitude_of, turned
from flownav.estimation.landing.states import ACCEL_BIAS, GYRO_BIAS, POSITION, VELOCITY
from flownav.frames import GRAVITY_M_S2, rotation_from_quaternion, to_earth
from flownav.measurement import Array
from flownav.navigation.state import CLOCK, LATEST_IMU, ROWS, USE_IMU

AHEAD = 13  # position NED [m], velocity NED [m/s], quaternion body to earth, body rate [rad/s]


@kernel
def ahead(work: Array, memory: Array, imu: Array, t_s: float, out: Array) -> None:
    """out (AHEAD,): the state at t_s. imu (n, 7): time and reading of those later than the filter's clock, in order.

    q <- q exp(w dt), v <- v + (R_mid f + g) dt, p <- p + mean v dt, as `estimation/landing/predict.move`, each step
    with the mean of the readings at its ends. Without an IMU attitude and velocity are held.
    """
    state = ROWS.state
    q = attitude_of(work, ONE_LANE, ROWS, 0)
    for i in range(3):
        out[i], out[3 + i], out[10 + i] = work[state + POSITION + i], work[state + VELOCITY + i], 0.0
    at_s = memory[CLOCK]
    if memory[USE_IMU] == 0.0:
        for i in range(3):
            out[i] += (t_s - at_s) * out[3 + i]
        out[6], out[7], out[8], out[9] = q
        return
    before, mean = np.empty(6), np.empty(6)
    for i in range(6):
        before[i] = work[LATEST_IMU + i] - work[state + (GYRO_BIAS + i if i < 3 else ACCEL_BIAS + i - 3)]
    for k in range(len(imu) + 1):
        last = k == len(imu)
        until_s = t_s if last else min(imu[k, 0], t_s)
        dt_s = until_s - at_s
        for i in range(6):
            bias = work[state + (GYRO_BIAS + i if i < 3 else ACCEL_BIAS + i - 3)]
            now = before[i] if last else imu[k, 1 + i] - bias
            mean[i] = 0.5 * (before[i] + now)
            before[i] = now
        if dt_s <= 0.0:
            continue
        middle = turned(q, 0.5 * dt_s * mean[0], 0.5 * dt_s * mean[1], 0.5 * dt_s * mean[2])
        rotation = rotation_from_quaternion(middle[0], middle[1], middle[2], middle[3])
        north, east, down = to_earth(rotation, mean[3], mean[4], mean[5])
        force = (north, east, down + GRAVITY_M_S2)
        for i in range(3):
            out[i] += dt_s * (out[3 + i] + 0.5 * dt_s * force[i])
            out[3 + i] += dt_s * force[i]
        q = turned(q, dt_s * mean[0], dt_s * mean[1], dt_s * mean[2])
        at_s = until_s
    for i in range(3):
        out[10 + i] = before[i]
    out[6], out[7], out[8], out[9] = q
