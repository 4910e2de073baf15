"""ArduPilot's DataFlash format as a writer has it: messages that describe themselves, one after the other.

Written apart from the reader (`logs/dataflash/`), so that neither can hide what the other gets wrong.
Source: ArduPilot, libraries/AP_Logger/LogStructure.h.
"""

from __future__ import annotations

import struct

import numpy as np

STRUCT = {
    "a": "32h", "b": "b", "B": "B", "g": "e", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d", "q": "q",
    "Q": "Q", "n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B",
}  # fmt: skip
FACTOR = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 10**7}
UNITS = {"-": "", "?": "UNKNOWN", "s": "s", "#": "instance", "m": "m", "G": "Gauss", "E": "rad/s"}
MULTIPLIERS = {"-": 0.0, "?": 1.0, "0": 1.0, "C": 1e-3, "F": 1e-6, "B": 1e-2}
HEAD = b"\xa3\x95"
FMT, FIRST_OWN = 128, 132  # types of messages: FMT's, and of those that a log defines itself


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

    @staticmethod
    def blank(codes: str) -> bytes:
        """A body of zeros."""
        return bytes(struct.calcsize("<" + "".join(STRUCT[c] for c in codes)))

    def content(self) -> bytes:
        """The whole log."""
        return b"".join(self.parts)


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


def define_simulated(writer: DataFlashWriter) -> None:
    """The truth of a simulated flight, as ArduPilot's simulator writes it."""
    writer.define("SIM", "QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4", "s----------", "F----------")
    writer.define("SIM2", "Qdddfff", "TimeUS,PN,PE,PD,VN,VE,VD", "s------", "F------")


def _packed(code: str, value: object) -> bytes:
    if code in "nNZ":
        return struct.pack("<" + STRUCT[code], value if isinstance(value, bytes) else str(value).encode())
    if code == "a":
        return struct.pack("<32h", *value)  # type: ignore[misc]
    if code in FACTOR:
        value = round(float(value) * FACTOR[code])  # type: ignore[arg-type]
    return struct.pack("<" + STRUCT[code], value if code in "fdg" else int(value))  # type: ignore[call-overload]
