"""Python called from compiled loops: C functions with an address, whose first mistake is kept and told afterwards."""

import ctypes
import inspect
from collections.abc import Callable
from typing import Any

from flownav.core.errors import InputError

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
        if isinstance(self.first, InputError | KeyboardInterrupt):
            raise self.first
        kind = type(self.first).__name__
        said = " ".join(str(self.first).split())
        raise InputError(f"{self.name}: {kind}: {said}; mend it (the Python traceback says where)") from self.first


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
    """How messages and records call a part: its `name`, or its class."""
    kind = part if isinstance(part, type) or inspect.isfunction(part) else type(part)
    return str(getattr(part, "name", "") or kind.__name__)
