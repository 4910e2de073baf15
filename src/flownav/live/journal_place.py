"""Where a session records to: a name that nobody has, and a journal beside it that nobody else writes."""

from __future__ import annotations

import errno
import fcntl
import os
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from flownav.core.errors import InputError
from flownav.core.free_names import MOST_NUMBERS, numbered
from flownav.logs.journal import MAGIC, SUFFIX

LOCK_WAIT_S = 1.0  # for somebody who only looks whether the journal is locked
NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)  # of file systems that have none


class Place(NamedTuple):
    """A record's name, its journal, open and locked, and what a user must know of the choice ("" where nothing)."""

    record: Path
    journal: Path
    file: int
    notice: str


def journal_of(record: Path) -> Path:
    """The journal of a record lies beside it."""
    return record.with_name(record.name + SUFFIX)


def claim(path: Path, *, force: bool) -> Place:
    """A place to record to: `path`, or numbered where a record or the journal of a killed run is there.

    force: a record that is there is replaced (in the end, by a whole one). A journal is never touched. InputError where
    another session records there, or nothing can be written.
    """
    if os.path.lexists(path) and not path.is_file():
        raise InputError(f"{path}: it is there and no file; give another --record")
    why = ""
    for number in range(MOST_NUMBERS):
        record = numbered(path, number)
        journal = journal_of(record)
        if os.path.lexists(journal):
            if is_locked(journal):
                raise InputError(f"{record}: another session is recording there; give another --record")
            why = why or f"{journal} is left by a session that was killed (`flownav recover {journal}`)"
        elif os.path.lexists(record) and not force:
            why = why or f"{record} is there already (--force replaces it)"
        else:
            file = _made(journal, record)
            if file is not None:
                return Place(record, journal, file, f"{why}; this session records to {record}" if why else "")
    raise InputError(f"{path}: it is there, and so are {MOST_NUMBERS} numbered beside it; give another --record")


def is_locked(journal: Path) -> bool:
    """Whether a session is writing it."""
    try:
        file = os.open(journal, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno in (errno.EWOULDBLOCK, errno.EACCES)
    finally:
        os.close(file)
    return False


def _made(journal: Path, record: Path) -> int | None:
    """A new journal, open and locked; None where somebody has made it in between."""
    try:
        journal.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(journal, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC, 0o666)
    except FileExistsError:
        return None
    except OSError as error:
        raise InputError(f"{record}: cannot be written ({error.strerror}); give another --record") from error
    until_s = time.monotonic() + LOCK_WAIT_S
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            break
        except OSError as error:
            if error.errno in NO_LOCKS or time.monotonic() > until_s:
                break
            time.sleep(0.01)
    try:
        os.write(file, MAGIC)
    except OSError as error:
        os.close(file)
        with suppress(OSError):
            journal.unlink()
        raise InputError(f"{record}: cannot be written ({error.strerror}); give another --record") from error
    return file
