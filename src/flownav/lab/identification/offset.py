"""Offset of a flow sensor where nothing moves: a drift that is fixed in the body's axes, about x and about y [rad/s].

Flow, its rotation taken off and its axes put right, is regressed on the reference's motion over the range and a
constant: as an angle, since a constant velocity at every height would be another fault. A vehicle that flies
all of its laps with the nose ahead shows less than one that hovers: a turn of the axes by a degree looks the same.
Intervals by stretches of CLUSTER_S, and by what this regression's response differs from the identified one, times the
motion's mean.
A gyro that takes the rotation off with a bias reads the same.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.lab.identification.flight import Flight
from flownav.lab.identification.quantities import Interval
from flownav.lab.identification.reference_motion import Motion
from flownav.sensors.datasheet import certain_offset

CLUSTER_S = 5.0
LEAST_CLUSTERS = 6
GPS_SLOW_M_S, GPS_SLOW_S = 0.05, 60.0  # chosen: what a receiver's velocity errs by, for as long
NEAREST_M = 0.2  # nearer, an error of the range makes any angle


class Offset(NamedTuple):
    """About body x and about body y [rad/s], each with its 95 % interval."""

    x: Interval
    y: Interval

    @property
    def certain(self) -> tuple[float, float]:
        """Both, 0 for one that is not known to be another: what is taken out."""
        x, y = (certain_offset(*axis) for axis in self)
        return x, y

    @property
    def matters(self) -> bool:
        """Whether one of them is known not to be 0."""
        return any(self.certain)


def flow_offset(flown: Flight, moved: Motion, velocity: Array, response: Array, age_s: float) -> Offset | None:
    """The offset that a flight shows; None of too short a one.

    velocity (n, 2): the flow's, its axes put right [m/s]; response (2, 2): to the body's velocity along x and y;
    age_s: how old a reading is when it arrives.
    """
    far = flown.good & (flown.range_m > NEAREST_M)
    t_s, range_m = flown.t_s[far], flown.range_m[far, None]
    labels = np.unique(np.floor(t_s / CLUSTER_S).astype(int), return_inverse=True)[1]
    if len(t_s) == 0 or labels.max() + 1 < LEAST_CLUSTERS:
        return None
    body = moved.in_body(flown, t_s - age_s)[:, :2] / range_m
    seen = velocity[far] / range_m
    design = np.column_stack([body, np.ones(len(body))])
    solution = np.linalg.lstsq(design, seen, rcond=None)[0]
    if np.linalg.matrix_rank(design) < design.shape[1]:
        return None  # it never moved along one axis, or by nothing but one velocity
    inverse, wander = np.linalg.inv(design.T @ design), _wander(flown, t_s, range_m)
    few = (labels.max() + 1) / (labels.max() - 2)
    found = []
    for axis in (0, 1):
        scores = design * (seen[:, axis] - design @ solution[:, axis])[:, None]
        sums = np.column_stack([np.bincount(labels, weights=column) for column in scores.T])
        chance = float(few * (inverse @ (sums.T @ sums) @ inverse)[2, 2])
        apart = float((response[axis] - solution[:2, axis]) @ body.mean(axis=0))
        found.append((float(solution[2, axis]), float(np.sqrt(chance + apart**2 + wander**2))))
    # forward velocity is flow about y; velocity to the right is flow about x, the other way round
    forward, right = found
    return Offset(Interval.of(-right[0], right[1]), Interval.of(*forward))


def _wander(flown: Flight, t_s: Array, range_m: Array) -> float:
    """Error of an offset due to a receiver's slow errors of velocity, which are fixed in earth axes [rad/s]."""
    if flown.reference != "gps":
        return 0.0
    level = flown.rotation(t_s)
    coherent = abs(np.mean(level[:, 0, 0] + 1j * level[:, 1, 0]))  # 1: the nose stays where it is
    lasts = min(1.0, GPS_SLOW_S / max(float(t_s[-1] - t_s[0]), 1.0))
    return float(GPS_SLOW_M_S * coherent * np.sqrt(lasts) / np.median(range_m))


def without(velocity: Array, range_m: Array, offset: Offset) -> Array:
    """Velocity (n, 2) of a flow whose offset is taken out."""
    x, y = offset.certain
    return np.asarray(velocity + range_m[:, None] * np.array([-y, x]))
