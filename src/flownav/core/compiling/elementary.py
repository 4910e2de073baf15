"""sin, cos, arctan2, arcsin, arccos, exp, sinh, cosh: the same bits on every processor, compiled or in plain Python.

They are sums, products, quotients and roots, and selects in place of branches, so that a loop over lanes vectorises
through them and no machine code calls the C library, whose bits differ from version to version and from processor to
processor. Each is within 1 ulp of the exact value (a result below the normal numbers within 2^-1073). Infinities, NaN
and signed zeros are as in C99's annex F, with one exception: the sine of an angle beyond `LARGEST_ANGLE_RAD` is NaN.

Called from Python with floats they are these equations; with complex numbers or arrays they are NumPy's functions.
Polynomials for an eighth of a turn, logarithm, exponential and arc sine: Sun Microsystems' fdlibm 5.3 (k_sin, k_cos,
e_log, e_exp, e_asin); reduction by Cody and Waite, Software Manual for the Elementary Functions, 1980.
"""

import math
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from flownav.core.compiling.engine import equation, stands_for
from flownav.core.compiling.scalars import bits_from_float, float_from_bits

Function = TypeVar("Function", bound=Callable[..., Any])

# the largest angle whose whole quarter turns are a number of 17 bits: those times 36 bits of pi/2 are exact
LARGEST_ANGLE_RAD = 2.0e5
TWO_OVER_PI = 0.6366197723675814
HALF_PI_PARTS = 1.5707963267923333, 2.5633441515839558e-12, 1.0562999066987428e-23  # 36, 36 and 53 bits
EIGHTH_PARTS = 0.7853981633961666, 1.2816720757972595e-12  # of a turn: 36 and 53 bits of pi/4
HALF_PI, HALF_PI_LOW = 1.5707963267948966, 6.123233995736766e-17
ROUNDING = 6755399441055744.0  # 1.5 * 2^52: added to a small number, its last bits are the nearest whole number
LOG2_E = 1.4426950408889634
LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10  # 33 bits times 11 bits are exact
LEAST_EXPONENT, MOST_EXPONENT = -746.0, 712.0  # exp of less is 0, of more infinite
SMALL, LARGE = 3.054936363499605e-151, 3.273390607896142e150  # 2^-500 and 2^500
SQRT2 = 1.4142135623730951

ZERO, ONE, TWO = np.uint64(0), np.uint64(1), np.uint64(2)
SIGN = np.uint64(0x8000000000000000)
MANTISSA = np.uint64(0x000FFFFFFFFFFFFF)
ONE_BITS = np.uint64(0x3FF0000000000000)
UPPER_HALF = np.uint64(0xFFFFFFFFF8000000)  # 26 of the 53 bits of a number: two such have an exact product
EXPONENT_SHIFT = np.uint64(52)
BIAS = np.uint64(1023)
SIGNED_BIAS = np.int64(1023)


def elementary(of_numpy: Callable[..., Any]) -> Callable[[Function], Function]:
    """An equation of floats as a function of anything: of complex numbers and arrays it is NumPy's."""

    def made(law: Function) -> Function:
        @wraps(law)
        def function(*values: Any) -> Any:
            if not all(isinstance(value, float | int) for value in values):
                return of_numpy(*values)
            return np.float64(law(*map(float, values)))

        return stands_for(law, function)  # type: ignore[return-value]

    return made


# -- angles ------------------------------------------------------------------------------------------------------
@equation
def sine_of_eighth(r: float, rest: float) -> float:
    """sin(r + rest) for |r| <= pi/4, rest the part of the angle that r has no bits for."""
    z = r * r
    v = z * r
    high = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
    series = high + z * (z * z) * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    return r - ((z * (0.5 * rest - v * series) - rest) + v * 1.66666666666666324348e-01)


@equation
def cosine_of_eighth(r: float, rest: float) -> float:
    """cos(r + rest) for |r| <= pi/4."""
    z = r * r
    high = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05))
    low = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    half = 0.5 * z
    near = 1.0 - half
    return near + (((1.0 - near) - half) + (z * (high + (z * z) * ((z * z) * low)) - r * rest))


@equation
def sine_and_cosine_of(angle_rad: float) -> tuple[float, float]:
    """sin(x), cos(x), by the nearest multiple of a quarter turn and what is left."""
    x = angle_rad if abs(angle_rad) <= LARGEST_ANGLE_RAD else math.nan
    counted = x * TWO_OVER_PI + ROUNDING
    quarters = counted - ROUNDING
    first, second, third = HALF_PI_PARTS
    near = x - quarters * first
    off = quarters * second
    high = near - off
    low = quarters * third - ((near - high) - off)
    r = high - low
    rest = (high - r) - low
    sine, cosine = sine_of_eighth(r, rest), cosine_of_eighth(r, rest)
    quadrant = bits_from_float(counted)
    odd = (quadrant & ONE) != ZERO
    one, other = cosine if odd else sine, sine if odd else cosine
    return (
        -one if (quadrant & TWO) != ZERO else one,
        -other if ((quadrant + ONE) & TWO) != ZERO else other,
    )


@elementary(np.sin)
def sin(angle_rad: float) -> float:
    """The sine."""
    return sine_and_cosine_of(angle_rad)[0]


@elementary(np.cos)
def cos(angle_rad: float) -> float:
    """The cosine."""
    return sine_and_cosine_of(angle_rad)[1]


# -- arcs --------------------------------------------------------------------------------------------------------
@equation
def arc_series(z: float) -> float:
    """(atan(t)/t - 1)/t^2 of z = t^2 <= 1/4: a polynomial that is minimax (Remez), relative error of atan 2^-57."""
    z2 = z * z
    z4 = z2 * z2
    a = (-0.3333333333333298 + z * 0.1999999999990317) + z2 * (-0.14285714276390785 + z * 0.11111110659828825)
    b = (-0.09090896249119725 + z * 0.07692073975409322) + z2 * (-0.06663811208745986 + z * 0.05858302628856659)
    c = (-0.051220211717320496 + z * 0.04186544718869632) + z2 * (-0.027435559398181895 + z * 0.010117250370231066)
    return a + z4 * (b + z4 * c)


@equation
def split(value: float) -> tuple[float, float]:
    """A number's upper 26 bits, and the rest."""
    upper = float_from_bits(bits_from_float(value) & UPPER_HALF)
    return upper, value - upper


@equation
def signed_as(value: float, sign_of: float) -> float:
    """A number that is not negative with another's sign."""
    return float_from_bits(bits_from_float(value) | (bits_from_float(sign_of) & SIGN))


@equation
def comparable(low: float, high: float) -> tuple[float, float]:
    """Two numbers 0 <= low <= high of the same ratio whose quotient and its remainder can be computed; 0/0 is 0."""
    endless = high == math.inf
    low = (1.0 if low == math.inf else 0.0 * low) if endless else low
    high = 1.0 if endless or high == 0.0 else high
    scale = SMALL if high > LARGE else (LARGE if low < SMALL else 1.0)
    return low * scale, high * scale


@elementary(np.arctan2)
def arctan2(y: float, x: float) -> float:
    """The angle of the direction (x, y), from -pi to pi: a multiple of an eighth of a turn, and an arc tangent.

    Of the smaller and the larger of both, or of their difference and their sum, the quotient is ratio + rest.
    """
    steep, backward = abs(y) > abs(x), (bits_from_float(x) & SIGN) != ZERO
    low, high = comparable(abs(x) if steep else abs(y), abs(y) if steep else abs(x))
    even = low + low > high
    above, below = low - high if even else low, low + high if even else high
    per_below = 1.0 / below
    whole = above * per_below
    ratio = split(whole)[0]
    upper, lower = split(below)
    lower = lower + (low - (below - high) if even else 0.0)
    rest = ((above - ratio * upper) - ratio * lower) * per_below
    whole = ratio + rest
    z = whole * whole
    rest = rest + whole * z * arc_series(z)
    turned = steep != backward
    eighth = (-1.0 if turned else 1.0) if even else 0.0
    eighths = (2.0 if steep else (4.0 if backward else 0.0)) + eighth
    ratio, rest = -ratio if turned else ratio, -rest if turned else rest
    start = eighths * EIGHTH_PARTS[0]
    angle = start + ratio
    return signed_as(angle + ((ratio - (angle - start)) + (rest + eighths * EIGHTH_PARTS[1])), y)


@equation
def arc_parts(size: float) -> tuple[float, float, float]:
    """(asin(x)/x - 1) of x = `size` below a half; above, a and b of acos(x) = 2 (a + b), a of 26 bits."""
    large = size >= 0.5
    z = 0.5 * (1.0 - size) if large else size * size
    p = -4.00555345006794114027e-02 + z * (7.91534994289814532176e-04 + z * 3.47933107596021167570e-05)
    p = 1.66666666666666657415e-01 + z * (-3.25565818622400915405e-01 + z * (2.01212532134862925881e-01 + z * p))
    q = 2.02094576023350569471e00 + z * (-6.88283971605453293030e-01 + z * 7.70381505559019352791e-02)
    q = 1.0 + z * (-2.40339491173441421878e00 + z * q)
    series = z * p / q
    root = np.sqrt(z)
    upper = split(root)[0]
    lower = (z - upper * upper) / (root + upper if root > 0.0 else 1.0)
    return series, upper, series * root + lower


@elementary(np.arcsin)
def arcsin(x: float) -> float:
    """The angle from -pi/2 to pi/2 of this sine."""
    series, a, b = arc_parts(abs(x))
    near = HALF_PI - 2.0 * a
    large = near + (((HALF_PI - near) - 2.0 * a) + (HALF_PI_LOW - 2.0 * b))
    return signed_as(large, x) if abs(x) >= 0.5 else x + x * series


@elementary(np.arccos)
def arccos(x: float) -> float:
    """The angle from 0 to pi of this cosine."""
    series, a, b = arc_parts(abs(x))
    near = 2.0 * HALF_PI - 2.0 * a
    behind = near + (((2.0 * HALF_PI - near) - 2.0 * a) + 2.0 * (HALF_PI_LOW - b))
    large = 2.0 * (a + b) if x > 0.0 else behind
    return large if abs(x) >= 0.5 else HALF_PI - (x - (HALF_PI_LOW - x * series))


# -- powers of e -------------------------------------------------------------------------------------------------
@equation
def power_of_two(whole: float) -> float:
    """2^whole of a whole number from -1022 to 1023."""
    return float_from_bits((bits_from_float(whole + ROUNDING) + BIAS) << EXPONENT_SHIFT)


@equation
def scaled(value: float, whole: float) -> float:
    """value * 2^whole, also where 2^whole is no normal number."""
    half = (0.5 * whole + ROUNDING) - ROUNDING
    return value * power_of_two(half) * power_of_two(whole - half)


@equation
def power_of_e(x: float) -> tuple[float, float, float]:
    """e^x = (near + rest) * 2^whole, near between 0.7 and 1.42; x held where that is a number or nearly infinite."""
    x = MOST_EXPONENT if x > MOST_EXPONENT else x
    x = LEAST_EXPONENT if x < LEAST_EXPONENT else x
    whole = (x * LOG2_E + ROUNDING) - ROUNDING
    high, low = x - whole * LN2_HIGH, whole * LN2_LOW
    r = high - low
    z = r * r
    c = 6.61375632143793436117e-05 + z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08)
    c = r - z * (1.66666666666666019037e-01 + z * (-2.77777777770155933842e-03 + z * c))
    near = 1.0 + high
    return near, (high - (near - 1.0)) + (r * c / (2.0 - c) - low), whole


@elementary(np.exp)
def exp(x: float) -> float:
    """e^x."""
    near, rest, whole = power_of_e(x)
    return scaled(near + rest, whole)


@equation
def inverse_part(near: float, rest: float, whole: float) -> float:
    """e^-x from e^x = (near + rest) * 2^whole, in units of 2^whole; a smaller value than counts is limited."""
    return power_of_two(-2.0 * (30.0 if whole > 30.0 else whole)) / (near + rest)


@elementary(np.cosh)
def cosh(x: float) -> float:
    """(e^x + e^-x)/2."""
    near, rest, whole = power_of_e(abs(x))
    return scaled(near + (rest + inverse_part(near, rest, whole)), whole - 1.0)


@elementary(np.sinh)
def sinh(x: float) -> float:
    """(e^x - e^-x)/2; below 1 its series, in which nothing is lost."""
    near, rest, whole = power_of_e(abs(x))
    large = scaled(near + (rest - inverse_part(near, rest, whole)), whole - 1.0)
    z = x * x
    series = 1.0 / 1307674368000.0 + z * (1.0 / 355687428096000.0 + z * (1.0 / 121645100408832000.0))
    series = 1.0 / 362880.0 + z * (1.0 / 39916800.0 + z * (1.0 / 6227020800.0 + z * series))
    series = 1.0 / 6.0 + z * (1.0 / 120.0 + z * (1.0 / 5040.0 + z * series))
    return signed_as(large, x) if abs(x) >= 1.0 else x + x * z * series


@equation
def log_of_unit(u: float) -> float:
    """ln(u) for 0 < u <= 1, u no subnormal."""
    bits = bits_from_float(u)
    exponent = np.int64(bits >> EXPONENT_SHIFT) - SIGNED_BIAS
    mantissa = float_from_bits((bits & MANTISSA) | ONE_BITS)
    big = mantissa > SQRT2
    f = (0.5 * mantissa if big else mantissa) - 1.0
    k = float(exponent) + (1.0 if big else 0.0)
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    t1 = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01))
    t2 = 2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)
    t2 = z * (6.666666666666735130e-01 + w * t2)
    half = 0.5 * f * f
    return k * LN2_HIGH - ((half - (s * (half + t1 + t2) + k * LN2_LOW)) - f)
