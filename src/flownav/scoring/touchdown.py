"""The touchdown of a block of flights: at contact and at rest, the part of each cause, and whether it is a crash.

Arrays are (epochs, lanes), places (epochs, 2, lanes) north and east of the pad's centre. A touchdown is judged where
the middle of the skids is: the centre of gravity of a vehicle that hovers tilted moves when the skids come flat.

The place of first contact is the sum of guidance, estimate and pad, as vectors. With e the error of the estimate used
by the autopilot,

    place = (place + e) - (e - e_pad) - e_pad = guidance - estimate - pad,

e_pad being e when the pad's place was last seen or noted: guidance is where the vehicle believed itself to be, pad how
wrong it had the pad's place, and estimate how far it has drifted since.
"""

from typing import Any, NamedTuple

import numpy as np

from flownav.core.compile import equation, kernel
from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.core.measurement import Array
from flownav.scoring.course import Course, Moving, Touch, followed, no_touch, nothing_yet

STILL_EPOCHS = 50  # a second

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
# broke its landing off; aloft 1: its last landing was broken off, and it is aloft at the end; beside 1: it is at rest
# and not on the pad that its camera was to find
TOUCHDOWN_COLUMNS = (
    *(f"contact.{name}" for name in CONTACT),
    *(f"rest.{name}" for name in REST),
    *(f"limited_by.{name}" for name in LIMITED_BY),
    "expected",
    "broken",
    "go_arounds",
    "aloft",
    "beside",
)
COLUMNS = len(TOUCHDOWN_COLUMNS)
NO_CONTACT, NO_REST, NO_PARTS = (np.nan,) * len(CONTACT), (np.nan,) * len(REST), (np.nan,) * len(LIMITED_BY)


class Limits(NamedTuple):
    """The limits of a vehicle's touchdown, from its file; beyond any of these it is a crash.

    pad_radius_m: farther from the middle of the pad that its camera was to find it has not landed on it.
    """

    max_sink_rate_m_s: float
    max_lateral_speed_m_s: float
    max_tilt_deg: float
    max_yaw_rate_deg_s: float
    max_slide_m: float
    pad_radius_m: float = np.inf


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


class Timing(NamedTuple):
    """When it touched, came to rest and was last seen, were it to have done so, and when it was to land [s]."""

    contact_s: float
    rest_s: float
    last_s: float
    may_land_after_s: float


@equation
def judged(c: Course, t: Touch, when: Timing, limits: Any) -> tuple[float, ...]:
    """The touchdown after the last epoch, by TOUCHDOWN_COLUMNS; what did not happen is NaN.

    limits: with the fields of `Limits`. A contact before `may_land_after_s` is a crash and no touchdown; so is none
    what a go-around follows.
    """
    early = c.contact >= 0.0 and when.contact_s < when.may_land_after_s
    touched = c.contact >= 0.0 and not early
    rests = touched and c.still >= STILL_EPOCHS
    slide_m = hypotenuse(c.place_n - t.place_n, c.place_e - t.place_e)
    at_contact = (
        when.contact_s, t.place_n, t.place_e, hypotenuse(t.place_n, t.place_e), t.sink_m_s, t.lateral_m_s,
        t.tilt_deg, t.yaw_deg_s,
    )  # fmt: skip
    at_rest = (when.rest_s, c.place_n, c.place_e, hypotenuse(c.place_n, c.place_e), c.tilt_deg, slide_m)
    parts = (
        hypotenuse(t.error_n - t.seen_n, t.error_e - t.seen_e),
        hypotenuse(t.place_n + t.error_n, t.place_e + t.error_e),
        hypotenuse(t.seen_n, t.seen_e),
    )
    bits = 1.0 if early else 0.0
    if touched:
        bits += 2.0 if t.sink_m_s > limits.max_sink_rate_m_s else 0.0
        bits += 4.0 if t.lateral_m_s > limits.max_lateral_speed_m_s else 0.0
        bits += 8.0 if t.tilt_deg > limits.max_tilt_deg else 0.0
        bits += 16.0 if t.yaw_deg_s > limits.max_yaw_rate_deg_s else 0.0
        bits += 32.0 if slide_m > limits.max_slide_m else 0.0
    bits += 64.0 if c.over_grounded > 0.0 or c.over_since > 0.0 else 0.0
    bits += 128.0 if c.low > 0.0 else 0.0
    expected = 1.0 if when.may_land_after_s < when.last_s else 0.0
    aloft = 1.0 if not touched and c.go_arounds > 0.0 else 0.0
    found = (at_contact if touched else NO_CONTACT) + (at_rest if rests else NO_REST)
    beside = 1.0 if rests and hypotenuse(c.place_n, c.place_e) > limits.pad_radius_m else 0.0
    return found + (parts if touched else NO_PARTS) + (expected, bits, c.go_arounds, aloft, beside)


@equation
def hypotenuse(a: float, b: float) -> float:
    """Length of a vector of two components."""
    length: float = np.sqrt(a * a + b * b)
    return length


@kernel
def fold(
    t_s: Array, motion: Motion, flown: Array, seen: Array, away: Array, limits: Limits, after_s: float, rows: Array
) -> None:
    """The touchdowns of `touchdowns` into rows (len(TOUCHDOWN_COLUMNS), lanes)."""
    epochs, lanes = motion.on_ground.shape
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
        found = judged(course, touch, Timing(contact_s, rest_s, t_s[epochs - 1], after_s), limits)
        for i in range(COLUMNS):
            rows[i, lane] = found[i]


def touchdowns(
    t_s: Array, motion: Motion, flown_error: Array, pad_seen: Array, away: Array, limits: Limits,
    may_land_after_s: float,
) -> Array:  # fmt: skip
    """Rows of TOUCHDOWN_COLUMNS, (lanes, len(TOUCHDOWN_COLUMNS)); events that did not happen are NaN.

    flown_error (epochs, 2, lanes): position used by the autopilot less the truth; pad_seen (epochs, lanes) 0/1: the pad
    could be seen or its place was noted; away (epochs, lanes) 0/1: the vehicle goes around.
    """
    block = Motion(*map(_plain, motion))
    limits_ = Limits(*map(float, limits))
    rows = np.empty((COLUMNS, block.on_ground.shape[1]))
    flown, seen, around = _plain(flown_error), _plain(pad_seen), _plain(away)
    fold(_plain(t_s), block, flown, seen, around, limits_, float(may_land_after_s), rows)
    return np.ascontiguousarray(rows.T)


def load_kernel() -> None:
    """Load or compile what `touchdowns` needs: the touchdowns of one flight of one step."""
    still = np.zeros((1, 1))
    motion = Motion(**{name: np.zeros((1, 2, 1)) if name == "place_m" else still for name in Motion._fields})
    touchdowns(np.zeros(1), motion, np.zeros((1, 2, 1)), still, still, Limits(*(0.0 for _ in Limits._fields)), 0.0)


def _plain(values: Array) -> Array:
    """Numbers as the kernel takes them, whatever holds them."""
    return np.ascontiguousarray(values, float)


def names_of(bits: float) -> list[str]:
    """The failures in a row's column "broken", in words."""
    return [name for bit, name in enumerate(BROKEN) if int(bits) >> bit & 1]
