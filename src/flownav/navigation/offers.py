"""Offering one component to the filter: checks common to all sensors, the test, and what is written of it."""

from __future__ import annotations

import numpy as np

from flownav.compile import ONE_LANE, procedure
from flownav.estimation.gating import Reason
from flownav.estimation.landing.algebra import expect, settle
from flownav.measurement import Array, Sensor
from flownav.navigation.journal import note_correction
from flownav.navigation.state import (
    AIDED,
    AIDED_AGAIN,
    CLOCK,
    DEAD_RECKONING,
    FLAG,
    LAST,
    OBSERVED,
    POSITION_INVALID,
    ROWS,
    STARTED,
    Reading,
    Running,
    write_event,
    write_offer,
)

(FUSED, INNOVATION_GATE, NO_DATA, NOT_FINITE, OUT_OF_RANGE, NO_HEIGHT, TILTED, BEFORE_START, DATUM, OUTAGE,
 DUPLICATE, LATE, STUCK, NEAR_GROUND, NOT_NEEDED, AHEAD) = map(int, Reason)  # fmt: skip
CLOCK_SLACK_S = 1e-6


@procedure
def too_old(reading: Reading, on: Running) -> bool:
    """Whether the reading repeats or precedes one of its sensor, or describes what the filter has left behind."""
    memory, sensor = on.memory, reading.sensor
    reason = FUSED
    if not np.isfinite(reading.t_s):
        reason = NOT_FINITE
    elif reading.t_s <= memory[LAST + sensor]:
        reason = DUPLICATE
    elif memory[STARTED] > 0.0 and reading.t_s < memory[CLOCK] - CLOCK_SLACK_S:
        reason = LATE
    if reason == FUSED:
        memory[LAST + sensor] = reading.t_s
        return False
    if sensor != Sensor.IMU:
        write_offer(reading, 0, reading.value[0], reason, on)
    return True


@procedure
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


@procedure
def put(variance: float, reason: int, index: tuple[int, ...], work: Array) -> None:
    """The variance of the component whose law stands in the observation rows, and whether it may be fused.

    `index` are the law's states; this is the only part of a correction that their number compiles anew.
    """
    work[ROWS.noise] = variance
    work[ROWS.offered] = 1.0 if reason == FUSED else 0.0
    work[OBSERVED] = len(index)
    for i in range(len(index)):
        work[OBSERVED + 1 + i] = index[i]
    expect(work, ONE_LANE, ROWS, index)


@procedure
def conclude(reading: Reading, component: int, observation: float, reason: int, on: Running) -> int:
    """Test, fuse and write down the component that was put; what became of it."""
    settle(on.work, ONE_LANE, ROWS, on.settings.filter.gate_sigma)
    if reason == FUSED and on.work[ROWS.accepted] == 0.0:
        reason = INNOVATION_GATE
    if on.work[ROWS.accepted] > 0.0:
        note_correction(on)
    write_offer(reading, component, observation, reason, on)
    return reason


# -- horizontal aid ---------------------------------------------------------------------------------------
@procedure
def note_aid(t_s: float, on: Running) -> None:
    """Something horizontal was fused."""
    memory = on.memory
    if memory[FLAG] > 0.0:
        write_event(t_s, AIDED_AGAIN, t_s - memory[AIDED], on.tape)
    memory[AIDED], memory[FLAG] = t_s, 0.0


@procedure
def note_aid_age(t_s: float, on: Running) -> None:
    """Flag dead reckoning, and then an invalid position, when no horizontal aid has been fused for long."""
    memory, settings = on.memory, on.settings
    age_s = t_s - memory[AIDED]
    if memory[FLAG] == 0.0 and age_s > settings.dead_reckoning_s:
        memory[FLAG] = 1.0
        write_event(t_s, DEAD_RECKONING, age_s, on.tape)
    if memory[FLAG] == 1.0 and age_s > settings.invalid_s:
        memory[FLAG] = 2.0
        write_event(t_s, POSITION_INVALID, age_s, on.tape)
