"""A vehicle behind a link on a virtual clock: time passes where the link is read, as `run_session` does it."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from flownav.live.link import Link
from flownav.live.simulated import SimulatedVehicle

STEP_S = 0.002
LOOK_S = 20e-6  # that passes with each look at the clock: what comes later is later
UNIX_S = 1.8e9


class Clock:
    """A clock that only tests move. Called, it is what `time.monotonic` is to the loops."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        self.now_s += LOOK_S
        return self.now_s


class VirtualLink(Link):
    """Datagrams between a session and the other end that answers; both live in the clock's time.

    arriving: frames that arrive by an instant. hear: what is answered to a frame at an instant.
    """

    datagrams = True

    def __init__(
        self,
        clock: Clock,
        arriving: Callable[[float], list[bytes]] = lambda now_s: [],
        hear: Callable[[bytes, float], list[bytes]] = lambda frame, now_s: [],
    ) -> None:
        super().__init__()
        self._clock, self._arriving, self._hear = clock, arriving, hear
        self._answers: list[bytes] = []
        self._always_ready = os.open(os.devnull, os.O_RDONLY)  # the loop waits for nothing

    def fileno(self) -> int:
        return self._always_ready

    def read(self) -> list[Any]:
        self._clock.now_s += STEP_S
        frames, self._answers = [*self._answers, *self._arriving(self._clock.now_s)], []
        self.received += sum(map(len, frames))
        return [(frame, None) for frame in frames]

    def write(self, frame: bytes) -> None:
        self.written += len(frame)
        self._answers += self._hear(frame, self._clock.now_s)

    def close(self) -> None:
        os.close(self._always_ready)


def link_to(vehicle: SimulatedVehicle, clock: Clock) -> VirtualLink:
    """A link to a simulated vehicle, run in the clock's time."""
    return VirtualLink(clock, lambda now_s: vehicle.due(now_s, UNIX_S + now_s), vehicle.hear)
