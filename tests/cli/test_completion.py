"""Shells complete values too: asked as bash asks, through the completion that `--install-completion` installs.

One test asks a process of its own, as a shell does; the others ask in this one.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from flownav.cli import main


def asked(line: str) -> dict[str, str]:
    """The environment that bash sets when it completes the end of a line."""
    return {"_FLOWNAV_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}


@pytest.fixture
def completed(tmp_path, monkeypatch, capsys):
    """The completions that bash gets for the end of a line."""

    def offered(line: str) -> list[str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["flownav"])
        for name, value in asked(line).items():
            monkeypatch.setenv(name, value)
        with pytest.raises(SystemExit):
            main()
        told = capsys.readouterr()
        assert told.err == ""
        return told.out.split()

    return offered


@pytest.mark.parametrize(("line", "offered"), [
    ("flownav sam", ["sample"]),
    ("flownav fly land", ["landing"]),
    ("flownav fly landing --gps ", ["white", "midg"]),
    ("flownav fly landing --filter p", ["paper"]),
    ("flownav fly landing --vehicle quad", ["quad-450"]),
    ("flownav fly landing --truth ", ["nonlinear", "linear"]),
    ("flownav campaign landing tak", ["takeoff"]),
    ("flownav campaign landing --sampling s", ["sobol"]),
    ("flownav certify approach_", ["approach_8_m_s"]),
    ("flownav accuracy --cases takeoff,app", ["takeoff,approach", "takeoff,approach_8_m_s"]),
    ("flownav identify x --order 2", ["2", "2+delay"]),
    ("flownav identify x --for ", ["px4", "ardupilot", "inav"]),
    ("flownav export x.fnr --to e", ["euroc"]),
    ("flownav live udp:14550 --send l", ["landing-target"]),
    ("flownav sample data", ["dataflash"]),
    ("flownav faults --faults range_st", ["range_stuck", "range_stuck_descent"]),
    ("flownav vehicle he", ["hexa-550"]),
    ("flownav rig --firmware 2013", ["2013-06", "2013-09"]),
    ("flownav schema file-se", ["file-sensor", "file-settings"]),
])  # fmt: skip
def test_values_are_offered(completed, line, offered):
    assert completed(line) == offered


def test_files_are_offered_beside_the_names(tmp_path):
    (tmp_path / "windy.toml").touch()
    (tmp_path / "notes.txt").touch()
    (tmp_path / "sub").mkdir()
    done = subprocess.run(
        [sys.executable, "-m", "flownav"], capture_output=True, text=True, env={**os.environ, **asked("flownav fly ")},
        cwd=tmp_path, timeout=120, check=False,
    )  # fmt: skip
    assert done.stderr == ""
    found = done.stdout.split()
    assert found[:6] == ["sortie", "takeoff", "landing", "gusty", "pad_return", "approach"]
    assert set(found[6:]) == {"windy.toml", "sub/"}
