"""Inertial readings without their spikes, beside the filter: for the flow's turning, and for the carrying to now."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import ONE_LANE, kernel, pointer
from flownav.core.measurement import Array
from flownav.navigation.memory import load_imu, load_spike, new_work, store_imu, store_spike
from flownav.navigation.records import Reading
from flownav.navigation.spikes import judge_spike
from flownav.navigation.vibration import with_reading


class Witness:
    """The filter's judge of spikes on a memory of its own, from reading to reading."""

    def __init__(self) -> None:
        self._work = new_work(ONE_LANE)

    def keeps(self, imu: Array) -> NDArray[np.bool_]:
        """Which inertial readings are no spikes, (n,); imu (n, 7): time [s], gyro [rad/s], specific force [m/s2]."""
        kept = np.ones(len(imu), np.bool_)
        mark_spikes(self._work, imu, kept)
        return kept


@kernel
def mark_spikes(work: Array, imu: Array, kept: NDArray[np.bool_]) -> None:
    """False in `kept` where a reading is a spike after those before it; the first is none."""
    rows, lanes, unstated = pointer(work), ONE_LANE, np.nan
    for k in range(len(imu)):
        reading = Reading(
            imu[k, 1], imu[k, 2], imu[k, 3], imu[k, 4], imu[k, 5], imu[k, 6],
            unstated, unstated, unstated, 255.0, 1.0, 0.0,
        )  # fmt: skip
        m = load_imu(rows, lanes, 0)
        if np.isfinite(m.read_s):
            spike, after = judge_spike(reading, imu[k, 0] - m.read_s, m, load_spike(rows, lanes, 0))
            store_spike(rows, lanes, 0, after)
            kept[k] = not spike
        if kept[k]:
            store_imu(rows, lanes, 0, with_reading(reading, imu[k, 0], m))
