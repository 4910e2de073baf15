"""Where the vehicle is from something near it: an external pose, the pad in a camera, the ground under the skids."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, procedure
from flownav.estimation.laws.pad import pad_fix
from flownav.estimation.laws.still import pad_below, position_itself, velocity_itself
from flownav.estimation.motion import rotation_of
from flownav.estimation.states import MEASURED, PAD, POSITION, STATE
from flownav.frames import to_earth
from flownav.navigation.journal import reset_state
from flownav.navigation.memory import (
    ASTRAY,
    OBSERVATION,
    PAD_KNOWN,
    PAD_STRAYS,
    REASON,
    load_aid,
    load_reading,
    load_start,
    store_aid,
)
from flownav.navigation.offers import conclude, fuse_offered, note_aid, note_height, put, usable, usable_in_flight
from flownav.navigation.packed import load_place_settings
from flownav.navigation.reasons import FUSED, INNOVATION_GATE, OUT_OF_RANGE, SILENT
from flownav.navigation.records import AidMemory, Reading
from flownav.navigation.tape import PAD_FOUND, Output, write_event
from flownav.navigation.told import PlaceSettings

LEAST_PAD_DISTANCE_M = 0.05
MANY_STRAYS = 6.0  # refused components of fixes, no whole fix fused between
UNKNOWN_M = 100.0
ON_GROUND = 0.5
STANDING_SIGMA_M = 0.005
CARRIED_M = 0.1
# how the pad is known: the vehicle stands on it before its flight, has left it, has seen it
STOOD_ON, LEFT, SEEN = 1.0, 2.0, 3.0


@equation
def component_of(reading: Reading, component: int) -> tuple[float, float]:
    """A reading's value and stated variance of component 0, 1 or 2."""
    value = reading.value_0 if component == 0 else (reading.value_1 if component == 1 else reading.value_2)
    stated = reading.variance_0 if component == 0 else (reading.variance_1 if component == 1 else reading.variance_2)
    return value, stated


# -- an external position -----------------------------------------------------------------------------------
@procedure
def take_pose(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """An external position in the local frame."""
    s = load_place_settings(p)
    for axis in range(3):
        for lane in range(len(lanes)):
            reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
            value, stated = component_of(reading, axis)
            variance = stated if np.isfinite(stated) else s.pose_sigma_m * s.pose_sigma_m
            put(work, lanes, lane, value, variance, usable(reading, value, variance, started))
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
    told = stated if component == 2 else stated * across
    reason = usable_in_flight(reading, reading.value_0 + reading.value_1 + distance, 0.0, started)
    near = distance < LEAST_PAD_DISTANCE_M
    return OUT_OF_RANGE if reason == FUSED and near else reason, told if np.isfinite(stated) else sigma * sigma


@procedure
def take_pad(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """The pad from the lens. Its place is a state: the first fix finds it, every one tells both it and the vehicle."""
    s = load_place_settings(p)
    for lane in range(len(lanes)):
        reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
        reason, _ = judge_pad(reading, 0, started, s)
        if reason == FUSED and work[PAD_KNOWN * len(lanes) + lane] < SEEN:
            find_pad(work, lanes, lane, t_s, reading, s, o)
    for component in range(3):
        for lane in range(len(lanes)):
            reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
            reason, variance = judge_pad(reading, component, started, s)
            value, _ = component_of(reading, component)
            put(work, lanes, lane, reading.value_0, variance, reason)
            work[OBSERVATION * len(lanes) + lane] = value
            work[(MEASURED + 1) * len(lanes) + lane] = reading.value_1
            work[(MEASURED + 2) * len(lanes) + lane] = reading.value_2
        pad_fix(work, lanes, component, s.pad_below_m, s.pad_forward_m, s.pad_right_m)
        conclude(work, lanes, t_s, sensor, component, s.gate_sigma, o)
        note_height(work, lanes, t_s)
        note_aid(work, lanes, t_s, o)
        if component < 2:
            count_strays(work, lanes, component)


@equation
def count_strays(work: Work, lanes: Lanes, component: int) -> None:
    """A pad that the camera sees elsewhere, fix after fix, is not where it was first seen: the next fix finds it anew.

    The first fix may have been of something else, and its place, once believed, would refuse all true ones.
    """
    for lane in range(len(lanes)):
        reason, strays = work[REASON * len(lanes) + lane], work[PAD_STRAYS * len(lanes) + lane]
        whole = component == 1 and reason == FUSED and work[ASTRAY * len(lanes) + lane] == 0.0
        strays = strays + 1.0 if reason == INNOVATION_GATE else (0.0 if whole else strays)
        work[ASTRAY * len(lanes) + lane] = 1.0 if component == 0 and reason == INNOVATION_GATE else 0.0
        astray = strays >= MANY_STRAYS
        work[PAD_STRAYS * len(lanes) + lane] = 0.0 if astray else strays
        work[PAD_KNOWN * len(lanes) + lane] = LEFT if astray else work[PAD_KNOWN * len(lanes) + lane]


@procedure
def find_pad(work: Work, lanes: Lanes, lane: int, t_s: float, reading: Reading, s: PlaceSettings, o: Output) -> None:
    """The pad is unknown but for this fix, which is about to be fused."""
    rotation = rotation_of(work, lanes, lane)
    depth = reading.value_2 / np.sqrt(reading.value_0 * reading.value_0 + reading.value_1 * reading.value_1 + 1.0)
    ahead, side = reading.value_0 * depth + s.pad_forward_m, reading.value_1 * depth + s.pad_right_m
    off = to_earth(rotation, ahead, side, depth + s.pad_below_m)
    total = 0.0
    for i in range(3):
        place = work[(STATE + POSITION + i) * len(lanes) + lane] + off[i]
        work[(STATE + PAD + i) * len(lanes) + lane] = place
        reset_state(work, lanes, lane, PAD + i, UNKNOWN_M * UNKNOWN_M, o)
        total += place * place
    work[PAD_KNOWN * len(lanes) + lane] = SEEN
    write_event(lanes, lane, t_s, PAD_FOUND, np.sqrt(total), o)


# -- at rest ------------------------------------------------------------------------------------------------
@procedure
def take_landed(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """On the ground: no velocity, and before a flight the pad is where the vehicle stands. In flight, nothing."""
    s = load_place_settings(p)
    for lane in range(len(lanes)):
        aid, reading = load_aid(work, lanes, lane), load_reading(work, lanes, lane)
        landed = reading.value_0 if reading.arrived > 0.0 else aid.landed
        store_aid(work, lanes, lane, AidMemory(aid.aided_s, aid.flag, aid.height_s, landed))
    variance = s.still_sigma_m_s * s.still_sigma_m_s
    for axis in range(3):
        for lane in range(len(lanes)):
            reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
            reason = usable(reading, reading.value_0, variance, started)
            put(work, lanes, lane, 0.0, variance, reason if reading.value_0 > ON_GROUND else SILENT)
        velocity_itself(work, lanes, axis)
        conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)
        note_aid(work, lanes, t_s, o)
    stand_on_pad(work, lanes, t_s, s, o)


@procedure
def stand_on_pad(work: Work, lanes: Lanes, t_s: float, s: PlaceSettings, o: Output) -> None:
    """The place of take-off is the pad until a camera sees one: a state tied to the vehicle's own while it stands, so
    that what GPS later tells of the one it tells of the other, and the way back is known better than either. A
    vehicle that is carried about before its flight takes the pad along.
    """
    standing = False
    for lane in range(len(lanes)):
        reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
        known = work[PAD_KNOWN * len(lanes) + lane]
        sound = usable(reading, reading.value_0, 0.0, started) == FUSED
        landed = sound and reading.value_0 > ON_GROUND
        off_n = work[(STATE + PAD) * len(lanes) + lane] - work[(STATE + POSITION) * len(lanes) + lane]
        off_e = work[(STATE + PAD + 1) * len(lanes) + lane] - work[(STATE + POSITION + 1) * len(lanes) + lane]
        carried = known == STOOD_ON and off_n * off_n + off_e * off_e > CARRIED_M * CARRIED_M
        if landed and (known == 0.0 or carried):
            for i in range(3):
                work[(STATE + PAD + i) * len(lanes) + lane] = work[(STATE + POSITION + i) * len(lanes) + lane]
                reset_state(work, lanes, lane, PAD + i, UNKNOWN_M * UNKNOWN_M, o)
            known = STOOD_ON
        known = LEFT if sound and not landed and known == STOOD_ON else known
        work[PAD_KNOWN * len(lanes) + lane] = known
        standing = standing or (landed and known == STOOD_ON)
    if not standing:
        return
    for axis in range(3):
        for lane in range(len(lanes)):
            reading = load_reading(work, lanes, lane)
            on_it = work[PAD_KNOWN * len(lanes) + lane] == STOOD_ON and reading.arrived > 0.0
            put(work, lanes, lane, 0.0, STANDING_SIGMA_M * STANDING_SIGMA_M, FUSED if on_it else SILENT)
        pad_below(work, lanes, axis)
        fuse_offered(work, lanes, s.gate_sigma, o)
