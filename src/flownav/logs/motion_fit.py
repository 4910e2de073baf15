"""How a reference's path fits the motion that one of a log's sensors saw.

The motion w that a sensor saw (`logs/witnesses.py`: velocity by GPS or flow, acceleration by the accelerometer) is held
against the path's, u, both as complex numbers, north plus i east, every STEP_S. Within windows of WINDOW_S, w = c u
with a free complex c, so that neither the path's north, nor a scale, nor a heading that drifts slowly counts; of
accelerations the windows' means are taken out: a bias, and a level that is off. A mirrored path fits by w = c conj(u)
instead, and a late one by w(t) = c u(t + lag). R2 is the share of w's square that is explained.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, Table
from flownav.logs.witnesses import HALF_S, Complex, Witness, averaged, joined

STEP_S, WINDOW_S = 0.1, 20.0  # of the grid; chosen: a gyro of 0.5 deg/s turns a heading by 10 deg in a window
LEAST_S = 10.0  # of common time
LEAST_MOTION = (0.15, 0.15)  # rms of what was seen, m/s and m/s2
LATEST_S, LAG_STEP_S = 2.0, 0.05
FITS = 0.8  # R2 of a path that fits
FITS_NOISILY = 0.5  # R2 of a path that fits where the other hand explains a third of that at most
UNEXPLAINED, LEAST_UNEXPLAINED = 3.0, 0.05  # is left by a path that does not fit: times as much, and of all. Along a
# straight line both hands fit, and what is left of either is small errors
LATE_LEAST = 0.02  # is left at least without a lag that leaves UNEXPLAINED times less; a late circle is a turned circle
LATE_UNEXPLAINED = 1.5  # times as much is left without the lag
ALIKE_RAD = np.radians(15.0)  # of one window's turn with the whole's


class Fit(NamedTuple):
    """lag_s: by which a reference is late; explained: R2 with that lag, and at_once: without; mirrored: R2 of its
    mirror image with the lag that is best for that.
    """

    lag_s: float
    explained: float
    at_once: float
    mirrored: float

    @property
    def hand(self) -> int:
        """1 the reference fits as it is, -1 its mirror image does, 0 this does not show."""
        return _clearly(self.explained, self.mirrored) - _clearly(self.mirrored, self.explained)

    @property
    def is_late(self) -> bool:
        """Whether what was seen is explained clearly better with the lag."""
        left, left_at_once = 1.0 - self.explained, 1.0 - self.at_once
        much = left_at_once - left >= LEAST_UNEXPLAINED and left_at_once >= LATE_UNEXPLAINED * left
        return much or left_at_once >= max(UNEXPLAINED * left, LATE_LEAST)


def _clearly(fits: float, does_not: float) -> bool:
    """Whether one R2 is of a path that fits and another of one that does not."""
    clear = fits >= FITS and 1.0 - does_not >= max(UNEXPLAINED * (1.0 - fits), LEAST_UNEXPLAINED)
    return clear or (fits >= FITS_NOISILY and UNEXPLAINED * does_not <= fits)


def path_of(truth: Table) -> tuple[Array, Array]:
    """Times (n,) and places (n, 3)."""
    return np.asarray(truth["t_s"], float), np.column_stack([np.asarray(truth[name], float) for name in POSITION_NED])


def fit_of(t_s: Array, path: Array, witness: Witness) -> Fit | None:
    """How a path (n,), (n, 3) fits what a sensor saw; None where too little moves."""
    grid = _grid(t_s, witness)
    if len(grid) * STEP_S < LEAST_S:
        return None
    seen = averaged(witness.t_s, witness.level, grid)
    most = round(LATEST_S / LAG_STEP_S)
    lags = LAG_STEP_S * np.arange(-most, most + 1)
    every = round(STEP_S / LAG_STEP_S)
    fine = motion(t_s, path, grid[0] + LAG_STEP_S * np.arange(-most, every * len(grid) + most), witness.order)
    moved = [fine[first : first + every * len(grid) : every] for first in range(len(lags))]
    known = np.isfinite(seen) & np.all([np.isfinite(one) for one in moved], axis=0)
    if np.count_nonzero(known) * STEP_S < LEAST_S:
        return None
    windows = _windows(grid)[known]
    seen = _centred(seen[known], windows, witness.order)
    if np.sqrt(np.mean(np.abs(seen) ** 2)) < LEAST_MOTION[witness.order - 1]:
        return None
    images = [_centred(one[known], windows, witness.order) for one in moved]
    explained = [_explained(seen, image, windows) for image in images]
    mirrored = [_explained(seen, np.conj(image), windows) for image in images]
    best = int(np.argmax(explained))
    return Fit(float(lags[best]), explained[best], explained[len(lags) // 2], max(mirrored))


def motion(t_s: Array, path: Array, at_s: Array, order: int) -> Complex:
    """A path's velocity (order 1) over 2 HALF_S about instants (n,), or its acceleration (order 2) as it is averaged
    twice over that; NaN outside and in its gaps.
    """

    def place(by_s: float) -> Complex:
        north, east = (joined(at_s + by_s, t_s, path[:, axis]) for axis in (0, 1))
        return np.asarray(north + 1j * east)

    if order == 1:
        return (place(HALF_S) - place(-HALF_S)) / (2.0 * HALF_S)
    return (place(2.0 * HALF_S) - 2.0 * place(0.0) + place(-2.0 * HALF_S)) / (2.0 * HALF_S) ** 2


def _grid(t_s: Array, witness: Witness) -> Array:
    """Instants of both."""
    if len(t_s) < 2:
        return np.zeros(0)
    return np.arange(max(t_s[0], witness.t_s[0]), min(t_s[-1], witness.t_s[-1]), STEP_S)


def _windows(grid: Array) -> NDArray[np.int_]:
    return np.asarray((grid - grid[0]) // WINDOW_S, int)


def _sums(values: Complex, windows: NDArray[np.int_]) -> Complex:
    return np.asarray(np.bincount(windows, values.real) + 1j * np.bincount(windows, values.imag))


def _centred(values: Complex, windows: NDArray[np.int_], order: int) -> Complex:
    """Accelerations without their windows' means; velocities as they are."""
    if order == 1:
        return values
    return np.asarray(values - (_sums(values, windows) / np.maximum(np.bincount(windows), 1))[windows])


def _explained(seen: Complex, moved: Complex, windows: NDArray[np.int_]) -> float:
    """R2 of seen = c moved, with one complex c a window."""
    across = _sums(seen * np.conj(moved), windows)
    square = np.maximum(np.bincount(windows, np.abs(moved) ** 2), 1e-12)
    return float(np.sum(np.abs(across) ** 2 / square) / np.sum(np.abs(seen) ** 2))


def turn_rad(t_s: Array, path: Array, heading: tuple[Array, Array], witness: Witness, lag_s: float) -> float | None:
    """The angle from what a sensor saw, turned by headings, to how the path goes [rad]; None where it is not the same
    all the while.
    """
    if witness.body is None:
        return None
    grid = _grid(t_s, witness)
    yaw = np.interp(witness.t_s + lag_s, *heading, np.nan, np.nan)
    seen = averaged(witness.t_s, witness.body * np.exp(1j * np.nan_to_num(yaw)), grid)
    moved = motion(t_s, path, grid + lag_s, witness.order)
    known = np.isfinite(seen) & np.isfinite(moved) & (grid + lag_s >= heading[0][0]) & (grid + lag_s <= heading[0][-1])
    if np.count_nonzero(known) * STEP_S < LEAST_S:
        return None
    windows = _windows(grid)[known]
    seen, moved = (_centred(one[known], windows, witness.order) for one in (seen, moved))
    turns = _sums(moved * np.conj(seen), windows)
    whole = complex(np.sum(turns))
    weight = np.bincount(windows, np.abs(moved) ** 2)
    alike = np.abs(np.angle(turns * np.conj(whole))) <= ALIKE_RAD
    return float(np.angle(whole)) if np.sum(weight[alike]) >= FITS * np.sum(weight) else None
