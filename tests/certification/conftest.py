"""A folder with a certificate, made once for this room's tests, and a copy of it for each."""

from __future__ import annotations

import shutil

import pytest

from certificates import STRICT, run
from flownav.core.errors import VerdictError
from requirements import HEAD, WINDY, write


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """A folder with a certificate that fails, and its requirement."""
    place = tmp_path_factory.mktemp("made")
    path = write(place, HEAD + WINDY + STRICT)
    done = run(path, "--out", place / "out", "--ranking", 16, "--records", 1)
    assert isinstance(done.exception, VerdictError)
    return place


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    """A copy of it, with the requirement where it was."""
    return shutil.copytree(made / "out", tmp_path / "out")
