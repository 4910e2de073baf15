"""When a log's vehicle flies, by who says so: the landed signal, the truth's height, the range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, Sensor
from flownav.logs.log import Log
from flownav.scoring.reference import flight_of

ON_THE_GROUND = 20  # readings of a range that starts on the ground
LIFTED_M = 0.3  # a sonar's noise and a landing gear's spring are less
NEAR_M = 0.1  # the way from here up to where it is surely lifted is flight already

Window = tuple[float, float]


def airborne_of(log: Log) -> Window | None:
    """From the first lift-off to the last touchdown [s]; None where nobody says."""
    if Sensor.LANDED in log.streams:
        landed = log.streams[Sensor.LANDED]
        flying = np.flatnonzero(landed.value[:, 0] < 0.5)
        if len(flying):
            last = flying[-1] + 1
            return float(landed.t_s[flying[0]]), float(landed.t_s[last]) if last < len(landed) else log.span_s[1]
    if log.truth is not None:
        return flight_of(np.asarray(log.truth["t_s"], float), np.asarray(log.truth["pos_d_m"], float))
    if Sensor.RANGE not in log.streams or len(log.streams[Sensor.RANGE]) < ON_THE_GROUND:
        return None
    distance = log.streams[Sensor.RANGE]
    height_m = distance.value[:, 0] - np.median(distance.value[:ON_THE_GROUND, 0])
    away = np.flatnonzero(height_m > LIFTED_M)
    if not len(away):
        return None
    near = np.flatnonzero(height_m <= NEAR_M)
    before, after = near[near < away[0]], near[near > away[-1]]
    first = before[-1] + 1 if len(before) else away[0]
    last = after[0] - 1 if len(after) else away[-1]
    return float(distance.t_s[first]), float(distance.t_s[last])


def flying_at(log: Log, t_s: Array) -> NDArray[np.bool_]:
    """Which instants (n,) lie in flight, stops on the ground between cut out; all where nobody says."""
    window = airborne_of(log)
    if window is None:
        return np.ones(len(t_s), bool)
    inside = (t_s >= window[0]) & (t_s <= window[1])
    if Sensor.LANDED not in log.streams:
        return np.asarray(inside)
    landed = log.streams[Sensor.LANDED]
    row = np.clip(np.searchsorted(landed.t_s, t_s, side="right") - 1, 0, len(landed) - 1)
    said = landed.value[row, 0] < 0.5
    return np.asarray(inside & said if (landed.value[:, 0] < 0.5).any() else inside)
