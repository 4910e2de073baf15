"""Noise by counter: every draw is a pure function of (seed, flight, step, channel).

Threefry-2x64 with 20 rounds (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011) turns
the counter into 128 random bits, Box-Muller turns those into two standard normals. There is no state to
carry, so a flight draws the same numbers alone, in any batch, on any thread and after a resume.
"""

import numpy as np

from flownav.core.compile import cosine_of_eighth, equation, float_from_bits, log_of_unit, sine_of_eighth

CHANNELS_PER_STEP = np.uint64(256)
KEY_PARITY = np.uint64(0x1BD11BDAA9FC1A22)
WORD = np.uint64(64)
MANTISSA_SHIFT = np.uint64(12)
QUADRANT_SHIFT = np.uint64(62)
ONE_BITS = np.uint64(0x3FF0000000000000)
TWO = np.uint64(2)
ONE = np.uint64(1)
ZERO = np.uint64(0)

QUARTER_PI = 0.7853981633974483


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
    angle = 2.0 * QUARTER_PI * fraction
    sine, cosine = sine_of_eighth(angle, 0.0), cosine_of_eighth(angle, 0.0)
    quadrant = word1 >> QUADRANT_SHIFT
    odd = (quadrant & ONE) != ZERO
    turned = (quadrant & TWO) != ZERO
    first = cosine if not odd else -sine
    second = sine if not odd else cosine
    sign = -radius if turned else radius
    return sign * first, sign * second
