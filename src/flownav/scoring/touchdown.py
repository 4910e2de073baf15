"""The touchdown of a block of flights: at contact and at rest, what was limited by what, and whether it is a crash.

Arrays are (epochs, lanes), places (epochs, 2, lanes) north and east of the pad's centre. A touchdown is judged where
the middle of the skids is: the centre of gravity of a vehicle that hovers tilted moves when the skids come flat.

Where it first touches is what guidance, estimate and pad add up to, as vectors. With e the error of what was flown on,

    place = (place + e) - (e - e_pad) - e_pad = guidance - estimate - pad,

e_pad being e when the pad's place was last seen or noted: guidance is where the vehicle believed itself to be, pad how
wrong it had the pad's place, and estimate how far it has drifted since.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import kernel
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


@kernel
def first_contact(on_ground: Array) -> NDArray[np.int64]:
    """The epoch of each lane's first ground contact after being airborne, -1 where there is none; (lanes,)."""
    epochs, lanes = on_ground.shape
    found = np.full(lanes, -1)
    for lane in range(lanes):
        without_contact = 0
        for k in range(epochs):
            touching = on_ground[k, lane] > 0.0
            if touching and without_contact >= AIRBORNE_EPOCHS:
                found[lane] = k
                break
            without_contact = 0 if touching else without_contact + 1
    return found


def rest_epoch(motion: Motion) -> NDArray[np.int64]:
    """From which epoch on each lane stays still on the ground until the flight's end, at least a second; else -1."""
    still = (motion.lateral_m_s < STILL_M_S) & (motion.yaw_rate_deg_s < STILL_DEG_S) & (motion.on_ground > 0.0)
    epochs = len(still)
    stays = np.where(still.all(axis=0), epochs, np.argmin(still[::-1], axis=0))
    return np.asarray(np.where(stays >= STILL_EPOCHS, epochs - stays, -1), np.int64)


def touchdowns(
    t_s: Array, motion: Motion, flown_error: Array, pad_seen: Array, away: Array, limits: Limits,
    may_land_after_s: float,
) -> Array:  # fmt: skip
    """Rows of TOUCHDOWN_COLUMNS, (lanes, len(TOUCHDOWN_COLUMNS)); what did not happen is NaN.

    flown_error (epochs, 2, lanes): position that was flown on less the truth; pad_seen (epochs, lanes) 0/1: the pad's
    place was to be seen or noted; away (epochs, lanes) 0/1: the vehicle goes around. A contact before
    `may_land_after_s` is a crash and no touchdown; so is none what a go-around follows.
    """
    lane = np.arange(motion.on_ground.shape[1])
    contact = first_contact(motion.on_ground * after_last(away))
    early = (contact >= 0) & (t_s[contact] < may_land_after_s)
    touched = (contact >= 0) & ~early
    at, before = np.maximum(contact, 0), np.maximum(contact - 1, 0)
    place, end = motion.place_m[at, :, lane], motion.place_m[-1].T
    rest = np.where(touched, rest_epoch(motion), -1)
    slide = np.hypot(*(end - place).T)
    seen = last_seen(pad_seen, at)
    error, at_pad = flown_error[at, :, lane], flown_error[seen, :, lane]
    guidance = place + error
    columns = {
        "contact.t_s": t_s[at],
        "contact.north_m": place[:, 0],
        "contact.east_m": place[:, 1],
        "contact.distance_m": np.hypot(*place.T),
        "contact.sink_rate_m_s": motion.sink_m_s[before, lane],
        "contact.lateral_speed_m_s": motion.lateral_m_s[before, lane],
        "contact.tilt_deg": motion.tilt_deg[before, lane],
        "contact.yaw_rate_deg_s": motion.yaw_rate_deg_s[before, lane],
        "limited_by.estimate_m": np.hypot(*(error - at_pad).T),
        "limited_by.guidance_m": np.hypot(*guidance.T),
        "limited_by.pad_m": np.hypot(*at_pad.T),
    }
    at_rest = {
        "rest.t_s": t_s[np.maximum(rest, 0)],
        "rest.north_m": end[:, 0],
        "rest.east_m": end[:, 1],
        "rest.distance_m": np.hypot(*end.T),
        "rest.tilt_deg": motion.tilt_deg[-1],
        "rest.slide_m": slide,
    }
    found = {name: np.where(touched, values, np.nan) for name, values in columns.items()}
    found |= {name: np.where(rest >= 0, values, np.nan) for name, values in at_rest.items()}
    found["expected"] = np.full(len(lane), float(may_land_after_s < t_s[-1]))
    found["go_arounds"] = (np.diff(away, axis=0) > 0.0).sum(axis=0).astype(float)
    found["aloft"] = np.where(touched, 0.0, (found["go_arounds"] > 0.0).astype(float))
    found["broken"] = broken(motion, found, np.where(touched, slide, 0.0), contact, early, limits)
    return np.column_stack([found[name] for name in TOUCHDOWN_COLUMNS])


def after_last(away: Array) -> Array:
    """1 from the epoch after a lane last went around, and all along where it never did (epochs, lanes)."""
    later = np.cumsum(away[::-1], axis=0)[::-1]
    return np.asarray((later <= 0.0).astype(float))


def last_seen(pad_seen: Array, contact: NDArray[np.int64]) -> NDArray[np.int64]:
    """The last epoch before each lane's contact at which the pad was to be seen; 0 where it never was."""
    before = (np.arange(len(pad_seen))[:, None] < contact) & (pad_seen > 0.0)
    last = len(before) - 1 - np.argmax(before[::-1], axis=0)
    return np.asarray(np.where(before.any(axis=0), last, 0), np.int64)


def broken(
    motion: Motion, found: dict[str, Array], slide_m: Array, contact: NDArray[np.int64], early: NDArray[np.bool_],
    limits: Limits,
) -> Array:  # fmt: skip
    """What each lane broke, as bits of BROKEN; 0: no crash."""
    since = (np.arange(len(motion.on_ground))[:, None] >= contact) & (contact >= 0)
    over = (motion.tilt_deg > ROLLED_OVER_DEG) & (since | (motion.on_ground > 0.0))
    wrong = (
        early,
        found["contact.sink_rate_m_s"] > limits.max_sink_rate_m_s,
        found["contact.lateral_speed_m_s"] > limits.max_lateral_speed_m_s,
        found["contact.tilt_deg"] > limits.max_tilt_deg,
        found["contact.yaw_rate_deg_s"] > limits.max_yaw_rate_deg_s,
        slide_m > limits.max_slide_m,
        over.any(axis=0),
        ~(motion.cg_height_m > 0.0).all(axis=0),  # a motion that is no number is no flight either
    )
    return np.asarray(sum((1 << bit) * flag.astype(float) for bit, flag in enumerate(wrong)), float)


def names_of(bits: float) -> list[str]:
    """What a row's column "broken" says, in words."""
    return [name for bit, name in enumerate(BROKEN) if int(bits) >> bit & 1]
