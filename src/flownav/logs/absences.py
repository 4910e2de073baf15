"""What a log lacks and what is done instead, in one line each: the same words for every format."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from flownav.logs.log import Absence
from flownav.measurement import Sensor, Stream

INSTEAD = {
    Sensor.ATTITUDE: Absence("no attitude", "the log cannot be replayed: every other sensor is turned by it"),
    Sensor.GPS_POSITION: Absence(
        "no GPS fix", "the path starts at the local origin and is dead reckoning on what is left; it drifts"
    ),
    Sensor.IMU: Absence("no inertial readings", "velocity is held between readings of the other sensors"),
    Sensor.BARO: Absence("no barometer", "height comes from GPS and range"),
}


def absences_of(streams: Mapping[Sensor, Stream], **said: str) -> Iterator[Absence]:
    """What the streams lack. said: what the reader knows better, by name of the sensor, for `Absence.what`."""
    for sensor, absence in INSTEAD.items():
        if sensor not in streams:
            yield absence._replace(what=said.get(sensor.name.lower(), absence.what))
    flow = streams.get(Sensor.FLOW_RATE)
    if flow is None and Sensor.FLOW_VELOCITY not in streams:
        yield Absence(said.get("flow_rate", "no optical flow"), "nothing but GPS holds the horizontal velocity")
    if flow is not None and Sensor.RANGE not in streams:
        yield Absence(said.get("range", "no range"), "flow is an angular rate and is not fused without a height")
    if flow is not None and np.isnan(flow.value[:, 2:]).all():
        other = "the IMU or the turning of the attitude" if Sensor.IMU in streams else "the turning of the attitude"
        yield Absence("no gyro in the flow sensor", f"rotation is taken out of the flow with {other}")
