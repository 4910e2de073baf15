"""What a log lacks and what is done instead, in one line each: the same words for every format."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from flownav.core.measurement import Sensor, Stream
from flownav.logs.log import Absence

INSTEAD = {
    Sensor.ATTITUDE: Absence(
        "no attitude", "it is found from the IMU: level by the accelerometer, heading counted from its start"
    ),
    Sensor.GPS_POSITION: Absence(
        "no GPS fix", "the path starts at the local origin and is dead reckoning on what is left; it drifts"
    ),
    Sensor.IMU: Absence("no inertial readings", "velocity is held between readings of the other sensors"),
    Sensor.BARO: Absence("no barometer", "height comes from the range, and from GPS where there is some"),
}


def absences_of(streams: Mapping[Sensor, Stream], **said: str) -> Iterator[Absence]:
    """What the streams lack. said: what the reader knows better, by name of the sensor, for `Absence.what`."""
    for sensor, absence in INSTEAD.items():
        if sensor not in streams:
            alone = sensor == Sensor.ATTITUDE and Sensor.IMU not in streams
            instead = "nothing finds it without an IMU: the log cannot be replayed" if alone else absence.instead
            yield Absence(said.get(sensor.name.lower(), absence.what), instead)
    flow = streams.get(Sensor.FLOW_RATE)
    if flow is None and Sensor.FLOW_VELOCITY not in streams:
        yield Absence(said.get("flow_rate", "no optical flow"), "nothing but GPS holds the horizontal velocity")
    if flow is not None and Sensor.RANGE not in streams:
        yield Absence(
            said.get("range", "no range"),
            "flow is fused on the height that the other sensors leave, which is uncertain",
        )
    if flow is not None and np.isnan(flow.value[:, 2:]).all():
        others = {Sensor.IMU: "the IMU", Sensor.ATTITUDE: "the turning of the attitude"}
        other = " or ".join(name for sensor, name in others.items() if sensor in streams)
        yield Absence("no gyro in the flow sensor", f"rotation is taken out of the flow with {other or 'nothing'}")
