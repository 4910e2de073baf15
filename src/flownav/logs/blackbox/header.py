"""The text at the start of a blackbox log: the fields of each kind of frame, how they are packed, and settings.

betaflight/betaflight, src/main/blackbox/blackbox.c (blackboxHeader, sendFieldDefinition, blackboxWriteSysinfo); INAV
descends from it. A file may hold several logs, one for each time the vehicle was armed.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

START = b"H Product:Blackbox flight data recorder"
LONGEST_LINE, MOST_FIELDS, MOST_LOGS, MOST_LINES = 16384, 256, 1000, 4096
KNOWN_PREDICTORS = frozenset(range(12))
HOME_COORD, HOME_COORD_EAST, INCREMENT = 7, 12, 6
KNOWN_ENCODINGS = frozenset((0, 1, 3, 6, 7, 8, 9, 10))

Codes = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Fields:
    """The fields of one kind of frame: names, and for each what it is predicted from and how the rest is packed."""

    names: tuple[str, ...] = ()
    predictors: Codes = field(default_factory=lambda: np.zeros(0, np.int64))
    encodings: Codes = field(default_factory=lambda: np.zeros(0, np.int64))

    def place(self, name: str) -> int:
        """Which field has this name; -1 for none."""
        return self.names.index(name) if name in self.names else -1


@dataclass(frozen=True, eq=False)
class Header:
    """One log of a file. frames: by letter "I", "P", "S", "G", "H". settings: the other lines. first_byte, end_byte:
    where its frames lie."""

    frames: dict[str, Fields]
    settings: dict[str, str]
    first_byte: int
    end_byte: int

    @property
    def firmware(self) -> str:
        """Such as "INAV 7.1.0" or "Betaflight 4.5.1"."""
        return " ".join(self.settings.get("Firmware revision", "").split()[:2]) or "an unknown firmware"

    @property
    def is_inav(self) -> bool:
        """Whether INAV wrote it."""
        return "INAV" in self.settings.get("Firmware revision", "").upper()

    def number(self, name: str, default: float) -> float:
        """A setting's first number; `default` where it is missing or none."""
        text = self.settings.get(name, "").split(",")[0].strip()
        try:
            if text.lower().startswith("0x"):
                return float(struct.unpack("<f", struct.pack("<I", int(text, 16) & 0xFFFFFFFF))[0])
            return float(text)
        except ValueError:
            return default


def headers(content: bytes) -> list[Header]:
    """Every log of a file whose fields are defined, in order."""
    starts: list[int] = []
    place = content.find(START)
    while place >= 0 and len(starts) < MOST_LOGS:
        starts.append(place)
        place = content.find(START, place + len(START))
    ends = [*starts[1:], len(content)][: len(starts)]
    found = [_header(content, start, end) for start, end in zip(starts, ends, strict=True)]
    return [header for header in found if header is not None]


def _header(content: bytes, start: int, end: int) -> Header | None:
    lines: dict[str, str] = {}
    place = start
    for _ in range(MOST_LINES):
        if content[place : place + 2] != b"H ":
            break
        stop = content.find(b"\n", place, min(end, place + LONGEST_LINE))
        if stop < 0:
            break
        name, _, value = content[place + 2 : stop].decode("ascii", errors="replace").partition(":")
        lines.setdefault(name.strip(), value.strip())
        place = stop + 1
    frames = {letter: _fields(lines, letter) for letter in "ISGH"}
    inter = _fields(lines, "P", frames["I"].names)
    if not len(frames["I"].names) or len(inter.names) != len(frames["I"].names):
        return None
    return Header(frames | {"P": inter}, lines, place, end)


def _fields(lines: dict[str, str], letter: str, names: tuple[str, ...] = ()) -> Fields:
    """What the lines say of a kind of frame; empty where they do not, or cannot be."""
    names = names or tuple(filter(None, lines.get(f"Field {letter} name", "").split(",")))
    predictors, encodings = (_codes(lines.get(f"Field {letter} {what}", "")) for what in ("predictor", "encoding"))
    sound = 0 < len(names) <= MOST_FIELDS and len(names) == len(predictors) == len(encodings)
    if not sound or not set(predictors) <= KNOWN_PREDICTORS or not set(encodings) <= KNOWN_ENCODINGS:
        return Fields()
    homes = [k for k, code in enumerate(predictors) if code == HOME_COORD]
    if len(homes) > 1:
        predictors[homes[1]] = HOME_COORD_EAST
    return Fields(names, np.array(predictors, np.int64), np.array(encodings, np.int64))


def _codes(text: str) -> list[int]:
    parts = text.split(",")
    return [int(part) for part in parts] if all(part.strip().isdigit() and len(part) < 4 for part in parts) else []
