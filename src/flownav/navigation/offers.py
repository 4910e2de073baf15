"""Offering one component to the filter on lanes: the test, the row written of it, and its effect on the aids."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, exp, procedure, replacing, smaller
from flownav.core.measurement import Sensor
from flownav.estimation.covariance import expect, settle, states_of
from flownav.estimation.hypotheses import weigh
from flownav.navigation import calls
from flownav.navigation.journal import note_correction
from flownav.navigation.kernel_settings import AidSettings
from flownav.navigation.memory import CLOCK, NEWEST_OF_SENSOR, share, shared
from flownav.navigation.reasons import (
    DUPLICATE,
    FUSED,
    INNOVATION_GATE,
    LATE,
    NOT_FINITE,
    SILENT,
)
from flownav.navigation.records import AidMemory, EchoMemory, LevelMemory, Reading
from flownav.navigation.tape import AIDED_AGAIN, DEAD_RECKONING, POSITION_INVALID, Output, write_offer
from flownav.navigation.verdicts import Accepted, Event, Fate, Noise, Observation, Offered, Tested, on_lanes

CLOCK_SLACK_S = 1e-6  # the tick of logged times, which are stated in microseconds
LIKE_READINGS = 4.0  # number of successive readings that err alike: chosen; its effect stands in integrity.md
# Sound ranges have 0.013 (mocap) and 0.02 (e-steps) at most, those that jump 0.11 and 0.78; with more strays they are
# weighed, and no evidence on the accelerometer (test_trust)
FEW_STRAYS = 0.02
STRAY_SHARE = 1.5  # some strays confirm each other: chosen; halved or doubled it fails test_strays
STRAY_SPAN_M = 5.0  # chosen: sonars' neighbours are 3.2 and 3.7 m apart at most (outdoor-2 and -3)

with_aid = replacing(AidMemory, "aided_s", "flag")
with_flag = replacing(AidMemory, "flag")
with_height = replacing(AidMemory, "height_s")


class LeftBehind(NamedTuple):
    """The row written for a reading that comes too late to be taken."""

    fate: Fate
    observation: Observation
    noise: Noise


@on_lanes(calls.leave_behind)
def leave_behind(reading: Reading, *, reason: int) -> LeftBehind:
    """Note of a reading only that it came and why it is not taken."""
    return LeftBehind(Fate(reason if reading.arrived > 0.0 else SILENT), Observation(reading.value_0), Noise(np.nan))


@procedure
def too_old(work: Work, lanes: Lanes, t_s: float, sensor: int, o: Output) -> bool:
    """Whether the reading repeats or precedes one of its sensor, or describes what the filter has left behind.

    The schedule is the same in all lanes, so one answer holds for all.
    """
    reason = FUSED
    if not np.isfinite(t_s):
        reason = NOT_FINITE
    elif t_s <= shared(work, lanes, NEWEST_OF_SENSOR + sensor):
        reason = DUPLICATE
    elif t_s < shared(work, lanes, CLOCK) - CLOCK_SLACK_S:
        reason = LATE
    if reason == FUSED:
        share(work, lanes, NEWEST_OF_SENSOR + sensor, t_s)
        return False
    if sensor != Sensor.IMU:
        leave_behind(work, lanes, reason)
        write_offer(work, lanes, t_s, sensor, 0, o)
    return True


# -- one component ----------------------------------------------------------------------------------------
@on_lanes(calls.observe_innovation)
def observe_innovation(tested: Tested) -> Observation:
    """Write the difference that a law finds as the observation of an attitude."""
    return Observation(tested.innovation)


@procedure
def conclude(work: Work, lanes: Lanes, t_s: float, sensor: int, component: int, gate_sigma: float, o: Output) -> None:
    """Test, fuse and write down the component whose law stands in the observation rows; REASON holds the outcome.

    What no lane offers corrects nothing and costs nothing, and its innovation is computed for the tape alone.
    """
    fuse_offered(work, lanes, gate_sigma, o)
    write_offer(work, lanes, t_s, sensor, component, o)


@on_lanes(calls.offer_what_is_sound)
def offer_what_is_sound(fate: Fate) -> Offered:
    """Offered to the filter where the judge found nothing against it."""
    return Offered(1.0 if fate.reason == FUSED else 0.0)


@on_lanes(calls.note_refusal)
def note_refusal(fate: Fate, tested: Accepted) -> Fate:
    """INNOVATION_GATE where the offer was not fused."""
    return Fate(INNOVATION_GATE if fate.reason == FUSED and tested.accepted == 0.0 else fate.reason)


@procedure
def fuse_offered(work: Work, lanes: Lanes, gate_sigma: float, o: Output) -> None:
    """Test and fuse the component in the lanes whose REASON is FUSED; INNOVATION_GATE where it does not pass."""
    offer_what_is_sound(work, lanes)
    expect(work, lanes, states_of(lanes), o.room[1] > 0)
    settle(work, lanes, states_of(lanes), gate_sigma)
    weigh(work, lanes, states_of(lanes), LIKE_READINGS)
    note_refusal(work, lanes)
    if len(lanes) == 1:
        note_correction(work, lanes, o)


# -- a place as a whole -----------------------------------------------------------------------------------
@equation
def gate_ratio(tested: Tested, gate_sigma: float) -> float:
    """The square of the innovation over the largest that the gate passes."""
    return tested.innovation * tested.innovation / (gate_sigma * gate_sigma * tested.total)


@on_lanes(calls.compare_level)
def compare_level(tested: Tested, m: LevelMemory, *, axis: int, gate_sigma: float) -> LevelMemory:
    """The largest test ratio of the components of a place, once all are compared; 0 where none can be offered."""
    before = m.ratio if axis > 0 else 0.0
    ratio = gate_ratio(tested, gate_sigma)
    return LevelMemory(ratio if tested.reason == FUSED and ratio > before else before)


@equation
def spoilt_whole(alone: bool, axis: int, m: LevelMemory) -> int:
    """North and east come of one place, and a jump along one axis spoils both: INNOVATION_GATE then, or FUSED.

    alone: without regard to the other axis.
    """
    return INNOVATION_GATE if not alone and axis < 2 and m.ratio > 1.0 else FUSED


# -- a reading among strays -------------------------------------------------------------------------------
@equation
def stray_variance(innovation: float, total: float, variance: float, stray: float) -> float:
    """The variance of a range [m2] that may be a stray: it is fused by the probability that it is none.

    beta = (1 - p) N(nu; S) / ((1 - p) N(nu; S) + p/W) is that of the ground among strays spread over W (probabilistic
    data association: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
    section 3.4), and a gain beta K is that of the variance R + S (1/beta - 1).
    """
    p = smaller(STRAY_SHARE * stray, 0.95)
    likely = (1.0 - p) * exp(-0.5 * innovation * innovation / total) / np.sqrt(2.0 * np.pi * total)
    weighed: float = variance + total * p / (STRAY_SPAN_M * likely + 1e-6)
    return weighed


class Strays(NamedTuple):
    """Whether there are strays in any lane; nothing is offered while they are weighed."""

    offered: Offered
    any: bool


@on_lanes(calls.look_for_strays)
def look_for_strays(echo: EchoMemory) -> Strays:
    """Whether strays are so frequent that a range must be weighed."""
    return Strays(Offered(0.0), echo.stray > FEW_STRAYS)


@on_lanes(calls.weighed_range)
def weighed_range(tested: Tested, echo: EchoMemory) -> Noise:
    """The variance of a range among strays."""
    weighed = stray_variance(tested.innovation, tested.total, tested.variance, echo.stray)
    return Noise(weighed if echo.stray > FEW_STRAYS else tested.variance)


@procedure
def weigh_strays(work: Work, lanes: Lanes) -> None:
    """The variance of the component at hand, in the lanes where there are strays."""
    if look_for_strays(work, lanes):
        expect(work, lanes, states_of(lanes), True)
        weighed_range(work, lanes)


# -- horizontal aid ---------------------------------------------------------------------------------------
class Aided(NamedTuple):
    """The aid at hand noted, and the event that the position is aided again."""

    aid: AidMemory
    again: Event


@on_lanes(calls.note_aid)
def note_aid(fate: Fate, aid: AidMemory, *, t_s: float) -> Aided:
    """Something horizontal was fused in the lanes whose reason is FUSED."""
    fused = fate.reason == FUSED
    again = Event(AIDED_AGAIN if fused and aid.flag > 0.0 else -1, t_s - aid.aided_s)
    return Aided(with_aid(aid, aided_s=t_s, flag=0.0) if fused else aid, again)


@on_lanes(calls.note_height)
def note_height(fate: Fate, aid: AidMemory, *, t_s: float) -> AidMemory:
    """The memory after something other than the range measured the height, in the lanes whose reason is FUSED."""
    return with_height(aid, height_s=t_s if fate.reason == FUSED else aid.height_s)


class AidAge(NamedTuple):
    """Consequences of the time since the last aid: memory and events."""

    aid: AidMemory
    reckoning: Event
    invalid: Event


@on_lanes(calls.note_aid_age)
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
