"""The touchdown of a block of flights: at contact and at rest, what was limited by what, and whether it is a crash.

Arrays are (epochs, lanes), places (epochs, 2, lanes) north and east of the pad's centre. A touchdown is judged where
the middle of the skids is: the centre of gravity of a vehicle that hovers tilted moves when the skids come flat.

Where it first touches is what guidance, estimate and pad add up to, as vectors. With e the error of what was flown on,

    place = (place + e) - (e - e_pad) - e_pad = guidance - estimate - pad,

e_pad being e when the pad's place was last seen or noted: guidance is where the vehicle believed itself to be, pad how
wrong it had the pad's place, and estimate how far it has drifted since.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import equation, kernel
from flownav.frames import rotation_from_quaternion, to_earth

Array = NDArray[np.float64]

AIRBORNE_EPOCHS = 25  # half a second without contact: skids flutter at lift-off
STILL_EPOCHS = 50  # a second
STILL_M_S, STILL_DEG_S = 0.02, 2.0
ROLLED_OVER_DEG = 30.0  # beyond what any of our skids stands on

CONTACT = (
    "t_s",
    "north_m",
    "east_m",
    "distance_m",
    "sink_rate_m_s",
    "lateral_speed_m_s",
    "tilt_deg",
    "yaw_rate_deg_s",
)
REST = ("t_s", "north_m", "east_m", "distance_m", "tilt_deg", "slide_m")
LIMITED_BY = ("estimate_m", "guidance_m", "pad_m")
# what makes a crash, a bit each of the column "broken"
BROKEN = (
    "before it may land",
    "sink rate",
    "lateral speed",
    "tilt",
    "yaw rate",
    "slide",
    "rolled over",
    "below the ground",
)

# one flight's touchdown as a row; expected 1: the flight was to land. broken: bits of BROKEN. go_arounds: how often it
# broke its landing off; aloft 1: its last landing was broken off, and it is aloft at the end
TOUCHDOWN_COLUMNS = (
    *(f"contact.{name}" for name in CONTACT),
    *(f"rest.{name}" for name in REST),
    *(f"limited_by.{name}" for name in LIMITED_BY),
    "expected",
    "broken",
    "go_arounds",
    "aloft",
)
COLUMNS = len(TOUCHDOWN_COLUMNS)


class Limits(NamedTuple):
    """What a vehicle's touchdown may be, as its file has it; beyond any of these it is a crash."""

    max_sink_rate_m_s: float
    max_lateral_speed_m_s: float
    max_tilt_deg: float
    max_yaw_rate_deg_s: float
    max_slide_m: float


class Motion(NamedTuple):
    """How a block moved: place of the skids' middle, height of the centre of gravity, speeds, tilt, yaw rate, contact.

    lateral_m_s: over the ground. on_ground: 0/1.
    """

    place_m: Array
    cg_height_m: Array
    sink_m_s: Array
    lateral_m_s: Array
    tilt_deg: Array
    yaw_rate_deg_s: Array
    on_ground: Array


def motion_of(
    position: Array, velocity_body: Array, quaternion: Array, yaw_rate_rad_s: Array, on_ground: Array,
    cg_above_skid_m: float,
) -> Motion:  # fmt: skip
    """From the truth: position NED of the centre of gravity and body velocity (epochs, 3, lanes), quaternion."""
    rotation = rotation_from_quaternion(*np.moveaxis(quaternion, 1, 0))
    vel_n, vel_e, vel_d = to_earth(rotation, *np.moveaxis(velocity_body, 1, 0))
    down = np.stack([rotation[2], rotation[5]], axis=1)  # horizontal part of body down
    return Motion(
        place_m=position[:, :2] + cg_above_skid_m * down,
        cg_height_m=-position[:, 2],
        sink_m_s=np.asarray(vel_d),
        lateral_m_s=np.hypot(vel_n, vel_e),
        tilt_deg=np.degrees(np.arccos(np.clip(rotation[8], -1.0, 1.0))),
        yaw_rate_deg_s=np.degrees(np.abs(yaw_rate_rad_s)),
        on_ground=on_ground,
    )


class Moving(NamedTuple):
    """What one epoch shows of a flight: as `Motion`, of one lane, with how wrong was what was flown on (north, east).

    seen: the pad's place was to be seen or noted. away: it goes around.
    """

    place_n: float
    place_e: float
    height_m: float
    sink_m_s: float
    lateral_m_s: float
    tilt_deg: float
    yaw_deg_s: float
    flown_n: float
    flown_e: float
    touches: bool
    seen: bool
    away: bool


class Course(NamedTuple):
    """What must be remembered of the epochs so far."""

    contact: float  # its epoch, of the first since the last go-around; -1: none
    untouched: float  # epochs without contact
    still: float  # epochs at rest on the ground
    sink_m_s: float  # of the last epoch, with the five that follow
    lateral_m_s: float
    tilt_deg: float
    yaw_deg_s: float
    place_n: float
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
    tilt_deg: float
    yaw_deg_s: float


@equation
def nothing_yet() -> Course:
    """Before the first epoch."""
    return Course(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@equation
def no_touch() -> Touch:
    """Before any contact."""
    return Touch(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@equation
def lands(touches: bool, untouched: float) -> bool:
    """Whether a contact after so many epochs without one is one after being airborne."""
    return touches and untouched >= AIRBORNE_EPOCHS


@equation
def followed(c: Course, touch: Touch, epoch: int, s: Moving) -> tuple[Course, Touch]:
    """What is remembered with one epoch more."""
    seen_n, seen_e = (s.flown_n, s.flown_e) if epoch == 0 else (c.seen_n, c.seen_e)
    met = c.contact < 0.0 and not s.away and lands(s.touches, c.untouched)
    contact = -1.0 if s.away else (float(epoch) if met else c.contact)
    first = Touch(
        s.place_n, s.place_e, s.flown_n, s.flown_e, seen_n, seen_e, c.sink_m_s, c.lateral_m_s, c.tilt_deg, c.yaw_deg_s
    )
    untouched = float(epoch + 1) if s.away else (0.0 if s.touches else c.untouched + 1.0)
    still = s.touches and s.lateral_m_s < STILL_M_S and s.yaw_deg_s < STILL_DEG_S
    over = s.tilt_deg > ROLLED_OVER_DEG
    begins = s.away and c.away == 0.0 and epoch > 0
    now = Course(
        contact, untouched, c.still + 1.0 if still else 0.0, s.sink_m_s, s.lateral_m_s, s.tilt_deg, s.yaw_deg_s,
        s.place_n, s.place_e, s.flown_n if s.seen else seen_n, s.flown_e if s.seen else seen_e,
        1.0 if over and s.touches else c.over_grounded, 0.0 if contact < 0.0 else (1.0 if over else c.over_since),
        c.low if s.height_m > 0.0 else 1.0,  # a motion that is no number is no flight either
        1.0 if s.away else 0.0, c.go_arounds + 1.0 if begins else c.go_arounds,
    )  # fmt: skip
    return now, first if met else touch


@equation
def put_touchdown(
    c: Course, t: Touch, contact_s: float, rest_s: float, last_s: float, may_land_after_s: float, limits: Any,
    row: Any, first: int, place: int,
) -> None:  # fmt: skip
    """The touchdown after the last epoch into row[first:, place], by TOUCHDOWN_COLUMNS; what did not happen is NaN.

    contact_s, rest_s, last_s: when it touched, when it came to rest, the last epoch's time. limits: with the fields of
    `Limits`. A contact before `may_land_after_s` is a crash and no touchdown; so is none what a go-around follows.
    """
    early = c.contact >= 0.0 and contact_s < may_land_after_s
    touched = c.contact >= 0.0 and not early
    rests = touched and c.still >= STILL_EPOCHS
    slide_m = hypotenuse(c.place_n - t.place_n, c.place_e - t.place_e)
    at_contact = (
        contact_s, t.place_n, t.place_e, hypotenuse(t.place_n, t.place_e), t.sink_m_s, t.lateral_m_s,
        t.tilt_deg, t.yaw_deg_s,
    )  # fmt: skip
    at_rest = (rest_s, c.place_n, c.place_e, hypotenuse(c.place_n, c.place_e), c.tilt_deg, slide_m)
    parts = (
        hypotenuse(t.error_n - t.seen_n, t.error_e - t.seen_e),
        hypotenuse(t.place_n + t.error_n, t.place_e + t.error_e),
        hypotenuse(t.seen_n, t.seen_e),
    )
    for i in range(8):
        row[first + i, place] = at_contact[i] if touched else np.nan
    for i in range(6):
        row[first + 8 + i, place] = at_rest[i] if rests else np.nan
    for i in range(3):
        row[first + 14 + i, place] = parts[i] if touched else np.nan
    bits = 1.0 if early else 0.0
    if touched:
        bits += 2.0 if t.sink_m_s > limits.max_sink_rate_m_s else 0.0
        bits += 4.0 if t.lateral_m_s > limits.max_lateral_speed_m_s else 0.0
        bits += 8.0 if t.tilt_deg > limits.max_tilt_deg else 0.0
        bits += 16.0 if t.yaw_deg_s > limits.max_yaw_rate_deg_s else 0.0
        bits += 32.0 if slide_m > limits.max_slide_m else 0.0
    bits += 64.0 if c.over_grounded > 0.0 or c.over_since > 0.0 else 0.0
    bits += 128.0 if c.low > 0.0 else 0.0
    row[first + 17, place] = 1.0 if may_land_after_s < last_s else 0.0
    row[first + 18, place] = bits
    row[first + 19, place] = c.go_arounds
    row[first + 20, place] = 1.0 if not touched and c.go_arounds > 0.0 else 0.0


@equation
def hypotenuse(a: float, b: float) -> float:
    """Length of a vector of two components."""
    length: float = np.sqrt(a * a + b * b)
    return length


if TOUCHDOWN_COLUMNS[17:] != ("expected", "broken", "go_arounds", "aloft"):
    raise AssertionError("put_touchdown writes TOUCHDOWN_COLUMNS by their places")


@kernel
def first_contact(on_ground: Array) -> NDArray[np.int64]:
    """The epoch of each lane's first ground contact after being airborne, -1 where there is none; (lanes,)."""
    epochs, lanes = on_ground.shape
    found = np.full(lanes, -1)
    for lane in range(lanes):
        untouched = 0.0
        for k in range(epochs):
            touches = on_ground[k, lane] > 0.0
            if lands(touches, untouched):
                found[lane] = k
                break
            untouched = 0.0 if touches else untouched + 1.0
    return found


@kernel
def fold(t_s: Array, motion: Motion, flown: Array, seen: Array, away: Array, limits: Limits, after_s: float) -> Array:
    """The touchdowns of `touchdowns`, (len(TOUCHDOWN_COLUMNS), lanes)."""
    epochs, lanes = motion.on_ground.shape
    rows = np.empty((COLUMNS, lanes))
    for lane in range(lanes):
        course, touch = nothing_yet(), no_touch()
        for k in range(epochs):
            shown = Moving(
                motion.place_m[k, 0, lane], motion.place_m[k, 1, lane], motion.cg_height_m[k, lane],
                motion.sink_m_s[k, lane], motion.lateral_m_s[k, lane], motion.tilt_deg[k, lane],
                motion.yaw_rate_deg_s[k, lane], flown[k, 0, lane], flown[k, 1, lane],
                motion.on_ground[k, lane] > 0.0, seen[k, lane] > 0.0, away[k, lane] > 0.0,
            )  # fmt: skip
            course, touch = followed(course, touch, k, shown)
        contact_s = t_s[max(int(course.contact), 0)]
        rest_s = t_s[min(epochs - int(course.still), epochs - 1)]
        put_touchdown(course, touch, contact_s, rest_s, t_s[epochs - 1], after_s, limits, rows, 0, lane)
    return rows


def touchdowns(
    t_s: Array, motion: Motion, flown_error: Array, pad_seen: Array, away: Array, limits: Limits,
    may_land_after_s: float,
) -> Array:  # fmt: skip
    """Rows of TOUCHDOWN_COLUMNS, (lanes, len(TOUCHDOWN_COLUMNS)); what did not happen is NaN.

    flown_error (epochs, 2, lanes): position that was flown on less the truth; pad_seen (epochs, lanes) 0/1: the pad's
    place was to be seen or noted; away (epochs, lanes) 0/1: the vehicle goes around.
    """
    block = Motion(*map(_plain, motion))
    told = Limits(*map(float, limits))
    rows = fold(_plain(t_s), block, _plain(flown_error), _plain(pad_seen), _plain(away), told, float(may_land_after_s))
    return np.ascontiguousarray(rows.T)


def _plain(values: Array) -> Array:
    """Numbers as the kernel takes them, whatever holds them."""
    return np.ascontiguousarray(values, float)


def names_of(bits: float) -> list[str]:
    """What a row's column "broken" says, in words."""
    return [name for bit, name in enumerate(BROKEN) if int(bits) >> bit & 1]
