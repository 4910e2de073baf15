"""Recorded flights without GPS, each beside dead reckoning by the raw gyro: drift, heading, and what is stated."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream
from flownav.logs.log import Log
from flownav.logs.open_log import open_flight
from flownav.navigation.flags import flagged, flags_of
from flownav.replays.fed import as_fed
from flownav.replays.judged import airborne_of
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.scoring.path import motion_of, truth_motion
from flownav.scoring.reference import drift_of, unwarned_share
from made.flight import Table
from made.judging import Line, line_of
from made.reckoning import reckoned

NEEDED = (Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE)
HEADINGS = (
    "flight", "flownav: end drift [m]", "most", "heading [deg]", "dead reckoning: end drift [m]", "most",
    "raw gyro: heading [deg]", "level, median [m]", "beyond it without a warning [% of flight]",
)  # fmt: skip


class Row(NamedTuple):
    """One flight. level_m: protection level, median in flight; unwarned: share of the flight in which the error is
    beyond it without a warning.
    """

    name: str
    ours: Line
    line: Line
    level_m: float
    unwarned: float


def tables_of(log: Log) -> dict[str, Table]:
    """The columns that dead reckoning reads, of a log's streams."""
    imu, flow, ranges = (log.streams[sensor] for sensor in NEEDED)
    names = ("gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s", "accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2")
    return {
        "imu": {"t_s": imu.t_s, **dict(zip(names, imu.value.T, strict=False))},
        "flow": {
            "t_s": _instants(flow), "flow_x_rad_s": flow.value[:, 0], "flow_y_rad_s": flow.value[:, 1],
            "quality": np.asarray(flow.quality, float),
        },
        "range": {
            "t_s": _instants(ranges), "range_m": ranges.value[:, 0],
            "valid": (ranges.quality > 0) & np.isfinite(ranges.value[:, 0]),
        },
    }  # fmt: skip


def _instants(stream: Stream) -> np.ndarray:
    return np.asarray(stream.t_s - stream.delay_s)


def is_gps_free(log: Log) -> bool:
    """Whether it has what dead reckoning needs, a truth with headings, and no GPS."""
    headed = log.heading_truth is not None or (log.truth is not None and "q_w" in log.truth)
    return (
        log.truth is not None and headed and Sensor.GPS_POSITION not in log.streams and set(NEEDED) <= set(log.streams)
    )


def row_of(name: str, log: Log) -> Row | None:
    """Replay by the defaults, and hold both against the truth from take-off to landing; None where that does not go."""
    flight = airborne_of(log) if is_gps_free(log) else None
    if flight is None or log.truth is None:
        return None
    truth = truth_motion(log.truth, log.heading_truth)
    options, settings = as_fed(log, ReplayOptions(), None)
    flown = replay(log, options, settings)
    estimate = motion_of(flown.table)
    drift = drift_of(estimate, truth, flight)
    if drift is None:
        return None
    stated, level = flown.estimate_rows, flown.estimate_rows.protection_m[:, 0]
    inside = (stated.t_s >= flight[0]) & (stated.t_s <= flight[1])
    warned = flagged(stated.t_s, flags_of(flown.written.event))
    unwarned = unwarned_share(stated.t_s, level, warned, drift)
    ours, line = (line_of(path, truth, flight) for path in (estimate, reckoned(tables_of(log))))
    return Row(name, ours, line, float(np.median(level[inside])), float(unwarned))


def rows_of(names: Sequence[str], paths: Sequence[Path]) -> list[Row]:
    """The rows of all logs that are such flights."""
    rows = []
    for name, path in zip(names, paths, strict=True):
        try:
            found = row_of(name, open_flight(path))
        except InputError:
            continue  # the league says why
        if found is not None:
            rows.append(found)
    return rows


def markdown(rows: Sequence[Row]) -> str:
    """The table, and its medians and worst."""
    lines = [HEADINGS, ("---", *["---:"] * (len(HEADINGS) - 1))]
    lines += [(row.name, *_figures(*row.ours, *row.line, row.level_m, 100.0 * row.unwarned)) for row in rows]
    if rows:
        figures = np.array([[*row.ours, *row.line, row.level_m, 100.0 * row.unwarned] for row in rows])
        lines += [("**median**", *_figures(*np.median(figures, axis=0)))]
        lines += [("**worst**", *_figures(*figures.max(axis=0)))]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _figures(*values: float) -> tuple[str, ...]:
    end, most, heading, end_line, most_line, gyro, level, unwarned = values
    return (
        f"{end:.2f}", f"{most:.2f}", f"{heading:.1f}", f"{end_line:.2f}", f"{most_line:.2f}", f"{gyro:.1f}",
        f"{level:.1f}", f"{unwarned:.1f}",
    )  # fmt: skip
