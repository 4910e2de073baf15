"""Which parts of flights are fitted and which judge the fit: alternate windows, and whole logs of several.

Between two windows lies a gap, so that what lasts of an error in one is not found again in the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from flownav.core.errors import InputError
from flownav.logs.log import Log
from flownav.replays.judged import Window, airborne_of

LONGEST_S = 30.0  # half of it is no harder a GPS cut, twice of it leaves too few windows of a usual flight
USUAL_S = 5.0
SHORTEST_S = 3.0  # a shorter one holds too few readings of a 10 Hz sensor
LEAST_JUDGES = 6  # with fewer, chance alone puts all of them on one side more often than once in forty
GAP_SHARE = 0.1
EVERY_THIRD = 3  # of several logs, one in three is held out whole


class Split(NamedTuple):
    """A log's windows: those of the fit and those that judge it [s]; whole: the log is held out, nothing is fitted."""

    fit: tuple[Window, ...]
    held: tuple[Window, ...]
    whole: bool = False


def split_flight(log: Log) -> Split:
    """Alternate windows of the flight; of the whole log where nobody says when it flew.

    InputError where the flight is too short for LEAST_JUDGES of each kind.
    """
    flown = airborne_of(log)
    first, last = log.span_s if flown is None else flown
    length = _length(last - first)
    if length < SHORTEST_S:
        what = "the log" if flown is None else "the flight"
        raise InputError(
            f"{log.path}: {what} lasts {last - first:.1f} s, too short for {2 * LEAST_JUDGES} windows of "
            f"{SHORTEST_S:g} s; give a log of {2 * LEAST_JUDGES * SHORTEST_S:g} s or more"
        )
    count = int((last - first) / length + 1e-9)
    windows = [(first + k * length, first + (k + 1.0 - GAP_SHARE) * length) for k in range(count)]
    return Split(tuple(windows[::2]), tuple(windows[1::2]))


def _length(flight_s: float) -> float:
    """Of one window and the gap after it [s]: twice as many as are needed where that leaves USUAL_S to each."""
    return min(max(flight_s / (4 * LEAST_JUDGES), USUAL_S), flight_s / (2 * LEAST_JUDGES), LONGEST_S)


def split_flights(logs: Sequence[Log]) -> list[Split]:
    """Each log's windows; of several logs the second of every three has nothing fitted to it.

    InputError as `split_flight`.
    """
    splits = [split_flight(log) for log in logs]
    return [
        Split((), split.held, whole=True) if number % EVERY_THIRD == 1 else split for number, split in enumerate(splits)
    ]
