"""GPS position and velocity: a fix is judged as a whole, fused axis by axis, and believed where refused for long."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, larger, procedure, smaller
from flownav.estimation.covariance import covariance_of, expect, states_of, variance_of
from flownav.estimation.laws.gps import gps_position, gps_velocity
from flownav.estimation.laws.still import pad_below
from flownav.estimation.states import (
    FORCE,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    INNOVATION,
    INNOVATION_VARIANCE,
    NOISE,
    OFFERED,
    PAD,
    POSITION,
    STATE,
    VELOCITY,
)
from flownav.measurement import Sensor
from flownav.navigation.journal import reset_state
from flownav.navigation.memory import (
    GPS_FUSED,
    GPS_MOVED,
    LEVEL_RATIO,
    PAD_BESIDE,
    PAD_KNOWN,
    REASON,
    STEADY_FORCE,
    load_flow,
    load_reading,
    load_rejection,
    load_start,
    store_rejection,
)
from flownav.navigation.offers import conclude, fuse_offered, note_aid, note_height, put, usable
from flownav.navigation.packed import load_gps_settings
from flownav.navigation.protection import sign_drift
from flownav.navigation.reasons import FUSED, INNOVATION_GATE, SILENT
from flownav.navigation.records import Reading, RejectionMemory
from flownav.navigation.tape import GPS_RESET, Output, write_event
from flownav.navigation.told import GpsSettings
from flownav.navigation.trust import OF_GPS, follow_noise, scale_noise

LEAST_REJECTIONS = 5
SOON_S = 1.0
UNKNOWN_PAD_M = 100.0
LEAST_PAD_VARIANCE_M2 = 1e-6


@equation
def judge_gps(
    reading: Reading, axis: int, position: bool, started: float, level_ratio: float, s: GpsSettings
) -> tuple[int, float]:
    """Verdict and variance of one axis: the white part of a fix's noise, and a share of the accuracy that it states.

    North and east come of one fix, and a jump along one axis spoils both.
    """
    value = reading.value_0 if axis == 0 else (reading.value_1 if axis == 1 else reading.value_2)
    stated = reading.variance_0 if axis == 0 else (reading.variance_1 if axis == 1 else reading.variance_2)
    white_position = s.gps_white_sigma_down_m if axis == 2 else s.gps_white_sigma_m
    white_velocity = s.gps_velocity_white_down_m_s if axis == 2 else s.gps_velocity_white_m_s
    white = white_position if position else white_velocity
    share = s.gps_white_share * s.gps_white_share * (stated if np.isfinite(stated) else 0.0)
    variance = white * white + share
    reason = usable(reading, value, variance, started)
    spoilt = reason == FUSED and axis < 2 and level_ratio > 1.0
    return INNOVATION_GATE if spoilt else reason, variance


@equation
def judge_rejections(
    refused: bool, soon: bool, t_s: float, m: RejectionMemory, s: GpsSettings
) -> tuple[bool, RejectionMemory]:
    """Whether GPS has been refused for a state so often and so long that the filter is wrong, and the count.

    soon: it is a velocity, or the flow that else would hold the filter is doubted too. Then SOON_S is long enough.
    """
    since_s = m.since_s if m.times > 0.0 else t_s
    count = m.times + 1.0
    patience_s = smaller(s.gps_reset_s, SOON_S) if soon else s.gps_reset_s
    reset = refused and count >= LEAST_REJECTIONS and t_s - since_s >= patience_s
    return reset, RejectionMemory(count if refused and not reset else 0.0, since_s)


@procedure
def take_gps(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """Position or velocity with its lasting errors; where it is refused for long, a reset."""
    s = load_gps_settings(p)
    position = sensor == Sensor.GPS_POSITION
    note_level_ratio(work, lanes, position, s)
    for axis in range(3):
        place = OF_GPS + axis + (0 if position else 3)
        offer_axis(work, lanes, axis, position, False, s)
        scale_noise(work, lanes, place)
        if position:
            sign_drift(work, lanes, t_s, axis)
        conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)
        follow_noise(work, lanes, t_s, place, s.gate_sigma)
        if axis < 2:
            note_aid(work, lanes, t_s, o)
            for lane in range(len(lanes)):
                before_s = work[GPS_FUSED * len(lanes) + lane]
                work[GPS_FUSED * len(lanes) + lane] = t_s if work[REASON * len(lanes) + lane] == FUSED else before_s
        elif position:
            note_height(work, lanes, t_s)
        mind_rejections(work, lanes, t_s, axis, position, s, o)


@procedure
def offer_axis(work: Work, lanes: Lanes, axis: int, position: bool, alone: bool, s: GpsSettings) -> None:
    """One axis of a fix, judged and put before its law. alone: whatever the other axes say."""
    for lane in range(len(lanes)):
        reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
        value = reading.value_0 if axis == 0 else (reading.value_1 if axis == 1 else reading.value_2)
        ratio = 0.0 if alone else work[LEVEL_RATIO * len(lanes) + lane]
        reason, variance = judge_gps(reading, axis, position, started, ratio, s)
        put(work, lanes, lane, value, variance, reason)
    if position:
        gps_position(work, lanes, axis, s.gps_forward_m, s.gps_right_m, s.gps_below_m)
    else:
        for lane in range(len(lanes)):  # the receiver's lag is of the motion, not of the vibration
            steady = work[(STEADY_FORCE + axis) * len(lanes) + lane]
            work[(FORCE + axis) * len(lanes) + lane] = steady
        gps_velocity(work, lanes, axis, s.gps_forward_m, s.gps_right_m, s.gps_below_m)


@procedure
def note_level_ratio(work: Work, lanes: Lanes, position: bool, s: GpsSettings) -> None:
    """LEVEL_RATIO: the larger test ratio of north and east, 0 where the fix cannot be offered."""
    for lane in range(len(lanes)):
        work[LEVEL_RATIO * len(lanes) + lane] = 0.0
    for axis in range(2):
        offer_axis(work, lanes, axis, position, True, s)
        for lane in range(len(lanes)):
            work[OFFERED * len(lanes) + lane] = 0.0
        expect(work, lanes, states_of(lanes), True)
        for lane in range(len(lanes)):
            innovation = work[INNOVATION * len(lanes) + lane]
            variance = work[INNOVATION_VARIANCE * len(lanes) + lane]
            ratio = innovation * innovation / (s.gate_sigma * s.gate_sigma * variance)
            judged = work[REASON * len(lanes) + lane] == FUSED
            before = work[LEVEL_RATIO * len(lanes) + lane]
            work[LEVEL_RATIO * len(lanes) + lane] = ratio if judged and ratio > before else before


@procedure
def mind_rejections(work: Work, lanes: Lanes, t_s: float, axis: int, position: bool, s: GpsSettings, o: Output) -> None:
    """Where GPS has been refused again and again for a state, the filter is wrong: that state goes to GPS.

    An axis that is refused for the other's sake alone does not count.
    """
    place = axis if position else 3 + axis
    moved = False
    for lane in range(len(lanes)):
        ratio = work[INNOVATION * len(lanes) + lane] ** 2
        ratio /= s.gate_sigma * s.gate_sigma * work[INNOVATION_VARIANCE * len(lanes) + lane]
        refused = work[REASON * len(lanes) + lane] == INNOVATION_GATE and ratio > 1.0
        heard = load_reading(work, lanes, lane).arrived > 0.0
        memory = load_rejection(work, lanes, place, lane)
        flow = load_flow(work, lanes, lane)
        doubted = flow.doubted > 0.0 or np.isfinite(flow.wrong_s)
        reset, after = judge_rejections(refused, doubted or not position, t_s, memory, s)
        if heard:
            store_rejection(work, lanes, place, lane, after)
        work[PAD_BESIDE * len(lanes) + lane] = np.nan
        if heard and reset:
            if position and not doubted and work[PAD_KNOWN * len(lanes) + lane] > 0.0:
                note_pad(work, lanes, lane, axis)
                moved = True
            go_to_gps(work, lanes, lane, t_s, axis, position, s, o)
    if moved:
        take_pad_along(work, lanes, axis, s, o)


@equation
def note_pad(work: Work, lanes: Lanes, lane: int, axis: int) -> None:
    """PAD_BESIDE: where the pad is from the vehicle along an axis, and the variance of that."""
    beside = work[(STATE + PAD + axis) * len(lanes) + lane] - work[(STATE + POSITION + axis) * len(lanes) + lane]
    both = variance_of(work, lanes, POSITION + axis, lane) + variance_of(work, lanes, PAD + axis, lane)
    variance = both - 2.0 * covariance_of(work, lanes, PAD + axis, POSITION + axis, lane)
    work[PAD_BESIDE * len(lanes) + lane] = beside
    work[(PAD_BESIDE + 1) * len(lanes) + lane] = larger(variance, LEAST_PAD_VARIANCE_M2)


@procedure
def take_pad_along(work: Work, lanes: Lanes, axis: int, s: GpsSettings, o: Output) -> None:
    """Where the position went to GPS, the pad goes along: flow, which nobody doubts, tells how far it is from there."""
    for lane in range(len(lanes)):
        beside, pad = work[PAD_BESIDE * len(lanes) + lane], STATE + PAD + axis
        goes = np.isfinite(beside)
        if goes:
            work[pad * len(lanes) + lane] = work[(STATE + POSITION + axis) * len(lanes) + lane] + beside
            reset_state(work, lanes, lane, PAD + axis, UNKNOWN_PAD_M * UNKNOWN_PAD_M, o)
        variance = work[(PAD_BESIDE + 1) * len(lanes) + lane]
        put(work, lanes, lane, beside if goes else 0.0, variance if goes else 1.0, FUSED if goes else SILENT)
    pad_below(work, lanes, axis)
    fuse_offered(work, lanes, s.gate_sigma, o)


@procedure
def go_to_gps(
    work: Work, lanes: Lanes, lane: int, t_s: float, axis: int, position: bool, s: GpsSettings, o: Output
) -> None:
    """One state of one lane goes to the fix, its lasting errors are forgotten."""
    reading = load_reading(work, lanes, lane)
    value = reading.value_0 if axis == 0 else (reading.value_1 if axis == 1 else reading.value_2)
    noise = work[NOISE * len(lanes) + lane]
    if position:
        slow = s.gps_slow_sigma_down_m if axis == 2 else s.gps_slow_sigma_m
        fast = s.gps_fast_sigma_down_m if axis == 2 else s.gps_fast_sigma_m
        work[(STATE + GPS_SLOW + axis) * len(lanes) + lane] = 0.0
        work[(STATE + GPS_FAST + axis) * len(lanes) + lane] = 0.0
        reset_state(work, lanes, lane, GPS_SLOW + axis, slow * slow, o)
        reset_state(work, lanes, lane, GPS_FAST + axis, fast * fast, o)
        reset_state(work, lanes, lane, POSITION + axis, slow * slow + fast * fast + noise, o)
    else:
        lasting = s.gps_velocity_sigma_down_m_s if axis == 2 else s.gps_velocity_sigma_m_s
        work[(STATE + GPS_VELOCITY + axis) * len(lanes) + lane] = 0.0
        reset_state(work, lanes, lane, GPS_VELOCITY + axis, lasting * lasting, o)
        reset_state(work, lanes, lane, VELOCITY + axis, lasting * lasting + noise, o)
    state = STATE + (POSITION if position else VELOCITY) + axis
    before = work[state * len(lanes) + lane]
    work[state * len(lanes) + lane] = value
    if position and axis < 2:  # whether GPS jumped or the filter was wrong, nobody knows
        work[(GPS_MOVED + axis) * len(lanes) + lane] += value - before
    write_event(lanes, lane, t_s, GPS_RESET, value - before, o)
