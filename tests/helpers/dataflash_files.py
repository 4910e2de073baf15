"""A small DataFlash writer and synthetic flights in that format; written apart from the reader on purpose."""

from __future__ import annotations

import struct

import numpy as np

from replay_logs import ORIGIN, SyntheticLog

STRUCT = {
    "a": "32h", "b": "b", "B": "B", "g": "e", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d", "q": "q",
    "Q": "Q", "n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B",
}  # fmt: skip
FACTOR = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 10**7}
UNITS = {"-": "", "?": "UNKNOWN", "s": "s", "#": "instance", "m": "m", "G": "Gauss", "E": "rad/s"}
MULTIPLIERS = {"-": 0.0, "?": 1.0, "0": 1.0, "C": 1e-3, "F": 1e-6, "B": 1e-2}
HEAD = b"\xa3\x95"


class DataFlashWriter:
    """Messages as bytes, in the order they are put. `units=False` leaves out UNIT, MULT and FMTU, as old logs do."""

    def __init__(self, units: bool = True) -> None:
        self.parts: list[bytes] = []
        self.types = {"FMT": (128, "BBnNZ")}
        self.units = units
        self._fmt("FMT", 128, "BBnNZ", "Type,Length,Name,Format,Columns")
        if units:
            self._fmt("UNIT", 129, "QbZ", "TimeUS,Id,Label")
            self._fmt("MULT", 130, "Qbd", "TimeUS,Id,Mult")
            self._fmt("FMTU", 131, "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
            for key, label in UNITS.items():
                self.put("UNIT", 0, ord(key), label)
            for key, factor in MULTIPLIERS.items():
                self.put("MULT", 0, ord(key), float(np.float32(factor)))

    def _fmt(self, name: str, kind: int, codes: str, labels: str) -> None:
        self.types[name] = (kind, codes)
        length = 3 + struct.calcsize("<" + "".join(STRUCT[c] for c in codes))
        self.put("FMT", kind, length, name, codes, labels)

    def define(self, name: str, codes: str, labels: str, units: str = "", multipliers: str = "") -> None:
        kind = 132 + len(self.types)
        self._fmt(name, kind, codes, labels)
        if self.units and units:
            self.put("FMTU", 0, kind, units, multipliers or "-" * len(units))

    def put(self, name: str, *values: object) -> int:
        """Append a message; numbers of the characters with a factor are given in their unit. Returns its offset."""
        kind, codes = self.types[name]
        at = sum(map(len, self.parts))
        self.parts.append(
            HEAD + bytes([kind]) + b"".join(_packed(code, value) for code, value in zip(codes, values, strict=True))
        )
        return at

    @staticmethod
    def blank(codes: str) -> bytes:
        """A body of zeros."""
        return bytes(struct.calcsize("<" + "".join(STRUCT[c] for c in codes)))

    def content(self) -> bytes:
        return b"".join(self.parts)


def _packed(code: str, value: object) -> bytes:
    if code in "nNZ":
        return struct.pack("<" + STRUCT[code], value if isinstance(value, bytes) else str(value).encode())
    if code == "a":
        return struct.pack("<32h", *value)  # type: ignore[misc]
    if code in FACTOR:
        value = round(float(value) * FACTOR[code])  # type: ignore[arg-type]
    return struct.pack("<" + STRUCT[code], value if code in "fdg" else int(value))  # type: ignore[call-overload]


def define_flight(writer: DataFlashWriter) -> None:
    """The messages that a flight's log has, as ArduCopter 4.6 writes them."""
    writer.define("ATT", "Qccc", "TimeUS,Roll,Pitch,Yaw", "s---", "F---")
    writer.define("IMU", "QBffffffBB", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,GH,AH", "s#EEE-----", "F-000-----")
    writer.define("GPS", "QBBLLefffB", "TimeUS,I,Status,Lat,Lng,Alt,Spd,GCrs,VZ,U", "s#--------", "F---------")
    writer.define("GPA", "QBCCCB", "TimeUS,I,HAcc,VAcc,SAcc,VV", "s#----", "F-----")
    writer.define("OF", "QBffff", "TimeUS,Qual,flowX,flowY,bodyX,bodyY", "s-EEEE", "F-0000")
    writer.define("RFND", "QBCBB", "TimeUS,Instance,Dist,Stat,Orient", "s#m--", "FB---")
    writer.define("BARO", "QBf", "TimeUS,I,Alt", "s#m", "F-0")
    writer.define("MAG", "QBhhhB", "TimeUS,I,MagX,MagY,MagZ,Health", "s#GGG-", "F-CCC-")
    writer.define("EV", "QB", "TimeUS,Id", "s-", "F-")
    writer.define("PARM", "QNf", "TimeUS,Name,Value", "s--", "F--")
    writer.define("ORGN", "QBLLe", "TimeUS,Type,Lat,Lng,Alt", "s#---", "F----")


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
