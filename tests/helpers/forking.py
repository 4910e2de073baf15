"""Small programs that compile, in processes of their own that find Numba ready: forked from one that has used it.

Of flownav a program still imports everything anew, with its own environment. What must not share another process's
addresses is run by a fresh interpreter.
"""

from __future__ import annotations

import json
import os
import runpy
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple


class Done(NamedTuple):
    """The result of a program."""

    returncode: int
    stdout: str
    stderr: str


class Nursery:
    """Runs programs one after the other, as `python -W error -B PROGRAM` would with that environment."""

    def __init__(self, serving: subprocess.Popen[str], folder: Path) -> None:
        self._serving, self._folder = serving, folder

    def run(self, program: Path, environment: Mapping[str, str]) -> Done:
        """A program to its end; its environment is this one alone."""
        said = {"out": str(self._folder / "out"), "err": str(self._folder / "err")}
        asked = {"program": str(program), "environment": dict(environment), **said}
        assert self._serving.stdin is not None
        assert self._serving.stdout is not None
        self._serving.stdin.write(json.dumps(asked) + "\n")
        self._serving.stdin.flush()
        status = self._serving.stdout.readline()
        assert status, "the process that programs fork from has died"
        return Done(int(status), *(Path(file).read_text(encoding="utf-8") for file in said.values()))


@contextmanager
def nursery() -> Iterator[Nursery]:
    """A process that has used Numba and has nothing of flownav; it ends with the block."""
    alone = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # a process of several threads does not fork
    command = [sys.executable, "-W", "error", "-B", __file__]
    pipes: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(command, env=alone, text=True, **pipes) as serving,
    ):
        try:
            yield Nursery(serving, Path(folder))
        finally:
            assert serving.stdin is not None
            serving.stdin.close()


def serve() -> dict[str, Any] | None:
    """In each process that is forked, what it was asked for; None where nothing more is asked."""
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            return dict(json.loads(line))
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)
    return None


def interruptible() -> None:
    """Ctrl-C reaches this process, though who runs the tests may ignore it (nohup, a shell's background)."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def become(asked: dict[str, Any]) -> None:
    """Run the program as if it were all that this process ever did."""
    interruptible()
    for number, file in enumerate((os.devnull, asked["out"], asked["err"])):
        opened = os.open(file, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(opened, number)
        os.close(opened)
    os.environ.clear()
    os.environ.update(asked["environment"])
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[:] = [str(Path(asked["program"]).parent), *paths, *sys.path[1:]]
    sys.argv = [asked["program"]]
    runpy.run_path(asked["program"], run_name="__main__")


if __name__ == "__main__":
    import numba

    numba.njit("float64(float64[::1])", error_model="numpy")(lambda values: values[0] + 1.0)  # its tables are filled
    if told := serve():
        become(told)
