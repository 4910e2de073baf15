"""Noise by counter: every draw is a pure function of (seed, flight, step, channel).

Threefry-2x64 with 20 rounds (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011) turns
the counter into 128 random bits, Box-Muller turns those into two standard normals. There is no state to
carry, so a flight draws the same numbers alone, in any batch, on any thread and after a resume. Logarithm,
sine and cosine are polynomials (fdlibm's), because libm calls would stop the lanes from vectorising.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import bits_from_float, equation, float_from_bits

CHANNELS_PER_STEP = np.uint64(256)
KEY_PARITY = np.uint64(0x1BD11BDAA9FC1A22)
WORD = np.uint64(64)
MANTISSA_SHIFT = np.uint64(12)
QUADRANT_SHIFT = np.uint64(62)
EXPONENT_SHIFT = np.uint64(52)
MANTISSA = np.uint64(0x000FFFFFFFFFFFFF)
ONE_BITS = np.uint64(0x3FF0000000000000)
BIAS = np.int64(1023)
TWO = np.uint64(2)
ONE = np.uint64(1)
ZERO = np.uint64(0)

QUARTER_PI = 0.7853981633974483
LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
SQRT2 = 1.4142135623730951


# -- Threefry --------------------------------------------------------------------------------------------
@equation
def _mix(x0, x1, rotation):  # type: ignore[no-untyped-def]
    """One Threefry round: add, rotate, xor."""
    x0 = x0 + x1
    x1 = ((x1 << rotation) | (x1 >> (WORD - rotation))) ^ x0
    return x0, x1


@equation
def _four_rounds_even(x0, x1):  # type: ignore[no-untyped-def]
    x0, x1 = _mix(x0, x1, np.uint64(16))
    x0, x1 = _mix(x0, x1, np.uint64(42))
    x0, x1 = _mix(x0, x1, np.uint64(12))
    return _mix(x0, x1, np.uint64(31))


@equation
def _four_rounds_odd(x0, x1):  # type: ignore[no-untyped-def]
    x0, x1 = _mix(x0, x1, np.uint64(16))
    x0, x1 = _mix(x0, x1, np.uint64(32))
    x0, x1 = _mix(x0, x1, np.uint64(24))
    return _mix(x0, x1, np.uint64(21))


@equation
def threefry(counter0, counter1, key0, key1):  # type: ignore[no-untyped-def]
    """Threefry-2x64-20: two uint64 from two counter and two key words."""
    key2 = KEY_PARITY ^ key0 ^ key1
    x0, x1 = _four_rounds_even(counter0 + key0, counter1 + key1)
    x0, x1 = _four_rounds_odd(x0 + key1, x1 + key2 + np.uint64(1))
    x0, x1 = _four_rounds_even(x0 + key2, x1 + key0 + np.uint64(2))
    x0, x1 = _four_rounds_odd(x0 + key0, x1 + key1 + np.uint64(3))
    x0, x1 = _four_rounds_even(x0 + key1, x1 + key2 + np.uint64(4))
    return x0 + key2, x1 + key0 + np.uint64(5)


# -- normals ---------------------------------------------------------------------------------------------
@equation
def log_of_unit(u: float) -> float:
    """ln(u) for 0 < u <= 1, u no subnormal; error below 1 ulp (fdlibm e_log)."""
    bits = bits_from_float(u)
    exponent = np.int64(bits >> EXPONENT_SHIFT) - BIAS
    mantissa = float_from_bits((bits & MANTISSA) | ONE_BITS)
    big = mantissa > SQRT2
    f = (0.5 * mantissa if big else mantissa) - 1.0
    k = float(exponent) + (1.0 if big else 0.0)
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    t1 = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01))
    t2 = z * (
        6.666666666666735130e-01
        + w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01))
    )
    half = 0.5 * f * f
    return k * LN2_HIGH - ((half - (s * (half + t1 + t2) + k * LN2_LOW)) - f)


@equation
def sine_cosine_of_eighth(r: float) -> tuple[float, float]:
    """sin(r), cos(r) for |r| <= pi/4 (fdlibm k_sin, k_cos; error below 1e-15)."""
    z = r * r
    sine = r + r * z * (
        -1.66666666666666324348e-01
        + z
        * (
            8.33333333332248946124e-03
            + z
            * (
                -1.98412698298579493134e-04
                + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
            )
        )
    )
    cosine = (
        1.0
        - 0.5 * z
        + z
        * z
        * (
            4.16666666666666019037e-02
            + z
            * (
                -1.38888888888741095749e-03
                + z
                * (
                    2.48015872894767294178e-05
                    + z
                    * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
                )
            )
        )
    )
    return sine, cosine


@equation
def normal_pair(seed, flight, step, channel):  # type: ignore[no-untyped-def]
    """Two independent standard normals of (seed, flight, step, channel); all four are integers >= 0.

    Box-Muller. Channels of one step are below CHANNELS_PER_STEP.
    """
    word0, word1 = threefry(
        np.uint64(flight), np.uint64(step) * CHANNELS_PER_STEP + np.uint64(channel), np.uint64(seed), ZERO
    )
    u = 2.0 - float_from_bits((word0 >> MANTISSA_SHIFT) | ONE_BITS)  # (0, 1]
    fraction = float_from_bits(((word1 << TWO) >> MANTISSA_SHIFT) | ONE_BITS) - 1.5  # [-0.5, 0.5)
    radius = np.sqrt(-2.0 * log_of_unit(u))
    sine, cosine = sine_cosine_of_eighth(2.0 * QUARTER_PI * fraction)
    quadrant = word1 >> QUADRANT_SHIFT
    odd = (quadrant & ONE) != ZERO
    turned = (quadrant & TWO) != ZERO
    first = cosine if not odd else -sine
    second = sine if not odd else cosine
    sign = -radius if turned else radius
    return sign * first, sign * second
