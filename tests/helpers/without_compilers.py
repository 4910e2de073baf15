"""flownav without Numba and llvmlite: all libraries of this installation but those, and kernels as a wheel has them."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

import build_wheel
from flownav.core.compiling.closure import PACKAGE

COMPILERS = ("numba", "llvmlite")


def libraries(folder: Path) -> Path:
    """A folder of links to all that is installed here but the compilers and flownav itself."""
    folder.mkdir()
    for site in map(Path, sys.path):
        for entry in site.iterdir() if site.name.endswith("-packages") else ():
            if not entry.name.startswith((*COMPILERS, "flownav", "__editable__")) and entry.suffix != ".pth":
                (folder / entry.name).symlink_to(entry)
    return folder


def with_kernels(folder: Path, kernels: Iterable[Path]) -> Path:
    """A folder with flownav as a wheel with these kernels has it."""
    package = folder / PACKAGE.name
    package.mkdir(parents=True)
    for entry in PACKAGE.iterdir():
        if entry.name not in ("kernels", "__pycache__"):
            (package / entry.name).symlink_to(entry)
    (package / "kernels").mkdir()
    for kernel in kernels:
        shutil.copy(kernel, package / "kernels")
    build_wheel.put_runtime(package / "kernels")
    return folder


def command(*words: object) -> list[str]:
    """This Python without its own libraries."""
    return [sys.executable, "-S", *map(str, words)]
