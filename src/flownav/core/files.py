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


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` to write to; it takes the name when the block ends well and goes when not.

    Missing folders are made. OSError where the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(_hidden())
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def folder_written_whole(path: Path) -> Iterator[Path]:
    """A temporary folder beside `path` to write into; it takes the name when the block ends well and goes when not.

    OSError where the folder cannot be written, or is there and holds something: nothing of a user's is removed.
    """
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise FileExistsError(errno.EEXIST, "it is there already and not empty", str(path))
    temporary = path.with_name(_hidden())
    temporary.mkdir(parents=True)
    try:
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
