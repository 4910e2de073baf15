"""The signals that hypotheses use: a log's readings side by side, filtered, resampled; pure functions of arrays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array

Flags = NDArray[np.bool_]


def running_mean(values: Array, count: int) -> Array:
    """Mean over `count` rows centred on each (n, k), of those that there are at the ends."""
    padded = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    first = np.clip(np.arange(len(values)) - count // 2, 0, len(values))
    last = np.clip(np.arange(len(values)) + (count + 1) // 2, 0, len(values))
    return np.asarray((padded[last] - padded[first]) / (last - first)[:, None])


def high_pass(t_s: Array, values: Array, width_s: float) -> Array:
    """Columns (n, k) less their running mean of that width, which is taken twice so that its skirts are steep."""
    count = max(3, round(width_s / max(float(np.median(np.diff(t_s))), 1e-4)))
    mean = running_mean(running_mean(values, count), count)
    return np.asarray(values - mean)


def at(t_s: Array, values: Array, instants_s: Array) -> Array:
    """Columns (n, k) at instants (m,) by straight lines."""
    return np.column_stack([np.interp(instants_s, t_s, column) for column in values.T])


def gap_near(t_s: Array, instants_s: Array) -> Array:
    """How far each instant (m,) is from the nearest sample [s]."""
    if not len(t_s):
        return np.full(len(instants_s), np.inf)
    after = np.clip(np.searchsorted(t_s, instants_s), 0, len(t_s) - 1)
    before = np.maximum(after - 1, 0)
    return np.asarray(np.minimum(np.abs(t_s[after] - instants_s), np.abs(instants_s - t_s[before])))


def running_median(values: Array, count: int) -> Array:
    """Median over `count` rows (odd) centred on each (n,)."""
    width = min(count | 1, len(values) - 1 + len(values) % 2)
    padded = np.pad(values, width // 2, mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1))


def spread(values: Array) -> float:
    """Standard deviation by the median absolute deviation; 0 of nothing."""
    if not len(values):
        return 0.0
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def stretches(flags: Flags) -> list[tuple[int, int]]:
    """First and last row of every stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(first), int(end) - 1) for first, end in edges.reshape(-1, 2)]


class Fit(NamedTuple):
    """y = M x at the best lag: M (k, j) with standard errors, the lag [s], the share of y's power explained."""

    matrix: Array
    sigma: Array
    lag_s: float
    share: float


def lagged_fit(t_s: Array, y: Array, x_t_s: Array, x: Array, lags_s: Array) -> Fit:
    """Regress y(t) (n, k) on x(t - lag) (m, j) at the lag that explains most; a parabola refines it.

    Standard errors take the residual as white over three rows.
    """
    explained = []
    for lag in lags_s:
        design = at(x_t_s, x, t_s - lag)
        explained.append(_explained(design, y)[0])
    best = int(np.argmax(explained))
    lag = float(lags_s[best])
    if 0 < best < len(lags_s) - 1:
        before, here, after = explained[best - 1 : best + 2]
        bend = before - 2.0 * here + after
        lag += float(0.5 * (before - after) / bend * (lags_s[1] - lags_s[0])) if bend < 0.0 else 0.0
    design = at(x_t_s, x, t_s - lag)
    share, matrix = _explained(design, y)
    left = np.var(y - design @ matrix.T, axis=0)
    inverse = np.diag(np.linalg.pinv(design.T @ design))
    return Fit(matrix, np.sqrt(3.0 * np.outer(left, inverse)), lag, share)


def _explained(x: Array, y: Array) -> tuple[float, Array]:
    matrix = np.linalg.lstsq(x, y, rcond=None)[0].T
    power = float(np.sum(y**2))
    return (1.0 - float(np.sum((y - x @ matrix.T) ** 2)) / power if power > 0.0 else 0.0), np.asarray(matrix)


def turn_of(matrix: Array) -> tuple[float, float, bool]:
    """Of a 2 by 2 response: the angle by which it turns [rad], its mean gain, and whether it mirrors."""
    mirrored = bool(np.linalg.det(matrix) < 0.0)
    straight = matrix @ np.diag([1.0, -1.0]) if mirrored else matrix
    angle = float(np.arctan2(straight[1, 0] - straight[0, 1], straight[0, 0] + straight[1, 1]))
    return angle, float(0.5 * np.hypot(straight[1, 0] - straight[0, 1], straight[0, 0] + straight[1, 1])), mirrored
