"""The event loop: measurements in time order through the landing filter, one vehicle."""

from __future__ import annotations

import numpy as np

from flownav.compile import ONE_LANE, kernel, procedure
from flownav.estimation.landing.predict import predict
from flownav.estimation.landing.settings import LandingSettings
from flownav.estimation.landing.states import ACCEL_BIAS, GYRO_BIAS
from flownav.frames import GRAVITY_M_S2
from flownav.measurement import Array, EventQueue, Sensor
from flownav.navigation.attitude import take_attitude, take_mag, take_yaw
from flownav.navigation.flow import take_flow
from flownav.navigation.height import take_baro, take_range
from flownav.navigation.journal import note_estimate, note_prediction
from flownav.navigation.offers import note_aid_age, too_old
from flownav.navigation.position import take_gps, take_landed, take_pad, take_pose
from flownav.navigation.start import gather, try_start
from flownav.navigation.state import (
    CLOCK,
    ESTIMATE_PERIOD_S,
    GAP,
    IMU_CLOCK,
    IMU_LOST,
    LATEST_IMU,
    ROWS,
    STARTED,
    USE_IMU,
    WRITTEN,
    Reading,
    Running,
    write_estimate,
    write_event,
)
from flownav.navigation.vibration import add_vibration_noise, follow_vibration, limit_biases

LONGEST_STEP_S = 0.1


@kernel
def run(queue: EventQueue, on: Running) -> None:
    """Feed every event of the queue, in its order: bring the filter to its instant, fuse it, write what came of it."""
    memory = on.memory
    for k in range(len(queue.t_s)):
        t_s, sensor = queue.t_s[k], queue.sensor[k]
        reading = Reading(t_s, sensor, queue.quality[k], queue.value[k], queue.variance[k])
        if too_old(reading, on):
            continue
        gather(reading, on)
        if memory[STARTED] == 0.0:
            try_start(reading, on)
        if memory[STARTED] > 0.0:
            moving = sensor == Sensor.IMU and take_imu(reading, on)
            advance(t_s, on)
            if moving:
                for i in range(6):
                    on.work[LATEST_IMU + i] = reading.value[i]
        if sensor == Sensor.ATTITUDE:
            take_attitude(reading, on)
        elif sensor == Sensor.GPS_POSITION or sensor == Sensor.GPS_VELOCITY:
            take_gps(reading, on)
        elif sensor == Sensor.FLOW_RATE or sensor == Sensor.FLOW_VELOCITY:
            take_flow(reading, on)
        elif sensor == Sensor.RANGE:
            take_range(reading, on)
        elif sensor == Sensor.BARO:
            take_baro(reading, on)
        elif sensor == Sensor.MAG:
            take_mag(reading, on)
        elif sensor == Sensor.YAW:
            take_yaw(reading, on)
        elif sensor == Sensor.POSE:
            take_pose(reading, on)
        elif sensor == Sensor.PAD:
            take_pad(reading, on)
        elif sensor == Sensor.LANDED:
            take_landed(reading, on)
        if memory[STARTED] > 0.0:
            note_aid_age(t_s, on)
            if t_s - memory[WRITTEN] >= ESTIMATE_PERIOD_S:
                limit_biases(on)
                write_estimate(t_s, on)
                note_estimate(on)


@procedure
def take_imu(reading: Reading, on: Running) -> bool:
    """The mean of this reading and the last stands for the time between them; whether this one stands for what follows.

    What is not finite is no reading.
    """
    value, memory = reading.value, on.memory
    total = 0.0
    for i in range(6):
        total += value[i]
    if memory[USE_IMU] == 0.0 or not np.isfinite(total):
        return False
    fresh = reading.t_s - memory[IMU_CLOCK] <= on.settings.imu_stale_s
    if not fresh:
        advance(reading.t_s, on)  # the gap is coasted: this reading knows nothing of it
        if np.isfinite(memory[IMU_CLOCK]):
            write_event(reading.t_s, IMU_LOST, reading.t_s - memory[IMU_CLOCK], on.tape)
    if fresh:
        follow_vibration(value, reading.t_s - memory[IMU_CLOCK], on)
    for i in range(6):
        on.work[LATEST_IMU + i] = 0.5 * (value[i] + on.work[LATEST_IMU + i]) if fresh else value[i]
    memory[IMU_CLOCK] = reading.t_s
    return True


@procedure
def advance(t_s: float, on: Running) -> None:
    """Bring the filter to an instant, with the IMU where it is fresh, in steps short enough for its laws."""
    memory, work = on.memory, on.work
    ahead_s = t_s - memory[CLOCK]
    if not ahead_s > 0.0:
        return
    steps = min(int(np.ceil(ahead_s / LONGEST_STEP_S)), 10000)
    dt_s = ahead_s / steps
    moved = memory[USE_IMU] > 0.0 and t_s - memory[IMU_CLOCK] <= on.settings.imu_stale_s
    for _ in range(steps):
        for i in range(6):
            work[ROWS.imu + i] = work[LATEST_IMU + i]
        if not moved:
            memory[GAP] = 1.0
            hold_still(on)
        step(dt_s, on.settings.filter if moved else on.settings.coasting, work)
        if moved:
            add_vibration_noise(dt_s, on)
        note_prediction(dt_s, on)
    memory[CLOCK] = t_s


@procedure
def step(dt_s: float, settings: LandingSettings, work: Array) -> None:
    """One prediction of the filter."""
    predict(work, ONE_LANE, ROWS, dt_s, settings, None)


@procedure
def hold_still(on: Running) -> None:
    """An IMU reading of no turning and no acceleration, in the filter's own attitude and biases."""
    work = on.work
    w, x = work[ROWS.attitude], work[ROWS.attitude + 1]
    y, z = work[ROWS.attitude + 2], work[ROWS.attitude + 3]
    down = (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    for i in range(3):
        work[ROWS.imu + i] = work[ROWS.state + GYRO_BIAS + i]
        work[ROWS.imu + 3 + i] = work[ROWS.state + ACCEL_BIAS + i] - GRAVITY_M_S2 * down[i]
