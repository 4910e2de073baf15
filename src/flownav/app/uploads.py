"""Uploads: bytes as they come onto the disk, whole or not at all, within a limit."""

import os
import shutil
from collections.abc import AsyncIterator
from pathlib import Path

from flownav.app.shelf import Shelf
from flownav.core.errors import InputError

MOST_BYTES = 500 * 1000 * 1000
LEAST_FREE_BYTES = 200 * 1000 * 1000  # of the disk, that stays free
TOO_LARGE = "is larger than 500 MB; open it where it lies, with `flownav info`"


async def receive(shelf: Shelf, name: str, announced: int | None, chunks: AsyncIterator[bytes]) -> Path:
    """Write a file as its bytes come; where it lies: under its name, or the next free number.

    announced: how many bytes will come, where that is known. A file in a folder (`log/gps.csv`) keeps its name.
    InputError where it is too large, or the name is none; whatever breaks it off leaves nothing behind.
    """
    place = shelf.path_of(name)
    _check_room(shelf, name, announced or 0)
    in_folder = place.parent != shelf.folder
    place.parent.mkdir(exist_ok=True)
    temporary = place.with_name(f".{place.name[:80]}.{os.urandom(4).hex()}.part")
    written = 0
    try:
        with temporary.open("xb") as file:
            async for chunk in chunks:
                written += len(chunk)
                if written > MOST_BYTES:
                    raise InputError(f"{name}: {TOO_LARGE}")
                file.write(chunk)
        if announced is not None and written != announced:
            raise InputError(f"{name}: only {written} of {announced} bytes came")
        if not in_folder:
            place = shelf.free(name)
        os.replace(temporary, place)
    finally:
        temporary.unlink(missing_ok=True)
        if in_folder and not any(place.parent.iterdir()):
            place.parent.rmdir()
    shelf.dropped.add(place.relative_to(shelf.folder).parts[0])
    return place


def _check_room(shelf: Shelf, name: str, announced: int) -> None:
    if announced > MOST_BYTES:
        raise InputError(f"{name}: {TOO_LARGE}")
    if shutil.disk_usage(shelf.folder).free < announced + LEAST_FREE_BYTES:
        raise InputError(f"{name}: the disk is full; make room, and drop it again")
