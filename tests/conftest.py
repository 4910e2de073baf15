"""Where the tests find the data and the paper's tables that do not ship with the project."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from places import SHARED


def _folder(variable: str, name: str) -> Path:
    folder = Path(os.environ.get(variable) or SHARED / name)
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent: set {variable} to the folder of {name} files to run this test")
    return folder


@pytest.fixture(scope="session")
def data_folder() -> Path:
    return _folder("FLOWNAV_DATA", "data")


@pytest.fixture(scope="session")
def paper_folder() -> Path:
    return _folder("FLOWNAV_PAPER", "paper")
