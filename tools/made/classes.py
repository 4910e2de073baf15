"""Every class of made flights, by name; `a-` is of generator A (splines), `b-` of generator B (closed loop)."""

from __future__ import annotations

from made import loop_sensors, loop_traits, spline_sensors, spline_traits
from made.flight import Made

NAMES = (*spline_traits.CLASSES, spline_traits.MIX, *loop_traits.CLASSES, loop_traits.MIX)


def make(name: str, number: int) -> Made:
    """One flight of a class: the same words, the same bits. KeyError where no class has the name."""
    if name not in NAMES:
        raise KeyError(name)
    return (spline_sensors if name.startswith("a-") else loop_sensors).make(name, number)
