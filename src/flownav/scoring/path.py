"""Errors of an estimated path against what a log knows: its GPS, through outages too, and its truth.

The same functions score a replay, its smoothed path, and whatever other estimate somebody holds against it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from flownav.core.frames import heading_from_quaternion
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_NED, Column, Table
from flownav.core.text import finite_or_none
from flownav.scoring.alignment import Alignment, align, velocity_of
from flownav.scoring.autopilot import columns_of, velocity_ned
from flownav.scoring.drift import Motion, Window, end_drift
from flownav.scoring.outage import OutageError, difference_at, horizontal_rms, outage_error


class Path(NamedTuple):
    """An estimate: t_s (n,), position north, east, down [m] (n, 3), velocity north, east [m/s] (n, 2).

    The velocity is NaN of an estimate that states none.
    """

    t_s: Array
    position: Array
    velocity_ne: Array


class References(NamedTuple):
    """What a log knows. fixes and speeds: GPS position and velocity as they arrived, t_s (m,) and value (m, 3).

    gps_delay_s: how old they were then. outages_s: windows in which GPS was withheld. truth: in its own frame; heading:
    its heading where that came apart from it. flight_s: from when to when it flew, None where nobody says.
    """

    fixes: tuple[Array, Array] | None = None
    speeds: tuple[Array, Array] | None = None
    gps_delay_s: float = 0.0
    outages_s: tuple[Window, ...] = ()
    truth: Table | None = None
    truth_name: str = ""
    heading: Table | None = None
    flight_s: Window | None = None


def path_of(table: Mapping[str, Column]) -> Path:
    """The path in a table; its velocity in the earth's axes where it states that, else turned by its attitude."""
    t_s, position = np.asarray(table["t_s"], float), columns_of(table, POSITION_NED)
    if set(VELOCITY_NED[:2]) <= table.keys():
        return Path(t_s, position, columns_of(table, VELOCITY_NED[:2]))
    velocity = velocity_ned(table)
    return Path(t_s, position, np.full((len(t_s), 2), np.nan) if velocity is None else velocity[:, :2])


def motion_of(table: Mapping[str, Column]) -> Motion:
    """The path in a table of a record, with the headings of its attitude where it has one."""
    t_s, position = np.asarray(table["t_s"], float), columns_of(table, POSITION_NED)
    if not set(QUATERNION) <= table.keys():
        return Motion(t_s, position, np.zeros(0), np.zeros(0))
    w, x, y, z = columns_of(table, QUATERNION).T
    heading = np.asarray(heading_from_quaternion(w, x, y, z))
    known = np.isfinite(heading)
    return Motion(t_s, position, t_s[known], heading[known])


def truth_motion(truth: Table, heading: Table | None) -> Motion:
    """A truth with its headings: those measured apart, else those of its attitude, else none."""
    if heading is None:
        return motion_of(truth)
    t_s, position = np.asarray(truth["t_s"], float), columns_of(truth, POSITION_NED)
    return Motion(t_s, position, np.asarray(heading["t_s"], float), np.asarray(heading["yaw_rad"], float))


def path_scores(estimate: Mapping[str, Column], known: References) -> dict[str, Any]:
    """Errors of the path: through each outage, of velocity against GPS, against the truth where there is one."""
    path = path_of(estimate)
    truth = truth_scores(path, known)
    return {
        "outages": [outage_entry(outage_of(path, known, *window)) for window in known.outages_s],
        "velocity_rms_m_s": velocity_rms(path, known),
        **({} if truth is None else {"truth": truth}),
    }


def outage_of(path: Path, known: References, t0: float, t1: float) -> OutageError:
    """The outage error over a window. ValueError without GPS."""
    if known.fixes is None:
        raise ValueError("an outage is scored against GPS, and there is none")
    t_s, value = known.fixes
    return outage_error(path.t_s, path.position[:, :2], t_s, value[:, :2], known.gps_delay_s, t0, t1)


def outage_entry(error: OutageError) -> dict[str, float | None]:
    """An outage as JSON has it; null where the window could not be scored."""
    return {name: finite_or_none(value) for name, value in error._asdict().items()}


def velocity_rms(path: Path, known: References) -> float | None:
    """Horizontal velocity against GPS velocity at the instant it describes [m/s]; None without either."""
    if known.speeds is None:
        return None
    t_s, value = known.speeds
    finite = np.isfinite(value[:, :2]).all(axis=1)
    instants = t_s[finite] - known.gps_delay_s
    return finite_or_none(horizontal_rms(path.t_s, path.velocity_ne, instants, value[finite, :2]))


def truth_alignment(path: Path, truth: Table | None) -> Alignment | None:
    """How a log's truth lies in the estimate's frame; None without a truth that overlaps."""
    if truth is None or not len(path.t_s):
        return None
    t_s, position = np.asarray(truth["t_s"], float), columns_of(truth, POSITION_NED)
    covered = (t_s >= path.t_s[0]) & (t_s <= path.t_s[-1])
    if np.count_nonzero(covered) < 2:
        return None
    return align(position[covered] + difference_at(path.t_s, path.position, t_s, position), position[covered])


def truth_scores(path: Path, known: References) -> dict[str, Any] | None:
    """Errors against the log's truth, turned and shifted onto the estimate; None without one."""
    placed, truth = truth_alignment(path, known.truth), known.truth
    if placed is None or truth is None:
        return None
    t_s, position = np.asarray(truth["t_s"], float), columns_of(truth, POSITION_NED)
    error = difference_at(path.t_s, path.position, t_s, placed.moved(position))
    velocity = placed.turned(velocity_of(t_s, position))
    squares = np.sum(error[:, :2] ** 2, axis=1)
    return {
        "reference": known.truth_name,
        "yaw_rad": placed.yaw_rad if placed.yaw_shown else None,
        "horizontal_rms_m": float(np.sqrt(squares.mean())),
        "horizontal_max_m": float(np.sqrt(squares.max())),
        "vertical_rms_m": float(np.sqrt(np.mean(error[:, 2] ** 2))),
        "velocity_rms_m_s": finite_or_none(horizontal_rms(path.t_s, path.velocity_ne, t_s, velocity[:, :2])),
    }


def end_drift_of(estimate: Motion, known: References) -> float | None:
    """Horizontal error at the end of the flight, the truth laid on the estimate at take-off [m]; None without one."""
    if known.truth is None:
        return None
    return end_drift(estimate, truth_motion(known.truth, known.heading), known.flight_s)
