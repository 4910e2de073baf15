"""Which flow readings of a flight can serve: in flight, of a quality, with a range beside them that can be believed.

A range is not believed where it sticks to its floor or stands far from the median of those around. What is left may
still jump: a sonar that hears now the ground, now something else. Its doubt, the share of steps that jump times their
usual size over the range, is an error of every gain that the log shows, and no length of log takes it out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.measurement import Array, Stream

FLOOR_SHARE = 0.01  # of the readings at the lowest range: a rangefinder stuck at its floor
FLOOR_MARGIN = 1.03
SPIKE_WINDOW, SPIKE_SHARE, SPIKE_M = 51, 0.3, 0.1
JUMP_M, JUMP_SHARE = 0.3, 0.1  # from a reading to the next: no vehicle climbs so fast
FAST_M_S = 5.0
LEAST_STEPS = 50
STALE_S = 0.5

Flags = NDArray[np.bool_]


class Ranges(NamedTuple):
    """Believed ranges: t_s (n,), range_m (n,); jumping: share of steps in flight that jump; doubt: relative error."""

    t_s: Array
    range_m: Array
    jumping: float
    doubt: float


def believed(where: str, distance: Stream, flying: Flags) -> Ranges:
    """The ranges to go by; flying (n,) of its readings. InputError where hardly any is left."""
    t_s, range_m = distance.t_s - distance.delay_s, distance.value[:, 0]
    aloft = flying & (range_m > 0.0)
    jumping, doubt = jumps(t_s[aloft], range_m[aloft])
    good = aloft & (range_m > _floor(range_m))
    if np.count_nonzero(good) < LEAST_STEPS:
        raise InputError(
            f"{where}: {np.count_nonzero(good)} of {len(range_m)} ranges are in flight and above the rangefinder's "
            f"floor; at least {LEAST_STEPS} are needed for the flow's scale and height"
        )
    t_s, range_m = t_s[good], range_m[good]
    kept = ~spikes(range_m)
    return Ranges(t_s[kept], range_m[kept], jumping, doubt)


def jumps(t_s: Array, range_m: Array) -> tuple[float, float]:
    """Share of steps that jump, and the error that they make: that share times the middle jump over the range."""
    if len(range_m) < LEAST_STEPS:
        return 0.0, 0.0
    step, lower = np.abs(np.diff(range_m)), np.minimum(range_m[1:], range_m[:-1])
    jump = step > JUMP_M + JUMP_SHARE * lower + FAST_M_S * np.minimum(np.diff(t_s), STALE_S)
    if not jump.any():
        return 0.0, 0.0
    share = float(jump.mean())
    return share, share * min(1.0, float(np.median(step[jump])) / float(np.median(range_m)))


def beside(ranges: Ranges, t_s: Array) -> tuple[Array, Flags]:
    """The range at instants (n,) by straight lines between believed ones, and where one is near."""
    after = np.clip(np.searchsorted(ranges.t_s, t_s), 1, len(ranges.t_s) - 1)
    away = np.minimum(np.abs(t_s - ranges.t_s[after - 1]), np.abs(ranges.t_s[after] - t_s))
    return np.interp(t_s, ranges.t_s, ranges.range_m), np.asarray(away <= STALE_S)


def spikes(range_m: Array) -> Flags:
    """Readings whose range is far from the median of those around: a sonar's echo of something else."""
    width = min(SPIKE_WINDOW, len(range_m) - 1 + len(range_m) % 2)
    padded = np.pad(range_m, width // 2, mode="reflect")
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    return np.asarray(np.abs(range_m - median) > SPIKE_SHARE * median + SPIKE_M)


def _floor(range_m: Array) -> float:
    """The range that counts as too near: just above the lowest one, where many readings stick to it."""
    lowest = float(np.min(range_m))
    stuck = np.mean(range_m <= lowest + 0.005) > FLOOR_SHARE
    return lowest * FLOOR_MARGIN + 0.005 if stuck else 0.0
