"""Height readings: the rangefinder over ground whose level is a state, and the barometer with its offset."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.compile import Lanes, Work, cos, equation, exp, procedure, smaller
from flownav.estimation.covariance import expect, variance_of
from flownav.estimation.hypotheses import RANGE_OFFSET, sign_all
from flownav.estimation.laws.height import baro_altitude, range_along_boresight
from flownav.estimation.motion import rotation_of
from flownav.estimation.states import (
    BARO,
    GROUND,
    INNOVATION,
    INNOVATION_VARIANCE,
    NOISE,
    OFFERED,
    POSITION,
    STATE,
    STATES,
    VELOCITY,
)
from flownav.navigation.journal import reset_state
from flownav.navigation.memory import (
    BARO_KNOWN,
    REASON,
    load_aid,
    load_echo,
    load_ground,
    load_range,
    load_reading,
    load_start,
    store_echo,
    store_ground,
    store_range,
)
from flownav.navigation.offers import conclude, fuse_offered, note_height, put, usable_in_flight
from flownav.navigation.packed import load_height_settings
from flownav.navigation.reasons import DATUM, FUSED, INNOVATION_GATE, OUT_OF_RANGE, SILENT, STUCK, TILTED
from flownav.navigation.records import EchoMemory, GroundMemory, RangeMemory, Reading
from flownav.navigation.tape import BARO_FOUND, GROUND_FOUND, GROUND_RESET, RANGE_STUCK, Output, write_event
from flownav.navigation.told import HeightSettings
from flownav.navigation.trust import OF_BARO, OF_RANGE, follow_noise, scale_noise, watch_whiteness
from flownav.navigation.vibration import doubt_imu

UNKNOWN_M = 100.0
DOUBTING_S = 0.05  # a range that alone tells the height and is refused so long is believed, not the accelerometer
AGREEMENT_M, AGREEMENT_SHARE = 0.2, 0.05  # ranges of one ground agree so far
LEAST_AGREEING = 3.0
STILL_S = 1.0  # a range that repeats itself so long while a ground is sought is of a vehicle that stands
ECHO_M, ECHO_SHARE = 0.1, 0.03  # neighbouring ranges of one ground differ by no more
ECHOES = 20.0  # ranges over which strays are counted
STRAY_SHARE = 1.5  # some strays confirm each other
STRAY_SPAN_M = 5.0
MANY_STRAYS, FEW_STRAYS = 0.15, 0.02  # so many tell nothing of the ground's level, or of the accelerometer; so few none
UNSEEN_M_S = 1.0  # a range that repeats itself may hide this climb or descent
LONGEST_REPEAT_S = 2.0  # nobody hovers so still for longer: a sensor out of its reach says the same for ever
SERVED_S = 1.0  # before it began to repeat itself, that a range was fused
ALONE = 5.0  # times the travel, where nothing else tells the height


class Height(NamedTuple):
    """What the filter says of a lane's height: down and its speed's standard deviation, and R_33."""

    pos_d_m: float
    speed_sigma_m_s: float
    upright: float


@equation
def range_variance(range_m: float, sigma_m: float, relative_sigma: float) -> float:
    """Variance of a range reading [m2]: a floor and a share of the range."""
    share = relative_sigma * range_m
    return sigma_m * sigma_m + share * share


@equation
def repeated_variance(variance: float, lasting_s: float) -> float:
    """Variance of a range [m2] that has been the same to the last digit for so long: what may have gone unseen."""
    unseen_m = UNSEEN_M_S * lasting_s
    return variance + unseen_m * unseen_m


@equation
def repeats(t_s: float, m: RangeMemory, height: Height, alone: bool, s: HeightSettings) -> bool:
    """Whether the range has repeated one value to the last digit for long: no news, and not what a vehicle does.

    In a still hover a sensor of 1 cm repeats itself for a second or two, and is right; it served until then. One that
    says the same from the first on, or while the height travels, or for ever, is out of its reach, or stuck.
    Where no barometer, GPS or pad has told the height lately, the range is all there is, and it is believed unless
    the height travels by more than the filter's own drift.
    """
    lasting_s = t_s - m.same_s
    travelled = abs(height.pos_d_m - m.down_m)
    drift = 3.0 * height.speed_sigma_m_s * lasting_s
    served = m.taken_s >= m.same_s - SERVED_S
    told = s.range_stuck_travel_m if served and lasting_s < LONGEST_REPEAT_S else 0.0
    least = ALONE * s.range_stuck_travel_m + drift if alone else told
    return lasting_s >= s.range_stuck_s and travelled >= least


@equation
def judge_range(
    reading: Reading, t_s: float, started: float, height: Height, alone: bool, m: RangeMemory, s: HeightSettings
) -> tuple[int, float, RangeMemory]:
    """Verdict, variance and what is remembered of one range [m] along the boresight."""
    range_m = reading.value_0
    stated = reading.variance_0
    variance = stated if np.isfinite(stated) else range_variance(range_m, s.range_sigma_m, s.range_relative_sigma)
    reason = usable_in_flight(reading, range_m, variance, started)
    within = range_m >= s.range_min_m and range_m <= s.range_max_m
    reason = OUT_OF_RANGE if reason == FUSED and not within else reason
    reason = TILTED if reason == FUSED and height.upright < cos(s.tilt_limit_rad) else reason
    news = range_m != m.last_m
    stuck = reason == FUSED and not news and repeats(t_s, m, height, alone, s)
    variance = variance if news or alone else repeated_variance(variance, t_s - m.same_s)
    heard = reason == FUSED
    after = RangeMemory(
        m.taken_s,
        m.refused_s,
        range_m if heard and news else m.last_m,
        t_s if heard and news else m.same_s,
        height.pos_d_m if heard and news else m.down_m,
        m.said_s,
        m.doubted,
    )
    return STUCK if stuck else reason, variance, after


@equation
def followed_echo(range_m: float, down_m: float, m: EchoMemory) -> EchoMemory:
    """A range is a stray where neither of the two before it confirms it, moved by the climb since or not (the filter
    may err in that); and the share of strays.
    """
    near = ECHO_M + ECHO_SHARE * range_m
    newest = smaller(abs(range_m - m.newest_m), abs(range_m - m.newest_m + down_m - m.newest_down_m))
    older = smaller(abs(range_m - m.older_m), abs(range_m - m.older_m + down_m - m.older_down_m))
    strays = newest > near and older > near  # false of the first
    stray = m.stray + (1.0 - m.stray) / ECHOES if strays else m.stray * (1.0 - 2.0 / ECHOES)
    return EchoMemory(range_m, down_m, m.newest_m, m.newest_down_m, stray)


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


@equation
def judge_ground(below_m: float, range_m: float, t_s: float, alone: bool, g: GroundMemory) -> tuple[bool, GroundMemory]:
    """Whether ranges in a row agree on a ground that is new, and the memory of it.

    One echo finds no ground. A range that repeats itself to the last digit must do so for long: a vehicle that stands
    reads so, and so does a sensor that holds an old value for a moment. Where nothing else tells the height, the first
    range must serve, before the vertical speed is lost.
    """
    agrees = g.agreeing > 0.0 and abs(below_m - g.candidate_m) <= AGREEMENT_M + AGREEMENT_SHARE * range_m
    since_s = g.since_s if agrees else t_s
    first_m = g.first_m if agrees else range_m
    count = g.agreeing + 1.0 if agrees else 1.0
    varied = 1.0 if agrees and (g.varied > 0.0 or range_m != first_m) else 0.0
    lasting = varied > 0.0 or t_s - since_s >= STILL_S
    first = alone and g.known == 0.0
    return first or (count >= LEAST_AGREEING and lasting), GroundMemory(
        g.known, below_m, since_s, first_m, count, varied
    )


@procedure
def take_range(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """Height over the ground below. Where range is refused for long, the ground has a step."""
    s = load_height_settings(p)
    for lane in range(len(lanes)):
        reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
        height = height_of(work, lanes, lane)
        alone = t_s - load_aid(work, lanes, lane).height_s > s.height_hold_s
        reason, variance, m = judge_range(reading, t_s, started, height, alone, load_range(work, lanes, lane), s)
        if reason == STUCK and abs(height.pos_d_m - m.down_m) >= s.range_stuck_travel_m and m.said_s != m.same_s:
            write_event(lanes, lane, t_s, RANGE_STUCK, reading.value_0, o)
            m = RangeMemory(m.taken_s, m.refused_s, m.last_m, m.same_s, m.down_m, m.same_s, m.doubted)
        store_range(work, lanes, lane, m)
        if reason == FUSED:
            echo = followed_echo(reading.value_0, height.pos_d_m, load_echo(work, lanes, lane))
            store_echo(work, lanes, lane, echo)
        if reason == FUSED and load_ground(work, lanes, lane).known == 0.0:
            found = seek_ground(work, lanes, lane, t_s, reading, height, alone, s, GROUND_FOUND, o)
            reason = FUSED if found else DATUM
        put(work, lanes, lane, reading.value_0, variance, reason)
    range_along_boresight(work, lanes, 0, s.range_below_m, s.range_forward_m, s.range_right_m)
    scale_noise(work, lanes, OF_RANGE)
    weigh_strays(work, lanes)
    sign_all(work, lanes, RANGE_OFFSET, 1.0)
    conclude(work, lanes, t_s, sensor, 0, s.gate_sigma, o)
    watch_whiteness(work, lanes, t_s, 2)
    follow_noise(work, lanes, t_s, OF_RANGE, s.gate_sigma)
    again = False
    for lane in range(len(lanes)):
        again = mind_refusals(work, lanes, lane, t_s, s, o) or again
    if again:  # the ground was found anew: the reading that said so is fused
        range_along_boresight(work, lanes, 0, s.range_below_m, s.range_forward_m, s.range_right_m)
        fuse_offered(work, lanes, s.gate_sigma, o)


@procedure
def weigh_strays(work: Work, lanes: Lanes) -> None:
    """NOISE of a range among strays, in the lanes where there are any."""
    any_strays = False
    for lane in range(len(lanes)):
        any_strays = any_strays or load_echo(work, lanes, lane).stray > FEW_STRAYS
        work[OFFERED * len(lanes) + lane] = 0.0
    if not any_strays:
        return
    expect(work, lanes, STATES, True)
    for lane in range(len(lanes)):
        stray = load_echo(work, lanes, lane).stray
        innovation, total = work[INNOVATION * len(lanes) + lane], work[INNOVATION_VARIANCE * len(lanes) + lane]
        variance = work[NOISE * len(lanes) + lane]
        weighed = stray_variance(innovation, total, variance, stray)
        work[NOISE * len(lanes) + lane] = weighed if stray > FEW_STRAYS else variance


@procedure
def seek_ground(
    work: Work, lanes: Lanes, lane: int, t_s: float, reading: Reading, height: Height, alone: bool, s: HeightSettings,
    kind: np.int_, o: Output,
) -> bool:  # fmt: skip
    """Note a range that would mean a new ground; where enough agree, the ground is unknown but for the newest of them,
    which is about to be fused.
    """
    below_m = height.pos_d_m + (reading.value_0 + s.range_below_m) * height.upright
    confirmed, g = judge_ground(below_m, reading.value_0, t_s, alone, load_ground(work, lanes, lane))
    if confirmed:
        work[(STATE + GROUND) * len(lanes) + lane] = below_m
        reset_state(work, lanes, lane, GROUND, UNKNOWN_M * UNKNOWN_M, o)
        write_event(lanes, lane, t_s, kind, below_m, o)
        store_ground(work, lanes, lane, GroundMemory(1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        m = load_range(work, lanes, lane)
        store_range(work, lanes, lane, RangeMemory(t_s, np.nan, m.last_m, m.same_s, m.down_m, m.said_s, m.doubted))
    else:
        store_ground(work, lanes, lane, g)
    return bool(confirmed)


@equation
def height_of(work: Work, lanes: Lanes, lane: int) -> Height:
    """What the filter says of a lane's height."""
    return Height(
        work[(STATE + POSITION + 2) * len(lanes) + lane],
        np.sqrt(variance_of(work, lanes, VELOCITY + 2, lane)),
        rotation_of(work, lanes, lane)[8],
    )


@procedure
def mind_refusals(work: Work, lanes: Lanes, lane: int, t_s: float, s: HeightSettings, o: Output) -> bool:
    """After the test: a range that is refused first makes the accelerometer doubted, then the ground new.

    A streak of refusals ends where the sensor says something else. True where the ground of this lane was found anew,
    and the reading is to be offered once more.
    """
    reason = work[REASON * len(lanes) + lane]
    m, g = load_range(work, lanes, lane), load_ground(work, lanes, lane)
    work[REASON * len(lanes) + lane] = SILENT  # of the second offer, unless the ground is new
    if reason == FUSED or reason == OUT_OF_RANGE:  # noqa: SIM109
        taken_s = t_s if reason == FUSED else m.taken_s
        store_range(work, lanes, lane, RangeMemory(taken_s, np.nan, m.last_m, m.same_s, m.down_m, m.said_s, m.doubted))
        store_ground(work, lanes, lane, GroundMemory(g.known, 0.0, 0.0, 0.0, 0.0, 0.0))
    if reason != INNOVATION_GATE:
        return False
    first = not np.isfinite(m.refused_s)
    since_s = t_s if first else m.refused_s
    doubted = 0.0 if first else m.doubted
    alone = t_s - load_aid(work, lanes, lane).height_s > s.height_hold_s
    strays = load_echo(work, lanes, lane).stray > MANY_STRAYS
    if alone and doubted == 0.0 and not strays and t_s - since_s >= DOUBTING_S:
        doubt_imu(work, lanes, lane, t_s, work[INNOVATION * len(lanes) + lane], o)
        doubted = 1.0  # once: doubted at each reading, a short echo would be believed too
    store_range(work, lanes, lane, RangeMemory(m.taken_s, since_s, m.last_m, m.same_s, m.down_m, m.said_s, doubted))
    if g.known == 0.0 or strays:
        return False
    reading, height = load_reading(work, lanes, lane), height_of(work, lanes, lane)
    if t_s - since_s < s.ground_reset_s:
        below_m = height.pos_d_m + (reading.value_0 + s.range_below_m) * height.upright
        store_ground(work, lanes, lane, judge_ground(below_m, reading.value_0, t_s, False, g)[1])
        return False
    found = seek_ground(work, lanes, lane, t_s, reading, height, False, s, GROUND_RESET, o)
    if found:
        work[REASON * len(lanes) + lane] = FUSED
    return found


@equation
def judge_baro(reading: Reading, started: float, s: HeightSettings) -> tuple[int, float]:
    """Verdict and variance of a pressure altitude [m]."""
    stated = reading.variance_0
    variance = stated if np.isfinite(stated) else s.baro_sigma_m * s.baro_sigma_m
    return usable_in_flight(reading, reading.value_0, variance, started), variance


@procedure
def take_baro(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """Height from pressure; the first reading finds the offset."""
    s = load_height_settings(p)
    for lane in range(len(lanes)):
        reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
        reason, variance = judge_baro(reading, started, s)
        if reason == FUSED and work[BARO_KNOWN * len(lanes) + lane] == 0.0:
            offset = reading.value_0 + work[(STATE + POSITION + 2) * len(lanes) + lane]
            work[(STATE + BARO) * len(lanes) + lane] = offset
            reset_state(work, lanes, lane, BARO, UNKNOWN_M * UNKNOWN_M, o)
            work[BARO_KNOWN * len(lanes) + lane] = 1.0
            write_event(lanes, lane, t_s, BARO_FOUND, offset, o)
        put(work, lanes, lane, reading.value_0, variance, reason)
    baro_altitude(work, lanes, 0)
    scale_noise(work, lanes, OF_BARO)
    conclude(work, lanes, t_s, sensor, 0, s.gate_sigma, o)
    follow_noise(work, lanes, t_s, OF_BARO, s.gate_sigma)
    note_height(work, lanes, t_s)
