"""Where a log's reference stands still although the vehicle goes on: its tracker has lost it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import Table
from flownav.logs.motion_fit import FITS_NOISILY, fit_of, path_of
from flownav.logs.references import SHOWN
from flownav.logs.witnesses import Witness, tilt_change_rad

STUCK_S, STUCK_M = 2.0, 1.0  # how long a place is the same to the last digit, and how far the vehicle went meanwhile
STUCK_M_S = 0.1  # on the mean: more than a bias makes of standing
STUCK_TILT_RAD = np.radians(1.0)  # more than a vehicle that stands tilts by


class Standstill(NamedTuple):
    """From when to when a path stands still [s], and how far the vehicle went from there meanwhile [m]."""

    begin_s: float
    end_s: float
    way_m: float


def stuck_of(
    truth: Table, witnesses: Sequence[Witness], streams: Mapping[Sensor, Stream]
) -> tuple[list[Standstill], str]:
    """Where a tracker stands still while the vehicle goes on, as the first sensor shows that agrees with the rest
    of its path; and that sensor.
    """
    t_s, path = path_of(truth)
    for witness in (one for one in witnesses if one.order == 1):
        found = standstills(t_s, path, witness)
        if not found:
            continue
        moving = np.ones(len(t_s), bool)
        for one in found:
            moving &= (t_s <= one.begin_s) | (t_s >= one.end_s)
        fit = fit_of(t_s[moving], path[moving], witness)
        if fit is not None and fit.explained >= FITS_NOISILY:
            return [one for one in found if tilt_change_rad(streams, *one[:2]) >= STUCK_TILT_RAD], witness.name
    return [], ""


def standstills(t_s: Array, path: Array, witness: Witness) -> list[Standstill]:
    """Where a path (n,), (n, 3) stays the same to the last digit while a sensor of velocity shows a way."""
    same = np.concatenate([[False], (np.diff(path, axis=0) == 0.0).all(axis=1), [False]])
    edges = np.flatnonzero(np.diff(same.astype(int)))
    found = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        begin_s, end_s = float(t_s[first]), float(t_s[last])
        inside = (witness.t_s >= begin_s) & (witness.t_s <= end_s)
        if end_s - begin_s < STUCK_S or np.count_nonzero(inside) < 2:
            continue
        at_s, speed = witness.t_s[inside], witness.level[inside]
        way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(at_s))])
        steady = way[-1] * (at_s - at_s[0]) / (at_s[-1] - at_s[0])  # as a bias makes it
        farthest_m = float(np.abs(way).max())
        if farthest_m >= max(STUCK_M, STUCK_M_S * (end_s - begin_s)) or np.abs(way - steady).max() >= STUCK_M:
            found.append(Standstill(begin_s, end_s, farthest_m))
    return found


def without(truth: Table, stuck: Sequence[Standstill]) -> Table:
    """A reference without the rows in which it is stuck, but for the first of each."""
    t_s = np.asarray(truth["t_s"], float)
    kept = np.ones(len(t_s), bool)
    for one in stuck:
        kept &= (t_s <= one.begin_s) | (t_s > one.end_s)
    return {name: np.asarray(column)[kept] for name, column in truth.items()}


def words_of(stuck: Sequence[Standstill]) -> str:
    """When and how far, as "stands still from 3.10 to 8.20 s (2.4 m)"; the first SHOWN of them."""
    shown = ", ".join(f"from {begin:.2f} to {end:.2f} s ({way:.3g} m)" for begin, end, way in stuck[:SHOWN])
    return f"stands still {shown}" + (f" and {len(stuck) - SHOWN} times more" if len(stuck) > SHOWN else "")
