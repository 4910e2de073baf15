"""The text form of a DataFlash log (.log), as a ground station downloads it: its lines as the messages that they were.

A line is a message's name and its values, `GPS, 3, 109214400, ...`; FMT lines describe the others, as FMT messages do.
Numbers of the characters c, C, e, E are divided by 100 there, degrees of L by 1e7, and a mode is its name. A number of
16 bits (c, C) is kept as one of 32: whoever rewrote a text need not have kept to what fits, as a heading of 359.99.
"""

import re
import struct
from collections.abc import Iterator

import numpy as np

from flownav.logs.dataflash import formats

LOOKED_AT_BYTES = 4096  # the firmware's name and a few numbers stand before the first line
# FMT's own line is often the first, but tools that cut a log write only the lines of what they keep
_FIRST = re.compile(rb"^FMT, ?\d{1,3}, ?\d{1,3}, ?[A-Z][A-Z0-9]{1,3}, ?[A-Za-z]{1,16}, ?[A-Za-z]\w*,", re.MULTILINE)
_WIDER = str.maketrans("cC", "eE")
_SIZES = {"n": 4, "N": 16, "Z": 64}
_STRUCT = {code: kind for code, kind in formats.CODES.items() if code not in formats.NOT_NUMBERS}
_LETTERS = {"i1": "b", "u1": "B", "<i2": "h", "<u2": "H", "<i4": "i", "<u4": "I", "<i8": "q", "<u8": "Q", "<f2": "e",
            "<f4": "f", "<f8": "d"}  # fmt: skip


def is_text(head: bytes) -> bool:
    """Whether a file's first bytes are those of the text form."""
    return _FIRST.search(head) is not None


def binary_of(content: bytes) -> bytes:
    """The messages of a text, as the vehicle would have written them; a line that is none is left out."""
    return b"".join(_messages(content))


def _messages(content: bytes) -> Iterator[bytes]:
    kinds: dict[str, tuple[int, str]] = {formats.FMT.name: (formats.FMT_TYPE, formats.FMT.codes)}
    for line in content.decode("latin-1").splitlines():
        name, _, rest = line.partition(",")
        known = kinds.get(name)
        if known is None:
            continue
        kind, codes = known
        values = [value.strip() for value in rest.split(",", len(codes) - 1)] if codes else []
        try:
            if name == formats.FMT.name:
                values[3] = values[3].translate(_WIDER)
                kinds.setdefault(values[2], (int(values[0]), values[3]))
                values[1] = str(formats.HEADER_BYTES + _size(values[3]))  # a text's own may be anything
            yield bytes((*formats.HEAD, kind)) + b"".join(_packed(*each) for each in zip(codes, values, strict=True))
        except (ValueError, OverflowError, struct.error, KeyError, IndexError):
            continue


def _size(codes: str) -> int:
    """Bytes of a body. KeyError where a character is none of the format's."""
    return sum(np.dtype(formats.CODES[code]).itemsize for code in codes)


def _packed(code: str, value: str) -> bytes:
    """A value as bytes; ValueError and the like where it is none."""
    if code in _SIZES:
        return value.encode("latin-1")[: _SIZES[code]].ljust(_SIZES[code], b"\0")
    if code == "M":
        return bytes([int(value) if value.isdigit() else 0])
    kind = "<" + _LETTERS[_STRUCT[code]]
    if code in "fdg":
        return struct.pack(kind, float(value))
    return struct.pack(
        kind, round(float(value) * formats.DIVISORS[code]) if code in formats.DIVISORS else _whole(value)
    )


def _whole(value: str) -> int:
    """A whole number, also as a spreadsheet writes it (12.0, 1e+06)."""
    try:
        return int(value)
    except ValueError:
        number = float(value)
        if number != round(number):
            raise
        return round(number)
