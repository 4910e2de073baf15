"""What an estimator said, whatever it is: where, how fast and which way, by the instant."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.core.measurement import Array
from flownav.core.record import QUATERNION, VELOCITY_BODY, Table
from flownav.navigation.rows import EstimateRow
from flownav.navigation.tables import estimate_table
from flownav.scoring.autopilot import columns_of
from flownav.scoring.drift import Motion
from flownav.scoring.path import motion_of

LONGEST_GAP_S = 0.5  # over more, an estimate between two rows is nobody's


class Track(NamedTuple):
    """An estimator's path with its headings, and its velocity north, east [m/s] (n, 2) at the same instants."""

    motion: Motion
    velocity_ne: Array

    @property
    def t_s(self) -> Array:
        """The instants (n,)."""
        return self.motion.t_s


def of_estimate(rows: Array) -> Track:
    """Of a replay: rows of a tape's estimate."""
    return Track(motion_of(estimate_table(rows)), EstimateRow.of(rows).vel_ned_m_s[:, :2])


def of_table(table: Table) -> Track:
    """Of an autopilot's own estimate; its velocity is NaN where it states none, or no attitude to turn it by."""
    motion = motion_of(table)
    velocity = np.full((len(motion.t_s), 2), np.nan)
    if {*VELOCITY_BODY, *QUATERNION} <= table.keys():
        rotation = rotation_from_quaternion(*columns_of(table, QUATERNION).T)
        velocity = np.column_stack(to_earth(rotation, *columns_of(table, VELOCITY_BODY).T))[:, :2]
    return Track(motion, velocity)


def says(track: Track, instants_s: Array) -> NDArray[np.bool_]:
    """At which instants (m,) the estimator has a row, or one on either side no more than LONGEST_GAP_S apart."""
    t_s = track.t_s
    if not len(t_s):
        return np.zeros(len(instants_s), bool)
    after = np.clip(np.searchsorted(t_s, instants_s), 1, max(len(t_s) - 1, 1))
    inside = np.asarray((instants_s >= t_s[0]) & (instants_s <= t_s[-1]))
    if len(t_s) < 2:
        return inside
    return np.asarray(inside & (t_s[after] - t_s[after - 1] <= LONGEST_GAP_S))


def at(track: Track, values: Array, instants_s: Array) -> Array:
    """Columns of a track (n, k) at other instants (m,), linear between its rows."""
    return np.column_stack([np.interp(instants_s, track.t_s, column) for column in values.T])
