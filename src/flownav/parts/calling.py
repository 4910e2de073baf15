"""Python called from compiled loops: C functions with an address; their first exception is raised afterwards."""

import ctypes
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from flownav.core.errors import InputError

LONGEST_NAME, LONGEST_MESSAGE = 60, 400  # letters of a message; a compiler writes pages
KINDS = {"p": ctypes.c_void_p, "q": ctypes.c_void_p, "d": ctypes.c_double, "i": ctypes.c_int64}


class Mistakes:
    """The first exception of a flight's parts; after it none of them is called any more."""

    def __init__(self) -> None:
        self.name = ""
        self.first: BaseException | None = None

    def tell(self) -> None:
        """InputError with the part's exception as its cause, or Ctrl-C; nothing where all went well."""
        if self.first is None:
            return
        with naming_part(self.name):
            raise self.first


@contextmanager
def naming_part(name: str) -> Iterator[None]:
    """Turn a part's exception into an InputError of one line with that exception as its cause; Ctrl-C stays Ctrl-C."""
    try:
        yield
    except (InputError, KeyboardInterrupt):
        raise
    except BaseException as mistake:
        raise InputError(f"{name}: {words_of(mistake)}; mend it (the Python traceback says where)") from mistake


def words_of(mistake: BaseException) -> str:
    """An exception in one line, its kind and its message, if it has one."""
    try:
        message = " ".join(str(mistake).split())
    except Exception:
        message = ""
    half = LONGEST_MESSAGE // 2
    short = message if len(message) <= LONGEST_MESSAGE else f"{message[:half]} ... {message[-half:]}"
    return f"{type(mistake).__name__}: {short}" if short else type(mistake).__name__


class Called:
    """A Python function as a C function. signature: as of `flownav.core.compile.unit`, letters of KINDS."""

    def __init__(self, name: str, function: Callable[..., None], signature: str, mistakes: Mistakes) -> None:
        def guarded(*arguments: Any) -> None:
            if mistakes.first is None:
                try:
                    function(*arguments)
                except BaseException as mistake:
                    mistakes.name, mistakes.first = name, mistake

        kinds = [KINDS[letter] for letter in signature.split()]
        self.entry = ctypes.CFUNCTYPE(None, *kinds)(guarded)

    @property
    def address(self) -> int:
        """Valid for as long as this object is kept."""
        return int(ctypes.cast(self.entry, ctypes.c_void_p).value or 0)


def name_of(part: object) -> str:
    """How messages and records call a part: its `name`, or its class; in one short line whatever it is."""
    kind = part if isinstance(part, type) or inspect.isfunction(part) else type(part)
    named = str(getattr(part, "name", "") or kind.__name__)
    return " ".join("".join(letter if letter.isprintable() else " " for letter in named).split())[:LONGEST_NAME]
