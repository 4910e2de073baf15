"""The processor level that kernels are compiled for, and everything else about the target that their code depends on.

Kernels are made for a *processor level* (x86-64-v3 with 256-bit vectors, x86-64-v4 with 512) rather than for this very
processor, so that they can be shipped; a processor of no such level gets code of its own. `FLOWNAV_LEVEL` names a level
to compile for, which this machine need not have.
"""

import os
import platform
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

# A lane loop must reach the vectoriser as a loop. Left alone, LLVM fully unrolls one whose body is still a
# call (equations are inlined later) and the lanes come out scalar; loops of 8 and fewer may unroll.
# No loop is unrolled in part: loops over states, whose bounds are known, would be, for no speed and half the compile
# time (landing filter, scalar / 16 lanes: 50 / 69 -> 35 / 36 CPU s at the same 34 / 285 ms a block).
LLVM_OPTIONS = ("--unroll-full-max-count=8", "--unroll-max-count=1")


class Level(NamedTuple):
    """A processor as LLVM knows it."""

    name: str
    cpu: str
    features: str


# 512-bit vectors are asked for where they exist: LLVM prefers 256 bits by default (measured 15 % slower)
LEVELS = {
    "x86-64-v3": Level("x86-64-v3", "x86-64-v3", ""),
    "x86-64-v4": Level("x86-64-v4", "x86-64-v4", "-prefer-256-bit"),
}
# the marks of each level, highest first (x86-64 psABI, 1.0, table 3.1), as LLVM names them
MARKS = {
    "x86-64-v4": ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"),
    "x86-64-v3": ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"),
}
OF_LINUX = {"bmi": "bmi1", "lzcnt": "abm"}  # the marks that Linux names otherwise
PROCESSOR = Path("/proc/cpuinfo")


class Leanness:
    """Whether functions are compiled as `target.LeanLibrary` does, or as Numba does by itself (`FLOWNAV_PLAIN=1`).

    Without it nothing of Numba's inside is replaced either: not `remembered.PATCHES`, `handed` or `spelled`.
    """

    wanted = not os.environ.get("FLOWNAV_PLAIN")


@cache
def level() -> Level:
    """The level that kernels are compiled for in this process."""
    asked = os.environ.get("FLOWNAV_LEVEL")
    if asked in LEVELS:
        return LEVELS[asked]
    if asked != "host" and (known := _known_level(_marks())):
        return known
    try:
        from llvmlite import binding as llvm  # 45 MB, which nothing else needs that compiles nothing
    except ImportError:
        return Level("host", "", "")  # no kernel is made for it
    features = llvm.get_host_cpu_features()
    if asked != "host" and (known := _known_level({name for name, there in features.items() if there})):
        return known
    wider = ",-prefer-256-bit" if features.get("avx512f") else ""
    return Level("host", llvm.get_host_cpu_name(), features.flatten() + wider)


def _known_level(marks: set[str]) -> Level | None:
    """The level of a processor with these marks, None of any other."""
    if platform.machine().lower() not in ("x86_64", "amd64") or not marks.issuperset(MARKS["x86-64-v3"]):
        return None
    return LEVELS["x86-64-v4" if marks.issuperset(MARKS["x86-64-v4"]) else "x86-64-v3"]


def _marks() -> set[str]:
    """The marks of this processor that Linux lets programs use; none elsewhere."""
    try:
        text = PROCESSOR.read_text(encoding="ascii", errors="replace")
    except OSError:
        return set()
    flags = next((line.split() for line in text.splitlines() if line.startswith("flags")), [])
    return {mark for level in MARKS.values() for mark in level if OF_LINUX.get(mark, mark) in flags}


def target_description() -> str:
    """Everything about the target and the optimiser that machine code depends on, in words."""
    how = "lean" if Leanness.wanted else "plain"
    return f"{sys.platform} {platform.machine()} {' '.join(level())} {' '.join(LLVM_OPTIONS)} {how}"
