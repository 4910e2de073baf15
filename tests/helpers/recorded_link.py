"""Recordings of a link, played into a session on a virtual clock: what arrived, when it arrived."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from flownav.live.filtering import Keeper
from flownav.live.options import Options
from flownav.live.session import Session
from flownav.logs.mavlink.framing import coder

TIMESYNC = bytes([111, 0, 0])
TICK_S = 0.005  # as the loop wakes up


class Arrival(NamedTuple):
    """A frame and when it came, on the clock of the companion that recorded it [s]."""

    now_s: float
    frame: bytes

    @property
    def message_id(self) -> int:
        return self.frame[7] | self.frame[8] << 8 | self.frame[9] << 16


class Sent(NamedTuple):
    """A message that the session sent and when, decoded."""

    now_s: float
    message: Any


def frames_of(path: Path) -> Iterator[tuple[float, bytes]]:
    """UNIX time of arrival [s] and frame of a .tlog of MAVLink 2, those that nobody knows among them."""
    data, place = path.read_bytes(), 0
    while place + 20 <= len(data):
        (stamp_us,) = struct.unpack_from(">Q", data, place)
        size = data[place + 9] + 12 + (13 if data[place + 10] & 1 else 0)
        yield stamp_us * 1e-6, data[place + 8 : place + 8 + size]
        place += 8 + size


def arrivals(folder: Path, until_s: float = float("inf")) -> list[Arrival]:
    """The vehicle's frames on the monotonic clock of the companion, in which its TIMESYNC answers are."""
    decoder: Any = coder()
    said = (
        stamp_s - message.ts1 * 1e-9
        for stamp_s, frame in frames_of(folder / "from_flownav.tlog")
        if frame[7:10] == TIMESYNC and not (message := decoder.decode(bytearray(frame))).tc1
    )
    ahead_s = next(said)
    found: list[Arrival] = []
    for stamp_s, frame in frames_of(folder / "from_vehicle.tlog"):
        if found and stamp_s - ahead_s - found[0].now_s > until_s:
            break
        found.append(Arrival(stamp_s - ahead_s, frame))
    return found


def play(
    frames: Iterable[Arrival],
    options: Options | None = None,
    keeper: Any = None,
    look: Callable[[Session, float], None] = lambda session, now_s: None,
) -> tuple[Session, list[Sent]]:
    """A session that lives through the arrivals, and all that it sent; `look` is called at each tick."""
    frames = list(frames)
    now_s = frames[0].now_s
    session = Session(options or Options(), keeper or Keeper(), now_s, 1.8e9)
    sent: list[Sent] = []
    decoder: Any = coder()

    def tick(at_s: float) -> None:
        session.tick(at_s)
        while session.outbox:
            sent.append(Sent(at_s, decoder.decode(bytearray(session.outbox.popleft()))))
        look(session, at_s)

    for arrival in frames:
        while arrival.now_s - now_s > TICK_S:
            now_s += TICK_S
            tick(now_s)
        now_s = max(now_s, arrival.now_s)
        session.take(arrival.frame, now_s, whole=True)
        if session.due:
            tick(now_s)
    return session, sent
