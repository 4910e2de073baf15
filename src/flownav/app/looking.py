"""A look at a log: the facts of `flownav info`, and its path as a thumbnail."""

from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.compile import announce_compilation
from flownav.core.errors import FlownavError
from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED
from flownav.logs.log import Log
from flownav.logs.open_log import open_log
from flownav.navigation.tables import estimate_table
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.scoring.path import columns_of
from flownav.studies.explain.autopilot_settings import dialect_of
from flownav.studies.inspection import summarise

POINTS = 160  # of a thumbnail
WRITTEN_BY = {".ulg": "px4", ".bin": "ardupilot"}  # formats of one autopilot, whose log may lack its parameters
WORDS = ("explained", "verdict", "causes", "warnings", "obstacles", "replayable", "start_s", "end_s", "notes")


def look_at(path: str) -> dict[str, Any]:
    """The facts of `flownav info` on a log, in short, and its path north and east [m], at most POINTS of it.

    InputError, one line, where the log cannot be read.
    """
    log = open_log(Path(path))
    with announce_compilation("inspection"):
        facts = summarise(log)
    way, of = _way(log)
    sensors = [stream["sensor"] for stream in facts["streams"]]
    has_gps = Sensor.GPS_POSITION in log.streams
    autopilot = dialect_of(log.parameters) or WRITTEN_BY.get(Path(path).suffix.lower(), "")
    return {name: facts[name] for name in WORDS} | {
        "sensors": sensors, "has_gps": has_gps, "fed": bool(log.fed), "autopilot": autopilot,
        "path": thinned(way, POINTS), "path_of": of,
    }  # fmt: skip


def _way(log: Log) -> tuple[Array, str]:
    """Positions (n, 3) of the best witness of the path, and its name; none where the log cannot be replayed either."""
    if log.truth is not None:
        return columns_of(log.truth, POSITION_NED), log.truth_name
    if Sensor.GPS_POSITION in log.streams:
        return log.streams[Sensor.GPS_POSITION].value[:, :3], "GPS"
    if log.autopilot is not None and set(POSITION_NED) <= log.autopilot.keys():
        return columns_of(log.autopilot, POSITION_NED), "the autopilot's estimate"
    try:
        flown = replay(log, *as_fed(log, ReplayOptions(), None))
    except FlownavError:
        return np.zeros((0, 3)), ""
    return columns_of(estimate_table(flown.estimate), POSITION_NED), "the estimate"


def thinned(way: Array, points: int) -> list[list[float]]:
    """At most this number of points of a path, north and east [m], those that are numbers, evenly in time."""
    known = way[np.isfinite(way[:, :2]).all(axis=1)]
    rows = np.linspace(0, max(len(known) - 1, 0), min(points, len(known))).round().astype(int)
    return [[round(float(n), 3), round(float(e), 3)] for n, e in known[rows, :2]]
