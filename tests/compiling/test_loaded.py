"""Kernels that were kept run without Numba: the same bytes, also where Numba is imported after them."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from flownav.core.compile import kernel, unit
from flownav.core.compiling import loaded
from flownav.core.compiling.engine import file_name
from flownav.core.compiling.words import words_of

PARTS = """
from typing import NamedTuple
import numpy as np
from flownav.core.compile import equation, kernel, procedure, unit

class Pair(NamedTuple):
    first: np.ndarray
    factor: float

@equation
def law(x, factor):
    return factor * x + 0.1

@procedure
def rooted(x):
    return np.sqrt(x)

@kernel
def put(pair, out):
    for i in range(len(out)):
        out[i] = rooted(law(pair.first[i], pair.factor))

@kernel
def again(pair, out):
    put(pair, out)
    put(pair, out)

@kernel
def refuse(x):
    if x < 0.0:
        raise ValueError("x is negative")
    return x + 1.0

def shift(p, n):
    for i in range(n):
        p[i] = p[i] + 1.0

SHIFT = unit(shift, "p", n=2)
"""
PROGRAM = """
import sys
import numpy as np
from parts_of_program import SHIFT, Pair, again, put, refuse

out = np.zeros(5)
put(Pair(np.arange(5.0), 3.0), out)
SHIFT(out)
print(out.tobytes().hex(), refuse(1.0))
print("numba" in sys.modules)
if len(sys.argv) > 1:
    again(Pair(np.arange(5.0), 3.0), out)
    print(out.tobytes().hex())
    try:
        refuse(-1.0)
    except ValueError as error:
        print(error)
"""


@pytest.fixture
def run(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    (tmp_path / "parts_of_program.py").write_text(PARTS)
    environment = {**os.environ, "FLOWNAV_CACHE": str(tmp_path / "cache")}

    def once(*words):
        done = subprocess.run([sys.executable, program, *words], env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    return once


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere Numba loads what was kept")
def test_what_was_kept_runs_without_numba_and_beside_it(run):
    compiled, imported = run()
    assert imported == "True"
    assert run() == [compiled, "False"]
    expected = np.sqrt(3.0 * np.arange(5.0) + 0.1)
    _, _, twice, error = run("and then compile")
    assert twice == expected.tobytes().hex()
    assert error == "x is negative"
    assert run("and then compile")[2:] == [twice, error]


def test_where_numba_is_not_as_supposed_it_loads_its_code_itself(monkeypatch):
    @kernel
    def tripled(x):
        return 3.0 * x

    assert tripled(2.0) == 6.0
    name = file_name(tripled.py_func, {}, words_of((2.0,)))
    assert loaded.python_function(name)(2.0) == 6.0
    monkeypatch.setattr(loaded, "LIBRARIES", ("numba._helperlib", "numba._of_another_version", loaded.RUNTIME))
    loaded.runtime.cache_clear()
    try:
        assert loaded.python_function(name) is None
        tripled._entries.clear()
        assert tripled(2.0) == 6.0
    finally:
        loaded.runtime.cache_clear()


def test_nothing_is_loaded_of_what_was_not_kept():
    assert loaded.python_function(None) is None
    assert loaded.c_function("no such kernel-0.kernel") is None


def test_a_unit_that_was_kept_has_an_address_that_works():
    def doubled(p):
        p[0] = 2.0 * p[0]

    first = unit(doubled, "p")
    values = np.array([1.5])
    first(values)
    second = unit(doubled, "p")
    second(values)
    assert values[0] == 6.0
