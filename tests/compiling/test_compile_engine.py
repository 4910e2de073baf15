"""Kernels compiled the lean way behave as Numba's own."""

from __future__ import annotations

import os
import sys
from typing import NamedTuple

import numba
import numpy as np
import pytest

from flownav.core.compile import LANES, ONE_LANE, equation, kernel, pointer, procedure, sparingly, unit
from flownav.core.compiling import target
from flownav.core.compiling.cache import STORE
from flownav.core.compiling.engine import FEW_STEPS, MOST_SPARED
from flownav.core.compiling.level import LEVELS, level
from forking import nursery

ROTATIONS = """
import hashlib
import numpy as np
from flownav.core.compile import LANES, equation, kernel, pointer
from flownav.core.frames import rotation_from_quaternion

@equation
def turned(w, x, y, z):
    r = rotation_from_quaternion(w, x, y, z)
    return r[0] * x + r[1] * y + r[2] * z + 0.1, r[3] * w - r[4] * x / (1.0 + r[5] * r[5])

@kernel
def turn(work, lanes):
    p = pointer(work)
    for _ in range(20):
        for lane in range(len(lanes)):
            a, b = turned(p[lane], p[len(lanes) + lane], p[2 * len(lanes) + lane], p[3 * len(lanes) + lane])
            p[lane], p[2 * len(lanes) + lane] = a / (1.0 + a * a), b / (1.0 + b * b)

work = np.random.default_rng(7).normal(size=4 * len(LANES))
turn(work, LANES)
print(hashlib.sha256(work.tobytes()).hexdigest(), len(work))
"""


@equation
def halved(x):
    if x < 0.0:
        raise ValueError("x is negative")
    return 0.5 * x


@procedure
def rooted(x):
    return np.sqrt(halved(x))


@equation
def rows(work, lanes, first):
    for lane in range(len(lanes)):
        work[first * len(lanes) + lane] = rooted(work[first * len(lanes) + lane])


@kernel
def treat(work, lanes):
    p = pointer(work)
    rows(p, lanes, 0)
    rows(p, lanes, 1)


@kernel
def treat_twice(work, lanes):
    treat(work, lanes)
    treat(work, lanes)


@numba.njit(error_model="numpy")
def treat_plainly(work, lanes):
    rows(work, lanes, 0)
    rows(work, lanes, 1)


@kernel
def total(count):
    numbers = np.empty(count)
    for i in range(count):
        numbers[i] = i
    return numbers.sum(), numbers


def _work(lanes):
    return np.arange(1.0, 1.0 + 2 * len(lanes))


@pytest.mark.parametrize("lanes", [ONE_LANE, LANES])
def test_kernels_call_equations_procedures_and_kernels(lanes):
    work = _work(lanes)
    expected = np.sqrt(0.5 * np.sqrt(0.5 * work))
    treat_twice(work, lanes)
    np.testing.assert_array_equal(work, expected)
    assert target.is_lean() or os.environ.get("FLOWNAV_PLAIN")


@pytest.mark.parametrize("lanes", [ONE_LANE, LANES])
def test_plain_numba_calls_equations_that_a_kernel_has_compiled(lanes):
    treat(_work(lanes), lanes)
    work = _work(lanes)
    treat_plainly(work, lanes)
    np.testing.assert_array_equal(work, np.sqrt(0.5 * _work(lanes)))
    treat(_work(lanes), lanes)


def test_an_error_in_an_equation_reaches_python():
    work = _work(ONE_LANE)
    work[1] = -1.0
    with pytest.raises(ValueError, match="x is negative"):
        treat(work, ONE_LANE)


def test_a_kernel_allocates_and_returns():
    result, numbers = total(5)
    assert result == 10.0
    assert numbers.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_an_error_in_a_unit_is_told_and_kept_from_its_caller(monkeypatch):
    """C has no exceptions: Python reports them through its hook for exceptions that cannot be raised."""

    def fail(p):
        if p[0] < 0.0:
            raise ValueError("p is negative")
        p[0] = 1.0

    told = []
    monkeypatch.setattr(sys, "unraisablehook", lambda told_of: told.append(str(told_of.exc_value)))
    values = np.array([-1.0])
    unit(fail, "p")(values)
    assert told == ["p is negative"]
    values[0] = 2.0
    unit(fail, "p")(values)
    assert values[0] == 1.0


def test_lanes_are_vectorised():
    """The machine code of a lane loop works on whole registers."""

    @equation
    def scaled(x):
        return 3.0 * x + 1.0

    @kernel
    def scale(work, lanes):
        p = pointer(work)
        for lane in range(len(lanes)):
            p[lane] = scaled(p[lane])

    scale.dispatcher(_work(LANES), LANES)
    (code,) = scale.dispatcher.inspect_asm().values()
    assert "vmulpd" in code


@pytest.fixture(scope="module")
def rotations(tmp_path_factory):
    """The program's output with such an environment; each process compiles, or loads the kernels that one like it
    has kept.
    """
    place = tmp_path_factory.mktemp("rotations")
    program = place / "program.py"
    program.write_text(ROTATIONS)

    def run(**environment):
        done = mother.run(program, {**os.environ, "FLOWNAV_CACHE": str(place / "cache"), **environment})
        assert done.returncode == 0, done.stderr
        return done.stdout

    with nursery() as mother:
        yield run


@pytest.mark.parametrize("asked_level", ["x86-64-v3", "host"])
def test_every_level_gives_the_same_bits(asked_level, rotations):
    """Contraction is off, so no processor level rounds differently; one that this machine has not is not tried."""
    if asked_level == "x86-64-v3" and level().name not in LEVELS:
        pytest.skip("this machine has no such level")
    ours, theirs = (rotations(FLOWNAV_LEVEL=asked) for asked in (level().name, asked_level))
    assert ours == theirs
    assert len(ours.split()) == 2


def test_lean_and_plain_give_the_same_bits(rotations):
    ours, plain = (rotations(FLOWNAV_PLAIN=asked) for asked in ("", "1"))
    assert ours == plain


class Told(NamedTuple):
    """Something that is there."""

    value: float


@procedure
def never_taken(told):
    """A branch that no compiler can type, were it to look at it."""
    return told.nothing_of_this_name


@equation
def doubled_if_told(told):
    return never_taken(told) if told is None else 2.0 * told.value


def test_what_is_done_for_the_lack_of_something_that_is_there_is_not_compiled():
    @kernel
    def run(value):
        return doubled_if_told(Told(value))

    assert run(3.0) == 6.0


def test_a_kernel_is_spared_a_few_times_for_few_steps(monkeypatch):
    @kernel
    def root(value):
        return np.sqrt(value)

    monkeypatch.setattr(STORE, "holds", lambda name: False)  # whatever an earlier run has kept
    for _ in range(MOST_SPARED):
        assert sparingly(root, 1, 2.0) == np.sqrt(2.0)
        assert not root.is_ready(2.0)
    assert sparingly(root, 1, 2.0) == np.sqrt(2.0)
    assert root.is_ready(2.0)


def test_a_kernel_that_was_kept_is_not_spared(monkeypatch):
    @kernel
    def cube(value):
        return value**3

    monkeypatch.setattr(STORE, "holds", lambda name: True)
    assert sparingly(cube, 1, 2.0) == 8.0
    assert cube.is_ready(2.0)


def test_a_kernel_is_compiled_for_many_steps():
    @kernel
    def half(value):
        return 0.5 * value

    assert sparingly(half, FEW_STEPS + 1, 2.0) == 1.0
    assert half.is_ready(2.0)
