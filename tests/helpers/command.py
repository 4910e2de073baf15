"""`flownav` as a user types it, in this process: its exit status and what it prints."""

from __future__ import annotations

import io
import os
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from flownav.cli import main, option_of
from flownav.core.errors import BEGIN, END, FlownavError


class Done(NamedTuple):
    """The result of a command."""

    returncode: int
    stdout: str
    stderr: str


def printed(error: BaseException | None) -> str:
    """An error of flownav's as the command line prints it."""
    return error.naming(option_of) if isinstance(error, FlownavError) else str(error)


def run(*arguments: object, cwd: Path = Path("."), columns: str = "80") -> Done:
    """A command, typed in a folder, on a terminal of this number of columns."""
    out, told = io.StringIO(), io.StringIO()
    typed, environment = ["flownav", *map(str, arguments)], {"COLUMNS": columns}
    with chdir(cwd), patch.object(sys, "argv", typed), patch.dict(os.environ, environment):
        try:
            with redirect_stdout(out), redirect_stderr(told):
                main()
        except SystemExit as left:
            status = left.code
    assert isinstance(status, int)
    done = Done(status, out.getvalue(), told.getvalue())
    assert not {BEGIN, END} & {*done.stdout, *done.stderr}
    return done
