"""Numba, set up as flownav uses it: where kernels are cached, how they are optimised, what is compiled and how."""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])

LANES_WIDE = 16
WITHOUT_KERNELS = ("cli", "export", "faults", "inspection", "live", "logs", "mavlink", "paper", "report")


def _cache_folder() -> Path:
    """A folder per version of the source: Numba's own cache does not see a change in an inlined function.

    Rooms that hold no compiled code are left out, so that a change in a table or a page compiles nothing anew.
    """
    root = Path(os.environ.get("FLOWNAV_CACHE") or Path.home() / ".cache" / "flownav")
    digest = hashlib.sha256()
    package = Path(__file__).parents[1]
    for source in sorted(package.rglob("*.py")):
        if source.relative_to(package).parts[0] in WITHOUT_KERNELS:
            continue
        digest.update(str(source.relative_to(package)).encode())
        digest.update(source.read_bytes())
    return root / f"kernels-{digest.hexdigest()[:16]}"


def _prune(folder: Path, keep: int = 3) -> None:
    """Remove the kernels of older sources, the newest `keep` excepted."""
    siblings = sorted(folder.parent.glob("kernels-*"), key=lambda f: f.stat().st_mtime, reverse=True)
    for stale in [f for f in siblings if f != folder][keep:]:
        shutil.rmtree(stale, ignore_errors=True)


CACHE_FOLDER = _cache_folder()
os.environ["NUMBA_CACHE_DIR"] = str(CACHE_FOLDER)

import numba  # noqa: E402  (the cache folder is set first)
from llvmlite import binding as llvm  # noqa: E402
from numba.extending import register_jitable  # noqa: E402

setattr(numba.config, "CACHE_DIR", str(CACHE_FOLDER))  # noqa: B010  (set at run time, unknown to type checkers)

# A lane loop must reach the vectoriser as a loop. Left alone, LLVM fully unrolls one whose body is still a
# call (equations are inlined later) and the lanes come out scalar; loops of 8 and fewer may unroll.
# No loop is unrolled in part: loops over states, whose bounds are known, would be, for no speed and half the compile
# time (landing filter, scalar / 16 lanes: 50 / 69 -> 35 / 36 CPU s at the same 34 / 285 ms a block).
llvm.set_option("flownav", f"--unroll-full-max-count={LANES_WIDE // 2}")
llvm.set_option("flownav", "--unroll-max-count=1")

# Where the processor has 512-bit vectors, use them (LLVM prefers 256 bits by default; measured 15 % faster).
_HOST_FEATURES = llvm.get_host_cpu_features()
if _HOST_FEATURES.get("avx512f") and not os.environ.get("NUMBA_CPU_FEATURES"):
    setattr(numba.config, "CPU_FEATURES", _HOST_FEATURES.flatten() + ",-prefer-256-bit")  # noqa: B010


# what only kernels call needs no entry for Python and for C, which would take as long to compile as a short law
UNWRAPPED = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def equation(function: Function) -> Function:
    """A scalar law: plain Python where Python calls it, compiled and inlined where a kernel does."""
    return register_jitable(forceinline=True, **UNWRAPPED)(function)


def kernel(function: Function) -> Function:
    """An entry point built from equations: releases the lock, cached on disk."""
    return cast(Function, numba.njit(nogil=True, cache=True, error_model="numpy")(function))


def procedure(function: Function) -> Function:
    """An equation too long to be inlined: kernels call it, and it is compiled once for each type of its arguments."""
    return register_jitable(**UNWRAPPED)(function)


@contextmanager
def announce_compilation(what: str) -> Iterator[None]:
    """Say on standard error that kernels are being compiled, once, the first time after a change."""
    marker = CACHE_FOLDER / f"{what.replace(' ', '-')}.compiled"
    if marker.exists():
        yield
        return
    start = time.perf_counter()
    print(f"flownav: compiling the {what} kernels (once, up to 20 s) ...", file=sys.stderr, flush=True)
    yield
    CACHE_FOLDER.mkdir(parents=True, exist_ok=True)
    marker.touch()
    _prune(CACHE_FOLDER)
    print(f"flownav: compiled in {time.perf_counter() - start:.1f} s", file=sys.stderr, flush=True)
