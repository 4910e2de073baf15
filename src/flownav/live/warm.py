"""Kernels compiled and loaded before the first message comes."""

from __future__ import annotations

import numpy as np

from flownav.compile import announce_compilation
from flownav.live.estimating import estimate_of
from flownav.live.filtering import Filtering
from flownav.live.horizon import Waiting
from flownav.live.options import Options
from flownav.live.recorder import NoRecorder
from flownav.measurement import COLUMNS, Measurement, Sensor


def warm_up() -> None:
    """One reading of each kind through a navigator that nobody listens to."""
    filtering = Filtering(Options(), NoRecorder())
    readings = [
        Waiting(0.1 * step, step, Measurement(0.1 * step, sensor, (0.1,) * len(COLUMNS[sensor]), (np.nan,) * 6), 0.1)
        for step, sensor in enumerate([Sensor.ATTITUDE, Sensor.IMU, Sensor.IMU, *Sensor])
    ]
    with announce_compilation("live"):
        filtering.begin(readings, gps_heard=True)
        for reading in readings:
            filtering.heard(reading)
        filtering.feed(readings)
        assert filtering.running is not None
        estimate_of(filtering.running, filtering.imu_after(-1.0), 1.0, 1.0, 0)
