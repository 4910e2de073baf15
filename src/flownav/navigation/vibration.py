"""An accelerometer that lies: vibration is rectified, and a hover may read half of gravity less than there is.

Two signs of it: readings that differ much from one to the next, and, where a filtered reading hides that, a range that
contradicts the motion while nothing else tells the height. Either lets the accelerometer's bias walk and widens its
limit, so that range, barometer or GPS keep the velocity.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, clamp, equation, larger, procedure, replacing, smaller
from flownav.estimation.covariance import add_noise_lane
from flownav.estimation.states import ACCEL_BIAS, GYRO_BIAS, POSITION, STATE, VELOCITY
from flownav.navigation.memory import MOVING, load_imu, load_start, store_imu
from flownav.navigation.records import ImuMemory, Reading
from flownav.navigation.tape import IMU_DOUBTED
from flownav.navigation.told import ImuSettings
from flownav.navigation.trust import accel_factors
from flownav.navigation.verdicts import Doubt, Event

FOLLOWING_S = 1.0
DOUBT_M_S2 = 2.0  # of an accelerometer that the range contradicts
DOUBT_LASTS_S = 60.0
FREED_WALK_M_S2_RT_S = 0.02  # of a bias, for each time that the accelerometer is noisier than told
with_doubt = replacing(ImuMemory, "doubt_m_s2")

SURE = 3.0  # standard deviations that a limit leaves room for
DOUBTED_SPEED_M_S = 1.0  # what it may have done to the velocity


@equation
def followed_vibration(reading: Reading, m: ImuMemory, dt_s: float) -> float:
    """The mean square of the differences between neighbouring readings, an axis: twice the variance of white noise."""
    x, y, z = reading.value_3 - m.accel_x, reading.value_4 - m.accel_y, reading.value_5 - m.accel_z
    share = dt_s / FOLLOWING_S if dt_s < FOLLOWING_S else 1.0
    return m.vibration + share * ((x * x + y * y + z * z) / 6.0 - m.vibration)


@equation
def with_reading(reading: Reading, t_s: float, m: ImuMemory) -> ImuMemory:
    """The newest reading remembered."""
    return ImuMemory(
        t_s, reading.value_0, reading.value_1, reading.value_2, reading.value_3, reading.value_4, reading.value_5,
        m.vibration, m.doubt_m_s2, m.gap,
    )  # fmt: skip


@equation
def vibration_beyond(m: ImuMemory, s: ImuSettings) -> float:
    """The vibration beyond the harmless [m/s2]."""
    return larger(np.sqrt(m.vibration) - s.vibration_free_m_s2, 0.0)


@equation
def doubted_imu(
    contradiction_m: float, doubted: bool, m: ImuMemory
) -> tuple[ImuMemory, Event, tuple[Doubt, Doubt, Doubt]]:
    """The range contradicts the motion that the accelerometer made: height, velocity and bias are set free.

    The memory, what is said of it, and the doubts; where not doubted, all as before.
    """
    says = doubted and m.doubt_m_s2 < 0.5 * DOUBT_M_S2
    freed = (
        Doubt(POSITION + 2, contradiction_m * contradiction_m if doubted else 0.0),
        Doubt(VELOCITY + 2, DOUBTED_SPEED_M_S * DOUBTED_SPEED_M_S if doubted else 0.0),
        Doubt(ACCEL_BIAS + 2, DOUBT_M_S2 * DOUBT_M_S2 if doubted else 0.0),
    )
    after = with_doubt(m, doubt_m_s2=DOUBT_M_S2 if doubted else m.doubt_m_s2)
    return after, Event(IMU_DOUBTED if says else -1, contradiction_m), freed


@procedure
def add_vibration_noise(work: Work, lanes: Lanes, dt_s: float, s: ImuSettings) -> None:
    """Velocity and accelerometer bias are less sure by what vibration may have made of them; a doubt is vertical.

    Only in lanes that the IMU moves.
    """
    for lane in range(len(lanes)):
        moved_s = dt_s if work[MOVING * len(lanes) + lane] > 0.0 else 0.0
        m = load_imu(work, lanes, lane)
        doubt = (1.0 - smaller(moved_s / DOUBT_LASTS_S, 1.0)) * m.doubt_m_s2
        faded = ImuMemory(
            m.read_s, m.gyro_x, m.gyro_y, m.gyro_z, m.accel_x, m.accel_y, m.accel_z, m.vibration, doubt, m.gap
        )
        store_imu(work, lanes, lane, faded)
        beyond = vibration_beyond(m, s)
        level = s.vibration_walk_per_rt_s * beyond
        down = s.vibration_walk_per_rt_s * larger(beyond, doubt)
        shaken = m.vibration * moved_s * moved_s if beyond > 0.0 else 0.0
        freed, freed_down = accel_factors(work, lanes, lane)
        told = s.accel_noise_m_s2_rt_hz * s.accel_noise_m_s2_rt_hz
        for i in range(3):
            walk = FREED_WALK_M_S2_RT_S * ((freed_down if i == 2 else freed) - 1.0)
            add_noise_lane(work, lanes, ACCEL_BIAS + i, lane, walk * walk * moved_s)
        shaken_down = larger(freed_down * freed_down - freed * freed, 0.0) * told * moved_s
        add_noise_lane(work, lanes, VELOCITY + 2, lane, shaken_down)
        add_noise_lane(work, lanes, ACCEL_BIAS, lane, level * level * moved_s)
        add_noise_lane(work, lanes, ACCEL_BIAS + 1, lane, level * level * moved_s)
        add_noise_lane(work, lanes, ACCEL_BIAS + 2, lane, down * down * moved_s)
        for i in range(3):
            add_noise_lane(work, lanes, VELOCITY + i, lane, shaken)


@procedure
def limit_biases(work: Work, lanes: Lanes, s: ImuSettings) -> None:
    """Hold both biases to what such sensors, and this vibration, can make: the last resort."""
    for lane in range(len(lanes)):
        m = load_imu(work, lanes, lane)
        beyond = vibration_beyond(m, s)
        level = s.accel_bias_limit_m_s2 + s.vibration_bias_share * beyond
        down = s.accel_bias_limit_m_s2 + s.vibration_bias_share * larger(beyond, m.doubt_m_s2)
        freed, freed_down = accel_factors(work, lanes, lane)
        at_start = SURE * np.sqrt(load_start(work, lanes, lane).shaken)
        level += (freed - 1.0) * s.accel_bias_limit_m_s2 + at_start
        down += (freed_down - 1.0) * s.accel_bias_limit_m_s2 + at_start
        hold(work, lanes, lane, ACCEL_BIAS, level)
        hold(work, lanes, lane, ACCEL_BIAS + 1, level)
        hold(work, lanes, lane, ACCEL_BIAS + 2, down)
        for i in range(3):
            hold(work, lanes, lane, GYRO_BIAS + i, s.gyro_bias_limit_rad_s)


@equation
def hold(work: Work, lanes: Lanes, lane: int, state: int, limit: float) -> None:
    """One state of one lane held between -limit and limit."""
    value = work[(STATE + state) * len(lanes) + lane]
    work[(STATE + state) * len(lanes) + lane] = clamp(value, -limit, limit)
