"""Compiled kernels on disk: one file for each kernel, signature and state of its sources; none can do harm.

A file is named after everything that its machine code depends on, so there is no index and nothing goes stale: the
import closure of the kernel's module (`closure.py`), the types of its arguments, its constants, the processor level
and the versions of the compilers. It begins with a checksum of the rest. Files are looked for first among those that
a wheel carries, which nobody writes, then in the user's cache (`FLOWNAV_CACHE`, `~/.cache/flownav`).

A damaged file is compiled anew and replaced. A folder that cannot be written, or that somebody else owns or may write
to (a cache holds code that is run), or that lies in such a folder or behind such a user's link, is not used, which one
line on standard error states.
"""

import hashlib
import inspect
import os
import platform
import re
import shutil
import sys
import time
from collections.abc import Callable, Collection, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.compiling.closure import OWN_FILE, OWN_FOLDER, PACKAGE, Sources, distrusted, distrusted_folder
from flownav.core.compiling.level import target_description
from flownav.core.files import written_whole

MAGIC = b"flownav kernel 1\n"
SUFFIX = ".kernel"
UNUSED_DAYS = 60.0
SHIPPED = PACKAGE / "kernels"
COMPILERS = "compilers.txt"  # beside kernels that a wheel carries: the versions that made them


def compilers(shipped: Path = SHIPPED) -> str:
    """The versions of the compilers; without them, of those that made the kernels of this wheel; "" without either."""
    try:
        return f"numba {version('numba')}, llvmlite {version('llvmlite')}"
    except PackageNotFoundError:
        made_by = shipped / COMPILERS
        return made_by.read_text(encoding="utf-8") if made_by.is_file() else ""


VERSIONS = (
    f"{compilers()}, numpy {'.'.join(np.__version__.split('.')[:2])}, "
    f"{platform.python_implementation()} {sys.version_info[0]}.{sys.version_info[1]}, {sys.platform}"
)


def cache_folder() -> Path:
    """Where this user's kernels are kept."""
    return Path(os.environ.get("FLOWNAV_CACHE") or os.path.expanduser("~/.cache/flownav"))


class Store:
    """Named pieces of bytes in a folder of one's own and, read only, in the folder that a wheel carries."""

    def __init__(self, own: Path, shipped: Path) -> None:
        self.own = own / "kernels"
        self.shipped = shipped
        self.sources = Sources(own / "sources.json")
        self._printed: set[str] = set()
        self._usable = True

    def load(self, name: str) -> bytes | None:
        """The bytes of that name, or None where there are none that can be trusted."""
        return self._read(self.shipped / name, True) or (self._read(self.own / name, False) if self._usable else None)

    def holds(self, name: str) -> bool:
        """Whether there is a file of that name, whatever is in it."""
        return (self.shipped / name).is_file() or (self.own / name).is_file()

    def is_empty(self) -> bool:
        """Whether nothing has been compiled yet."""
        return not any(any(folder.glob(f"*{SUFFIX}")) for folder in (self.shipped, self.own))

    def is_writable(self) -> bool:
        """Whether what is saved would be kept."""
        try:
            return self._usable and not self._make() and os.access(self.own, os.W_OK | os.X_OK)
        except OSError:
            return False

    def save(self, name: str, payload: bytes) -> None:
        """Keep these bytes, or report why that cannot be."""
        if not self._usable:
            return
        try:
            if why := self._make():
                self._give_up(why)
                return
            with written_whole(self.own / name) as file:
                file.touch(OWN_FILE)
                file.write_bytes(MAGIC + hashlib.sha256(payload).digest() + payload)
            self._prune()
        except OSError as error:
            self._give_up(error.strerror or str(error))

    def _make(self) -> str:
        """Make the folder, which no other user may write to whatever the umask; why it is not to be trusted, or ""."""
        if why := self._distrusted():
            return why
        self.own.parent.mkdir(OWN_FOLDER, parents=True, exist_ok=True)
        self.own.mkdir(OWN_FOLDER, exist_ok=True)
        return self._distrusted()

    def _distrusted(self) -> str:
        """Why somebody else could change what is kept, by the folder or the one that it lies in; "" where nobody."""
        return distrusted_folder(self.own.parent, sticky=True) or distrusted_folder(self.own)

    def damaged(self, name: str, why: str) -> None:
        """Report that a file is damaged; it is compiled anew and replaced."""
        self._print(f"the cached kernel {name.split('-')[0]} is damaged ({why}): compiling it anew")

    def _read(self, path: Path, shipped: bool) -> bytes | None:
        try:
            if not shipped and (why := self._distrusted()):
                self._give_up(why)
                return None
            with path.open("rb") as file:
                if not shipped and (why := distrusted(os.fstat(file.fileno()))):
                    self._give_up(why)
                    return None
                content = file.read()
            if not shipped:
                _mark_used(path)
        except FileNotFoundError:
            return None
        except OSError as error:
            self._give_up(error.strerror or str(error))
            return None
        start = len(MAGIC) + 32
        if not content.startswith(MAGIC) or hashlib.sha256(content[start:]).digest() != content[len(MAGIC) : start]:
            self.damaged(path.name, "its checksum is wrong")
            return None
        return content[start:]

    def _give_up(self, why: str) -> None:
        self._usable = False
        self._print(f"compiled kernels are not kept in {self.own} ({why}); FLOWNAV_CACHE can name another folder")

    def _print(self, message: str) -> None:
        if message not in self._printed:
            self._printed.add(message)
            print(f"flownav: {message}", file=sys.stderr, flush=True)

    def _prune(self) -> None:
        """Remove what has not been used for long."""
        horizon = time.time() - UNUSED_DAYS * 86400.0
        for path in self.own.glob(f"*{SUFFIX}"):
            if path.stat().st_mtime < horizon:
                path.unlink(missing_ok=True)
        for folder in self.own.parent.glob("kernels-*"):  # of versions that kept one for each state of the sources
            shutil.rmtree(folder, ignore_errors=True)


def _mark_used(path: Path) -> None:
    """Set the time of a file to that of its last use, to the day."""
    if time.time() - path.stat().st_mtime > 86400.0:
        os.utime(path)


STORE = Store(cache_folder(), SHIPPED)


def depends_also(module: str, laws: Collection[Callable[..., Any]], reason: str) -> None:
    """Note that all code compiled from a module is, in this process, also made of these laws, and of the text
    `said`.
    """
    generated = " ".join(law.__code__.co_filename for law in laws if law.__code__.co_filename.startswith("<flownav"))
    others = {law.__module__ for law in laws if not law.__code__.co_filename.startswith("<flownav")}
    STORE.sources.extend(module, others, f"{reason} {generated}")


def file_name(function: Callable[..., Any], constants: dict[str, Any], kinds: str) -> str | None:
    """The name of a function's file: everything that its code depends on, hashed; None if that is unknown.

    kinds: the types of its arguments in words (`words`).
    """
    stamp = STORE.sources.stamp(set(_modules(function, constants)))
    inner = inspect.getclosurevars(function).nonlocals
    described = f"{kinds} {_constant(constants)} {_constant(dict(inner))}"
    if stamp is None or " at 0x" in described:
        return None
    name = f"{function.__module__}.{function.__qualname__}"
    file = function.__code__.co_filename
    generated = file if file.startswith("<") else ""  # such a name holds a hash of the source
    everything = "\n".join([name, generated, stamp, described, target_description(), VERSIONS])
    readable = re.sub(r"[^A-Za-z0-9_.]", "", name.removeprefix("flownav."))
    return f"{readable}-{hashlib.sha256(everything.encode()).hexdigest()[:24]}{SUFFIX}"


def _modules(function: Callable[..., Any], constants: dict[str, Any]) -> Iterator[str]:
    """The function's module; those of the functions and classes it names, which matter if it is a generated one."""
    yield "flownav.core.compile"
    yield "flownav.core.compiling.compiler"
    yield "flownav.core.compiling.extensions"
    yield "flownav.core.compiling.intrinsics"
    yield function.__module__
    named = [function.__globals__.get(name) for name in function.__code__.co_names]
    for value in [*named, *constants.values(), *inspect.getclosurevars(function).nonlocals.values()]:
        module = value.__name__ if inspect.ismodule(value) else getattr(value, "__module__", None)
        if isinstance(module, str) and module.split(".")[0] == PACKAGE.name:
            yield module


def _constant(value: Any) -> str:
    """A constant in words: numbers to the last bit, functions and classes by name, arrays by their bytes."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_constant(value[key])}" for key in sorted(value)) + "}"
    if isinstance(value, tuple):
        return f"{type(value).__qualname__}(" + ", ".join(map(_constant, value)) + ")"
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
    if callable(value):
        return f"{value.__module__}.{value.__qualname__}"
    return repr(value)
