"""The course of a flight as its touchdown asks for it: what is remembered of its epochs, and of its first contact."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import equation, kernel
from flownav.core.measurement import Array

AIRBORNE_EPOCHS = 25  # half a second without contact: skids flutter at lift-off
# Standing: chosen. In wind a vehicle stands and rocks on its skids, within 1.5 cm and at up to 2 Hz.
STANDS_WITHIN_M, STANDS_DEG_S = 0.03, 15.0
ROLLED_OVER_DEG = 30.0  # beyond what any of our skids stands on


class Moving(NamedTuple):
    """One epoch of a flight: its motion (`touchdown.Motion`), and the error of the estimate used by the autopilot.

    seen: the pad could be seen or its place was noted. away: it goes around.
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
    """The memory of the epochs so far."""

    contact: float  # its epoch, of the first since the last go-around; -1: none
    untouched: float  # epochs without contact
    still: float  # epochs at rest: on the ground, at the place of the first of them
    sink_m_s: float  # of the last epoch, with the five that follow
    lateral_m_s: float
    tilt_deg: float
    yaw_deg_s: float
    place_n: float
    place_e: float
    seen_n: float  # error of the estimate in use when the pad was last seen
    seen_e: float
    over_grounded: float  # 1: rolled over on the ground
    over_since: float  # 1: rolled over since the contact
    low: float  # 1: was below the ground
    away: float
    go_arounds: float
    stood_n: float  # where it began to stand
    stood_e: float


class Touch(NamedTuple):
    """The first contact: place, errors of the estimate in use then and when the pad was last seen, motion before it."""

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
    return Course(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@equation
def no_touch() -> Touch:
    """Before any contact."""
    return Touch(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@equation
def lands(touches: bool, untouched: float) -> bool:
    """Whether a contact after `untouched` epochs without one is one after being airborne."""
    return touches and untouched >= AIRBORNE_EPOCHS


@equation
def near(north_m: float, east_m: float) -> bool:
    """Whether a vehicle so far from where it began to stand still stands there."""
    return north_m * north_m + east_m * east_m < STANDS_WITHIN_M * STANDS_WITHIN_M


@equation
def followed(c: Course, touch: Touch, epoch: int, s: Moving) -> tuple[Course, Touch]:
    """The memory with one epoch more."""
    seen_n, seen_e = (s.flown_n, s.flown_e) if epoch == 0 else (c.seen_n, c.seen_e)
    met = c.contact < 0.0 and not s.away and lands(s.touches, c.untouched)
    contact = -1.0 if s.away else (float(epoch) if met else c.contact)
    first = Touch(
        s.place_n, s.place_e, s.flown_n, s.flown_e, seen_n, seen_e, c.sink_m_s, c.lateral_m_s, c.tilt_deg, c.yaw_deg_s
    )
    untouched = float(epoch + 1) if s.away else (0.0 if s.touches else c.untouched + 1.0)
    stands = s.touches and s.yaw_deg_s < STANDS_DEG_S
    still = stands and c.still > 0.0 and near(s.place_n - c.stood_n, s.place_e - c.stood_e)
    over = s.tilt_deg > ROLLED_OVER_DEG
    begins = s.away and c.away == 0.0 and epoch > 0
    now = Course(
        contact, untouched, c.still + 1.0 if still else (1.0 if stands else 0.0), s.sink_m_s, s.lateral_m_s,
        s.tilt_deg, s.yaw_deg_s, s.place_n, s.place_e, s.flown_n if s.seen else seen_n, s.flown_e if s.seen else seen_e,
        1.0 if over and s.touches else c.over_grounded, 0.0 if contact < 0.0 else (1.0 if over else c.over_since),
        c.low if s.height_m > 0.0 else 1.0,  # a motion that is no number is no flight either
        1.0 if s.away else 0.0, c.go_arounds + 1.0 if begins else c.go_arounds,
        c.stood_n if still else s.place_n, c.stood_e if still else s.place_e,
    )  # fmt: skip
    return now, first if met else touch


@kernel
def put_first_contact(on_ground: Array, found: NDArray[np.int64]) -> None:
    """Write the result of `first_contact` for each lane; -1 where there is none."""
    epochs, lanes = on_ground.shape
    for lane in range(lanes):
        untouched = 0.0
        for k in range(epochs):
            touches = on_ground[k, lane] > 0.0
            if lands(touches, untouched):
                found[lane] = k
                break
            untouched = 0.0 if touches else untouched + 1.0


def first_contact(on_ground: Array) -> NDArray[np.int64]:
    """The epoch of each lane's first ground contact after being airborne, -1 where there is none; (lanes,)."""
    found = np.full(on_ground.shape[1], -1)
    put_first_contact(on_ground, found)
    return found
