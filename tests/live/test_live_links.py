"""Links by their address: IPv6 beside IPv4, whole frames on a slow line, and what is counted."""

from __future__ import annotations

import errno
import socket
import time
from contextlib import suppress
from types import SimpleNamespace

import pytest

from flownav.core.errors import InputError
from flownav.live import byte_links
from flownav.live.byte_links import TcpLink, open_link
from flownav.live.link import Address, UdpLink, parse_url, same_sender


def has_ipv6():
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as probe:
            probe.bind(("::1", 0))
    except OSError:
        return False
    return True


needs_ipv6 = pytest.mark.skipif(not has_ipv6(), reason="this machine has no IPv6")


def until(what, seconds=120.0):  # what takes longer hangs
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := what():
            return found
        time.sleep(0.002)
    raise AssertionError("it never came")


# -- IPv6 -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("udp:[::1]:14550", Address("udp", "::1", 14550)),
        ("udpin:[::]:14550", Address("udp", "::", 14550)),
        ("udpout:[2001:db8::7]:14550", Address("udpout", "2001:db8::7", 14550)),
        ("udpout:[fe80::1%eth0]:14550", Address("udpout", "fe80::1%eth0", 14550)),
        ("tcp://[::1]:5760", Address("tcp", "::1", 5760)),
        ("tcpin:[::ffff:10.0.0.1]:5760", Address("tcpin", "::ffff:10.0.0.1", 5760)),
    ],
)
def test_an_ipv6_address_stands_in_brackets(url, address):
    assert parse_url(url) == address


@pytest.mark.parametrize("url", ["udp:::1:14550", "udp:[::1]", "udpout:[host]:1", "tcp:[::1:5760", "tcp:[]:5760"])
def test_what_is_half_an_address_is_one_line(url):
    with pytest.raises(InputError, match=r"no link; give .* an IPv6 address in brackets"):
        parse_url(url)


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (("::1", 5, 0, 0), ("::1", 5, 0, 0), True),
        (("fe80::1", 5, 0, 2), ("fe80::1%eth0", 5, 0, 2), True),
        (("fe80::1%eth0", 5, 0, 2), ("fe80::1%eth1", 5, 0, 3), False),
        (("10.0.0.1", 5), ("10.0.0.1", 6), False),
        (None, ("10.0.0.1", 5), False),
    ],
)
def test_who_is_the_same_sender(one, other, same):
    assert same_sender(one, other) is same


@needs_ipv6
@pytest.mark.parametrize("listening", ["udp:[::1]:0", "udp:[::]:0"])
def test_datagrams_go_both_ways_over_ipv6_and_strangers_are_not_heard(listening):
    ours = open_link(listening)
    assert isinstance(ours, UdpLink)
    theirs, stranger = (open_link(f"udpout:[::1]:{ours.port}") for _ in range(2))
    theirs.write(b"there")
    [(piece, sender)] = until(ours.read)
    assert piece == b"there"
    ours.believe(sender)
    ours.write(b"back")
    assert [found for found, _ in until(theirs.read)] == [b"back"]
    stranger.write(b"I am the vehicle")
    until(lambda: ours.read() or ours.counts["other_sender"])
    assert ours.counts["other_sender"] == 1
    for link in (ours, theirs, stranger):
        link.close()


def test_datagrams_that_the_system_had_no_room_for_are_counted():
    ours = open_link("udp:127.0.0.1:0")
    theirs = open_link(f"udpout:127.0.0.1:{ours.port}")
    sent, read = 20_000, 0
    for _ in range(sent):
        theirs.write(bytes(1000))
    while pieces := ours.read():
        read += len(pieces)
    assert 0 < read < sent
    assert ours.counts["overflowed"] == sent - read
    assert not theirs.counts
    ours.close()
    theirs.close()


@needs_ipv6
def test_every_interface_of_ipv6_hears_ipv4_too():
    ours = open_link("udp:[::]:0")
    theirs = open_link(f"udpout:127.0.0.1:{ours.port}")
    theirs.write(b"there")
    [(piece, sender)] = until(ours.read)
    assert piece == b"there"
    ours.believe(sender)
    ours.write(b"back")
    assert [found for found, _ in until(theirs.read)] == [b"back"]
    ours.close()
    theirs.close()


@needs_ipv6
def test_tcp_connects_over_ipv6():
    server = open_link("tcpin:[::1]:0")
    assert isinstance(server, TcpLink)
    caller = open_link(f"tcp:[::1]:{server.port}")
    server.read()
    caller.write(b"there")
    assert until(server.read) == [(b"there", None)]
    caller.close()
    server.close()


class Called:
    """A socket in memory. answered: whether a call that it makes is answered; until then nothing can be written."""

    def __init__(self, answered=True):
        self._ends, self.answered, self.closed = socket.socketpair(), answered, False
        self._ends[0].setblocking(False)
        while not answered:
            try:
                self._ends[0].send(bytes(65536))
            except BlockingIOError:
                break
        self.family = socket.AF_INET

    def fileno(self):
        return self._ends[0].fileno()

    def getpeername(self):
        return ("127.0.0.1", 5760)

    def connect_ex(self, address):
        return errno.EINPROGRESS

    def recv(self, most):
        return self._ends[0].recv(most)

    def setblocking(self, flag): ...

    def setsockopt(self, *option): ...

    def getsockopt(self, *option):
        return 0

    def hang_up(self):
        self._ends[1].close()

    def close(self):
        for end in self._ends:
            end.close()
        self.closed = True


def test_a_call_that_nobody_answers_is_given_up_and_made_again(monkeypatch):
    """Each read looks once and waits for nothing: 5 ms of a clock that only reading moves."""
    first, silent, heard = Called(), [], Called()

    def call(*kind):
        if len(silent) == 3:
            return heard
        silent.append(Called(answered=False))
        return silent[-1]

    sockets = SimpleNamespace(**vars(socket) | {"create_connection": lambda *where, timeout: first, "socket": call})
    monkeypatch.setattr(byte_links, "socket", sockets)
    link, now_s = TcpLink(Address("tcp", "127.0.0.1", 5760)), 0.0
    link.clock = lambda: now_s
    first.hang_up()
    looks = 0
    while not link.counts["reconnected"]:
        assert link.read() == []
        looks, now_s = looks + 1, now_s + 0.005
        assert looks < 2000
    assert [call.closed for call in silent] == [True] * 3
    assert now_s == pytest.approx(3 * 1.0 + 4 * 0.5, abs=0.1)
    assert link.fileno() == heard.fileno()
    link.close()


@pytest.mark.real_time
def test_a_peer_that_is_gone_does_not_stop_us_and_is_found_again():
    """A call that nobody answers waited for a second, twice every second."""
    with socket.socket() as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        address = server.getsockname()
        link = open_link(f"tcp:127.0.0.1:{address[1]}")
        accepted, _ = server.accept()
        crowd = []
        for _ in range(3):  # fill what waits to be accepted: further calls are not answered at all
            caller = socket.socket()
            caller.setblocking(False)
            caller.connect_ex(address)
            crowd.append(caller)
        accepted.close()
        taken_s = []
        for _ in range(300):
            before_s = time.monotonic()
            link.read()
            taken_s.append(time.monotonic() - before_s)
            time.sleep(0.005)
        assert sorted(taken_s)[-5] < 0.5  # five calls are begun; waited for, each took a second
        assert link.counts["reconnected"] == 0
        server.settimeout(0.001)
        waiting = []

        def found():
            link.read()
            with suppress(TimeoutError):
                waiting.append(server.accept()[0])
            return link.counts["reconnected"]

        assert until(found) == 1
        for end in (*crowd, *waiting):
            end.close()
        link.close()


def test_a_host_that_is_none_is_one_line():
    with pytest.raises(InputError, match="cannot be opened"):
        open_link("udpout:nowhere.invalid:14550")
