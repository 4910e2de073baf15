"""The scores of a flight kept as it flies, for flights whose history nobody keeps: rows of a lane buffer.

The same columns as `errors.score_block` and `touchdown.touchdowns` compute from histories, epoch by epoch. Sums run in
the same order; a standard deviation is Welford's, so that it agrees to rounding instead of to the bit
(tests/scoring/test_running.py holds both).

B. P. Welford, "Note on a method for calculating corrected sums of squares and products", Technometrics 4 (1962).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import Lanes, arccos, equation, lane_access, larger, magnitude
from flownav.frames import rotation_from_quaternion, to_earth
from flownav.scoring.errors import MAX_POSITION_ERROR, SCORE_COLUMNS, STATES, STATISTICS
from flownav.scoring.touchdown import (
    AIRBORNE_EPOCHS,
    ROLLED_OVER_DEG,
    STILL_DEG_S,
    STILL_EPOCHS,
    STILL_M_S,
    TOUCHDOWN_COLUMNS,
)

Rows = NDArray[np.float64]

ROLLED_OVER = float(np.cos(np.radians(ROLLED_OVER_DEG)))
STILL_RAD_S = float(np.radians(STILL_DEG_S))
OVER_BIT, LOW_BIT = 64.0, 128.0  # of touchdown.BROKEN
# a flight's row: SCORE_COLUMNS, and the largest horizontal error in flight
RUNNING_COLUMNS = len(SCORE_COLUMNS) + 1


class Shown(NamedTuple):
    """What one epoch shows of a flight, and how it counts.

    pos and vel: the truth, NED [m] and body FRD [m/s]; q: its attitude, yaw_rate_rad_s; error: of the estimate,
    position NED and body velocity; flown: horizontal error of what was flown on. counts: this step's errors are scored;
    aloft: and it is in flight, after the pad was noted. seen: the pad's place was to be seen or noted. home: the errors
    of this epoch are what horizontal errors are relative to.
    """

    pos_n: float
    pos_e: float
    pos_d: float
    u: float
    v: float
    w: float
    qw: float
    qx: float
    qy: float
    qz: float
    yaw_rate_rad_s: float
    ground_m: float
    touches: bool
    away: bool
    error_n: float
    error_e: float
    error_d: float
    error_u: float
    error_v: float
    error_w: float
    flown_n: float
    flown_e: float
    counts: bool
    aloft: bool
    seen: bool
    home: bool


class ErrorSums(NamedTuple):
    """Of one state: sum, sum of squares, largest magnitude, running mean and sum of squares about it."""

    total: float
    squares: float
    largest: float
    mean: float
    about_mean: float


class Course(NamedTuple):
    """What must be remembered of the epochs so far; the sides of a contact, and how the flight is going."""

    steps: float  # that are scored
    home_n: float
    home_e: float
    horizontal_sq: float  # largest of a step in flight [m2]; -1: none yet
    contact: float  # its epoch; -1: none
    untouched: float  # epochs without contact
    still: float  # epochs at rest on the ground
    sink_m_s: float  # of the last epoch, with the three that follow
    lateral_m_s: float
    upright: float
    yaw_rad_s: float
    place_n: float  # of the skids' middle, at present
    place_e: float
    seen_n: float  # error of what was flown on when the pad was last seen
    seen_e: float
    over_grounded: float  # 1: rolled over on the ground
    over_since: float  # 1: rolled over since the contact
    low: float  # 1: was below the ground
    away: float
    go_arounds: float


class Touch(NamedTuple):
    """The first contact: place, errors of what was flown on then and when the pad was last seen, motion before it."""

    place_n: float
    place_e: float
    error_n: float
    error_e: float
    seen_n: float
    seen_e: float
    sink_m_s: float
    lateral_m_s: float
    upright: float
    yaw_rad_s: float


load_sums, store_sums = lane_access(ErrorSums, None)
load_course, store_course = lane_access(Course, None)
load_touch, store_touch = lane_access(Touch, None)
SUMS = len(ErrorSums._fields)
COURSE = SUMS * len(STATES)
TOUCH = COURSE + len(Course._fields)
RUNNING_ROWS = TOUCH + len(Touch._fields)


@equation
def begin_scores(work: Rows, lanes: Lanes, row: int) -> None:
    """Nothing seen yet, in the RUNNING_ROWS rows from `row` on."""
    for i in range(RUNNING_ROWS):
        for lane in range(len(lanes)):
            work[(row + i) * len(lanes) + lane] = 0.0
    for lane in range(len(lanes)):
        fresh = Course(
            0.0, 0.0, 0.0, -1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        )
        store_course(work, lanes, row + COURSE, lane, fresh)


@equation
def with_error(sums: ErrorSums, error: float, count: float) -> ErrorSums:
    """One more error, the `count`-th."""
    off = error - sums.mean
    mean = sums.mean + off / count
    return ErrorSums(
        sums.total + error, sums.squares + error * error, larger(sums.largest, magnitude(error)), mean,
        sums.about_mean + off * (error - mean),
    )  # fmt: skip


@equation
def note_shown(work: Rows, lanes: Lanes, row: int, lane: int, epoch: int, s: Shown, cg_above_skid_m: float) -> None:
    """One epoch of a lane into its running scores."""
    c, touch = load_course(work, lanes, row + COURSE, lane), load_touch(work, lanes, row + TOUCH, lane)
    count = c.steps
    if s.counts:
        count = c.steps + 1.0
        errors = (s.error_n, s.error_e, s.error_d, s.error_u, s.error_v, s.error_w)
        for state in range(6):
            at = row + SUMS * state
            store_sums(work, lanes, at, lane, with_error(load_sums(work, lanes, at, lane), errors[state], count))
    home_n, home_e = (s.error_n, s.error_e) if s.home else (c.home_n, c.home_e)
    off_n, off_e = s.error_n - home_n, s.error_e - home_e
    horizontal_sq = larger(c.horizontal_sq, off_n * off_n + off_e * off_e) if s.counts and s.aloft else c.horizontal_sq

    rotation = rotation_from_quaternion(s.qw, s.qx, s.qy, s.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, s.u, s.v, s.w)
    lateral_m_s, upright = np.sqrt(vel_n * vel_n + vel_e * vel_e), rotation[8]
    place_n, place_e = s.pos_n + cg_above_skid_m * rotation[2], s.pos_e + cg_above_skid_m * rotation[5]
    yaw_rad_s, over = magnitude(s.yaw_rate_rad_s), upright < ROLLED_OVER

    first = epoch == 0
    seen_n, seen_e = (s.flown_n, s.flown_e) if first else (c.seen_n, c.seen_e)
    meets = s.touches and not s.away and c.contact < 0.0 and c.untouched >= AIRBORNE_EPOCHS
    contact = -1.0 if s.away else (float(epoch) if meets else c.contact)
    if meets:
        met = Touch(
            place_n, place_e, s.flown_n, s.flown_e, seen_n, seen_e, c.sink_m_s, c.lateral_m_s, c.upright, c.yaw_rad_s
        )
        store_touch(work, lanes, row + TOUCH, lane, met)
    else:
        store_touch(work, lanes, row + TOUCH, lane, touch)
    untouched = float(epoch + 1) if s.away else (0.0 if s.touches else c.untouched + 1.0)
    still = s.touches and lateral_m_s < STILL_M_S and yaw_rad_s < STILL_RAD_S
    over_since = 0.0 if contact < 0.0 else (1.0 if over else c.over_since)
    above = -s.pos_d - s.ground_m > 0.0
    now = Course(
        count, home_n, home_e, horizontal_sq, contact, untouched, c.still + 1.0 if still else 0.0,
        vel_d, lateral_m_s, upright, yaw_rad_s, place_n, place_e,
        s.flown_n if s.seen else seen_n, s.flown_e if s.seen else seen_e,
        1.0 if over and s.touches else c.over_grounded, over_since, c.low if above else 1.0,
        1.0 if s.away else 0.0, c.go_arounds + 1.0 if s.away and c.away == 0.0 and not first else c.go_arounds,
    )  # fmt: skip
    store_course(work, lanes, row + COURSE, lane, now)


@equation
def write_scores(
    work: Rows, lanes: Lanes, row: int, lane: int, epochs: int, epoch_s: float, may_land_after_s: float,
    limits: Any, scores: Any, flight: int,
) -> None:  # fmt: skip
    """A lane's row after its last epoch, into scores[:, flight] (RUNNING_COLUMNS, flights).

    limits: of its touchdown, with the fields of `touchdown.Limits`.
    """
    c, t = load_course(work, lanes, row + COURSE, lane), load_touch(work, lanes, row + TOUCH, lane)
    worst = -1.0
    for state in range(6):
        sums = load_sums(work, lanes, row + SUMS * state, lane)
        at = state * len(STATISTICS)
        largest = sums.largest if c.steps > 0.0 else np.nan
        scores[at, flight] = sums.total / c.steps if c.steps > 0.0 else np.nan
        scores[at + 1, flight] = np.sqrt(sums.about_mean / c.steps) if c.steps > 0.0 else np.nan
        scores[at + 2, flight] = np.sqrt(sums.squares / c.steps) if c.steps > 0.0 else np.nan
        scores[at + 3, flight] = largest
        if state < 3:
            worst = larger(worst, largest)
    scores[MAX_POSITION_ERROR, flight] = worst if c.steps > 0.0 else np.nan
    scores[RUNNING_COLUMNS - 1, flight] = np.sqrt(c.horizontal_sq) if c.horizontal_sq >= 0.0 else np.nan
    write_touchdown(c, t, epochs, epoch_s, may_land_after_s, limits, scores, flight)


@equation
def write_touchdown(
    c: Course, t: Touch, epochs: int, epoch_s: float, may_land_after_s: float, limits: Any, scores: Any, flight: int
) -> None:
    """The touchdown's columns of a row; what did not happen is NaN."""
    last_s = (epochs - 1) * epoch_s
    early = c.contact >= 0.0 and c.contact * epoch_s < may_land_after_s
    touched = c.contact >= 0.0 and not early
    rests = touched and c.still >= STILL_EPOCHS
    slide_m = hypotenuse(c.place_n - t.place_n, c.place_e - t.place_e)
    tilt_deg, yaw_deg_s = np.degrees(arccos(within_one(t.upright))), np.degrees(t.yaw_rad_s)
    at_contact = (
        c.contact * epoch_s, t.place_n, t.place_e, hypotenuse(t.place_n, t.place_e), t.sink_m_s, t.lateral_m_s,
        tilt_deg, yaw_deg_s,
    )  # fmt: skip
    at_rest = (
        (epochs - c.still) * epoch_s, c.place_n, c.place_e, hypotenuse(c.place_n, c.place_e),
        np.degrees(arccos(within_one(c.upright))), slide_m,
    )  # fmt: skip
    parts = (
        hypotenuse(t.error_n - t.seen_n, t.error_e - t.seen_e),
        hypotenuse(t.place_n + t.error_n, t.place_e + t.error_e),
        hypotenuse(t.seen_n, t.seen_e),
    )
    row = MAX_POSITION_ERROR + 1
    for i in range(8):
        scores[row + i, flight] = at_contact[i] if touched else np.nan
    for i in range(6):
        scores[row + 8 + i, flight] = at_rest[i] if rests else np.nan
    for i in range(3):
        scores[row + 14 + i, flight] = parts[i] if touched else np.nan
    bits = 1.0 if early else 0.0
    if touched:
        bits += 2.0 if t.sink_m_s > limits.max_sink_rate_m_s else 0.0
        bits += 4.0 if t.lateral_m_s > limits.max_lateral_speed_m_s else 0.0
        bits += 8.0 if tilt_deg > limits.max_tilt_deg else 0.0
        bits += 16.0 if yaw_deg_s > limits.max_yaw_rate_deg_s else 0.0
        bits += 32.0 if slide_m > limits.max_slide_m else 0.0
    bits += OVER_BIT if c.over_grounded > 0.0 or c.over_since > 0.0 else 0.0
    bits += LOW_BIT if c.low > 0.0 else 0.0
    scores[row + 17, flight] = 1.0 if may_land_after_s < last_s else 0.0
    scores[row + 18, flight] = bits
    scores[row + 19, flight] = c.go_arounds
    scores[row + 20, flight] = 1.0 if not touched and c.go_arounds > 0.0 else 0.0


@equation
def hypotenuse(a: float, b: float) -> float:
    """Length of a vector of two components."""
    length: float = np.sqrt(a * a + b * b)
    return length


@equation
def within_one(cosine: float) -> float:
    """A cosine that rounding has carried beyond one, brought back."""
    return -1.0 if cosine < -1.0 else (1.0 if cosine > 1.0 else cosine)


if TOUCHDOWN_COLUMNS[17:] != ("expected", "broken", "go_arounds", "aloft"):
    raise AssertionError("write_touchdown writes touchdown.TOUCHDOWN_COLUMNS by their places")
