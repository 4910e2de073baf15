"""Offering one component to the filter on lanes: checks common to all sensors, the test, and what is written of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.compile import Lanes, Work, equation, procedure, replacing
from flownav.estimation.covariance import expect, settle, states_of
from flownav.estimation.hypotheses import weigh
from flownav.estimation.states import ACCEPTED, MEASURED, NOISE
from flownav.measurement import Sensor
from flownav.navigation.journal import note_correction
from flownav.navigation.memory import CLOCK, LAST, OBSERVATION, REASON, share, shared
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
from flownav.navigation.tape import AIDED_AGAIN, DEAD_RECKONING, POSITION_INVALID, Output, write_offer
from flownav.navigation.told import AidSettings
from flownav.navigation.verdicts import Accepted, Event, Fate, Noise, Observation, Offered, Tested, on_lanes

CLOCK_SLACK_S = 1e-6
COLOR = 4.0  # so many readings after one another err alike

with_aid = replacing(AidMemory, "aided_s", "flag")
with_flag = replacing(AidMemory, "flag")
with_height = replacing(AidMemory, "height_s")


# -- checks -----------------------------------------------------------------------------------------------
@equation
def is_heard(reading: Reading) -> bool:
    """Whether a reading is there for one who only listens: it arrived, has data and is not withheld."""
    return reading.arrived > 0.0 and reading.quality > 0.0 and reading.withheld == 0.0


@equation
def component_of(reading: Reading, component: int) -> tuple[float, float]:
    """A reading's value and stated variance of component 0, 1 or 2."""
    value = reading.value_0 if component == 0 else (reading.value_1 if component == 1 else reading.value_2)
    stated = reading.variance_0 if component == 0 else (reading.variance_1 if component == 1 else reading.variance_2)
    return value, stated


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
    """What `usable` says, of a sensor of which nothing is said before the start."""
    return SILENT if started == 0.0 else usable(reading, value, variance, started)


class LeftBehind(NamedTuple):
    """What is written down of a reading that comes too late to be taken."""

    fate: Fate
    observation: Observation
    noise: Noise


@on_lanes
def leave_behind(reading: Reading, *, reason: int) -> LeftBehind:
    """Nothing of the reading but that it came, and why it is not taken."""
    return LeftBehind(Fate(reason if reading.arrived > 0.0 else SILENT), Observation(reading.value_0), Noise(np.nan))


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
        leave_behind(work, lanes, reason)
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


@on_lanes
def observe_innovation(tested: Tested) -> Observation:
    """The difference that a law finds is what is written down of an attitude."""
    return Observation(tested.innovation)


@procedure
def conclude(work: Work, lanes: Lanes, t_s: float, sensor: int, component: int, gate_sigma: float, o: Output) -> None:
    """Test, fuse and write down the component whose law stands in the observation rows; REASON says what became of it.

    What no lane offers corrects nothing and costs nothing, and its innovation is computed for the tape alone.
    """
    fuse_offered(work, lanes, gate_sigma, o)
    write_offer(work, lanes, t_s, sensor, component, o)


@on_lanes
def offer_what_is_sound(fate: Fate) -> Offered:
    """Offered to the filter where the judge found nothing against it."""
    return Offered(1.0 if fate.reason == FUSED else 0.0)


@on_lanes
def note_refusal(fate: Fate, tested: Accepted) -> Fate:
    """INNOVATION_GATE where what was offered was not fused."""
    return Fate(INNOVATION_GATE if fate.reason == FUSED and tested.accepted == 0.0 else fate.reason)


@procedure
def fuse_offered(work: Work, lanes: Lanes, gate_sigma: float, o: Output) -> None:
    """Test and fuse the component in the lanes whose REASON is FUSED; INNOVATION_GATE where it does not pass."""
    offer_what_is_sound(work, lanes)
    expect(work, lanes, states_of(lanes), o.room[1] > 0)
    settle(work, lanes, states_of(lanes), gate_sigma)
    weigh(work, lanes, states_of(lanes), COLOR)
    note_refusal(work, lanes)
    if len(lanes) == 1 and shared(work, lanes, ACCEPTED) > 0.0:
        note_correction(work, lanes, o)


# -- horizontal aid ---------------------------------------------------------------------------------------
class Aided(NamedTuple):
    """The aid at hand noted, and that the position is told again."""

    aid: AidMemory
    again: Event


@on_lanes
def note_aid(fate: Fate, aid: AidMemory, *, t_s: float) -> Aided:
    """Something horizontal was fused in the lanes whose reason is FUSED."""
    fused = fate.reason == FUSED
    again = Event(AIDED_AGAIN if fused and aid.flag > 0.0 else -1, t_s - aid.aided_s)
    return Aided(with_aid(aid, aided_s=t_s, flag=0.0) if fused else aid, again)


@on_lanes
def note_height(fate: Fate, aid: AidMemory, *, t_s: float) -> AidMemory:
    """Something other than the range told the height in the lanes whose reason is FUSED."""
    return with_height(aid, height_s=t_s if fate.reason == FUSED else aid.height_s)


class AidAge(NamedTuple):
    """What follows from how long ago the last aid was."""

    aid: AidMemory
    reckoning: Event
    invalid: Event


@on_lanes
def note_aid_age(aid: AidMemory, *, t_s: float, s: AidSettings) -> AidAge:
    """Dead reckoning, and then an invalid position, where no horizontal aid has been fused for long.

    Before the start the age is NaN, and nothing is flagged.
    """
    age_s = t_s - aid.aided_s
    reckons = aid.flag == 0.0 and age_s > s.dead_reckoning_s
    flag = 1.0 if reckons else aid.flag
    invalid = flag == 1.0 and age_s > s.invalid_s
    return AidAge(
        with_flag(aid, flag=2.0 if invalid else flag),
        Event(DEAD_RECKONING if reckons else -1, age_s),
        Event(POSITION_INVALID if invalid else -1, age_s),
    )
