"""Links that are streams of bytes, TCP and serial ports, and whatever link a URL names."""

import errno
import os
import select
import socket
import time
from contextlib import suppress
from typing import Any

from flownav.core.errors import InputError
from flownav.live.link import EVERYWHERE_6, FORMS, MOST_BYTES, Address, Link, Outgoing, Piece, UdpLink, parse_url

RECONNECT_S = 1.0  # for a call to be answered: chosen
ALONE = getattr(socket, "MSG_EOR", 0)  # or Linux appends a message to one that waits, without a look at the bound
SENDING_BYTES = 8192  # of the kernel's own buffer: chosen; with its bookkeeping a dozen estimates on their way
NOTSENT_LOWAT = 25  # TCP_NOTSENT_LOWAT of Linux, which Python does not name: bytes that may wait to be sent
UNACKNOWLEDGED_MS = 5000  # a peer that acknowledges nothing for so long is gone: chosen; the kernel's own takes minutes


class ByteLink(Link):
    """A stream of bytes: a frame is put in line whole, and what the other side takes is sent."""

    clock = staticmethod(time.monotonic)

    def __init__(self, address: Address, capacity_bytes_s: float | None = None) -> None:
        super().__init__(address)
        self._address = address
        self._outgoing = Outgoing(self.counts, capacity_bytes_s)
        self._tries = 0

    @property
    def is_open(self) -> bool:
        """Whether there is somebody to send to."""
        raise NotImplementedError

    def write(self, frame: bytes) -> None:
        """Send whole what is taken now; the rest waits. Where nobody is there, count it."""
        if not self.is_open:
            self.counts["not_sent"] += 1
            return
        self._outgoing.put(frame)
        self._flush()

    def _flush(self) -> None:
        try:
            self.written += self._outgoing.flush(self._taken, self.clock())
        except OSError:
            self._broken()

    def _taken(self, content: bytes) -> int:
        """How much is taken at once."""
        try:
            return self._sent(content)
        except BlockingIOError:
            return 0

    def _sent(self, content: bytes) -> int:
        """Send; how much. OSError where that fails."""
        raise NotImplementedError

    def _broken(self) -> None:
        """Give up what is broken; it is made again."""
        raise NotImplementedError


class TcpLink(ByteLink):
    """A connection that is made again when it breaks: by calling (tcp) or by waiting for a caller (tcpin).

    Only the first call waits, before anything flies: later ones go to the same address and never stop the session.
    """

    def __init__(self, address: Address) -> None:
        super().__init__(address)
        self._server: socket.socket | None = None
        self._connection: socket.socket | None = None
        self._calling: socket.socket | None = None
        self._called_s = 0.0
        if address.kind == "tcpin":
            family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
            everywhere = address.host == EVERYWHERE_6 and socket.has_dualstack_ipv6()
            self._server = socket.create_server(
                (address.host, address.number), family=family, backlog=1, dualstack_ipv6=everywhere
            )
            self._server.setblocking(False)
            self.port = int(self._server.getsockname()[1])
        else:
            found = socket.create_connection((address.host, address.number), timeout=RECONNECT_S)
            self._peer = found.family, found.getpeername()
            self._connection = self._made(found)

    def _made(self, connection: socket.socket) -> socket.socket:
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with suppress(OSError, AttributeError):  # Linux
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS)
        with suppress(OSError):  # Linux; what may not go now waits where a newer estimate takes its place
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENDING_BYTES)
            connection.setsockopt(socket.IPPROTO_TCP, NOTSENT_LOWAT, 1)
        return connection

    def fileno(self) -> int:
        """The file number of the connection, or of the server that waits for one."""
        found = self._connection or self._server
        return found.fileno() if found else -1

    def read(self) -> list[Piece]:
        """Bytes that have arrived; a broken connection is made again."""
        if self._connection is None:
            self._connect()
            return []
        self._flush()
        if self._connection is None:
            return []
        try:
            piece = self._connection.recv(MOST_BYTES)
        except BlockingIOError:
            return []
        except OSError:
            piece = b""
        if not piece:
            self._broken()
        self.received += len(piece)
        return [(piece, None)] if piece else []

    def _connect(self) -> None:
        try:
            if self._server is not None:
                self._connection = self._made(self._server.accept()[0])
            elif self._calling is None:
                self._call()
            else:
                self._answered(self._calling)
        except OSError:
            self._given_up()
        if self._connection is not None:
            self.counts["reconnected"] += 1

    def _call(self) -> None:
        """Begin to call, every half second."""
        self._tries += 1
        if self._tries % 100:
            return
        family, address = self._peer
        self._calling, self._called_s = socket.socket(family, socket.SOCK_STREAM), self.clock()
        self._calling.setblocking(False)
        if self._calling.connect_ex(address) not in (0, errno.EINPROGRESS):
            self._given_up()

    def _answered(self, calling: socket.socket) -> None:
        """Whether the call was answered by now."""
        if select.select([], [calling], [], 0.0)[1]:
            if calling.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
                self._given_up()
            else:
                self._connection, self._calling = self._made(calling), None
        elif self.clock() - self._called_s > RECONNECT_S:
            self._given_up()

    def _given_up(self) -> None:
        if self._calling is not None:
            self._calling.close()
        self._calling = None

    def _broken(self) -> None:
        if self._connection is not None:
            self._connection.close()
        self._connection = None
        self._outgoing.clear()

    @property
    def is_open(self) -> bool:
        """Whether there is a connection."""
        return self._connection is not None

    def _sent(self, content: bytes) -> int:
        assert self._connection is not None
        return self._connection.send(content, ALONE)

    def close(self) -> None:
        """Close connection and server."""
        self._broken()
        self._given_up()
        if self._server is not None:
            self._server.close()


class SerialLink(ByteLink):
    """A serial port that is opened again when its cable was pulled.

    What is written goes to the file and not through pyserial, whose write tries again for ever while the port is full.
    """

    def __init__(self, address: Address) -> None:
        super().__init__(address, address.capacity_bytes_s)
        self._port: Any = self._opened()

    def _opened(self) -> Any:
        try:
            import serial
        except ImportError as error:
            raise InputError("a serial link needs pyserial; install it with `pip install 'flownav[live]'`") from error
        return serial.Serial(self._address.host, self._address.number, timeout=0, write_timeout=0)

    def fileno(self) -> int:
        """The port's file number."""
        return int(self._port.fileno()) if self._port is not None else -1

    def read(self) -> list[Piece]:
        """Bytes that have arrived; a lost port is opened again."""
        if self._port is None:
            self._tries += 1
            if self._tries % 100 == 0:
                with suppress(OSError):
                    self._port = self._opened()
                    self.counts["reconnected"] += 1
            return []
        self._flush()
        if self._port is None:
            return []
        try:
            piece = bytes(self._port.read(MOST_BYTES))
        except OSError:
            self.close()
            return []
        self.received += len(piece)
        return [(piece, None)] if piece else []

    @property
    def is_open(self) -> bool:
        """Whether the port is open."""
        return self._port is not None

    def _sent(self, content: bytes) -> int:
        return os.write(self._port.fileno(), content)

    def _broken(self) -> None:
        self.close()

    def close(self) -> None:
        """Close the port."""
        if self._port is not None:
            with suppress(OSError):
                self._port.close()
        self._port = None
        self._outgoing.clear()


def open_link(url: str) -> Link:
    """The link that a URL names. InputError where the URL is wrong or the address cannot be had."""
    address = parse_url(url)
    try:
        if address.kind in ("udp", "udpout"):
            return UdpLink(address)
        return SerialLink(address) if address.kind == "serial" else TcpLink(address)
    except OSError as error:
        raise InputError(f"{url}: cannot be opened ({error.strerror or error}); {FORMS}") from error
