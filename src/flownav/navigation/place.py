"""Where the vehicle is from something near it: an external pose, the pad in a camera, the ground under the skids."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, larger, procedure, replacing
from flownav.core.frames import to_earth
from flownav.estimation.covariance import expect, states_of
from flownav.estimation.laws.pad import pad_fix
from flownav.estimation.laws.still import pad_below, position_itself, velocity_itself
from flownav.estimation.named import Attitude, PositionNed, VelocityNed, rotation_by
from flownav.estimation.states import MEASURED, PAD, STATE
from flownav.navigation import calls
from flownav.navigation.kernel_settings import PlaceSettings
from flownav.navigation.memory import MEMORY
from flownav.navigation.motion_records import ImuMemory, SeenWindow, StandMemory
from flownav.navigation.offers import compare_level, conclude, fuse_offered, judged_whole, note_aid, note_height
from flownav.navigation.packed import load_place_settings
from flownav.navigation.reasons import (
    FUSED,
    INNOVATION_GATE,
    OUT_OF_RANGE,
    SILENT,
    component_of,
    usable,
    usable_in_flight,
)
from flownav.navigation.records import AidMemory, LevelMemory, PadMemory, Reading, StartMemory
from flownav.navigation.tape import PAD_FOUND, Output
from flownav.navigation.verdicts import UNKNOWN_M, Event, Fate, Offer, Reset, on_lanes
from flownav.navigation.windows import RESTING_FLOW_M_S, RESTING_GPS_M_S, flow_speed

LEAST_PAD_DISTANCE_M = 0.05  # chosen: no camera on board is so near its pad; halved it fails test_judges
# Refused fixes in a row: chosen. Without it a first fix of something else stays the pad
# (test_a_pad_first_seen_where_there_is_none_is_found_where_it_is; 13 of 480 approaches landed metres beside).
MANY_STRAYS = 4.0
LEAST_WHITE_SHARE = 0.02
ON_GROUND = 0.5  # between 0 and 1
FLOWN_S = 5.0  # chosen: a skid switch that bounces, or a detector that has not made up its mind, is no flight
STANDING_SIGMA_M = 0.005  # chosen, not measured: how skids settle
MOVED_ALONG_M = 0.1  # chosen, not measured; 0.05 m stays and 0.15 m goes along (test_fates)
# how the pad is known: not, of a vehicle that flies and stood on none; it stands on it before its flight, has left it,
# has seen it
NEVER_STOOD, STOOD_ON, LEFT, SEEN = -1.0, 1.0, 2.0, 3.0

# Above the ground of any vehicle that stands on it: chosen; `windows` has the speed of one that does.
ALOFT_M = 1.0

with_landed = replacing(AidMemory, "landed")
with_landing = replacing(Reading, "value_0")
with_known = replacing(PadMemory, "known", "aloft_s")


class Pad(NamedTuple):
    """Where the filter has the pad, local NED [m]."""

    north_m: float
    east_m: float
    down_m: float


class Sight(NamedTuple):
    """A pad fix as its observation law reads it: tangents forward and right, and the distance [m]."""

    forward: float
    right: float
    distance_m: float


MEMORY.name(Pad, *(STATE + PAD + i for i in range(3)))
MEMORY.name(Sight, *(MEASURED + i for i in range(3)))


@equation
def pad_at(north_m: float, east_m: float, down_m: float, goes: bool) -> tuple[Reset, Reset, Reset]:
    """Resets that put the pad at a place of unknown certainty, where `goes` holds."""
    unknown = UNKNOWN_M * UNKNOWN_M
    return (
        Reset(PAD if goes else -1, north_m, unknown),
        Reset(PAD + 1 if goes else -1, east_m, unknown),
        Reset(PAD + 2 if goes else -1, down_m, unknown),
    )


# -- an external position -----------------------------------------------------------------------------------
@on_lanes(calls.judge_pose)
def judge_pose(
    reading: Reading, start: StartMemory, m: LevelMemory, *, axis: int, alone: bool, s: PlaceSettings
) -> Offer:
    """One axis of an external position, with the variance that it states or the settings' own. North and east are
    judged together; alone: without regard to the other axis.
    """
    value, stated = component_of(reading, axis)
    variance = stated if np.isfinite(stated) else s.pose_sigma_m * s.pose_sigma_m
    reason = usable(reading, value, variance, start.started)
    return Offer(value, variance, reason if alone else judged_whole(reason, axis, m))


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


# -- the pad ------------------------------------------------------------------------------------------------
@equation
def judge_pad(reading: Reading, component: int, started: float, s: PlaceSettings) -> tuple[int, float]:
    """Verdict and variance of a pad fix's component: across its line of sight (0, 1) and along it (2) [m2].

    What is stated of a tangent is s^2 (1 + a^2 + b^2)(1 + t^2) for noise s across the sight (a, b, 1), t its own.
    """
    distance = reading.value_2
    value, stated = component_of(reading, component)
    sigma = (s.pad_distance_sigma if component == 2 else s.pad_angle_sigma_rad) * distance
    sight = 1.0 + reading.value_0 * reading.value_0 + reading.value_1 * reading.value_1
    across = distance * distance / (sight * (1.0 + value * value))
    variance_stated = stated if component == 2 else stated * across
    reason = usable_in_flight(reading, reading.value_0 + reading.value_1 + distance, 0.0, started)
    near = distance < LEAST_PAD_DISTANCE_M
    lasts = (s.pad_scale_sigma if component == 2 else s.pad_boresight_sigma_rad) * distance
    whole = variance_stated if np.isfinite(stated) else sigma * sigma
    white = larger(whole - lasts * lasts, LEAST_WHITE_SHARE * whole)
    return OUT_OF_RANGE if reason == FUSED and near else reason, white


@equation
def late_variance(velocity: VelocityNed, m: ImuMemory, distance_m: float, component: int, s: PlaceSettings) -> float:
    """Variance of a pad fix due to an error of its time stamp [m2]: the square of the pad's travel meanwhile."""
    u, v, w = velocity
    turning = (m.gyro_x * m.gyro_x + m.gyro_y * m.gyro_y) * distance_m * distance_m if component < 2 else 0.0
    return s.pad_time_sigma_s * s.pad_time_sigma_s * (u * u + v * v + w * w + turning)


class FoundPad(NamedTuple):
    """A pad that is found: that it is known, and where."""

    pad: PadMemory
    place: tuple[Reset, Reset, Reset]
    found: Event


@on_lanes(calls.find_pad)
def find_pad(
    reading: Reading, start: StartMemory, position: PositionNed, attitude: Attitude, m: PadMemory, *, s: PlaceSettings
) -> FoundPad:
    """A pad that no camera has seen is unknown but for this fix, which is about to be fused."""
    reason, _ = judge_pad(reading, 0, start.started, s)
    found = reason == FUSED and m.known < SEEN
    rotation = rotation_by(attitude)
    depth = reading.value_2 / np.sqrt(reading.value_0 * reading.value_0 + reading.value_1 * reading.value_1 + 1.0)
    ahead, side = reading.value_0 * depth + s.pad_forward_m, reading.value_1 * depth + s.pad_right_m
    off_n, off_e, off_d = to_earth(rotation, ahead, side, depth + s.pad_below_m)
    north_m, east_m, down_m = position.pos_n + off_n, position.pos_e + off_e, position.pos_d + off_d
    return FoundPad(
        with_known(m, known=SEEN if found else m.known, aloft_s=m.aloft_s),
        pad_at(north_m, east_m, down_m, found),
        Event(PAD_FOUND if found else -1, np.sqrt(north_m * north_m + east_m * east_m + down_m * down_m)),
    )


class PadOffer(NamedTuple):
    """One component of a pad fix: its law reads the whole of it."""

    offer: Offer
    sight: Sight


@on_lanes(calls.judge_sight)
def judge_sight(
    reading: Reading, start: StartMemory, velocity: VelocityNed, m: ImuMemory, fix: LevelMemory,
    *, component: int, alone: bool, s: PlaceSettings,
) -> PadOffer:  # fmt: skip
    """One component of a pad fix. All three are judged together: an object that is not the pad may lie in line with it
    along one of them, and there its lever would turn the heading. alone: without regard to the others.
    """
    reason, fixed = judge_pad(reading, component, start.started, s)
    variance = fixed + late_variance(velocity, m, reading.value_2, component, s)
    value, _ = component_of(reading, component)
    judged = reason if alone else judged_whole(reason, 0, fix)
    return PadOffer(Offer(value, variance, judged), Sight(reading.value_0, reading.value_1, reading.value_2))


@on_lanes(calls.count_refusals)
def count_refusals(fate: Fate, m: PadMemory) -> PadMemory:
    """A pad that the camera sees elsewhere, fix after fix, is not where it was first seen: the next fix finds it anew.

    The first fix may have been of something else, and its place, once believed, would refuse all true ones.
    """
    refused = fate.reason == INNOVATION_GATE
    refusals = m.refusals + 1.0 if refused else (0.0 if fate.reason == FUSED else m.refusals)
    astray = refusals >= MANY_STRAYS
    return PadMemory(LEFT if astray else m.known, 0.0 if astray else refusals, m.aloft_s)


@procedure
def take_pad(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """The pad from the lens. Its place is a state: the first fix finds it, every one corrects both it and the
    vehicle.
    """
    s = load_place_settings(p)
    find_pad(work, lanes, t_s, s, o)
    for component in range(3):
        see_pad(work, lanes, component, True, s)
        expect(work, lanes, states_of(lanes), True)
        compare_level(work, lanes, component, s.gate_sigma)
    for component in range(3):
        see_pad(work, lanes, component, False, s)
        conclude(work, lanes, t_s, sensor, component, s.gate_sigma, o)
        note_height(work, lanes, t_s)
        note_aid(work, lanes, t_s, o)
        if component == 0:
            count_refusals(work, lanes)


@procedure
def see_pad(work: Work, lanes: Lanes, component: int, alone: bool, s: PlaceSettings) -> None:
    """One component of a pad fix, judged and put before its law."""
    judge_sight(work, lanes, component, alone, s)
    pad_fix(work, lanes, component, s.pad_below_m, s.pad_forward_m, s.pad_right_m)


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
