"""How fast real receivers' positions walk off from their own velocities: what a slow spoofer can hide behind.

Over windows of several lengths: by how much the way of GPS position differs from the integral of GPS velocity,
horizontally, a second. python tools/gps_slope.py FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from flownav.core.errors import FlownavError, InputError
from flownav.core.measurement import Array, Sensor
from flownav.logs.log import Log
from flownav.logs.open_log import open_log
from flownav.studies.compare.job import logs_in

WINDOWS_S = (5.0, 10.0, 20.0, 40.0)
LONGEST_GAP_S = 1.0  # a window over a longer one says nothing


def slopes(log: Log, window_s: float) -> Array:
    """Of each window that begins with a fix and has no gap (n,) [m/s]."""
    position, velocity = log.streams[Sensor.GPS_POSITION], log.streams[Sensor.GPS_VELOCITY]
    t_s = position.t_s
    steps = np.diff(velocity.t_s)[:, None]
    way = np.vstack([np.zeros((1, 2)), np.cumsum(0.5 * steps * (velocity.value[1:, :2] + velocity.value[:-1, :2]), 0)])
    walked = np.column_stack([np.interp(t_s, velocity.t_s, way[:, axis]) for axis in range(2)])
    apart = position.value[:, :2] - walked
    ends = np.searchsorted(t_s, t_s + window_s)
    gaps = np.concatenate([[0], np.cumsum(np.diff(t_s) > LONGEST_GAP_S)])
    begins = np.flatnonzero((ends < len(t_s)) & (gaps[np.minimum(ends, len(t_s) - 1)] == gaps))
    return np.hypot(*(apart[ends[begins]] - apart[begins]).T) / window_s


def table(folder: Path) -> str:
    """A row a log and window as Markdown. InputError where no log has both of GPS."""
    lines = ["| log | window [s] | windows | median [m/s] | 95 % | most |\n", "|---|---:|---:|---:|---:|---:|\n"]
    for path in logs_in(folder):
        try:
            log = open_log(path)
        except InputError:
            continue
        if not {Sensor.GPS_POSITION, Sensor.GPS_VELOCITY} <= set(log.streams):
            continue
        for window_s in WINDOWS_S:
            found = slopes(log, window_s)
            if len(found):
                told = " | ".join(f"{value:.2f}" for value in (*np.percentile(found, [50, 95]), found.max()))
                lines.append(f"| `{path.relative_to(folder)}` | {window_s:g} | {len(found)} | {told} |\n")
    if len(lines) == 2:
        raise InputError(f"{folder}: no log has GPS position and velocity")
    return "".join(lines)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python tools/gps_slope.py FOLDER")
    try:
        print(table(Path(sys.argv[1])), end="")
    except (FlownavError, OSError) as error:
        sys.exit(f"flownav: {error}")
