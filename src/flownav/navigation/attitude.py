"""Attitude and heading readings: an external attitude where there is no IMU, a magnetometer, an external heading."""

from __future__ import annotations

import numpy as np

from flownav.compile import ONE_LANE, procedure
from flownav.estimation.landing.observe import (
    ATTITUDE_STATES,
    HEADING_STATES,
    observe_attitude,
    observe_heading,
    rotation_of,
)
from flownav.estimation.landing.states import ATTITUDE, INS_ERROR, STATES
from flownav.frames import quaternion_product, to_earth
from flownav.navigation.offers import FUSED, NOT_FINITE, conclude, put, usable
from flownav.navigation.state import (
    FROM_ATTITUDE,
    FROM_MAG,
    GAP,
    HEADING_CLOCK,
    MAG_HEADING,
    OWN_BEFORE,
    READ_BEFORE,
    ROWS,
    SPREAD_BEFORE,
    STARTED,
    USE_ATTITUDE,
    USE_HEADING,
    VALUE,
    Reading,
    Running,
)

LEAST_FIELD_GAUSS = 1e-3
BRIDGE_SIGMA_RAD = 0.02


@procedure
def take_attitude(reading: Reading, on: Running) -> None:
    """An autopilot's or INS's attitude: all of it where no IMU serves, its heading where nothing else gives one."""
    value, memory, work = reading.value, on.memory, on.work
    if memory[STARTED] == 0.0:
        return
    size = np.sqrt(value[0] ** 2 + value[1] ** 2 + value[2] ** 2 + value[3] ** 2)
    reason = usable(reading.quality, size, 0.0, on)
    if reason == FUSED and not 0.5 < size < 2.0:
        reason = NOT_FINITE
    if reason != FUSED:
        return
    for i in range(4):
        work[VALUE + i] = value[i] / size
    if memory[USE_ATTITUDE] > 0.0:
        for axis in range(3):
            sigma = on.settings.ins_tilt_white_rad
            observe_attitude(work, ONE_LANE, ROWS, axis, VALUE, 0.0)
            observation = work[ROWS.innovation]
            put(sigma * sigma, reason, ATTITUDE_STATES[axis], on.work)
            conclude(reading, axis, observation, reason, on)
        return
    bridge(reading, on)
    if memory[USE_HEADING] == FROM_ATTITUDE:
        w, x, y, z = work[VALUE], work[VALUE + 1], work[VALUE + 2], work[VALUE + 3]
        heading = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
        offer_heading(reading, heading, heading_variance(reading.t_s, on), reason, on)


@procedure
def bridge(reading: Reading, on: Running) -> None:
    """Across a gap of the IMU the filter turns as the logged attitude did: q_before conj(read_before) read, measured.

    Its variance is what the filter's was before the gap, and BRIDGE_SIGMA_RAD for the time between the two logs.
    """
    memory, work = on.memory, on.work
    if memory[GAP] == 0.0:
        for i in range(4):
            memory[OWN_BEFORE + i], memory[READ_BEFORE + i] = work[ROWS.attitude + i], work[VALUE + i]
        for i in range(3):
            memory[SPREAD_BEFORE + i] = work[ROWS.covariance + (ATTITUDE + i) * (STATES + 1)]
        return
    memory[GAP] = 0.0
    if not np.isfinite(memory[OWN_BEFORE]):
        return
    read = (work[VALUE], work[VALUE + 1], work[VALUE + 2], work[VALUE + 3])
    own = (memory[OWN_BEFORE], memory[OWN_BEFORE + 1], memory[OWN_BEFORE + 2], memory[OWN_BEFORE + 3])
    back = (memory[READ_BEFORE], -memory[READ_BEFORE + 1], -memory[READ_BEFORE + 2], -memory[READ_BEFORE + 3])
    turned = quaternion_product(own, quaternion_product(back, read))
    saved = (work[VALUE], work[VALUE + 1], work[VALUE + 2], work[VALUE + 3])
    for i in range(4):
        work[VALUE + i] = turned[i]
    for axis in range(3):
        observe_attitude(work, ONE_LANE, ROWS, axis, VALUE, 0.0)
        error = ROWS.state + INS_ERROR
        turn = work[ROWS.innovation]
        for k in range(3):  # the bridge has no slow error of its own
            turn += work[ROWS.coefficient + 1 + k] * work[error + k]
            work[ROWS.coefficient + 1 + k] = 0.0
        work[ROWS.innovation] = turn
        put(memory[SPREAD_BEFORE + axis] + BRIDGE_SIGMA_RAD**2, FUSED, ATTITUDE_STATES[axis], on.work)
        conclude(reading, axis, turn, FUSED, on)
    for i in range(4):
        work[VALUE + i] = saved[i]


@procedure
def magnetic_heading(on: Running) -> float:
    """The heading that the latest magnetometer reading and the filter's tilt give, from magnetic north [rad]."""
    rotation = rotation_of(on.work, ONE_LANE, ROWS, 0)
    heading: float = np.arctan2(rotation[3], rotation[0]) - on.memory[MAG_HEADING]
    return heading


@procedure
def heading_variance(t_s: float, on: Running) -> float:
    """Variance of one heading [rad2] whose error lasts for many: 2 sigma^2 tau/dt, at least sigma^2."""
    settings, memory = on.settings, on.memory
    step_s = max(t_s - memory[HEADING_CLOCK], 1e-3)
    memory[HEADING_CLOCK] = t_s
    variance: float = settings.heading_noise_rad**2 * max(1.0, 2.0 * settings.heading_time_s / step_s)
    return variance


@procedure
def take_mag(reading: Reading, on: Running) -> None:
    """A magnetometer: the level field points to magnetic north; the declination is part of the heading error state."""
    value, memory = reading.value, on.memory
    if memory[USE_HEADING] != FROM_MAG:
        return
    rotation = rotation_of(on.work, ONE_LANE, ROWS, 0)
    north, east, _ = to_earth(rotation, value[0], value[1], value[2])
    field = np.sqrt(north * north + east * east)
    reason = usable(reading.quality, field, 0.0, on)
    if not field > LEAST_FIELD_GAUSS:
        return
    memory[MAG_HEADING] = np.arctan2(east, north)
    if memory[STARTED] > 0.0:
        offer_heading(reading, magnetic_heading(on), heading_variance(reading.t_s, on), reason, on)


@procedure
def take_yaw(reading: Reading, on: Running) -> None:
    """An external heading."""
    variance = reading.variance[0]
    if np.isnan(variance):
        variance = heading_variance(reading.t_s, on)
    reason = usable(reading.quality, reading.value[0], variance, on)
    if on.memory[STARTED] > 0.0:
        offer_heading(reading, reading.value[0], variance, reason, on)


@procedure
def offer_heading(reading: Reading, heading_rad: float, variance: float, reason: int, on: Running) -> None:
    """A heading, with its slow error as a state."""
    on.work[VALUE] = heading_rad
    observe_heading(on.work, ONE_LANE, ROWS, VALUE)
    put(variance, reason, HEADING_STATES, on.work)
    conclude(reading, 0, heading_rad, reason, on)
