"""Frames on their way into a stream of bytes: whole ones only, at the line's pace, and no estimate that is old.

A line that is full is no reason to wait, and none to send what was true a second ago: of estimates the newest unsent
one stands for all before it, and what does not go out is counted.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable

from flownav.mavlink.framing import MAVLINK_2

LATEST_ONLY = (331, 102, 103, 149)  # ODOMETRY, VISION_POSITION_ESTIMATE, VISION_SPEED_ESTIMATE, LANDING_TARGET
MOST_WAITING = 4096  # bytes of other frames
BURST_S = 0.02  # of the line's pace that may go out at once


def message_id_of(frame: bytes) -> int:
    """The number of a frame's message; -1 of what is no MAVLink 2 frame."""
    return int.from_bytes(frame[7:10], "little") if len(frame) >= 10 and frame[0] == MAVLINK_2 else -1


class Outgoing:
    """What waits to be written. counts: `replaced`, estimates that a newer one stood for; `not_sent`, other frames.

    pace_bytes_s: what the line carries; None where it takes what it is given.
    """

    def __init__(self, counts: Counter[str], pace_bytes_s: float | None = None) -> None:
        self._counts, self._pace_bytes_s = counts, pace_bytes_s
        self._others: deque[bytes] = deque()
        self._estimates: dict[int, bytes] = {}
        self._rest = b""  # of the frame that is being written
        self._credit = 0.0  # bytes that may be written now
        self._earned_s = float("-inf")

    def __len__(self) -> int:
        """Bytes that wait."""
        waiting = (*self._others, *self._estimates.values())
        return len(self._rest) + sum(map(len, waiting))

    def put(self, frame: bytes) -> None:
        """Queue a frame, or count it as not sent."""
        number = message_id_of(frame)
        if number in LATEST_ONLY:
            if self._estimates.pop(number, None) is not None:
                self._counts["replaced"] += 1
            self._estimates[number] = frame
        elif sum(map(len, self._others)) + len(frame) > MOST_WAITING:
            self._counts["not_sent"] += 1
        else:
            self._others.append(frame)

    def flush(self, write: Callable[[bytes], int], now_s: float) -> int:
        """Write what the pace and the port allow; write says how many bytes it took. How many went out."""
        self._earn(now_s)
        written = 0
        while self._rest or (self._credit > 0.0 and self._next()):
            taken = write(self._rest)
            self._rest = self._rest[taken:]
            self._credit -= taken
            written += taken
            if self._rest:
                break
        return written

    def clear(self) -> None:
        """The connection is gone, and what waited for it."""
        self._counts["not_sent"] += bool(self._rest) + len(self._others) + len(self._estimates)
        self._others.clear()
        self._estimates.clear()
        self._rest = b""

    def _earn(self, now_s: float) -> None:
        if self._pace_bytes_s is None:
            self._credit = float("inf")
            return
        most = BURST_S * self._pace_bytes_s
        self._credit = min(most, self._credit + self._pace_bytes_s * (now_s - self._earned_s))
        self._earned_s = now_s

    def _next(self) -> bool:
        """Take up the next frame: what is not an estimate first, since TIMESYNC measures the way."""
        if self._others:
            self._rest = self._others.popleft()
        elif self._estimates:
            self._rest = self._estimates.pop(next(iter(self._estimates)))
        return bool(self._rest)
