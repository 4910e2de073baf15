"""Records of the package are passed whole, whoever compiles the caller; others as Numba does it."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
import pytest
from llvmlite import ir
from numba.core.datamodel.manager import DataModelManager
from numba.core.datamodel.registry import default_manager

from flownav.core.compile import LANES, ONE_LANE, equation, kernel, procedure
from flownav.core.compiling.loops import has_loop, jumps_back
from flownav.core.compiling.memo import memoising


class Inside(NamedTuple):
    """All of one type."""

    x: float
    y: float


class Told(NamedTuple):
    """Of all kinds."""

    inside: Inside
    table: np.ndarray
    count: int
    holds: bool
    absent: None


Inside.__module__ = Told.__module__ = "flownav.tests"  # as if they were the package's


class Foreign(NamedTuple):
    """Somebody else's."""

    x: float
    n: int


TOLD = Told(Inside(0.25, -3.0), np.array([1.0, 2.0, 4.0]), 2, True, None)


@procedure
def weighed(told, factor):
    total = told.inside.x * factor
    for value in told.table:
        total += value * told.inside.y
    return total + told.count if told.holds else -1.0


@procedure
def changed(told, factor):
    return Told(Inside(told.inside.y, told.inside.x * factor), told.table, told.count + 1, not told.holds, told.absent)


@kernel
def both(told, factor):
    after = changed(changed(told, factor), factor)
    return weighed(told, factor) + after.inside.x * after.count, after.holds


@numba.njit
def by_numba(told, factor):
    return weighed(changed(changed(told, factor), 2.0), factor)


def test_a_record_of_the_package_is_one_argument():
    model = default_manager.lookup(numba.typeof(TOLD))
    assert model.get_argument_type() is model.get_value_type()
    assert isinstance(model.get_argument_type(), ir.LiteralStructType)
    assert isinstance(default_manager.lookup(numba.typeof(TOLD.inside)).get_argument_type(), ir.ArrayType)


def test_somebody_elses_and_another_targets_are_handed_over_as_numba_does():
    assert isinstance(default_manager.lookup(numba.typeof(Foreign(1.0, 2))).get_argument_type(), tuple)
    of_a_device = DataModelManager().chain(default_manager)
    assert isinstance(of_a_device.lookup(numba.typeof(TOLD)).get_argument_type(), tuple)


def test_kernels_and_numbas_own_functions_call_them_alike():
    assert both(TOLD, 0.1) == both.py_func(TOLD, 0.1)
    after = changed(changed(TOLD, 0.1), 2.0)
    assert by_numba(TOLD, 0.1) == weighed(after, 0.1)


# -- what is optimised by itself -----------------------------------------------------------------------------
def jumping(*thens: tuple[int, ...]) -> ir.Function:
    """A function whose blocks jump to these."""
    function = ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), [ir.IntType(1)]), "f")
    blocks = [function.append_basic_block() for _ in thens]
    for block, following in zip(blocks, thens, strict=True):
        builder = ir.IRBuilder(block)
        if not following:
            builder.ret_void()
        elif len(following) == 1:
            builder.branch(blocks[following[0]])
        else:
            builder.cbranch(function.args[0], *(blocks[then] for then in following))
    return function


@pytest.mark.parametrize(
    ("thens", "back", "loop"),
    [
        (((),), False, False),
        (((1, 2), (2,), ()), False, False),
        (((2, 3), (), (1,), (1,)), True, False),  # blocks in another order
        (((0, 1), ()), True, True),
        (((1,), (2, 3), (1,), ()), True, True),
        (((3,), (2,), (1, 4), (1,), ()), True, True),
    ],
)
def test_a_loop_is_what_comes_back_to_itself(thens, back, loop):
    function = jumping(*thens)
    assert (jumps_back(function), has_loop(function)) == (back, loop)


@equation
def held(x):
    if x > 3.0:
        return 3.0 if x < 9.0 else x / 3.0
    if x < -3.0:
        return -3.0
    return x * x


@procedure
def squares(x):
    return held(x) + held(2.0 * x)


def swept(work, lanes):
    for lane in range(len(lanes)):
        work[lane] = squares(work[lane])


@pytest.mark.parametrize("builds", [(ONE_LANE, LANES, ONE_LANE), (LANES, ONE_LANE, LANES)], ids=["one", "many"])
def test_laws_serve_one_lane_and_many_in_any_order(builds):
    """A law is given to callers on one lane as it is, and optimised by itself once one on many lanes asks for it."""
    for lanes in builds:
        work = np.linspace(-8.0, 20.0, len(lanes))
        wanted = [squares(float(x)) for x in work]
        kernel(swept)(work, lanes)
        assert work.tolist() == wanted


# -- what is remembered --------------------------------------------------------------------------------------
def test_a_remembered_hash_is_the_types_own():
    kinds = [numba.typeof(TOLD), numba.float64, numba.typeof((1, 2.0)), numba.typeof(TOLD.table)]
    own = [hash(kind) for kind in kinds]
    with memoising():
        assert [hash(kind) for kind in kinds] == own == [hash(kind) for kind in kinds]
        assert hash(numba.types.Tuple((numba.int64, numba.float64))) == own[2]
