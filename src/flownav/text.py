"""Numbers and names as text."""

from __future__ import annotations


def number(text: str) -> float:
    """A decimal number as files and options have it.

    ValueError for what else Python would take: `1_000`, which may be a 1 and three digits of something, and the digits
    of other scripts.
    """
    if "_" in text or not text.isascii():
        raise ValueError(f"not a decimal number: {text!r}")
    return float(text)


def plain(text: str) -> str:
    """Text for a file in UTF-8: the bytes of a file's name that are none are spelt out."""
    return text.encode("utf-8", errors="backslashreplace").decode("utf-8")
