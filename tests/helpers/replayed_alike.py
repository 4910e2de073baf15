"""The same made flight from two files: how far apart their replays lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flownav.core.measurement import Sensor
from flownav.core.record import POSITION_NED, VELOCITY_BODY
from flownav.logs.log import Log
from flownav.logs.open_log import open_flight
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.bundle import to_record
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay

START_S = 1.0


def estimate_of(log: Log) -> dict[str, np.ndarray]:
    """The table of the navigator's estimate, with standard settings."""
    flown = replay(log, ReplayOptions(), NavigatorSettingsFile())
    return to_record(flown, {"duration_s": 0.0}, []).tables["estimate"]


def apart(one: Path, other: Path, other_later_s: float = 0.0) -> tuple[float, float]:
    """Largest distance [m] and largest difference of velocity [m/s] of two logs' estimates at the same instants.

    other_later_s: how much the times of the second log are larger than those of the first. The first second is left
    out: which of two readings of one instant comes first is rounding there, and moves the start.
    """
    first, second = estimate_of(open_flight(one)), estimate_of(open_flight(other))
    at_s = first["t_s"][(first["t_s"] >= first["t_s"][0] + START_S) & (first["t_s"] >= second["t_s"][0] - other_later_s)
                        & (first["t_s"] <= second["t_s"][-1] - other_later_s)]  # fmt: skip
    assert len(at_s) > 0.9 * len(first["t_s"])

    def difference(names: tuple[str, ...]) -> float:
        columns = [
            np.interp(at_s + other_later_s, second["t_s"], second[name]) - np.interp(at_s, first["t_s"], first[name])
            for name in names
        ]
        return float(np.linalg.norm(columns, axis=0).max())

    return difference(POSITION_NED), difference(VELOCITY_BODY)


def largest_difference(one: Log, other: Log, sensor: Sensor) -> float:
    """Between the readings of one sensor in two logs, row by row; of attitudes the angle [rad]."""
    first, second = one.streams[sensor], other.streams[sensor]
    assert len(first) == len(second)
    if sensor == Sensor.ATTITUDE:
        cosine = np.abs(np.sum(first.value * second.value, axis=1))
        return float(2.0 * np.arccos(np.clip(cosine, 0.0, 1.0)).max())
    return float(np.nanmax(np.abs(first.value - second.value)))
