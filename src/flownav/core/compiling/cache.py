"""Compiled kernels on disk: one file for each kernel, signature and state of its sources; none can do harm.

A file is named after everything that its machine code depends on, so there is no index and nothing goes stale: the
import closure of the kernel's module (`closure.py`), the types of its arguments, its constants, the processor level
and the versions of the compilers. It begins with a checksum of the rest. Files are looked for first among those that
a wheel carries, which nobody writes, then in the user's cache (`FLOWNAV_CACHE`, `~/.cache/flownav`).

What is damaged is compiled anew and replaced. A folder that cannot be written, or belongs to somebody else (a cache
holds code that is run), is not used, which is said in one line on standard error.
"""

import hashlib
import inspect
import os
import pickle
import platform
import re
import shutil
import sys
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any, cast

import llvmlite
import numba
import numpy as np
from numba import types
from numba.core.caching import _Cache
from numba.core.typing.templates import Signature

from flownav.core.compiling.closure import PACKAGE, Sources, is_foreign
from flownav.core.compiling.target import target_description
from flownav.core.files import written_whole

MAGIC = b"flownav kernel 1\n"
SUFFIX = ".kernel"
UNUSED_DAYS = 60.0
SHIPPED = PACKAGE / "kernels"
VERSIONS = (
    f"numba {numba.__version__}, llvmlite {llvmlite.__version__}, numpy {'.'.join(np.__version__.split('.')[:2])}, "
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
        self._told: set[str] = set()
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
            self.own.mkdir(parents=True, exist_ok=True)
            return self._usable and os.access(self.own, os.W_OK | os.X_OK) and not is_foreign(self.own.stat())
        except OSError:
            return False

    def save(self, name: str, payload: bytes) -> None:
        """Keep these bytes, or say why that cannot be."""
        if not self._usable:
            return
        try:
            self.own.mkdir(parents=True, exist_ok=True)
            if is_foreign(self.own.stat()):
                self._give_up("it belongs to another user")
                return
            with written_whole(self.own / name) as file:
                file.write_bytes(MAGIC + hashlib.sha256(payload).digest() + payload)
            self._prune()
        except OSError as error:
            self._give_up(error.strerror or str(error))

    def damaged(self, name: str, why: str) -> None:
        """Say that a file is damaged; it is compiled anew and replaced."""
        self._tell(f"the cached kernel {name.split('-')[0]} is damaged ({why}): compiling it anew")

    def _read(self, path: Path, shipped: bool) -> bytes | None:
        try:
            with path.open("rb") as file:
                if not shipped and (is_foreign(os.fstat(file.fileno())) or is_foreign(self.own.stat())):
                    self._give_up("it belongs to another user")
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
        self._tell(f"compiled kernels are not kept in {self.own} ({why}); FLOWNAV_CACHE can name another folder")

    def _tell(self, message: str) -> None:
        if message not in self._told:
            self._told.add(message)
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
    """The time of a file tells when it was last used, to the day."""
    if time.time() - path.stat().st_mtime > 86400.0:
        os.utime(path)


STORE = Store(cache_folder(), SHIPPED)


def depends_also(module: str, laws: Collection[Callable[..., Any]], said: str) -> None:
    """Whatever is compiled from a module is, in this process, also made of these laws, and of what is said."""
    generated = " ".join(law.__code__.co_filename for law in laws if law.__code__.co_filename.startswith("<flownav"))
    others = {law.__module__ for law in laws if not law.__code__.co_filename.startswith("<flownav")}
    STORE.sources.extend(module, others, f"{said} {generated}")


class KernelCache(_Cache):
    """Numba's interface to the store, for one function with these constants."""

    def __init__(self, function: Callable[..., Any], constants: dict[str, Any]) -> None:
        self._function = function
        self._constants = constants

    @property
    def cache_path(self) -> str:
        """The folder, as Numba's statistics show it."""
        return str(STORE.own)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function of this signature, or None: it must be compiled."""
        name = self.file_name(sig)
        payload = STORE.load(name) if name is not None else None
        if name is None or payload is None:
            return None
        try:
            reduced = pickle.loads(payload)
            return numba.core.compiler.CompileResult._rebuild(target_context, *reduced)
        except Exception as error:
            STORE.damaged(name, type(error).__name__)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled function, unless it holds addresses of this process."""
        name = self.file_name(sig)
        if name is None or data.lifted or data.library.has_dynamic_globals:
            return
        data = data._replace(type_annotation="")  # a listing of the whole function, of no use to anybody
        STORE.save(name, numba.core.serialize.dumps(data._reduce()))

    def file_name(self, sig: Any) -> str | None:
        """The name of this function's file: everything that its code depends on, hashed; None if that is unknown."""
        stamp = STORE.sources.stamp(set(_modules(self._function, self._constants)))
        inner = inspect.getclosurevars(self._function).nonlocals
        described = f"{_described(sig)} {_constant(self._constants)} {_constant(dict(inner))}"
        if stamp is None or " at 0x" in described:
            return None
        function = f"{self._function.__module__}.{self._function.__qualname__}"
        file = self._function.__code__.co_filename
        generated = file if file.startswith("<") else ""  # such a name holds a hash of the source
        everything = "\n".join([function, generated, stamp, described, target_description(), VERSIONS])
        readable = re.sub(r"[^A-Za-z0-9_.]", "", function.removeprefix("flownav."))
        return f"{readable}-{hashlib.sha256(everything.encode()).hexdigest()[:24]}{SUFFIX}"

    def enable(self) -> None:
        """Numba's switch; this cache is always on."""

    def disable(self) -> None:
        """Numba's switch; this cache is always on."""

    def flush(self) -> None:
        """Numba's broom; nothing here goes stale."""


def _modules(function: Callable[..., Any], constants: dict[str, Any]) -> Iterator[str]:
    """The function's module; those of the functions and classes it names, which matter if it is a generated one."""
    yield "flownav.core.compile"
    yield function.__module__
    named = [function.__globals__.get(name) for name in function.__code__.co_names]
    for value in [*named, *constants.values(), *inspect.getclosurevars(function).nonlocals.values()]:
        module = value.__name__ if inspect.ismodule(value) else getattr(value, "__module__", None)
        if isinstance(module, str) and module.split(".")[0] == PACKAGE.name:
            yield module


def _described(kind: Any) -> str:
    """A Numba type, or a tuple of them, in words that are the same in every process; classes by module and fields."""
    if isinstance(kind, tuple):
        return "(" + ", ".join(map(_described, kind)) + ")"
    if isinstance(kind, types.BaseTuple):
        parts = ", ".join(_described(part) for part in cast(Any, kind))
        cls = getattr(kind, "instance_class", tuple)
        return f"{cls.__module__}.{cls.__qualname__}[{', '.join(getattr(cls, '_fields', ()))}: {parts}]"
    if isinstance(kind, Signature):
        return f"{_described(kind.args)} -> {_described(kind.return_type)}"
    return str(kind)


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
