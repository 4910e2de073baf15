"""How a blackbox log is written: the text at its start, and how numbers are packed, in compiled functions.

The text states the fields of each kind of frame, how they are packed, and settings (betaflight/betaflight,
src/main/blackbox/blackbox.c: blackboxHeader, sendFieldDefinition, blackboxWriteSysinfo; INAV descends from it). A file
may hold several logs, one for each time the vehicle was armed. src/main/blackbox/blackbox_encoding.c writes the
numbers: each function takes the bytes and a place, and gives the place after; -1 means that the bytes end before.
"""

import struct
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import kernel

START = b"H Product:Blackbox flight data recorder"
LONGEST_LINE, MOST_FIELDS, MOST_LOGS, MOST_LINES = 16384, 256, 1000, 4096
KNOWN_PREDICTORS = frozenset(range(12))
HOME_COORD, HOME_COORD_EAST, INCREMENT = 7, 12, 6
KNOWN_ENCODINGS = frozenset((0, 1, 3, 6, 7, 8, 9, 10))

Codes = NDArray[np.int64]
Bytes = NDArray[np.uint8]
Numbers = NDArray[np.int64]

SIGNED_VB, UNSIGNED_VB, NEG_14BIT, TAG8_8SVB, TAG2_3S32, TAG8_4S16, NONE, TAG2_3SVARIABLE = 0, 1, 3, 6, 7, 8, 9, 10
AT_MOST = 8  # values that one encoding packs together


LARGEST_SETTING = 2147483647.0  # of a flight controller's own 32 bits


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
        """Such as "INAV 7.1.0" or "Betaflight 4.5.1"; "Cleanflight d72983e", whose revision is a commit alone."""
        words = self.settings.get("Firmware revision", "").split()[:2]
        kind = self.settings.get("Firmware type", "").split()[:1] if len(words) == 1 else []
        return " ".join([*kind, *words]) or "an unknown firmware"

    @property
    def is_inav(self) -> bool:
        """Whether INAV wrote it."""
        return "INAV" in self.settings.get("Firmware revision", "").upper()

    def number(self, name: str, default: float) -> float:
        """A setting's first number; `default` where it is missing, or none that a setting can be."""
        text = self.settings.get(name, "").split(",")[0].strip()
        try:
            if text.lower().startswith("0x"):
                found = float(struct.unpack("<f", struct.pack("<I", int(text, 16) & 0xFFFFFFFF))[0])
            else:
                found = float(text)
        except ValueError:
            return default
        return found if abs(found) <= LARGEST_SETTING else default  # NaN is not


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
    """The fields of a kind of frame as the header lines define them; empty where they do not, or cannot be."""
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


# -- packed numbers -----------------------------------------------------------------------------------------
@kernel
def unsigned_vb(content: Bytes, pos: int, end: int) -> tuple[int, int]:
    """Seven bits a byte, the lowest first; five bytes at most."""
    value, shift = 0, 0
    for _ in range(5):
        if pos >= end:
            return 0, -1
        byte = int(content[pos])
        pos += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value & 0xFFFFFFFF, pos
        shift += 7
    return 0, -1


@kernel
def signed_vb(content: Bytes, pos: int, end: int) -> tuple[int, int]:
    """A variable-byte number whose sign is its lowest bit (zigzag)."""
    value, pos = unsigned_vb(content, pos, end)
    return (value >> 1) ^ -(value & 1), pos


@kernel
def sign_extended(value: int, bits: int) -> int:
    """A number of `bits` bits in two's complement."""
    return value - (1 << bits) if value & (1 << (bits - 1)) else value


@kernel
def sized(content: Bytes, pos: int, end: int, selector: int, count: int, out: Numbers) -> int:
    """`count` signed numbers of 1 to 4 bytes, lowest first; two bits of the selector give the size of each."""
    for k in range(count):
        width = ((selector >> (2 * k)) & 3) + 1
        if pos + width > end:
            return -1
        value = 0
        for j in range(width):
            value |= int(content[pos + j]) << (8 * j)
        out[k] = sign_extended(value, 8 * width)
        pos += width
    return pos


@kernel
def tag2_3(content: Bytes, pos: int, end: int, variable: bool, out: Numbers) -> int:
    """Three numbers after two bits that give their size: 2, 4 and 6 bits each (or 5-5-4, 8-7-7), or whole bytes."""
    if pos >= end:
        return -1
    lead = int(content[pos])
    selector = lead >> 6
    pos += 1
    if selector == 3:
        return sized(content, pos, end, lead & 63, 3, out)
    if selector == 0:
        for k in range(3):
            out[k] = sign_extended((lead >> (4 - 2 * k)) & 3, 2)
        return pos
    if pos + selector > end:
        return -1
    one = int(content[pos])
    if selector == 1:
        if variable:
            out[0] = sign_extended((lead & 62) >> 1, 5)
            out[1] = sign_extended(((lead & 1) << 4) | (one >> 4), 5)
        else:
            out[0] = sign_extended(lead & 15, 4)
            out[1] = sign_extended(one >> 4, 4)
        out[2] = sign_extended(one & 15, 4)
        return pos + 1
    two = int(content[pos + 1])
    if variable:
        out[0] = sign_extended(((lead & 63) << 2) | (one >> 6), 8)
        out[1] = sign_extended(((one & 63) << 1) | (two >> 7), 7)
        out[2] = sign_extended(two & 127, 7)
    else:
        out[0] = sign_extended(lead & 63, 6)
        out[1] = sign_extended(one & 63, 6)
        out[2] = sign_extended(two & 63, 6)
    return pos + 2


@kernel
def tag8_4s16(content: Bytes, pos: int, end: int, out: Numbers) -> int:
    """Four numbers of 0, 4, 8 or 16 bits, packed nibble by nibble, the high one first."""
    if pos >= end:
        return -1
    selector = int(content[pos])
    pos += 1
    half, kept = False, 0  # whether the low nibble of the byte before is still to come, and that byte
    for k in range(4):
        size = (selector >> (2 * k)) & 3
        nibbles = 0 if size == 0 else 1 << (size - 1)
        value = 0
        for _ in range(nibbles):
            if half:
                value = (value << 4) | (kept & 15)
                half = False
            else:
                if pos >= end:
                    return -1
                kept = int(content[pos])
                pos += 1
                value = (value << 4) | (kept >> 4)
                half = True
        out[k] = sign_extended(value, 4 * nibbles) if nibbles else 0
    return pos


@kernel
def packed(content: Bytes, pos: int, end: int, encoding: int, group: int, out: Numbers) -> tuple[int, int]:
    """The next values of an encoding into `out` (AT_MOST,): how many they are, and the place after them.

    group: how many fields in a row have the encoding, which TAG8_8SVB packs together.
    """
    count = 1
    if encoding == UNSIGNED_VB:
        out[0], pos = unsigned_vb(content, pos, end)
    elif encoding == SIGNED_VB:
        out[0], pos = signed_vb(content, pos, end)
    elif encoding == NEG_14BIT:
        value, pos = unsigned_vb(content, pos, end)
        out[0] = -sign_extended(value & 16383, 14)
    elif encoding == NONE:
        out[0] = 0
    elif encoding == TAG8_8SVB:
        count = min(group, AT_MOST)
        if count == 1:
            out[0], pos = signed_vb(content, pos, end)
        elif pos >= end:
            pos = -1
        else:
            marks = int(content[pos])
            pos += 1
            for k in range(count):
                out[k] = 0
                if (marks >> k) & 1 and pos >= 0:
                    out[k], pos = signed_vb(content, pos, end)
    elif encoding == TAG8_4S16:
        count = 4
        pos = tag8_4s16(content, pos, end, out)
    else:
        count = 3
        pos = tag2_3(content, pos, end, encoding == TAG2_3SVARIABLE, out)
    return count, pos
