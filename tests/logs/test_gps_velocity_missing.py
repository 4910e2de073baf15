"""A log whose receiver states no velocity: it is among what is missing, and only there."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.logs.log import absences_of

T_S = np.arange(0.0, 10.0, 0.2)


def stream(sensor: Sensor) -> Stream:
    return Stream.of(sensor, T_S, np.zeros((len(T_S), 3)))


@pytest.mark.parametrize(
    ("sensors", "is_missing"),
    [
        ((Sensor.GPS_POSITION,), True),
        ((Sensor.GPS_POSITION, Sensor.GPS_VELOCITY), False),
        ((Sensor.GPS_VELOCITY,), False),
        ((), False),  # no GPS at all is another line
    ],
)
def test_a_velocity_is_missing_beside_a_position_only(sensors, is_missing):
    found = {absence.what: absence.instead for absence in absences_of({sensor: stream(sensor) for sensor in sensors})}
    assert ("no GPS velocity" in found) == is_missing
    if is_missing:
        assert "how the GPS position moves" in found["no GPS velocity"]
        assert "no GPS fix" not in found
