"""Nested dictionaries as TOML text, which `parameter_files` reads back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flownav.core.text import plain


def to_toml(entries: Mapping[str, Any]) -> str:
    """Nested dictionaries as TOML: values with provenance inline, tables and lists of tables with headers.

    The same numbers are read back, to the bit.
    """
    return "\n".join(_lines(entries, "")) + "\n"


def _lines(entries: Mapping[str, Any], prefix: str) -> list[str]:
    lines = [f"{key} = {_literal(value)}" for key, value in entries.items() if not _is_table(value)]
    for key, value in entries.items():
        if not _is_table(value):
            continue
        header = f"{prefix}{key}"
        for table in value if isinstance(value, list) else [value]:
            lines += ["", f"[[{header}]]" if isinstance(value, list) else f"[{header}]"]
            lines += _lines(table, f"{header}.")
    return lines


def _is_table(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and isinstance(value[0], Mapping)
    return isinstance(value, Mapping) and "value" not in value


def _literal(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_literal(item)}" for key, item in value.items()) + " }"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, Sequence):
        return "[" + ", ".join(_literal(item) for item in value) + "]"
    if isinstance(value, int | np.integer):
        return str(int(value))
    number = float(value)
    return repr(number) if math.isfinite(number) else "nan"


def _quoted(text: str) -> str:
    escaped = plain(text).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
