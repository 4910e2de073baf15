"""The bytes that were sent and may not have been read: an estimate that waits in a buffer is old when it is read.

A stream's own buffers hold a second's estimates, and the far side's hold ten; a bridge to a slow line reads from them
no faster than that line carries. Its kernel acknowledges what nobody has read. An answer to TIMESYNC does show it: all
that was sent before the question has been read. Where answers take longer than the shortest way there and back, as much
is let on its way as is read within QUEUE_S.
"""

import math
from collections import deque
from typing import NamedTuple

ASK_S = 0.2  # between questions: chosen, 140 bytes/s each way
QUEUE_S = 0.2  # that a message may wait to be read: chosen, 4 m at 20 m/s would arrive 0.2 s late
LEAST_BYTES = 500  # on their way at least: two estimates of 244 bytes
FIRST_BYTES = 3000  # at first: 50 estimates/s of ASK_S; more where this number of bytes is read in time
MOST_BYTES = 65536
MOST_ASKED = 8  # questions that wait; who answers none is not asked for ever
GROWTH = 1.5  # of what may be on its way with each answer in time: chosen
WINDOW_S = 20.0  # of the shortest round trip


class Asked(NamedTuple):
    """A question: our time, which names it [ns], and the bytes that were sent before it."""

    ts1_ns: int
    sent: int


class Backlog:
    """Bytes on their way to a reader, and whether an estimate may follow them.

    A reader that has not answered yet is not judged. spells: how often a reader was found slow.
    """

    def __init__(self) -> None:
        self.spells = 0
        self.slow = False
        self._asked: deque[Asked] = deque(maxlen=MOST_ASKED)
        self._sent, self._read, self._read_s = 0, 0, math.nan
        self._most = float(FIRST_BYTES)
        self._shortest: deque[tuple[float, float]] = deque(maxlen=2)  # since when, and the least round trip [s]
        self._asked_s = -math.inf

    def put(self, size: int) -> None:
        """Count `size` bytes as sent."""
        self._sent += size

    def due(self, now_s: float) -> bool:
        """Whether to ask; `asked` follows."""
        patience_s = ASK_S if len(self._asked) < MOST_ASKED else 1.0
        return now_s - self._asked_s >= patience_s

    def asked(self, ts1_ns: int, now_s: float) -> None:
        """A question was sent."""
        self._asked_s = now_s
        self._asked.append(Asked(ts1_ns, self._sent))

    def answered(self, ts1_ns: int, now_s: float) -> bool:
        """An answer; False where it is to no question of ours."""
        found = next((one for one in self._asked if one.ts1_ns == ts1_ns), None)
        if found is None:
            return False
        while self._asked and self._asked[0].sent <= found.sent and self._asked[0].ts1_ns <= ts1_ns:
            self._asked.popleft()
        trip_s = now_s - ts1_ns * 1e-9
        self._note_shortest(trip_s, now_s)
        if trip_s - self._shortest_s > QUEUE_S:
            elapsed_s = now_s - self._read_s
            rate = (found.sent - self._read) / elapsed_s if elapsed_s > 0.0 else 0.0
            self._limit(rate * QUEUE_S)
        elif trip_s - self._shortest_s < 0.5 * QUEUE_S and self._sent - self._read > 0.5 * self._most:
            self._most = min(GROWTH * self._most, MOST_BYTES)
            self.slow = self.slow and self._most < FIRST_BYTES
        self._read, self._read_s = max(self._read, found.sent), now_s
        return True

    def is_open(self, now_s: float) -> bool:
        """Whether an estimate may be sent."""
        if self._read_s != self._read_s:
            return True
        if self._asked and now_s - self._asked[0].ts1_ns * 1e-9 - self._shortest_s > QUEUE_S:
            self._limit(0.0)
        return self._sent - self._read < self._most

    def _limit(self, most: float) -> None:
        self.spells += not self.slow
        self.slow = True
        self._most = min(self._most, max(most, float(LEAST_BYTES)))

    def _note_shortest(self, trip_s: float, now_s: float) -> None:
        if not self._shortest or now_s - self._shortest[-1][0] >= WINDOW_S:
            self._shortest.append((now_s, trip_s))
        elif trip_s < self._shortest[-1][1]:
            self._shortest[-1] = self._shortest[-1][0], trip_s

    @property
    def _shortest_s(self) -> float:
        return min((trip_s for _, trip_s in self._shortest), default=0.0)
