"""The data messages of a ULog by the million: where they lie, and one field of all of them, in compiled loops."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import kernel

MESSAGE_IDS = 1 << 16  # a message id has two bytes
HEADER, ID = 3, 2  # bytes before a row: length and kind, topic
DATA_KIND = 68  # "D"
AT_ONCE = 1 << 18  # messages that one call of `walk_data` takes at most

Bytes = NDArray[np.uint8]
Places = NDArray[np.int64]


class Announced(NamedTuple):
    """By message id (MESSAGE_IDS,): least and most bytes of a row, 0 where it is unknown, and whether it is wanted."""

    least: Places
    most: Places
    wanted: NDArray[np.bool_]


def nothing_announced() -> Announced:
    """Before the first topic."""
    return Announced(np.zeros(MESSAGE_IDS, np.int64), np.zeros(MESSAGE_IDS, np.int64), np.zeros(MESSAGE_IDS, np.bool_))


@kernel
def walk_data(
    content: Bytes, pos: int, limit: int, least: Places, most: Places, wanted: NDArray[np.bool_], rows: Places,
    ids: NDArray[np.uint16],
) -> tuple[int, int]:  # fmt: skip
    """Over the sound data messages of known topics from `pos` on, as far as they follow each other.

    Writes where the wanted ones' rows begin, and of which topic they are; the place after the last, and how many.
    """
    count = 0
    while pos + HEADER + ID <= limit and count < len(rows):
        size = int(content[pos]) + 256 * int(content[pos + 1])
        stop = pos + HEADER + size
        if content[pos + 2] != DATA_KIND or size < ID or stop > limit:
            break
        number = int(content[pos + 3]) + 256 * int(content[pos + 4])
        if least[number] == 0 or size - ID < least[number] or size - ID > most[number]:
            break
        if wanted[number]:
            rows[count] = pos + HEADER + ID
            ids[count] = number
            count += 1
        pos = stop
    return pos, count


@kernel
def gather(content: Bytes, rows: Places, offset: int, out: Bytes) -> None:
    """The bytes of one field of every row, out (n, size of the field)."""
    for row in range(len(rows)):
        for k in range(out.shape[1]):
            out[row, k] = content[rows[row] + offset + k]


def field_of(content: Bytes, rows: Places, offset: int, dtype: np.dtype[np.generic]) -> NDArray[np.generic]:
    """One field of every row (n,), as the file has it."""
    out = np.empty((len(rows), dtype.itemsize), np.uint8)
    gather(content, rows, offset, out)
    return out.view(dtype)[:, 0]
