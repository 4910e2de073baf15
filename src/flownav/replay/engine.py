"""The event loop: measurements in time order through the kinematic filter, one vehicle.

`run` is the kernel. Between calls the filter lives in `work` (a lane buffer of one lane) and in `memory` (the
scalars that are no part of the filter: clocks, datums, rejection timers), so a live session may feed events as they
come. What happens goes to a `Tape`: estimates, one row per offered component, and events.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import ONE_LANE, kernel
from flownav.estimation.gating import Reason
from flownav.estimation.kinematic_filter import (
    KINEMATIC_ROW_COUNT,
    coast,
    correct,
    flow_to_body_velocity,
    flow_velocity_variance,
    kinematic_rows,
    observe_body_velocity,
    observe_state,
    predict,
    range_variance,
    rotation_of,
    turn_attitude,
)
from flownav.estimation.kinematic_settings import KinematicSettings
from flownav.frames import to_body
from flownav.measurement import Array, EventQueue, Sensor

ROWS = kinematic_rows(0)
STATE, COVARIANCE = ROWS.kalman.state, ROWS.kalman.covariance
GYRO = KINEMATIC_ROW_COUNT  # 3 rows: the latest body rates
READING = GYRO + 3  # the component that is offered: value, variance, 1.0 where it may be fused
WORK_ROWS = READING + 3

(FUSED, INNOVATION_GATE, NO_DATA, NOT_FINITE, OUT_OF_RANGE, NO_HEIGHT, TILTED, BEFORE_START, DATUM, OUTAGE) = map(
    int, Reason
)
# NumPy integers, not Python's: Numba compiles a function anew for each Python integer it is called with
RANGE, BARO, ONLY, DOWN = np.int64(Sensor.RANGE), np.int64(Sensor.BARO), np.int64(0), np.int64(2)

# memory: what the loop remembers besides the filter
(CLOCK, STARTED, HAS_ATTITUDE, DEADLINE, IMU_CLOCK, WRITTEN, VEL_CLOCK, VEL_N, VEL_E, VEL_D,
 GROUND, RANGE_CLOCK, RANGE_SINCE, BARO_OFFSET, BARO_CLOCK, SINCE, COUNT) = (*range(16), 22)  # fmt: skip
MEMORY_SIZE = COUNT + 6  # SINCE and COUNT hold one value for each state: how long GPS has been rejected for it

# columns of Tape.innovation and Tape.estimate
OFFER_COLUMNS = ("t_s", "sensor", "component", "observation", "observation_variance", "innovation",
                 "innovation_variance", "test_ratio", "reason")  # fmt: skip
ESTIMATE_COLUMNS = 23  # t, position 3, body velocity 3, quaternion 4, their std 6, NED velocity 3, trim 3
ESTIMATE_PERIOD_S = 0.02

# kinds of event
START, GROUND_SET, GROUND_RESET, BARO_SET, GPS_RESET = np.arange(5)
EVENT_NAMES = (
    ("filter", "start", "at a GPS fix (1) or without (0)"),
    ("range", "datum", "ground level below the first range, down in the local frame [m]"),
    ("range", "reset", "range was rejected for long: new ground level, down in the local frame [m]"),
    ("baro", "datum", "pressure height of the local origin [m]"),
    ("gps", "reset", "GPS was rejected for long: the state went to it, by this much"),
)
LEAST_REJECTIONS = 5
LEAST_RANGE_M = 0.05
UNKNOWN_RANGE_M = 2.0


class Tape(NamedTuple):
    """What a run writes: estimate (n, 23), innovation (m, 9), event (k, 3: t, kind, value), used rows of each (3,)."""

    estimate: Array
    innovation: Array
    event: Array
    used: NDArray[np.int64]


def new_tape(queue: EventQueue) -> Tape:
    """A tape long enough for a queue."""
    offered = {Sensor.GPS_POSITION: 3, Sensor.GPS_VELOCITY: 3, Sensor.FLOW_RATE: 2, Sensor.FLOW_VELOCITY: 3,
               Sensor.RANGE: 1, Sensor.BARO: 1}  # fmt: skip
    components = sum(count * int(np.count_nonzero(queue.sensor == sensor)) for sensor, count in offered.items())
    span_s = float(queue.t_s[-1] - queue.t_s[0]) if len(queue.t_s) else 0.0
    estimates = min(len(queue.t_s), int(span_s / ESTIMATE_PERIOD_S) + 2)
    return Tape(
        np.empty((estimates, ESTIMATE_COLUMNS)),
        np.empty((components, len(OFFER_COLUMNS))),
        np.empty((len(queue.t_s) + 8, 3)),
        np.zeros(3, np.int64),
    )


def new_memory(queue: EventQueue, start_wait_s: float) -> tuple[Array, Array]:
    """work and memory of a filter that has not started."""
    memory = np.full(MEMORY_SIZE, np.nan)
    memory[[STARTED, HAS_ATTITUDE]] = 0.0
    memory[[IMU_CLOCK, WRITTEN, VEL_CLOCK, RANGE_CLOCK]] = -np.inf
    memory[COUNT:] = 0.0
    fixes = (queue.sensor == Sensor.GPS_POSITION) & (queue.quality > 0)
    memory[DEADLINE] = queue.t_s[0] + start_wait_s if fixes.any() else -np.inf
    return np.zeros(WORK_ROWS), memory


@kernel
def run(queue: EventQueue, settings: KinematicSettings, work: Array, memory: Array, tape: Tape) -> None:
    """Feed every event of the queue; see the module."""
    for k in range(len(queue.t_s)):
        t_s, sensor, quality = queue.t_s[k], queue.sensor[k], queue.quality[k]
        value, variance = queue.value[k], queue.variance[k]
        if sensor == Sensor.GPS_VELOCITY and quality > 0.0:
            memory[VEL_CLOCK], memory[VEL_N], memory[VEL_E], memory[VEL_D] = t_s, value[0], value[1], value[2]
        if memory[STARTED] == 0.0:
            start(t_s, sensor, quality, value, settings, work, memory, tape)
        if memory[STARTED] > 0.0:
            advance(t_s, settings, work, memory)
        if sensor == Sensor.ATTITUDE:
            size = np.sqrt(value[0] ** 2 + value[1] ** 2 + value[2] ** 2 + value[3] ** 2)
            for i in range(4):
                work[ROWS.attitude + i] = value[i] / size
            memory[HAS_ATTITUDE] = 1.0
        elif sensor == Sensor.IMU:
            for i in range(3):
                work[GYRO + i] = value[i]
                work[ROWS.force + i] = value[3 + i]
            memory[IMU_CLOCK] = t_s
        elif sensor == Sensor.GPS_POSITION or sensor == Sensor.GPS_VELOCITY:
            take_gps(t_s, sensor, quality, value, variance, settings, work, memory, tape)
        elif sensor == Sensor.FLOW_RATE or sensor == Sensor.FLOW_VELOCITY:
            take_flow(t_s, sensor, quality, value, variance, settings, work, memory, tape)
        elif sensor == Sensor.RANGE:
            take_range(t_s, quality, value[0], variance[0], settings, work, memory, tape)
        elif sensor == Sensor.BARO:
            take_baro(t_s, quality, value[0], variance[0], settings, work, memory, tape)
        if memory[STARTED] > 0.0 and t_s - memory[WRITTEN] >= ESTIMATE_PERIOD_S:
            write_estimate(t_s, work, memory, tape)


@kernel
def start(
    t_s: float, sensor: int, quality: float, value: Array, settings: KinematicSettings, work: Array, memory: Array,
    tape: Tape,
) -> None:  # fmt: skip
    """Start at a fix, or at the local origin where none came in time; an attitude is needed either way."""
    at_fix = sensor == Sensor.GPS_POSITION and quality > 0.0
    if memory[HAS_ATTITUDE] == 0.0 or not (at_fix or t_s >= memory[DEADLINE]):
        return
    horizontal, vertical = 0.1, 0.1
    for i in range(3):
        work[STATE + i] = value[i] if at_fix else 0.0
    if at_fix:
        horizontal, vertical = settings.gps_position_sigma_m, settings.gps_height_sigma_m
    speed, climb = settings.start_velocity_sigma_m_s, settings.start_velocity_sigma_m_s
    if t_s - memory[VEL_CLOCK] < 1.0:
        for i in range(3):
            work[STATE + 3 + i] = memory[VEL_N + i]
        speed, climb = settings.gps_velocity_sigma_m_s, settings.gps_climb_sigma_m_s
    sigmas = (horizontal, horizontal, vertical, speed, speed, climb)
    for i in range(6):
        work[COVARIANCE + 7 * i] = sigmas[i] * sigmas[i]
    memory[STARTED], memory[CLOCK] = 1.0, t_s
    write_event(t_s, START, 1.0 if at_fix else 0.0, tape)


@kernel
def advance(t_s: float, settings: KinematicSettings, work: Array, memory: Array) -> None:
    """Bring the filter to an instant, with the IMU where it is fresh."""
    dt_s = t_s - memory[CLOCK]
    if dt_s > 0.0:
        if t_s - memory[IMU_CLOCK] <= settings.stale_s:
            predict(work, ONE_LANE, ROWS, dt_s, settings)
            turn_attitude(work, ONE_LANE, ROWS, GYRO, dt_s)
        else:
            coast(work, ONE_LANE, ROWS, dt_s, settings)
        memory[CLOCK] = t_s


# -- sensors -----------------------------------------------------------------------------------------------
@kernel
def take_gps(
    t_s: float, sensor: int, quality: float, value: Array, variance: Array, settings: KinematicSettings, work: Array,
    memory: Array, tape: Tape,
) -> None:  # fmt: skip
    """Position or velocity, component by component; where it is rejected for long, the state goes to it."""
    first = 0 if sensor == Sensor.GPS_POSITION else 3
    for axis in range(3):
        if first == 0:
            sigma = settings.gps_position_sigma_m if axis < 2 else settings.gps_height_sigma_m
        else:
            sigma = settings.gps_velocity_sigma_m_s if axis < 2 else settings.gps_climb_sigma_m_s
        noise = sigma * sigma if np.isnan(variance[axis]) else variance[axis]
        reason = usable(quality, value[axis], noise, memory)
        reason = offer_state(t_s, sensor, axis, first + axis, value[axis], noise, reason, settings, work, memory, tape)
        mind_rejections(t_s, first + axis, reason, value[axis], noise, settings, work, memory, tape)


@kernel
def mind_rejections(
    t_s: float, index: int, reason: int, value: float, variance: float, settings: KinematicSettings, work: Array,
    memory: Array, tape: Tape,
) -> None:  # fmt: skip
    """Where GPS has been rejected again and again for a state, the filter is wrong: that state goes to GPS.

    A jump of height takes the ground's and the barometer's datum with it.
    """
    if reason != INNOVATION_GATE:
        memory[COUNT + index] = 0.0
        return
    if memory[COUNT + index] == 0.0:
        memory[SINCE + index] = t_s
    memory[COUNT + index] += 1.0
    if memory[COUNT + index] < LEAST_REJECTIONS or t_s - memory[SINCE + index] < settings.gps_reset_s:
        return
    jump = value - work[STATE + index]
    work[STATE + index] = value
    for i in range(6):
        work[COVARIANCE + 6 * index + i] = 0.0
        work[COVARIANCE + 6 * i + index] = 0.0
    work[COVARIANCE + 7 * index] = variance
    if index == 2:
        memory[GROUND] += jump
        memory[BARO_OFFSET] += jump
    memory[COUNT + index] = 0.0
    write_event(t_s, GPS_RESET, jump, tape)


@kernel
def take_flow(
    t_s: float, sensor: int, quality: float, value: Array, variance: Array, settings: KinematicSettings, work: Array,
    memory: Array, tape: Tape,
) -> None:  # fmt: skip
    """Flow as body velocity: angular rates times the height along the boresight, or a velocity as it is."""
    upright = rotation_of(work, ONE_LANE, ROWS, 0)[8]
    height_variance = work[COVARIANCE + 14] / max(upright * upright, 0.01)
    known = t_s - memory[RANGE_CLOCK] <= settings.height_hold_s
    range_m = max((memory[GROUND] - work[STATE + 2]) / max(upright, 0.1), LEAST_RANGE_M) if known else UNKNOWN_RANGE_M
    reason = usable(quality, value[0] + value[1], 0.0, memory)
    forward, right = value[0], value[1]
    if sensor == Sensor.FLOW_RATE:
        forward, right = flow_to_body_velocity(value[0], value[1], value[2], value[3], range_m)
        if reason == FUSED and not np.isfinite(forward + right):
            reason = NOT_FINITE if known else NO_HEIGHT
        elif reason == FUSED and not known:
            reason = NO_HEIGHT
        elif reason == FUSED and max(abs(value[0]), abs(value[1])) > settings.flow_limit_rad_s:
            reason = OUT_OF_RANGE
    if reason == FUSED and upright < np.cos(settings.tilt_limit_rad):
        reason = TILTED
    noise_of_range = height_variance + range_variance(range_m, settings)
    components = 3 if sensor == Sensor.FLOW_VELOCITY and np.isfinite(value[2]) else 2
    for axis in range(components):
        velocity = forward if axis == 0 else (right if axis == 1 else value[2])
        noise = variance[axis] if sensor == Sensor.FLOW_VELOCITY else np.nan
        if np.isnan(noise):
            noise = flow_velocity_variance(range_m, noise_of_range, velocity, quality, settings)
        offer_body_velocity(t_s, sensor, axis, velocity, noise, reason, settings, work, memory, tape)


@kernel
def take_range(
    t_s: float, quality: float, range_m: float, variance: float, settings: KinematicSettings, work: Array, memory: Array,
    tape: Tape,
) -> None:  # fmt: skip
    """Height over flat ground: p_d = ground - r cos(tilt). Where range is rejected for long, the ground has a step."""
    upright = rotation_of(work, ONE_LANE, ROWS, 0)[8]
    noise = range_variance(range_m, settings) if np.isnan(variance) else variance
    reason = usable(quality, range_m, noise, memory)
    if reason == FUSED and not settings.range_min_m <= range_m <= settings.range_max_m:
        reason = OUT_OF_RANGE
    if reason == FUSED and upright < np.cos(settings.tilt_limit_rad):
        reason = TILTED
    below = work[STATE + 2] + range_m * upright
    if reason == FUSED and np.isnan(memory[GROUND]):
        memory[GROUND] = below
        reason = DATUM
        write_event(t_s, GROUND_SET, below, tape)
    down = memory[GROUND] - range_m * upright
    reason = offer_state(t_s, RANGE, ONLY, DOWN, down, noise, reason, settings, work, memory, tape)
    if reason == FUSED or reason == DATUM:
        memory[RANGE_CLOCK], memory[RANGE_SINCE] = t_s, np.nan
    elif reason == INNOVATION_GATE:
        if np.isnan(memory[RANGE_SINCE]):
            memory[RANGE_SINCE] = t_s
        if t_s - memory[RANGE_SINCE] >= settings.ground_reset_s:
            memory[GROUND], memory[RANGE_CLOCK], memory[RANGE_SINCE] = below, t_s, np.nan
            write_event(t_s, GROUND_RESET, below, tape)


@kernel
def take_baro(
    t_s: float, quality: float, altitude_m: float, variance: float, settings: KinematicSettings, work: Array,
    memory: Array, tape: Tape,
) -> None:  # fmt: skip
    """Height from pressure: p_d = offset - altitude; the offset follows the rest of the filter slowly."""
    noise = settings.baro_sigma_m * settings.baro_sigma_m if np.isnan(variance) else variance
    reason = usable(quality, altitude_m, noise, memory)
    if reason == FUSED and np.isnan(memory[BARO_OFFSET]):
        memory[BARO_OFFSET], memory[BARO_CLOCK] = altitude_m + work[STATE + 2], t_s
        reason = DATUM
        write_event(t_s, BARO_SET, memory[BARO_OFFSET], tape)
    down = memory[BARO_OFFSET] - altitude_m
    reason = offer_state(t_s, BARO, ONLY, DOWN, down, noise, reason, settings, work, memory, tape)
    if reason == FUSED:
        share = min((t_s - memory[BARO_CLOCK]) / settings.baro_drift_time_s, 1.0)
        memory[BARO_OFFSET] -= share * work[ROWS.kalman.innovation]
        memory[BARO_CLOCK] = t_s


# -- one component -----------------------------------------------------------------------------------------
@kernel
def usable(quality: float, value: float, variance: float, memory: Array) -> int:
    """FUSED where a reading may be offered, or the reason why not."""
    reason = FUSED
    if memory[STARTED] == 0.0:
        reason = BEFORE_START
    elif quality < 0.0:
        reason = OUTAGE
    elif quality == 0.0:
        reason = NO_DATA
    elif not np.isfinite(value + variance):
        reason = NOT_FINITE
    return reason


@kernel
def offer_state(
    t_s: float, sensor: int, component: int, index: int, value: float, variance: float, reason: int,
    settings: KinematicSettings, work: Array, memory: Array, tape: Tape,
) -> int:  # fmt: skip
    """Offer a reading of state `index`; what became of it."""
    work[READING], work[READING + 1], work[READING + 2] = value, variance, 1.0 if reason == FUSED else 0.0
    observe_state(work, ONE_LANE, ROWS, index, READING, READING + 1, READING + 2)
    return conclude(t_s, sensor, component, reason, settings, work, memory, tape)


@kernel
def offer_body_velocity(
    t_s: float, sensor: int, component: int, value: float, variance: float, reason: int, settings: KinematicSettings,
    work: Array, memory: Array, tape: Tape,
) -> int:  # fmt: skip
    """Offer a component of body velocity; what became of it."""
    work[READING], work[READING + 1], work[READING + 2] = value, variance, 1.0 if reason == FUSED else 0.0
    observe_body_velocity(work, ONE_LANE, ROWS, component, READING, READING + 1, READING + 2)
    return conclude(t_s, sensor, component, reason, settings, work, memory, tape)


@kernel
def conclude(
    t_s: float, sensor: int, component: int, reason: int, settings: KinematicSettings, work: Array, memory: Array,
    tape: Tape,
) -> int:  # fmt: skip
    """Test, fuse and write down the component that stands in the observation rows."""
    fresh = t_s - memory[IMU_CLOCK] <= settings.stale_s
    correct(work, ONE_LANE, ROWS, settings, 1.0 / settings.trim_time_s if fresh else 0.0)
    if reason == FUSED and work[ROWS.kalman.accepted] == 0.0:
        reason = INNOVATION_GATE
    row = tape.used[1]
    tape.used[1] = row + 1
    line = tape.innovation[row]
    line[0], line[1], line[2], line[8] = t_s, sensor, component, reason
    line[3], line[4] = work[READING], work[READING + 1]
    line[5] = work[ROWS.kalman.innovation] if reason != BEFORE_START else np.nan
    line[6] = work[ROWS.kalman.innovation_variance] if reason != BEFORE_START else np.nan
    line[7] = work[ROWS.kalman.test_ratio] if reason != BEFORE_START else np.nan
    return reason


# -- writing down ------------------------------------------------------------------------------------------
@kernel
def write_event(t_s: float, kind: int, value: float, tape: Tape) -> None:
    """A happening; the tape holds one for each measurement at most."""
    row = tape.used[2]
    tape.event[row, 0], tape.event[row, 1], tape.event[row, 2] = t_s, kind, value
    tape.used[2] = row + 1


@kernel
def write_estimate(t_s: float, work: Array, memory: Array, tape: Tape) -> None:
    """State, attitude and standard deviations at an instant; see ESTIMATE_COLUMNS."""
    line = tape.estimate[tape.used[0]]
    tape.used[0] += 1
    memory[WRITTEN] = t_s
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
