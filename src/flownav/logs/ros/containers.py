"""A bag's messages, whatever file or folder they lie in: topic, type, time of logging and bytes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.logs.ros.bag import MCAP_MAGIC, ROS1_MAGIC, SQLITE_MAGIC, Bag, Message, Wanted

SUFFIXES = (".mcap", ".db3", ".bag")


def is_bag_folder(folder: Path) -> bool:
    """Whether a folder holds a ROS 2 bag: its files beside metadata.yaml, or alone."""
    try:
        return any(file.suffix.lower() in (".mcap", ".db3") for file in folder.iterdir())
    except OSError:
        return False


def files_of(path: Path) -> list[Path]:
    """The files of a bag, in the order of their names. InputError where a folder holds none that can be read."""
    if not an_input(path).is_dir():
        return [path]
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in (".mcap", ".db3"))
    packed = sorted(file.name for file in path.iterdir() if file.name.endswith((".db3.zstd", ".mcap.zstd")))
    if packed:
        raise InputError(f"{path}: {packed[0]} is compressed as a whole; unpack it first (unzstd {packed[0]})")
    if not files:
        raise InputError(f"{path}: no .mcap or .db3 file in it; a ROS 2 bag's folder is needed")
    return [an_input(file) for file in files]


def messages(path: Path, bag: Bag, wanted: Wanted) -> Iterator[Message]:
    """The wanted messages of one file, in the order in which they lie. InputError where it cannot be read at all."""
    kind = _kind(path)
    if kind == "mcap":
        from flownav.logs.ros.mcap_records import mcap_messages

        return mcap_messages(path, bag, wanted)
    if kind == "db3":
        from flownav.logs.ros.sqlite_bag import sqlite_messages

        return sqlite_messages(path, bag, wanted)
    if kind == "bag":
        from flownav.logs.ros.ros1_bag import ros1_messages

        return ros1_messages(path, bag, wanted)
    raise InputError(f"{path}: no bag (neither MCAP nor SQLite nor ROS 1); record it again, or give another log")


def _kind(path: Path) -> str:
    try:
        with path.open("rb") as file:
            head = file.read(16)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); see who may read it") from error
    for magic, kind in ((MCAP_MAGIC, "mcap"), (SQLITE_MAGIC, "db3"), (ROS1_MAGIC, "bag")):
        if head.startswith(magic):
            return kind
    return ""
