"""The symbols that compiled code needs of the linker, and which of the package's functions are compiled."""

from __future__ import annotations

import dis
import importlib
import inspect
import math
import struct
from collections.abc import Iterator
from itertools import pairwise
from types import FunctionType
from typing import Any

import numpy as np

from flownav.core.compiling.closure import PACKAGE
from flownav.core.compiling.engine import EQUATIONS, Kernel
from flownav.core.compiling.loaded import kept
from flownav.core.compiling.units import Unit

SYMBOL_TABLE, SECTION_BYTES, SYMBOL_BYTES = 2, 64, 24
# Python's and Numba's own functions, in the wrapper and where an array is made; copying bytes computes nothing
HARMLESS = ("Py", "_Py", "NRT_", "numba_", "memset", "memcpy", "memmove")


def asked_for(code: bytes) -> set[str]:
    """The symbols that machine code does not define, but those that compute nothing."""
    return {name for name in undefined(code) if not name.startswith(HARMLESS)}


def undefined(elf: bytes) -> Iterator[str]:
    """The symbols that an ELF object file (64 bits, little-endian) does not define."""
    assert elf[:6] == b"\x7fELF\x02\x01"
    first, count = struct.unpack_from("<Q", elf, 0x28)[0], struct.unpack_from("<H", elf, 0x3C)[0]
    sections = [struct.unpack_from("<IIQQQQII", elf, first + SECTION_BYTES * i) for i in range(count)]
    for _, kind, _, _, place, size, link, _ in sections:
        if kind != SYMBOL_TABLE:
            continue
        for at in range(place + SYMBOL_BYTES, place + size, SYMBOL_BYTES):
            name, _, _, section = struct.unpack_from("<IBBH", elf, at)
            if section == 0:
                start = sections[link][4] + name
                yield elf[start : elf.index(b"\0", start)].decode()


def modules() -> list[Any]:
    """Every module of the package that compiles something."""
    names = [
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        for path in sorted(PACKAGE.rglob("*.py"))
        if "flownav.core.compile import" in path.read_text(encoding="utf-8")
    ]
    return [importlib.import_module(name.removesuffix(".__init__")) for name in names]


def parts() -> dict[int, Any]:
    """Every kernel and every unit of the package, by identity."""
    return {id(part): part for module in modules() for part in vars(module).values() if isinstance(part, Kernel | Unit)}


def codes(part: Any) -> Iterator[bytes]:
    """The machine code of a kernel, for each type of arguments that it was used with, or of a unit that was used."""
    names = part.files() if isinstance(part, Kernel) else [part.file_name()] if part.is_ready else []
    yield from (kept(name).code for name in names)


def compiled_functions() -> set[FunctionType]:
    """Every equation, procedure, kernel and unit's function of the package, as Python wrote it."""
    entries = [part.py_func if isinstance(part, Kernel) else part.function for part in parts().values()]
    functions = [inspect.unwrap(function) for function in (*entries, *EQUATIONS)]
    return {function for function in functions if (function.__module__ or "flownav").startswith("flownav")}


def borrowed(function: FunctionType) -> set[str]:
    """The names that a function takes from NumPy and from Python's math."""
    steps = list(dis.get_instructions(function))
    libraries = {name for name, value in function.__globals__.items() if value is np or value is math}
    return {
        str(then.argval)
        for step, then in pairwise(steps)
        if step.argval in libraries and then.opname in ("LOAD_ATTR", "LOAD_METHOD")
    }
