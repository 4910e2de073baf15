"""Stability margins of a loop from its frequency response L(jω), where L = -1 is the edge of stability."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.text import finite
from flownav.vehicle.plant import Complex

Array = NDArray[np.float64]


class Margins(NamedTuple):
    """The least phase [deg], gain [dB] and delay [s] that take a closed loop to the edge of stability.

    phase_deg: more lag or more lead, whichever is less, over all crossings of |L| = 1. gain_db: more or less gain,
    over all crossings of the negative real axis. delay_s: over all crossings of |L| = 1. Infinite without a crossing.
    """

    phase_deg: float
    gain_db: float
    delay_s: float

    def finite(self) -> dict[str, float | None]:
        """By name, null where nothing takes the loop to its edge."""
        found: dict[str, float | None] = finite(self._asdict())
        return found


def margins(loop: Complex, omega_rad_s: Array) -> Margins:
    """The margins of L(jω) (n,) on a grid of frequencies fine enough to interpolate on."""
    log_w, phase = np.log(omega_rad_s), np.unwrap(np.angle(loop))
    level = np.log(np.abs(loop))
    gain_crossings, phases = _crossings(level, phase)
    at_w = np.exp(np.interp(gain_crossings, np.arange(len(log_w)), log_w))
    from_edge = _wrapped(phases - np.pi)
    lag = np.mod(from_edge, 2.0 * np.pi)
    levels = [_crossings(phase - edge, level)[1] for edge in _edges(phase)]
    return Margins(
        phase_deg=float(np.degrees(np.min(np.abs(from_edge), initial=np.inf))),
        gain_db=float(20.0 / np.log(10.0) * min((np.min(np.abs(x), initial=np.inf) for x in levels), default=np.inf)),
        delay_s=float(np.min(lag / at_w, initial=np.inf)),
    )


def _edges(phase: Array) -> Array:
    """The odd multiples of π within reach of an unwrapped phase."""
    first, last = np.floor(phase.min() / np.pi), np.ceil(phase.max() / np.pi)
    multiples = np.arange(first, last + 1.0)
    return np.asarray(np.pi * multiples[np.mod(multiples, 2.0) == 1.0])


def _crossings(crossing: Array, read: Array) -> tuple[Array, Array]:
    """Where `crossing` changes sign, as a fractional index, and what `read` is there."""
    at = np.nonzero(np.diff(np.signbit(crossing)))[0]
    share = crossing[at] / (crossing[at] - crossing[at + 1])
    return at + share, read[at] + share * (read[at + 1] - read[at])


def _wrapped(angle: Array) -> Array:
    return np.asarray(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)
