"""Synthetic flights of the tests as DataFlash logs, by the package's own writer, which knows nothing of the reader."""

from __future__ import annotations

import struct

import numpy as np

from flownav.export.samples.dataflash import FMT, STRUCT, gps_time
from flownav.export.samples.dataflash import HEAD as HEAD
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
    speed = np.hypot(north, east)
    writer.put("GPS", time_us, 0, fix, *gps_time(time_us), latitude, longitude, altitude, speed, course, down, 1)
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


# -- as ArduCopter wrote in February 2015 (commit 3918413b of its history) --------------------------------------
OLD = {
    "ATT": ("IccccCCCC", "TimeMS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw"),
    "IMU": ("IffffffII", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,ErrG,ErrA"),
    "GPS": ("BIHBcLLeeEefI", "Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ,T"),
    "OF": ("IBffff", "TimeMS,Qual,flowX,flowY,bodyX,bodyY"),
    "BARO": ("Iffcf", "TimeMS,Alt,Press,Temp,CRt"),
    "MAG": ("Ihhhhhhhhh", "TimeMS,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,MOfsX,MOfsY,MOfsZ"),
    "RFND": ("ICC", "TimeMS,Dist1,Dist2"),
    "EKF1": ("IccCffffffccc", "TimeMS,Roll,Pitch,Yaw,VN,VE,VD,PN,PE,PD,GX,GY,GZ"),
    "EV": ("B", "Id"),
    "PARM": ("Nf", "Name,Value"),
}
WEEK_MS = 109_214_400  # a receiver's time of the week, which is not the vehicle's


def old_dataflash_of(log: SyntheticLog, boot_s: float = 40.0) -> DataFlashWriter:
    """The flight with milliseconds, a GPS that has its own time too, and events without any."""
    writer = DataFlashWriter(units=False)
    for name, (codes, labels) in OLD.items():
        writer.define(name, codes, labels)
    rows = [(t, name, row) for name, table in log.tables.items() for t, *row in zip(*table.values(), strict=True)]
    for t, name, row in sorted(rows, key=lambda entry: entry[0]):
        OLD_MESSAGES[name](writer, round((t + boot_s) * 1e3), row)
    return writer


def _old_gps(writer: DataFlashWriter, time_ms: int, row: list[float]) -> None:
    fix, latitude, longitude, altitude, north, east, down = row
    course = np.degrees(np.arctan2(east, north)) % 360.0
    writer.put("GPS", fix, WEEK_MS + time_ms, 1774, 9, 1.2, latitude, longitude, 0.0, altitude, np.hypot(north, east),
               course, down, time_ms)  # fmt: skip


def _old_attitude(writer: DataFlashWriter, time_ms: int, row: list[float]) -> None:
    roll, pitch, yaw = np.degrees(row)
    writer.put("ATT", time_ms, 0, roll, 0, pitch, 0, yaw % 360.0, 0, 0)


OLD_MESSAGES = {
    "attitude": _old_attitude,
    "imu": lambda w, t, row: w.put("IMU", t, *row, 0, 0),
    "gps": _old_gps,
    "flow": lambda w, t, row: w.put("OF", t, row[4], *row[:4]),
    "range": lambda w, t, row: w.put("RFND", t, row[0], 0),
    "baro": lambda w, t, row: w.put("BARO", t, row[0], 0, 0, 0),
    "mag": lambda w, t, row: w.put("MAG", t, *row, *(6 * [0])),
}


def as_text(content: bytes) -> str:
    """The lines that a ground station makes of a log: numbers in their unit, degrees, modes by name."""
    at, lines, types = 0, ["1", "", "ArduCopter V3.1 (5c6503e2)", "Free RAM: 1044", "APM 2"], {FMT: ("FMT", "BBnNZ")}
    while at < len(content):
        name, codes = types[content[at + 2]]
        layout = "<" + "".join(STRUCT[code] for code in codes)
        values = struct.unpack_from(layout, content, at + 3)
        at += 3 + struct.calcsize(layout)
        if name == "FMT":
            kind, _, *texts = values
            types[kind] = tuple(text.rstrip(b"\0").decode() for text in texts[:2])
        lines.append(", ".join([name, *map(_written, codes, values)]))
    return "\n".join(lines) + "\n"


def _written(code: str, value: object) -> str:
    if code in "nNZ":
        return value.rstrip(b"\0").decode()
    if code == "M":
        return {0: "STABILIZE", 5: "LOITER"}.get(value, str(value))
    if code == "L":
        return f"{value / 1e7:.7f}"
    return f"{value / 100:.2f}" if code in "cCeE" else f"{value:.9g}" if code in "fdg" else str(value)
