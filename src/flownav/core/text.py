"""Numbers and names as text."""

from __future__ import annotations

import math
from typing import Any


def number(text: str) -> float:
    """A decimal number as files and options have it.

    ValueError for what else Python would take: `1_000`, which may be a 1 and three digits of something, and the digits
    of other scripts.
    """
    if "_" in text or not text.isascii():
        raise ValueError(f"not a decimal number: {text!r}")
    return float(text)


def finite_or_none(value: float | None) -> float | None:
    """A number as JSON has it: None where there is none, where it is infinite and where it is no number."""
    return None if value is None or not math.isfinite(value) else float(value)


def finite(value: Any) -> Any:
    """A value, and all within it, as JSON has it: `finite_or_none` of its numbers, lists of tuples."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return finite_or_none(value) if isinstance(value, float) else value


def plain(text: str) -> str:
    """Text for a file in UTF-8: the bytes of a file's name that are none are spelt out."""
    return text.encode("utf-8", errors="backslashreplace").decode("utf-8")
