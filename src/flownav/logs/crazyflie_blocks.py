"""A log of the Crazyflie's micro SD deck as blocks of variables, fixed in rate or written at events.

Format, versions 1 and 2: bitcraze/crazyflie-firmware, src/deck/drivers/src/usddeck.c and tools/usdlog/cfusdlog.py.
0xBC, version and number of block kinds (uint16 each); a kind is its number, its name, and its variables as `name(t)`
with a struct's type letter; then blocks of number (uint16), time (version 1: uint32 ms; 2: uint64 us) and values; a
CRC-32 ends the file.
"""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.logs.assembly import content_of, sha256_of

MAGIC = 0xBC
LETTERS = {"B": "u1", "b": "i1", "H": "u2", "h": "i2", "I": "u4", "i": "i4", "Q": "u8", "q": "i8", "e": "f2", "f": "f4"}
CODES = {letter: np.dtype(f"<{kind}") for letter, kind in (LETTERS | {"d": "f8", "?": "?"}).items()}
MOST_KINDS, MOST_VARIABLES, LONGEST_NAME = 256, 256, 80
TIME_STAMPS = {1: (np.dtype("<u4"), 1e-3), 2: (np.dtype("<u8"), 1e-6)}


@dataclass
class Block:
    """One kind of block: its name ("fixedFrequency", "estFlow"), times [s] and variables by name."""

    name: str
    t_s: NDArray[np.float64]
    columns: dict[str, NDArray[np.float64]]

    def matrix(self, *names: str) -> Array:
        """Variables side by side (n, len(names))."""
        return np.column_stack([self.columns[name] for name in names])


@dataclass
class Blocks:
    """The blocks of a file, and notes on its damage."""

    found: list[Block]
    sha256: str
    notes: list[str]

    def with_variables(self, *names: str) -> Block | None:
        """The block with all these variables that was written most often; None where there is none."""
        usable = [block for block in self.found if set(names) <= block.columns.keys() and len(block.t_s)]
        return max(usable, key=lambda block: len(block.t_s), default=None)


class _Kind(NamedTuple):
    name: str
    variables: tuple[str, ...]
    row: np.dtype[np.void]


def read_blocks(path: Path) -> Blocks:
    """The blocks of a file. InputError where it cannot be read or its head is none of the two versions."""
    content = content_of(path, "a log of the micro SD deck")
    version, kinds, place = _head(path, content)
    sound = len(content) >= 9 and crc32(content[:-4]) == int.from_bytes(content[-4:], "little")
    end = len(content) - 4 if sound else len(content)
    rows, stop = _rows(content, place, end, kinds)
    notes = [] if sound else ["the checksum does not fit: the log was not closed, or is damaged"]
    if stop < end and sound:
        notes.append(f"damaged at byte {stop}: {end - stop} bytes are left out")
    elif stop < end:
        notes.append(f"{end - stop} bytes at the end belong to no whole block and are left out")
    unit_s = TIME_STAMPS[version][1]
    found = []
    for number, kind in kinds.items():
        table = np.frombuffer(b"".join(rows[number]), kind.row)
        columns = {name: table[f"v{k}"].astype(float) for k, name in enumerate(kind.variables)}
        found.append(Block(kind.name, unit_s * table["time"].astype(float), columns))
    return Blocks(found, sha256_of(content), notes)


def looks_like(head: bytes) -> bool:
    """Whether a file's first bytes are those of such a log: magic, version, and a first kind with a sane name."""
    if len(head) < 12 or head[0] != MAGIC or int.from_bytes(head[1:3], "little") not in TIME_STAMPS:
        return False
    count, name = int.from_bytes(head[3:5], "little"), head[7 : 7 + LONGEST_NAME].split(b"\0")[0]
    return 0 < count <= MOST_KINDS and len(name) > 0 and name.isascii() and name.decode().isprintable()


def _head(path: Path, content: bytes) -> tuple[int, dict[int, _Kind], int]:
    """Version, kinds by number, and where the blocks begin."""
    if len(content) < 5 or content[0] != MAGIC:
        raise InputError(f"{path}: no log of the micro SD deck (it begins with 0xBC)")
    version, count = struct.unpack_from("<HH", content, 1)
    if version not in TIME_STAMPS:
        raise InputError(f"{path}: version {version} of the micro SD deck's log; 1 and 2 are known")
    if not 0 < count <= MOST_KINDS:
        raise InputError(f"{path}: a damaged head ({count} kinds of blocks); give another log")
    kinds: dict[int, _Kind] = {}
    place = 5
    try:
        for _ in range(count):
            number = struct.unpack_from("<H", content, place)[0]
            name, place = _name(content, place + 2)
            variables = struct.unpack_from("<H", content, place)[0]
            place += 2
            if variables > MOST_VARIABLES:
                raise ValueError(f"{variables} variables")
            fields: list[tuple[str, Any]] = [("number", np.dtype("<u2")), ("time", TIME_STAMPS[version][0])]
            names = []
            for k in range(variables):
                label, place = _name(content, place)
                if len(label) < 4 or label[-3] != "(" or label[-1] != ")" or label[-2] not in CODES:
                    raise ValueError(f"variable {label!r}")
                names.append(label[:-3])
                fields.append((f"v{k}", CODES[label[-2]]))
            kinds.setdefault(number, _Kind(name, tuple(names), np.dtype(fields)))
    except (struct.error, ValueError) as error:
        raise InputError(f"{path}: a damaged head ({error}); give another log") from error
    return version, kinds, place


def _name(content: bytes, place: int) -> tuple[str, int]:
    """A text up to its zero, and the place after it. ValueError where it does not end or is no text."""
    end = content.find(b"\0", place, place + LONGEST_NAME)
    if end < 0:
        raise ValueError("a name without an end")
    return content[place:end].decode("ascii"), end + 1


def _rows(content: bytes, place: int, end: int, kinds: dict[int, _Kind]) -> tuple[dict[int, list[bytes]], int]:
    """Each kind's blocks as bytes, and where the first byte lies that belongs to no whole block."""
    rows: dict[int, list[bytes]] = {number: [] for number in kinds}
    sizes = {number: kind.row.itemsize for number, kind in kinds.items()}
    while place + 2 <= end:
        number = content[place] | content[place + 1] << 8
        size = sizes.get(number)
        if size is None or place + size > end:
            break
        rows[number].append(content[place : place + size])
        place += size
    return rows, place
