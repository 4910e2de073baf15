"""Pieces of memory that are free go back to the system."""

from __future__ import annotations

import subprocess
import sys

import pytest

SCRIPT = """
import numpy as np
from flownav.campaigns.run import give_back_early
if {early}:
    give_back_early()
def rss():
    return int(open("/proc/self/status").read().split("VmRSS:")[1].split()[0])
np.ones(30 << 17)  # 30 MB, freed at once: from now on glibc keeps pieces of this size
before = rss()
pieces = [np.ones(1 << 18) for _ in range(40)]  # 80 MB
last = np.ones(1 << 10)
del pieces
print(rss() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="of glibc")
def test_free_memory_goes_back():
    done = subprocess.run([sys.executable, "-c", SCRIPT.format(early=True)], check=True, capture_output=True, text=True)
    assert int(done.stdout) < 10_000  # none is kept; without it, 20 000
