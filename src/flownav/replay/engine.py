"""The event loop: measurements in time order through the kinematic filter, one vehicle."""

from __future__ import annotations

import numpy as np

from flownav.compile import ONE_LANE, kernel
from flownav.estimation.kinematic_filter import coast, predict, turn_attitude
from flownav.measurement import EventQueue, Sensor
from flownav.replay.sensors import take_baro, take_flow, take_gps, take_range
from flownav.replay.state import (
    CLOCK,
    COVARIANCE,
    DEADLINE,
    ESTIMATE_PERIOD_S,
    GYRO,
    HAS_ATTITUDE,
    IMU_CLOCK,
    ROWS,
    START,
    STARTED,
    STATE,
    VEL_CLOCK,
    VEL_D,
    VEL_E,
    VEL_N,
    WRITTEN,
    Reading,
    Running,
    write_estimate,
    write_event,
)

ORIGIN_SIGMA_M = 0.1  # the local origin, where the filter's start defines it
LOST_SIGMA_M = 10.0  # the same where the log's fixes define it and came too late
VELOCITY_MEMORY_S = 1.0


@kernel
def run(queue: EventQueue, on: Running) -> None:
    """Feed every event of the queue, in its order."""
    for k in range(len(queue.t_s)):
        reading = Reading(queue.t_s[k], queue.sensor[k], queue.quality[k], queue.value[k], queue.variance[k])
        sensor, value, memory = reading.sensor, reading.value, on.memory
        if memory[STARTED] == 0.0:
            start(reading, on)
        if memory[STARTED] > 0.0:
            advance(reading.t_s, on)
        if sensor == Sensor.ATTITUDE:
            size = np.sqrt(value[0] ** 2 + value[1] ** 2 + value[2] ** 2 + value[3] ** 2)
            for i in range(4):
                on.work[ROWS.attitude + i] = value[i] / size
            memory[HAS_ATTITUDE] = 1.0
        elif sensor == Sensor.IMU:
            for i in range(3):
                on.work[GYRO + i] = value[i]
                on.work[ROWS.force + i] = value[3 + i]
            memory[IMU_CLOCK] = reading.t_s
        elif sensor == Sensor.GPS_POSITION or sensor == Sensor.GPS_VELOCITY:
            take_gps(reading, on)
        elif sensor == Sensor.FLOW_RATE or sensor == Sensor.FLOW_VELOCITY:
            take_flow(reading, on)
        elif sensor == Sensor.RANGE:
            take_range(reading, on)
        elif sensor == Sensor.BARO:
            take_baro(reading, on)
        if memory[STARTED] > 0.0 and reading.t_s - memory[WRITTEN] >= ESTIMATE_PERIOD_S:
            write_estimate(reading.t_s, on)


@kernel
def start(reading: Reading, on: Running) -> None:
    """Start at a fix, or at the local origin with the first flow where no fix came in time."""
    t_s, sensor, value = reading.t_s, reading.sensor, reading.value
    work, memory, settings = on.work, on.memory, on.settings
    heard = reading.quality > 0.0 and memory[HAS_ATTITUDE] > 0.0
    if sensor == Sensor.GPS_VELOCITY and heard and np.isfinite(value[0] + value[1] + value[2]):
        memory[VEL_CLOCK], memory[VEL_N], memory[VEL_E], memory[VEL_D] = t_s, value[0], value[1], value[2]
    at_fix = heard and sensor == Sensor.GPS_POSITION and np.isfinite(value[0] + value[1] + value[2])
    at_flow = heard and (sensor == Sensor.FLOW_RATE or sensor == Sensor.FLOW_VELOCITY) and t_s >= memory[DEADLINE]
    if not (at_fix or at_flow):
        return
    horizontal = vertical = LOST_SIGMA_M if np.isfinite(memory[DEADLINE]) else ORIGIN_SIGMA_M
    for i in range(3):
        work[STATE + i] = value[i] if at_fix else 0.0
    if at_fix:
        horizontal, vertical = settings.gps_position_sigma_m, settings.gps_height_sigma_m
    speed = climb = settings.start_velocity_sigma_m_s
    if t_s - memory[VEL_CLOCK] < VELOCITY_MEMORY_S:
        for i in range(3):
            work[STATE + 3 + i] = memory[VEL_N + i]
        speed, climb = settings.gps_velocity_sigma_m_s, settings.gps_climb_sigma_m_s
    sigmas = (horizontal, horizontal, vertical, speed, speed, climb)
    for i in range(6):
        work[COVARIANCE + 7 * i] = sigmas[i] * sigmas[i]
    memory[STARTED], memory[CLOCK] = 1.0, t_s
    write_event(t_s, START, 1.0 if at_fix else 0.0, on.tape)


@kernel
def advance(t_s: float, on: Running) -> None:
    """Bring the filter to an instant, with the IMU where it is fresh."""
    dt_s = t_s - on.memory[CLOCK]
    if dt_s > 0.0:
        if t_s - on.memory[IMU_CLOCK] <= on.settings.stale_s:
            predict(on.work, ONE_LANE, ROWS, dt_s, on.settings)
            turn_attitude(on.work, ONE_LANE, ROWS, GYRO, dt_s)
        else:
            coast(on.work, ONE_LANE, ROWS, dt_s, on.settings)
        on.memory[CLOCK] = t_s
