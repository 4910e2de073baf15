"""`flownav live` as a process of its own, and a hovering vehicle that talks to it in real time."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flownav.live.byte_links import open_link
from flownav.logs.mavlink.framing import coder
from live_ends import Hover

ODOMETRY = 331
HUNG_S = 120.0  # whatever takes so long hangs


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class LiveProcess:
    """The process; `told` counts the estimates that came back."""

    def __init__(self, record: Path | None, *more: str, **popen: Any) -> None:
        port = free_port()
        command = [sys.executable, "-m", "flownav", "live", f"udp:{port}", *more]
        command += ["--record", str(record)] if record else []
        usual: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        self.process = subprocess.Popen(command, **(usual | popen))
        self.vehicle, self.link = Hover(), open_link(f"udpout:127.0.0.1:{port}")
        self.told = 0
        self.heard: list[tuple[float, Any]] = []  # how old each estimate was when it came [s], and what it says
        self._hears = coder()
        self._start_s = time.monotonic()

    def __enter__(self) -> LiveProcess:
        return self

    def __exit__(self, *raised: object) -> None:
        with self.process:  # waits, and closes its pipes: left open by a test that failed, they fail the next
            self.process.kill()
        self.link.close()

    def fly(self, more: int, within_s: float = HUNG_S, beside: Callable[[], object] = lambda: None) -> LiveProcess:
        """Talk until `more` further estimates have come back; beside: called every 10 ms."""
        until_s, wanted = time.monotonic() + within_s, self.told + more
        while self.told < wanted:
            assert time.monotonic() < until_s, f"{self.told} of {wanted} estimates after {within_s} s"
            assert self.process.poll() is None, "it ended"
            time.sleep(0.01)
            for frame in self.vehicle.frames(time.monotonic() - self._start_s):
                self.link.write(frame)
            beside()
            for piece, _ in self.link.read():
                if piece[0] == 0xFD and int.from_bytes(piece[7:10], "little") == ODOMETRY:
                    self.told += 1
                    said: Any = self._hears.decode(bytearray(piece))
                    now_s = self.vehicle.boot_s + time.monotonic() - self._start_s
                    self.heard.append((now_s - 1e-6 * said.time_usec, said))
        return self

    def end(self, number: int) -> tuple[str, str]:
        """Send a signal and wait; what it printed."""
        self.process.send_signal(number)
        return self.process.communicate(timeout=HUNG_S)
