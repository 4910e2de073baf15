"""An accelerometer that lies: vibration is rectified, and a hover may read half of gravity less than there is.

Two signs of it: readings that differ much from one to the next, and, where a filtered reading hides that, a range that
contradicts the motion: it creeps out of its gate, or nothing else measures the height. Either lets the accelerometer's
biases walk and widens their limit, on every axis, so that range, flow, barometer or GPS keep the velocity.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, equation, larger, replacing, smaller, squared
from flownav.estimation.states import ACCEL_BIAS, GROUND, POSITION, VELOCITY
from flownav.navigation import calls
from flownav.navigation.kernel_settings import BIAS_LIMIT_SIGMAS, ImuSettings
from flownav.navigation.motion_records import ForceBlocks, ImuMemory, MotionStep
from flownav.navigation.records import Reading, StartMemory
from flownav.navigation.tape import IMU_DOUBTED
from flownav.navigation.trust import AccelFactors
from flownav.navigation.verdicts import Biases, Doubt, Event, on_lanes

# Chosen together: 3 m/s2 rectified at take-off leave the height within 0.3 m (test_vibration_at_take_off), 6 in half a
# second within 5 m (test_hard_flights). None was varied alone.
BLOCK_S, BLOCKS_FOLLOWED_S = 0.4, 4.0
FOLLOWING_S = 1.0  # over which readings' scatter is followed (test_judges)
DOUBT_M_S2 = 2.0  # of an accelerometer that the range contradicts
DOUBT_LASTS_S = 60.0
FREED_WALK_M_S2_RT_S = 0.02  # of a bias, for each time that the accelerometer is noisier than stated
with_doubt = replacing(ImuMemory, "doubt_m_s2")
with_shaking = replacing(ImuMemory, "doubt_m_s2", "shaken_most")
# TWICE as much as before, and another vibration has begun, as when rotors spin up; one that has ended is forgotten
# after FADING_S. Both chosen: where every gust adds its share, the minutes without GPS of `outdoor` err by 0.77 instead
# of 0.68
TWICE, FADING_S = 2.0, 300.0

# The ground has followed a height that errs: as many times what the range still contradicts may both be off. With 1 the
# height of `flownav faults --offline --faults imu_bias` is beyond 3 sigma for 12 s undetected, with 3 for 1 s.
WITH_GROUND = 3.0
DOUBTED_SPEED_M_S = 1.0  # what it may have done to the velocity: half a second of DOUBT_M_S2


@equation
def followed_vibration(reading: Reading, m: ImuMemory, dt_s: float) -> float:
    """The mean square of the differences between neighbouring readings, an axis: twice the variance of white noise."""
    x, y, z = reading.value_3 - m.accel_x, reading.value_4 - m.accel_y, reading.value_5 - m.accel_z
    share = dt_s / FOLLOWING_S if dt_s < FOLLOWING_S else 1.0
    return m.vibration + share * ((x * x + y * y + z * z) / 6.0 - m.vibration)


@equation
def followed_gyro_power(reading: Reading, m: ImuMemory, dt_s: float) -> float:
    """The power density of the gyro's white noise, a mean over its axes: how changes between readings change has six
    times its variance, and little of the vehicle's motion (`notch.followed_density`).

    Vibration that a unit of 50 Hz reads at its aliases turns an attitude as white noise does: 1 rad/s rms by 0.14 rad
    in a second, which no datasheet states.
    """
    p = reading.value_0 - m.gyro_x - m.change_p
    q = reading.value_1 - m.gyro_y - m.change_q
    r = reading.value_2 - m.gyro_z - m.change_r
    share = dt_s / (FOLLOWING_S + dt_s)
    return m.gyro_power + share * ((p * p + q * q + r * r) * dt_s / 18.0 - m.gyro_power)


@equation
def followed_accel_power(reading: Reading, m: ImuMemory, dt_s: float) -> float:
    """The same of the accelerometer, of its level axes: along the third the thrust itself is unsteady."""
    x, y = reading.value_3 - m.accel_x - m.change_x, reading.value_4 - m.accel_y - m.change_y
    share = dt_s / (FOLLOWING_S + dt_s)
    return m.accel_power + share * ((x * x + y * y) * dt_s / 12.0 - m.accel_power)


@equation
def followed_blocks(reading: Reading, t_s: float, m: ForceBlocks) -> ForceBlocks:
    """The mean level force over blocks of BLOCK_S with one reading more, and the noise that blocks show: how their
    changes change has six times the variance of a block's mean (`followed_accel_power`, whose readings are blocks).

    A unit that smooths shows none of its noise between two readings of 1 kHz, and shaking that comes and goes lasts
    longer than one; a vehicle's own level force, which is drag, hardly changes its pace within a second.
    """
    summed = ForceBlocks(
        t_s if m.readings == 0.0 else m.since_s, m.readings + 1.0, m.sum_x + reading.value_3, m.sum_y + reading.value_4,
        m.mean_x, m.mean_y, m.change_x, m.change_y, m.blocks, m.power,
    )  # fmt: skip
    lasts_s = t_s - summed.since_s
    x, y = summed.sum_x / summed.readings, summed.sum_y / summed.readings
    change_x, change_y = x - m.mean_x, y - m.mean_y
    square = squared(change_x - m.change_x) + squared(change_y - m.change_y)
    share = larger(1.0 / (m.blocks - 1.0), BLOCK_S / BLOCKS_FOLLOWED_S) if m.blocks > 1.0 else 0.0
    ended = ForceBlocks(
        0.0, 0.0, 0.0, 0.0, x, y, change_x, change_y,
        m.blocks + 1.0, m.power + share * (square * BLOCK_S / 12.0 - m.power),
    )  # fmt: skip
    anew = ForceBlocks(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, m.power)
    return summed if lasts_s < BLOCK_S else (ended if lasts_s < 2.0 * BLOCK_S else anew)


@equation
def with_reading(reading: Reading, t_s: float, m: ImuMemory) -> ImuMemory:
    """The newest reading remembered."""
    return ImuMemory(
        t_s, reading.value_0, reading.value_1, reading.value_2, reading.value_3, reading.value_4, reading.value_5,
        m.vibration, m.doubt_m_s2, m.gap, m.shaken_most,
        reading.value_0 - m.gyro_x, reading.value_1 - m.gyro_y, reading.value_2 - m.gyro_z,
        reading.value_3 - m.accel_x, reading.value_4 - m.accel_y, m.gyro_power, m.accel_power,
    )  # fmt: skip


@equation
def vibration_beyond(m: ImuMemory, s: ImuSettings) -> float:
    """The vibration beyond the harmless [m/s2]."""
    return larger(np.sqrt(m.vibration) - s.vibration_free_m_s2, 0.0)


@equation
def doubted_imu(
    contradiction_m: float, doubted: bool, crept: bool, m: ImuMemory
) -> tuple[ImuMemory, Event, tuple[Doubt, Doubt, Doubt, Doubt, Doubt, Doubt]]:
    """The range contradicts the motion that the accelerometer made: height, climb and vertical bias are set free.

    Where the range crept, the ground followed the height before, and the accelerometer may err on every axis; where it
    jumped, it may be an echo. The memory, its event, and the doubts; where not doubted, all as before.
    """
    says = doubted and m.doubt_m_s2 < 0.5 * DOUBT_M_S2
    off_m = WITH_GROUND * contradiction_m if doubted else 0.0
    freed = (
        Doubt(POSITION + 2, off_m * off_m),
        Doubt(GROUND, off_m * off_m if crept else 0.0),
        Doubt(VELOCITY + 2, DOUBTED_SPEED_M_S * DOUBTED_SPEED_M_S if doubted else 0.0),
        Doubt(ACCEL_BIAS, DOUBT_M_S2 * DOUBT_M_S2 if crept else 0.0),
        Doubt(ACCEL_BIAS + 1, DOUBT_M_S2 * DOUBT_M_S2 if crept else 0.0),
        Doubt(ACCEL_BIAS + 2, DOUBT_M_S2 * DOUBT_M_S2 if doubted else 0.0),
    )
    after = with_doubt(m, doubt_m_s2=DOUBT_M_S2 if doubted else m.doubt_m_s2)
    return after, Event(IMU_DOUBTED if says else -1, contradiction_m), freed


class Shaken(NamedTuple):
    """Memory of vibration after a step, and the doubts that it causes."""

    imu: ImuMemory
    doubts: tuple[Doubt, Doubt, Doubt, Doubt, Doubt, Doubt, Doubt, Doubt, Doubt]


@on_lanes(calls.add_vibration_noise)
def add_vibration_noise(
    m: ImuMemory, start: StartMemory, step: MotionStep, factor: AccelFactors, *, dt_s: float, s: ImuSettings
) -> Shaken:
    """Doubts of velocity and accelerometer bias by the errors that vibration, or a doubted accelerometer, may have
    caused.

    Vibration is rectified: an accelerometer that comes to be shaken more, as rotors spin up, may err by so much more.
    Only in lanes that the IMU moves.
    """
    moved_s = dt_s if step.moves > 0.0 else 0.0
    doubt = (1.0 - smaller(moved_s / DOUBT_LASTS_S, 1.0)) * m.doubt_m_s2
    beyond = vibration_beyond(m, s)
    level = down = s.vibration_walk_per_rt_s * larger(beyond, doubt)
    shaken = m.vibration * moved_s * moved_s if beyond > 0.0 else 0.0
    before = larger(m.shaken_most, start.shaken)
    more = step.moves > 0.0 and m.vibration > TWICE * before
    grown = m.vibration - before if more else 0.0
    rectified = s.vibration_rectified_share * s.vibration_rectified_share * grown
    most = m.vibration if more else (1.0 - smaller(moved_s / FADING_S, 1.0)) * m.shaken_most
    walk, walk_down = FREED_WALK_M_S2_RT_S * (factor.level - 1.0), FREED_WALK_M_S2_RT_S * (factor.down - 1.0)
    return Shaken(
        with_shaking(m, doubt_m_s2=doubt, shaken_most=most),
        (
            Doubt(ACCEL_BIAS, walk * walk * moved_s + rectified),
            Doubt(ACCEL_BIAS + 1, walk * walk * moved_s + rectified),
            Doubt(ACCEL_BIAS + 2, walk_down * walk_down * moved_s + rectified),
            Doubt(ACCEL_BIAS, level * level * moved_s),
            Doubt(ACCEL_BIAS + 1, level * level * moved_s),
            Doubt(ACCEL_BIAS + 2, down * down * moved_s),
            Doubt(VELOCITY, shaken),
            Doubt(VELOCITY + 1, shaken),
            Doubt(VELOCITY + 2, shaken),
        ),
    )


@on_lanes(calls.limit_biases)
def limit_biases(m: ImuMemory, start: StartMemory, factor: AccelFactors, b: Biases, *, s: ImuSettings) -> Biases:
    """Both biases held to what such sensors, and this vibration, can make: the last resort."""
    beyond = vibration_beyond(m, s)
    level = down = s.accel_bias_limit_m_s2 + s.vibration_bias_share * larger(beyond, m.doubt_m_s2)
    shaken = larger(m.shaken_most, start.shaken)
    at_start = BIAS_LIMIT_SIGMAS * larger(s.vibration_rectified_share, 1.0) * np.sqrt(shaken)
    level += (factor.level - 1.0) * s.accel_bias_limit_m_s2 + at_start
    down += (factor.down - 1.0) * s.accel_bias_limit_m_s2 + at_start
    turning = s.gyro_bias_limit_rad_s
    return Biases(
        clamp(b.gyro_x, -turning, turning), clamp(b.gyro_y, -turning, turning), clamp(b.gyro_z, -turning, turning),
        clamp(b.accel_x, -level, level), clamp(b.accel_y, -level, level), clamp(b.accel_z, -down, down),
    )  # fmt: skip
