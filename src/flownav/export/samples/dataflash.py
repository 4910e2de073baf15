"""A log as ArduPilot would have written it: DataFlash messages, in order of time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED, QUATERNION, Table
from flownav.export.samples.angles import angles_of, velocities_ned
from flownav.export.samples.csv_folder import changes
from flownav.export.samples.dataflash_file import DataFlashWriter, define_flight, define_simulated
from flownav.export.samples.fixes import fixes_of
from flownav.logs.log import Log

BOOT_S = 20.0  # the vehicle's time since boot when the log's time 0 is
GOOD, DOWNWARD, FIX_3D = 4, 25, 3
LANDED, FLYING = 18, 28  # LogEvent
MILLIGAUSS = 1e3
SIMULATED_EVERY = 2  # rows of the truth


class Row(NamedTuple):
    """A message of the log: time of the flight [s], name, values after TimeUS."""

    t_s: float
    name: str
    values: tuple[object, ...]


def write_dataflash(log: Log, path: Path) -> None:
    """Write a log as a DataFlash file (.bin)."""
    writer = DataFlashWriter()
    define_flight(writer)
    define_simulated(writer)
    least_m, most_m = log.limits["range_m"]
    assert log.origin_deg_m is not None
    for name, value in (("RNGFND1_MIN_CM", 100.0 * least_m), ("RNGFND1_MAX_CM", 100.0 * most_m)):
        writer.put("PARM", round(BOOT_S * 1e6), name, value)
    writer.put("ORGN", round(BOOT_S * 1e6), 0, *log.origin_deg_m)
    for t_s, name, values in sorted(_rows(log), key=lambda row: row.t_s):
        writer.put(name, round((BOOT_S + t_s) * 1e6), *values)
    path.write_bytes(writer.content())


def _rows(log: Log) -> Iterator[Row]:
    """Every message, sensor by sensor."""
    streams = log.streams
    for t_s, value in _of(log, Sensor.IMU):
        yield Row(t_s, "IMU", (0, *value, 1, 1))
    flow = streams[Sensor.FLOW_RATE]
    for (t_s, value), quality in zip(_of(log, Sensor.FLOW_RATE), np.rint(flow.quality).tolist(), strict=True):
        yield Row(t_s, "OF", (quality, *value))
    ranges = streams[Sensor.RANGE]
    for (t_s, (distance,)), quality in zip(_of(log, Sensor.RANGE), ranges.quality.tolist(), strict=True):
        yield Row(t_s, "RFND", (0, distance, GOOD if quality > 0.0 else 0, DOWNWARD))
    for t_s, (altitude,) in _of(log, Sensor.BARO):
        yield Row(t_s, "BARO", (0, altitude))
    for t_s, field in _of(log, Sensor.MAG):
        yield Row(t_s, "MAG", (0, *(round(MILLIGAUSS * part) for part in field), 1))
    yield from _fixes(log)
    for t_s, landed in zip(*(column.tolist() for column in changes(log)), strict=True):
        yield Row(t_s, "EV", (LANDED if landed else FLYING,))
    if log.autopilot is not None:
        for t_s, angles in zip(
            log.autopilot["t_s"].tolist(), np.degrees(angles_of(log.autopilot)).tolist(), strict=True
        ):
            yield Row(t_s, "ATT", tuple(angles))
    if log.truth is not None:
        yield from _simulated({name: column[::SIMULATED_EVERY] for name, column in log.truth.items()}, log)


def _of(log: Log, sensor: Sensor) -> Iterator[tuple[float, list[float]]]:
    stream = log.streams[sensor]
    return zip(stream.t_s.tolist(), stream.value.tolist(), strict=True)


def _fixes(log: Log) -> Iterator[Row]:
    """GPS, and GPA with its accuracies at the same time."""
    fixes = fixes_of(log)
    north, east, down = fixes.velocity_ned_m_s.T
    course = np.degrees(np.arctan2(east, north)) % 360.0
    columns = (fixes.t_s, fixes.lat_deg, fixes.lon_deg, fixes.alt_m, np.hypot(north, east), course, down)
    sigmas = np.column_stack([fixes.sigma_m, fixes.sigma_m_s]).tolist()
    for (t_s, *values), stated in zip(np.column_stack(columns).tolist(), sigmas, strict=True):
        yield Row(t_s, "GPS", (0, FIX_3D, *values, 1))
        yield Row(t_s, "GPA", (0, *stated, 1))


def _simulated(truth: Table, log: Log) -> Iterator[Row]:
    """SIM and SIM2: the truth in degrees and in metres of the local frame."""
    import pymap3d

    assert log.origin_deg_m is not None
    place = np.column_stack([truth[name] for name in POSITION_NED])
    quaternion = np.column_stack([truth[name] for name in QUATERNION])
    latitude, longitude, altitude = pymap3d.ned2geodetic(*place.T, *log.origin_deg_m)
    geodetic = np.column_stack([altitude, latitude, longitude])
    state = (truth["t_s"], _angles_deg(truth), geodetic, quaternion, place, velocities_ned(truth))
    for t_s, *values in np.column_stack(state).tolist():
        yield Row(t_s, "SIM", tuple(values[:10]))
        yield Row(t_s, "SIM2", tuple(values[10:]))


def _angles_deg(table: Table) -> Array:
    """Roll, pitch, and yaw from 0 to 360 [deg], (n, 3)."""
    angles = np.degrees(angles_of(table))
    angles[:, 2] %= 360.0
    return np.asarray(angles)
