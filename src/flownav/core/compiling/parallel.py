"""A unit compiled in a second process while this one compiles the kernel that calls it.

LLVM and Python hold one lock each in a process, so a second thread would wait; a second process does not. It puts the
unit into the cache, from where this one loads it. Whatever goes wrong there (killed, no memory, another version of a
file) costs time only: what is not in the cache afterwards is compiled here.
"""

import importlib
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from flownav.core.compiling.cache import STORE
from flownav.core.compiling.engine import Kernel
from flownav.core.compiling.progress import PROGRESS
from flownav.core.compiling.units import Unit

PATIENCE_S = 300.0  # how long the other process may take when this one has done its part
_one_at_a_time = threading.RLock()
_in_between: list[Callable[[], object]] = []
_begun: dict[tuple[str, str], subprocess.Popen[bytes]] = {}


def compile_in_parallel(unit: Unit, kernel: Any, *arguments: Any, whole: str = "") -> None:
    """Make a unit and a kernel ready for calls with such arguments: side by side where neither is in the cache.

    The arguments are only looked at for their types; whole: what both are together, in words for people. Does nothing
    where only one is missing, where this process may use but one core, or where the cache cannot be written: they are
    compiled when they are called.
    """
    with _one_at_a_time:
        name = name_of(unit)
        if unit.is_ready or name is None or not _are_both_missing(unit, kernel, arguments) or not can_pay():
            return
        with PROGRESS.expect(2, whole), _compiling_elsewhere(unit.__name__, name) as other:
            kernel.prepare(*arguments)
            for work in _in_between if other is not None else ():
                work()
            if other is not None:
                with suppress(subprocess.TimeoutExpired):
                    other.wait(PATIENCE_S)


def begin_in_parallel(module: str, name: str) -> None:
    """Where nothing has ever been compiled, begin on a unit that will be needed before what needs it is imported.

    `compile_in_parallel` takes the process over; it ends with this process otherwise.
    """
    if STORE.is_empty() and can_pay() and not _begun:
        with suppress(OSError):
            _begun[module, name] = _start((module, name))


@contextmanager
def meanwhile(work: Callable[[], object]) -> Iterator[None]:
    """Within the block, run `work` while this process waits for the other one's unit: work that is needed next anyway.

    Where nothing is waited for it is not done.
    """
    _in_between.append(work)
    try:
        yield
    finally:
        _in_between.remove(work)


def _are_both_missing(unit: Unit, kernel: Any, arguments: tuple[Any, ...]) -> bool:
    """Whether unit and kernel are neither known here nor on disk, but can be kept there."""
    if not isinstance(kernel, Kernel) or kernel.is_ready(*arguments):
        return False
    files = unit.file_name(), kernel.file_name(*arguments)
    return not any(file is None or STORE.holds(file) for file in files)


def can_pay() -> bool:
    """Whether a second process would have a core of its own, and a folder to put its work into."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return cores > 1 and STORE.is_writable()


def name_of(unit: Unit) -> tuple[str, str] | None:
    """The module of a unit and its name there; None where another process could not find it by these."""
    module = sys.modules.get(unit.function.__module__)
    if module is None or module.__name__ == "__main__":
        return None
    return next(((module.__name__, name) for name, value in vars(module).items() if value is unit), None)


@contextmanager
def _compiling_elsewhere(what: str, name: tuple[str, str]) -> Iterator[subprocess.Popen[bytes] | None]:
    """Another process that compiles a unit, or None where none can be had; it is gone after the block."""
    try:
        other = _begun.pop(name, None) or _start(name)
    except OSError:
        yield None
        return
    while _begun:
        _end(_begun.popitem()[1])
    PROGRESS.begin(what)
    try:
        yield other
    finally:
        PROGRESS.end(what, other.poll() == 0)
        _end(other)


def _start(name: tuple[str, str]) -> subprocess.Popen[bytes]:
    """A process that imports what this one does, and ends when this one ends: its standard input is then closed."""
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
    return subprocess.Popen(
        [sys.executable, "-P", "-m", __name__, *name],
        env={**os.environ, "PYTHONPATH": paths, "FLOWNAV_CACHE": str(STORE.own.parent)},
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _end(other: subprocess.Popen[bytes]) -> None:
    """Leave no process and none of its half-written files."""
    other.kill()
    other.wait()
    if other.stdin is not None:
        other.stdin.close()
    with suppress(OSError):
        for part in STORE.own.glob(f".*.{other.pid}.part"):
            part.unlink()


def _end_with_parent() -> None:
    """End this process as soon as its standard input is closed."""
    sys.stdin.buffer.read()
    os._exit(1)


def main(module: str, name: str) -> None:
    """Compile a unit into the cache."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    unit: Unit = getattr(importlib.import_module(module), name)
    assert unit.address
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
