"""What the loop does with a reading of each sensor: check it, put it in filter terms, offer it, mind its datum."""

from __future__ import annotations

from typing import Any

import numpy as np

from flownav.compile import ONE_LANE, kernel
from flownav.estimation.gating import Reason
from flownav.estimation.kinematic_filter import (
    correct,
    flow_velocity_variance,
    observe_body_velocity,
    observe_state,
    range_variance,
    rotation_of,
)
from flownav.measurement import Sensor
from flownav.replay.state import (
    BARO_CLOCK,
    BARO_OFFSET,
    BARO_SET,
    COUNT,
    COVARIANCE,
    FLOW_CLOCK,
    FLOW_EXCESS,
    GPS_RESET,
    GROUND,
    GROUND_RESET,
    GROUND_SET,
    IMU_CLOCK,
    OFFERED,
    RANGE_CLOCK,
    RANGE_SINCE,
    ROWS,
    SINCE,
    STARTED,
    STATE,
    Reading,
    Running,
    write_event,
    write_offer,
)
from flownav.sensors.angular_flow import metric_flow

(FUSED, INNOVATION_GATE, NO_DATA, NOT_FINITE, OUT_OF_RANGE, NO_HEIGHT, TILTED, BEFORE_START, DATUM, OUTAGE) = map(
    int, tuple(Reason)[:10]
)
ONLY, DOWN = np.arange(2) * 2  # the one component of range and baro, and the state that it reads
LEAST_REJECTIONS = 5
LEAST_RANGE_M = 0.05
UNKNOWN_RANGE_M = 2.0
LARGEST_EXCESS = 400.0
LONGEST_STEP_S = 1.0


@kernel
def take_gps(reading: Reading, on: Running) -> None:
    """Position or velocity, component by component; where it is rejected for long, the state goes to it."""
    settings = on.settings
    first = 0 if reading.sensor == Sensor.GPS_POSITION else 3
    for axis in range(3):
        if first == 0:
            sigma = settings.gps_position_sigma_m if axis < 2 else settings.gps_height_sigma_m
        else:
            sigma = settings.gps_velocity_sigma_m_s if axis < 2 else settings.gps_climb_sigma_m_s
        noise = sigma * sigma if np.isnan(reading.variance[axis]) else reading.variance[axis]
        reason = usable(reading.quality, reading.value[axis], noise, on)
        reason = offer_state(reading, axis, first + axis, reading.value[axis], noise, reason, on)
        mind_rejections(reading.t_s, first + axis, reason, reading.value[axis], noise, on)


@kernel
def mind_rejections(t_s: float, index: int, reason: int, value: float, variance: float, on: Running) -> None:
    """Where GPS has been rejected again and again for a state, the filter is wrong: that state goes to GPS.

    A jump of height takes the ground's and the barometer's datum with it.
    """
    work, memory = on.work, on.memory
    if reason != INNOVATION_GATE:
        memory[COUNT + index] = 0.0
        return
    if memory[COUNT + index] == 0.0:
        memory[SINCE + index] = t_s
    memory[COUNT + index] += 1.0
    if memory[COUNT + index] < LEAST_REJECTIONS or t_s - memory[SINCE + index] < on.settings.gps_reset_s:
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
    write_event(t_s, GPS_RESET, jump, on.tape)


@kernel
def take_flow(reading: Reading, on: Running) -> None:
    """Flow as body velocity: angular rates times the range that the state implies, or a velocity as it is.

    The state's height is the rangefinder's, smoothed by the filter, without its spikes and between its readings.
    """
    memory, settings, value = on.memory, on.settings, reading.value
    upright = rotation_of(on.work, ONE_LANE, ROWS, 0)[8]
    known = reading.t_s - memory[RANGE_CLOCK] <= settings.height_hold_s
    height_m = memory[GROUND] - on.work[STATE + 2]
    range_m = max(height_m / max(upright, 0.1), LEAST_RANGE_M) if known else UNKNOWN_RANGE_M
    noise_of_range = on.work[COVARIANCE + 14] / max(upright * upright, 0.01) + range_variance(range_m, settings)
    forward, right = value[0], value[1]
    reason = usable(reading.quality, forward + right, 0.0, on)
    if reading.sensor == Sensor.FLOW_RATE:
        forward, right = metric_flow(value[0], value[1], value[2], value[3], range_m)
        if reason == FUSED and not np.isfinite(forward + right):
            reason = NOT_FINITE
        elif reason == FUSED and not known:
            reason = NO_HEIGHT
        elif reason == FUSED and max(abs(value[0]), abs(value[1])) > settings.flow_limit_rad_s:
            reason = OUT_OF_RANGE
    if reason == FUSED and upright < np.cos(settings.tilt_limit_rad):
        reason = TILTED
    components = 3 if reading.sensor == Sensor.FLOW_VELOCITY and np.isfinite(value[2]) else 2
    tested = False
    for axis in range(components):
        velocity = forward if axis == 0 else (right if axis == 1 else value[2])
        noise = reading.variance[axis] if reading.sensor == Sensor.FLOW_VELOCITY else np.nan
        modelled = np.isnan(noise)
        if modelled:
            model = flow_velocity_variance(range_m, noise_of_range, velocity, reading.quality, settings)
            noise = memory[FLOW_EXCESS] * model
        outcome = offer_body_velocity(reading, axis, velocity, noise, reason, on)
        if modelled and (outcome == FUSED or outcome == INNOVATION_GATE):  # noqa: SIM109
            learn_flow_noise(reading.t_s, on)
            tested = True
    if tested:
        memory[FLOW_CLOCK] = reading.t_s


@kernel
def learn_flow_noise(t_s: float, on: Running) -> None:
    """Follow how many times noisier than its model the flow is: the mean of (nu^2 - h P h') / R, at least 1.

    A poor lens or floor shows in the innovations; the model alone would take its noise for motion and gate the
    rest away.
    """
    memory, kalman = on.memory, ROWS.kalman
    noise, total = on.work[kalman.noise], on.work[kalman.innovation_variance]
    square = min(on.work[kalman.innovation] ** 2, on.settings.gate_sigma**2 * total)
    found = (square - (total - noise)) * memory[FLOW_EXCESS] / noise
    share = min(max(t_s - memory[FLOW_CLOCK], 0.0), LONGEST_STEP_S) / on.settings.flow_noise_time_s
    followed = memory[FLOW_EXCESS] + 0.5 * share * (found - memory[FLOW_EXCESS])
    memory[FLOW_EXCESS] = min(max(followed, 1.0), LARGEST_EXCESS)


@kernel
def take_range(reading: Reading, on: Running) -> None:
    """Height over flat ground: p_d = ground - r cos(tilt). Where range is rejected for long, the ground has a step."""
    t_s, memory, settings = reading.t_s, on.memory, on.settings
    range_m, noise = reading.value[0], reading.variance[0]
    upright = rotation_of(on.work, ONE_LANE, ROWS, 0)[8]
    if np.isnan(noise):
        noise = range_variance(range_m, settings)
    reason = usable(reading.quality, range_m, noise, on)
    if reason == FUSED and not settings.range_min_m <= range_m <= settings.range_max_m:
        reason = OUT_OF_RANGE
    if reason == FUSED and upright < np.cos(settings.tilt_limit_rad):
        reason = TILTED
    below = on.work[STATE + 2] + range_m * upright
    if reason == FUSED and np.isnan(memory[GROUND]):
        memory[GROUND] = below
        reason = DATUM
        write_event(t_s, GROUND_SET, below, on.tape)
    reason = offer_state(reading, ONLY, DOWN, memory[GROUND] - range_m * upright, noise, reason, on)
    if reason == FUSED or reason == DATUM:  # noqa: SIM109
        memory[RANGE_CLOCK], memory[RANGE_SINCE] = t_s, np.nan
    elif reason == INNOVATION_GATE:
        if np.isnan(memory[RANGE_SINCE]):
            memory[RANGE_SINCE] = t_s
        if t_s - memory[RANGE_SINCE] >= settings.ground_reset_s:
            memory[GROUND], memory[RANGE_CLOCK], memory[RANGE_SINCE] = below, t_s, np.nan
            write_event(t_s, GROUND_RESET, below, on.tape)


@kernel
def take_baro(reading: Reading, on: Running) -> None:
    """Height from pressure: p_d = offset - altitude; the offset follows the rest of the filter slowly."""
    t_s, memory, settings = reading.t_s, on.memory, on.settings
    altitude_m, noise = reading.value[0], reading.variance[0]
    if np.isnan(noise):
        noise = settings.baro_sigma_m * settings.baro_sigma_m
    reason = usable(reading.quality, altitude_m, noise, on)
    if reason == FUSED and np.isnan(memory[BARO_OFFSET]):
        memory[BARO_OFFSET], memory[BARO_CLOCK] = altitude_m + on.work[STATE + 2], t_s
        reason = DATUM
        write_event(t_s, BARO_SET, memory[BARO_OFFSET], on.tape)
    reason = offer_state(reading, ONLY, DOWN, memory[BARO_OFFSET] - altitude_m, noise, reason, on)
    if reason == FUSED:
        share = min((t_s - memory[BARO_CLOCK]) / settings.baro_drift_time_s, 1.0)
        memory[BARO_OFFSET] -= share * on.work[ROWS.kalman.innovation]
        memory[BARO_CLOCK] = t_s


# -- one component -----------------------------------------------------------------------------------------
@kernel
def usable(quality: float, value: float, variance: float, on: Running) -> int:
    """FUSED where a reading may be offered, or the reason why not."""
    reason = FUSED
    if on.memory[STARTED] == 0.0:
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
    reading: Reading, component: Any, index: Any, value: float, variance: float, reason: int, on: Running
) -> int:
    """Offer a reading of state `index`; what became of it."""
    put(value, variance, reason, on)
    observe_state(on.work, ONE_LANE, ROWS, index, OFFERED, OFFERED + 1, OFFERED + 2)
    return conclude(reading, component, reason, on)


@kernel
def offer_body_velocity(
    reading: Reading, component: int, value: float, variance: float, reason: int, on: Running
) -> int:
    """Offer a component of body velocity; what became of it."""
    put(value, variance, reason, on)
    observe_body_velocity(on.work, ONE_LANE, ROWS, component, OFFERED, OFFERED + 1, OFFERED + 2)
    return conclude(reading, component, reason, on)


@kernel
def put(value: float, variance: float, reason: int, on: Running) -> None:
    """A component into the rows from which the filter takes it."""
    on.work[OFFERED], on.work[OFFERED + 1] = value, variance
    on.work[OFFERED + 2] = 1.0 if reason == FUSED else 0.0


@kernel
def conclude(reading: Reading, component: int, reason: int, on: Running) -> int:
    """Test, fuse and write down the component that stands in the observation rows."""
    fresh = reading.t_s - on.memory[IMU_CLOCK] <= on.settings.stale_s
    correct(on.work, ONE_LANE, ROWS, on.settings, 1.0 / on.settings.trim_time_s if fresh else 0.0)
    if reason == FUSED and on.work[ROWS.kalman.accepted] == 0.0:
        reason = INNOVATION_GATE
    write_offer(reading, component, reason, on)
    return reason
