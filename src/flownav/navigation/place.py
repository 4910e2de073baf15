"""Where the vehicle is from something near it: an external pose, the pad in a camera, the ground under the skids."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, larger, procedure, replacing
from flownav.estimation.covariance import expect, states_of
from flownav.estimation.laws.still import pad_below, position_itself, velocity_itself
from flownav.estimation.named import PositionNed
from flownav.navigation import calls
from flownav.navigation.kernel_settings import PlaceSettings
from flownav.navigation.motion_records import SeenWindow, StandMemory
from flownav.navigation.offers import compare_level, conclude, fuse_offered, note_aid, note_height, spoilt_whole
from flownav.navigation.packed import load_place_settings
from flownav.navigation.pad import LEFT, NEVER_STOOD, STOOD_ON, Pad, pad_at
from flownav.navigation.reasons import (
    FUSED,
    INNOVATION_GATE,
    SILENT,
    component_of,
    judged,
    stated_or,
    usable,
)
from flownav.navigation.records import AidMemory, LevelMemory, PadMemory, Reading, StartMemory
from flownav.navigation.tape import Output
from flownav.navigation.verdicts import Offer, Reset, on_lanes
from flownav.navigation.windows import RESTING_FLOW_M_S, RESTING_GPS_M_S, flow_speed

ON_GROUND = 0.5  # between 0 and 1
FLOWN_S = 5.0  # chosen: a skid switch that bounces, or a detector that has not made up its mind, is no flight
STANDING_SIGMA_M = 0.005  # chosen, not measured: how skids settle
MOVED_ALONG_M = 0.1  # chosen, not measured; 0.05 m stays and 0.15 m goes along (test_fates)
# Above the ground of any vehicle that stands on it: chosen; `windows` has the speed of one that does.
ALOFT_M = 1.0

with_landed = replacing(AidMemory, "landed")
with_landing = replacing(Reading, "value_0")
with_known = replacing(PadMemory, "known", "aloft_s")


# -- an external position -----------------------------------------------------------------------------------
@on_lanes(calls.judge_pose)
def judge_pose(
    reading: Reading, start: StartMemory, m: LevelMemory, *, axis: int, alone: bool, s: PlaceSettings
) -> Offer:
    """One axis of an external position, with the variance that it states or the settings' own. North and east are
    judged together; alone: without regard to the other axis.
    """
    value, stated = component_of(reading, axis)
    variance = stated_or(stated, s.pose_sigma_m * s.pose_sigma_m)
    sound = usable(reading, value, variance, start.started)
    return Offer(value, variance, judged(sound, FUSED, False, spoilt_whole(alone, axis, m)))


@procedure
def take_pose(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """An external position in the local frame."""
    s = load_place_settings(p)
    for axis in range(2):
        judge_pose(work, lanes, axis, True, s)
        position_itself(work, lanes, axis)
        expect(work, lanes, states_of(lanes), True)
        compare_level(work, lanes, axis, s.gate_sigma)
    for axis in range(3):
        judge_pose(work, lanes, axis, False, s)
        position_itself(work, lanes, axis)
        conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)
        if axis < 2:
            note_aid(work, lanes, t_s, o)
        else:
            note_height(work, lanes, t_s)


# -- at rest ------------------------------------------------------------------------------------------------
@equation
def is_aloft(seen: SeenWindow, m: StandMemory) -> bool:
    """Whether a vehicle that is reported to have landed still flies: by a range, a receiver or the flow."""
    range_m = seen.range_high_m if seen.range_high_m >= 0.0 else m.last_m
    flow_m_s = flow_speed(seen) if range_m >= 0.0 else 0.0  # over an unknown height it is no speed
    return range_m > ALOFT_M or larger(seen.gps_m_s, m.gps_m_s) >= RESTING_GPS_M_S or flow_m_s >= RESTING_FLOW_M_S


@on_lanes(calls.disbelieve_landed)
def disbelieve_landed(reading: Reading, seen: SeenWindow, m: StandMemory) -> Reading:
    """The reading, not landed where the vehicle flies, whatever it reports."""
    return with_landing(reading, value_0=0.0 if is_aloft(seen, m) else reading.value_0)


@on_lanes(calls.note_landed)
def note_landed(reading: Reading, aid: AidMemory) -> AidMemory:
    """The memory of whether the vehicle is on the ground, by the newest report."""
    return with_landed(aid, landed=reading.value_0 if reading.arrived > 0.0 else aid.landed)


@on_lanes(calls.judge_landed)
def judge_landed(
    reading: Reading, start: StartMemory, seen: SeenWindow, m: StandMemory, *, variance: float
) -> Offer:  # fmt: skip
    """No velocity, on the ground; in flight, nothing. What contradicts it refuses it."""
    reason = usable(reading, reading.value_0, variance, start.started)
    claimed = INNOVATION_GATE if reason == FUSED and is_aloft(seen, m) else reason
    return Offer(0.0, variance, claimed if reading.value_0 > ON_GROUND else SILENT)


class Standing(NamedTuple):
    """How the pad is known to a vehicle that may stand on it, and where it is. stands: on the pad."""

    pad: PadMemory
    place: tuple[Reset, Reset, Reset]
    stands: bool


@on_lanes(calls.stand_on_pad)
def stand_on_pad(
    reading: Reading, start: StartMemory, position: PositionNed, pad: Pad, m: PadMemory, *, t_s: float
) -> Standing:
    """The place of take-off is the pad until a camera sees one: a state tied to the vehicle's own while it stands, so
    that what GPS later corrects in one it corrects in the other, and the way back is known better than either. A
    vehicle that is carried about before its flight takes the pad along; one that has flown lands where it lands.
    """
    sound = usable(reading, reading.value_0, 0.0, start.started) == FUSED
    landed = sound and reading.value_0 > ON_GROUND
    off_n, off_e = pad.north_m - position.pos_n, pad.east_m - position.pos_e
    moved_along = m.known == STOOD_ON and off_n * off_n + off_e * off_e > MOVED_ALONG_M * MOVED_ALONG_M
    anew = landed and (m.known == 0.0 or moved_along)
    known = STOOD_ON if anew else m.known
    flies = sound and not landed
    aloft_s = np.inf if landed else (t_s if flies and t_s < m.aloft_s else m.aloft_s)
    never = flies and known == 0.0 and t_s - aloft_s >= FLOWN_S
    known = LEFT if flies and known == STOOD_ON else (NEVER_STOOD if never else known)
    return Standing(
        with_known(m, known=known, aloft_s=aloft_s),
        pad_at(position.pos_n, position.pos_e, position.pos_d, anew),
        landed and known == STOOD_ON,
    )


@on_lanes(calls.tie_to_pad)
def tie_to_pad(reading: Reading, m: PadMemory) -> Offer:
    """The vehicle is where its pad is."""
    on_it = m.known == STOOD_ON and reading.arrived > 0.0
    return Offer(0.0, STANDING_SIGMA_M * STANDING_SIGMA_M, FUSED if on_it else SILENT)


@procedure
def take_landed(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """On the ground: no velocity, and before a flight the pad is where the vehicle stands. In flight, nothing; nor
    where a range, a receiver or the flow shows that it flies: a report of "landed" is one witness among them.
    """
    s = load_place_settings(p)
    for axis in range(3):
        judge_landed(work, lanes, s.still_sigma_m_s * s.still_sigma_m_s)
        velocity_itself(work, lanes, axis)
        conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)
        note_aid(work, lanes, t_s, o)
    disbelieve_landed(work, lanes)
    note_landed(work, lanes)
    if stand_on_pad(work, lanes, t_s, o):
        for axis in range(3):
            tie_to_pad(work, lanes)
            pad_below(work, lanes, axis)
            fuse_offered(work, lanes, s.gate_sigma, o)
