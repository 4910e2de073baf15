"""Own sine, exponential and the like: within 1 ulp of the exact value, special as C99 says, in Python the same bits."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.core import compile as elementary
from flownav.core.compile import kernel, log_of_unit
from flownav.core.compiling.elementary import LARGEST_ANGLE_RAD

DRAWS = 30_000
SMALLEST = np.finfo(float).tiny
INF, NAN = math.inf, math.nan
NAMES = ("sin", "cos", "arcsin", "arccos", "exp", "sinh", "cosh")
ANGLES = [(-4.0, 4.0), (-LARGEST_ANGLE_RAD, LARGEST_ANGLE_RAD)]
BETWEEN = {
    "sin": ANGLES, "cos": ANGLES, "arcsin": [(-1.0, 1.0)], "arccos": [(-1.0, 1.0)],
    "exp": [(-1.0, 1.0), (-708.0, 709.0), (-745.0, -708.0)],
    "sinh": [(-2.0, 2.0), (-710.0, 710.0)], "cosh": [(-2.0, 2.0), (-710.0, 710.0)],
}  # fmt: skip
extended = pytest.mark.skipif(
    np.finfo(np.longdouble).nmant < 63, reason="the oracle needs numbers of more than 53 bits"
)


def each(function):
    """The function of every element of arrays, compiled."""

    @kernel
    def fill(x, out):
        for i in range(len(x)):
            out[i] = function(x[i])

    def of(x):
        out = np.empty_like(x)
        fill(x, out)
        return out

    return of


COMPILED = {name: each(getattr(elementary, name)) for name in NAMES}
ARCTAN2 = elementary.arctan2


@kernel
def fill_arctan2(y, x, out):
    for i in range(len(x)):
        out[i] = ARCTAN2(y[i], x[i])


def arctan2_of(y, x):
    out = np.empty_like(x)
    fill_arctan2(y, x, out)
    return out


def off_by(found, exact):
    """How many units in the last place a result is from the exact value; below the normal numbers two are one."""
    exact = np.asarray(exact, np.longdouble)
    unit = np.spacing(np.abs(exact.astype(float)))
    return np.abs((found - exact) / np.where(np.abs(exact) < SMALLEST, 2.0 * unit, unit)).astype(float)


def drawn(name):
    """Arguments over the whole range, evenly and by magnitude, and near what is special."""
    rng = np.random.default_rng(5)
    low, high = BETWEEN[name][0][0], BETWEEN[name][-1][1]
    parts = [rng.uniform(*ends, DRAWS) for ends in BETWEEN[name]]
    sizes = 10.0 ** rng.uniform(-310.0, math.log10(min(high, -low) if name != "exp" else 700.0), DRAWS)
    near_one = 1.0 - 10.0 ** rng.uniform(-16.0, 0.0, DRAWS)
    return np.concatenate([*parts, sizes, -sizes, near_one, -near_one])


@extended
@pytest.mark.parametrize("name", NAMES)
def test_it_is_within_one_unit_in_the_last_place(name):
    x = drawn(name)
    off = off_by(COMPILED[name](x), getattr(np, name)(x.astype(np.longdouble)))
    assert off.max() < 0.9, x[np.argmax(off)]


@extended
def test_the_angle_of_a_direction_is_within_one_unit_in_the_last_place():
    rng = np.random.default_rng(6)
    way = rng.uniform(-np.pi, np.pi, DRAWS)
    signs = rng.choice([-1.0, 1.0], (4, DRAWS))
    close, far = 10.0 ** rng.uniform(-3.0, 3.0, (2, DRAWS)), 10.0 ** rng.uniform(-320.0, 305.0, (2, DRAWS))
    y = np.concatenate([np.sin(way), signs[0] * close[0], signs[1] * far[0], np.full(DRAWS, 1.0)])
    x = np.concatenate([np.cos(way), signs[2] * close[1], signs[3] * far[1], 1.0 + 1e-6 * way])
    off = off_by(arctan2_of(y, x), np.arctan2(y.astype(np.longdouble), x.astype(np.longdouble)))
    assert off.max() < 0.9, (y[np.argmax(off)], x[np.argmax(off)])


@extended
def test_the_logarithm_is_within_one_unit_in_the_last_place():
    u = np.random.default_rng(7).uniform(SMALLEST, 1.0, DRAWS)
    u = np.concatenate([u, u**40, 1.0 - 1e-9 * u])
    assert off_by(each(log_of_unit)(u), np.log(u.astype(np.longdouble))).max() < 1.0


def test_the_angles_next_to_quarter_turns_are_reduced_without_loss():
    """sin x = k pi/2 - x there to 2^-106, of which an inexact reduction would leave no digit."""
    quarters = np.arange(1, int(LARGEST_ANGLE_RAD * 2.0 / np.pi))
    x = quarters * (0.5 * np.pi)
    sine, cosine = COMPILED["sin"](x), COMPILED["cos"](x)
    small = np.where(quarters % 2 == 0, sine, cosine)
    with localcontext() as context:
        context.prec = 60
        half_pi = Decimal("1.57079632679489661923132169163975144209858469968755291048747229615390820314")
        for i in np.concatenate([np.argsort(np.abs(small))[:500], np.arange(0, len(x), 199)]):
            left = Decimal(float(x[i])) - int(quarters[i]) * half_pi
            assert abs(Decimal(abs(float(small[i]))) / abs(left) - 1) < Decimal(2.0**-52), x[i]
    assert np.all(np.abs(np.where(quarters % 2 == 0, cosine, sine)) == 1.0)


@pytest.mark.parametrize(
    ("name", "told", "expected"),
    [
        ("sin", 0.0, 0.0), ("sin", -0.0, -0.0), ("sin", 5e-324, 5e-324), ("sin", -2.0**-1050, -(2.0**-1050)),
        ("cos", -0.0, 1.0), ("arcsin", -0.0, -0.0), ("arcsin", 1.0, np.pi / 2), ("arcsin", -1.0, -np.pi / 2),
        ("arccos", 1.0, 0.0), ("arccos", -1.0, np.pi), ("arccos", 0.0, np.pi / 2),
        ("exp", 0.0, 1.0), ("exp", -0.0, 1.0), ("exp", INF, INF), ("exp", -INF, 0.0), ("exp", 709.79, INF),
        ("exp", 1e300, INF), ("exp", -745.14, 0.0), ("exp", -745.13, 5e-324), ("exp", 1.0, math.e),
        ("sinh", -0.0, -0.0), ("sinh", -INF, -INF), ("sinh", 5e-324, 5e-324), ("sinh", 711.0, INF),
        ("cosh", 0.0, 1.0), ("cosh", -INF, INF),
        *((name, NAN, NAN) for name in NAMES),
        *((name, way * size, NAN) for name in ("sin", "cos") for way in (-1, 1) for size in (2.1e5, 1e300, INF)),
    ],
)  # fmt: skip
def test_special_values(name, told, expected):
    for found in (COMPILED[name](np.array([told]))[0], getattr(elementary, name)(told)):
        assert same(found, expected), found


@pytest.mark.parametrize("x", [1.0 + 2.0**-52, -2.0, INF])
@pytest.mark.parametrize("name", ["arcsin", "arccos"])
def test_what_no_angle_has_as_its_sine_gives_nan(name, x):
    assert np.isnan(COMPILED[name](np.array([x]))[0])


@pytest.mark.parametrize("y", [0.0, -0.0, 5e-324, -1.0, 1e308, INF, -INF, NAN])
@pytest.mark.parametrize("x", [0.0, -0.0, 5e-324, 1.0, -1.0, -1e308, INF, -INF, NAN])
def test_special_directions_are_c99_s(y, x):
    expected = math.atan2(y, x)
    for found in (arctan2_of(np.array([y]), np.array([x]))[0], ARCTAN2(y, x)):
        assert same(found, expected), found


def same(found, expected):
    return (np.isnan(found) and np.isnan(expected)) or np.float64(found).tobytes() == np.float64(expected).tobytes()


@pytest.mark.parametrize("name", NAMES)
def test_python_has_the_bits_of_compiled_code(name):
    x = drawn(name)[::37]
    plain = np.array([getattr(elementary, name)(float(value)) for value in x])
    assert plain.tobytes() == COMPILED[name](x).tobytes()


@given(st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_python_has_the_angle_of_compiled_code(y, x):
    assert same(ARCTAN2(y, x), arctan2_of(np.array([y]), np.array([x]))[0])


@given(st.floats(-1e5, 1e5))
def test_a_sine_is_odd_a_cosine_even_and_both_lie_on_the_circle(x):
    sine, cosine = elementary.sin(x), elementary.cos(x)
    assert (elementary.sin(-x), elementary.cos(-x)) == (-sine, cosine)
    assert sine * sine + cosine * cosine == pytest.approx(1.0, abs=5e-16)


@pytest.mark.parametrize("name", NAMES)
def test_complex_numbers_and_arrays_are_numpy_s(name):
    function, theirs = getattr(elementary, name), getattr(np, name)
    assert function(0.3 + 0.2j) == theirs(0.3 + 0.2j)
    assert np.array_equal(function(np.linspace(-1.0, 1.0, 7)), theirs(np.linspace(-1.0, 1.0, 7)))


def test_a_loop_over_lanes_is_vectorised():
    """No call, no branch and no table: the optimised loop computes on vectors."""

    @kernel
    def turn(x, out):
        for i in range(len(x)):
            out[i] = elementary_sin(x[i]) * elementary_exp(x[i]) + ARCTAN2(x[i], out[i])

    turn.dispatcher(np.ones(64), np.ones(64))
    (code,) = (made.library.get_llvm_str() for made in turn.dispatcher.overloads.values())
    assert "fdiv <" in code.replace("fdiv fast", "fdiv")
    assert "@llvm.sin" not in code


elementary_sin, elementary_exp = elementary.sin, elementary.exp
