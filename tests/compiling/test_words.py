"""Types of arguments in words: what is written without Numba is what Numba's own types are called."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from flownav.core.compiling.compiler import described, signature_of
from flownav.core.compiling.words import OF_LETTERS, words_of, words_of_letters


class Inner(NamedTuple):
    rate: float
    count: int


class Outer(NamedTuple):
    inner: Any
    table: Any
    absent: Any


FROZEN = np.zeros(3)
FROZEN.setflags(write=False)
VALUES = [
    (1.0, 2, True, None, -(2**63)),
    (np.float32(1.0), np.int16(3), np.uint64(7), np.bool_(True), np.float64(0.5)),
    (np.zeros(3), np.zeros((2, 3), np.int64), np.zeros((2, 3, 4), np.bool_), np.zeros(0, np.uint8), FROZEN),
    (np.zeros((4, 3)).T, np.zeros((4, 6))[:, ::2], np.frombuffer(b"abcd", np.uint8)),
    ((0,) * 16, (), (1.0, 2), (0,)),
    (Inner(1.0, 2), Outer(Inner(np.float64(1.0), 1), np.zeros((2, 2)), None), (Inner(0.0, 1), 3.0)),
]


@pytest.mark.parametrize("values", VALUES)
def test_words_are_numbas(values):
    assert words_of(values) == described(tuple(map(numba.typeof, values)))


@pytest.mark.parametrize(
    "value",
    [2**63, 1j, "text", [1.0], np.zeros(3, ">f8"), np.zeros(2, "f8,i8"), np.zeros(9, np.uint8)[1:].view("f8"), print],
)
def test_what_only_numba_knows_has_no_words(value):
    assert words_of((1.0, value)) is None


def test_the_words_of_a_unit_are_numbas():
    letters = list(OF_LETTERS)
    assert words_of_letters(letters) == described(signature_of(letters))
