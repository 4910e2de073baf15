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
    """What the writer's thread does at the end is done where somebody waits for it."""

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

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s, self.stopped = START_S, False

        def thread(target: Any, **named: object) -> NoThread:
            return NoThread(self, target)

        monkeypatch.setattr(writing, "threading", SimpleNamespace(Thread=thread, Event=threading.Event))
        monkeypatch.setattr(writing, "time", SimpleNamespace(monotonic=lambda: self.now_s))

    def fly(self, wire: Wire, recorder: Recorder, seconds: float) -> Wire:
        """The vehicle talks for so long, and the writer has its turns."""

        def turn() -> None:
            if not self.stopped and wire.now_s - self.now_s >= writing.WRITE_S:
                self.now_s = wire.now_s
                self.stopped = recorder._writer.turn(self.now_s)

        return wire.fly(seconds, beside=turn)

    def killed(self, record: Any, seconds: float) -> Any:
        """The journal of a flight that was killed, as it lies there."""
        recorder = Recorder(record, Options())
        self.fly(Wire(Hover(), Options(), recorder), recorder, seconds).close()
        recorder.leave()
        return recorder.journal


def full_disk(monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """Writing fails with ENOSPC once so many bytes are written, in the middle of a block."""
    real, left = os.write, [after]

    def write(file: int, data: memoryview) -> int:
        if left[0] <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        count = real(file, data[: left[0]])
        left[0] -= count
        return count

    monkeypatch.setattr(writing.os, "write", write)
