"""Kernels compiled and loaded before the first message comes."""

from __future__ import annotations

import gc

import numpy as np

from flownav.core.compile import announce_compilation
from flownav.core.measurement import COLUMNS, Measurement, Sensor
from flownav.live.estimating import estimate_of
from flownav.live.filtering import Filtering
from flownav.live.horizon import Waiting
from flownav.live.options import Options
from flownav.live.recorder import NoRecorder
from flownav.mavlink.dialect import coder
from flownav.mavlink.outgoing import odometry
from flownav.mavlink.position_messages import local_position_m


def warm_up() -> None:
    """One reading of each kind through a navigator that nobody listens to, and one message there and back.

    A second of loading while a vehicle talks would overflow the socket's buffer.
    """
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
        estimate = estimate_of(filtering.running, filtering.imu_after(-1.0), 1.0, 1.0, 0)
    local_position_m((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    mav = coder()
    mav.decode(bytearray(odometry(mav, estimate).pack(mav)))
    gc.collect()
    gc.freeze()  # what is loaded by now stays; the collector need not look at it again
