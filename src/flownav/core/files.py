"""Files and folders that appear whole or not at all, and the order in which a folder's are taken.

What a user names to be written goes through `guard`, which also asks what is there already.
"""

import errno
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # what a write says where there is no room; it names no file


@contextmanager
def _naming(path: Path, temporary: Path) -> Iterator[None]:
    """Name a path in the OSErrors of writing to a temporary one in its place, or to what lies in it."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno in FULL:
            raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
        if isinstance(error.filename, str) and error.filename.startswith(str(temporary)):
            there = str(path) + error.filename.removeprefix(str(temporary))
            raise OSError(error.errno, error.strerror, there) from error
        raise


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` to write to; it takes the name when the block ends well and goes when not.

    Missing folders are made. OSError, which names `path`, where the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(_hidden())
    try:
        with _naming(path, temporary):
            yield temporary
            os.replace(temporary, path)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def folder_written_whole(path: Path) -> Iterator[Path]:
    """A temporary folder beside `path` to write into; it takes the name when the block ends well and goes when not.

    OSError, which names the folder or what lies in it, where it cannot be written, or is there and holds something:
    nothing of a user's is removed.
    """
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise FileExistsError(errno.EEXIST, "it is there already and not empty", str(path))
    temporary = path.with_name(_hidden())
    try:
        with _naming(path, temporary):
            temporary.mkdir(parents=True)
            yield temporary
            os.replace(temporary, path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _hidden() -> str:
    """A name that no file has, and no longer than others."""
    return f".{secrets.token_hex(8)}.{os.getpid()}.part"


def natural_order(path: Path) -> tuple[list[tuple[bool, int, str]], ...]:
    """A key to sort paths by: numbers in names by their value, so that test2 comes before test10."""
    return tuple(_number_by_number(part) for part in path.parts)


def _number_by_number(name: str) -> list[tuple[bool, int, str]]:
    """A name's digits and what lies between, in turn; digits sort before all else, as they do in ASCII."""
    parts = re.findall(r"\d+|\D+", name, re.ASCII)
    return [(False, int(part), part) if part.isdecimal() else (True, 0, part) for part in parts]
