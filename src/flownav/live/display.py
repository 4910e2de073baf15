"""The screen in a process of its own, so that neither drawing nor a terminal that takes nothing holds the session up.

A terminal takes nothing after Ctrl-S, or where nobody reads what it shows. Views go to the process through a pipe, one
at a time; it answers when one is drawn.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rich.console import RenderableType

LAST_WAIT_S = 1.0  # for the terminal, at the end: chosen
DRAWN = b"."


class View(NamedTuple):
    """The screen's content at an instant, as text: taken between two readings, drawn whenever the terminal takes it.

    alarms: what somebody must know now, above all else. sensors: rows of the table of sensors. estimate: rows of the
    estimate. strips: name, bars and newest value. lines: below them.
    """

    title: str
    alarms: list[str]
    sensors: list[tuple[str, ...]]
    estimate: list[tuple[str, ...]]
    strips: list[tuple[str, str, str]]
    lines: list[str]


def draw(view: View) -> RenderableType:
    """A view laid out for a terminal. Takes milliseconds: not for the thread that flies."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    sensors = Table("sensor", "Hz", "age [s]", "lag [s]", "innovation", "ratio", "")
    for row in view.sensors:
        sensors.add_row(*row)
    estimate = Table("", "north", "east", "down")
    for row in view.estimate:
        estimate.add_row(*row)
    strips = Table.grid(padding=(0, 1))
    for strip_row in view.strips:
        strips.add_row(*strip_row)
    alarms = (Text(alarm, style="bold red") for alarm in view.alarms)
    return Group(*alarms, view.title, sensors, estimate, strips, *view.lines)


class Display:
    """The process, fed with views; those that come before the last one is drawn are not even taken.

    stuck: the terminal took nothing in the end, so that nothing more should be written there.
    """

    def __init__(self, look: Callable[[float], View]) -> None:
        self.stuck = False
        self._look = look
        self._drawn, drawn = os.pipe()
        os.set_blocking(self._drawn, False)
        command = [sys.executable, "-m", "flownav.live.display", str(drawn)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=[drawn])
        os.close(drawn)
        assert self._process.stdin is not None
        self._views = self._process.stdin.fileno()
        os.set_blocking(self._views, False)

    def show(self, now_s: float) -> None:
        """A new view, if the last one is drawn. Never waits."""
        with suppress(OSError):  # not drawn yet, or the terminal is gone
            if os.read(self._drawn, 1):
                os.write(self._views, json.dumps(self._look(now_s)).encode() + b"\n")

    def close(self) -> None:
        """Leave the screen."""
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(LAST_WAIT_S)
        except subprocess.TimeoutExpired:
            self.stuck = True
            self._process.kill()
            self._process.wait()
        os.close(self._drawn)


class NoDisplay:
    """Shows nothing, where nobody looks."""

    stuck = False

    def show(self, now_s: float) -> None:
        """Show nothing."""


@contextmanager
def on_terminal(look: Callable[[float], View], *, shown: bool) -> Iterator[Display | NoDisplay]:
    """A display on standard output, where it is to be shown. look: what is to be seen at an instant of our clock."""
    if not shown:
        yield NoDisplay()
        return
    display = Display(look)
    try:
        yield display
    finally:
        display.close()


def main() -> None:
    """The process: draws the views that come, until no more can come."""
    from rich.console import Console
    from rich.live import Live

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the session's, which then ends us
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    drawn = int(sys.argv[1])
    console = Console(markup=False, highlight=False)
    with suppress(OSError), Live(console=console, auto_refresh=False, screen=True) as shown:
        os.write(drawn, DRAWN)
        for line in sys.stdin:
            shown.update(draw(View(*json.loads(line))), refresh=True)
            os.write(drawn, DRAWN)


if __name__ == "__main__":
    main()
