"""`flownav live` in this process on a virtual clock, a hovering vehicle at the other end of its link."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from flownav.cli import app
from flownav.cli import live as command
from flownav.live import byte_links, loop
from journal_turns import Turns
from live_ends import STEP_S, Hover
from virtual_link import UNIX_S, Clock, VirtualLink


class Told:
    """The frames of a hovering vehicle by an instant; what is planned happens once its time has come."""

    def __init__(self, vehicle: Hover, planned: dict[float, Callable[[], Any]]) -> None:
        self._vehicle, self._steps = vehicle, 0
        self._planned = sorted(planned.items())

    def __call__(self, now_s: float) -> list[bytes]:
        while self._planned and self._planned[0][0] <= now_s:
            self._planned.pop(0)[1]()
        frames: list[bytes] = []
        while self._steps * STEP_S < now_s:
            self._steps += 1
            frames += self._vehicle.frames(self._steps * STEP_S)
        return frames


def run_live(
    patched: pytest.MonkeyPatch, *arguments: object, vehicle: Hover | None = None, **planned: Callable[[], Any]
) -> Result:
    """The command's result. vehicle: None where nobody speaks; planned: what happens at `at_5` s."""
    clock = Clock()
    happens = {float(name.removeprefix("at_")): what for name, what in planned.items()}
    frames = Told(vehicle, happens) if vehicle is not None else (lambda now_s: [])
    turns = Turns(patched, clock.now_s)

    def told(now_s: float) -> list[bytes]:
        turns.until(now_s)
        return frames(now_s)

    patched.setattr(command, "time", SimpleNamespace(monotonic=clock, time=lambda: UNIX_S))
    patched.setattr(byte_links, "open_link", lambda url: VirtualLink(clock, told))
    patched.setattr(loop, "run_session", partial(loop.run_session, clock=clock))
    patched.setattr(loop, "run_before_others", lambda: "ordinary")
    return CliRunner().invoke(app, ["live", "udp:0", *map(str, arguments)])
