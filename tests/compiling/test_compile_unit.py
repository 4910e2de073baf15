"""Units: the same function as plain Python, as C, and with its constants bound."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest

from flownav.core.compile import LANES, ONE_LANE, unit
from flownav.core.compiling import target
from flownav.core.compiling.compiler import without_surprises

SCALE = 3.0


def scale_lanes(work, lanes, rows, factor, *, sign=1):
    """Every row times a factor."""
    for row in range(rows):
        for lane in range(len(lanes)):
            work[row * len(lanes) + lane] = sign * factor * SCALE * work[row * len(lanes) + lane]


ONE = unit(scale_lanes, "p i d", lanes=ONE_LANE, sign=-1)
MANY = unit(scale_lanes, "p i d", lanes=LANES, sign=-1)


@pytest.mark.parametrize(("part", "lanes"), [(ONE, ONE_LANE), (MANY, LANES)])
def test_compiled_and_python_agree(part, lanes):
    work = np.random.default_rng(2).normal(size=7 * len(lanes))
    expected, by_python, by_address = work.copy(), work.copy(), work.copy()
    expected[:] = -(2.0 * SCALE) * expected
    part(work, 7, 2.0)
    part.python(by_python, 7, 2.0)
    part(by_address.ctypes.data_as(ctypes.c_void_p), 7, 2.0)
    np.testing.assert_array_equal(work, expected)
    np.testing.assert_array_equal(by_python, expected)
    np.testing.assert_array_equal(by_address, expected)


def test_the_address_stays():
    assert ONE.address == ONE.address != MANY.address


def test_the_function_keeps_its_name_and_words():
    assert ONE.__name__ == "scale_lanes"
    assert ONE.__doc__ == "Every row times a factor."


def test_a_constant_of_an_enclosing_function_is_bound_too():
    offset = 5.0

    def shift(p, n):
        for i in range(n):
            p[i] = p[i] + offset

    work = np.zeros(2)
    unit(shift, "p", n=2)(work)
    assert work.tolist() == [5.0, 5.0]


@pytest.mark.parametrize("argument", [np.zeros(4, np.float32), np.zeros((4, 4))[:, 1], np.zeros(4, np.int64)])
def test_a_wrong_array_is_refused(argument):
    with pytest.raises(TypeError, match="contiguous array of float64"):
        ONE(argument, 1, 1.0)


def test_a_wrong_count_of_arguments_is_refused():
    with pytest.raises(TypeError, match="takes 3 arguments, not 2"):
        ONE(np.zeros(4), 1)


def test_an_unknown_letter_is_refused():
    with pytest.raises(ValueError, match="not x"):
        unit(scale_lanes, "p x")


def test_an_unknown_constant_is_refused():
    with pytest.raises(TypeError, match="has no parameter width"):
        unit(scale_lanes, "p i d", lanes=LANES, width=3)(np.zeros(16), 1, 1.0)


def test_a_wrong_unit_does_not_change_how_the_others_are_compiled():
    before = target.is_lean()
    with pytest.raises(TypeError, match="has no parameter width"):
        unit(scale_lanes, "p i d", lanes=LANES, width=3)(np.zeros(16), 1, 1.0)
    assert target.is_lean() == before


def test_where_only_the_plain_way_works_it_is_kept_and_said(monkeypatch, capsys):
    monkeypatch.setattr(target.Leanness, "wanted", True)

    def compile_it():
        if target.is_lean():
            raise AttributeError("no such part")
        return "compiled"

    assert without_surprises(compile_it) == "compiled"
    assert not target.is_lean()
    assert "compiles the slow way here (AttributeError: no such part)" in capsys.readouterr().err
