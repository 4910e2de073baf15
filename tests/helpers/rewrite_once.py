"""The test files of a fresh checkout are made ready for pytest by all workers, each its share, not by each all of them.

pytest rewrites the assertions of a file and keeps the result beside it. Every worker collects every file, and two that
begin together would rewrite each of them twice. A file whose turn comes before its worker is done with it is rewritten
by whoever needs it, as ever.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import pytest
from _pytest.assertion import rewrite


def rewrite_share(config: pytest.Config) -> None:
    """Rewrite this worker's share of the files below what was asked for, where it is not there."""
    number = int(os.environ["PYTEST_XDIST_WORKER"].removeprefix("gw"))
    for file in asked_for(config)[number :: int(os.environ["PYTEST_XDIST_WORKER_COUNT"])]:
        folder = rewrite.get_cache_dir(file)
        kept = folder / (file.name.removesuffix(".py") + rewrite.PYC_TAIL)
        if rewrite._read_pyc(file, kept) is None and rewrite.try_makedirs(folder):
            with suppress(SyntaxError):  # collecting the file says what is wrong with it
                status, code = rewrite._rewrite_test(file, config)
                rewrite._write_pyc(config.stash[rewrite.assertstate_key], code, status, kept)


def asked_for(config: pytest.Config) -> list[Path]:
    """The test files in the folders that are to be tested, in one order."""
    folders = {config.invocation_params.dir / argument for argument in config.args}
    return sorted({file for folder in folders if folder.is_dir() for file in folder.rglob("test_*.py")})
