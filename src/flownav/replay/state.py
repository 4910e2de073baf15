"""What a running filter is made of: its lane buffer, what it remembers besides, and the tape it writes.

The loop's code works on three arrays, so that it compiles and so that a live session can stop and go on:
`work`, a lane buffer of one lane with the filter's rows; `memory`, the scalars that are no part of the filter
(clocks, datums, rejection timers); and the `Tape`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import ONE_LANE, kernel
from flownav.estimation.gating import Reason
from flownav.estimation.kinematic_filter import KINEMATIC_ROW_COUNT, kinematic_rows, rotation_of
from flownav.estimation.kinematic_settings import KinematicSettings
from flownav.frames import to_body
from flownav.measurement import Array, EventQueue, Sensor

# rows of `work`
ROWS = kinematic_rows(0)
STATE, COVARIANCE = ROWS.kalman.state, ROWS.kalman.covariance
GYRO = KINEMATIC_ROW_COUNT  # 3 rows: the latest body rates
OFFERED = GYRO + 3  # the component that is offered: value, variance, 1.0 where it may be fused
WORK_ROWS = OFFERED + 3

# places in `memory`; SINCE and COUNT hold one value for each state: how long GPS has been rejected for it
(CLOCK, STARTED, HAS_ATTITUDE, DEADLINE, IMU_CLOCK, WRITTEN, VEL_CLOCK, VEL_N, VEL_E, VEL_D,
 GROUND, RANGE_CLOCK, RANGE_SINCE, BARO_OFFSET, BARO_CLOCK, FLOW_EXCESS,
 FLOW_CLOCK, SINCE, COUNT) = (*range(18), 24)  # fmt: skip
MEMORY_SIZE = COUNT + 6

# what a tape's columns hold
OFFER_COLUMNS = ("t_s", "sensor", "component", "observation", "observation_variance", "innovation",
                 "innovation_variance", "test_ratio", "reason")  # fmt: skip
ESTIMATE_COLUMNS = (
    23  # t, position 3, body velocity 3, quaternion 4, position and velocity std 6, NED velocity 3, trim 3
)
ESTIMATE_PERIOD_S = 0.02
COMPONENTS = {Sensor.GPS_POSITION: 3, Sensor.GPS_VELOCITY: 3, Sensor.FLOW_RATE: 2, Sensor.FLOW_VELOCITY: 3,
              Sensor.RANGE: 1, Sensor.BARO: 1}  # fmt: skip

# Kinds of event: source, kind, what the value is. NumPy numbers them, because Numba compiles a function anew
# for each Python integer that it is called with.
START, GROUND_SET, GROUND_RESET, BARO_SET, GPS_RESET = np.arange(5)
EVENT_NAMES = (
    ("filter", "start", "at a GPS fix (1) or at the local origin (0)"),
    ("range", "datum", "ground level below the first range, down in the local frame [m]"),
    ("range", "reset", "range was rejected for long: new ground level, down in the local frame [m]"),
    ("baro", "datum", "pressure height of the local origin [m]"),
    ("gps", "reset", "GPS was rejected for long: one state went to it, by this much [m or m/s]"),
)


class Tape(NamedTuple):
    """What a run writes: estimate (n, 23), innovation (m, 9), event (k, 3: t, kind, value), used rows of each (3,)."""

    estimate: Array
    innovation: Array
    event: Array
    used: NDArray[np.int64]


class Running(NamedTuple):
    """A filter at work."""

    settings: KinematicSettings
    work: Array
    memory: Array
    tape: Tape


class Reading(NamedTuple):
    """One event of a queue: when, which sensor, quality, values and variances (MAX_VALUES,)."""

    t_s: float
    sensor: int
    quality: float
    value: Array
    variance: Array


def new_filter(queue: EventQueue, settings: KinematicSettings) -> Running:
    """A filter that has not started, with a tape long enough for the queue."""
    memory = np.full(MEMORY_SIZE, np.nan)
    memory[[STARTED, HAS_ATTITUDE]] = 0.0
    memory[FLOW_EXCESS] = 1.0
    memory[[IMU_CLOCK, FLOW_CLOCK, WRITTEN, VEL_CLOCK, RANGE_CLOCK]] = -np.inf
    memory[COUNT:] = 0.0
    fixes = (queue.sensor == Sensor.GPS_POSITION) & (queue.quality > 0)
    memory[DEADLINE] = queue.t_s[0] + settings.start_wait_s if fixes.any() else -np.inf
    return Running(settings, np.zeros(WORK_ROWS), memory, _new_tape(queue))


def _new_tape(queue: EventQueue) -> Tape:
    components = sum(count * int(np.count_nonzero(queue.sensor == sensor)) for sensor, count in COMPONENTS.items())
    estimates = min(len(queue.t_s), int((queue.t_s[-1] - queue.t_s[0]) / ESTIMATE_PERIOD_S) + 2)
    return Tape(
        np.empty((estimates, ESTIMATE_COLUMNS)),
        np.empty((components, len(OFFER_COLUMNS))),
        np.empty((len(queue.t_s) + 8, 3)),
        np.zeros(3, np.int64),
    )


@kernel
def write_event(t_s: float, kind: Any, value: float, tape: Tape) -> None:
    """A happening; there is at most one for each measurement."""
    row = tape.used[2]
    tape.event[row, 0], tape.event[row, 1], tape.event[row, 2] = t_s, kind, value
    tape.used[2] = row + 1


@kernel
def write_offer(reading: Reading, component: int, reason: int, on: Running) -> None:
    """What became of the component that was offered last."""
    row = on.tape.used[1]
    on.tape.used[1] = row + 1
    line, kalman = on.tape.innovation[row], ROWS.kalman
    tested = reason != Reason.BEFORE_START
    line[0], line[1], line[2], line[8] = reading.t_s, reading.sensor, component, reason
    line[3], line[4] = on.work[OFFERED], on.work[OFFERED + 1]
    line[5] = on.work[kalman.innovation] if tested else np.nan
    line[6] = on.work[kalman.innovation_variance] if tested else np.nan
    line[7] = on.work[kalman.test_ratio] if tested else np.nan


@kernel
def write_estimate(t_s: float, on: Running) -> None:
    """State, attitude and standard deviations at an instant; see ESTIMATE_COLUMNS."""
    work, line = on.work, on.tape.estimate[on.tape.used[0]]
    on.tape.used[0] += 1
    on.memory[WRITTEN] = t_s
    rotation = rotation_of(work, ONE_LANE, ROWS, 0)
    velocity = to_body(rotation, work[STATE + 3], work[STATE + 4], work[STATE + 5])
    line[0] = t_s
    for i in range(3):
        line[1 + i] = work[STATE + i]
        line[4 + i] = velocity[i]
        line[11 + i] = np.sqrt(work[COVARIANCE + 7 * i])
        line[17 + i] = work[STATE + 3 + i]
        line[20 + i] = work[ROWS.trim + i]
        variance = 0.0
        for j in range(3):
            for k in range(3):
                variance += rotation[3 * j + i] * work[COVARIANCE + 6 * (3 + j) + 3 + k] * rotation[3 * k + i]
        line[14 + i] = np.sqrt(variance)
    for i in range(4):
        line[7 + i] = work[ROWS.attitude + i]
