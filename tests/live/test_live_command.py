"""`flownav live` from its start to its end on a virtual clock: asked to stop, broken off, on a full disk, alone."""

from __future__ import annotations

import json
import signal

import pytest

from flownav.core.errors import VerdictError
from flownav.logs.open_log import open_flight
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from journal_turns import full_disk
from live_command import run_live
from live_ends import Hover


def replayed(path):
    log = open_flight(path)
    return replay(log, *as_fed(log, ReplayOptions(), None))


def raised(*numbers):
    def raise_them():
        for number in numbers:
            signal.raise_signal(number)

    return raise_them


@pytest.mark.parametrize("numbers", [(signal.SIGINT,), (signal.SIGTERM,), (signal.SIGHUP, signal.SIGHUP)])
def test_who_asks_it_to_stop_gets_a_complete_record(tmp_path, monkeypatch, numbers):
    path = tmp_path / "live.fnr"
    done = run_live(monkeypatch, "--record", path, "--json", vehicle=Hover(), at_5=raised(*numbers))
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert facts["record"] == str(path)
    assert facts["duration_s"] == pytest.approx(5.0, abs=0.1)
    assert facts["sent"] >= 100
    assert facts["traffic"]["received_bytes_s"] > 0.0
    assert facts["traffic"]["written_bytes_s"] > 0.0
    assert facts["traffic"]["capacity_bytes_s"] is None
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert len(replayed(path).estimate) > 100


def test_a_second_ctrl_c_breaks_off_and_says_how_to_recover(tmp_path, monkeypatch):
    path = tmp_path / "live.fnr"
    twice = raised(signal.SIGTERM, signal.SIGINT)
    done = run_live(monkeypatch, "--record", path, vehicle=Hover(), at_5=twice)
    assert isinstance(done.exception, VerdictError)
    assert str(done.exception) == "udp:0: broken off"
    assert f"flownav recover {path}.journal" in done.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["live.fnr.journal"]


def test_a_duration_ends_it(monkeypatch):
    done = run_live(monkeypatch, "--duration", "4", "--json", vehicle=Hover())
    assert done.exit_code == 0
    assert json.loads(done.stdout)["duration_s"] == pytest.approx(4.0, abs=0.02)


def test_a_full_disk_in_flight_is_said_and_the_session_goes_on(tmp_path, monkeypatch):
    path = tmp_path / "live.fnr"
    full_disk(monkeypatch, 200_000)
    done = run_live(monkeypatch, "--record", path, "--duration", "8", "--json", vehicle=Hover())
    assert isinstance(done.exception, VerdictError)
    assert "not recording any more: No space left on device; the session goes on" in done.stderr
    facts = json.loads(done.stdout)
    assert facts["recording_stopped"] == "No space left on device"
    assert facts["sent"] >= 250
    assert facts["record"] == str(path)
    assert len(replayed(path).estimate) > 10


def test_nobody_heard_is_a_bad_verdict_and_leaves_nothing(tmp_path, monkeypatch):
    done = run_live(monkeypatch, "--duration", "0.5", "--json", "--record", tmp_path / "live.fnr")
    assert isinstance(done.exception, VerdictError)
    assert str(done.exception).startswith("udp:0: no autopilot was received in 0.5 s")
    facts = json.loads(done.stdout)
    assert facts["vehicle"] is None
    assert facts["record"] is None
    assert not list(tmp_path.iterdir())
