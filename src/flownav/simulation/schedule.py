"""When each sensor reads and when the navigator takes it: one timetable for all flights of a scenario.

Every reading has three times: the instant at which it was taken, the instant that it describes as far as anybody
knows (`t_s`: its arrival less the age that the datasheet states; arrivals are uneven, so this is off by the jitter),
and the epoch in which the navigator takes it, a fixed horizon later. Readings are taken in the order of `t_s`, as a
live session's horizon releases them. The timetable is a scenario's, not a flight's: what differs from flight to
flight is what was read and whether it arrived.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Sensor
from flownav.simulation.onboard import EPOCH_S, PHYSICS_PERIOD_S, Clock, Onboard
from flownav.simulation.truth import CARRIED

JITTER_KEY = 20251121  # of the timetable's own generator: it is part of the scenario, not of a seed
KEYS_A_KIND = 256  # of several sensors of one kind each has its own jitter
SLACK_S = 1e-9  # what rounding leaves of an instant


class Timing(NamedTuple):
    """lag_s: age of what is read at the instant of reading it (a sensor's own dynamics); latency_s: from there to its
    arrival; jitter_s: how uneven arrivals are, and so how far off their stamps.
    """

    lag_s: float
    latency_s: float
    jitter_s: float


class Schedule(NamedTuple):
    """The readings in the order in which the navigator takes them.

    t_s (n,), sensor (n,), slot (n,) of the ring, epoch (n,) in which it is taken; slots: of the ring; horizon_epochs:
    how far the navigator lags behind the present.
    """

    t_s: NDArray[np.float64]
    sensor: NDArray[np.int64]
    slot: NDArray[np.int64]
    epoch: NDArray[np.int64]
    slots: int
    horizon_epochs: int

    @property
    def horizon_s(self) -> float:
        """How far the navigator lags behind the present [s]."""
        return self.horizon_epochs * EPOCH_S


def schedule_of(
    epochs: int, sensors: Onboard, timing: dict[Sensor, Timing], stated: dict[Sensor, Timing] | None = None
) -> Schedule:
    """The timetable of a flight of `epochs` epochs; `timing` of each sensor that is fitted.

    stated: what the navigator takes it for, where that is something else. The horizon has room for both.
    """
    stated = timing if stated is None else stated
    ages_s = (t.lag_s + t.latency_s for t in (*timing.values(), *stated.values()))
    horizon = max(1, math.ceil((max(ages_s) - SLACK_S) / EPOCH_S))
    t_s, sensor, sampled = sampled_readings(epochs, sensors, timing, stated)
    ready = np.ceil((t_s - SLACK_S) / EPOCH_S).astype(np.int64) + horizon
    by_epoch = np.searchsorted(sampled, np.arange(epochs), side="right")  # how many were read by the end of an epoch
    newest = by_epoch[np.clip(ready, 0, epochs - 1)]
    slots = int(np.max(newest - np.arange(len(t_s)))) + 1
    order = np.argsort(t_s, kind="stable")
    slot = np.arange(len(t_s)) % slots
    return Schedule(t_s[order], sensor[order], slot[order], ready[order], slots, horizon)


def sampled_readings(
    epochs: int, sensors: Onboard, timing: dict[Sensor, Timing], stated: dict[Sensor, Timing]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Every reading in the order of `sampling.sample`: the instant it is taken to describe, its sensor, its epoch.

    Each sensor's jitter is drawn for itself: a vehicle without another sensor has the same.
    """
    parts: list[tuple[NDArray[np.float64], int, NDArray[np.int64]]] = []
    for sensor, key, clock in clocks(sensors):
        due = np.arange(clock.first, epochs, clock.every, dtype=np.int64)
        drawn = np.random.Generator(np.random.Philox(key=[JITTER_KEY, key])).random(len(due))
        late_s = timing[sensor].jitter_s * (2.0 * drawn - 1.0)
        hidden_s = timing[sensor].latency_s - stated[sensor].latency_s
        t_s = np.asarray(due * EPOCH_S - stated[sensor].lag_s + late_s + hidden_s, np.float64)
        parts.append((t_s, int(sensor), due))
    every = np.arange(epochs, dtype=np.int64)
    for part in range(round(EPOCH_S / (sensors.inertial_steps * PHYSICS_PERIOD_S))):
        t_s = np.asarray(every * EPOCH_S + (part + 1) * sensors.inertial_steps * PHYSICS_PERIOD_S, np.float64)
        parts.append((t_s, int(Sensor.IMU), every))
    epoch = np.concatenate([due for _, _, due in parts])
    order = np.argsort(epoch, kind="stable")
    kinds = np.concatenate([np.full(len(due), kind) for _, kind, due in parts])
    return np.concatenate([t_s for t_s, _, _ in parts])[order], kinds[order], epoch[order]


def clocks(sensors: Onboard) -> list[tuple[Sensor, int, Clock]]:
    """Every reading of a fitted sensor but the inertial one, in the order in which `sampling.sample` takes them.

    Its kind, the key of its jitter, and its clock. What a sensor says at one time arrives together.
    """
    found, seen = [], Counter[Sensor]()
    for sensor in CARRIED:
        clock, first = getattr(sensors.carried, sensor.name).clock, sensor.says[0].kind
        key = int(first) + KEYS_A_KIND * seen[first]
        seen[first] += 1
        if sensor.on_epochs:
            found += [(said.kind, key, clock) for said in sensor.says[: clock.fitted]]
    return found
