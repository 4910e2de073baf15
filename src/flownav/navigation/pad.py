"""Where the pad is that a camera looks for: found by fixes that agree, corrected by every one, and found anew."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, larger, procedure, replacing
from flownav.core.frames import to_earth
from flownav.estimation.covariance import expect, states_of
from flownav.estimation.laws.pad import pad_fix
from flownav.estimation.named import Attitude, PositionNed, VelocityNed, rotation_by
from flownav.estimation.states import MEASURED, PAD, STATE
from flownav.navigation import calls
from flownav.navigation.kernel_settings import PlaceSettings
from flownav.navigation.memory import MEMORY
from flownav.navigation.motion_records import ImuMemory
from flownav.navigation.offers import compare_level, conclude, note_aid, note_height, spoilt_whole
from flownav.navigation.packed import load_place_settings
from flownav.navigation.reasons import (
    DATUM,
    FUSED,
    INNOVATION_GATE,
    OUT_OF_RANGE,
    component_of,
    judged,
    stated_or,
    usable_in_flight,
)
from flownav.navigation.records import LevelMemory, PadMemory, Reading, StartMemory
from flownav.navigation.tape import PAD_FOUND, Output
from flownav.navigation.verdicts import UNKNOWN_M, Event, Fate, Offer, Reset, on_lanes

LEAST_PAD_DISTANCE_M = 0.05  # chosen: no camera on board is so near its pad; halved it fails test_judges
# Fixes in a row that agree on one place: chosen. Three find the pad, for a single one may be of something else, and
# with one frame in twenty false most flights landed metres beside their pad; four refused ones show that it is
# elsewhere (test_a_pad_first_seen_where_there_is_none_is_found_where_it_is).
FIXES_THAT_FIND, MANY_STRAYS = 3.0, 4.0
# two fixes agree within so much and this share of the distance: chosen, not measured; 0.1 s of motion and the noise
AGREE_M, AGREE_SHARE = 0.2, 0.1
LEAST_WHITE_SHARE = 0.02
# how the pad is known: not, of a vehicle that flies and stood on none; it stands on it before its flight, has left it,
# has seen it
NEVER_STOOD, STOOD_ON, LEFT, SEEN = -1.0, 1.0, 2.0, 3.0

with_count = replacing(PadMemory, "known", "agreeing")
with_latest = replacing(PadMemory, "known", "agreeing", "last_n_m", "last_e_m", "last_d_m")


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
    whole = stated_or(variance_stated, sigma * sigma)
    white = larger(whole - lasts * lasts, LEAST_WHITE_SHARE * whole)
    return judged(reason, OUT_OF_RANGE if near else FUSED, False, FUSED), white


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


@equation
def agrees(north_m: float, east_m: float, down_m: float, distance_m: float, m: PadMemory) -> bool:
    """Whether a fix from this distance sees something where the one before it did."""
    off_n, off_e, off_d = north_m - m.last_n_m, east_m - m.last_e_m, down_m - m.last_d_m
    within = AGREE_M + AGREE_SHARE * distance_m
    return off_n * off_n + off_e * off_e + off_d * off_d < within * within


@on_lanes(calls.find_pad)
def find_pad(
    reading: Reading, start: StartMemory, position: PositionNed, attitude: Attitude, m: PadMemory, *, s: PlaceSettings
) -> FoundPad:
    """A pad that no camera has seen is found by fixes in a row that agree on its place; it is unknown but for the last
    of them, which is about to be fused.
    """
    reason, _ = judge_pad(reading, 0, start.started, s)
    rotation = rotation_by(attitude)
    depth = reading.value_2 / np.sqrt(reading.value_0 * reading.value_0 + reading.value_1 * reading.value_1 + 1.0)
    ahead, side = reading.value_0 * depth + s.pad_forward_m, reading.value_1 * depth + s.pad_right_m
    off_n, off_e, off_d = to_earth(rotation, ahead, side, depth + s.pad_below_m)
    north_m, east_m, down_m = position.pos_n + off_n, position.pos_e + off_e, position.pos_d + off_d
    sees = reason == FUSED
    agreeing = m.agreeing + 1.0 if agrees(north_m, east_m, down_m, reading.value_2, m) else 1.0
    found = sees and m.known < SEEN and agreeing >= FIXES_THAT_FIND
    latest = with_latest(
        m,
        known=SEEN if found else m.known,
        agreeing=agreeing if sees else m.agreeing,
        last_n_m=north_m if sees else m.last_n_m,
        last_e_m=east_m if sees else m.last_e_m,
        last_d_m=down_m if sees else m.last_d_m,
    )
    return FoundPad(
        latest,
        pad_at(north_m, east_m, down_m, found),
        Event(PAD_FOUND if found else -1, np.sqrt(north_m * north_m + east_m * east_m + down_m * down_m)),
    )


class PadOffer(NamedTuple):
    """One component of a pad fix: its law reads the whole of it."""

    offer: Offer
    sight: Sight


@on_lanes(calls.judge_sight)
def judge_sight(
    reading: Reading, start: StartMemory, velocity: VelocityNed, m: ImuMemory, fix: LevelMemory, pad: PadMemory,
    *, component: int, alone: bool, s: PlaceSettings,
) -> PadOffer:  # fmt: skip
    """One component of a pad fix. All three are judged together: an object that is not the pad may lie in line with it
    along one of them, and there its lever would turn the heading. alone: without regard to the others. A fix that has
    not found the pad yet notes a place and corrects nothing.
    """
    sound, fixed = judge_pad(reading, component, start.started, s)
    variance = fixed + late_variance(velocity, m, reading.value_2, component, s)
    value, _ = component_of(reading, component)
    outlier = DATUM if pad.known < SEEN else spoilt_whole(alone, 0, fix)
    return PadOffer(
        Offer(value, variance, judged(sound, FUSED, False, outlier)),
        Sight(reading.value_0, reading.value_1, reading.value_2),
    )


@on_lanes(calls.count_refusals)
def count_refusals(fate: Fate, m: PadMemory) -> PadMemory:
    """A pad that the camera sees elsewhere, fix after fix at one place, is not where it was first seen: the next such
    fix finds it anew.

    The first fixes may have been of something else, and their place, once believed, would refuse all true ones.
    """
    astray = fate.reason == INNOVATION_GATE and m.known == SEEN and m.agreeing >= MANY_STRAYS
    return with_count(m, known=LEFT if astray else m.known, agreeing=0.0 if fate.reason == FUSED else m.agreeing)


@procedure
def take_pad(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """The pad from the lens. Its place is a state: the first fixes that agree find it, every one from then on corrects
    both it and the vehicle.
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
