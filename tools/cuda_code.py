"""Sizes of the code for a CUDA device: `python tools/cuda_code.py` prints a table, and needs no GPU.

For each filter: how long numba-cuda, NVVM and NVIDIA's assembler take, how large the code is, and the assembler's
report on registers, stack and spills. It needs the extra `gpu`.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from cuda import pathfinder

from flownav.campaigns.cuda import Cuda, truths_of
from flownav.campaigns.device_flight import take_here
from flownav.core.compiling.device import call_instead, lowered
from flownav.core.compiling.launch import argument_names, argument_type, per_thread
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario, with_filter

H200 = (9, 0)
HEADINGS = ("filter", "numba-cuda s", "NVVM s", "assembler s", "PTX MB", "cubin MB", "registers", "stack B",
            "spilled B", "read back B", "loads", "stores")  # fmt: skip


class Compiling:
    """Stands in a device's place: what it should run it compiles, and keeps a row of the table of."""

    in_python = False
    row: tuple[Any, ...] = ()

    def __init__(self) -> None:
        call_instead(take_here)

    def free_bytes(self) -> int:
        """Enough."""
        return 1 << 40

    def put(self, value: Any) -> Any:
        """The value itself."""
        return value

    def new(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """Zeros."""
        return np.zeros(shape, dtype)

    def fetch(self, array: Any) -> Any:
        """The array itself."""
        return array

    def run(self, function: Callable[..., None], threads: int, told: dict[str, Any], constants: dict[str, Any]) -> None:
        """Compile the function for an H200."""
        arguments = (threads, *(told[name] for name in argument_names(function, constants)))
        began_s = time.perf_counter()
        library = lowered(per_thread(function, constants), tuple(map(argument_type, arguments)), H200)
        lowered_s = time.perf_counter()
        ptx = library.get_asm_str(cc=(*H200, ""))
        ptx_s = time.perf_counter()
        said, size = assembled(ptx)
        done_s = time.perf_counter()
        entry = said[said.index(library._entry_name) :]
        memory = [int(n) for n in re.findall(r"(\d+) bytes (?:stack frame|spill stores|spill loads)", entry)[:3]]
        registers = max(int(n) for n in re.findall(r"Used (\d+) registers", said))
        loads, stores = (len(re.findall(rf"^\s+{kind}\.global", ptx, re.M)) for kind in ("ld", "st"))
        times = (lowered_s - began_s, ptx_s - lowered_s, done_s - ptx_s)
        self.row = (*times, len(ptx) / 1e6, size / 1e6, registers, *memory, loads, stores)


def assembled(ptx: str) -> tuple[str, int]:
    """The assembler's report, and the size of its machine code."""
    assembler = pathfinder.find_nvidia_binary_utility("ptxas")
    with tempfile.TemporaryDirectory() as folder:
        source, code = Path(folder) / "flight.ptx", Path(folder) / "flight.cubin"
        source.write_text(ptx)
        command = [str(assembler), "-arch=sm_90", "-v", str(source), "-o", str(code)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return done.stderr, code.stat().st_size


def main() -> None:
    """The table, a row a filter."""
    print("| " + " | ".join(HEADINGS) + " |\n|" + "---|" * len(HEADINGS))
    for name in ("paper", "landing"):
        flight, runner = assemble(with_filter(load_scenario("landing"), name)).flight, Compiling()
        list(Cuda(runner).rows(flight, 1, 0, 1, truths_of(flight, 1, None)))
        cells = [f"{value:.1f}" if isinstance(value, float) else str(value) for value in runner.row]
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
