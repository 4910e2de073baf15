"""`flownav live` as it is used: killed, hung up, on a full disk, before a terminal that nobody reads."""

from __future__ import annotations

import json
import math
import os
import pty
import resource
import signal
import subprocess
import sys
import time

import pytest

from flownav.core.record import Record
from flownav.logs.open_log import open_flight
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from live_process import HUNG_S, LiveProcess

pytestmark = pytest.mark.real_time  # the same on a virtual clock: test_live_command.py, test_live_journal.py


def replayed(path):
    log = open_flight(path)
    return replay(log, *as_fed(log, ReplayOptions(), None))


def test_a_killed_session_is_recovered_but_for_its_last_second(tmp_path):
    path, journal = tmp_path / "live.fnr", tmp_path / "live.fnr.journal"
    with LiveProcess(path) as live:
        live.fly(150)
        flown_s = live.vehicle.boot_s + time.monotonic() - live._start_s
        live.end(signal.SIGKILL)
    assert [file.name for file in tmp_path.iterdir()] == [journal.name]
    recover = subprocess.run(
        [sys.executable, "-m", "flownav", "recover", str(journal), "--json"], capture_output=True, text=True, check=True
    )
    assert json.loads(recover.stdout)["ended"] is False
    record = Record.load(path)
    newest_s = record.tables["fed"]["arrival_s"].max()
    assert flown_s - newest_s < 5.0  # a second and the horizon, on a machine that has time
    assert len(replayed(path).estimate) == len(record.tables["estimate"]["t_s"])
    assert record.manifest["live"]["sent"] > 0


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_a_terminal_that_ends_and_a_termination_leave_a_complete_record(tmp_path, number):
    path = tmp_path / "live.fnr"
    with LiveProcess(path, "--json") as live:
        live.fly(30)
        live.process.send_signal(number)
        if number == signal.SIGHUP:
            live.process.send_signal(number)  # a shell and the kernel both say so
        output, errors = live.end(number) if number == signal.SIGHUP else live.process.communicate(timeout=HUNG_S)
    assert live.process.returncode == 0, errors
    assert json.loads(output)["record"] == str(path)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert len(replayed(path).estimate) > 10


def test_a_second_ctrl_c_breaks_off_and_says_how_to_recover(tmp_path):
    with LiveProcess(tmp_path / "live.fnr") as live:
        live.fly(30)
        os.kill(live.process.pid, signal.SIGSTOP)
        os.kill(live.process.pid, signal.SIGTERM)
        os.kill(live.process.pid, signal.SIGINT)  # both wait for it
        os.kill(live.process.pid, signal.SIGCONT)
        _, errors = live.process.communicate(timeout=HUNG_S)
    assert live.process.returncode == 1
    assert "Traceback" not in errors
    assert f"flownav recover {tmp_path / 'live.fnr.journal'}" in errors
    assert (tmp_path / "live.fnr.journal").exists()


def test_a_full_disk_in_flight_is_said_and_the_session_goes_on(tmp_path):
    """A limit on the size of files is a full disk that needs no disk."""
    path, most = tmp_path / "live.fnr", 200_000

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    with LiveProcess(path, "--json", preexec_fn=limit) as live:
        live.fly(30)
        journal = tmp_path / "live.fnr.journal"
        while journal.stat().st_size < most:
            live.fly(5)
        live.fly(60)
        output, errors = live.end(signal.SIGINT)
    assert live.process.returncode == 1
    assert "not recording any more: File too large; the session goes on" in errors
    assert "Traceback" not in errors
    facts = json.loads(output)
    assert facts["recording_stopped"] == "File too large"
    assert facts["sent"] >= 90
    found = path if facts["record"] else None
    if found is None:  # the record would have been too large as well
        subprocess.run([sys.executable, "-m", "flownav", "recover", facts["journal"]], check=True)
    assert len(replayed(path).estimate) > 10


@pytest.mark.parametrize("kind", ["attitude", "imu", "heartbeat", "junk"])
def test_twenty_thousand_messages_a_second_take_nothing_but_time(tmp_path, kind):
    """In mid-flight, on the vehicle's own port: what is sent stays true and of now, goes on, and its time never steps
    back.
    """
    with LiveProcess(tmp_path / "live.fnr", "--json") as live:
        mav, last_s, sent = live.vehicle.mav, time.monotonic(), 0

        def flood():
            nonlocal last_s, sent
            now_s = time.monotonic()
            ms = round((live.vehicle.boot_s + now_s - live._start_s) * 1e3)
            frame = {
                "attitude": lambda: bytes(mav.attitude_encode(ms, *[0.0] * 6).pack(mav)),
                "imu": lambda: bytes(mav.highres_imu_encode(1000 * ms, 0, 0, -9.8, *[0] * 10, 0x3F).pack(mav)),
                "heartbeat": lambda: bytes(mav.heartbeat_encode(2, 3, 0, 0, 4, 3).pack(mav)),
                "junk": lambda: b"\xfd" * 60,
            }[kind]()
            many = min(round(20_000 * (now_s - last_s)), 2_000)
            for _ in range(many):
                live.link.write(frame)
            last_s, sent = now_s, sent + many

        live.fly(150)
        live.heard.clear()
        begun_s = last_s = time.monotonic()
        while sent < 60_000 or time.monotonic() - begun_s < 5.0:  # a machine that has no time takes longer
            assert time.monotonic() - begun_s < HUNG_S
            live.fly(1, beside=flood)
        flooded, took_s = len(live.heard), time.monotonic() - begun_s
        live.fly(100)
        oldest_s = max(age_s for age_s, _ in live.heard)
        print(f"{kind}: {sent} in {took_s:.1f} s, {flooded} estimates, {oldest_s:.2f} s old at most")
        assert max(math.hypot(said.x, said.y) for _, said in live.heard) < 0.5
        assert oldest_s < 2.0
        stamps_us = [said.time_usec for _, said in live.heard]
        assert stamps_us == sorted(stamps_us)
        output, errors = live.end(signal.SIGINT)
    assert live.process.returncode == 0, errors
    assert json.loads(output)["resets"] <= 1


def test_a_terminal_that_nobody_reads_holds_nobody_up(tmp_path):
    path = tmp_path / "live.fnr"
    ours, theirs = pty.openpty()
    try:
        with LiveProcess(path, stdout=theirs) as live:
            live.fly(400)  # eight seconds: the terminal's buffer has long been full
            live.end(signal.SIGTERM)
        assert live.process.returncode == 0
        assert [file.name for file in tmp_path.iterdir()] == [path.name]
        assert len(replayed(path).estimate) > 100
        assert os.read(ours, 100)
    finally:
        os.close(ours)
        os.close(theirs)


def test_nobody_heard_is_a_bad_verdict_and_leaves_nothing(tmp_path):
    command = [sys.executable, "-m", "flownav", "live", "udp:0", "--duration", "0.5", "--json"]
    command += ["--record", str(tmp_path / "live.fnr")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "udp:0: no autopilot was received in 0.5 s" in done.stderr.splitlines()[-1]
    facts = json.loads(done.stdout)
    assert facts["vehicle"] is None
    assert facts["record"] is None
    assert not list(tmp_path.iterdir())
