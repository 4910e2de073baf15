"""Kernels of a wheel where neither Numba nor llvmlite is installed: they run; what is not compiled is one line."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig

import pytest

from without_compilers import command, libraries, with_kernels

pytestmark = pytest.mark.skipif(
    sysconfig.get_platform() != "linux-x86_64", reason="wheels with kernels are built there"
)
PARTS = """
import numpy as np
from flownav.core.compile import equation, kernel, unit

@equation
def law(x):
    return 3.0 * x + 0.1

@kernel
def put(out, factor=2.0):
    for i in range(len(out)):
        if out[i] < 0.0:
            raise ValueError("a value is negative")
        out[i] = factor * law(np.sqrt(out[i]))

def shift(p, n):
    for i in range(n):
        p[i] = p[i] + 1.0

SHIFT = unit(shift, "p", n=2)
"""
PROGRAM = """
import importlib.util
import numpy as np
from flownav.core.errors import InputError
from parts_of_program import SHIFT, put

out = np.arange(5.0)
put(out, 2.0)
SHIFT(out)
print(out.tobytes().hex())
for call in (lambda o: put(o), lambda o: put(o, factor=2.0), lambda o: put(factor=2.0, out=o)):
    other = np.arange(5.0)
    call(other)
    print(other.tobytes().hex())
try:
    put(-out, 2.0)
except ValueError as error:
    print(error)
if importlib.util.find_spec("numba") is None:
    for ask in (lambda: put(out.astype(np.float32), 2.0), lambda: put([1.0], 2.0), put.prepare):
        try:
            ask()
        except InputError as error:
            print(error)
    import flownav
    try:
        flownav.build("linux-x86_64", "never")
    except InputError as error:
        print(error)
"""
NEEDED = "this needs code that is not compiled yet, and so Numba: pip install 'flownav[compile]'"


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    folder = tmp_path_factory.mktemp("without")
    (folder / "program.py").write_text(PROGRAM)
    (folder / "parts_of_program.py").write_text(PARTS)
    return folder


def ran(environment, words, folder):
    done = subprocess.run(words, env=environment, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines(), done.stderr


def test_kernels_run_without_their_compiler_and_what_is_not_compiled_is_one_line(places):
    program = places / "program.py"
    compiled, _ = ran({**os.environ, "FLOWNAV_CACHE": str(places / "cache")}, [sys.executable, program], places)
    package = with_kernels(places / "package", (places / "cache" / "kernels").glob("*.kernel"))
    paths = os.pathsep.join(map(str, (package, libraries(places / "libraries"))))
    outside = {**os.environ, "PYTHONPATH": paths, "FLOWNAV_CACHE": str(places / "none")}
    without, stated = ran(outside, command(program), places)
    assert without == [*compiled, *[NEEDED] * 4]
    assert len(set(compiled[1:4])) == 1  # by keyword and with a default it is the same code
    assert compiled[4] == "a value is negative"
    assert stated == ""
    assert not list((places / "none").rglob("*.kernel"))
