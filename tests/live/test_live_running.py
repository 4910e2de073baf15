"""The means that keep a session's estimates in time: the collector, the start's backlog, scheduling, the screen's
process.
"""

from __future__ import annotations

import gc
import json
import os
import pty
import signal
import sys
import threading
import time
from contextlib import suppress
from functools import partial
from types import SimpleNamespace

import pytest

from flownav.live import display as shown
from flownav.live import loop
from flownav.live.display import Display, View
from flownav.live.filtering import BATCH_READINGS, Keeper
from flownav.live.loop import COLLECT_S, Collector, Latency, run_session, stoppable
from flownav.live.options import Options
from flownav.live.screen import Screen
from live_ends import Hover, Wire

HUNG_S = 120.0  # whatever takes so long hangs
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
    wire = Wire(Hover(), Options(), Keeper())
    fed, sent = [], []
    real = wire.session.filtering.feed

    def feed(until_s):
        outcome = real(until_s)
        if outcome.readings:
            fed.append(outcome.readings)
            sent.append(wire.session.sent)
        return outcome

    wire.session.filtering.feed = feed
    wire.fly(5.0)
    wire.close()
    assert fed[:3] == [BATCH_READINGS] * 3  # two seconds at 230 Hz wait
    assert max(fed) == BATCH_READINGS
    last = max(place for place, count in enumerate(fed) if count == BATCH_READINGS)
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
        assert said in loop.run_before_others()
        assert sys.getswitchinterval() == pytest.approx(loop.SWITCH_S)
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
    wire = Wire(Hover(), Options(), Keeper()).fly(3.0)
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


@pytest.mark.real_time
def test_views_are_drawn_on_the_terminal_and_it_is_left_as_it_was(terminal, monkeypatch):
    seen = []

    def read():
        with suppress(OSError):
            while True:
                seen.append(os.read(terminal, 4096))

    def await_words(words, show=lambda now_s: None):
        until_s = time.monotonic() + HUNG_S
        while words not in b"".join(seen):
            assert time.monotonic() < until_s
            show(0.0)
            time.sleep(0.01)

    monkeypatch.setattr(shown, "LAST_WAIT_S", HUNG_S)
    threading.Thread(target=read, daemon=True).start()
    display = Display(lambda now_s: VIEW)
    await_words(b"NOT RECORDING", display.show)
    display.close()
    assert not display.stuck
    await_words(b"\x1b[?1049l")  # back from the other screen
    assert b"\x1b[?1049h" in b"".join(seen)


@pytest.mark.real_time
def test_a_terminal_that_nobody_reads_is_given_up(terminal):
    display = Display(lambda now_s: VIEW._replace(lines=["x" * 200] * 200))
    for _ in range(400):
        display.show(0.0)
        time.sleep(0.01)
    display.close()
    assert display.stuck


class Screenless:
    """A process of the screen that has answered so often, takes no view, and ends when it is killed."""

    def __init__(self, answers, command, stdin, pass_fds):
        self._views, into = os.pipe()
        self.stdin, self.killed = os.fdopen(into, "wb"), False
        os.write(pass_fds[0], shown.DRAWN * answers)

    def wait(self, within_s=None):
        if not self.killed:
            raise shown.subprocess.TimeoutExpired("screen", within_s)
        os.close(self._views)

    def kill(self):
        self.killed = True


@pytest.mark.parametrize(("answers", "taken"), [(0, 0), (1, 1), (9, 9)])
def test_a_view_is_taken_for_each_that_was_drawn_and_a_terminal_that_takes_nothing_is_given_up(
    monkeypatch, answers, taken
):
    """Nine of its views are more than a pipe holds."""
    looks = []
    monkeypatch.setattr(shown.subprocess, "Popen", partial(Screenless, answers))
    display = Display(lambda now_s: looks.append(now_s) or VIEW._replace(lines=["x" * 200] * 200))
    for step in range(50):
        display.show(0.25 * step)
    assert looks == [0.25 * step for step in range(taken)]
    display.close()
    assert display.stuck


def test_the_screens_process_draws_what_comes_and_answers_each_view(monkeypatch, capsys):
    answers, drawn = os.pipe()
    lines = [json.dumps(VIEW) + "\n", json.dumps(VIEW._replace(title="the second", alarms=[])) + "\n"]
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr(sys, "argv", ["display", str(drawn)])
    monkeypatch.setattr(sys, "stdin", lines)
    monkeypatch.setattr(signal, "signal", lambda *ignored: None)
    monkeypatch.setattr(os, "sched_setscheduler", lambda *ignored: None)
    shown.main()
    os.close(drawn)
    assert os.read(answers, 10) == 3 * shown.DRAWN
    os.close(answers)
    text = capsys.readouterr().out
    assert (
        text.index("\x1b[?1049h") < text.index("NOT RECORDING") < text.index("the second") < text.index("\x1b[?1049l")
    )
