"""The types of arguments in words, as Numba names them, without Numba.

They are part of the name of a kernel's file, so they must be what `compiler.described` makes of Numba's own types
(`tests/compiling/test_words.py`). What Numba would have to be asked about has none.
"""

from typing import Any

import numpy as np

LEAST_INT, MOST_INT = -(2**63), 2**63 - 1
NUMBERS = "biufc"  # NumPy's kinds of numbers
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
        return _word_of_array(value)
    if value is None:
        return "none"
    if isinstance(value, tuple):
        return f"{kind.__module__}.{kind.__qualname__}[{', '.join(getattr(kind, '_fields', ()))}: " + (
            ", ".join(map(word_of, value)) + "]"
        )
    if isinstance(value, np.generic) and value.dtype.kind in NUMBERS and value.dtype.isnative:
        return str(value.dtype)
    raise _UnknownError


def _word_of_array(array: Any) -> str:
    flags = array.flags
    if array.dtype.kind not in NUMBERS or not array.dtype.isnative or not flags.aligned:
        raise _UnknownError
    layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
    return f"{'' if flags.writeable else 'readonly '}array({array.dtype}, {array.ndim}d, {layout})"
