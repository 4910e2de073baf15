"""Where an estimate ends that was right at take-off: the truth is laid on it there, in place and heading."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.scoring.alignment import Alignment, align
from flownav.scoring.outage import difference_at

OFF_THE_GROUND_M = 0.05

Window = tuple[float, float]


class Motion(NamedTuple):
    """A path in its own frame: t_s (n,), position north, east, down [m] (n, 3), and its headings where it has some.

    heading_t_s (m,), heading_rad (m,): clockwise from the path's own north, any whole turns; empty without.
    """

    t_s: Array
    position: Array
    heading_t_s: Array
    heading_rad: Array


def flight_of(t_s: Array, down_m: Array) -> Window | None:
    """First and last instant at which a truth's height differs from its start by more than OFF_THE_GROUND_M [s].

    None where it never does.
    """
    away = np.flatnonzero(abs(down_m - down_m[0]) > OFF_THE_GROUND_M) if len(down_m) else np.zeros(0, int)
    return (float(t_s[away[0]]), float(t_s[away[-1]])) if len(away) else None


class Drift(NamedTuple):
    """The error of an estimate that was right at take-off: t_s (n,), horizontal and vertical [m], (n,) each."""

    t_s: Array
    horizontal_m: Array
    vertical_m: Array


def drift_of(estimate: Motion, truth: Motion, flight_s: Window | None = None) -> Drift | None:
    """The error at the truth's instants of flight that both cover; None without such a flight.

    flight_s: from when to when it flew; by the truth's height where nobody says.

    The truth is laid on the estimate at take-off, turned by the difference of headings there; without a heading of
    either by what fits the two paths best over the flight (least squares).
    """
    flight = flight_s or flight_of(truth.t_s, truth.position[:, 2])
    if flight is None or not len(estimate.t_s):
        return None
    inside = (truth.t_s >= max(flight[0], estimate.t_s[0])) & (truth.t_s <= min(flight[1], estimate.t_s[-1]))
    if np.count_nonzero(inside) < 2:
        return None
    t_s, position = truth.t_s[inside], truth.position[inside]
    ours = position + difference_at(estimate.t_s, estimate.position, t_s, position)
    turn = _heading_between(estimate, truth, float(t_s[0]))
    yaw = align(ours, position).yaw_rad if turn is None else turn
    moved = Alignment(yaw, (0.0, 0.0, 0.0)).turned(position - position[0])
    error = ours - ours[0] - moved
    return Drift(t_s, np.hypot(error[:, 0], error[:, 1]), abs(error[:, 2]))


def end_drift(estimate: Motion, truth: Motion, flight_s: Window | None = None) -> float | None:
    """Horizontal error [m] at the last instant of flight that both cover (`drift_of`); None without such a flight."""
    found = drift_of(estimate, truth, flight_s)
    return None if found is None else float(found.horizontal_m[-1])


def _heading_between(estimate: Motion, truth: Motion, at_s: float) -> float | None:
    """The estimate's heading less the truth's [rad]; None where one of them has none within its time."""
    ours, theirs = (_heading_at(path, at_s) for path in (estimate, truth))
    return None if ours is None or theirs is None else ours - theirs


def _heading_at(path: Motion, at_s: float) -> float | None:
    """Linear between the headings, over the turn's seam; None outside their time."""
    if not len(path.heading_t_s) or not path.heading_t_s[0] <= at_s <= path.heading_t_s[-1]:
        return None
    return float(np.interp(at_s, path.heading_t_s, np.unwrap(path.heading_rad)))
