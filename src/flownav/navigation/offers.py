"""Offering one component to the filter on lanes: checks common to all sensors, the test, and what is written of it."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, procedure
from flownav.estimation.covariance import expect, settle, states_of
from flownav.estimation.hypotheses import weigh
from flownav.estimation.states import ACCEPTED, MEASURED, NOISE, OFFERED
from flownav.measurement import Sensor
from flownav.navigation.journal import note_correction
from flownav.navigation.memory import CLOCK, LAST, OBSERVATION, REASON, load_aid, load_reading, share, shared, store_aid
from flownav.navigation.reasons import (
    BEFORE_START,
    DUPLICATE,
    FUSED,
    INNOVATION_GATE,
    LATE,
    NO_DATA,
    NOT_FINITE,
    OUTAGE,
    SILENT,
)
from flownav.navigation.records import AidMemory, Reading
from flownav.navigation.tape import (
    AIDED_AGAIN,
    DEAD_RECKONING,
    POSITION_INVALID,
    Output,
    write_event,
    write_offer,
)
from flownav.navigation.told import AidSettings

CLOCK_SLACK_S = 1e-6
COLOR = 4.0  # so many readings after one another err alike


# -- checks -----------------------------------------------------------------------------------------------
@equation
def is_heard(reading: Reading) -> bool:
    """Whether a reading is there for one who only listens: it arrived, has data and is not withheld."""
    return reading.arrived > 0.0 and reading.quality > 0.0 and reading.withheld == 0.0


@equation
def usable(reading: Reading, value: float, variance: float, started: float) -> int:
    """FUSED where a reading may be offered, or the reason why not; SILENT where there is none."""
    reason = FUSED if np.isfinite(value + variance) else NOT_FINITE
    reason = NO_DATA if reading.quality == 0.0 else reason
    reason = OUTAGE if reading.withheld > 0.0 else reason
    reason = BEFORE_START if started == 0.0 else reason
    return SILENT if reading.arrived == 0.0 else reason


@equation
def usable_in_flight(reading: Reading, value: float, variance: float, started: float) -> int:
    """The same, of a sensor of which nothing is said before the start."""
    return SILENT if started == 0.0 else usable(reading, value, variance, started)


@procedure
def too_old(work: Work, lanes: Lanes, t_s: float, sensor: int, o: Output) -> bool:
    """Whether the reading repeats or precedes one of its sensor, or describes what the filter has left behind.

    The schedule is the same in all lanes, so one answer holds for all.
    """
    reason = FUSED
    if not np.isfinite(t_s):
        reason = NOT_FINITE
    elif t_s <= shared(work, lanes, LAST + sensor):
        reason = DUPLICATE
    elif t_s < shared(work, lanes, CLOCK) - CLOCK_SLACK_S:
        reason = LATE
    if reason == FUSED:
        share(work, lanes, LAST + sensor, t_s)
        return False
    if sensor != Sensor.IMU:
        for lane in range(len(lanes)):
            reading = load_reading(work, lanes, lane)
            work[REASON * len(lanes) + lane] = reason if reading.arrived > 0.0 else SILENT
            work[OBSERVATION * len(lanes) + lane] = reading.value_0
            work[NOISE * len(lanes) + lane] = np.nan
        write_offer(work, lanes, t_s, sensor, 0, o)
    return True


# -- one component ----------------------------------------------------------------------------------------
@equation
def put(work: Work, lanes: Lanes, lane: int, measured: float, variance: float, reason: int) -> None:
    """One lane's measured value, variance and verdict; a law and `conclude` follow."""
    work[MEASURED * len(lanes) + lane] = measured
    work[OBSERVATION * len(lanes) + lane] = measured
    work[NOISE * len(lanes) + lane] = variance
    work[REASON * len(lanes) + lane] = reason


@procedure
def conclude(work: Work, lanes: Lanes, t_s: float, sensor: int, component: int, gate_sigma: float, o: Output) -> None:
    """Test, fuse and write down the component whose law stands in the observation rows; REASON says what became of it.

    What no lane offers corrects nothing and costs nothing, and its innovation is computed for the tape alone.
    """
    fuse_offered(work, lanes, gate_sigma, o)
    write_offer(work, lanes, t_s, sensor, component, o)


@procedure
def fuse_offered(work: Work, lanes: Lanes, gate_sigma: float, o: Output) -> None:
    """Test and fuse the component in the lanes whose REASON is FUSED; INNOVATION_GATE where it does not pass."""
    for lane in range(len(lanes)):
        work[OFFERED * len(lanes) + lane] = 1.0 if work[REASON * len(lanes) + lane] == FUSED else 0.0
    expect(work, lanes, states_of(lanes), o.room[1] > 0)
    settle(work, lanes, states_of(lanes), gate_sigma)
    weigh(work, lanes, states_of(lanes), COLOR)
    for lane in range(len(lanes)):
        reason = work[REASON * len(lanes) + lane]
        refused = reason == FUSED and work[ACCEPTED * len(lanes) + lane] == 0.0
        work[REASON * len(lanes) + lane] = INNOVATION_GATE if refused else reason
    if len(lanes) == 1 and work[ACCEPTED] > 0.0:
        note_correction(work, lanes, o)


# -- horizontal aid ---------------------------------------------------------------------------------------
@procedure
def note_aid(work: Work, lanes: Lanes, t_s: float, o: Output) -> None:
    """Something horizontal was fused in the lanes whose REASON is FUSED."""
    for lane in range(len(lanes)):
        if work[REASON * len(lanes) + lane] == FUSED:
            aid = load_aid(work, lanes, lane)
            if aid.flag > 0.0:
                write_event(lanes, lane, t_s, AIDED_AGAIN, t_s - aid.aided_s, o)
            store_aid(work, lanes, lane, AidMemory(t_s, 0.0, aid.height_s, aid.landed))


@procedure
def note_height(work: Work, lanes: Lanes, t_s: float) -> None:
    """Something other than the range told the height in the lanes whose REASON is FUSED."""
    for lane in range(len(lanes)):
        aid = load_aid(work, lanes, lane)
        told = work[REASON * len(lanes) + lane] == FUSED
        height_s = t_s if told else aid.height_s
        store_aid(work, lanes, lane, AidMemory(aid.aided_s, aid.flag, height_s, aid.landed))


@procedure
def note_aid_age(work: Work, lanes: Lanes, t_s: float, s: AidSettings, o: Output) -> None:
    """Flag dead reckoning, and then an invalid position, where no horizontal aid has been fused for long."""
    for lane in range(len(lanes)):
        aid = load_aid(work, lanes, lane)
        age_s = t_s - aid.aided_s  # NaN before the start: no flag
        flag = aid.flag
        if flag == 0.0 and age_s > s.dead_reckoning_s:
            flag = 1.0
            write_event(lanes, lane, t_s, DEAD_RECKONING, age_s, o)
        if flag == 1.0 and age_s > s.invalid_s:
            flag = 2.0
            write_event(lanes, lane, t_s, POSITION_INVALID, age_s, o)
        store_aid(work, lanes, lane, AidMemory(aid.aided_s, flag, aid.height_s, aid.landed))
