"""Where the tests find the data and the paper's tables that do not ship with the project."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# NumPy, which reads this as it is imported, multiplies on as many threads as there are cores: where the workers keep
# the cores busy, those threads only wait for each other, and processor time is spent on that
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import hypothesis
import pytest

import command_tree
import compile_once
import rewrite_once
from browsing import CHROMIUM, QUIET
from places import SHARED

# a loaded machine draws slowly, and says nothing of the test by that
UNHURRIED = hypothesis.settings(deadline=None, print_blob=True, suppress_health_check=[hypothesis.HealthCheck.too_slow])
hypothesis.settings.register_profile("flownav", UNHURRIED, derandomize=True)  # every run draws the same
hypothesis.settings.register_profile("random", UNHURRIED)  # `make test-random` draws anew
hypothesis.settings.load_profile("flownav")

# thousands of tests and all that they import stay until the end: Python need not look for garbage among them each time
gc.set_threshold(50_000, 20, 20)
command_tree.keep()

if "PYTEST_XDIST_WORKER" in os.environ:
    compile_once.begin()


def pytest_sessionstart(session: pytest.Session) -> None:
    """A worker's share of what every worker needs, before it collects."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        rewrite_once.rewrite_share(session.config)


def pytest_collection_finish() -> None:
    """Leave collected objects, which are no garbage, out of every later search."""
    gc.collect()
    gc.freeze()


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


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Headless Chromium; a test that asks for it is skipped where there is none."""
    if CHROMIUM is None:
        pytest.skip("no Chromium here: install Debian's package `chromium` (apt-get install chromium)")
    api = pytest.importorskip("playwright.sync_api", reason="install `playwright` (dependency group `test`)")
    with api.sync_playwright() as running:
        opened = running.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        yield opened
        opened.close()
