"""A log as a ground station's MAVLink log: what the simulated vehicle of `live` tells, a time before each frame."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from flownav.live.simulated import SimulatedVehicle
from flownav.logs.log import Log

START_US = 1_767_225_600_000_000  # 2026-01-01: of the ground station's clock, which no flight was flown by
STEP_S = 0.002
LINK_S = 0.004  # from the vehicle to the ground station


def write_tlog(log: Log, path: Path) -> None:
    """Write a log as a .tlog. InputError where pymavlink is not installed."""
    vehicle, parts = SimulatedVehicle(log), []
    for t_s in np.arange(0.0, vehicle.end_s + STEP_S, STEP_S).tolist():
        stamp = struct.pack(">Q", START_US + round((t_s + LINK_S) * 1e6))
        parts += [stamp + frame for frame in vehicle.due(t_s, 0.0)]
    path.write_bytes(b"".join(parts))
