"""The two links of a simulated vehicle, on loopback: a ground station's, and a companion's, which is watched.

One loop serves both: the autopilot's messages to its companion go on to flownav and back, frame by frame, with the
line's faults; estimates are noted as they leave, and the ground station's messages go to all that ask for them.
"""

import math
import random
import select
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple

from flownav.logs.mavlink.framing import ARDUPILOT, Message, StreamFrames, coder
from flownav.logs.mavlink.messages import STATES, LocalState, TrueState
from flownav.logs.mavlink.outgoing import ARMED

HOST = "127.0.0.1"
STATION = (255, 190)  # the ground station's system, and MAV_COMP_ID_MISSIONPLANNER
GCS, INVALID = 6, 8  # MAV_TYPE, MAV_AUTOPILOT
BEAT_S, TURN_S = 0.1, 0.02  # of messages that are repeated; chosen
ODOMETRY, SPEED, VISION = 331, 103, 102
LARGEST = 65536
STAMPED = 35  # SO_TIMESTAMPNS of Linux: the kernel's time of a datagram's arrival
NAN = float("nan")


class SentEstimate(NamedTuple):
    """An estimate as it left flownav: our clock, the vehicle's [s], place and velocity (NaN where it is left out)."""

    now_s: float
    boot_s: float
    pos_ned_m: tuple[float, float, float]
    quality: int
    resets: int


class Truth(NamedTuple):
    """A simulator's true state, and when it arrived."""

    now_s: float
    state: TrueState


class History:
    """The events of a flight: truth, flownav's messages, the autopilot's estimates, texts, on our clock [s]."""

    def __init__(self) -> None:
        self.truth: list[Truth] = []
        self.estimates: list[SentEstimate] = []
        self.local: list[tuple[float, LocalState]] = []
        self.words: list[tuple[float, str, str]] = []  # when, who, what
        self.boot_less_now_s = -math.inf  # the vehicle's time since boot less our clock, by the shortest wait

    def say(self, who: str, what: str) -> None:
        """Note a word."""
        self.words.append((time.monotonic(), who, what))


class Line:
    """The faults of the companion's line: it loses a share of frames, or all while it is cut."""

    def __init__(self, seed: int) -> None:
        self.loss, self.cut = 0.0, False
        self._chance = random.Random(seed)

    def passes(self) -> bool:
        """Whether a frame comes through."""
        return not self.cut and (self.loss <= 0.0 or self._chance.random() >= self.loss)


class Wire:
    """The sockets of one flight.

    station_peer: where the autopilot listens for a ground station; None: the first sender. companion_port: where the
    autopilot sends to its companion, 0 for any; live_port: where flownav listens.
    """

    def __init__(self, live_port: int, companion_port: int = 0, station_peer: int | None = None, seed: int = 1) -> None:
        self.history, self.line = History(), Line(seed)
        self.live_port = live_port
        self._station, self._vehicle, self._live = bound(), bound(companion_port), bound()
        self._station_peer = (HOST, station_peer) if station_peer is not None else None
        self._vehicle_peer: Any = None
        self._frames, self._coder, self._mav = StreamFrames(), coder(), coder(*STATION)
        self.latest: dict[str, Message] = {}
        self.received: list[Callable[[Message], None]] = []  # called with each message of the autopilot
        self.beats: list[Callable[[Any], list[Message]]] = []  # messages that are sent ten times a second
        self.turns: list[Callable[[float], None]] = []  # what is done each turn of the loop
        self.kept: Callable[[bytes, bool], None] | None = (
            None  # who keeps the frames that pass, and whether to the vehicle
        )
        self._beat_s = self._heartbeat_s = float("-inf")

    @property
    def mav(self) -> Any:
        """The ground station's packer."""
        return self._mav

    @property
    def station_port(self) -> int:
        """Where the ground station listens."""
        return int(self._station.getsockname()[1])

    @property
    def companion_port(self) -> int:
        """Where the autopilot is to send what is for its companion."""
        return int(self._vehicle.getsockname()[1])

    def close(self) -> None:
        """Close the sockets."""
        for each in (self._station, self._vehicle, self._live):
            each.close()

    def say(self, message: Message, mav: Any = None) -> None:
        """Send to the autopilot, as the ground station or as another component."""
        if self._station_peer is not None:
            with suppress(OSError):
                self._station.sendto(bytes(message.pack(mav or self._mav)), self._station_peer)

    def pump(self, seconds: float) -> None:
        """Let time pass."""
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0.0:
            self.turn(min(left_s, TURN_S))

    def until(self, so: Callable[[], Any], limit_s: float) -> bool:
        """Let time pass until `so()` is true; whether it came true."""
        end_s = time.monotonic() + limit_s
        while not so():
            if time.monotonic() >= end_s:
                return False
            self.turn(TURN_S)
        return True

    def turn(self, wait_s: float) -> None:
        """One turn of the loop: what has arrived, and what is due."""
        ready, _, _ = select.select([self._station, self._vehicle, self._live], [], [], wait_s)
        now_s = time.monotonic()
        for each in ready:
            for piece, sender, arrived_s in _read(each, now_s):
                if each is self._station:
                    self._station_peer = self._station_peer or sender
                    self._receive(piece, arrived_s)
                elif each is self._vehicle:
                    self._vehicle_peer = sender
                    self._pass(piece, self._live, (HOST, self.live_port))
                else:
                    self._pass(piece, self._vehicle, self._vehicle_peer, now_s)
        if now_s - self._beat_s >= BEAT_S:
            self._beat_s = now_s
            self._beat(now_s)
        for what in self.turns:
            what(now_s)

    def _beat(self, now_s: float) -> None:
        if now_s - self._heartbeat_s >= 1.0:
            self._heartbeat_s = now_s
            self.say(self._mav.heartbeat_encode(GCS, INVALID, 0, 0, 4, 3))
        for what in self.beats:
            for message in what(self._mav):
                self.say(message)

    # -- reception -----------------------------------------------------------------------------------------------
    def _receive(self, piece: bytes, now_s: float) -> None:
        for frame, content in self._frames.feed(piece, whole=True):
            if frame.component != 1:
                continue
            with suppress(Exception):  # a frame of another dialect's length
                self._take(self._coder.decode(bytearray(content)), now_s)

    def _take(self, message: Message, now_s: float) -> None:
        name = message.msgname
        self.latest[name] = message
        if (boot_ms := getattr(message, "time_boot_ms", 0)) and name != "SYSTEM_TIME":
            self.history.boot_less_now_s = max(self.history.boot_less_now_s, boot_ms * 1e-3 - now_s)
        state = STATES[name](message) if name in STATES else None
        if isinstance(state, TrueState):
            self.history.truth.append(Truth(now_s, state))
        elif isinstance(state, LocalState):
            self.history.local.append((now_s, state))
        elif name == "STATUSTEXT":
            self.history.words.append((now_s, "autopilot", message.text.rstrip("\0")))
        for who in self.received:
            who(message)

    def _pass(self, piece: bytes, out: socket.socket, to: Any, now_s: float = NAN) -> None:
        """Frames from one end of the companion's line to the other; a datagram may hold several."""
        to_vehicle, frames = now_s == now_s, list(_whole(piece))
        passed = [frame for frame in frames if self.line.passes()]
        if to_vehicle:
            for frame in frames:
                self._note(frame, now_s)
        if self.kept is not None:
            for frame in frames if to_vehicle else passed:
                self.kept(frame, to_vehicle)
        if passed and to is not None:
            with suppress(OSError):  # flownav does not listen yet
                out.sendto(b"".join(passed), to)

    def _note(self, frame: bytes, now_s: float) -> None:
        """An estimate that leaves."""
        number = frame[7] | frame[8] << 8 | frame[9] << 16 if frame[0] == 0xFD else -1
        if number not in (ODOMETRY, SPEED, VISION):
            return
        message = self._coder.decode(bytearray(frame))
        boot_s = getattr(message, "time_usec", getattr(message, "usec", 0)) * 1e-6
        place = (NAN,) * 3 if number == SPEED else (message.x, message.y, message.z)
        self.history.estimates.append(
            SentEstimate(now_s, boot_s, place, getattr(message, "quality", 0), message.reset_counter)
        )

    # -- what is known ------------------------------------------------------------------------------------------
    @property
    def armed(self) -> bool:
        """By the last HEARTBEAT."""
        beat = self.latest.get("HEARTBEAT")
        return beat is not None and bool(beat.base_mode & ARMED)

    @property
    def by_ardupilot(self) -> bool:
        """The make, by its HEARTBEAT."""
        beat = self.latest.get("HEARTBEAT")
        return beat is not None and beat.autopilot == ARDUPILOT

    @property
    def sends(self) -> bool:
        """Whether flownav has sent a place in the last second."""
        estimates = self.history.estimates
        return (
            bool(estimates)
            and time.monotonic() - estimates[-1].now_s < 1.0
            and math.isfinite(estimates[-1].pos_ned_m[0])
        )


def bound(port: int = 0) -> socket.socket:
    """A UDP socket on loopback."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    if sys.platform == "linux":
        made.setsockopt(socket.SOL_SOCKET, STAMPED, 1)
    made.setblocking(False)
    try:
        made.bind((HOST, port))
    except OSError:
        made.close()
        raise
    return made


def free_port() -> int:
    """A UDP port that nobody has at this moment."""
    with bound() as found:
        return int(found.getsockname()[1])


def _read(from_where: socket.socket, now_s: float) -> Iterator[tuple[bytes, Any, float]]:
    """Datagrams, their senders, and when each arrived, which on a busy machine is long before it is read."""
    unix_less_now_s = time.time() - time.monotonic()
    while True:
        try:
            piece, beside, _, sender = from_where.recvmsg(LARGEST, socket.CMSG_SPACE(16))
        except BlockingIOError:
            return
        except OSError:  # the other end is gone
            return
        stamps = [content for level, kind, content in beside if level == socket.SOL_SOCKET and kind == STAMPED]
        arrived_s = now_s
        if stamps and len(stamps[0]) == 16:
            seconds, nanoseconds = struct.unpack("@qq", stamps[0])
            arrived_s = min(now_s, seconds + 1e-9 * nanoseconds - unix_less_now_s)
        yield piece, sender, arrived_s


def _whole(piece: bytes) -> Iterator[bytes]:
    """The frames of a datagram, by their lengths."""
    place = 0
    while place + 8 <= len(piece):
        if piece[place] == 0xFD:
            size = piece[place + 1] + 12 + (13 if piece[place + 2] & 1 else 0)
        elif piece[place] == 0xFE:
            size = piece[place + 1] + 8
        else:
            place += 1
            continue
        yield piece[place : place + size]
        place += size
