"""Ranges: height over ground whose level is a state."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, cos, equation, procedure, replacing, smaller
from flownav.estimation.hypotheses import RANGE_OFFSET
from flownav.estimation.laws.height import range_along_boresight
from flownav.estimation.states import GROUND, POSITION
from flownav.navigation import calls
from flownav.navigation.kernel_settings import HeightSettings
from flownav.navigation.motion_records import ImuMemory
from flownav.navigation.offers import FEW_STRAYS, conclude, fuse_offered, weigh_strays
from flownav.navigation.packed import load_height_settings
from flownav.navigation.place import ON_GROUND
from flownav.navigation.reasons import (
    DATUM,
    FUSED,
    INNOVATION_GATE,
    OUT_OF_RANGE,
    SILENT,
    STUCK,
    TILTED,
    judged,
    objecting,
    stated_or,
    usable_in_flight,
)
from flownav.navigation.records import (
    AidMemory,
    EchoMemory,
    GroundMemory,
    RangeMemory,
    RangingMemory,
    Reading,
    StartMemory,
    WitnessMemory,
)
from flownav.navigation.tape import GROUND_FOUND, GROUND_RESET, RANGE_STUCK, Output
from flownav.navigation.trust import OF_RANGE, creeps, follow_noise, watch_whiteness
from flownav.navigation.verdicts import (
    NO_EVENT,
    NO_RESET,
    UNKNOWN_M,
    Doubt,
    Event,
    Fate,
    Height,
    Left,
    Offer,
    Reset,
    Sign,
    Tested,
    on_lanes,
)
from flownav.navigation.vibration import doubted_imu

# Logs are those of ../shared/data; a stray is a range that neither of the two before it confirms.
# Refused so long, a range that alone gives the height is believed, not the accelerometer: chosen; at once, a lone echo
# would make the accelerometer doubted.
DOUBTING_S = 0.05
LEANING_SHARE = 0.5  # of a range that is fused in the mean of those before it
AGREEMENT_M, AGREEMENT_SHARE = 0.2, 0.05  # ranges of one ground agree so far: chosen, not measured
LEAST_AGREEING = 3.0  # one echo finds no ground; a roof of 1.2 m is found after 1.45 s (test_navigation_safeguards)
STILL_S = 1.0  # a range that repeats itself so long while a ground is sought is of a vehicle that stands: not measured
ECHO_M, ECHO_SHARE = 0.1, 0.03  # outdoor: 99 % of neighbours differ by 0.04 m or less, 1 in 10^4 is a stray
STRAYS_OVER_RANGES = 20.0  # chosen; nine that agree then end a step of the ground (test_navigation_safeguards)
MANY_STRAYS = 0.15  # sonars that jump have 0.11 (outdoor-3) and 0.78 (outdoor-2) of strays, sound ones 0.02 at most
UNSEEN_M_S = 1.0  # climb or descent that a repeated range may hide: chosen, what it weighs is held by test_judges
LONGEST_REPEAT_S = 2.0  # a still hover repeats one value for 1.9 s (outdoor), a range beyond reach for 2.1 (outdoor-3)
SERVED_S = 1.0  # believing a range that is constant from the first on, 436 of 480 gusty approaches land; else 455
UNAIDED_TRAVEL_RATIO = 5.0  # times the travel, where nothing else measures the height: chosen, held by test_judges


with_value = replacing(RangeMemory, "last_m", "same_s", "down_m")
with_report = replacing(RangeMemory, "stuck_s")
with_taken = replacing(RangeMemory, "taken_s", "refused_s")
with_sigmas = replacing(RangeMemory, "sigmas", "off_m")
with_test = replacing(RangeMemory, "tested_s", "contradiction_m", "before_m")
with_refusal = replacing(RangeMemory, "refused_s", "doubted")
without_candidate = replacing(GroundMemory, "candidate_m", "since_s", "first_m", "agreeing", "varied")


@equation
def range_variance(range_m: float, sigma_m: float, relative_sigma: float) -> float:
    """Variance of a range reading [m2]: a floor and a share of the range."""
    share = relative_sigma * range_m
    return sigma_m * sigma_m + share * share


@equation
def repeated_variance(variance: float, lasting_s: float) -> float:
    """Variance of a range [m2] that has repeated one value for lasting_s, with the change that may be undetected."""
    unseen_m = UNSEEN_M_S * lasting_s
    return variance + unseen_m * unseen_m


@equation
def repeats(t_s: float, m: RangeMemory, height: Height, alone: bool, s: HeightSettings) -> bool:
    """Whether the range has repeated one value to the last digit for so long that it carries no information and no
    vehicle does so.

    In a still hover a sensor of 1 cm repeats itself for a second or two, and is right; it served until then. One that
    repeats a value from the first reading on, or while the height travels, or for ever, is out of its reach, or stuck.
    Where no barometer, GPS or pad has measured the height lately, the range is all there is, and it is believed unless
    the height travels by more than the filter's own drift.
    """
    lasting_s = t_s - m.same_s
    travelled = abs(height.pos_d_m - m.down_m)
    drift = 3.0 * height.speed_sigma_m_s * lasting_s
    served = m.taken_s >= m.same_s - SERVED_S
    least_served = s.range_stuck_travel_m if served and lasting_s < LONGEST_REPEAT_S else 0.0
    least = UNAIDED_TRAVEL_RATIO * s.range_stuck_travel_m + drift if alone else least_served
    return lasting_s >= s.range_stuck_s and travelled >= least


@equation
def range_verdict(
    reading: Reading, t_s: float, started: float, height: Height, alone: bool, m: RangeMemory, s: HeightSettings
) -> tuple[int, float, RangeMemory]:
    """Verdict, variance and memory of one range [m] along the boresight."""
    range_m = reading.value_0
    once = stated_or(reading.variance_0, range_variance(range_m, s.range_sigma_m, s.range_relative_sigma))
    within = range_m >= s.range_min_m and range_m <= s.range_max_m
    reach = objecting(FUSED if within else OUT_OF_RANGE, height.upright < cos(s.tilt_limit_rad), TILTED)
    news = range_m != m.last_m
    stuck = not news and repeats(t_s, m, height, alone, s)
    reason = judged(usable_in_flight(reading, range_m, once, started), reach, stuck, FUSED)
    variance = once if news or alone else repeated_variance(once, t_s - m.same_s)
    after = with_value(m, last_m=range_m, same_s=t_s, down_m=height.pos_d_m) if reason == FUSED and news else m
    return reason, variance, after


@equation
def followed_echo(range_m: float, down_m: float, m: EchoMemory) -> EchoMemory:
    """A range is a stray where neither of the two before it confirms it, moved by the climb since or not (the filter
    may err in that); and the share of strays.
    """
    near = ECHO_M + ECHO_SHARE * range_m
    newest = smaller(abs(range_m - m.newest_m), abs(range_m - m.newest_m + down_m - m.newest_down_m))
    older = smaller(abs(range_m - m.older_m), abs(range_m - m.older_m + down_m - m.older_down_m))
    strays = newest > near and older > near  # false of the first
    stray = m.stray + (1.0 - m.stray) / STRAYS_OVER_RANGES if strays else m.stray * (1.0 - 2.0 / STRAYS_OVER_RANGES)
    return EchoMemory(range_m, down_m, m.newest_m, m.newest_down_m, stray)


@equation
def judge_ground(below_m: float, range_m: float, t_s: float, alone: bool, g: GroundMemory) -> tuple[bool, GroundMemory]:
    """Whether ranges in a row agree on a ground that is new, and the memory of it.

    One echo finds no ground. A range that repeats itself to the last digit must do so for long: a vehicle that stands
    reads so, and so does a sensor that holds an old value for a moment. Where nothing else measures the height, the
    first range must serve, before the vertical speed is lost.
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


# -- the rangefinder's way --------------------------------------------------------------------------------------
class Sought(NamedTuple):
    """A ground that is sought: whether ranges agree on a new one, and then where it is."""

    found: bool
    ground: GroundMemory
    reset: Reset
    event: Event


@equation
def sought_ground(
    reading: Reading, t_s: float, height: Height, alone: bool, g: GroundMemory, kind: np.int_, s: HeightSettings
) -> Sought:
    """Note a range that would mean a new ground; where enough agree, the ground is unknown but for the newest of them,
    which is about to be fused.
    """
    below_m = height.pos_d_m + (reading.value_0 + s.range_below_m) * height.upright
    found, after = judge_ground(below_m, reading.value_0, t_s, alone, g)
    return Sought(
        found,
        GroundMemory(1.0, 0.0, 0.0, 0.0, 0.0, 0.0) if found else after,
        Reset(GROUND if found else -1, below_m, UNKNOWN_M * UNKNOWN_M),
        Event(kind if found else -1, below_m),
    )


class RangeVerdict(NamedTuple):
    """Verdict on a range: memory, events, reset, sign of an offset, and offer."""

    memory: RangingMemory
    stuck: Event
    reset: Reset
    found: Event
    offset: Sign
    offer: Offer


@on_lanes(calls.judge_range)
def judge_range(
    reading: Reading, start: StartMemory, height: Height, aid: AidMemory, memory: RangingMemory, noise: WitnessMemory,
    *, t_s: float, s: HeightSettings,
) -> RangeVerdict:  # fmt: skip
    """A range along the boresight: whether it may be fused, whether it is stuck, and the first ground that it finds."""
    m, echo, g = memory
    alone = t_s - aid.height_s > s.height_hold_s
    reason, variance, m = range_verdict(reading, t_s, start.started, height, alone, m, s)
    still = reason == STUCK and abs(height.pos_d_m - m.down_m) >= s.range_stuck_travel_m and m.stuck_s != m.same_s
    m = with_report(m, stuck_s=m.same_s) if still else m
    taken = reason == FUSED
    echo = followed_echo(reading.value_0, height.pos_d_m, echo) if taken else echo
    sought = sought_ground(reading, t_s, height, alone, g, GROUND_FOUND, s)
    seeks = taken and g.known == 0.0
    found = seeks and sought.found
    return RangeVerdict(
        RangingMemory(
            with_taken(m, taken_s=t_s, refused_s=np.nan) if found else m, echo, sought.ground if seeks else g
        ),
        Event(RANGE_STUCK if still else -1, reading.value_0),
        sought.reset if found else NO_RESET,
        sought.event if found else NO_EVENT,
        Sign(RANGE_OFFSET, 1.0),
        Offer(reading.value_0, variance * noise.factor, DATUM if seeks and not found else reason),
    )


class Refusal(NamedTuple):
    """Consequences of a range's fate. again: the ground was found anew, and the reading is offered once more."""

    fate: Fate
    memory: RangingMemory
    imu: ImuMemory
    doubts: tuple[Doubt, Doubt, Doubt, Doubt, Doubt, Doubt]
    doubted: Event
    reset: Reset
    found: Event
    left: Left
    again: bool


@on_lanes(calls.judge_refusal)
def judge_refusal(
    tested: Tested, reading: Reading, height: Height, aid: AidMemory, memory: RangingMemory, imu: ImuMemory,
    *, t_s: float, s: HeightSettings,
) -> Refusal:  # fmt: skip
    """After the test: a range that is refused first makes the accelerometer doubted, then the ground new.

    The accelerometer is doubted where the range crept out of its gate and stays out, or alone measures the height. A
    streak of refusals ends where the sensor reads something else. The ground is found anew where ranges agree on it for
    long, and where they do not, its candidate is followed; a vehicle that stands stands on the ground it has. Whether
    it was a step of the ground or the height was wrong, nobody knows: by so much the height may be off.
    """
    m, echo, g = memory
    fused, refused = tested.reason == FUSED, tested.reason == INNOVATION_GATE
    strays = echo.stray > MANY_STRAYS
    since_s = m.refused_s if np.isfinite(m.refused_s) else t_s
    doubted_before = m.doubted if np.isfinite(m.refused_s) else 0.0
    lasting_s = t_s - since_s
    alone = t_s - aid.height_s > s.height_hold_s
    second = refused and np.isfinite(m.refused_s) and doubted_before == 0.0 and echo.stray <= FEW_STRAYS
    crept = second and creeps(tested, t_s, m, s.gate_sigma)
    long = alone and doubted_before == 0.0 and lasting_s >= DOUBTING_S
    doubts = refused and not strays and (long or crept)
    by_m = tested.innovation if doubts else 0.0
    # once: at each, a short echo would be believed too
    imu_after, doubt_event, freed = doubted_imu(by_m, doubts, crept, imu)
    sought = sought_ground(reading, t_s, height, False, g, GROUND_RESET, s)
    seeks = refused and g.known > 0.0 and not strays and aid.landed <= ON_GROUND
    again = seeks and lasting_s >= s.ground_reset_s and sought.found
    waits = seeks and (lasting_s < s.ground_reset_s or not sought.found)
    ends = fused or tested.reason == OUT_OF_RANGE
    ground = without_candidate(g, 0.0, 0.0, 0.0, 0.0, 0.0) if ends else g
    below_m = height.pos_d_m + (reading.value_0 + s.range_below_m) * height.upright
    followed = judge_ground(below_m, reading.value_0, t_s, False, g)[1]
    after = with_taken(m, taken_s=t_s if fused else m.taken_s, refused_s=np.nan) if ends else m
    leaning = m.sigmas + LEANING_SHARE * (tested.innovation / np.sqrt(tested.total) - m.sigmas)
    after = with_sigmas(
        after, sigmas=leaning if fused else m.sigmas, off_m=tested.innovation if fused else m.off_m
    )  # fmt: skip
    tests = fused or refused
    after = with_test(
        after,
        tested_s=t_s if tests else m.tested_s,
        contradiction_m=tested.innovation if tests else m.contradiction_m,
        before_m=m.contradiction_m if tests else m.before_m,
    )
    after = with_refusal(after, refused_s=since_s, doubted=1.0 if doubts else doubted_before) if refused else after
    return Refusal(
        Fate(FUSED if again else SILENT),
        RangingMemory(
            with_taken(after, taken_s=t_s, refused_s=np.nan) if again else after,
            echo,
            sought.ground if again else (followed if waits else ground),
        ),
        imu_after,
        freed,
        doubt_event,
        sought.reset if again else NO_RESET,
        sought.event if again else NO_EVENT,
        Left(POSITION + 2, -tested.innovation * height.upright if again else 0.0),
        again,
    )


@procedure
def take_range(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """Height over the ground below. Where range is refused for long, the ground has a step."""
    s = load_height_settings(p)
    judge_range(work, lanes, t_s, s, OF_RANGE, o)
    range_along_boresight(work, lanes, 0, s.range_below_m, s.range_forward_m, s.range_right_m)
    weigh_strays(work, lanes)
    conclude(work, lanes, t_s, sensor, 0, s.gate_sigma, o)
    watch_whiteness(work, lanes, t_s, 2)
    follow_noise(work, lanes, t_s, OF_RANGE, gate_sigma=s.gate_sigma)
    if judge_refusal(work, lanes, t_s, s, o):  # the ground was found anew: the reading that showed it is fused
        range_along_boresight(work, lanes, 0, s.range_below_m, s.range_forward_m, s.range_right_m)
        fuse_offered(work, lanes, s.gate_sigma, o)
