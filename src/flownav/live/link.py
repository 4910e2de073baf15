"""Links to a vehicle, none of which ever blocks: addresses, UDP, and frames on their way into a stream of bytes.

Loopback unless an address is given; `byte_links` has TCP and serial ports. Into a stream of bytes go whole frames only,
at the line's pace, and no estimate that is old: a line that is full is no reason to wait, and none to send an estimate
that is a second old. Of estimates the newest unsent one replaces all before it, and every frame that is not sent is
counted.
"""

import os
import re
import select
import socket
import struct
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

from flownav.core.errors import InputError
from flownav.logs.mavlink.framing import MAVLINK_2

FORMS = (
    "udp:[HOST:]PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:[HOST:]PORT or serial:DEVICE[:BAUD]; "
    "an IPv6 address in brackets, udp:[::1]:14550"
)
LOOPBACK, LOOPBACK_6, EVERYWHERE_6 = "127.0.0.1", "::1", "::"
DEFAULT_BAUD = 115200  # a bare PX4FLOW's
MOST_BYTES = 65536  # the largest datagram
SO_MEMINFO = 55  # Linux, asm-generic/socket.h: nine uint32, the last of them the datagrams dropped (sock_diag.h)
MOST_READS = 64  # in a row, before the session has its turn: chosen
USB = re.compile(r"ttyACM|tty\.usbmodem|cu\.usbmodem|COM\d+$")  # ports whose baud rate is a formality
BITS_A_BYTE = 10  # with start and stop bit
LATEST_ONLY = (331, 102, 103, 149)  # ODOMETRY, VISION_POSITION_ESTIMATE, VISION_SPEED_ESTIMATE, LANDING_TARGET
MOST_WAITING = 4096  # bytes of other frames: chosen, a third of a second at 115200 baud
BURST_S = 0.02  # of the line's pace that may go out at once: chosen; 18 estimates a second at 57600 (live.md)


class Address(NamedTuple):
    """Where a link leads. kind: udp (listens), udpout, tcp, tcpin (listens), serial; number: port or baud."""

    kind: str
    host: str
    number: int

    @property
    def over_uart(self) -> bool:
        """Whether it is a serial line whose baud rate matters."""
        port = os.path.basename(os.path.realpath(self.host))
        return self.kind == "serial" and USB.match(port) is None

    @property
    def capacity_bytes_s(self) -> float | None:
        """The line's capacity each way [bytes/s]; None where its address does not give it."""
        return self.number / BITS_A_BYTE if self.over_uart else None


def parse_url(url: str) -> Address:
    """udp:14550 listens on loopback only; udp:0.0.0.0:14550 on every interface. InputError where it is no link."""
    kind, _, rest = url.partition(":")
    rest = rest.removeprefix("//")
    if kind == "serial":
        found = re.fullmatch(r"(?P<device>.+?)(?::(?P<baud>\d+))?", rest)
        if found and found["device"]:
            return Address("serial", found["device"], int(found["baud"] or DEFAULT_BAUD))
    elif kind in ("udp", "udpin", "udpout", "tcp", "tcpin"):
        host, _, port = rest.rpartition(":")
        listens = kind in ("udp", "udpin", "tcpin")
        bracketed = re.fullmatch(r"\[(?P<address>[0-9a-fA-F:.]+(?:%[\w.-]+)?)\]", host)
        host = bracketed["address"] if bracketed and ":" in bracketed["address"] else host
        whole = bool(bracketed) or not set(host) & set(":[]")
        if port.isdecimal() and int(port) < 65536 and whole and (host or listens):
            return Address("udp" if kind == "udpin" else kind, host or LOOPBACK, int(port))
    raise InputError(f"{url}: no link; give {FORMS}")


Sender = tuple[Any, ...] | None  # as the socket has it: two parts, or four of IPv6
Piece = tuple[bytes, Sender]  # what arrived, and from whom


def same_sender(one: Sender, other: Sender) -> bool:
    """Whether two are the same address, port and, of IPv6, scope; an address may carry its zone's name or not."""
    if one is None or other is None:
        return one is other
    return (one[0].partition("%")[0], one[1], one[3:]) == (other[0].partition("%")[0], other[1], other[3:])


def resolved(host: str, port: int) -> tuple[socket.AddressFamily, tuple[Any, ...]]:
    """The address of a host for datagrams, IPv4 where it has both. OSError where it has none."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    family, _, _, _, address = min(found, key=lambda entry: entry[0] != socket.AF_INET)
    return family, address


class Link:
    """The link of a session to its vehicle.

    counts: `not_sent`, `replaced`, `unreachable`, `other_sender`, `reconnected`, `overflowed` (datagrams too many).
    received, written: bytes so far. capacity_bytes_s: its capacity each way; None where that is not known.
    """

    datagrams = False

    def __init__(self, address: Address | None = None) -> None:
        self.counts: Counter[str] = Counter()
        self.received = self.written = 0
        self.capacity_bytes_s = address.capacity_bytes_s if address is not None else None

    def fileno(self) -> int:
        """For select; -1 while there is no connection."""
        raise NotImplementedError

    def read(self) -> list[Piece]:
        """Pieces that have arrived, without waiting."""
        raise NotImplementedError

    def overheard(self) -> list[bytes]:
        """Datagrams of the last `read` that came from elsewhere than the vehicle that is believed."""
        return []

    def write(self, frame: bytes) -> None:
        """Send a frame, or drop and count it."""
        raise NotImplementedError

    def close(self) -> None:
        """Let go."""

    def believe(self, sender: Sender) -> None:
        """Accept `sender` as the vehicle: answers go there, and no other sender is accepted."""

    def forget(self) -> None:
        """Accept any sender again: the vehicle is silent."""


def waited(link: Link, seconds: float) -> None:
    """Until something arrives, or so long."""
    if link.fileno() < 0:
        time.sleep(seconds)
    else:
        select.select([link.fileno()], [], [], seconds)


class UdpLink(Link):
    """Datagrams. udp listens to anyone until the vehicle has spoken; udpout talks to the address that is named."""

    datagrams = True

    def __init__(self, address: Address) -> None:
        super().__init__(address)
        family, found = resolved(address.host, address.number)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._named: Sender = None
        with suppress(OSError):
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        try:
            if address.kind == "udp":
                if found[0] == EVERYWHERE_6:  # and IPv4 with it
                    self._socket.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
                self._socket.bind(found)
            else:
                self._named = found
                self._socket.bind((_own_end(found[0]), 0))
        except OSError:
            self._socket.close()
            raise
        self._peer = self._named
        self._overheard: list[bytes] = []
        self.port = int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        """The socket's file number."""
        return self._socket.fileno()

    def believe(self, sender: Sender) -> None:
        """Answer there, and listen to nobody else."""
        self._peer = sender

    def forget(self) -> None:
        """Listen to anyone again, where no address was named."""
        self._peer = self._named

    def read(self) -> list[Piece]:
        """Whole datagrams."""
        pieces: list[Piece] = []
        self._overheard = []
        for turn in range(MOST_READS):
            if turn == MOST_READS - 1:  # more comes than is read at once
                self._count_overflow()
            try:
                piece, sender = self._socket.recvfrom(MOST_BYTES)
            except BlockingIOError:
                break
            except OSError:  # an earlier datagram of ours found nobody
                self.counts["unreachable"] += 1
                continue
            if self._peer is not None and not same_sender(sender, self._peer):
                self.counts["other_sender"] += 1
                self._overheard.append(piece)
            else:
                self.received += len(piece)
                pieces.append((piece, sender))
        return pieces

    def _count_overflow(self) -> None:
        """Datagrams for which the socket's buffer had no room, as the system counts them."""
        with suppress(OSError, struct.error):
            lost = struct.unpack_from("I", self._socket.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, 36), 32)[0]
            if lost:
                self.counts["overflowed"] = lost

    def overheard(self) -> list[bytes]:
        """Of other senders, at most MOST_READS."""
        return self._overheard

    def write(self, frame: bytes) -> None:
        """A datagram; nothing where nobody has spoken yet."""
        if self._peer is None:
            return
        try:
            self.written += self._socket.sendto(frame, self._peer)
        except OSError:
            self.counts["not_sent"] += 1

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def _own_end(host: str) -> str:
    """Where our end of a datagram link to a host is bound: on loopback where the host is."""
    if ":" in host:
        return LOOPBACK_6 if host == LOOPBACK_6 else EVERYWHERE_6
    return LOOPBACK if host.startswith("127.") else ""


# -- frames into a stream of bytes --------------------------------------------------------------------------
def message_id_of(frame: bytes) -> int:
    """The number of a frame's message; -1 of what is no MAVLink 2 frame."""
    return int.from_bytes(frame[7:10], "little") if len(frame) >= 10 and frame[0] == MAVLINK_2 else -1


class Outgoing:
    """Frames that wait to be written. counts: `replaced`, estimates that a newer one replaced; `not_sent`, other
    frames.

    pace_bytes_s: the line's capacity; None where it is not limited.
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
        """Write as many frames as pace and port allow; write: returns how many bytes it took. Returns the number of
        frames sent.
        """
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
