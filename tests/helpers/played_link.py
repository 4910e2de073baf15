"""A recording of a vehicle's link, played over UDP in real time to a session of another process on this machine."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

from flownav.live.byte_links import open_link
from flownav.logs.mavlink.framing import coder
from recorded_link import TIMESYNC, Arrival, arrivals


class PlayedLink:
    """Plays until it is left, or the recording has ended; the vehicle is silent then."""

    def __init__(self, folder: Path, port: int, until_s: float = float("inf")) -> None:
        self._frames = arrivals(folder, until_s)
        self._link = open_link(f"udpout:127.0.0.1:{port}")
        self._left = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> PlayedLink:
        self._thread.start()
        return self

    def __exit__(self, *raised: object) -> None:
        self._left.set()
        self._thread.join()
        self._link.close()

    def _run(self) -> None:
        later_s = time.monotonic() - self._frames[0].now_s
        for arrival in self._frames:
            while (wait_s := arrival.now_s + later_s - time.monotonic()) > 0.0:
                if self._left.wait(min(wait_s, 0.05)):
                    return
            self._link.write(_of_now(arrival, later_s))
            self._link.read()


def _of_now(arrival: Arrival, later_s: float) -> bytes:
    """A frame as it would come now: an answer to a TIMESYNC of the companion names the time of one that is later."""
    if arrival.frame[7:10] != TIMESYNC:
        return arrival.frame
    mav: Any = coder(arrival.frame[5], arrival.frame[6])
    message = mav.decode(bytearray(arrival.frame))
    if not message.tc1:
        return arrival.frame
    mav.seq = arrival.frame[4]
    return bytes(mav.timesync_encode(message.tc1, message.ts1 + round(later_s * 1e9)).pack(mav))
