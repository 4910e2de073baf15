"""Motion of a reference that no accelerometer felt: a leap that its tracker's own filter has spread over a second.

Over a time T an accelerometer of a vehicle reads the integral of its specific force f, and whatever its attitude is

    |change of velocity - g T| <= integral of |f| over T

(g down; the length of an integral is at most the integral of the length). A reference that speeds up by more, and slows
down again soon, has not flown there. So a leap of any speed is found by its two ends, and a vehicle that flies as fast
is not, since its accelerometer has felt it.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, Stream

Places = NDArray[np.int64]  # numbers of rows

GRAVITY_M_S2 = 9.80665
WINDOW_S, LEAST_STEPS = 0.1, 3  # over which a velocity is taken, and steps of the path at least
LATE_S, LATE_STEP_S = 0.3, 0.05  # by which the reference's clock may be off the accelerometer's
SCALE = 1.05  # by which an accelerometer may read too little
LEAST_UNFELT_M_S, SCATTERS = 1.0, 3.0  # of velocity beyond what was felt, and in scatters of the path's own velocity
LONGEST_S = 2.0  # from a leap's begin to its end
LEAST_SIZE_M = 0.5
LONGEST_GAP_S = 0.1  # of the accelerometer
LEAST_WEIGHT = 0.8  # in g: of an accelerometer that has gravity in it
MOST_UNFELT = 0.02  # of all places; with more the two do not belong together


class Unfelt(NamedTuple):
    """From when to when [s] a path moves although nothing was felt, and by what beside its own motion, north, east,
    down [m].
    """

    begin_s: float
    end_s: float
    by_ned_m: Array


def unfelt(t_s: Array, position: Array, imu: Stream | None) -> list[Unfelt]:
    """The leaps of a path (n,), (n, 3) that an accelerometer (Sensor.IMU) did not feel, in order; none without one."""
    new = np.flatnonzero(np.concatenate([[True], (np.diff(position, axis=0) != 0.0).any(axis=1)]))
    felt = None if imu is None else _Felt.of(imu)
    if felt is None or len(new) < 4 * LEAST_STEPS:
        return []
    at_s, path = t_s[new], position[new]
    steps = max(LEAST_STEPS, int(WINDOW_S / max(float(np.median(np.diff(at_s))), 1e-3)))
    if len(at_s) <= 2 * steps + 1:
        return []
    places, change, beyond = _beyond(at_s, path, steps, felt)
    if np.count_nonzero(beyond > 0.0) > MOST_UNFELT * len(places):
        return []
    found, after_s = list[Unfelt](), -np.inf
    for first, last in pairwise(_groups(np.flatnonzero(beyond > 0.0), steps)):
        begin, end = int(places[first[0]]), int(places[last[-1]])  # the rows before it begins, and after its end
        turned = float(change[first].mean(axis=0) @ change[last].mean(axis=0)) < 0.0
        if at_s[begin] < after_s or at_s[end] - at_s[begin] > LONGEST_S or not turned:
            continue
        ways = [(path[begin] - path[begin - steps]) / (at_s[begin] - at_s[begin - steps]),
                (path[end + steps] - path[end]) / (at_s[end + steps] - at_s[end])]  # fmt: skip
        by = path[end] - path[begin] - 0.5 * (ways[0] + ways[1]) * (at_s[end] - at_s[begin])
        if float(np.linalg.norm(by)) >= LEAST_SIZE_M:
            found.append(Unfelt(float(at_s[begin]), float(at_s[end]), by))
            after_s = float(at_s[end])
    return found


class _Felt(NamedTuple):
    """The integral of an accelerometer's length [m/s] at its readings, and how many gaps came before each."""

    t_s: Array
    way_m_s: Array
    gaps: Array

    @classmethod
    def of(cls, imu: Stream) -> _Felt | None:
        """By a stream; None where it has no gravity in it, or too few readings."""
        length = np.linalg.norm(imu.value[:, 3:6], axis=1)
        good = np.isfinite(length)
        t_s, length = (imu.t_s - imu.delay_s)[good], length[good]
        if len(t_s) < 2 or float(np.median(length)) < LEAST_WEIGHT * GRAVITY_M_S2:
            return None
        gap_s = np.diff(t_s)
        way = np.concatenate([[0.0], np.cumsum(0.5 * gap_s * (length[1:] + length[:-1]))])
        return cls(t_s, way, np.concatenate([[0.0], np.cumsum(gap_s > LONGEST_GAP_S)]))

    def most(self, begin_s: Array, end_s: Array) -> Array:
        """The most that was felt between instants, (n,) [m/s], at any lateness; infinite where there is a gap."""
        late_s = np.arange(-LATE_S, LATE_S + 0.5 * LATE_STEP_S, LATE_STEP_S)
        felt = [
            np.interp(end_s + late, self.t_s, self.way_m_s) - np.interp(begin_s + late, self.t_s, self.way_m_s)
            for late in late_s
        ]
        broken = np.interp(end_s + LATE_S, self.t_s, self.gaps) > np.interp(begin_s - LATE_S, self.t_s, self.gaps)
        outside = (begin_s - LATE_S < self.t_s[0]) | (end_s + LATE_S > self.t_s[-1])
        return np.where(broken | outside, np.inf, np.max(felt, axis=0))


def _beyond(at_s: Array, path: Array, steps: int, felt: _Felt) -> tuple[Places, Array, Array]:
    """Of each row that has `steps` steps on either side: its number, the change of velocity there, (n, 3), and by how
    much that is beyond what was felt [m/s].
    """
    speed = np.diff(path, axis=0) / np.maximum(np.diff(at_s), 1e-6)[:, None]
    middle_s = 0.5 * (at_s[1:] + at_s[:-1])
    windows = np.lib.stride_tricks.sliding_window_view(speed, steps, axis=0)  # (rows, 3, steps)
    motion = np.median(windows, axis=2)
    scatter = np.median(np.linalg.norm(windows - motion[:, :, None], axis=1), axis=1)
    mean_s = np.lib.stride_tricks.sliding_window_view(middle_s, steps).mean(axis=1)
    before, after = slice(0, -steps), slice(steps, None)
    change, lasts_s = motion[after] - motion[before], mean_s[after] - mean_s[before]
    needed = np.linalg.norm(change - lasts_s[:, None] * [0.0, 0.0, GRAVITY_M_S2], axis=1)
    allowed = SCALE * felt.most(mean_s[before], mean_s[after])
    noise = LEAST_UNFELT_M_S + SCATTERS * (scatter[after] + scatter[before])
    return np.arange(steps, steps + len(change), dtype=np.int64), change, needed - allowed - noise


def _groups(places: Places, steps: int) -> list[Places]:
    """Numbers that follow each other by at most `steps`, together."""
    return np.split(places, np.flatnonzero(np.diff(places) > steps) + 1) if len(places) else []
