"""The attitude that the navigator finds from a log's other sensors, for logs without one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flownav.errors import InputError
from flownav.logs.log import Log
from flownav.measurement import Sensor, Stream
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replay.prepare import ReplayOptions
from flownav.replay.session import replay

FOUND = "the log has no attitude: it is the navigator's own, from IMU and flow, its heading counted from its start"


def with_attitude(log: Log) -> tuple[Log, str]:
    """The log with an attitude, and a note where that is the navigator's own estimate.

    InputError where the log has neither an attitude nor what a replay needs to find one.
    """
    if Sensor.ATTITUDE in log.streams:
        return log, ""
    if Sensor.IMU not in log.streams:
        raise InputError(f"{log.path}: neither attitude nor IMU; one of them turns the reference into the sensor's axes")
    found = replay(log, ReplayOptions(), NavigatorSettingsFile()).estimate
    known = np.isfinite(found[:, 7:11]).all(axis=1)
    attitude = Stream.of(Sensor.ATTITUDE, found[known, 0], found[known, 7:11])
    return replace(log, streams={**log.streams, Sensor.ATTITUDE: attitude}), FOUND
