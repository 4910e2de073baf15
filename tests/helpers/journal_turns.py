"""The writer of a session's journal without its thread: it has its turns by the test's own time."""

from __future__ import annotations

import errno
import os
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from flownav.live import writing
from flownav.live.options import Options
from flownav.live.recorder import Recorder
from live_ends import START_S, Hover, Wire


class NoThread:
    """A thread whose work at the end is done where somebody waits for it."""

    def __init__(self, turns: Turns, target: Any) -> None:
        self._turns, self._target = turns, target

    def start(self) -> None:
        """Nothing."""

    def join(self, timeout: float) -> None:
        if not self._turns.stopped:
            self._target()

    def is_alive(self) -> bool:
        return False


class Turns:
    """A recorder made while it lasts writes each WRITE_S of the flight, and when it ends."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, start_s: float = START_S) -> None:
        self.now_s, self.stopped = start_s, False
        self._writer: Any = None

        def thread(target: Any, **named: object) -> NoThread:
            self._writer, self.stopped = target.__self__, False
            return NoThread(self, target)

        monkeypatch.setattr(writing, "threading", SimpleNamespace(Thread=thread, Event=threading.Event))
        monkeypatch.setattr(writing, "time", SimpleNamespace(monotonic=lambda: self.now_s))

    def fly(self, wire: Wire, seconds: float) -> Wire:
        """The vehicle talks for so long, and the writer has its turns."""

        return wire.fly(seconds, beside=lambda: self.until(wire.now_s))

    def until(self, now_s: float) -> None:
        """The writer has its turn where one is due by an instant."""
        if self._writer is not None and not self.stopped and now_s - self.now_s >= writing.WRITE_S:
            self.now_s = now_s
            self.stopped = self._writer.turn(now_s)

    def killed(self, record: Any, seconds: float) -> Any:
        """The journal of a flight that was killed, as it lies there."""
        recorder = Recorder(record, Options())
        self.fly(Wire(Hover(), Options(), recorder), seconds).close()
        recorder.leave()
        return recorder.journal


def full_disk(monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """Writing fails with ENOSPC once `after` bytes are written, in the middle of a block."""
    real, left = os.write, [after]

    def write(file: int, data: memoryview) -> int:
        if left[0] <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        count = real(file, data[: left[0]])
        left[0] -= count
        return count

    monkeypatch.setattr(writing.os, "write", write)
