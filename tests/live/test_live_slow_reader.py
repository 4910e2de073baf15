"""A reader that is slower than what it is sent: what it reads is of now, and what would be old is never sent."""

from __future__ import annotations

import fcntl
import socket
import struct
import sys

import numpy as np
import pytest

from flownav.live.backlog import ASK_S, FIRST_BYTES, LEAST_BYTES, Backlog
from flownav.live.byte_links import open_link
from flownav.live.options import Options
from flownav.logs.mavlink.framing import coder
from live_ends import Hover, Wire

UNSENT = 0x894B  # SIOCOUTQNSD


def ages(wire, since_s):
    """How old each estimate was when it was read [s]."""
    found = zip(wire.heard, wire.heard_s, strict=True)
    return np.array(
        [
            t_s - (m.time_usec * 1e-6 - wire.vehicle.boot_s)
            for m, t_s in found
            if m.msgname == "ODOMETRY" and t_s > since_s
        ]
    )


@pytest.mark.parametrize("reads_bytes_s", [800.0, 2500.0, 6000.0])
def test_what_a_slow_reader_reads_is_of_now(reads_bytes_s):
    """Estimates of 12 kB/s to one that reads a fifth of it came 6 s old, 3 m from the vehicle."""
    wire = Wire(Hover(answers=True), Options(), reads_bytes_s=reads_bytes_s).fly(40.0)
    steady = ages(wire, 20.0)
    assert len(steady) * 244 > 0.4 * 20.0 * reads_bytes_s, "it is sent what it can read"
    assert np.quantile(steady, 0.95) < 0.25 + 500.0 / reads_bytes_s
    assert ages(wire, 0.0).max() < 0.6 + 3000.0 / reads_bytes_s, "until it is noticed"
    assert wire.session.backlog.slow
    assert wire.session.intake.flow_waited > 500
    wire.close()


def test_a_reader_that_keeps_up_is_sent_all():
    free, asked = (Wire(Hover(answers=answers), Options()).fly(10.0) for answers in (False, True))
    assert len(asked.estimates()) == len(free.estimates())
    assert asked.session.backlog.spells == 0
    for wire in (free, asked):
        wire.close()


def test_a_reader_that_stops_for_a_while_gets_none_of_what_was_meanwhile():
    wire = Wire(Hover(answers=True), Options()).fly(6.0)
    wire.reads_bytes_s, wire._unread = 0.0, 0.0
    wire.fly(8.0)
    wire.reads_bytes_s = 1e6
    wire.fly(6.0)
    late = ages(wire, 14.0)
    assert (late > 0.2).sum() < 40, "half a second's, which were on their way"
    assert len(late[late < 0.1]) > 200
    assert wire.session.reason == ""
    wire.close()


def test_one_that_answers_no_timesync_is_not_judged():
    wire = Wire(Hover(), Options(), reads_bytes_s=2500.0).fly(8.0)
    assert wire.session.backlog.is_open(1e9)
    wire.close()


def test_a_question_that_is_not_answered_closes_and_the_answer_opens():
    backlog = Backlog()
    backlog.asked(0, 0.0)
    assert backlog.answered(0, 0.01)
    backlog.put(400)
    backlog.asked(round(1e9), 1.0)
    assert backlog.is_open(1.1)
    backlog.put(400)
    assert not backlog.is_open(1.3)
    assert backlog.spells == 1
    assert not backlog.answered(5, 1.4), "somebody else's"
    assert backlog.answered(round(1e9), 1.9)
    assert backlog.is_open(1.9), f"less than {LEAST_BYTES} bytes are on their way"


def test_who_answers_nothing_is_asked_more_seldom():
    backlog, asked = Backlog(), 0
    for step in range(6000):
        now_s = 0.01 * step
        if backlog.due(now_s):
            backlog.asked(round(now_s * 1e9), now_s)
            asked += 1
    assert asked < 75
    assert FIRST_BYTES > LEAST_BYTES
    assert ASK_S < 1.0


@pytest.mark.skipif(sys.platform != "linux", reason="TCP_NOTSENT_LOWAT is Linux's")
def test_a_socket_holds_no_more_than_two_messages_that_are_not_on_their_way():
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        link = open_link(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        reader, _ = server.accept()
        mav = coder()
        size = 0
        for _ in range(1000):
            frame = bytes(
                mav.odometry_encode(1, 1, 1, 1, 1, 1, (1, 0, 0, 0), 1, 1, 1, 1, 1, 1, [1.0] * 21, [1.0] * 21).pack(mav)
            )
            link.write(frame)
            size = len(frame)
        (unsent,) = struct.unpack("i", fcntl.ioctl(link.fileno(), UNSENT, struct.pack("i", 0)))
        assert unsent <= 2 * size
        assert len(link._outgoing) <= 2 * size
        assert link.counts["replaced"] > 900
        reader.close()
        link.close()
