"""What the autopilot itself estimated, beside a replay: its path in our frame and its errors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import Table
from flownav.logs.log import Log
from flownav.replays.prepare import GPS
from flownav.scoring.path import autopilot_errors, in_frame_of


def autopilot_path(log: Log, gps_delay_s: float, t_s: Array, position: Array) -> Table | None:
    """The autopilot's estimate in the frame of ours, t_s (n,) and position (n, 3); None where there is none.

    Columns as record.TABLES["autopilot"].
    """
    return None if log.autopilot is None else in_frame_of(t_s, position, log.autopilot, _gps(log, gps_delay_s))


def autopilot_scores(log: Log, gps_delay_s: float) -> dict[str, Any] | None:
    """Name of the autopilot's estimator and the errors of its estimate (scoring/autopilot); None without one."""
    if log.autopilot is None:
        return None
    return {"name": log.autopilot_name, **autopilot_errors(log.autopilot, log.truth, _gps(log, gps_delay_s))}


def _gps(log: Log, delay_s: float) -> dict[Sensor, Stream]:
    """GPS as the log has it, withheld or not, with its delay."""
    return {sensor: replace(log.streams[sensor], delay_s=delay_s) for sensor in GPS if sensor in log.streams}
