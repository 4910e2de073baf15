"""The cost of passing means of several inertial readings: the state compared with that of all readings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from emulation.narrow import apart
from flownav.core.measurement import Array, Sensor
from flownav.export.onboard.board import Board
from flownav.export.onboard.interface import Rates
from flownav.navigation import progress
from flownav.navigation.rings import Given

EVERY = 40  # inertial readings, a multiple of what is summed


def in_means(readings: Sequence[Given], count: int) -> Iterator[Given]:
    """Each `count` inertial readings of a unit that integrates as their mean, weighted by time, at the last's time."""
    sums, since_s, last_s, held = np.zeros(6), np.nan, np.nan, 0
    for given in readings:
        if given.sensor != Sensor.IMU:
            yield given
            continue
        if np.isfinite(last_s):  # the first says nothing of how long it is
            sums, held = sums + given.numbers[:6] * (given.t_s - last_s), held + 1
        else:
            since_s = given.t_s
        last_s = given.t_s
        if held == count:
            numbers = given.numbers.copy()
            numbers[:6] = sums / (last_s - since_s)
            yield Given(given.t_s, given.sensor, numbers)
            sums, since_s, held = np.zeros(6), last_s, 0


def means_apart(settings: Array, rates: Rates, lag: bool, readings: Sequence[Given], count: int) -> Array:
    """By how many standard deviations position, velocity and attitude differ with means: (2, 3), median and worst."""
    fewer = iter(in_means(readings, count))
    whole, coarse = (Board(settings, rates.sizes, lag=lag) for _ in range(2))
    found, inertial, coming = [], 0, next(fewer, None)
    for given in readings:
        whole.take(given)
        while coming is not None and coming.t_s <= given.t_s:
            coarse.take(coming)
            coming = next(fewer, None)
        inertial += given.sensor == Sensor.IMU
        if given.sensor == Sensor.IMU and inertial % EVERY == 1:  # both have read up to here
            told = whole.now(given.t_s), coarse.now(given.t_s)
            if all(each.status == progress.STATE_GIVEN for each in told):
                found.append(apart(*told))
    return np.array([np.median(found, axis=0), np.max(found, axis=0)])
