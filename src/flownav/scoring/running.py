"""The scores of a flight kept as it flies, for flights whose history nobody keeps: rows of a lane buffer.

The same columns as `errors.score_block` and `touchdown.touchdowns` compute from histories, by the same laws of one
epoch (`errors.with_error`, `course.followed`).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import Lanes, arccos, equation, lane_access, larger, magnitude
from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.scoring.course import Course, Moving, Touch, followed, nothing_yet
from flownav.scoring.errors import (
    MAX_POSITION_ERROR,
    SCORE_COLUMNS,
    STATES,
    STATISTICS,
    ErrorSums,
    statistics_of,
    with_error,
)
from flownav.scoring.touchdown import COLUMNS, Timing, hypotenuse, judged

Rows = NDArray[np.float64]

# a flight's row: SCORE_COLUMNS, and the largest horizontal error in flight
RUNNING_COLUMNS = len(SCORE_COLUMNS) + 1


class Shown(NamedTuple):
    """One epoch of a flight, and how it counts.

    pos and vel: the truth, NED [m] and body FRD [m/s]; q: its attitude, yaw_rate_rad_s; error: of the estimate,
    position NED and body velocity; flown: horizontal error of the estimate used by the autopilot. counts: this step's
    errors are scored; aloft: and it is in flight, after the pad was noted. seen: the pad could be seen or its place was
    noted. home: horizontal errors are relative to the errors of this epoch.
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


class Horizontal(NamedTuple):
    """The memory of the errors besides their sums: the number scored, and the largest horizontal one."""

    steps: float
    home_n: float
    home_e: float
    largest_sq: float  # of a step in flight [m2]; -1: none yet


load_sums, store_sums = lane_access(ErrorSums, None)
load_horizontal, store_horizontal = lane_access(Horizontal, None)
load_course, store_course = lane_access(Course, None)
load_touch, store_touch = lane_access(Touch, None)
SUMS = len(ErrorSums._fields)
HORIZONTAL = SUMS * len(STATES)
COURSE = HORIZONTAL + len(Horizontal._fields)
TOUCH = COURSE + len(Course._fields)
RUNNING_ROWS = TOUCH + len(Touch._fields)


@equation
def begin_scores(work: Rows, lanes: Lanes, row: int) -> None:
    """Write that nothing is seen yet into the RUNNING_ROWS rows from `row` on."""
    for i in range(RUNNING_ROWS):
        for lane in range(len(lanes)):
            work[(row + i) * len(lanes) + lane] = 0.0
    for lane in range(len(lanes)):
        store_horizontal(work, lanes, row + HORIZONTAL, lane, Horizontal(0.0, 0.0, 0.0, -1.0))
        store_course(work, lanes, row + COURSE, lane, nothing_yet())


@equation
def note_shown(work: Rows, lanes: Lanes, row: int, lane: int, epoch: int, s: Shown, cg_above_skid_m: float) -> None:
    """One epoch of a lane into its running scores."""
    h = load_horizontal(work, lanes, row + HORIZONTAL, lane)
    count = h.steps
    if s.counts:
        count = h.steps + 1.0
        errors = (s.error_n, s.error_e, s.error_d, s.error_u, s.error_v, s.error_w)
        for state in range(6):
            at = row + SUMS * state
            store_sums(work, lanes, at, lane, with_error(load_sums(work, lanes, at, lane), errors[state], count))
    home_n, home_e = (s.error_n, s.error_e) if s.home else (h.home_n, h.home_e)
    off_n, off_e = s.error_n - home_n, s.error_e - home_e
    largest_sq = larger(h.largest_sq, off_n * off_n + off_e * off_e) if s.counts and s.aloft else h.largest_sq
    store_horizontal(work, lanes, row + HORIZONTAL, lane, Horizontal(count, home_n, home_e, largest_sq))

    course, touch = load_course(work, lanes, row + COURSE, lane), load_touch(work, lanes, row + TOUCH, lane)
    course, touch = followed(course, touch, epoch, moving_of(s, cg_above_skid_m))
    store_course(work, lanes, row + COURSE, lane, course)
    store_touch(work, lanes, row + TOUCH, lane, touch)


@equation
def moving_of(s: Shown, cg_above_skid_m: float) -> Moving:
    """The motion that an epoch shows, as `touchdown.motion_of` has it of a block."""
    rotation = rotation_from_quaternion(s.qw, s.qx, s.qy, s.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, s.u, s.v, s.w)
    place_n, place_e = s.pos_n + cg_above_skid_m * rotation[2], s.pos_e + cg_above_skid_m * rotation[5]
    tilt_deg, yaw_deg_s = np.degrees(arccos(within_one(rotation[8]))), np.degrees(magnitude(s.yaw_rate_rad_s))
    return Moving(
        place_n, place_e, -s.pos_d - s.ground_m, vel_d, hypotenuse(vel_n, vel_e), tilt_deg, yaw_deg_s,
        s.flown_n, s.flown_e, s.touches, s.seen, s.away,
    )  # fmt: skip


class Terms(NamedTuple):
    """The terms that a flight is judged by: its epochs, their length, when it is to land, and with the fields of
    `touchdown.Limits` what its touchdown may be.
    """

    epochs: int
    epoch_s: float
    may_land_after_s: float
    limits: Any


@equation
def write_scores(work: Rows, lanes: Lanes, row: int, lane: int, terms: Terms, scores: Any, flight: int) -> None:
    """A lane's row after its last epoch, into scores[:, flight] (RUNNING_COLUMNS, flights)."""
    h = load_horizontal(work, lanes, row + HORIZONTAL, lane)
    worst = -1.0
    for state in range(6):
        found = statistics_of(load_sums(work, lanes, row + SUMS * state, lane), h.steps)
        for i in range(4):
            scores[state * len(STATISTICS) + i, flight] = found[i]
        if state < 3:
            worst = larger(worst, found[3])
    scores[MAX_POSITION_ERROR, flight] = worst if h.steps > 0.0 else np.nan
    scores[RUNNING_COLUMNS - 1, flight] = np.sqrt(h.largest_sq) if h.largest_sq >= 0.0 else np.nan
    c, t = load_course(work, lanes, row + COURSE, lane), load_touch(work, lanes, row + TOUCH, lane)
    epochs, epoch_s = terms.epochs, terms.epoch_s
    when = Timing(c.contact * epoch_s, (epochs - c.still) * epoch_s, (epochs - 1) * epoch_s, terms.may_land_after_s)
    touchdown = judged(c, t, when, terms.limits)
    for i in range(COLUMNS):
        scores[MAX_POSITION_ERROR + 1 + i, flight] = touchdown[i]


@equation
def within_one(cosine: float) -> float:
    """A cosine that rounding has carried beyond one, brought back."""
    return -1.0 if cosine < -1.0 else (1.0 if cosine > 1.0 else cosine)
