"""Synthetic flights of the tests as DataFlash logs, by the package's own writer, which knows nothing of the reader."""

from __future__ import annotations

import struct

import numpy as np

from flownav.export.samples.dataflash import HEAD as HEAD
from flownav.export.samples.dataflash import STRUCT
from flownav.export.samples.dataflash import DataFlashWriter as DataFlashWriter
from flownav.export.samples.dataflash import define_flight as define_flight
from replay_logs import ORIGIN, SyntheticLog


def dataflash_of(log: SyntheticLog, writer: DataFlashWriter | None = None, boot_s: float = 40.0) -> DataFlashWriter:
    """A synthetic flight as ArduPilot would have written it, in order of time; boot_s is when the log starts."""
    writer = writer or DataFlashWriter()
    define_flight(writer)
    writer.put("PARM", boot_s * 1e6, "RNGFND1_MIN_CM", 10.0)
    writer.put("PARM", boot_s * 1e6, "RNGFND1_MAX_CM", 4000.0)
    writer.put("ORGN", boot_s * 1e6, 0, *ORIGIN)
    rows = [(t, name, row) for name, table in log.tables.items() for t, *row in zip(*table.values(), strict=True)]
    for t, name, row in sorted(rows, key=lambda entry: entry[0]):
        MESSAGES[name](writer, round((t + boot_s) * 1e6), row)
    return writer


def blank(codes: str) -> bytes:
    """A message's body of zeros."""
    return bytes(struct.calcsize("<" + "".join(STRUCT[code] for code in codes)))


def _gps(writer: DataFlashWriter, time_us: int, row: list[float]) -> None:
    fix, latitude, longitude, altitude, north, east, down = row
    course = np.degrees(np.arctan2(east, north)) % 360.0
    writer.put("GPS", time_us, 0, fix, latitude, longitude, altitude, np.hypot(north, east), course, down, 1)
    writer.put("GPA", time_us, 0, 0.5, 0.8, 0.2, 1)


def _flow(writer: DataFlashWriter, time_us: int, row: list[float]) -> None:
    flow_x, flow_y, gyro_x, gyro_y, quality = row
    writer.put("OF", time_us, quality, flow_x, flow_y, gyro_x, gyro_y)


MESSAGES = {
    "attitude": lambda w, t, row: w.put("ATT", t, *np.degrees(row)),
    "imu": lambda w, t, row: w.put("IMU", t, 0, *row, 1, 1),
    "gps": _gps,
    "flow": _flow,
    "range": lambda w, t, row: w.put("RFND", t, 0, row[0], 4, 25),
    "baro": lambda w, t, row: w.put("BARO", t, 0, row[0]),
    "mag": lambda w, t, row: w.put("MAG", t, 0, *row, 1),
}
