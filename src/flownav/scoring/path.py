"""Errors of an estimated path against what a log knows: its GPS, through outages too, and its truth.

The same functions score a replay, its smoothed path, and whatever other estimate somebody holds against it.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from flownav.core.frames import heading_from_quaternion, rotation_from_quaternion, to_earth, turned_about_down
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, VELOCITY_NED, Column, Table
from flownav.core.text import finite_or_none
from flownav.scoring.reference import (
    Alignment,
    Motion,
    OutageError,
    Window,
    align,
    difference_at,
    end_drift,
    horizontal_rms,
    outage_error,
    velocity_of,
)


class Path(NamedTuple):
    """An estimate: t_s (n,), position north, east, down [m] (n, 3), velocity north, east [m/s] (n, 2).

    The velocity is NaN of an estimate that states none.
    """

    t_s: Array
    position: Array
    velocity_ne: Array


class References(NamedTuple):
    """The references in a log. fixes and speeds: GPS position and velocity as they arrived, t_s (m,) and value (m, 3).

    gps_delay_s: how old they were then. outages_s: windows in which GPS was withheld. truth: in its own frame; heading:
    its heading where that came apart from it. flight_s: from when to when it flew, None where the log does not show it.
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
    """The outage error over a window.

    It is against the log's truth, turned onto GPS's north and taken at the instants that GPS describes, or against
    GPS, whose own slow errors count as drift, where there is no truth. A truth that no GPS shows the north of is turned
    onto the estimate. ValueError without either.
    """
    placed, truth = _truth_by_gps(known) or truth_alignment(path, known.truth), known.truth
    if placed is not None and truth is not None:
        t_s, value = np.asarray(truth["t_s"], float) + known.gps_delay_s, placed.turned(columns_of(truth, POSITION_NED))
    elif known.fixes is not None:
        t_s, value = known.fixes
    else:
        raise ValueError("an outage is scored against a truth or GPS, and there is neither")
    return outage_error(path.t_s, path.position[:, :2], t_s, value[:, :2], known.gps_delay_s, t0, t1)


def _truth_by_gps(known: References) -> Alignment | None:
    """How the truth lies in GPS's frame, which no estimate bends; None where the two do not show it."""
    if known.fixes is None:
        return None
    t_s, value = known.fixes
    placed = truth_alignment(Path(t_s - known.gps_delay_s, value, value[:, :2]), known.truth)
    return placed if placed is not None and placed.yaw_shown else None


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


# -- the autopilot's own estimate --------------------------------------------------------------------------------
LEAST_ROWS = 10
AGAINST = {"truth": "the reference, turned and shifted onto it", "gps": "GPS, mean difference taken out"}


class Offsets(NamedTuple):
    """An estimate less its reference: against "truth" or "gps", instants (n,), north, east, down [m] (n, 3).

    placed: how the truth was turned and shifted onto the estimate; None against GPS, whose mean difference is out.
    """

    against: str
    t_s: Array
    error: Array
    placed: Alignment | None


def autopilot_offsets(estimate: Table, truth: Table | None, gps: Mapping[Sensor, Stream]) -> Offsets | None:
    """Where an estimate's position lies from its reference; None where there is nothing to compare with.

    Against truth, which is turned and shifted onto the estimate first; else against GPS, whose mean difference is
    taken out (the two have different origins). `gps` with its delays.
    """
    t_s, position = np.asarray(estimate["t_s"], float), columns_of(estimate, POSITION_NED)
    if truth is not None:
        reference_t_s, reference = np.asarray(truth["t_s"], float), columns_of(truth, POSITION_NED)
        covered = (reference_t_s >= t_s[0]) & (reference_t_s <= t_s[-1])
        if np.count_nonzero(covered) < LEAST_ROWS:
            return None
        placed = align(reference[covered] + difference_at(t_s, position, reference_t_s, reference), reference[covered])
        error = difference_at(t_s, position, reference_t_s, placed.moved(reference))
        return Offsets("truth", reference_t_s[covered], error, placed)
    if Sensor.GPS_POSITION not in gps:
        return None
    fixes = gps[Sensor.GPS_POSITION]
    taken_s = fixes.t_s - fixes.delay_s
    error = difference_at(t_s, position, taken_s, fixes.value)
    error = error - error.mean(axis=0) if len(error) else error
    return Offsets("gps", taken_s[(taken_s >= t_s[0]) & (taken_s <= t_s[-1])], error, None)


def autopilot_errors(estimate: Table, truth: Table | None, gps: Mapping[Sensor, Stream]) -> dict[str, Any]:
    """Errors of an estimate's position and velocity against the reference of `autopilot_offsets`; None each without."""
    found = autopilot_offsets(estimate, truth, gps)
    if found is None:
        return _errors(None, np.zeros((0, 3)), np.nan, None)
    t_s, velocity, placed = np.asarray(estimate["t_s"], float), velocity_ned(estimate), found.placed
    if truth is not None and placed is not None:
        reference_t_s, reference = np.asarray(truth["t_s"], float), columns_of(truth, POSITION_NED)
        moving = placed.turned(velocity_of(reference_t_s, reference))
        yaw_rad = placed.yaw_rad if placed.yaw_shown else None
        return _errors("truth", found.error, _rms(t_s, velocity, reference_t_s, moving), yaw_rad)
    if Sensor.GPS_VELOCITY not in gps:
        return _errors("gps", found.error, np.nan, None)
    speeds = gps[Sensor.GPS_VELOCITY]
    known = np.isfinite(speeds.value).all(axis=1)
    moving_rms = _rms(t_s, velocity, speeds.t_s[known] - speeds.delay_s, speeds.value[known])
    return _errors("gps", found.error, moving_rms, None)


def placed_in(t_s: Array, position: Array, estimate: Table, gps: Mapping[Sensor, Stream]) -> Alignment | None:
    """The alignment of an autopilot's estimate with the frame of another one, t_s (n,) and position (n, 3); None where
    they share no time.

    By GPS where there is some: shifted by its mean difference from GPS, the frame of which is the other's. Without,
    the autopilot's north may be any: turned and shifted onto the other.
    """
    theirs_t_s, theirs = np.asarray(estimate["t_s"], float), columns_of(estimate, POSITION_NED)
    if Sensor.GPS_POSITION in gps:
        fixes = gps[Sensor.GPS_POSITION]
        error = difference_at(theirs_t_s, theirs, fixes.t_s - fixes.delay_s, fixes.value)
        if len(error) < LEAST_ROWS:
            return None
        north, east, down = (-error.mean(axis=0)).tolist()
        return Alignment(0.0, (north, east, down))
    covered = (theirs_t_s >= t_s[0]) & (theirs_t_s <= t_s[-1])
    if np.count_nonzero(covered) < LEAST_ROWS:
        return None
    ours = theirs[covered] + difference_at(t_s, position, theirs_t_s, theirs)
    return align(ours, theirs[covered])


def moved_by(estimate: Table, placed: Alignment) -> Table:
    """An estimate with its position and attitude, where it has them, in another frame; body velocity stays."""
    table: Table = dict(estimate)
    if set(POSITION_NED) <= estimate.keys():
        table |= dict(zip(POSITION_NED, placed.moved(columns_of(estimate, POSITION_NED)).T, strict=True))
    if set(QUATERNION) <= estimate.keys():
        turned = turned_about_down(tuple(columns_of(estimate, QUATERNION).T), placed.yaw_rad)
        table |= dict(zip(QUATERNION, map(np.asarray, turned), strict=True))
    return table


def _errors(against: str | None, error: Array, velocity_rms: float, yaw_rad: float | None) -> dict[str, Any]:
    enough = len(error) >= LEAST_ROWS
    horizontal = np.hypot(error[:, 0], error[:, 1])
    return {
        "against": against if enough else None,
        "horizontal_rms_m": float(np.sqrt(np.mean(horizontal**2))) if enough else None,
        "horizontal_max_m": float(horizontal.max()) if enough else None,
        "vertical_rms_m": float(np.sqrt(np.mean(error[:, 2] ** 2))) if enough else None,
        "velocity_rms_m_s": finite_or_none(velocity_rms),
        "yaw_rad": yaw_rad if enough else None,
    }


def columns_of(table: Mapping[str, Column], names: tuple[str, ...]) -> Array:
    """Columns of a table side by side, (n, len(names))."""
    return np.column_stack([np.asarray(table[name], float) for name in names])


def velocity_ned(estimate: Mapping[str, Column]) -> Array | None:
    """Velocity north, east, down (n, 3) from body axes; None where the estimate has none."""
    if not {*VELOCITY_BODY, *QUATERNION} <= estimate.keys():
        return None
    rotation = rotation_from_quaternion(*columns_of(estimate, QUATERNION).T)
    return np.column_stack(to_earth(rotation, *columns_of(estimate, VELOCITY_BODY).T))


def _rms(t_s: Array, velocity: Array | None, reference_t_s: Array, reference: Array) -> float:
    """Horizontal [m/s]; NaN without a velocity or common time."""
    return np.nan if velocity is None else horizontal_rms(t_s, velocity[:, :2], reference_t_s, reference[:, :2])
