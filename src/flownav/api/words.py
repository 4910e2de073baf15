"""What the calls of the API share: how a call is written down, and numbers that must lie in a range."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from numbers import Integral
from pathlib import Path
from typing import Any

from flownav.core.errors import InputError

LONGEST = 200  # characters of one argument


def call_of(name: str, *arguments: Any, **options: Any) -> str:
    """A call as Python writes it, for the record's "how to reproduce"; what is None or empty is left out.

    Options that stand as the function has them unless told otherwise are left out by `changed`.
    """
    given = [_shown(argument) for argument in arguments]
    said = {key: value for key, value in options.items() if value is not None and _is_said(value)}
    given += [f"{key}={_shown(value)}" for key, value in said.items() if key.isidentifier()]
    dotted = {key: value for key, value in said.items() if not key.isidentifier()}
    given += [f"**{_shown(dotted)}"] if dotted else []
    return f"flownav.{name}({', '.join(given)})"


def changed(function: Callable[..., Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """The options that differ from the function's defaults."""
    defaults = {name: parameter.default for name, parameter in inspect.signature(function).parameters.items()}
    return {name: value for name, value in options.items() if not _same(value, defaults.get(name))}


def _same(value: Any, default: Any) -> bool:
    return type(value) is type(default) and repr(value) == repr(default)


def _is_said(value: Any) -> bool:
    return not (isinstance(value, tuple | list | dict) and not value)


def _shown(value: Any) -> str:
    text = repr(str(value)) if hasattr(value, "__fspath__") else repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def require_from(name: str, value: int, low: int, high: int) -> None:
    """InputError where an argument is no whole number, or is out of its range."""
    if isinstance(value, bool) or not isinstance(value, Integral) or not low <= value <= high:
        raise InputError(f"{name} = {value!r}: must be a whole number from {low} to {high}")


def require_path(name: str, value: Any) -> Path:
    """The path. InputError where something else is given."""
    if not isinstance(value, str | Path):
        raise InputError(f"{name}: {type(value).__name__} is given; a path is needed")
    return Path(value)
