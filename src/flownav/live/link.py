"""Links to a vehicle: UDP, TCP and serial (byte_links), none of which ever blocks. Loopback unless told otherwise."""

from __future__ import annotations

import os
import re
import socket
from collections import Counter
from contextlib import suppress
from typing import Any, NamedTuple

from flownav.core.errors import InputError

FORMS = (
    "udp:[HOST:]PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:[HOST:]PORT or serial:DEVICE[:BAUD]; "
    "an IPv6 address in brackets, udp:[::1]:14550"
)
LOOPBACK, LOOPBACK_6, EVERYWHERE_6 = "127.0.0.1", "::1", "::"
DEFAULT_BAUD = 115200  # a bare PX4FLOW's
MOST_BYTES = 65536
MOST_READS = 64  # in a row, before the session has its turn
USB = re.compile(r"ttyACM|tty\.usbmodem|cu\.usbmodem|COM\d+$")  # ports whose baud rate is a formality
BITS_A_BYTE = 10  # with start and stop bit


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
        """What the line carries each way [bytes/s]; None where its address does not tell."""
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
    """What a session is run over. counts: `not_sent`, `replaced`, `unreachable`, `other_sender`, `reconnected`.

    received, written: bytes so far. capacity_bytes_s: what it carries each way; None where that is not known.
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
        """What has arrived, without waiting."""
        raise NotImplementedError

    def write(self, frame: bytes) -> None:
        """Send a frame, or drop and count it."""
        raise NotImplementedError

    def close(self) -> None:
        """Let go."""

    def believe(self, sender: Sender) -> None:
        """The vehicle spoke from there: it is answered there, and nobody else is listened to."""

    def forget(self) -> None:
        """The vehicle is silent: anyone may speak."""


def open_link(url: str) -> Link:
    """InputError where the URL is wrong or the address cannot be had."""
    from flownav.live.byte_links import SerialLink, TcpLink

    address = parse_url(url)
    try:
        if address.kind in ("udp", "udpout"):
            return UdpLink(address)
        return SerialLink(address) if address.kind == "serial" else TcpLink(address)
    except OSError as error:
        raise InputError(f"{url}: cannot be opened ({error.strerror or error}); {FORMS}") from error


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
        self.port = int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        """Of the socket."""
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
        for _ in range(MOST_READS):
            try:
                piece, sender = self._socket.recvfrom(MOST_BYTES)
            except BlockingIOError:
                break
            except OSError:  # an earlier datagram of ours found nobody
                self.counts["unreachable"] += 1
                continue
            if self._peer is not None and not same_sender(sender, self._peer):
                self.counts["other_sender"] += 1
            else:
                self.received += len(piece)
                pieces.append((piece, sender))
        return pieces

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
