"""What keeps a session's estimates in time: the collector, the start's backlog, scheduling, the screen's process."""

from __future__ import annotations

import gc
import os
import pty
import signal
import sys
import threading
import time
from contextlib import suppress
from types import SimpleNamespace

import pytest

from flownav.live import display as shown
from flownav.live import priority
from flownav.live.display import Display, View
from flownav.live.filtering import BATCH
from flownav.live.loop import COLLECT_S, Collector, Latency, run_session, stoppable
from flownav.live.options import Options
from flownav.live.recorder import NoRecorder
from flownav.live.screen import Screen
from live_ends import Hover, Wire

VIEW = View(
    "udp:1  sending", ["NOT RECORDING: No space left"], [("range", "25")], [("position", "1", "2", "3")], [], ["x"]
)


def test_the_collector_is_off_while_a_session_runs_but_for_its_turns(monkeypatch):
    collected = []
    monkeypatch.setattr(gc, "collect", collected.append)
    with Collector(0.0) as collector:
        assert not gc.isenabled()
        for step in range(1000):
            collector.turn(0.02 * step)
    assert gc.isenabled()
    assert 0.8 * 20.0 / COLLECT_S < len(collected) <= 20.0 / COLLECT_S
    assert set(collected) == {0, 1}


def test_the_collector_is_on_again_when_the_session_fails():
    session = SimpleNamespace(due=False, sent=0, reason="")
    with pytest.raises(AttributeError):
        run_session(session, SimpleNamespace(fileno=lambda: -1, read=list), Latency(), lambda: False)
    assert gc.isenabled()


def test_what_was_listened_to_is_fed_in_slices_and_nothing_is_sent_meanwhile():
    wire = Wire(Hover(), Options(), NoRecorder())
    fed, sent = [], []
    real = wire.session.filtering.feed

    def feed(released):
        fed.append(len(released))
        sent.append(wire.session.sent)
        return real(released)

    wire.session.filtering.feed = feed
    wire.fly(5.0)
    wire.close()
    assert fed[:3] == [BATCH] * 3  # two seconds at 230 Hz wait
    assert max(fed) == BATCH
    last = max(place for place, count in enumerate(fed) if count == BATCH)
    assert last > 4
    assert sent[last] == 0
    assert wire.session.sent > 100


@pytest.mark.parametrize(
    ("refused", "said"), [((), "real time"), (("fifo",), "nice -10"), (("fifo", "nice"), "ordinary")]
)
def test_the_scheduling_is_what_is_permitted_and_is_said(monkeypatch, refused, said):
    def permitted(name):
        def ask(*numbers):
            if name in refused:
                raise PermissionError(1, "Operation not permitted")

        return ask

    before_s = sys.getswitchinterval()
    monkeypatch.setattr(os, "sched_setscheduler", permitted("fifo"))
    monkeypatch.setattr(os, "setpriority", permitted("nice"))
    try:
        assert said in priority.run_before_others()
        assert sys.getswitchinterval() == pytest.approx(priority.SWITCH_S)
    finally:
        sys.setswitchinterval(before_s)


def test_a_terminal_that_hangs_up_twice_does_not_break_off():
    with stoppable() as asked:
        for _ in range(2):
            signal.raise_signal(signal.SIGHUP)
        assert asked()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_a_recording_that_stopped_is_the_first_thing_that_the_screen_says():
    wire = Wire(Hover(), Options(), NoRecorder()).fly(3.0)
    recorder = SimpleNamespace(reason="", path="flight.fnr", size=2_000_000)
    screen = Screen(wire.session, Latency(), "udp:1", recorder, "real time")
    calm = screen.view(wire.now_s)
    recorder.reason = "No space left on device"
    alarmed = screen.view(wire.now_s)
    wire.close()
    assert calm.alarms == []
    assert "recording: flight.fnr, 2.0 MB; scheduling: real time" in calm.lines[-1]
    assert alarmed.alarms == ["NOT RECORDING: No space left on device"]


@pytest.fixture
def terminal(monkeypatch):
    """A terminal as the screen's process has it for standard output."""
    ours, theirs = pty.openpty()
    real = shown.subprocess.Popen
    monkeypatch.setattr(shown.subprocess, "Popen", lambda *command, **more: real(*command, stdout=theirs, **more))
    yield ours
    os.close(ours)
    os.close(theirs)


def test_views_are_drawn_on_the_terminal_and_it_is_left_as_it_was(terminal):
    seen = []

    def read():
        with suppress(OSError):
            while True:
                seen.append(os.read(terminal, 4096))

    threading.Thread(target=read, daemon=True).start()
    display = Display(lambda now_s: VIEW)
    until_s = time.monotonic() + 20.0
    while b"NOT RECORDING" not in b"".join(seen):
        assert time.monotonic() < until_s
        display.show(0.0)
        time.sleep(0.01)
    display.close()
    assert not display.stuck
    time.sleep(0.1)
    text = b"".join(seen)
    assert b"\x1b[?1049h" in text  # the other screen, and back
    assert b"\x1b[?1049l" in text


def test_a_terminal_that_takes_nothing_is_given_up_and_said(terminal):
    display = Display(lambda now_s: VIEW._replace(lines=["x" * 200] * 200))
    taken = 0
    until_s = time.monotonic() + 4.0
    while time.monotonic() < until_s:
        before_s = time.monotonic()
        display.show(0.0)
        taken = max(taken, time.monotonic() - before_s)
        time.sleep(0.01)
    assert taken < 0.5
    before_s = time.monotonic()
    display.close()
    assert display.stuck
    assert time.monotonic() - before_s < 5.0
