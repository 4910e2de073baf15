"""The place that a position without GPS refers to; where that place was lost it is set again, as a counted jump.

Dead reckoning by flow has no truth to return to: after a period in which flow was not trusted, the distance covered
meanwhile is unknown, and waiting does not reveal it. During the period only the velocity is sent. Once flow and
inertial sensors have agreed again for AGREED_S, sending continues from where the filter believes the vehicle is: the
limits then apply to the error added since, and the autopilot, which sees the reset counter change, moves its estimate
there.
"""

import math
from typing import NamedTuple

from flownav.core.compile import ONE_LANE
from flownav.core.measurement import Array
from flownav.estimation.covariance import variance_of
from flownav.estimation.states import POSITION
from flownav.navigation.loop import Running
from flownav.navigation.memory import PROTECTION, load_flow, load_gps, load_suspicion

AGREED_S = 1.0  # chosen: ten readings of a flow of 10 Hz; held by test_live_recordings
UNHELD_S = 2.0  # without a fix for so long the position is the flow's: chosen, two of a receiver of 1 Hz
FLOW_S = 0.5  # an older flow reading is no evidence of the present: chosen
CAUSED_S = 3.0  # a suspicion that begins so soon after a doubt, or during one, is of what caused the doubt: chosen
PLACES = ("flow_doubted", "fault_suspected", "unprotected", "uncertain")  # reasons that are of the place alone


class Base(NamedTuple):
    """Known errors of a place that are no longer counted: its protection level [m], its variance [m2], and the
    suspicion that belongs to it, by its start time [s].
    """

    protection_m: float = 0.0
    variance_m2: float = 0.0
    suspected_s: float = math.nan


NOTHING = Base()


class Anchor:
    """The place that the sent position refers to. moves: number of times it was set again."""

    def __init__(self) -> None:
        self.base = NOTHING
        self.moves = 0
        self._agreed_s = self._doubted_s = math.nan  # since when flow agrees; when it was doubted last

    def begin_anew(self) -> None:
        """Another navigator."""
        self.base = NOTHING
        self._agreed_s = self._doubted_s = math.nan

    def watch(self, on: Running, t_s: float) -> None:
        """Update from the navigator's state at `t_s`."""
        flow = load_flow(on.work, ONE_LANE, 0)
        if flow.doubted > 0.0 or not on.clock_s <= flow.taken_s + FLOW_S:
            self._agreed_s = math.nan
            self._doubted_s = t_s if flow.doubted > 0.0 else self._doubted_s
        elif self._agreed_s != self._agreed_s:
            self._agreed_s = t_s
        if holds(on):
            self.base = NOTHING
        else:  # what was wrong fades with the navigator's memory
            level_m = float(on.work[PROTECTION])
            self.base = self.base._replace(protection_m=min(self.base.protection_m, level_m))

    def agrees(self, t_s: float) -> bool:
        """Whether flow has agreed with the inertial sensors for long enough."""
        return t_s - self._agreed_s >= AGREED_S

    def may_move(self, on: Running, t_s: float) -> bool:
        """Whether the place may be set again: nothing else holds it, and flow has been good for long enough."""
        if holds(on) or not self.agrees(t_s):
            return False
        suspicion = load_suspicion(on.work, ONE_LANE, 0)
        return bool(suspicion.suspected == 0.0 or suspicion.suspected_s <= self._doubted_s + CAUSED_S)

    def move(self, on: Running, *, jumps: bool) -> None:
        """Set the place again; a jump where no place was sent meanwhile."""
        self.moves += jumps
        suspicion = load_suspicion(on.work, ONE_LANE, 0)
        level_m = float(on.work[PROTECTION])
        self.base = Base(
            level_m if math.isfinite(level_m) else math.inf,
            place_variance(on.work),
            suspicion.suspected_s if suspicion.suspected > 0.0 else math.nan,
        )


def holds(on: Running) -> bool:
    """Whether GPS has given the position within UNHELD_S."""
    return bool(on.clock_s <= load_gps(on.work, ONE_LANE, 0).last_fix_s + UNHELD_S)


def place_variance(work: Array) -> float:
    """The larger variance of north and east [m2]."""
    return float(max(variance_of(work, ONE_LANE, POSITION + axis, 0) for axis in range(2)))
