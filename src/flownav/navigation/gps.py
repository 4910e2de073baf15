"""GPS position and velocity: a fix is judged as a whole, fused axis by axis, and believed where refused for long."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, larger, procedure, replacing, row_of, smaller
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import Sensor
from flownav.estimation.covariance import covariance_of, expect, states_of, variance_of
from flownav.estimation.laws.gps import gps_position, gps_velocity
from flownav.estimation.laws.still import pad_below
from flownav.estimation.states import GPS_FAST, GPS_SLOW, GPS_VELOCITY, PAD, POSITION, STATE, VELOCITY
from flownav.navigation import calls
from flownav.navigation.fault_signs import sign_drift
from flownav.navigation.fix_walk import MOMENT_S, agrees, hold_walk, is_doubted, watch_walk
from flownav.navigation.kernel_settings import GpsSettings
from flownav.navigation.memory import MEMORY
from flownav.navigation.motion_records import SteadyForce
from flownav.navigation.offers import (
    compare_level,
    conclude,
    fuse_offered,
    gate_ratio,
    note_aid,
    note_height,
    spoilt_whole,
)
from flownav.navigation.packed import load_gps_settings
from flownav.navigation.reasons import FUSED, INNOVATION_GATE, SILENT, component_of, judged, usable
from flownav.navigation.records import (
    FixMemory,
    FlowMemory,
    GpsMemory,
    LevelMemory,
    RangeMemory,
    Reading,
    StartMemory,
    WitnessMemory,
)
from flownav.navigation.tape import GPS_RESET, Output
from flownav.navigation.trust import OF_GPS, SMALLEST_NOISE, followed_noise, scale_noise
from flownav.navigation.verdicts import UNKNOWN_M, Event, Force, Noise, Offer, Reset, Tested, on_lanes

LAG_LEFT = 0.3  # chosen: half of it is as good, with none v is too sure in a tail wind (test_wind_from_all_sides)
LEAST_REJECTIONS = 5  # chosen: a second of a 5 Hz receiver; one refusal alone is none (test_judges)
SOON_S = 1.0  # with 7 s a flow of the wrong sign carried the vehicle 84 m off, so 10 to 15 (flownav faults)
# chosen: flow drifts by less than 1 m in it (measured.md), and a receiver that is off for so long is not the better one
JUMPED_S = 60.0
LEAPT_RATIO = 4.0  # twice the gate: chosen; what a flow of the wrong sign leads away creeps out of it
LEAST_PAD_VARIANCE_M2 = 1e-6  # chosen: 1 mm, so that a tie is never exact

with_fused = replacing(WitnessMemory, "fused_s")
with_refusal = replacing(WitnessMemory, "times", "since_s", "leapt")
with_reset = replacing(GpsMemory, "last_fix_s", "moved_n_m", "moved_e_m")


# -- the filter's estimates -------------------------------------------------------------------------------------
class AlongAxis(NamedTuple):
    """The filter's estimate along an axis, NED: position [m], velocity [m/s] with its variance [m2/s2], the slow error
    of GPS [m], when a velocity of GPS was fused last and since when it agrees [s], and the pad's offset with its
    variance [m, m2].
    """

    position_m: float
    velocity_m_s: float
    velocity_variance: float
    slow_m: float
    agreed_s: float
    agrees_since_s: float
    pad_off_m: float
    pad_variance: float


@equation
def along_axis(work: Work, lanes: Lanes, axis: int, lane: int) -> AlongAxis:
    """The filter's estimate along an axis of a lane."""
    position_m = row_of(work, lanes, STATE + POSITION + axis, lane)
    velocity = load_witness(work, lanes, OF_GPS + 3 + axis, lane)
    both = variance_of(work, lanes, POSITION + axis, lane) + variance_of(work, lanes, PAD + axis, lane)
    variance = both - 2.0 * covariance_of(work, lanes, PAD + axis, POSITION + axis, lane)
    return AlongAxis(
        position_m,
        row_of(work, lanes, STATE + VELOCITY + axis, lane),
        variance_of(work, lanes, VELOCITY + axis, lane),
        row_of(work, lanes, STATE + GPS_SLOW + axis, lane),
        velocity.fused_s,
        velocity.since_s,
        row_of(work, lanes, STATE + PAD + axis, lane) - position_m,
        larger(variance, LEAST_PAD_VARIANCE_M2),
    )


MEMORY.derive(AlongAxis, along_axis, "axis")
load_witness, _ = MEMORY.access(WitnessMemory)


# -- one axis of a fix ----------------------------------------------------------------------------------------
@on_lanes(calls.judge_fix)
def judge_fix(
    reading: Reading, start: StartMemory, m: LevelMemory, *, axis: int, position: bool, alone: bool, s: GpsSettings
) -> Offer:
    """One axis of a fix: the variance is the white part of its noise, and a share of the accuracy that it states.

    North and east are judged together; alone: without regard to the other axis.
    """
    value, stated = component_of(reading, axis)
    white_position = s.gps_white_sigma_down_m if axis == 2 else s.gps_white_sigma_m
    white_velocity = s.gps_velocity_white_down_m_s if axis == 2 else s.gps_velocity_white_m_s
    white = white_position if position else white_velocity
    share = s.gps_white_share * s.gps_white_share * (stated if np.isfinite(stated) else 0.0)
    variance = white * white + share
    sound = usable(reading, value, variance, start.started)
    return Offer(value, variance, judged(sound, FUSED, False, spoilt_whole(alone, axis, m)))


@equation
def lag_variance(start: StartMemory, steady: SteadyForce, s: GpsSettings) -> float:
    """Variance of a GPS velocity due to the receiver's smoothing [m2/s2]: the lag that is estimated (`gps_velocity`) is
    one number, which a smoothing is not, and leaves a share LAG_LEFT of its doubt times the acceleration.
    """
    lag_s = LAG_LEFT * s.gps_velocity_lag_sigma_s if start.started > 0.0 else 0.0
    return lag_s * lag_s * squared_acceleration(steady)


@on_lanes(calls.add_lag)
def add_lag(noise: Noise, start: StartMemory, steady: SteadyForce, *, s: GpsSettings) -> Noise:
    """A velocity errs the more, the more the vehicle is accelerated."""
    return Noise(noise.variance + lag_variance(start, steady, s))


@on_lanes(calls.follow_fix_noise)
def follow_fix_noise(
    tested: Tested, start: StartMemory, steady: SteadyForce, m: WitnessMemory,
    *, t_s: float, place: int, s: GpsSettings,
) -> WitnessMemory:  # fmt: skip
    """After the test: an axis that was fused teaches its white noise; the rest of a lag lasts, and is no white
    noise.
    """
    if tested.reason != FUSED:
        return m
    white = tested.variance - (0.0 if place < OF_GPS + 3 else lag_variance(start, steady, s))
    return followed_noise(tested.innovation, tested.total, white, SMALLEST_NOISE, s.gate_sigma, t_s, m)


@equation
def squared_acceleration(steady: SteadyForce) -> float:
    """Square of the vehicle's acceleration [m2/s4], of the steady specific force, NED."""
    down_m_s2 = steady.down_m_s2 + GRAVITY_M_S2
    return steady.north_m_s2 * steady.north_m_s2 + steady.east_m_s2 * steady.east_m_s2 + down_m_s2 * down_m_s2


@on_lanes(calls.smooth_force)
def smooth_force(steady: SteadyForce) -> Force:
    """A receiver's lag is of the motion, not of the vibration."""
    return Force(steady.north_m_s2, steady.east_m_s2, steady.down_m_s2)


# -- a fix that is refused ------------------------------------------------------------------------------------
@equation
def leaps(tested: Tested, ratio: float, position: bool, velocity_variance: float, since_s: float) -> bool:
    """Whether a reading that is refused is too far off for any fault of the motion: then GPS itself is off.

    since_s: time since one was fused. Nothing wrong puts a position within its gate, and so does a velocity that was
    off by its own standard deviation all that time; what is beyond is neither, but for a false alarm of the gate (6e-7
    at 5 sigma). A velocity must have leapt far out of its gate: a flow of the wrong sign leads one away, too.
    """
    moved = velocity_variance * since_s * since_s
    return ratio * tested.total > tested.total + moved if position else ratio > LEAPT_RATIO


@equation
def judge_rejections(
    ratio: float, position: bool, doubted: bool, t_s: float, m: WitnessMemory, s: GpsSettings, seen: bool = False,
    leapt_now: bool = False,
) -> tuple[bool, WitnessMemory]:  # fmt: skip
    """Whether GPS has been refused for a state so often and so long that the filter is wrong, and the count.

    ratio: its test ratio where it is refused, else 0. position: or else it is a velocity, for which SOON_S is long
    enough, as it is where flow, which else would hold the filter, is doubted. seen: another witness carries the state.
    leapt_now: GPS is off by `leaps`, of a velocity by the first refusal: for JUMPED_S it is not followed then. since_s
    stays when it is over, and is the end of a silence or a long refusal.
    """
    refused = ratio > 1.0
    first = not m.times > 0.0
    since_s = t_s if first else m.since_s
    leapt = 1.0 if leapt_now and (first or position) else (0.0 if first else m.leapt)
    count = m.times + 1.0
    soon = not position or doubted
    patience_s = JUMPED_S if seen and leapt > 0.0 else (smaller(s.gps_reset_s, SOON_S) if soon else s.gps_reset_s)
    reset = refused and count >= LEAST_REJECTIONS and t_s - since_s >= patience_s
    last_s = m.since_s if t_s - m.fused_s <= MOMENT_S else t_s
    times = count if refused and not reset else 0.0
    return reset, with_refusal(m, times=times, since_s=since_s if refused else last_s, leapt=leapt)


@equation
def gone_to_gps(
    value: float, noise: float, axis: int, position: bool, goes: bool, off: bool, s: GpsSettings
) -> tuple[Reset, Reset, Reset]:
    """A state goes to the fix, and the fix's lasting errors are forgotten: a position's two, or a velocity's.

    off: it is the fix that is off, by its slow error, which goes to the value instead.
    """
    slow = s.gps_slow_sigma_down_m if axis == 2 else s.gps_slow_sigma_m
    fast = s.gps_fast_sigma_down_m if axis == 2 else s.gps_fast_sigma_m
    velocity = s.gps_velocity_sigma_down_m_s if axis == 2 else s.gps_velocity_sigma_m_s
    first = slow if position else velocity
    lasting = slow * slow + fast * fast if position else velocity * velocity
    return (
        Reset((GPS_SLOW if position else GPS_VELOCITY) + axis if goes else -1, value if off else 0.0, first * first),
        Reset(GPS_FAST + axis if goes and position and not off else -1, 0.0, fast * fast),
        Reset((POSITION if position else VELOCITY) + axis if goes and not off else -1, value, lasting + noise),
    )


class FixFate(NamedTuple):
    """Consequences of a fix's fate along an axis. pad_goes: the pad is tied to the vehicle anew."""

    memory: FixMemory
    goes: tuple[Reset, Reset, Reset]
    event: Event
    pad: Reset
    tie: Offer
    pad_goes: bool


@on_lanes(calls.judge_fate)
def judge_fate(
    tested: Tested, reading: Reading, along: AlongAxis, flow: FlowMemory, ranged: RangeMemory, memory: FixMemory,
    *, t_s: float, place: int, s: GpsSettings,
) -> FixFate:  # fmt: skip
    """After the test: where GPS has been refused again and again for a state, the filter is wrong: it goes to GPS.

    An axis that is refused for the other's sake alone does not count. Where the position goes, the pad goes along:
    flow, which is not doubted, measures how far it is from there.
    """
    m, gps, pad = memory
    position = place < OF_GPS + 3
    axis = place - OF_GPS if position else place - OF_GPS - 3
    value, _ = component_of(reading, axis)
    here = reading.arrived > 0.0
    doubted = is_doubted(flow)
    ratio = gate_ratio(tested, s.gate_sigma) if tested.reason == INNOVATION_GATE else 0.0
    flowed = not doubted and t_s - flow.taken_s <= MOMENT_S
    above = not np.isfinite(ranged.refused_s) and t_s - ranged.taken_s <= MOMENT_S
    carried_s = ranged.taken_s if axis == 2 else flow.taken_s
    velocity_agrees = position and agrees(along.agreed_s, along.agrees_since_s, m.fused_s, t_s)
    carried = velocity_agrees and t_s - carried_s <= MOMENT_S
    seen = carried or (above if axis == 2 else flowed)
    fused_s = t_s - m.fused_s
    leapt_now = leaps(tested, ratio, position, along.velocity_variance, fused_s) and (carried or fused_s <= MOMENT_S)
    reset, after = judge_rejections(ratio, position, doubted, t_s, m, s, seen, leapt_now)
    off = position and seen and after.leapt > 0.0
    after = with_fused(after, fused_s=t_s) if tested.reason == FUSED or (reset and off) else after
    resets = here and reset
    goes = resets and not off
    by = value - (along.position_m if position else along.velocity_m_s)
    moved = by if goes and position else 0.0  # whether GPS jumped or the filter was wrong is unknown
    pad_goes = goes and position and not doubted and pad.known > 0.0
    return FixFate(
        FixMemory(
            after if here else m,
            with_reset(
                gps,
                last_fix_s=t_s if axis < 2 and tested.reason == FUSED else gps.last_fix_s,
                moved_n_m=gps.moved_n_m + (moved if axis == 0 else 0.0),
                moved_e_m=gps.moved_e_m + (moved if axis == 1 else 0.0),
            ),
            pad,
        ),
        gone_to_gps(
            along.slow_m + tested.innovation if off else value, tested.variance, axis, position, resets, off, s
        ),
        Event(GPS_RESET if goes else -1, by),
        Reset(PAD + axis if pad_goes else -1, value + along.pad_off_m, UNKNOWN_M * UNKNOWN_M),
        Offer(
            along.pad_off_m if pad_goes else 0.0,
            along.pad_variance if pad_goes else 1.0,
            FUSED if pad_goes else SILENT,
        ),
        pad_goes,
    )


# -- the way of a fix -------------------------------------------------------------------------------------------
@procedure
def take_gps(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """Position or velocity with its lasting errors; where it is refused for long, a reset."""
    s = load_gps_settings(p)
    position = sensor == Sensor.GPS_POSITION
    if not position:
        smooth_force(work, lanes)
    for axis in range(2):
        offer_axis(work, lanes, axis, position, True, s)
        if not position:
            add_lag(work, lanes, s)
        expect(work, lanes, states_of(lanes), True)
        compare_level(work, lanes, axis, s.gate_sigma)
    if position:
        hold_walk(work, lanes, t_s)
    for axis in range(3):
        state = axis if position else 3 + axis
        offer_axis(work, lanes, axis, position, False, s)
        scale_noise(work, lanes, OF_GPS + state)
        if position:
            sign_drift(work, lanes, t_s, axis)
        else:
            add_lag(work, lanes, s)
        conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)
        if position and axis < 2:
            watch_walk(work, lanes, t_s, axis, place=OF_GPS + axis)
        follow_fix_noise(work, lanes, t_s, OF_GPS + state, s)
        if axis < 2:
            note_aid(work, lanes, t_s, o)
        elif position:
            note_height(work, lanes, t_s)
        if judge_fate(work, lanes, t_s, OF_GPS + state, s, axis=axis, o=o):
            pad_below(work, lanes, axis)
            fuse_offered(work, lanes, s.gate_sigma, o)


@procedure
def offer_axis(work: Work, lanes: Lanes, axis: int, position: bool, alone: bool, s: GpsSettings) -> None:
    """One axis of a fix, judged and put before its law."""
    judge_fix(work, lanes, axis, position, alone=alone, s=s)
    if position:
        gps_position(work, lanes, axis, s.gps_forward_m, s.gps_right_m, s.gps_below_m)
    else:
        gps_velocity(work, lanes, axis, s.gps_forward_m, s.gps_right_m, s.gps_below_m)
