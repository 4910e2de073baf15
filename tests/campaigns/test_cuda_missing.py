"""Without a device, or without numba-cuda, one line says so and what to do."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

ASKED = [sys.executable, "-m", "flownav", "campaign", "landing", "--flights", "2", "--engine", "cuda"]
WITHOUT_DEVICE = os.environ | {"NUMBA_DISABLE_CUDA": "1", "CUDA_VISIBLE_DEVICES": ""}


def complaint(tmp_path, *more):
    done = subprocess.run(
        [*ASKED, "--out", tmp_path / "campaign", *more], env=WITHOUT_DEVICE, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert not (tmp_path / "campaign").exists()
    (line,) = done.stderr.strip().splitlines()
    return line


@pytest.mark.parametrize("more", [[], ["--json"]], ids=["for people", "as JSON"])
def test_no_device_is_one_line_that_says_what_to_do(tmp_path, more):
    line = complaint(tmp_path, *more)
    assert "--engine cuda" in line
    assert "use --engine local" in line
    assert "no CUDA device was found" in line or "numba-cuda is not installed" in line


def test_a_missing_library_is_named_with_its_extra(monkeypatch):
    from flownav.campaigns.cuda import Cuda
    from flownav.core.errors import InputError

    monkeypatch.delenv("NUMBA_ENABLE_CUDASIM", raising=False)
    monkeypatch.setitem(sys.modules, "numba_cuda", None)
    with pytest.raises(InputError, match=r"^engine cuda: numba-cuda is not installed .*flownav.gpu.*engine local"):
        Cuda()
