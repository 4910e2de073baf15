"""Where a result came from: versions, inputs and their hashes, and the command that made it."""

import hashlib
import platform
import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from flownav.core.files import natural_order
from flownav.core.version import __version__

LIBRARIES = ("numpy", "numba", "scipy", "pyarrow")
_call: ContextVar[str | None] = ContextVar("call", default=None)


def provenance(inputs: Iterable[Path] = ()) -> dict[str, Any]:
    """Versions, time and the SHA-256 of every input file (a folder counts file by file)."""
    return {
        "flownav": __version__,
        "python": platform.python_version(),
        "libraries": {name: version_of(name) for name in LIBRARIES},
        "written_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "inputs": {str(file): hash_of(file) for path in inputs for file in _files(path)},
    }


@contextmanager
def called_as(call: str) -> Iterator[None]:
    """Within it results name this call of the Python API as their origin, and not a command."""
    before = _call.set(call)
    try:
        yield
    finally:
        _call.reset(before)


def command_line() -> str:
    """The command as typed, or the call of the Python API, for the report's 'how to reproduce'."""
    return _call.get() or shlex.join(["flownav", *sys.argv[1:]])


def command_words() -> list[str] | str:
    """The words of the command, or of the call from Python."""
    return _call.get() or ["flownav", *sys.argv[1:]]


def hash_of(file: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@cache
def code_sha256() -> str:
    """SHA-256 over the package's sources as they are now: results of another code are not to be mixed with these."""
    package = Path(__file__).parents[1]
    found = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        found.update(f"{source.relative_to(package).as_posix()} {hash_of(source)}\n".encode())
    return found.hexdigest()


def _files(path: Path) -> list[Path]:
    return sorted((f for f in path.iterdir() if f.is_file()), key=natural_order) if path.is_dir() else [path]


def version_of(name: str) -> str | None:
    """The version of a distribution; None where it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None
