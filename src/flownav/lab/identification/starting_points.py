"""Where the fits start: gain and delay from the runs themselves, dynamics of several shapes with that delay."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flownav.core.measurement import Array
from flownav.lab.identification.descent import Point, Structure
from flownav.lab.identification.experiment import Experiment

DELAY_STEPS = 71
READINGS = 1000  # of a run, that the delays are compared on
SHORTEST_LAG_S = 2e-3
FAST_POLE = 4.0


def points(guess: tuple[float, float], structure: Structure) -> list[Point]:
    """Starts for a structure from a gain and a delay, the delay split between dynamics and a pure one."""
    gain, delay_s = guess
    if structure.order == 0:
        return [Point(np.zeros(0), gain, delay_s)]
    lag_s = max(delay_s, SHORTEST_LAG_S)
    if not structure.delay:
        lags = [(shape, lag_s * factor, 0.0) for shape in (critical, butterworth) for factor in (1.0, 0.4)]
    else:
        lags = [(shape, max(lag_s * share, SHORTEST_LAG_S), lag_s * (1.0 - share))
                for shape in (critical, butterworth) for share in (0.8, 0.3)]  # fmt: skip
    return [Point(np.log(shape(structure.order, lag)), gain, rest) for shape, lag, rest in lags]


def gain_and_delay(runs: Sequence[Experiment], delay_range_s: tuple[float, float]) -> tuple[float, float]:
    """The gain and the delay on a grid that explain most, by regression of each run on its shifted input."""
    best = (0.0, 1.0, 0.0)
    thin = [(run, slice(None, None, max(1, len(run.t_y) // READINGS))) for run in runs]
    for delay_s in np.linspace(*delay_range_s, DELAY_STEPS):
        across, along = 0.0, 1e-300
        for run, some in thin:
            shifted = np.interp(run.t_y[some] - delay_s, run.t_u, run.u)
            shifted -= shifted.mean()
            across += float(shifted @ run.y[some])
            along += float(shifted @ shifted)
        best = max(best, (across * across / along, across / along, float(delay_s)))
    return best[1] or 1e-3, best[2]


def critical(order: int, lag_s: float) -> Array:
    """a_1 .. a_n of (s + n/lag)^n: equal real poles."""
    return np.asarray(np.poly(np.full(order, -order / lag_s))[1:])


def butterworth(order: int, lag_s: float) -> Array:
    """a_1 .. a_n of the Butterworth polynomial whose slow delay a_{n-1}/a_n is the lag."""
    angles = np.pi * (2.0 * np.arange(1, order + 1) + order - 1.0) / (2.0 * order)
    unit = np.poly(np.exp(1j * angles)).real
    rate = unit[-2] / lag_s
    return np.asarray(unit[1:] * rate ** np.arange(1.0, order + 1.0))


def with_fast_poles(log_a: Array, order: int) -> Array:
    """The same dynamics with more real poles, FAST_POLE times as fast as the model's own rate and up."""
    rate = float(np.exp(log_a[-1] / len(log_a)))
    whole = np.concatenate([[1.0], np.exp(log_a)])
    for extra in range(order - len(log_a)):
        whole = np.convolve(whole, [1.0, (FAST_POLE + extra) * rate])
    return np.asarray(np.log(whole[1:]))
