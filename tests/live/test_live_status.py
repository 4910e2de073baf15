"""The state of a session as a file: what it states while it sends and while it withholds, and that it goes."""

from __future__ import annotations

import json
import os
import time

import pytest

from flownav.core.errors import InputError
from flownav.core.marks import is_ours
from flownav.live.anchor import PLACES
from flownav.live.answers import WITHHELD
from flownav.live.filtering import Keeper
from flownav.live.loop import Latency
from flownav.live.options import Options
from flownav.live.screen import Screen, protection_of
from flownav.live.session import Session
from flownav.live.status import ALIVE_S, MOST_POINTS, Status, StatusFile, Trail, status_place
from live_command import run_live
from live_ends import Hover
from recorded_link import arrivals, play


def looks(frames, every_s=0.5, options=None):
    """The status of a recording every half second, and the session."""
    found, last = [], [float("-inf")]
    status = None

    def look(session, now_s):
        nonlocal status
        if status is None:
            status = Status(session, Screen(session, Latency(), "udp:0"), "udp:0", None, now_s)
        if now_s - last[0] >= every_s:
            last[0] = now_s
            found.append((status.look(now_s), session.reason, session.estimate))

    session, _ = play(frames, options=options, look=look)
    return found, session


def test_while_it_sends_the_figures_are_those_of_what_is_sent(data_folder):
    found, session = looks(arrivals(data_folder / "ardupilot-live" / "square", 40.0))
    last = found[-1][0]
    assert (last["reason"], last["why"], last["listens"]) == ("", "", False)
    assert last["vehicle"] == {"system": 1, "component": 1}
    estimate = found[-1][2]
    assert last["quality_percent"] == estimate.quality
    assert last["three_sigma_m"][1] == pytest.approx(3.0 * estimate.pose_covariance[1, 1] ** 0.5, abs=1e-3)
    assert last["three_sigma_m_s"][0] == pytest.approx(3.0 * estimate.velocity_covariance[0, 0] ** 0.5, abs=1e-3)
    assert last["here_ned_m"] == pytest.approx(estimate.pos_ned_m, abs=0.5)  # half a second of horizon
    assert last["vel_ned_m_s"] == pytest.approx(estimate.vel_ned_m_s, abs=1e-3)
    assert last["protection_m"] == pytest.approx(protection_of(session)[:2], abs=0.2)
    assert last["sent"] > 100
    assert [row[0] for row in last["sensors"]] == [sensor.name.lower() for sensor in sorted(session.intake.readings)]
    json.dumps(last, allow_nan=False)


def test_before_a_vehicle_is_received_nothing_is_known_but_why():
    session = Session(Options(), Keeper(), 100.0, 1.8e9)
    status = Status(session, Screen(session, Latency(), "udp:0"), "udp:0", None, 100.0)
    found = status.look(103.0)
    assert (found["vehicle"], found["reason"], found["why"]) == (None, "no_vehicle", WITHHELD["no_vehicle"])
    assert (found["here_ned_m"], found["protection_m"], found["quality_percent"], found["path"]) == (
        None,
        None,
        None,
        [],
    )
    assert (found["lasted_s"], found["for_s"]) == (3.0, 3.0)


def test_the_path_shows_where_it_was_withheld_and_since_when(data_folder):
    found, _ = looks(arrivals(data_folder / "ardupilot-live" / "no-gps-never-sends", 40.0))
    reasons = [reason for _, reason, _ in found]
    withheld = [(status, reason) for status, reason, _ in found if reason]
    assert all(status["why"] == WITHHELD[reason] for status, reason in withheld)
    last = found[-1][0]
    same = next((k for k, reason in enumerate(reversed(reasons)) if reason != reasons[-1]), len(reasons) - 1)
    assert last["for_s"] == pytest.approx(0.5 * (same - 1), abs=0.6)
    marks = [mark for *_, mark in last["path"]]
    placed = [reason for status, reason, _ in found if status["here_ned_m"] is not None]
    assert marks == [int(not reason) for reason in placed]


def test_a_session_that_only_listens_withholds_nothing(data_folder):
    found, _ = looks(arrivals(data_folder / "ardupilot-live" / "square", 20.0), options=Options(send="none"))
    last = found[-1][0]
    assert (last["listens"], last["reason"], last["why"], last["sent"]) == (True, "", "", 0)
    assert last["quality_percent"] > 0
    assert last["path"][-1][2] == 1


def test_velocity_alone_is_stated(data_folder):
    found, _ = looks(arrivals(data_folder / "px4-live" / "px4-no-gps-heading", 60.0))
    for status, reason, _ in found:
        assert not status["velocity_only"] or reason in PLACES


def test_the_path_is_even_in_time_and_bounded():
    trail = Trail()
    for k in range(5 * MOST_POINTS):
        trail.take(float(k), -float(k), sent=k % 2 == 0)
    assert MOST_POINTS // 2 <= len(trail.points) <= MOST_POINTS
    steps = {later[0] - before[0] for before, later in zip(trail.points, trail.points[1:], strict=False)}
    assert steps == {8.0}
    assert trail.points[0] == (0.0, -0.0, 1)


def until(read, patience_s=60.0):
    give_up = time.monotonic() + patience_s
    while not (found := read()):
        assert time.monotonic() < give_up
        time.sleep(0.005)
    return found


def test_the_command_writes_it_and_removes_it(tmp_path, monkeypatch):
    path, kept = tmp_path / "flight.live.json", []

    def look():
        kept.append(json.loads(until(lambda: path.exists() and path.read_text())))
        assert is_ours(path)

    done = run_live(monkeypatch, "--status", path, "--record", tmp_path / "f.fnr", "--duration", 7, "--json",
                    vehicle=Hover(), at_5=look)  # fmt: skip
    assert done.exit_code == 0, done.output
    assert kept[0]["live_status"] == 1
    assert kept[0]["url"] == "udp:0"
    assert kept[0]["record"] == "f.fnr"
    assert kept[0]["process"] == os.getpid()
    assert [file.name for file in tmp_path.iterdir()] == ["f.fnr"]


def test_the_newest_is_written_as_the_last_one_is_done_and_nobody_waits(tmp_path):
    path, asked, failed = tmp_path / "x.live.json", [], []
    file = StatusFile(path, lambda now_s: asked.append(now_s) or {"now_s": now_s}, failed.append)
    for now_s in (0.0, 0.25, 0.5, 1.0):
        file.show(now_s)
        until(lambda: file._idle)
    assert asked == [0.0, 0.5, 1.0]
    assert json.loads(path.read_text())["now_s"] == 1.0
    file.close()
    assert list(tmp_path.iterdir()) == []
    assert failed == []


def test_what_cannot_be_written_is_stated_once_and_the_session_goes_on(tmp_path):
    folder, failed = tmp_path / "gone", []
    folder.write_text("a file where a folder is needed")
    file = StatusFile(folder / "x.live.json", lambda now_s: {"now_s": now_s}, failed.append)
    for now_s in (0.0, 1.0, 2.0):
        file.show(now_s)
        until(lambda: file._idle)
    file.close()
    assert len(failed) == 1


def test_what_is_of_another_or_not_ours_is_not_replaced(tmp_path):
    path = tmp_path / "x.live.json"
    file = StatusFile(path, lambda now_s: {"now_s": now_s})
    file.show(0.0)
    until(path.exists)
    with pytest.raises(InputError, match="another session writes its status there"):
        status_place(path)
    old_s = time.time() - ALIVE_S - 1.0
    os.utime(path, (old_s, old_s))
    assert status_place(path) == path  # of a session that was killed
    path.write_text('{"mine": 1}')
    os.utime(path, (old_s, old_s))
    with pytest.raises(InputError, match="not written by flownav"):
        status_place(path)
    file.close()


def test_setup_writes_no_status(tmp_path, monkeypatch):
    done = run_live(monkeypatch, "--setup", "--status", tmp_path / "x.live.json")
    assert str(done.exception) == "--status: --setup flies nothing; leave one of the two away"
