"""`flownav app` as it is typed: what it needs, where it listens, how lightly it starts, how it ends."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from command import run
from flownav.app.server import listening
from forking import interruptible


@pytest.mark.parametrize("package", ["uvicorn", "starlette.applications"])
def test_a_missing_extra_is_one_line_with_what_installs_it(tmp_path, monkeypatch, package):
    pytest.importorskip("uvicorn")
    monkeypatch.setitem(sys.modules, package, None)
    done = run("app", "--no-browser", "--folder", "x", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "flownav: flownav app needs the packages starlette and uvicorn: pip install 'flownav[app]'\n"


def test_a_port_that_is_taken_is_one_line(tmp_path):
    pytest.importorskip("uvicorn")
    with listening(0) as taken:
        taken.listen()
        port = taken.getsockname()[1]
        done = run("app", "--no-browser", "--port", port, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"flownav: --port {port}: cannot be used (")


def test_it_starts_lightly_says_where_it_is_and_ends_at_ctrl_c(tmp_path):
    pytest.importorskip("uvicorn")
    typed = [sys.executable, "-m", "flownav", "app", "--no-browser", "--json"]
    begun = subprocess.Popen(typed, cwd=tmp_path, stdout=subprocess.PIPE, preexec_fn=interruptible)
    try:
        said = json.loads(begun.stdout.readline())
        with urllib.request.urlopen(f"{said['address']}api/state", timeout=120) as answer:
            assert json.load(answer)["files"] == []
        status = Path(f"/proc/{begun.pid}/status").read_text()
        ticks = Path(f"/proc/{begun.pid}/stat").read_text().rpartition(")")[2].split()[11:13]
        begun.send_signal(signal.SIGINT)
        assert begun.wait(120.0) == 0
    finally:
        begun.kill()
        begun.wait()
        begun.stdout.close()
    assert said["address"].startswith("http://127.0.0.1:")
    assert len(said["address"].split("/")[3]) >= 32
    assert int(re.search(r"VmHWM:\s+(\d+)", status)[1]) < 150_000
    assert sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK") < 1.5  # processor seconds: about 0.4 on a quiet machine
