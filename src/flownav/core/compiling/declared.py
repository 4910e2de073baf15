"""Declarations of equations to the compiler, kept until something is compiled: cached kernels need none of them.

Numba takes a third of a second to import, and as long again to take in a thousand equations. A process that only runs
what was compiled before never does either (`loaded`). One that has Numba already declares them at once, so that
functions compiled by Numba itself can call equations.
"""

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module

EXTENSIONS = "flownav.core.compiling.extensions"  # by name: what it imports has left word here
COMPILERS = ("numba", "llvmlite")
NEEDED = "this needs code that is not compiled yet, and so Numba: pip install 'flownav[compile]'"
_lock = threading.RLock()
_waiting: list[Callable[[], object]] = []
_begun = False


def when_compiling(declare: Callable[[], object]) -> None:
    """Do this before anything is compiled, in the order of these calls."""
    with _lock:
        _waiting.append(declare)
        if _begun:
            _declare()
        elif "numba" in sys.modules:
            begin_compiling()


def begin_compiling() -> None:
    """Import the compiler and declare all equations to it; from then on each new one is declared at once."""
    global _begun
    with _lock:
        if not _begun:
            with needing_compilers():
                _begun = True
                import_module(EXTENSIONS)
        _declare()


@contextmanager
def needing_compilers() -> Iterator[None]:
    """A block that imports the compiler. InputError where that is not installed, as beside kernels of a wheel."""
    global _begun
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in COMPILERS:
            raise
        from flownav.core.errors import InputError

        _begun = False
        raise InputError(NEEDED) from None


def _declare() -> None:
    while _waiting:
        _waiting.pop(0)()
