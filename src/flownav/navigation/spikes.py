"""Inertial readings that no vehicle can follow: a spike is as one that never came.

A jump is a spike where it is larger than turning and shaking can make it from one reading to the next, unless what
comes after it says the same: then the vehicle was hit, and the next readings tell.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import equation, procedure, smaller
from flownav.estimation.kalman import Lanes, Work
from flownav.navigation.inertial import sound
from flownav.navigation.memory import (
    READING,
    load_imu,
    load_reading,
    load_spike,
    load_start,
    store_spike,
)
from flownav.navigation.records import ImuMemory, Reading, SpikeMemory
from flownav.navigation.tape import IMU_SPIKE, Output, write_event

GYRO_JUMP_RAD_S, TURNING_RAD_S2 = 1.0, 100.0  # what a small vehicle does at once, and in the time between
ACCEL_JUMP_M_S2, SHAKING_M_S3 = 20.0, 1000.0
TIMES = 6.0  # the usual jump
USUAL = 50.0  # readings over which that is followed
LONGEST_S = 0.1  # after a gap no jump is a spike
MOST = 3.0  # in a row
ARRIVED_AT = READING + Reading._fields.index("arrived")


@equation
def distance(x: float, y: float, z: float) -> float:
    """Length of a vector."""
    length: float = np.sqrt(x * x + y * y + z * z)
    return length


@equation
def judge_spike(reading: Reading, step_s: float, m: ImuMemory, s: SpikeMemory) -> tuple[bool, SpikeMemory]:
    """Whether an inertial reading is a spike after the one that was kept, step_s before; and the memory of it."""
    gyro = distance(reading.value_0 - m.gyro_x, reading.value_1 - m.gyro_y, reading.value_2 - m.gyro_z)
    accel = distance(reading.value_3 - m.accel_x, reading.value_4 - m.accel_y, reading.value_5 - m.accel_z)
    most_gyro = GYRO_JUMP_RAD_S + TURNING_RAD_S2 * step_s + TIMES * s.gyro_rad_s
    most_accel = ACCEL_JUMP_M_S2 + SHAKING_M_S3 * step_s + TIMES * s.accel_m_s2
    jumps = gyro > most_gyro or accel > most_accel
    gyro_again = distance(reading.value_0 - s.gyro_x, reading.value_1 - s.gyro_y, reading.value_2 - s.gyro_z)
    accel_again = distance(reading.value_3 - s.accel_x, reading.value_4 - s.accel_y, reading.value_5 - s.accel_z)
    again = s.refused > 0.0 and gyro_again < 0.5 * most_gyro and accel_again < 0.5 * most_accel
    comparable = step_s <= LONGEST_S
    spike = jumps and comparable and not again and s.refused < MOST
    gyro_usual = s.gyro_rad_s + (smaller(gyro, most_gyro) - s.gyro_rad_s) / USUAL
    accel_usual = s.accel_m_s2 + (smaller(accel, most_accel) - s.accel_m_s2) / USUAL
    return spike, SpikeMemory(
        s.refused + 1.0 if spike else 0.0,
        gyro_usual if comparable and not spike else s.gyro_rad_s,
        accel_usual if comparable and not spike else s.accel_m_s2,
        reading.value_0, reading.value_1, reading.value_2, reading.value_3, reading.value_4, reading.value_5,
    )  # fmt: skip


@procedure
def drop_spikes(work: Work, lanes: Lanes, t_s: float, o: Output) -> None:
    """A spike did not arrive."""
    for lane in range(len(lanes)):
        reading, m = load_reading(work, lanes, lane), load_imu(work, lanes, lane)
        if sound(reading) and np.isfinite(m.read_s) and load_start(work, lanes, lane).started > 0.0:
            spike, after = judge_spike(reading, t_s - m.read_s, m, load_spike(work, lanes, lane))
            store_spike(work, lanes, lane, after)
            if spike:
                work[ARRIVED_AT * len(lanes) + lane] = 0.0
                if after.refused == 1.0:
                    write_event(
                        lanes, lane, t_s, IMU_SPIKE, distance(reading.value_0, reading.value_1, reading.value_2), o
                    )
