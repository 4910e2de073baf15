"""Guidance: where the helicopter is told to be, as a path of knots in the local NED frame.

The path is relative to the pad: position (0, 0, 0) is the ground at the pad's centre, so `down` is minus
the height of the skids. Between knots the reference moves in straight lines at constant speed, and through a knot at
constant acceleration: a corner that no vehicle can fly is one that it overshoots. A landing keeps descending past the
ground until the skids report contact.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import equation

PIECES = 8  # chosen: a corner of 1.5 s in steps of 0.2 s
LEFT_STRAIGHT = 0.9  # chosen: short legs keep a tenth of themselves (test_autopilot)


class Path(NamedTuple):
    """Knots: t_s (k,) strictly increasing, position_ned_m (k, 3). Before the first and after the last: held."""

    t_s: NDArray[np.float64]
    position_ned_m: NDArray[np.float64]


class Reference(NamedTuple):
    """Position [m] and velocity [m/s] in the local NED frame."""

    pos_n: float
    pos_e: float
    pos_d: float
    vel_n: float
    vel_e: float
    vel_d: float


@equation
def reference_at(path: Path, t_s: float) -> Reference:
    """The reference at time t: linear between knots, velocity the slope of the leg."""
    t, position = path.t_s, path.position_ned_m
    last = len(t) - 1
    leg = 0
    for k in range(1, last):
        leg = k if t_s >= t[k] else leg
    span = t[leg + 1] - t[leg]
    inside = t_s >= t[0] and t_s < t[last]
    share = min(1.0, max(0.0, (t_s - t[leg]) / span))
    rate = 1.0 / span if inside else 0.0
    step_n = position[leg + 1, 0] - position[leg, 0]
    step_e = position[leg + 1, 1] - position[leg, 1]
    step_d = position[leg + 1, 2] - position[leg, 2]
    return Reference(
        position[leg, 0] + share * step_n,
        position[leg, 1] + share * step_e,
        position[leg, 2] + share * step_d,
        rate * step_n,
        rate * step_e,
        rate * step_d,
    )


def path_through(knots: list[tuple[float, float, float, float]]) -> Path:
    """A path through (t_s, north_m, east_m, down_m) knots. ValueError unless two or more, times increasing."""
    table = np.asarray(knots, float).reshape(-1, 4)
    if len(table) < 2 or not np.all(np.diff(table[:, 0]) > 0.0):
        raise ValueError("a path needs two or more knots with strictly increasing times")
    return Path(np.ascontiguousarray(table[:, 0]), np.ascontiguousarray(table[:, 1:]))


def rounded(path: Path, blend_s: float) -> Path:
    """The path with every inner knot passed at constant acceleration over `blend_s`, in PIECES straight pieces.

    A leg is left for its corners nine tenths of its time at most. It is what averaging the path over that time gives:
    ahead of the corner by half of it, behind by as much, and on the legs between as before.
    """
    t, position = path.t_s, path.position_ned_m
    slopes = np.diff(position, axis=0) / np.diff(t)[:, None]
    times, places = [t[:1]], [position[:1]]
    for k in range(1, len(t) - 1):
        span = min(blend_s, LEFT_STRAIGHT * (t[k] - t[k - 1]), LEFT_STRAIGHT * (t[k + 1] - t[k]))
        before = np.linspace(-0.5 * span, 0.5 * span, PIECES + 1)[:, None]
        bend = (slopes[k] - slopes[k - 1]) * (before + 0.5 * span) ** 2 / (2.0 * span)
        times.append(t[k] + before[:, 0])
        places.append(position[k] + slopes[k - 1] * before + bend)
    times.append(t[-1:])
    places.append(position[-1:])
    return Path(np.ascontiguousarray(np.concatenate(times)), np.ascontiguousarray(np.concatenate(places)))
