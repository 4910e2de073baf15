"""Numbers as pages write them, and the headline's tiles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

NONE, MINUS = "\N{EN DASH}", "\N{MINUS SIGN}"


@dataclass(frozen=True)
class Part:
    """What a large figure is made of: its name, its value as text, its length as a share of the longest part."""

    name: str
    value: str
    share: float


@dataclass(frozen=True)
class Tile:
    """A large figure of the headline."""

    label: str
    value: str
    unit: str = ""
    note: str = ""
    parts: tuple[Part, ...] = ()


def number(value: Any, digits: int = 4) -> str:
    """A number with a true minus sign and fixed decimals; a dash where there is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return NONE
    return f"{value:z.{digits}f}".replace("-", MINUS)


def metres(value: Any) -> str:
    """A length with as many decimals as it deserves."""
    size = abs(value) if isinstance(value, (int, float)) else 0.0
    return number(value, 3 if size < 1 else 2 if size < 100 else 0)
