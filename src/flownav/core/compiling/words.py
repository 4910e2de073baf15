"""The types of arguments in words, as Numba names them, without Numba.

They are part of the name of a kernel's file, so they must be what `compiler.described` makes of Numba's own types
(`tests/compiling/test_words.py`). What Numba would have to be asked about has none.
"""

from functools import cache
from typing import Any

import numpy as np

LEAST_INT, MOST_INT = -(2**63), 2**63 - 1
NUMBERS = "biufc"  # NumPy's kinds of numbers
C_CONTIGUOUS, F_CONTIGUOUS, ALIGNED, WRITEABLE = 0x0001, 0x0002, 0x0100, 0x0400  # NumPy's C-API, "Array flags"
OF_LETTERS = {"p": "float64*", "q": "int64*", "d": "float64", "i": "int64"}  # of a unit's signature


def words_of(arguments: tuple[Any, ...]) -> str | None:
    """The types of a function's arguments; None where one is of a type that only Numba knows."""
    try:
        return f"({', '.join(map(word_of, arguments))})"
    except _UnknownError:
        return None


def words_of_letters(letters: list[str]) -> str:
    """The signature of a unit, which returns nothing."""
    return f"({', '.join(OF_LETTERS[letter] for letter in letters)}) -> none"


class _UnknownError(Exception):
    """Only Numba knows this type."""


def word_of(value: Any) -> str:
    """The type of one argument; classes of named tuples by module and fields."""
    kind = type(value)
    if kind is float:
        return "float64"
    if kind is bool:
        return "bool"
    if kind is int and LEAST_INT <= value <= MOST_INT:
        return "int64"
    if kind is np.ndarray:
        return _word_of_array(value.dtype, value.ndim, value.flags.num)
    if value is None:
        return "none"
    if isinstance(value, tuple):
        return _opening(kind) + ", ".join(map(word_of, value)) + "]"  # type: ignore[arg-type]  # mypy: a class has no hash
    if isinstance(value, np.generic) and value.dtype.kind in NUMBERS and value.dtype.isnative:
        return str(value.dtype)
    raise _UnknownError


@cache
def _opening(kind: type) -> str:
    """The beginning of a class of tuples: its module, name and fields."""
    return f"{kind.__module__}.{kind.__qualname__}[{', '.join(getattr(kind, '_fields', ()))}: "


@cache  # of few kinds, and asked for with every call of a kernel: NumPy takes 20 us to write out a dtype
def _word_of_array(dtype: Any, dimensions: int, flags: int) -> str:
    """The type of an array; flags: the number of `ndarray.flags`."""
    if dtype.kind not in NUMBERS or not dtype.isnative or not flags & ALIGNED:
        raise _UnknownError
    layout = "C" if flags & C_CONTIGUOUS else "F" if flags & F_CONTIGUOUS else "A"
    return f"{'' if flags & WRITEABLE else 'readonly '}array({dtype}, {dimensions}d, {layout})"
