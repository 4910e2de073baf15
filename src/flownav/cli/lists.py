"""Options that take several values: given by repetition, by commas, or both."""

from __future__ import annotations

from collections.abc import Sequence

from flownav.core.errors import InputError


def words(option: str, given: Sequence[str]) -> list[str]:
    """Every word, once, in order. InputError where there is none."""
    return list(dict.fromkeys(_parts(option, given)))


def _parts(option: str, given: Sequence[str]) -> list[str]:
    found = [word.strip() for text in given for word in text.split(",") if word.strip()]
    if not found:
        raise InputError(f"{option}: give one at least")
    return found


def numbers(option: str, given: Sequence[str], low: float, high: float) -> list[float]:
    """Every number, in order. InputError where one is none, or out of range."""
    from flownav.cli.output import require_between
    from flownav.core.text import number

    found = []
    for word in _parts(option, given):
        try:
            found.append(number(word))
        except ValueError:
            raise InputError(f"{option} {word}: a number is needed") from None
        require_between(option, found[-1], low, high)
    return found
