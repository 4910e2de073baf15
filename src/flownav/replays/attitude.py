"""The attitude that the navigator finds from a log's other sensors, for logs without one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array, Sensor, Stream
from flownav.logs.log import Log
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import FLOW, ReplayOptions, prepare
from flownav.replays.session import replay
from flownav.sensors.datasheet import IdentifiedFlow

FOUND = "the log has no attitude: it is the navigator's own, from IMU and flow, its heading counted from its start"


def with_attitude(log: Log, axes: Array | None = None) -> tuple[Log, str]:
    """The log with an attitude, and a note where that is the navigator's own estimate.

    axes (2, 2) of -1, 0, 1: how the flow sensor's lie, sensor = axes @ vehicle, where they are known to lie otherwise.
    InputError where the log has neither an attitude nor what a replay needs to find one.
    """
    if Sensor.ATTITUDE in log.streams:
        return log, ""
    if Sensor.IMU not in log.streams:
        raise InputError(
            f"{log.path}: neither attitude nor IMU; one of them turns the reference into the sensor's axes"
        )
    options = ReplayOptions() if axes is None else ReplayOptions(identified=turned_sensor(log, axes))
    found = replay(log, options, NavigatorSettingsFile()).said
    known = np.isfinite(found.quaternion).all(axis=1)
    attitude = Stream.of(Sensor.ATTITUDE, found.t_s[known], found.quaternion[known])
    return replace(log, streams={**log.streams, Sensor.ATTITUDE: attitude}), FOUND


def turned_sensor(log: Log, axes: Array) -> IdentifiedFlow:
    """A sensor of gain 1 whose axes lie so, and whose readings are as old as the log makes them."""
    delays_s = prepare(log, ReplayOptions()).delays_s
    first, second = ((float(row[0]), float(row[1])) for row in axes)
    return IdentifiedFlow(1.0, 1.0, max(delays_s.get(sensor, 0.0) for sensor in FLOW), (first, second))
