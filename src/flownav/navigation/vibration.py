"""An accelerometer that lies: vibration is rectified, and a hover may read half of gravity less than there is.

Two signs of it: readings that differ much from one to the next, and, where a filtered reading hides that, a range that
contradicts the motion while nothing else tells the height. Either lets the accelerometer's bias walk and widens its
limit, so that range, barometer or GPS keep the velocity.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import ONE_LANE, procedure
from flownav.estimation.landing.algebra import add_noise
from flownav.estimation.landing.bias_limits import hold
from flownav.estimation.landing.states import ACCEL_BIAS, GYRO_BIAS, VELOCITY
from flownav.measurement import Array
from flownav.navigation.state import DOUBT, IMU_DOUBTED, LATEST_IMU, ROWS, VIBRATION, Running, write_event

FOLLOWING_S = 1.0
DOUBT_M_S2 = 2.0  # of an accelerometer that the range contradicts
DOUBT_LASTS_S = 60.0
DOUBTED_SPEED_M_S = 1.0  # what it may have done to the velocity


@procedure
def follow_vibration(value: Array, dt_s: float, on: Running) -> None:
    """The mean square of the differences between neighbouring readings, an axis: twice the variance of white noise."""
    square = 0.0
    for i in range(3, 6):
        square += (value[i] - on.work[LATEST_IMU + i]) ** 2
    share = min(dt_s / FOLLOWING_S, 1.0)
    on.memory[VIBRATION] += share * (square / 6.0 - on.memory[VIBRATION])


@procedure
def excess(on: Running) -> float:
    """The vibration beyond the harmless [m/s2]."""
    level: float = np.sqrt(on.memory[VIBRATION])
    return max(level - on.settings.vibration_free_m_s2, 0.0)


@procedure
def doubt(t_s: float, contradiction_m: float, on: Running) -> None:
    """The range contradicts the motion that the accelerometer made: both velocity and bias are set free."""
    if on.memory[DOUBT] < 0.5 * DOUBT_M_S2:
        write_event(t_s, IMU_DOUBTED, contradiction_m, on.tape)
    on.memory[DOUBT] = DOUBT_M_S2
    add_noise(on.work, ONE_LANE, ROWS, VELOCITY + 2, DOUBTED_SPEED_M_S * DOUBTED_SPEED_M_S)
    add_noise(on.work, ONE_LANE, ROWS, ACCEL_BIAS + 2, DOUBT_M_S2 * DOUBT_M_S2)


@procedure
def add_vibration_noise(dt_s: float, on: Running) -> None:
    """Velocity and accelerometer bias are less sure by what vibration may have made of them; a doubt is vertical."""
    beyond, share = excess(on), on.settings.vibration_walk_per_rt_s
    on.memory[DOUBT] *= 1.0 - min(dt_s / DOUBT_LASTS_S, 1.0)
    for i in range(3):
        walk = share * (max(beyond, on.memory[DOUBT]) if i == 2 else beyond)
        add_noise(on.work, ONE_LANE, ROWS, ACCEL_BIAS + i, walk * walk * dt_s)
        if beyond > 0.0:
            add_noise(on.work, ONE_LANE, ROWS, VELOCITY + i, on.memory[VIBRATION] * dt_s * dt_s)


@procedure
def limit_biases(on: Running) -> None:
    """Hold both biases to what such sensors, and this vibration, can make: the last resort."""
    settings = on.settings.filter
    for i in range(3):
        harm = max(excess(on), on.memory[DOUBT]) if i == 2 else excess(on)
        limit = settings.accel_bias_limit_m_s2 + on.settings.vibration_bias_share * harm
        hold(on.work, ONE_LANE, ROWS, GYRO_BIAS + i, settings.gyro_bias_limit_rad_s)
        hold(on.work, ONE_LANE, ROWS, ACCEL_BIAS + i, limit)
