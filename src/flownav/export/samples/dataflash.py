"""A log as ArduPilot would have written it: DataFlash messages that describe themselves, in order of time.

The format is written apart from the reader (`logs/dataflash/`), so that neither can hide what the other gets wrong.
Source: ArduPilot, libraries/AP_Logger/LogStructure.h.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED, QUATERNION, Table
from flownav.export.samples.flight import angles_of, changes, fixes_of, velocities_ned
from flownav.logs.happened import MESSAGE, SOURCE_SET
from flownav.logs.log import Log

STRUCT = {
    "a": "32h", "b": "b", "B": "B", "g": "e", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d", "q": "q",
    "Q": "Q", "n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B",
}  # fmt: skip
FACTOR = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 10**7}
UNITS = {"-": "", "?": "UNKNOWN", "s": "s", "#": "instance", "m": "m", "G": "Gauss", "E": "rad/s"}
MULTIPLIERS = {"-": 0.0, "?": 1.0, "0": 1.0, "C": 1e-3, "F": 1e-6, "B": 1e-2}
HEAD = b"\xa3\x95"
FMT, FIRST_OWN = 128, 132  # types of messages: FMT's, and of those that a log defines itself
BOOT_S = 20.0  # the vehicle's time since boot when the log's time 0 is
GOOD, DOWNWARD, FIX_3D = 4, 25, 3
LANDED, FLYING, FIRST_SET = 18, 28, 84  # LogEvent; the source sets 1 to 3 follow the last
MILLIGAUSS_PER_GAUSS = 1e3
SIMULATED_EVERY = 2  # rows of the truth
# invented: GPS time when the vehicle was switched on (4 January 2026); readers date every message of a log by it
GPS_WEEK, BOOT_MS, WEEK_MS = 2400, 36_000_000, 604_800_000


class DataFlashWriter:
    """Messages as bytes, in the order they are put. `units=False` leaves out UNIT, MULT and FMTU, as old logs do."""

    def __init__(self, units: bool = True) -> None:
        self.parts: list[bytes] = []
        self.types = {"FMT": (FMT, "BBnNZ")}
        self.units = units
        self._size = 0
        self._fmt("FMT", FMT, "BBnNZ", "Type,Length,Name,Format,Columns")
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
        """A message of the log's own: a format character, a unit and a multiplier each field."""
        kind = FIRST_OWN + len(self.types)
        self._fmt(name, kind, codes, labels)
        if self.units and units:
            self.put("FMTU", 0, kind, units, multipliers or "-" * len(units))

    def put(self, name: str, *values: object) -> int:
        """Append a message; numbers of the characters with a factor are given in their unit. Returns its offset."""
        kind, codes = self.types[name]
        at = self._size
        body = b"".join(_packed(code, value) for code, value in zip(codes, values, strict=True))
        self.parts.append(HEAD + bytes([kind]) + body)
        self._size += len(self.parts[-1])
        return at

    def content(self) -> bytes:
        """The whole log."""
        return b"".join(self.parts)


def define_flight(writer: DataFlashWriter) -> None:
    """The messages that a flight's log has, as ArduCopter 4.6 writes them."""
    writer.define("ATT", "Qccc", "TimeUS,Roll,Pitch,Yaw", "s---", "F---")
    writer.define("IMU", "QBffffffBB", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,GH,AH", "s#EEE-----", "F-000-----")
    labels = "TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt,Spd,GCrs,VZ,U"
    writer.define("GPS", "QBBIHLLefffB", labels, "s#----------", "F-----------")
    writer.define("GPA", "QBCCCB", "TimeUS,I,HAcc,VAcc,SAcc,VV", "s#----", "F-----")
    writer.define("OF", "QBffff", "TimeUS,Qual,flowX,flowY,bodyX,bodyY", "s-EEEE", "F-0000")
    writer.define("RFND", "QBCBB", "TimeUS,Instance,Dist,Stat,Orient", "s#m--", "FB---")
    writer.define("BARO", "QBf", "TimeUS,I,Alt", "s#m", "F-0")
    writer.define("MAG", "QBhhhB", "TimeUS,I,MagX,MagY,MagZ,Health", "s#GGG-", "F-CCC-")
    writer.define("EV", "QB", "TimeUS,Id", "s-", "F-")
    writer.define("PARM", "QNf", "TimeUS,Name,Value", "s--", "F--")
    writer.define("ORGN", "QBLLe", "TimeUS,Type,Lat,Lng,Alt", "s#---", "F----")
    labels = "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"
    writer.define("XKF1", "QBccCfffffffccce", labels, "s#--------------", "F---------------")
    writer.define("MSG", "QZ", "TimeUS,Message", "s-", "F-")


def define_simulated(writer: DataFlashWriter) -> None:
    """The truth of a simulated flight, as ArduPilot's simulator writes it."""
    writer.define("SIM", "QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4", "s----------", "F----------")
    writer.define("SIM2", "Qdddfff", "TimeUS,PN,PE,PD,VN,VE,VD", "s------", "F------")


def gps_time(time_us: float) -> tuple[int, int]:
    """A receiver's time of week [ms] and week, at a time since boot [us]."""
    since_ms = BOOT_MS + round(1e-3 * time_us)
    return since_ms % WEEK_MS, GPS_WEEK + since_ms // WEEK_MS


def _packed(code: str, value: object) -> bytes:
    if code in "nNZ":
        return struct.pack("<" + STRUCT[code], value if isinstance(value, bytes) else str(value).encode())
    if code == "a":
        return struct.pack("<32h", *value)  # type: ignore[misc]
    if code in FACTOR:
        value = round(float(value) * FACTOR[code])  # type: ignore[arg-type]
    return struct.pack("<" + STRUCT[code], value if code in "fdg" else int(value))  # type: ignore[call-overload]


# -- a log --------------------------------------------------------------------------------------------------
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
    stated = {"RNGFND1_MIN_CM": 100.0 * least_m, "RNGFND1_MAX_CM": 100.0 * most_m}
    for name, value in (log.parameters or stated).items():
        writer.put("PARM", round(BOOT_S * 1e6), name, value)
    if log.origin_deg_m is not None:
        writer.put("ORGN", round(BOOT_S * 1e6), 0, *log.origin_deg_m)
    for t_s, name, values in sorted(_rows(log), key=lambda row: row.t_s):
        writer.put(name, round((BOOT_S + t_s) * 1e6), *values)
    path.write_bytes(writer.content())


def _rows(log: Log) -> Iterator[Row]:
    """Every message, sensor by sensor."""
    for t_s, value in _of(log, Sensor.IMU):
        yield Row(t_s, "IMU", (0, *value, 1, 1))
    for (t_s, value), quality in zip(_of(log, Sensor.FLOW_RATE), _qualities(log, Sensor.FLOW_RATE), strict=True):
        yield Row(t_s, "OF", (round(quality), *value))
    for (t_s, (distance,)), quality in zip(_of(log, Sensor.RANGE), _qualities(log, Sensor.RANGE), strict=True):
        yield Row(t_s, "RFND", (0, distance, GOOD if quality > 0.0 else 0, DOWNWARD))
    for t_s, (altitude,) in _of(log, Sensor.BARO):
        yield Row(t_s, "BARO", (0, altitude))
    for t_s, field in _of(log, Sensor.MAG):
        yield Row(t_s, "MAG", (0, *(round(MILLIGAUSS_PER_GAUSS * part) for part in field), 1))
    if Sensor.GPS_POSITION in log.streams:
        yield from _fixes(log)
    if Sensor.LANDED in log.streams:
        for t_s, landed in zip(*(column.tolist() for column in changes(log)), strict=True):
            yield Row(t_s, "EV", (LANDED if landed else FLYING,))
    for happened in log.happened:
        if happened.kind == SOURCE_SET:
            yield Row(happened.t_s, "EV", (FIRST_SET + int(happened.value),))
        elif happened.kind == MESSAGE:
            yield Row(happened.t_s, "MSG", (happened.text,))
    if log.autopilot is not None:
        yield from _estimated(log.autopilot)
    if log.truth is not None:
        yield from _simulated({name: column[::SIMULATED_EVERY] for name, column in log.truth.items()}, log)


def _of(log: Log, sensor: Sensor) -> Iterator[tuple[float, list[float]]]:
    if sensor not in log.streams:
        return iter(())
    stream = log.streams[sensor]
    return zip(stream.t_s.tolist(), stream.value.tolist(), strict=True)


def _qualities(log: Log, sensor: Sensor) -> list[float]:
    return log.streams[sensor].quality.tolist() if sensor in log.streams else []


def _estimated(own: Table) -> Iterator[Row]:
    """ATT and XKF1: the estimate of the vehicle's own filter."""
    angles, velocity = np.degrees(angles_of(own)), velocities_ned(own)
    turned = np.where(np.arange(3) == 2, angles % 360.0, angles)
    place = np.column_stack([own[name] for name in POSITION_NED])
    columns = np.column_stack([own["t_s"], angles, turned, velocity, velocity[:, 2], place])
    for t_s, *values in columns.tolist():
        yield Row(t_s, "ATT", tuple(values[:3]))
        yield Row(t_s, "XKF1", (0, *values[3:], 0.0, 0.0, 0.0, 0.0))


def _fixes(log: Log) -> Iterator[Row]:
    """GPS, and GPA with its accuracies at the same time."""
    fixes = fixes_of(log)
    north, east, down = fixes.velocity_ned_m_s.T
    course = np.degrees(np.arctan2(east, north)) % 360.0
    columns = (fixes.t_s, fixes.lat_deg, fixes.lon_deg, fixes.alt_m, np.hypot(north, east), course, down)
    sigmas = np.column_stack([fixes.sigma_m, fixes.sigma_m_s]).tolist()
    for (t_s, *values), stated in zip(np.column_stack(columns).tolist(), sigmas, strict=True):
        yield Row(t_s, "GPS", (0, FIX_3D, *gps_time(1e6 * (BOOT_S + t_s)), *values, 1))
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
