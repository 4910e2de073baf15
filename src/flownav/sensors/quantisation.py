"""Readings that come in whole steps."""

from __future__ import annotations

import numpy as np

from flownav.core.compile import equation


@equation
def quantised(value: float, quantum: float, steps_per_unit: float) -> float:
    """`value` to the nearest whole multiple of `quantum` (halves to even); unchanged where `quantum` is 0.

    `steps_per_unit` is 1/quantum (0 where quantum is 0). `np.rint` is one processor instruction in scalar and
    in vector code, so lanes keep their speed and their bits.
    """
    return np.rint(value * steps_per_unit) * quantum if quantum > 0.0 else value


def steps_per_unit(quantum: float) -> float:
    """1/quantum, or 0 where there is no quantisation."""
    return 1.0 / quantum if quantum > 0.0 else 0.0
