"""Is a log's reference one path in one frame? Rows that cannot be are left out, leaps taken back, and both are noted.

A tracker mistakes a marker, a simulator sets its vehicle elsewhere, visual odometry starts anew: one row at 50 km is
not an error of 700 m rms of the estimate compared with it. The path goes on where it was; within each piece it is
scored as it is.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, Stream
from flownav.core.record import POSITION_NED, Table
from flownav.logs.unfelt import Unfelt, unfelt

FARTHEST_M = 1e5  # from a local origin
LEAST_LEAP_M, LEAST_LEAP_M_S = 0.5, 20.0  # more than its own motion makes it, and that much per time
LEAST_PIECE_S = 1.0  # what is shorter is a stray; over as long the path before and after a leap must stay apart
STEPS = 5  # whose median is the motion before a leap
MOST_STRAYS = 0.2  # of the rows; with more nothing is known of which are right
LEAST_SCATTERS = 6.0  # of the path about its motion, that a leap is longer than
LEAST_MOVE_M, LEAST_ROWS = 1.0, 10  # of an origin; rows before and after
SHOWN = 3
MOST_UNFELT = 20  # leaps that no accelerometer felt


def _rows(table: Table, kept: NDArray[np.bool_]) -> Table:
    """The table without some of its rows; itself where all are kept."""
    return table if kept.all() else {key: np.asarray(column)[kept] for key, column in table.items()}


class Leap(NamedTuple):
    """When a path leaps [s], and by what beside its own motion, north, east, down [m]."""

    t_s: float
    by_ned_m: Array


def examined(truth: Table, name: str, imu: Stream | None = None) -> tuple[Table, tuple[str, ...]]:
    """A reference without strays and leaps, and a note on each kind; the table itself where there are none. Rows that
    can be no place are left out, however many they are.

    truth: columns t_s and POSITION_NED at least, in order of time. name: of the reference, for the notes. imu: by which
    a leap that is spread over many rows is known, where there is one.
    """
    t_s = np.asarray(truth["t_s"], float)
    position = np.column_stack([np.asarray(truth[column], float) for column in POSITION_NED])
    possible = np.isfinite(position).all(axis=1) & (np.abs(position) <= FARTHEST_M).all(axis=1)
    kept = possible & ~_short_pieces(t_s, position, possible)
    strays = np.flatnonzero(~kept)
    if np.count_nonzero(possible & ~kept) > MOST_STRAYS * len(t_s):
        about = f"{name} leaps about ({len(strays)} of its {len(t_s)} rows): errors against it mean little"
        return _rows(truth, possible), (about,)
    table = _rows(truth, kept)
    if not kept.any():
        return table, _of_strays(name, t_s[strays])
    leaps = lasting(leaps_of(t_s[kept], position[kept]), t_s[kept], position[kept])
    for leap in leaps:
        later = np.asarray(table["t_s"], float) >= leap.t_s
        table = _shifted(table, later, leap.by_ned_m)
    table, slow = _without_unfelt(table, name, imu)
    return table, (*_of_strays(name, t_s[strays]), *_of_leaps(name, leaps), *slow)


def _shifted(table: Table, later: NDArray[np.bool_], by_ned_m: Array) -> Table:
    """The table with the places of some rows shifted back."""
    return table | {
        column: np.where(later, np.asarray(table[column], float) - by, table[column])
        for column, by in zip(POSITION_NED, by_ned_m, strict=True)
    }


def _without_unfelt(table: Table, name: str, imu: Stream | None) -> tuple[Table, tuple[str, ...]]:
    """The table without the leaps that no accelerometer felt and after which its path stays apart, and a note."""
    notes = []
    for _ in range(MOST_UNFELT):  # each is taken back before the next is looked for
        t_s = np.asarray(table["t_s"], float)
        position = np.column_stack([np.asarray(table[column], float) for column in POSITION_NED])
        for leap in unfelt(t_s, position, imu):
            outside = (t_s <= leap.begin_s) | (t_s >= leap.end_s)
            if _stays(leap, t_s, position):
                table = _shifted(_rows(table, outside), t_s[outside] >= leap.end_s, leap.by_ned_m)
                size_m = float(np.linalg.norm(leap.by_ned_m))
                notes.append(f"by {size_m:.3g} m from {leap.begin_s:.2f} to {leap.end_s:.2f} s")
                break
        else:
            break
    if not notes:
        return table, ()
    return table, (
        f"{name} leaps {', '.join(notes)}, which no accelerometer felt; these rows are left out, and what follows is "
        "shifted back",
    )


def _stays(leap: Unfelt, t_s: Array, position: Array) -> bool:
    """Whether a path (n,), (n, 3) stays apart from where it was going: by its median velocity of a second on either
    side.
    """
    pieces = [
        _Piece.of(t_s[part], position[part])
        for part in (
            (t_s <= leap.begin_s) & (t_s >= leap.begin_s - LEAST_PIECE_S),
            (t_s >= leap.end_s) & (t_s <= leap.end_s + LEAST_PIECE_S),
        )
    ]
    middle_s = 0.5 * (leap.begin_s + leap.end_s)
    apart, size_m = pieces[1].at(middle_s) - pieces[0].at(middle_s), float(np.linalg.norm(leap.by_ned_m))
    scatter_m = max(piece.scatter_m for piece in pieces)
    return float(apart @ leap.by_ned_m) >= 0.5 * size_m**2 and size_m >= LEAST_SCATTERS * scatter_m


def leaps_of(t_s: Array, position: Array) -> list[Leap]:
    """Where a path (n,), (n, 3) leaps. Rows that repeat the place before them are copies, or stand.

    A leap that a tracker's own filter spreads over several rows is as many leaps, and the rows between them are strays.
    """
    new = np.flatnonzero(np.concatenate([[True], (np.diff(position, axis=0) != 0.0).any(axis=1)]))
    if len(t_s) < 2 or len(new) < 2:
        return []
    at, path = t_s[new], position[new]
    step = np.diff(path, axis=0)
    usual_s = float(np.median(np.diff(at)))  # between places: of copies longer than between rows
    since_s = np.maximum(t_s[new[1:]] - t_s[new[1:] - 1], usual_s)  # what hides for a while may have moved meanwhile
    step_s = np.maximum(np.minimum(np.diff(at), since_s), 1e-6)
    found: list[Leap] = []
    speed = step / step_s[:, None]
    fast = np.linalg.norm(speed, axis=1) >= LEAST_LEAP_M_S
    for place in np.flatnonzero(fast):
        first, last = _run(fast, step_s, int(place))
        before, after = speed[max(first - STEPS, 0) : first], speed[last + 1 : last + 1 + STEPS]
        motions = [np.median(one, axis=0) for one in (before, after) if len(one)] or [np.zeros(3)]
        beyond = min((step[place] - motion * step_s[place] for motion in motions), key=lambda by: float(by @ by))
        size = float(np.linalg.norm(beyond))
        if size >= LEAST_LEAP_M and size >= LEAST_LEAP_M_S * step_s[place]:
            found.append(Leap(float(at[place + 1]), beyond))
    return found


def _run(fast: NDArray[np.bool_], step_s: Array, place: int) -> tuple[int, int]:
    """The first and the last of the fast steps around one; itself where they last: the vehicle is as fast as that."""
    slow = np.flatnonzero(~fast)
    after = int(np.searchsorted(slow, place))
    first = int(slow[after - 1]) + 1 if after else 0
    last = int(slow[after]) - 1 if after < len(slow) else len(fast) - 1
    return (first, last) if step_s[first : last + 1].sum() < LEAST_PIECE_S else (place, place)


def lasting(leaps: Sequence[Leap], t_s: Array, position: Array) -> list[Leap]:
    """Those leaps after which a path (n,), (n, 3) stays apart from where it was going.

    The path of a second before, and of one after, are each carried to the leap by their median velocity. A row with a
    late stamp, a spike that settles, or noise leaves the two together. Where one place was repeated for more than a
    second before, the vehicle stood there, or its tracker had lost it: a way that either velocity makes meanwhile is no
    leap.
    """
    new = np.flatnonzero(np.concatenate([[True], (np.diff(position, axis=0) != 0.0).any(axis=1)]))
    at_s, path = t_s[new], position[new]
    usual_s = float(np.median(np.diff(at_s))) if len(at_s) > 1 else 0.0
    found = []
    for leap in leaps:
        place = int(np.searchsorted(at_s, leap.t_s))
        early = slice(int(np.searchsorted(at_s, at_s[place - 1] - LEAST_PIECE_S)), place)
        late = slice(place, int(np.searchsorted(at_s, leap.t_s + LEAST_PIECE_S, side="right")))
        pieces = [_Piece.of(at_s[part], path[part]) for part in (early, late)]
        held_s, size_m = float(at_s[place] - at_s[place - 1]), float(np.linalg.norm(leap.by_ned_m))
        if held_s > LEAST_PIECE_S:
            step = path[place] - path[place - 1]
            left_m = [float(np.linalg.norm(step - piece.motion * held_s)) for piece in pieces]
            stays = min(left_m) >= 0.5 * float(np.linalg.norm(step))
        else:
            middle_s = float(at_s[place] - 0.5 * held_s)
            apart = pieces[1].at(middle_s) - pieces[0].at(middle_s)
            scatter_m = max(piece.scatter_m for piece in pieces)
            stamped_m = usual_s * max(float(np.linalg.norm(piece.motion)) for piece in pieces)  # by a stamp that is off
            least_m = max(LEAST_SCATTERS * scatter_m, stamped_m)
            stays = float(apart @ leap.by_ned_m) >= 0.5 * size_m**2 and size_m >= least_m
        if stays:
            found.append(leap)
    return found


class _Piece(NamedTuple):
    """A second of a path: its median velocity [m/s], where that has it at an instant [m], and its scatter [m]."""

    t_s: float
    place: Array
    motion: Array
    scatter_m: float

    @classmethod
    def of(cls, t_s: Array, path: Array) -> "_Piece":
        """By rows (n,), (n, 3)."""
        speed = np.diff(path, axis=0) / np.maximum(np.diff(t_s), 1e-6)[:, None]
        motion = np.median(speed, axis=0) if len(speed) else np.zeros(3)
        there = path - motion * (t_s - t_s[0])[:, None]
        place = np.median(there, axis=0)
        return cls(float(t_s[0]), place, motion, float(np.median(np.linalg.norm(there - place, axis=1))))

    def at(self, t_s: float) -> Array:
        """Where it is at an instant."""
        return np.asarray(self.place + self.motion * (t_s - self.t_s))


def of_one_origin(t_s: Array, local: Array, known_t_s: Array, known: Array) -> tuple[Array, list[Leap]]:
    """A local path (n,), (n, 3) about its first origin, and when and by what that moved.

    known_t_s (m,), known (m, 3): the same estimate about an origin that does not move. Where the two part from one row
    to the next and stay apart, it is the origin that has moved. The known ones about a row are left out: between them
    it is not known when the estimate itself was reset.
    """
    path, found = local.copy(), list[Leap]()
    covered = np.flatnonzero((t_s >= known_t_s[0]) & (t_s <= known_t_s[-1])) if len(known_t_s) else np.zeros(0, int)
    if len(covered) < 2 * LEAST_ROWS:
        return path, found
    there = np.column_stack([np.interp(t_s[covered], known_t_s, column) for column in known.T])
    apart, at_s, done = local[covered] - there, t_s[covered], 0
    for place in np.flatnonzero(np.linalg.norm(np.diff(apart, axis=0), axis=1) >= LEAST_MOVE_M) + 1:
        last = known_t_s[np.searchsorted(known_t_s, at_s[place - 1], side="right") - 1]
        first = known_t_s[np.searchsorted(known_t_s, at_s[place])]
        early, late = int(np.searchsorted(at_s, last, side="right")), int(np.searchsorted(at_s, first))
        before, after = apart[max(early - LEAST_ROWS, 0) : early], apart[late : late + LEAST_ROWS]
        if place < done or min(len(before), len(after)) < LEAST_ROWS:
            continue
        by = np.median(after, axis=0) - np.median(before, axis=0)
        if float(np.linalg.norm(by)) >= LEAST_MOVE_M:
            found.append(Leap(float(at_s[place]), by))
            path[covered[place] :] -= by
            done = late + LEAST_ROWS  # what moves within the rows after is in their median already
    return path, found


def _short_pieces(t_s: Array, position: Array, possible: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The rows of pieces between leaps, and before and after them, that are too short to be reported."""
    short = np.zeros(len(t_s), bool)
    leaps = [leap.t_s for leap in leaps_of(t_s[possible], position[possible])]
    edges = [-np.inf, *leaps, np.inf] if leaps else []
    for first, last in pairwise(edges):
        inside = (t_s >= first) & (t_s < last)
        if inside.any() and t_s[inside][-1] - t_s[inside][0] < LEAST_PIECE_S:
            short |= inside
    return short


def _of_strays(name: str, strays_s: Array) -> tuple[str, ...]:
    if not len(strays_s):
        return ()
    rows = "one row is" if len(strays_s) == 1 else f"{len(strays_s)} rows are"
    return (f"{name}: {rows} far from the others and left out, at {_times(strays_s)}",)


def _of_leaps(name: str, leaps: list[Leap]) -> tuple[str, ...]:
    if not leaps:
        return ()
    return (f"{name} leaps {listed(leaps)}; what follows is shifted back, and each piece is scored as it is",)


def listed(leaps: Sequence[Leap]) -> str:
    """By how much, and when."""
    sizes = ", ".join(f"by {float(np.linalg.norm(leap.by_ned_m)):.3g} m at {leap.t_s:.2f} s" for leap in leaps[:SHOWN])
    return sizes + (f" and {len(leaps) - SHOWN} times more" if len(leaps) > SHOWN else "")


def _times(t_s: Array) -> str:
    shown = ", ".join(f"{one:.2f}" for one in t_s[:SHOWN].tolist())
    return f"{shown} s" + (" and later" if len(t_s) > SHOWN else "")
