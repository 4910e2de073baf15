"""What a running navigator is made of: its lane buffer, what it remembers besides, and the tape it writes.

Three arrays, so that the loop compiles and a live session can stop and go on: `work`, a lane buffer of one lane
with the landing filter's rows; `memory`, the scalars that are no part of the filter (clocks, timers, datums); and
the `Tape`. A smoother's `Journal` is beside them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import ONE_LANE, procedure
from flownav.estimation.gating import Reason
from flownav.estimation.landing.observe import rotation_of
from flownav.estimation.landing.states import LANDING_ROW_COUNT, POSITION, STATES, VELOCITY, landing_rows
from flownav.frames import to_body
from flownav.measurement import Array, EventQueue, Sensor
from flownav.navigation.settings import NavigatorSettings

# rows of `work`
ROWS = landing_rows(0)
LATEST_IMU = LANDING_ROW_COUNT  # 6: the last reading, which stands until the next
VALUE = LATEST_IMU + 6  # 4: what is offered
LEVER = VALUE + 4  # 1: velocity of the lens from rotation [m/s]
OBSERVED = LEVER + 1  # 10: how many states the offered component reads, and which
WORK_ROWS = OBSERVED + 10

# places in `memory`; SINCE and COUNT hold one value for each of six states (how long GPS has been rejected for it),
# LAST the newest time of each sensor, LEVEL the sum of specific force before the start
(
    CLOCK,
    STARTED,
    USE_IMU,
    USE_ATTITUDE,
    USE_HEADING,
    DEADLINE,
    WRITTEN,
    IMU_CLOCK,
    ATTITUDE_CLOCK,
    MAG_HEADING,
    GROUND_SET,
    RANGE_CLOCK,
    RANGE_SINCE,
    RANGE_LAST,
    RANGE_SAME_SINCE,
    RANGE_DOWN,
    RANGE_SAID,
    BARO_KNOWN,
    FLOW_EXCESS,
    FLOW_CLOCK,
    FLOW_BIAS_X,
    FLOW_BIAS_Y,
    FLOW_BIAS_COUNT,
    FLOW_GYRO_IS_IMU,
    AIDED,
    FLAG,
    LANDED,
    LEVEL_COUNT,
    HEADING_CLOCK,
    GAP,
    HEIGHT_CLOCK,
    VIBRATION,
    DOUBT,
    RANGE_DOUBTED,
) = range(34)
SINCE = 34
COUNT = SINCE + 6
LAST = COUNT + 6
LEVEL = LAST + max(Sensor) + 1
PAD = LEVEL + 3  # where the first pad fix puts the pad, NED [m]
OWN_BEFORE = PAD + 3  # the filter's attitude at the last attitude reading with a fresh IMU
READ_BEFORE = OWN_BEFORE + 4  # that reading
SPREAD_BEFORE = READ_BEFORE + 4  # and the filter's variances [rad2]
FLOW_RATIO = SPREAD_BEFORE + 3  # mean of nu^2 over its variance, flow of the last second
FLOW_DOUBT = FLOW_RATIO + 1  # 1 while flow is doubted
MEMORY_SIZE = FLOW_DOUBT + 1

# headings: none, a magnetometer's, an external attitude's or YAW's
NO_HEADING, FROM_MAG, FROM_ATTITUDE = 0.0, 1.0, 2.0

OFFER_COLUMNS = ("t_s", "sensor", "component", "observation", "observation_variance", "innovation",
                 "innovation_variance", "test_ratio", "reason")  # fmt: skip
# t, position 3, body velocity 3, quaternion 4, position and velocity std 6, NED velocity 3, attitude std 3, then the
# error states from GYRO_BIAS to FLOW_SCALE
EXTRA_STATES = 21
ESTIMATE_COLUMNS = 23 + EXTRA_STATES
ESTIMATE_PERIOD_S = 0.02
COMPONENTS = {Sensor.GPS_POSITION: 3, Sensor.GPS_VELOCITY: 3, Sensor.FLOW_RATE: 2, Sensor.FLOW_VELOCITY: 3,
              Sensor.RANGE: 1, Sensor.BARO: 1, Sensor.MAG: 1, Sensor.YAW: 1, Sensor.ATTITUDE: 3, Sensor.POSE: 3,
              Sensor.PAD: 3, Sensor.LANDED: 3}  # fmt: skip

# Kinds of event: source, kind, what the value is. NumPy numbers them, because Numba compiles a function anew
# for each Python integer that it is called with.
(START, GROUND_FOUND, GROUND_RESET, BARO_FOUND, GPS_RESET, DEAD_RECKONING, POSITION_INVALID, AIDED_AGAIN,
 RANGE_STUCK, PAD_FOUND, IMU_LOST, IMU_DOUBTED, FLOW_DOUBTED, FLOW_TRUSTED) = np.arange(14)  # fmt: skip
EVENT_NAMES = (
    ("filter", "start", "at a GPS fix (1) or at the local origin (0)"),
    ("range", "datum", "ground level below the first range, down in the local frame [m]"),
    ("range", "reset", "range was rejected for long: new ground level, down in the local frame [m]"),
    ("baro", "datum", "pressure height of the local origin [m]"),
    ("gps", "reset", "GPS was rejected for long: one state went to it, by this much [m or m/s]"),
    ("filter", "dead_reckoning", "no horizontal aid for this long [s]"),
    ("filter", "position_invalid", "no horizontal aid for this long [s]"),
    ("filter", "aided", "horizontal aid is back after this long [s]"),
    ("range", "stuck", "it repeats this value while the vehicle moves [m]"),
    ("pad", "datum", "the pad's distance from the local origin [m]"),
    ("imu", "lost", "no reading for this long [s]; attitude and velocity coast"),
    ("imu", "doubted", "range contradicts it by this much [m]; the accelerometer's bias is set free"),
    ("flow", "doubted", "it contradicts IMU and GPS: mean square innovation over its variance"),
    ("flow", "trusted", "it agrees again: mean square innovation over its variance"),
)


class Tape(NamedTuple):
    """What a run writes: estimate (n, ESTIMATE_COLUMNS), innovation (m, 9), event (k, 3), used rows of each (3,)."""

    estimate: Array
    innovation: Array
    event: Array
    used: NDArray[np.int64]


class Journal(NamedTuple):
    """What a smoother needs (navigation/journal.py): entry (n, ENTRY), state and quaternion (m, STATES + 4), covariance
    (m, STATES, STATES) of each estimate, used (2,): how many entries and estimates there were, kept or not.
    """

    entry: Array
    state: Array
    covariance: Array
    used: NDArray[np.int64]


class Running(NamedTuple):
    """A navigator at work."""

    settings: NavigatorSettings
    start_sigma: Array  # (STATES,) of the error states before the first reading
    work: Array
    memory: Array
    tape: Tape
    journal: Journal


class Reading(NamedTuple):
    """One event: when, which sensor, quality, values and variances (MAX_VALUES,)."""

    t_s: float
    sensor: int
    quality: float
    value: Array
    variance: Array


def new_tape(queue: EventQueue) -> Tape:
    """A tape long enough for a queue."""
    components = sum(count * int(np.count_nonzero(queue.sensor == sensor)) for sensor, count in COMPONENTS.items())
    estimates = min(len(queue.t_s), int((queue.t_s[-1] - queue.t_s[0]) / ESTIMATE_PERIOD_S) + 2)
    return empty_tape(estimates, components, 4 * len(queue.t_s) + 8)


def empty_tape(estimates: int, components: int, events: int) -> Tape:
    """A tape with this many rows."""
    return Tape(
        np.empty((estimates, ESTIMATE_COLUMNS)),
        np.empty((components, len(OFFER_COLUMNS))),
        np.empty((events, 3)),
        np.zeros(3, np.int64),
    )


def new_memory() -> Array:
    """Nothing has been heard."""
    memory = np.full(MEMORY_SIZE, np.nan)
    zeros = [DOUBT, VIBRATION, GAP, STARTED, USE_IMU, USE_ATTITUDE, USE_HEADING, GROUND_SET, BARO_KNOWN, FLAG,
             LANDED, LEVEL_COUNT, RANGE_DOUBTED,
             FLOW_BIAS_X, FLOW_BIAS_Y, FLOW_BIAS_COUNT, FLOW_GYRO_IS_IMU, RANGE_DOWN]  # fmt: skip
    memory[zeros] = 0.0
    memory[[FLOW_EXCESS, FLOW_RATIO]] = 1.0
    memory[FLOW_DOUBT] = 0.0
    memory[[HEIGHT_CLOCK, HEADING_CLOCK, IMU_CLOCK, ATTITUDE_CLOCK, FLOW_CLOCK, WRITTEN, RANGE_CLOCK]] = -np.inf
    memory[COUNT : COUNT + 6] = 0.0
    memory[LAST:LEVEL] = -np.inf
    memory[LEVEL : LEVEL + 3] = 0.0
    return memory


@procedure
def write_event(t_s: float, kind: Any, value: float, tape: Tape) -> None:
    """A happening."""
    row = tape.used[2]
    if row < len(tape.event):
        tape.event[row, 0], tape.event[row, 1], tape.event[row, 2] = t_s, kind, value
        tape.used[2] = row + 1


@procedure
def write_offer(reading: Reading, component: int, observation: float, reason: int, on: Running) -> None:
    """What became of the component that was offered last."""
    row = on.tape.used[1]
    if row >= len(on.tape.innovation):
        return
    on.tape.used[1] = row + 1
    line = on.tape.innovation[row]
    tested = reason != Reason.BEFORE_START and reason != Reason.DUPLICATE and reason != Reason.LATE
    line[0], line[1], line[2], line[8] = reading.t_s, reading.sensor, component, reason
    line[3], line[4] = observation, on.work[ROWS.noise]
    line[5] = on.work[ROWS.innovation] if tested else np.nan
    line[6] = on.work[ROWS.innovation_variance] if tested else np.nan
    line[7] = on.work[ROWS.test_ratio] if tested else np.nan


@procedure
def write_estimate(t_s: float, on: Running) -> None:
    """State, attitude and standard deviations at an instant; see ESTIMATE_COLUMNS."""
    work = on.work
    if on.tape.used[0] >= len(on.tape.estimate):
        return
    line = on.tape.estimate[on.tape.used[0]]
    on.tape.used[0] += 1
    on.memory[WRITTEN] = t_s
    rotation = rotation_of(work, ONE_LANE, ROWS, 0)
    first = ROWS.state + VELOCITY
    velocity = to_body(rotation, work[first], work[first + 1], work[first + 2])
    line[0] = t_s
    for i in range(3):
        line[1 + i] = work[ROWS.state + POSITION + i]
        line[4 + i] = velocity[i]
        line[11 + i] = np.sqrt(work[ROWS.covariance + (POSITION + i) * (STATES + 1)])
        line[17 + i] = work[first + i]
        line[20 + i] = np.sqrt(work[ROWS.covariance + (6 + i) * (STATES + 1)])
        variance = 0.0
        for j in range(3):
            for k in range(3):
                element = ROWS.covariance + (VELOCITY + j) * STATES + VELOCITY + k
                variance += rotation[3 * j + i] * work[element] * rotation[3 * k + i]
        line[14 + i] = np.sqrt(max(variance, 0.0))
    for i in range(4):
        line[7 + i] = work[ROWS.attitude + i]
    for i in range(EXTRA_STATES):
        line[23 + i] = work[ROWS.state + 9 + i]
