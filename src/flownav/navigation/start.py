"""How a navigator starts: a first attitude, and a fix or the local origin."""

from __future__ import annotations

import numpy as np

from flownav.compile import procedure
from flownav.estimation.landing.states import ATTITUDE, POSITION, STATES
from flownav.frames import quaternion_from_euler
from flownav.measurement import Sensor
from flownav.navigation.attitude import magnetic_heading
from flownav.navigation.state import (
    AIDED,
    ATTITUDE_CLOCK,
    CLOCK,
    DEADLINE,
    FROM_MAG,
    IMU_CLOCK,
    LATEST_IMU,
    LEVEL,
    LEVEL_COUNT,
    MAG_HEADING,
    NO_HEADING,
    ROWS,
    START,
    STARTED,
    USE_HEADING,
    Reading,
    Running,
    write_event,
)

ORIGIN_SIGMA_M = 0.1  # the local origin, where the navigator's start defines it
LOST_SIGMA_M = 10.0  # the same where the log's fixes define it and came too late, and about a first fix
READ_TILT_RAD = 0.03  # an attitude that was read
LEVELLED_TILT_RAD = 0.1  # one from the accelerometer
READ_HEADING_RAD = 0.1  # an autopilot's, whose compass is calibrated
COMPASS_HEADING_RAD = 0.3  # a raw magnetometer's
LEAST_LEVELLING = 5


@procedure
def gather(reading: Reading, on: Running) -> None:
    """Before the start: the latest attitude, heading and IMU reading, and the mean specific force."""
    value, memory, work = reading.value, on.memory, on.work
    if memory[STARTED] > 0.0:
        return
    if reading.sensor == Sensor.ATTITUDE:
        size = np.sqrt(value[0] ** 2 + value[1] ** 2 + value[2] ** 2 + value[3] ** 2)
        if size > 0.5 and size < 2.0:
            for i in range(4):
                work[ROWS.attitude + i] = value[i] / size
            memory[ATTITUDE_CLOCK] = reading.t_s
    elif reading.sensor == Sensor.IMU:
        total = value[0] + value[1] + value[2] + value[3] + value[4] + value[5]
        if np.isfinite(total):
            for i in range(6):
                work[LATEST_IMU + i] = value[i]
            share = 1.0 / min(memory[LEVEL_COUNT] + 1.0, 100.0)
            for i in range(3):
                memory[LEVEL + i] += share * (value[3 + i] - memory[LEVEL + i])
            memory[LEVEL_COUNT] += 1.0
            memory[IMU_CLOCK] = reading.t_s


@procedure
def try_start(reading: Reading, on: Running) -> None:
    """Start at a fix, or at the local origin with the first flow, pose or range where no fix came in time."""
    t_s, sensor, value, memory, work = reading.t_s, reading.sensor, reading.value, on.memory, on.work
    read = np.isfinite(memory[ATTITUDE_CLOCK])
    if not read and memory[LEVEL_COUNT] < LEAST_LEVELLING:
        return
    heard = reading.quality > 0.0 and np.isfinite(value[0])
    at_fix = heard and sensor == Sensor.GPS_POSITION and np.isfinite(value[0] + value[1] + value[2])
    other = sensor == Sensor.FLOW_RATE or sensor == Sensor.FLOW_VELOCITY or sensor == Sensor.POSE
    at_origin = heard and other and t_s >= memory[DEADLINE]
    if not (at_fix or at_origin):
        return
    if not read:
        level(on)
    lost = np.isfinite(memory[DEADLINE])
    for i in range(STATES):
        work[ROWS.state + i] = 0.0
        for j in range(STATES):
            work[ROWS.covariance + i * STATES + j] = on.start_sigma[i] ** 2 if i == j else 0.0
    for i in range(2):
        tilt = READ_TILT_RAD if read else LEVELLED_TILT_RAD
        work[ROWS.covariance + (ATTITUDE + i) * (STATES + 1)] = tilt * tilt
    known = memory[USE_HEADING] == NO_HEADING and not lost  # the start defines the frame
    heading = 1e-3 if known else (READ_HEADING_RAD if read else COMPASS_HEADING_RAD)
    work[ROWS.covariance + (ATTITUDE + 2) * (STATES + 1)] = heading * heading
    for i in range(3):
        sigma = LOST_SIGMA_M if lost else ORIGIN_SIGMA_M
        work[ROWS.covariance + (POSITION + i) * (STATES + 1)] = sigma * sigma
        work[ROWS.state + POSITION + i] = value[i] if at_fix else 0.0
    memory[STARTED], memory[CLOCK], memory[AIDED] = 1.0, t_s, t_s
    write_event(t_s, START, 1.0 if at_fix else 0.0, on.tape)


@procedure
def level(on: Running) -> None:
    """Roll and pitch from the mean specific force, heading from the magnetometer where one was heard, else north."""
    memory, work = on.memory, on.work
    x, y, z = memory[LEVEL], memory[LEVEL + 1], memory[LEVEL + 2]
    roll, pitch = np.arctan2(-y, -z), np.arctan2(x, np.sqrt(y * y + z * z))
    w0, x0, y0, z0 = quaternion_from_euler(roll, pitch, 0.0)
    work[ROWS.attitude], work[ROWS.attitude + 1], work[ROWS.attitude + 2], work[ROWS.attitude + 3] = w0, x0, y0, z0
    heading = 0.0
    if memory[USE_HEADING] == FROM_MAG and np.isfinite(memory[MAG_HEADING]):
        heading = magnetic_heading(on)
    w0, x0, y0, z0 = quaternion_from_euler(roll, pitch, heading)
    work[ROWS.attitude], work[ROWS.attitude + 1], work[ROWS.attitude + 2], work[ROWS.attitude + 3] = w0, x0, y0, z0
