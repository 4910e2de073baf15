"""What the calls of the API share: how a call is written down, and numbers that must lie in a range."""

from __future__ import annotations

from typing import Any

from flownav.errors import InputError

LONGEST = 200  # characters of one argument


def call_of(name: str, *arguments: Any, **options: Any) -> str:
    """A call as Python writes it, for the record's "how to reproduce"; what is None, False or empty is left out."""
    given = [_shown(argument) for argument in arguments]
    said = {key: value for key, value in options.items() if value is not None and _is_said(value)}
    given += [f"{key}={_shown(value)}" for key, value in said.items() if key.isidentifier()]
    dotted = {key: value for key, value in said.items() if not key.isidentifier()}
    given += [f"**{_shown(dotted)}"] if dotted else []
    return f"flownav.{name}({', '.join(given)})"


def _is_said(value: Any) -> bool:
    return value is not False and not (isinstance(value, tuple | list | dict) and not value)


def _shown(value: Any) -> str:
    text = repr(str(value)) if hasattr(value, "__fspath__") else repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def require_from(name: str, value: float, low: float, high: float) -> None:
    """InputError where an argument's number is out of its range, or is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise InputError(f"{name} = {value!r}: must be a number from {low} to {high}")
