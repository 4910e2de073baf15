"""The autopilot's own estimate: against the best reference that its log has, and in the frame of ours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flownav.core.frames import rotation_from_quaternion, to_earth, turned_about_down
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Column, Table
from flownav.core.text import finite_or_none
from flownav.scoring.alignment import Alignment, align, velocity_of
from flownav.scoring.outage import difference_at, horizontal_rms

LEAST_ROWS = 10


def autopilot_errors(estimate: Table, truth: Table | None, gps: Mapping[Sensor, Stream]) -> dict[str, Any]:
    """Errors of an estimate's position and velocity; None each where there is nothing to compare with.

    Against truth, which is turned and shifted onto the estimate first; else against GPS, whose mean difference is
    taken out (the two have different origins). `gps` with its delays.
    """
    t_s, position = np.asarray(estimate["t_s"], float), columns_of(estimate, POSITION_NED)
    velocity = velocity_ned(estimate)
    if truth is not None:
        reference_t_s, reference = np.asarray(truth["t_s"], float), columns_of(truth, POSITION_NED)
        covered = (reference_t_s >= t_s[0]) & (reference_t_s <= t_s[-1])
        if np.count_nonzero(covered) < LEAST_ROWS:
            return _errors(None, np.zeros((0, 3)), np.nan, None)
        placed = align(reference[covered] + difference_at(t_s, position, reference_t_s, reference), reference[covered])
        error = difference_at(t_s, position, reference_t_s, placed.moved(reference))
        moving = placed.turned(velocity_of(reference_t_s, reference))
        yaw_rad = placed.yaw_rad if placed.yaw_shown else None
        return _errors("truth", error, _rms(t_s, velocity, reference_t_s, moving), yaw_rad)
    if Sensor.GPS_POSITION not in gps:
        return _errors(None, np.zeros((0, 3)), np.nan, None)
    fixes = gps[Sensor.GPS_POSITION]
    error = difference_at(t_s, position, fixes.t_s - fixes.delay_s, fixes.value)
    error = error - error.mean(axis=0) if len(error) else error
    if Sensor.GPS_VELOCITY not in gps:
        return _errors("gps", error, np.nan, None)
    speeds = gps[Sensor.GPS_VELOCITY]
    known = np.isfinite(speeds.value).all(axis=1)
    moving_rms = _rms(t_s, velocity, speeds.t_s[known] - speeds.delay_s, speeds.value[known])
    return _errors("gps", error, moving_rms, None)


def in_frame_of(t_s: Array, position: Array, estimate: Table, gps: Mapping[Sensor, Stream]) -> Table | None:
    """An autopilot's estimate in the frame of another one, t_s (n,) and position (n, 3); None where they share no time.

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
        return _moved(estimate, Alignment(0.0, (north, east, down)))
    covered = (theirs_t_s >= t_s[0]) & (theirs_t_s <= t_s[-1])
    if np.count_nonzero(covered) < LEAST_ROWS:
        return None
    ours = theirs[covered] + difference_at(t_s, position, theirs_t_s, theirs)
    return _moved(estimate, align(ours, theirs[covered]))


def _moved(estimate: Table, placed: Alignment) -> Table:
    """An estimate with its position and attitude in another frame; velocity, in body axes, stays."""
    table = {**estimate, **dict(zip(POSITION_NED, placed.moved(columns_of(estimate, POSITION_NED)).T, strict=True))}
    if set(QUATERNION) <= estimate.keys():
        turned = turned_about_down(tuple(columns_of(estimate, QUATERNION).T), placed.yaw_rad)
        table |= dict(zip(QUATERNION, turned, strict=True))
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
