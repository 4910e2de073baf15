"""Inertial readings: which of them are sound, what stands for the time between two, and what moves the filter when."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, procedure
from flownav.estimation.states import ACCEL_NOISE, FORCE, GYRO_NOISE, IMU
from flownav.navigation.memory import (
    CLOCK,
    MOVING,
    OWED,
    SPENT,
    STEADY_FORCE,
    load_imu,
    load_reading,
    load_start,
    shared,
    store_imu,
)
from flownav.navigation.records import ImuMemory, Reading
from flownav.navigation.tape import IMU_LOST, Output, write_event
from flownav.navigation.told import Equipment, ImuSettings
from flownav.navigation.trust import accel_factors
from flownav.navigation.vibration import followed_vibration, with_reading

LEAST_STEP_S = 0.002  # a shorter step is not made to pay what is owed
STEADY_S = 0.1
Motion = tuple[float, float, float, float, float, float]  # body rate [rad/s] and specific force [m/s2], body FRD


@equation
def sound(reading: Reading) -> bool:
    """Whether an inertial reading is one: it arrived, and all of it is finite."""
    gyro = reading.value_0 + reading.value_1 + reading.value_2
    total = gyro + reading.value_3 + reading.value_4 + reading.value_5
    return reading.arrived > 0.0 and reading.withheld == 0.0 and bool(np.isfinite(total))


@equation
def said_by(reading: Reading) -> Motion:
    """What an inertial reading says."""
    return (reading.value_0, reading.value_1, reading.value_2, reading.value_3, reading.value_4, reading.value_5)


@equation
def remembered(m: ImuMemory) -> Motion:
    """What the newest one that was kept said."""
    return (m.gyro_x, m.gyro_y, m.gyro_z, m.accel_x, m.accel_y, m.accel_z)


@equation
def motion_between(before: Motion, now: Motion, integrates: float) -> Motion:
    """What stands for the time between two inertial readings: their mean (trapezium), or the later one of a unit that
    integrates over that time itself.
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


@procedure
def choose_motion(
    work: Work, lanes: Lanes, t_s: float, heard: bool, fitted: Equipment, s: ImuSettings, o: Output
) -> None:
    """MOVING, and the IMU's rows, for the step to t_s: the readings at its ends, the newest reading, or none.

    heard: an inertial reading is at hand. After a gap it knows nothing of the gap, which is coasted. Where no time
    passes there is no gap.
    """
    step_s = t_s - shared(work, lanes, CLOCK)
    for lane in range(len(lanes)):
        m, started = load_imu(work, lanes, lane), load_start(work, lanes, lane).started > 0.0
        fresh = fitted.use_imu and t_s - m.read_s <= s.imu_stale_s
        reading = load_reading(work, lanes, lane)
        now = heard and sound(reading)
        if now and not fresh and np.isfinite(m.read_s) and started:
            write_event(lanes, lane, t_s, IMU_LOST, t_s - m.read_s, o)
        between = motion_between(remembered(m), said_by(reading), s.imu_integrates)
        moving = fresh and started
        pay(work, lanes, lane, step_s, t_s - m.read_s, now, moving, between, remembered(m))
        vibration = followed_vibration(reading, m, t_s - m.read_s) if now and fresh else m.vibration
        work[MOVING * len(lanes) + lane] = 1.0 if moving else 0.0
        told = accel_factors(work, lanes, lane)[0] * s.accel_noise_m_s2_rt_hz
        accel = told if moving else s.coasting_accel_m_s2_rt_hz
        gyro = s.gyro_noise_rad_s_rt_hz if moving else s.coasting_rate_rad_s_rt_hz
        work[ACCEL_NOISE * len(lanes) + lane] = accel * accel
        work[GYRO_NOISE * len(lanes) + lane] = gyro * gyro
        gap = 1.0 if step_s > 0.0 and started and not moving else m.gap
        store_imu(
            work, lanes, lane,
            ImuMemory(
                m.read_s, m.gyro_x, m.gyro_y, m.gyro_z, m.accel_x, m.accel_y, m.accel_z, vibration, m.doubt_m_s2, gap
            ),
        )  # fmt: skip


@equation
def pay(
    work: Work, lanes: Lanes, lane: int, step_s: float, period_s: float, now: bool, moving: bool, between: Motion,
    held: Motion,
) -> None:  # fmt: skip
    """The IMU's rows of one lane for a step of step_s, such that the integral over each inertial period is as read.

    Between two inertial readings the filter stops at other sensors' instants, moved there by the reading that it holds.
    What that spent is taken off what the next reading says of its whole period, and the rest is paid over the rest of
    the period, or, where that is too short, over the step after it. Without this, vibration that an IMU integrates
    over its period would enter the velocity cut into pieces, as a random walk.
    """
    payable = step_s >= LEAST_STEP_S
    for i in range(6):
        spent = work[(SPENT + i) * len(lanes) + lane] if moving else 0.0
        owed = work[(OWED + i) * len(lanes) + lane] if moving else 0.0
        usual = between[i] if now else held[i]
        total = between[i] * period_s - spent + owed if now else usual * step_s + owed
        value = total / step_s if payable and moving else usual
        left = total - value * step_s
        work[(IMU + i) * len(lanes) + lane] = value
        work[(OWED + i) * len(lanes) + lane] = left if moving else 0.0
        work[(SPENT + i) * len(lanes) + lane] = 0.0 if now or not moving else spent + usual * step_s


@procedure
def steady_force(work: Work, lanes: Lanes, dt_s: float) -> None:
    """STEADY_FORCE follows the specific force of the step that was just made."""
    share = dt_s / (STEADY_S + dt_s)
    for i in range(3):
        for lane in range(len(lanes)):
            before = work[(STEADY_FORCE + i) * len(lanes) + lane]
            force = work[(FORCE + i) * len(lanes) + lane]
            work[(STEADY_FORCE + i) * len(lanes) + lane] = before + share * (force - before)


@procedure
def keep_imu(work: Work, lanes: Lanes, t_s: float) -> None:
    """The reading at hand stands for what follows, until the next."""
    for lane in range(len(lanes)):
        reading, m = load_reading(work, lanes, lane), load_imu(work, lanes, lane)
        if sound(reading) and load_start(work, lanes, lane).started > 0.0:
            store_imu(work, lanes, lane, with_reading(reading, t_s, m))
