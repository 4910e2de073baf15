"""Guidance: where the helicopter is told to be, as a path of knots in the local NED frame.

The path is relative to the pad: position (0, 0, 0) is the ground at the pad's centre, so `down` is minus
the height of the skids. Between knots the reference moves in straight lines at constant speed; a landing
keeps descending past the ground until the skids report contact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import equation


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
