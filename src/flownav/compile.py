"""The only place that knows Numba: scalar equations, procedures, the kernels built from them, and lanes.

An `@equation` is a short pure function of scalars and named tuples. Called from Python it is plain Python,
which takes floats, complex numbers (for exact derivatives) and, where it has no branch, NumPy arrays; called
from a kernel it is compiled and inlined. A `@procedure` is an equation too long for that: it is compiled once
and called. A `@kernel` is an entry point: it releases the interpreter lock and is cached on disk.

*Lanes* are flights that a kernel advances side by side. A kernel takes a lane marker, `ONE_LANE` or
`LANES`, whose length is part of its type and so a compile-time constant: the same source compiles to the
scalar build (one lane) and to the vectorised one (`reference/compute-core.md` measured the pattern).
State lives in one flat buffer, a row of `len(lanes)` values for each scalar, at constant row offsets.

Floating-point contraction is off, so that a flight has the same bytes alone, in any batch and on any
number of threads.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import struct
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])

LANES_WIDE = 16
WITHOUT_KERNELS = ("cli", "export", "faults", "inspection", "live", "logs", "mavlink", "paper", "report")
ONE_LANE: tuple[int, ...] = (0,)
LANES: tuple[int, ...] = (0,) * LANES_WIDE


def _cache_folder() -> Path:
    """A folder per version of the source: Numba's own cache does not see a change in an inlined function.

    Rooms that hold no compiled code are left out, so that a change in a table or a page compiles nothing anew.
    """
    root = Path(os.environ.get("FLOWNAV_CACHE") or Path.home() / ".cache" / "flownav")
    digest = hashlib.sha256()
    package = Path(__file__).parent
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
import numpy as np  # noqa: E402
from llvmlite import binding as llvm  # noqa: E402
from llvmlite import ir  # noqa: E402
from numba import types  # noqa: E402
from numba.extending import intrinsic, overload, register_jitable  # noqa: E402

setattr(numba.config, "CACHE_DIR", str(CACHE_FOLDER))  # noqa: B010  (set at run time, unknown to type checkers)

# A lane loop must reach the vectoriser as a loop. Left alone, LLVM fully unrolls one whose body is still a
# call (equations are inlined later) and the lanes come out scalar; loops of 8 and fewer may unroll.
llvm.set_option("flownav", f"--unroll-full-max-count={LANES_WIDE // 2}")

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


def lane_access(bundle: type, row: int) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """`load(work, lanes, lane)` and `store(work, lanes, lane, value)` of a named tuple kept in a lane buffer.

    `bundle` is a NamedTuple class of scalars, `row` the constant row of its first field. Field `i` of lane
    `k` lies at `(row + i) * len(lanes) + k`. The two functions are written out field by field because LLVM
    vectorises straight-line code only.
    """
    fields: tuple[str, ...] = bundle._fields  # type: ignore[attr-defined]
    loads = ", ".join(f"work[{row + i} * len(lanes) + lane]" for i in range(len(fields)))
    stores = "\n".join(f"    work[{row + i} * len(lanes) + lane] = value.{name}" for i, name in enumerate(fields))
    scope: dict[str, Any] = {"bundle": bundle}
    exec(f"def load(work, lanes, lane):\n    return bundle({loads})\n", scope)
    exec(f"def store(work, lanes, lane, value):\n{stores}\n", scope)
    return equation(scope["load"]), equation(scope["store"])


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


# -- scalar helpers that work on floats, on complex numbers (complex step) and inside lanes ---------------
@equation
def larger(a: float, b: float) -> float:
    """max(a, b) by real part; a select, so lanes stay vectorised and complex steps pass."""
    return a if a.real > b.real else b


@equation
def smaller(a: float, b: float) -> float:
    """min(a, b) by real part."""
    return a if a.real < b.real else b


@equation
def magnitude(a: float) -> float:
    """|a| as an analytic function of a: -a where the real part is negative."""
    return a if a.real >= 0.0 else -a


@equation
def clamp(a: float, low: float, high: float) -> float:
    """a held between low and high."""
    return larger(low, smaller(a, high))


# -- the bits of a float, and back: for polynomial logarithms and exponentials ----------------------------
def float_from_bits(bits: Any) -> float:
    """The float64 that these 64 bits (uint64) spell."""
    return float(struct.unpack("<d", struct.pack("<Q", int(bits)))[0])


def bits_from_float(value: float) -> Any:
    """The 64 bits (uint64) of a float64."""
    return np.uint64(struct.unpack("<Q", struct.pack("<d", value))[0])


@intrinsic
def _bitcast_to_float(typing_context: Any, bits: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.uint64), generate


@intrinsic
def _bitcast_to_bits(typing_context: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.uint64(types.float64), generate


@overload(float_from_bits, inline="always")
def _compiled_float_from_bits(bits):  # type: ignore[no-untyped-def]
    return lambda bits: _bitcast_to_float(bits)  # type: ignore[call-arg]


@overload(bits_from_float, inline="always")
def _compiled_bits_from_float(value):  # type: ignore[no-untyped-def]
    return lambda value: _bitcast_to_bits(value)  # type: ignore[call-arg]
