"""Numbers, names and nested dictionaries as text; the TOML is read back by `parameter_files`."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal
from numbers import Integral
from typing import Any

CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")  # all but tab and line feed


def number(text: str) -> float:
    """A decimal number as files and options have it.

    ValueError for what else Python would take: `1_000`, which may be a 1 and three digits of something, and the digits
    of other scripts.
    """
    if "_" in text or not text.isascii():
        raise ValueError(f"not a decimal number: {text!r}")
    return float(text)


def meant(word: str, known: Iterable[str]) -> str:
    """The one of the known words that a misspelt one is near, as a question to end a message with; "" far from all."""
    from difflib import get_close_matches

    names = {name.replace("-", "_"): name for name in known}
    near = get_close_matches(word.replace("-", "_"), names, 1, 0.7)
    return f"; did you mean {names[near[0]]}?" if near else ""


UNITS = {
    "rad_s": "rad/s", "m_s": "m/s", "deg_s": "°/s", "kg_m2": "kg m²", "kg_m3": "kg/m³", "n_m_rad": "N m/rad",
    "n_m": "N/m", "n_s_m": "N s/m", "1_s": "1/s", "1_rad": "1/rad", "s_rad": "s/rad", "per_rad": "1/rad",
    "m2": "m²", "mrad": "mrad", "deg": "°", "percent": "%", "mg": "mg", "ug_rthz": "µg/√Hz", "mgauss": "mG",
    "m": "m", "s": "s", "kg": "kg", "w": "W", "v": "V", "ah": "Ah", "ohm": "Ω",
}  # units at the end of a key, the longest that fits  # fmt: skip
KEY_WORDS = {"wind.speed_20ft_m_s": "wind at 20 ft (m/s)", "wind.from_direction_deg": "wind from (°)"}


def key_words(key: str) -> str:
    """A key of a parameter file in words, with its unit.

    Example:
        >>> key_words("vehicle.main_rotor.speed_rad_s"), key_words("noise"), key_words("wind.from_direction_deg")
        ('vehicle, main rotor: speed (rad/s)', 'noise', 'wind from (°)')
        >>> key_words("vehicle.drive.governor_gain_s_rad")
        'vehicle, drive: governor gain (s/rad)'
    """
    if key in KEY_WORDS:
        return KEY_WORDS[key]
    *groups, name = key.split(".")
    ends = sorted((end for end in UNITS if name.endswith(f"_{end}")), key=len)
    unit = f" ({UNITS[ends[-1]]})" if ends else ""
    words = name.removesuffix(f"_{ends[-1]}") if ends else name
    where = f"{', '.join(groups)}: " if groups else ""
    return f"{where}{words}".replace("_", " ") + unit


def finite_or_none(value: float | None) -> float | None:
    """A number as JSON has it: None where there is none, where it is infinite and where it is no number."""
    return None if value is None or not math.isfinite(value) else float(value)


def interval_words(low: float | None, high: float | None, form: str = ".3f", join: str = " to ") -> str:
    """An interval's two ends; of one that too few flights leave open, the end that there is: "at least 0.110"."""
    if low is None or high is None:
        ends = [f"{word} {end:{form}}" for word, end in (("at least", low), ("at most", high)) if end is not None]
        return ends[0] if ends else "anything"
    return f"{low:{form}}{join}{high:{form}}"


def finite(value: Any) -> Any:
    """A value, and all within it, as JSON has it: `finite_or_none` of its numbers, lists of tuples."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return finite_or_none(value) if isinstance(value, float) else value


def exactly(value: float, times: int = 1) -> str:
    """A finite number, or a multiple of it, in as many decimals as it takes to tell it from every other."""
    shown = Decimal(repr(float(value))) * times
    return f"{shown.normalize() if shown else Decimal(0):f}"


def harmless(text: str) -> str:
    """Text for a terminal: characters that would command it, as a file from elsewhere can hold, are written as
    escapes.
    """
    return CONTROL.sub(lambda found: repr(found.group())[1:-1], text)


def plain(text: str) -> str:
    """Text for a file in UTF-8: the bytes of a file's name that are no UTF-8 are written as escapes."""
    return text.encode("utf-8", errors="backslashreplace").decode("utf-8")


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
    if isinstance(value, Integral):
        return str(int(value))
    number = float(value)
    return repr(number) if math.isfinite(number) else "nan"


def _quoted(text: str) -> str:
    escaped = plain(text).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
