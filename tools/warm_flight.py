"""Where the processor time of a warm `flownav fly --no-report` goes, part by part: a Markdown table on standard output.

    python tools/warm_flight.py [SCENARIO]

Every part is timed without what it calls of the others. The least of three runs, each in a process of its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from time import process_time
from typing import Any

RUNS = 3
PARTS = (  # of modules as they are once the command is loaded: what, module, function
    ("reading and checking the scenario's files", "flownav.simulation.assemble", "assemble"),
    ("the flight itself", "flownav.simulation.flight", "fly_block"),
    ("names of kernels: what their code depends on", "flownav.core.compiling.cache", "file_name"),
    ("linking kernels", "flownav.core.compiling.loaded", "python_function"),
    ("linking kernels", "flownav.core.compiling.loaded", "c_function"),
    ("the record's tables", "flownav.simulation.flight_record", "record_of"),
    ("writing the record", "flownav.core.record_file", "save"),
    ("the table that is printed", "flownav.cli.fly", "show"),
)
LIBRARIES = "NumPy, pydantic, typer, rich, llvmlite, pyarrow"
IMPORTED = ("numpy", "pydantic", "typer", "rich.table", "llvmlite.binding", "pyarrow.parquet")


def measured(scenario: str) -> dict[str, float]:
    """Seconds of processor time by part, in this process."""
    import gc

    gc.set_threshold(50_000)
    start = process_time()
    for name in IMPORTED:
        __import__(name)
    libraries = process_time()
    import flownav.cli.fly
    import flownav.simulation.flight_record
    from flownav.api import flying  # noqa: F401

    loaded = process_time()
    spent: dict[str, float] = defaultdict(float)
    inside: list[float] = []
    for what, module, name in PARTS:
        _timed(sys.modules[module], name, what, spent, inside)
    with tempfile.TemporaryDirectory() as folder:
        sys.argv = ["flownav", "fly", scenario, "--no-report", "--out", f"{folder}/flight.fnr"]
        begun, output = process_time(), os.dup(1)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        try:
            flownav.cli.main()
        except SystemExit as ended:
            if ended.code:
                raise
        sys.stdout.flush()
        os.dup2(output, 1)
        flown = process_time() - begun
    rest = flown - sum(spent.values())
    return {
        "Python itself": start,
        f"libraries ({LIBRARIES})": libraries - start,
        "flownav's modules": loaded - libraries,
        **spent,
        "the command line and all else": rest,
    }


def _timed(module: Any, name: str, what: str, spent: dict[str, float], inside: list[float]) -> None:
    """Time a function wherever it has been imported to, without what it calls of the other parts."""
    function: Callable[..., Any] = getattr(module, name)

    class Timed:
        """The function, with everything else that it has."""

        @wraps(function, updated=())
        def __call__(self, *arguments: Any, **named: Any) -> Any:
            begun = process_time()
            inside.append(0.0)
            try:
                return function(*arguments, **named)
            finally:
                taken = process_time() - begun
                spent[what] += taken - inside.pop()
                if inside:
                    inside[-1] += taken

        def __getattr__(self, attribute: str) -> Any:
            return getattr(function, attribute)

    replacement: Any = Timed()
    for other in list(sys.modules.values()):
        if getattr(other, "__name__", "").startswith("flownav"):
            for place, value in list(vars(other).items()):
                if value is function:
                    setattr(other, place, replacement)


def main(scenario: str = "sortie") -> None:
    """Measure in processes of their own, and print the least of each part."""
    runs = []
    for _ in range(RUNS + 1):  # the first may compile
        command = [sys.executable, str(Path(__file__).resolve()), scenario, "--one"]
        runs.append(json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout))
    least = {what: min(run[what] for run in runs[1:]) for what in runs[1]}
    print(f"| `flownav fly {scenario} --no-report` | processor time [ms] |\n|---|---|")
    for what, seconds in least.items():
        print(f"| {what} | {1e3 * seconds:.0f} |")
    print(f"| **together** | **{1e3 * sum(least.values()):.0f}** |")


if __name__ == "__main__":
    if "--one" in sys.argv:
        print(json.dumps(measured(sys.argv[1])))
    else:
        main(*sys.argv[1:])
