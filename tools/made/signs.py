"""The first sign of an error in a flight, from its errors and the record's events."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.navigation.tape import EVENT_NAMES
from flownav.replays.session import Replay
from flownav.scoring.reference import Drift
from made.flight import Array


class Errors(NamedTuple):
    """Errors in flight at the estimate's instants t_s (n,): velocity forward, right [m/s] (n, 2), tilt and heading
    [rad], height [m] (n,). squares (3,): mean squares of the error over the stated one, of position (north, east),
    velocity (forward, right) and heading.
    """

    t_s: Array
    velocity_m_s: Array
    tilt_rad: Array
    heading_rad: Array
    height_m: Array
    squares: tuple[float, float, float]


WRONG = {"height 0.5 m": 0.5, "tilt 4°": 0.07, "heading 4°": 0.07, "velocity 0.3 m/s": 0.3, "drift 0.5 m": 0.5}
LASTS_S = 0.5  # an error that goes away at once is no sign
BIAS_MOVED_RAD_S = 0.004
LATER_S = 10.0  # after take-off: what was learnt on the ground is used, what is learnt in flight begins
UNSURE_M = 1.0  # a position stated worse than this at take-off: nobody saw that it stood
ACCUSE_NOBODY = ("start", "datum", "aided", "trusted", "cleared")


def signs_of(errors: Errors, flown: Replay, drift: Drift) -> tuple[str, ...]:
    """Errors that lasted, in the order of time; biases that moved; the last events before the first of them."""
    begin_s = float(errors.t_s[0])
    sizes = (abs(errors.height_m), errors.tilt_rad, abs(errors.heading_rad), np.hypot(*errors.velocity_m_s.T))
    begun = [(since(errors.t_s, size > least), name) for (name, least), size in zip(WRONG.items(), sizes, strict=False)]
    begun.append((since(drift.t_s, drift.horizontal_m > WRONG["drift 0.5 m"]), "drift 0.5 m"))
    first = sorted((at_s, name) for at_s, name in begun if at_s is not None)
    until_s = first[0][0] if first else float(errors.t_s[-1])
    found = [f"{name} at {at_s - begin_s:+.1f} s" for at_s, name in first]
    return (
        *found,
        *_unsure(flown, begin_s),
        *_moved(flown, begin_s, float(errors.t_s[-1])),
        *_events(flown, begin_s, until_s),
    )


def since(t_s: Array, wrong: np.ndarray) -> float | None:
    """The first instant from which something is wrong for LASTS_S; None without."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wrong, [False]]).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if t_s[end - 1] - t_s[begin] >= LASTS_S:
            return float(t_s[begin])
    return None


def _unsure(flown: Replay, begin_s: float) -> list[str]:
    """That the position was not known at take-off."""
    said = flown.estimate_rows
    stated_m = float(said.std_pos_ned_m[min(int(np.searchsorted(said.t_s, begin_s)), len(said.t_s) - 1), 0])
    return [f"position stated to {stated_m:.1f} m at take-off"] if stated_m > UNSURE_M else []


def _moved(flown: Replay, begin_s: float, end_s: float) -> list[str]:
    """Gyro biases that moved in flight."""
    said = flown.estimate_rows
    at = [int(np.searchsorted(said.t_s, t_s)) for t_s in (begin_s, begin_s + LATER_S, end_s)]
    values = said.states[np.minimum(at, len(said.t_s) - 1), :3]
    return [
        f"gyro bias {axis} {first:+.4f} at take-off, {later:+.4f} {LATER_S:.0f} s later, {last:+.4f} at the end"
        for axis, (first, later, last) in zip("xyz", values.T, strict=True)
        if max(first, later, last) - min(first, later, last) > BIAS_MOVED_RAD_S
    ]


def _events(flown: Replay, begin_s: float, until_s: float) -> list[str]:
    """The last three that accuse somebody."""
    told = [
        f"{EVENT_NAMES[int(kind)][0]} {EVENT_NAMES[int(kind)][1]} {value:.3g} at {t_s - begin_s:+.1f} s"
        for t_s, kind, value in flown.written.event.tolist()
        if t_s <= until_s and EVENT_NAMES[int(kind)][1] not in ACCUSE_NOBODY
    ]
    return told[-3:]
