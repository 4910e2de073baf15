"""Where a session records to, and the thread that writes its journal.

A record has an unused name, and a journal next to it that nobody else writes. Rows passed to the writer are on the disk
within a second, and nobody waits.
"""

import errno
import fcntl
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.free_names import MOST_NUMBERS, numbered
from flownav.core.measurement import Array
from flownav.logs.journal import MAGIC, SUFFIX, block

LOCK_WAIT_S = 1.0  # for somebody who only looks whether the journal is locked
NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)  # of file systems that have none
# Chosen: together less than the second that a killed session may lose (test_at_most_a_second_is_not_on_the_disk).
WRITE_S = 0.2  # how often what has come is written
SYNC_S = 0.5  # how often it is forced to the disk
HEAD_EVERY_S = 60.0  # the head is written again, so that a damaged sector at the start does not cost the flight
MOST_WAITING = 64 << 20  # bytes that may wait for a disk that does not answer: chosen
LAST_WAIT_S = 30.0  # for the disk, at the end: chosen

Rows = dict[str, Array]


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
        raise InputError(f"{path}: it is there and no file; give another name")
    why = ""
    for number in range(MOST_NUMBERS):
        record = numbered(path, number)
        journal = journal_of(record)
        if os.path.lexists(journal):
            if is_locked(journal):
                raise InputError(f"{record}: another session is recording there; give another name")
            why = why or f"{journal} is left by a session that was killed (`flownav recover {journal}`)"
        elif os.path.lexists(record) and not force:
            why = why or f"{record} is there already (--force replaces it)"
        else:
            file = _made(journal, record)
            if file is not None:
                return Place(record, journal, file, f"{why}; this session records to {record}" if why else "")
    raise InputError(f"{path}: it is there, and so are {MOST_NUMBERS} numbered beside it; give another name")


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
        raise InputError(f"{record}: cannot be written ({error.strerror}); give another name") from error
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
        raise InputError(f"{record}: cannot be written ({error.strerror}); give another name") from error
    return file


class Writer:
    """Takes entries and rows without blocking; writes them in blocks. `reason` says why it stopped writing, "" until
    then.

    failed: called once, in the writing thread, with that reason.
    """

    def __init__(self, file: int, head: dict[str, Any], failed: Callable[[str], None] = lambda reason: None) -> None:
        self.reason = ""
        self.written = 0  # bytes
        self._file, self._head, self._failed = file, head, failed
        self._queued: deque[tuple[str, Any]] = deque()
        self._rows: deque[Rows] = deque()
        self._taken, self._done = 0, 0  # bytes of rows; each is counted up by one thread only
        self._number = 0
        self._ended = threading.Event()
        self._synced_s = self._head_s = time.monotonic()
        self._put({"head": head}, {})  # OSError here is the caller's: nothing flies yet
        os.fsync(file)
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def say(self, name: str, value: Any) -> None:
        """One of the lists of a block (`segments`, `origins`, `notes`) has one more, or `facts` are these now."""
        if not self.reason:
            self._queued.append((name, value))

    def take(self, rows: Rows) -> None:
        """Rows that belong together: they stand in one block or are lost together."""
        if self.reason:
            return
        self._taken += sum(values.nbytes for values in rows.values())
        if self._taken - self._done > MOST_WAITING:
            self._stop("the disk does not keep up")
            return
        self._rows.append(rows)

    def close(self) -> None:
        """Write what still waits and stop. Waits for the disk, LAST_WAIT_S at most."""
        self._ended.set()
        self._thread.join(LAST_WAIT_S)
        if self._thread.is_alive():
            self._stop("the disk does not answer")

    @property
    def is_stuck(self) -> bool:
        """Whether it still waits for the disk after `close`."""
        return self._thread.is_alive()

    # -- the thread -------------------------------------------------------------------------------------------
    def _run(self) -> None:
        ended = False
        while not ended:
            last = self._ended.wait(WRITE_S)
            ended = self.turn(time.monotonic(), last=last) or last

    def turn(self, now_s: float, *, last: bool = False) -> bool:
        """Write what has come and force it to the disk where that is due; whether writing has stopped for good."""
        try:
            if now_s - self._head_s >= HEAD_EVERY_S:
                self._head_s = now_s
                self._put({"head": self._head}, {})
            self._write()
            if last or now_s - self._synced_s >= SYNC_S:
                self._synced_s = now_s
                os.fsync(self._file)
        except OSError as error:
            self._stop(error.strerror or str(error))
        except Exception as error:  # whatever it is, the flight goes on
            self._stop(f"{type(error).__name__}: {error}")
        if stopped := bool(self.reason):
            self._failed(self.reason)
        return stopped

    def _write(self) -> None:
        """One block of all that has come."""
        pending: dict[str, Any] = {}
        for _ in range(len(self._queued)):
            name, value = self._queued.popleft()
            if name in ("facts", "end"):
                pending[name] = value
            else:
                pending.setdefault(name, []).append(value)
        taken = [self._rows.popleft() for _ in range(len(self._rows))]
        names = dict.fromkeys(name for rows in taken for name in rows)
        joined = {name: np.concatenate([rows[name] for rows in taken if name in rows]) for name in names}
        if pending or joined:
            self._put(pending, joined)
        self._done += sum(values.nbytes for values in joined.values())

    def _put(self, pending: dict[str, Any], rows: Rows) -> None:
        left = memoryview(block(self._number, pending, rows))
        self._number += 1
        while left:
            count = os.write(self._file, left)
            self.written += count
            left = left[count:]

    def _stop(self, reason: str) -> None:
        if not self.reason:
            self.reason = reason
            self._queued.clear()
            self._rows.clear()
