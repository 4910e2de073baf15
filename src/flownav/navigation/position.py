"""Position and velocity readings: GPS, an external pose, the pad, and a vehicle on the ground."""

from __future__ import annotations

import numpy as np

from flownav.compile import ONE_LANE, procedure
from flownav.estimation.landing.algebra import settle
from flownav.estimation.landing.observe import (
    GPS_POSITION_STATES,
    GPS_VELOCITY_STATES,
    STATE_ITSELF,
    observe_gps_position,
    observe_gps_velocity,
    observe_state,
    rotation_of,
)
from flownav.estimation.landing.observe_pad import PAD_STATES, observe_pad
from flownav.estimation.landing.states import GPS_FAST, GPS_SLOW, GPS_VELOCITY, POSITION, VELOCITY
from flownav.frames import to_earth
from flownav.measurement import Sensor
from flownav.navigation.journal import reset_state
from flownav.navigation.offers import (
    BEFORE_START,
    DATUM,
    FUSED,
    INNOVATION_GATE,
    OUT_OF_RANGE,
    conclude,
    note_aid,
    put,
    usable,
)
from flownav.navigation.state import (
    COUNT,
    GPS_RESET,
    HEIGHT_CLOCK,
    LANDED,
    PAD,
    PAD_FOUND,
    ROWS,
    SINCE,
    STARTED,
    VALUE,
    Reading,
    Running,
    write_event,
)

LEAST_REJECTIONS = 5
LEAST_PAD_DISTANCE_M = 0.05


@procedure
def take_gps(reading: Reading, on: Running) -> None:
    """Position or velocity, axis by axis, with its Gauss-Markov errors; where it is rejected for long, a reset."""
    work = on.work
    position = reading.sensor == Sensor.GPS_POSITION
    fused, level = False, level_agrees(reading, on)
    for axis in range(3):
        noise = gps_noise(reading, axis, on)
        reason = usable(reading.quality, reading.value[axis], noise, on)
        if reason == FUSED and axis < 2 and not level:
            reason = INNOVATION_GATE
        work[VALUE] = reading.value[axis]
        if position:
            observe_gps_position(work, ONE_LANE, ROWS, axis, VALUE, 0.0)
            put(noise, reason, GPS_POSITION_STATES[axis], on.work)
            reason = conclude(reading, axis, reading.value[axis], reason, on)
        else:
            observe_gps_velocity(work, ONE_LANE, ROWS, axis, VALUE, 0.0)
            put(noise, reason, GPS_VELOCITY_STATES[axis], on.work)
            reason = conclude(reading, axis, reading.value[axis], reason, on)
        fused = fused or (reason == FUSED and axis < 2)
        if reason == FUSED and position and axis == 2:
            on.memory[HEIGHT_CLOCK] = reading.t_s
        beside = reason == INNOVATION_GATE and not work[ROWS.test_ratio] > 1.0  # refused for the other axis alone
        mind_rejections(reading, axis, FUSED if beside else reason, noise, on)
    if fused:
        note_aid(reading.t_s, on)


@procedure
def gps_noise(reading: Reading, axis: int, on: Running) -> float:
    """Variance of what changes from fix to fix."""
    settings, stated = on.settings, reading.variance[axis]
    if reading.sensor == Sensor.GPS_POSITION:
        white = settings.gps_white_sigma_down_m if axis == 2 else settings.gps_white_sigma_m
    else:
        white = settings.gps_velocity_white_down_m_s if axis == 2 else settings.gps_velocity_white_m_s
    share = settings.gps_white_share * settings.gps_white_share * (0.0 if np.isnan(stated) else stated)
    return white * white + share


@procedure
def level_agrees(reading: Reading, on: Running) -> bool:
    """Whether north and east both pass the gate: they come of one fix, and a jump along one axis spoils both."""
    work, agrees = on.work, True
    if on.memory[STARTED] == 0.0:
        return agrees
    for axis in range(2):
        work[VALUE] = reading.value[axis]
        noise = gps_noise(reading, axis, on)
        if reading.sensor == Sensor.GPS_POSITION:
            observe_gps_position(work, ONE_LANE, ROWS, axis, VALUE, 0.0)
            put(noise, INNOVATION_GATE, GPS_POSITION_STATES[axis], work)
        else:
            observe_gps_velocity(work, ONE_LANE, ROWS, axis, VALUE, 0.0)
            put(noise, INNOVATION_GATE, GPS_VELOCITY_STATES[axis], work)
        settle(work, ONE_LANE, ROWS, on.settings.filter.gate_sigma)
        agrees = agrees and not work[ROWS.test_ratio] > 1.0
    return agrees


@procedure
def mind_rejections(reading: Reading, axis: int, reason: int, noise: float, on: Running) -> None:
    """Where GPS has been rejected again and again for a state, the filter is wrong: that state goes to GPS."""
    work, memory = on.work, on.memory
    first = 0 if reading.sensor == Sensor.GPS_POSITION else 3
    place = first + axis
    if reason != INNOVATION_GATE:
        memory[COUNT + place] = 0.0
        return
    if memory[COUNT + place] == 0.0:
        memory[SINCE + place] = reading.t_s
    memory[COUNT + place] += 1.0
    if memory[COUNT + place] < LEAST_REJECTIONS or reading.t_s - memory[SINCE + place] < on.settings.gps_reset_s:
        return
    before = work[ROWS.state + place]
    settings = on.settings.filter
    if first == 0:
        slow = settings.gps_slow_sigma_down_m if axis == 2 else settings.gps_slow_sigma_m
        fast = settings.gps_fast_sigma_down_m if axis == 2 else settings.gps_fast_sigma_m
        work[ROWS.state + GPS_SLOW + axis], work[ROWS.state + GPS_FAST + axis] = 0.0, 0.0
        reset_state(GPS_SLOW + axis, slow * slow, on)
        reset_state(GPS_FAST + axis, fast * fast, on)
        reset_state(POSITION + axis, slow * slow + fast * fast + noise, on)
    else:
        lasting = settings.gps_velocity_sigma_m_s
        work[ROWS.state + GPS_VELOCITY + axis] = 0.0
        reset_state(GPS_VELOCITY + axis, lasting * lasting, on)
        reset_state(VELOCITY + axis, lasting * lasting + noise, on)
    work[ROWS.state + place] = reading.value[axis]
    memory[COUNT + place] = 0.0
    write_event(reading.t_s, GPS_RESET, reading.value[axis] - before, on.tape)


@procedure
def take_pose(reading: Reading, on: Running) -> None:
    """An external position in the local frame."""
    for axis in range(3):
        noise = reading.variance[axis]
        if np.isnan(noise):
            noise = on.settings.pose_sigma_m * on.settings.pose_sigma_m
        reason = usable(reading.quality, reading.value[axis], noise, on)
        on.work[VALUE] = reading.value[axis]
        observe_state(on.work, ONE_LANE, ROWS, POSITION + axis, VALUE)
        put(noise, reason, STATE_ITSELF[POSITION + axis], on.work)
        reason = conclude(reading, axis, reading.value[axis], reason, on)
        if reason == FUSED and axis < 2:
            note_aid(reading.t_s, on)
        elif reason == FUSED:
            on.memory[HEIGHT_CLOCK] = reading.t_s


@procedure
def take_pad(reading: Reading, on: Running) -> None:
    """The pad: the first fix says where it lies; every later one tells the vehicle's place from it."""
    work, memory, value = on.work, on.memory, reading.value
    distance = value[2]
    noise = on.settings.pad_angle_sigma_rad
    reason = usable(reading.quality, value[0] + value[1] + distance, noise, on)
    if reason == FUSED and distance < LEAST_PAD_DISTANCE_M:
        reason = OUT_OF_RANGE
    if reason == BEFORE_START or memory[STARTED] == 0.0:
        return
    if reason == FUSED and np.isnan(memory[PAD]):
        find_pad(reading, on)
        reason = DATUM
    for i in range(3):
        work[VALUE + i] = value[i]
    shift(on, -1.0)
    for component in range(3):
        stated = reading.variance[component]
        sigma = on.settings.pad_distance_sigma if component == 2 else on.settings.pad_angle_sigma_rad
        spread = sigma * distance
        observe_pad(work, ONE_LANE, ROWS, component, VALUE, on.settings.flow_below_m)
        put(spread * spread if np.isnan(stated) else stated, reason, PAD_STATES, on.work)
        outcome = conclude(reading, component, value[component], reason, on)
        if outcome == FUSED:
            memory[HEIGHT_CLOCK] = reading.t_s
            note_aid(reading.t_s, on)
    shift(on, 1.0)


@procedure
def find_pad(reading: Reading, on: Running) -> None:
    """Where this fix puts the pad in the local frame, by the filter's own place."""
    work, memory, value = on.work, on.memory, reading.value
    rotation = rotation_of(work, ONE_LANE, ROWS, 0)
    depth = value[2] / np.sqrt(value[0] * value[0] + value[1] * value[1] + 1.0)
    off = to_earth(rotation, value[0] * depth, value[1] * depth, depth + on.settings.flow_below_m)
    total = 0.0
    for i in range(3):
        memory[PAD + i] = work[ROWS.state + POSITION + i] + off[i]
        total += memory[PAD + i] * memory[PAD + i]
    write_event(reading.t_s, PAD_FOUND, np.sqrt(total), on.tape)


@procedure
def shift(on: Running, sign: float) -> None:
    """Position counted from the pad (-1), and back from the local origin (1)."""
    for i in range(3):
        place = on.memory[PAD + i]
        on.work[ROWS.state + POSITION + i] += sign * place if np.isfinite(place) else 0.0


@procedure
def take_landed(reading: Reading, on: Running) -> None:
    """On the ground: no velocity."""
    on.memory[LANDED] = reading.value[0]
    on.work[VALUE] = 0.0
    for axis in range(3):
        noise = on.settings.still_sigma_m_s * on.settings.still_sigma_m_s
        reason = usable(reading.quality if reading.value[0] > 0.5 else 0.0, reading.value[0], noise, on)
        observe_state(on.work, ONE_LANE, ROWS, VELOCITY + axis, VALUE)
        put(noise, reason, STATE_ITSELF[VELOCITY + axis], on.work)
        conclude_still(reading, axis, reason, on)


@procedure
def conclude_still(reading: Reading, axis: int, reason: int, on: Running) -> None:
    """A zero velocity is written down where it was offered; in flight there is nothing to say."""
    if reading.value[0] > 0.5:
        reason = conclude(reading, axis, 0.0, reason, on)
        if reason == FUSED:
            note_aid(reading.t_s, on)
