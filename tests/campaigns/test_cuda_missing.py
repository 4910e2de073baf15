"""Without a device, or without numba-cuda, one line says so and what to do."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec

import pytest

from command import run

ASKED = ["flownav", "campaign", "landing", "--flights", "2", "--engine", "cuda"]
WITHOUT_DEVICE = os.environ | {"NUMBA_DISABLE_CUDA": "1", "CUDA_VISIBLE_DEVICES": ""}


def complaint(folder, done):
    assert done.returncode == 2
    assert done.stdout == ""
    assert not folder.exists()
    (line,) = done.stderr.strip().splitlines()
    return line


@pytest.fixture(params=["in a process of its own", "as JSON"])
def line(request, tmp_path, monkeypatch):
    """For people as a driver without a device answers; as JSON where none is reported."""
    folder = tmp_path / "campaign"
    if request.param != "as JSON":
        command = [sys.executable, "-m", *ASKED, "--out", folder]
        return complaint(folder, subprocess.run(command, env=WITHOUT_DEVICE, capture_output=True, text=True))
    if find_spec("numba_cuda") is not None:
        monkeypatch.setattr("numba.cuda.is_available", lambda: False)
    return complaint(folder, run(*ASKED[1:], "--out", folder, "--json", cwd=tmp_path))


def test_no_device_is_one_line_that_says_what_to_do(line):
    assert "--engine cuda" in line
    assert "use --engine local" in line
    assert "no CUDA device was found" in line or "numba-cuda is not installed" in line


@pytest.mark.parametrize("more", [["--plan"], ["--out", "certificate"]])
def test_a_plan_needs_the_device_as_its_flights_do(tmp_path, monkeypatch, more):
    if find_spec("numba_cuda") is not None:
        monkeypatch.setattr("numba.cuda.is_available", lambda: False)
    done = run("certify", "approach", "--engine", "cuda", *more, cwd=tmp_path)
    assert "--engine cuda: " in complaint(tmp_path / "certificate", done)


def test_a_missing_library_is_named_with_its_extra(monkeypatch):
    from flownav.campaigns.cuda import Cuda
    from flownav.core.errors import InputError

    monkeypatch.delenv("NUMBA_ENABLE_CUDASIM", raising=False)
    monkeypatch.setitem(sys.modules, "numba_cuda", None)
    with pytest.raises(InputError, match=r"^engine cuda: numba-cuda is not installed .*flownav.gpu.*engine local"):
        Cuda()
