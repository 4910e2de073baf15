"""Kernels for a wheel: what a cache holds for one processor level, compiled for another, and run by nobody.

Which kernels the commands use, and with arguments of which types, is found by running the commands at a level that
this machine has. Their files say of which function and types they are: that is compiled again for the level of this
process (`FLOWNAV_LEVEL`) into its cache (`FLOWNAV_CACHE`), so that a machine may build what it cannot run.
"""

import importlib
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from flownav.core.compiling.cache import SUFFIX, Store
from flownav.core.compiling.engine import Kernel
from flownav.core.compiling.loaded import MachineCode
from flownav.core.compiling.units import Unit


def compile_again(folder: Path) -> int:
    """Compile for this process's level what the cache `folder` holds for another; how many kernels these are.

    ValueError where a file is damaged, or of a function that is no kernel.
    """
    store = Store(folder, folder)
    names = sorted(path.name for path in store.own.glob(f"*{SUFFIX}"))
    for name in names:
        payload = store.load(name)
        if payload is None:
            raise ValueError(f"{name} cannot be read")
        _library, described, _environment, signature, *_ = MachineCode(*pickle.loads(payload)).unpickled()
        made = 0
        for part in parts_of(described.modname, described.qualname):
            made += 1
            if isinstance(part, Unit):
                assert part.address
            else:
                part.dispatcher.compile(signature.args)
        if not made:
            raise ValueError(f"{name}: {described.modname} has no kernel {described.qualname}")
    return len(names)


def parts_of(module: str, function: str) -> Iterator[Any]:
    """The kernel of a function, or its units: one function may be compiled with several constants."""
    for value in vars(importlib.import_module(module)).values():
        if (isinstance(value, Kernel) and value.py_func.__qualname__ == function) or (
            isinstance(value, Unit) and value.function.__qualname__ == function
        ):
            yield value


if __name__ == "__main__":
    print(compile_again(Path(sys.argv[1])))
