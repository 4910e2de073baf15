"""The time of `import flownav` in a fresh interpreter, and of the first use of a name of the API."""

from __future__ import annotations

import subprocess
import sys

import pytest

NOTHING = "pass"
CODES = {
    "an interpreter that imports nothing": NOTHING,
    "import flownav": "import flownav",
    "flownav.Record": "import flownav; flownav.Record",
    "flownav.fly": "import flownav; flownav.fly",
}


@pytest.mark.parametrize("what", CODES)
def test_bench_import(benchmark, what):
    benchmark.group = "a fresh interpreter"
    benchmark.extra_info["what"] = what
    benchmark.pedantic(
        lambda: subprocess.run([sys.executable, "-c", CODES[what]], check=True), rounds=9, warmup_rounds=2
    )
