"""A log as a folder of CSV files, one a sensor: what `logs/csv_folder.py` reads (docs/reference/csv-folder.md)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from flownav.core.measurement import COLUMNS, Array, Sensor
from flownav.core.record import POSITION_NED
from flownav.export.samples.angles import angles_of
from flownav.export.samples.fixes import Fixes, fixes_of
from flownav.logs.log import Log

MILLIGAUSS = 1e3
FIX_3D = 3.0
Columns = dict[str, Array]


def write_csv_folder(log: Log, folder: Path) -> None:
    """Write a file for each sensor of a log into a folder that is there."""
    for name, columns in tables_of(log):
        formats = ["%.9f" if key in ("lat_deg", "lon_deg") else "%.6f" if key == "t_s" else "%.9g" for key in columns]
        line = ",".join(formats)
        rows = np.column_stack(list(columns.values())).tolist()
        text = "\n".join([",".join(columns), *(line % tuple(row) for row in rows)]) + "\n"
        (folder / f"{name}.csv").write_text(text, encoding="utf-8", newline="\n")


def tables_of(log: Log) -> Iterator[tuple[str, Columns]]:
    """Name and columns of each file; the attitude is the one that the vehicle's autopilot flew on."""
    if log.autopilot is not None:
        own = log.autopilot
        angles = zip(("roll_rad", "pitch_rad", "yaw_rad"), angles_of(own).T, strict=True)
        yield "attitude", {"t_s": own["t_s"], **dict(angles)}
    for name, sensor in (("imu", Sensor.IMU), ("flow", Sensor.FLOW_RATE), ("baro", Sensor.BARO)):
        if sensor in log.streams:
            stream = log.streams[sensor]
            columns = {"t_s": stream.t_s, **dict(zip(COLUMNS[sensor], stream.value.T, strict=True))}
            yield name, columns | ({"quality": stream.quality} if sensor == Sensor.FLOW_RATE else {})
    if Sensor.GPS_POSITION in log.streams:
        yield "gps", _gps(fixes_of(log))
    if Sensor.RANGE in log.streams:
        ranges = log.streams[Sensor.RANGE]
        yield "range", {"t_s": ranges.t_s, "range_m": ranges.value[:, 0], "valid": (ranges.quality > 0.0).astype(float)}
    if Sensor.MAG in log.streams:
        field = log.streams[Sensor.MAG]
        names = (f"mag_{axis}_mgauss" for axis in "xyz")
        yield "mag", {"t_s": field.t_s, **dict(zip(names, MILLIGAUSS * field.value.T, strict=True))}
    if Sensor.LANDED in log.streams:
        t_s, landed = changes(log)
        yield "landed", {"t_s": t_s, "landed": landed}
    if log.truth is not None:
        place = {f"{axis}_m": log.truth[name] for axis, name in zip("xyz", POSITION_NED, strict=True)}
        yield "truth", {"t_s": log.truth["t_s"], **place}
        yield "heading_truth", {"t_s": log.truth["t_s"], "yaw_rad": angles_of(log.truth)[:, 2]}


def changes(log: Log) -> tuple[Array, Array]:
    """Times at which a vehicle landed or took off, the first reading among them, and 1 on the ground, 0 in flight."""
    stream = log.streams[Sensor.LANDED]
    landed = (stream.value[:, 0] > 0.5).astype(float)
    new = np.flatnonzero(np.concatenate([[True], np.diff(landed) != 0.0]))
    return stream.t_s[new], landed[new]


def _gps(fixes: Fixes) -> Columns:
    velocity = dict(zip((f"vel_{axis}_m_s" for axis in "ned"), fixes.velocity_ned_m_s.T, strict=True))
    place = {"lat_deg": fixes.lat_deg, "lon_deg": fixes.lon_deg, "alt_m": fixes.alt_m}
    return {"t_s": fixes.t_s, "fix_type": np.full(len(fixes.t_s), FIX_3D), **place, **velocity}
