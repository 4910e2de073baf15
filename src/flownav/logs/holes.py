"""Refuses a log with a large hole: a part that was never written, which the file system reads as zeros."""

import os
from pathlib import Path

from flownav.core.errors import InputError

MOST_HOLE_BYTES = 16 << 20  # chosen: recorders write what they have; a copy that broke off may leave gigabytes


def require_written(path: Path, size: int) -> None:
    """InputError where more than MOST_HOLE_BYTES of a file's `size` bytes were never written: a hole, read as zeros.

    A file system that does not report holes has none. OSError where there is no file.
    """
    hole = _first_hole(path, size) if size > MOST_HOLE_BYTES else None
    if hole is not None:
        raise InputError(
            f"{path}: more than {MOST_HOLE_BYTES >> 20} MB of it, from byte {hole} on, were never written; copy it "
            "again, or cut it there"
        )


def _first_hole(path: Path, size: int) -> int | None:
    """Where the first hole of a file begins; None where all its holes together are no larger than allowed."""
    to_data, to_hole = getattr(os, "SEEK_DATA", None), getattr(os, "SEEK_HOLE", None)
    if to_data is None or to_hole is None:
        return None
    with path.open("rb") as file:
        first, left, place = None, MOST_HOLE_BYTES, 0
        while place < size and left >= 0:
            try:
                begin = os.lseek(file.fileno(), place, to_hole)
            except OSError:  # a file system without holes
                return None
            try:
                place = os.lseek(file.fileno(), begin, to_data)
            except OSError:  # no data behind it
                place = size
            first = begin if first is None else first
            left -= place - begin
    return first if left < 0 else None
