"""Noise by counter: the generator's known answers, and the distribution of its normals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from flownav.core.compile import LANES, ONE_LANE, bits_from_float, float_from_bits, kernel
from flownav.simulation.noise import normal_pair, threefry


@kernel
def encrypt(c0, c1, k0, k1):
    return threefry(c0, c1, k0, k1)


@kernel
def draw(pairs, lanes, seed, flight, first_step, channel):
    for step in range(len(pairs)):
        for lane in range(len(lanes)):
            pairs[step, 0, lane], pairs[step, 1, lane] = normal_pair(seed, flight + lane, first_step + step, channel)


def normals(count, *, lanes=ONE_LANE, seed=1, flight=0, first_step=0, channel=0):
    pairs = np.empty((count, 2, len(lanes)))
    draw(pairs, lanes, seed, flight, first_step, channel)
    return pairs


# known answers of Threefry-2x64, 20 rounds: Random123 1.09, kat_vectors
@pytest.mark.parametrize(
    ("counter", "key", "answer"),
    [
        ((0, 0), (0, 0), (0xC2B6E3A8C2C69865, 0x6F81ED42F350084D)),
        ((2**64 - 1, 2**64 - 1), (2**64 - 1, 2**64 - 1), (0xE02CB7C4D95D277A, 0xD06633D0893B8B68)),
        (
            (0x243F6A8885A308D3, 0x13198A2E03707344),
            (0xA4093822299F31D0, 0x082EFA98EC4E6C89),
            (0x263C7D30BB0F0AF1, 0x56BE8361D3311526),
        ),
    ],
)
def test_threefry_gives_the_published_answers(counter, key, answer):
    words = encrypt(*(np.uint64(word) for word in (*counter, *key)))
    assert tuple(int(word) for word in words) == answer


def test_normals_are_standard_normal():
    sample = normals(100_000).ravel()
    assert stats.kstest(sample, "norm").pvalue > 1e-3
    assert abs(stats.kurtosis(sample)) < 5 * np.sqrt(24 / len(sample))


def test_the_two_normals_of_a_pair_are_independent_and_so_are_channels_steps_and_flights():
    pairs = normals(50_000)
    others = [
        normals(50_000, channel=1),
        normals(50_000, flight=1),
        normals(50_000, seed=2),
        normals(50_000, first_step=1),
    ]
    first = pairs[:, 0, 0]
    for second in [pairs[:, 1, 0], *(other[:, 0, 0] for other in others)]:
        assert abs(np.corrcoef(first, second)[0, 1]) < 5 / np.sqrt(len(first))
        assert abs(np.corrcoef(first**2, second**2)[0, 1]) < 5 / np.sqrt(len(first))


def test_a_flight_draws_the_same_numbers_alone_and_in_any_lane():
    block = normals(200, lanes=LANES, flight=48)
    for lane in range(len(LANES)):
        assert np.array_equal(block[:, :, lane], normals(200, flight=48 + lane)[:, :, 0])


def test_a_later_start_continues_the_same_numbers():
    assert np.array_equal(normals(100)[40:], normals(60, first_step=40))


@settings(deadline=None)
@given(st.floats(allow_nan=False))
def test_bits_go_and_come_back(value):
    assert float_from_bits(bits_from_float(value)) == value
