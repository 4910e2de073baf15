"""The screen in a thread of its own: a terminal that takes nothing (Ctrl-S, a pipe nobody reads) holds nobody up."""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import IO

from flownav.live.screen import Screen, View, draw

LAST_WAIT_S = 1.0  # for the terminal, at the end


class Display:
    """Draws the newest view that the terminal has time for; views that come meanwhile are not even taken."""

    def __init__(self, screen: Screen, file: IO[str]) -> None:
        self._screen, self._file = screen, file
        self._views: queue.SimpleQueue[View | None] = queue.SimpleQueue()
        self._idle = True
        self.stuck = False
        self._thread = threading.Thread(target=self._run, name="screen", daemon=True)
        self._thread.start()

    def show(self, now_s: float) -> None:
        """A new view, if the last one is drawn. Never waits."""
        if self._idle:
            self._idle = False
            self._views.put(self._screen.view(now_s))

    def close(self) -> None:
        """Leave the screen; `stuck` where the terminal still takes nothing after LAST_WAIT_S."""
        self._views.put(None)
        self._thread.join(LAST_WAIT_S)
        self.stuck = self._thread.is_alive()
        if not self.stuck:
            with suppress(OSError):
                self._file.close()

    def _run(self) -> None:
        from rich.console import Console
        from rich.live import Live

        console = Console(file=self._file, markup=False, highlight=False)
        shown = Live(console=console, auto_refresh=False, screen=True, redirect_stdout=False, redirect_stderr=False)
        try:
            with shown:
                while (view := self._views.get()) is not None:
                    shown.update(draw(view), refresh=True)
                    self._idle = True
        except (OSError, ValueError):
            return  # the terminal is gone; `_idle` stays False and no more views are taken


class NoDisplay:
    """Shows nothing, where nobody looks."""

    stuck = False

    def show(self, now_s: float) -> None:
        """Nothing."""


@contextmanager
def on_terminal(screen: Screen, *, shown: bool) -> Iterator[Display | NoDisplay]:
    """A display on standard output, where it is to be shown.

    It has a file of its own: one that is stuck must not hold up what Python does with its own at the end.
    """
    if not shown:
        yield NoDisplay()
        return
    display = Display(screen, os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding=sys.stdout.encoding))
    try:
        yield display
    finally:
        display.close()
