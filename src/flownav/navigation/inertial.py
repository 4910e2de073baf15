"""Inertial readings: which of them are sound, what stands for the time between two, and what moves the filter when."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation, larger, replacing
from flownav.navigation import calls
from flownav.navigation.kernel_settings import ImuSettings
from flownav.navigation.motion_records import (
    ForceBlocks,
    ImuMemory,
    MotionMemory,
    MotionStep,
    OwedMotion,
    SpentMotion,
    SteadyForce,
    ToneMemory,
)
from flownav.navigation.notch import is_notched, tracked_tones
from flownav.navigation.records import Reading, StartMemory
from flownav.navigation.tape import IMU_LOST
from flownav.navigation.trust import AccelFactors
from flownav.navigation.verdicts import AppliedMotion, Event, Force, MotionNoise, on_lanes
from flownav.navigation.vibration import (
    followed_accel_power,
    followed_blocks,
    followed_gyro_power,
    followed_vibration,
    with_reading,
)

LEAST_STEP_S = 0.002  # chosen: half a period at 250 Hz; what is owed over less would be an acceleration of its own
SWING_S = 0.3  # chosen: 0.6 is as good, with none all three velocities are too sure (test_wind_from_all_sides)
STEADY_S = 0.1  # chosen: of vibration at 24 Hz (the shipped rotor) a fifteenth is left
BEYOND_ANY_UNIT = 1e4  # m/s2 and rad/s: chosen, five times what the widest shock sensor of an autopilot reads (200 g)
with_motion = replacing(ImuMemory, "vibration", "gyro_power", "accel_power", "gap")
Motion = tuple[float, float, float, float, float, float]  # body rate [rad/s] and specific force [m/s2], body FRD


@equation
def sound(reading: Reading) -> bool:
    """Whether an inertial reading is one: it arrived, and a unit can have read it."""
    return reading.arrived > 0.0 and reading.withheld == 0.0 and is_possible(reading)


@equation
def is_possible(r: Reading) -> bool:
    """Whether a unit can have read it, of which NaN is none: one square of 1e200 would make what follows infinite."""
    return size_of(r) < BEYOND_ANY_UNIT


@equation
def size_of(r: Reading) -> float:
    """The sum of all six axes without their signs: 0 where each is, NaN where one is."""
    turning = abs(r.value_0) + abs(r.value_1) + abs(r.value_2)
    return turning + abs(r.value_3) + abs(r.value_4) + abs(r.value_5)


@equation
def motion_of(reading: Reading) -> Motion:
    """Body rate [rad/s] and specific force [m/s2] of an inertial reading."""
    return (reading.value_0, reading.value_1, reading.value_2, reading.value_3, reading.value_4, reading.value_5)


@equation
def last_motion(m: ImuMemory) -> Motion:
    """Body rate [rad/s] and specific force [m/s2] of the newest reading that was kept."""
    return (m.gyro_x, m.gyro_y, m.gyro_z, m.accel_x, m.accel_y, m.accel_z)


@equation
def without_tones(motion: Motion, m: ToneMemory) -> Motion:
    """A reading's motion less the tones that were found in it."""
    return (motion[0], motion[1], motion[2], motion[3] - m.taken_x, motion[4] - m.taken_y, motion[5] - m.taken_z)


@equation
def noise_density(least: float, whole: float, left: float, s: ImuSettings) -> float:
    """Density of the accelerometer's noise [m/s2/sqrt(Hz)]: as stated, or more where its readings show more: their
    whole power, or what the notches leave of it.
    """
    return larger(least, np.sqrt(left if is_notched(s) else whole))


@equation
def turning_noise(turn_rad_s: float, power: float, s: ImuSettings) -> float:
    """Density squared of the gyro's noise [rad2/s]: as stated, or more where its readings show more (power), plus the
    effect of its scale error while turning about body down. A rotor's tone, which comes back within its period, turns
    nothing: what it shows is not counted.

    An error of scale or alignment is a lasting share of what is turned, and the tilt that it makes of a turn comes back
    as the heading does: white noise of the time that a swing lasts.
    """
    scale = s.gyro_scale_sigma * turn_rad_s
    seen = power - s.gyro_tones_rad_s_rt_hz * s.gyro_tones_rad_s_rt_hz
    return larger(s.gyro_noise_rad_s_rt_hz * s.gyro_noise_rad_s_rt_hz, seen) + SWING_S * scale * scale


@equation
def motion_between(before: Motion, now: Motion, integrates: float) -> Motion:
    """The motion between two inertial readings: their mean (trapezium), or the later one of a unit that integrates over
    that time itself.
    """
    share = 1.0 if integrates > 0.5 else 0.5
    rest = 1.0 - share
    return (
        share * now[0] + rest * before[0],
        share * now[1] + rest * before[1],
        share * now[2] + rest * before[2],
        share * now[3] + rest * before[3],
        share * now[4] + rest * before[4],
        share * now[5] + rest * before[5],
    )


class Paid(NamedTuple):
    """One axis of a step: what moves the filter, and what of it is spent and owed after it."""

    value: float
    spent: float
    owed: float


@equation
def paid(
    between: float, held: float, spent: float, owed: float, step_s: float, period_s: float, now: bool, moving: bool
) -> Paid:
    """The motion applied over step_s, such that the integral over each inertial period is as read.

    Between two inertial readings the filter stops at other sensors' instants, moved there by the reading that it holds.
    The part applied so far is taken off the next reading's integral over its whole period, and the rest is paid over
    the rest of the period, or, where that is too short, over the step after it. Without this, vibration that an IMU
    integrates over its period would enter the velocity cut into pieces, as a random walk.
    """
    spent = spent if moving else 0.0
    owed = owed if moving else 0.0
    usual = between if now else held
    total = between * period_s - spent + owed if now else usual * step_s + owed
    value = total / step_s if step_s >= LEAST_STEP_S and moving else usual
    left = total - value * step_s
    return Paid(value, 0.0 if now or not moving else spent + usual * step_s, left if moving else 0.0)


class StepMotion(NamedTuple):
    """The motion that moves the filter over a step, with its noise."""

    step: MotionStep
    applied: AppliedMotion
    memory: MotionMemory
    noise: MotionNoise
    lost: Event


@on_lanes(calls.judge_motion)
def judge_motion(
    reading: Reading, start: StartMemory, memory: MotionMemory, blocks: ForceBlocks, doubt: AccelFactors,
    *, t_s: float, step_s: float, arrived_now: bool, s: ImuSettings,
) -> StepMotion:  # fmt: skip
    """The motion that moves the filter over the step to t_s, from the readings at its ends, the newest reading, or
    none.

    arrived_now: an inertial reading is at hand; where none ever is, none stands for the step. After a gap it knows
    nothing of the gap, which is coasted. Where no time passes there is no gap.
    """
    m, spent, owed, before = memory
    started = start.started > 0.0
    period_s = t_s - m.read_s
    fresh = period_s <= s.imu_stale_s
    now = arrived_now and sound(reading)
    loses = now and not fresh and np.isfinite(m.read_s) and started
    held = without_tones(last_motion(m), before)
    force = (reading.value_3, reading.value_4, reading.value_5)
    tones = tracked_tones(force, held[3:6], before, period_s if fresh else 0.0, s) if now and is_notched(s) else before
    between = motion_between(held, without_tones(motion_of(reading), tones), s.imu_integrates)
    moving = fresh and started
    p = paid(between[0], held[0], spent.gyro_x, owed.gyro_x, step_s, period_s, now, moving)
    q = paid(between[1], held[1], spent.gyro_y, owed.gyro_y, step_s, period_s, now, moving)
    r = paid(between[2], held[2], spent.gyro_z, owed.gyro_z, step_s, period_s, now, moving)
    x = paid(between[3], held[3], spent.accel_x, owed.accel_x, step_s, period_s, now, moving)
    y = paid(between[4], held[4], spent.accel_y, owed.accel_y, step_s, period_s, now, moving)
    z = paid(between[5], held[5], spent.accel_z, owed.accel_z, step_s, period_s, now, moving)
    least_down = s.accel_noise_m_s2_rt_hz * s.accel_noise_down_share
    density = noise_density(s.accel_noise_m_s2_rt_hz, larger(m.accel_power, blocks.power), tones.noise_power, s)
    noise_down = noise_density(least_down, m.accel_power, tones.noise_power, s)
    accel = doubt.level * density if moving else s.coasting_accel_m_s2_rt_hz
    accel_down = larger(doubt.level, doubt.down) * noise_down if moving else s.coasting_accel_m_s2_rt_hz
    gyro = (
        turning_noise(r.value, m.gyro_power, s) if moving else s.coasting_rate_rad_s_rt_hz * s.coasting_rate_rad_s_rt_hz
    )
    return StepMotion(
        MotionStep(1.0 if moving else 0.0),
        AppliedMotion(p.value, q.value, r.value, x.value, y.value, z.value),
        MotionMemory(
            with_motion(
                m,
                vibration=followed_vibration(reading, m, period_s) if now and fresh else m.vibration,
                accel_power=followed_accel_power(reading, m, period_s) if now and fresh else m.accel_power,
                gyro_power=followed_gyro_power(reading, m, period_s) if now and fresh else m.gyro_power,
                gap=1.0 if step_s > 0.0 and started and not moving else m.gap,
            ),
            SpentMotion(p.spent, q.spent, r.spent, x.spent, y.spent, z.spent),
            OwedMotion(p.owed, q.owed, r.owed, x.owed, y.owed, z.owed),
            tones,
        ),
        MotionNoise(accel * accel, accel_down * accel_down, gyro),
        Event(IMU_LOST if loses else -1, period_s),
    )


@on_lanes(calls.steady_force)
def steady_force(before: SteadyForce, force: Force, *, dt_s: float) -> SteadyForce:
    """The specific force of the step that was just made, followed."""
    share = dt_s / (STEADY_S + dt_s)
    return SteadyForce(
        before.north_m_s2 + share * (force.north_m_s2 - before.north_m_s2),
        before.east_m_s2 + share * (force.east_m_s2 - before.east_m_s2),
        before.down_m_s2 + share * (force.down_m_s2 - before.down_m_s2),
    )


@on_lanes(calls.watch_force)
def watch_force(reading: Reading, m: ForceBlocks, *, t_s: float) -> ForceBlocks:
    """The reading at hand goes into the mean force over a block, before the start as after it."""
    return followed_blocks(reading, t_s, m) if sound(reading) else m


@on_lanes(calls.keep_imu)
def keep_imu(reading: Reading, start: StartMemory, m: ImuMemory, *, t_s: float) -> ImuMemory:
    """The reading at hand stands for what follows, until the next."""
    return with_reading(reading, t_s, m) if sound(reading) and start.started > 0.0 else m
