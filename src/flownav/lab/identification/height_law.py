"""How a flow sensor's error grows with height, and which schedule of its variance a filter should use.

Named laws for the standard deviation of the velocity error at height h:

- `paper`: (1 - 0.90 sqrt(0.6/h)) sigma_signal. The paper scales its fits by field of view and speed, h/0.6 and
  sqrt(0.6/h), and finds 0.9 at every height; that is a fit of 0.90 sqrt(0.6/h), and fit = 1 - sigma/sigma_signal.
- `power`: sigma_r (h/h_r)^n, fitted; Table 2's means give 0.0350 (h/0.6)^2.06 m/s.

Schedules compared: `constant` (one variance), `quality` (variance by the reading's quality, as PX4 does between its
N_MIN and N_MAX), `height` (the fitted power law), `paper`. Each is fitted on every other block of the log and scored on
the blocks between by the mean of log sigma + e^2/(2 sigma^2): the lower, the better the schedule.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.lab.identification.output_error import Z_95
from flownav.lab.identification.quantities import Interval

ACCURACY, ACCURACY_HEIGHT_M = 0.90, 0.6
MOST_BINS = 8
LEAST_IN_BIN = 40
BLOCK_READINGS = 200  # readings
SMALLEST_SIGMA_M_S = 1e-4
QUALITY_EDGES = (1.0, 64.0, 128.0, 192.0, 255.0, 256.0)


def paper_fit(height_m: Array | float) -> Array:
    """The paper's accuracy at a height: 0.90 sqrt(0.6/h), at most 1."""
    return np.minimum(1.0, ACCURACY * np.sqrt(ACCURACY_HEIGHT_M / np.asarray(height_m, float)))


def paper_sigma(height_m: Array | float, signal_sigma_m_s: float) -> Array:
    """Standard deviation of the velocity error by the paper's rule [m/s]."""
    return np.maximum(SMALLEST_SIGMA_M_S, (1.0 - paper_fit(height_m)) * signal_sigma_m_s)


class PowerLaw(NamedTuple):
    """sigma(h) = sigma_m_s (h/reference_m)^exponent between low_m and high_m, held outside."""

    sigma_m_s: Interval
    exponent: Interval
    reference_m: float
    low_m: float
    high_m: float

    def at(self, height_m: Array | float) -> Array:
        """sigma [m/s]."""
        height = np.clip(np.asarray(height_m, float), self.low_m, self.high_m)
        return np.asarray(self.sigma_m_s.value * (height / self.reference_m) ** self.exponent.value)


class NoisePoint(NamedTuple):
    """Error of the readings about one height."""

    height_m: float
    sigma_m_s: float
    readings: int

    @property
    def sigma_rad_s(self) -> float:
        """The standard deviation as an angular rate."""
        return self.sigma_m_s / self.height_m


class QualityPoint(NamedTuple):
    """Error variance of the readings of some quality."""

    low: int
    high: int
    variance_m2_s2: float
    readings: int


class ScheduleScore(NamedTuple):
    """How well a schedule of the variance describes the error to a filter, on readings it was not fitted to."""

    name: str
    score: float  # mean of log sigma + e^2/(2 sigma^2)
    share_within_2_sigma: float
    sigma_lowest_m_s: float
    sigma_highest_m_s: float


def fit_power_law(points: Sequence[NoisePoint]) -> PowerLaw:
    """Weighted least squares of log sigma on log h. With one height, or heights within 10 %, a constant.

    A standard deviation from n readings is known to 1/sqrt(2 n); where the points scatter more than that, the
    scatter widens the intervals.
    """
    heights = np.array([point.height_m for point in points])
    sigmas = np.maximum([point.sigma_m_s for point in points], SMALLEST_SIGMA_M_S)
    weights = np.array([2.0 * point.readings for point in points])
    reference = float(np.exp(np.sum(weights * np.log(heights)) / weights.sum()))
    x, y = np.log(heights / reference), np.log(sigmas)
    sloped = len(points) > 1 and heights.max() > 1.1 * heights.min()
    design = np.column_stack([np.ones(len(x)), x]) if sloped else np.ones((len(x), 1))
    inverse = np.linalg.inv(design.T @ (weights[:, None] * design))
    solution = inverse @ (design.T @ (weights * y))
    degrees = len(x) - design.shape[1]
    scatter = float(np.sum(weights * (y - design @ solution) ** 2)) / degrees if degrees > 0 else 1.0
    deviation = np.sqrt(np.diag(inverse) * max(1.0, scatter))
    exponent = Interval.of(float(solution[1]), float(deviation[1])) if sloped else Interval(0.0, 0.0, 0.0)
    sigma = Interval.of_log(float(np.exp(solution[0])), float(deviation[0]))
    return PowerLaw(sigma, exponent, reference, float(heights.min()), float(heights.max()))


def noise_by_height(error: Array, height_m: Array) -> list[NoisePoint]:
    """Standard deviations in bins of height with equal shares of the readings; error (n,), height_m (n,).

    About the mean of each bin, outliers beyond five median deviations left out.
    """
    count = max(1, min(MOST_BINS, len(error) // LEAST_IN_BIN))
    edges = np.unique(np.quantile(height_m, np.linspace(0.0, 1.0, count + 1)))
    if len(edges) < 2:
        return [NoisePoint(float(height_m[0]), spread(error), len(error))]
    places = np.clip(np.searchsorted(edges, height_m, side="right") - 1, 0, len(edges) - 2)
    return [
        NoisePoint(float(height_m[places == i].mean()), spread(error[places == i]), int(np.sum(places == i)))
        for i in range(len(edges) - 1)
        if np.sum(places == i) >= 2
    ]


def variance_by_quality(error: Array, quality: Array) -> list[QualityPoint]:
    """Error variance in classes of quality; classes with few readings are left out."""
    points = []
    for low, high in pairwise(QUALITY_EDGES):
        mine = (quality >= low) & (quality < high)
        if np.count_nonzero(mine) >= LEAST_IN_BIN:
            points.append(QualityPoint(int(low), int(high - 1), spread(error[mine]) ** 2, int(mine.sum())))
    return points


def spread(error: Array) -> float:
    """Standard deviation without outliers beyond five robust ones [same unit]."""
    centred = error - np.median(error)
    robust = 1.4826 * float(np.median(np.abs(centred)))
    kept = centred[np.abs(centred) <= 5.0 * robust] if robust > 0.0 else centred
    return max(float(kept.std()), SMALLEST_SIGMA_M_S)


def tail(error: Array, sigma: Array) -> float:
    """How many standard deviations hold 99.7 % of the readings: 3 for normal errors."""
    return float(np.quantile(np.abs(error - np.median(error)) / sigma, 0.9973))


def compare_schedules(error: Array, height_m: Array, quality: Array, signal_sigma_m_s: float) -> list[ScheduleScore]:
    """The table, best first; error, height and quality (n,) in order of time."""
    trained = (np.arange(len(error)) // max(1, min(BLOCK_READINGS, len(error) // 4))) % 2 == 0
    fitted: dict[str, Callable[[NDArray[np.bool_]], Array]] = {
        "constant": _constant(error[trained]),
        "quality": _by_quality(error[trained], quality[trained], quality),
        "height": _by_height(error[trained], height_m[trained], height_m),
        "paper": lambda rows: paper_sigma(height_m[rows], signal_sigma_m_s),
    }
    lowest, highest = (height_m <= np.quantile(height_m, 0.1)), (height_m >= np.quantile(height_m, 0.9))
    centred = error - np.median(error)
    scores = []
    for name, sigma_of in fitted.items():
        sigma = sigma_of(~trained)
        ratio = centred[~trained] / sigma
        score = float(np.mean(np.log(sigma) + 0.5 * np.minimum(ratio**2, 25.0)))
        within = float(np.mean(np.abs(ratio) <= 2.0))
        scores.append(
            ScheduleScore(name, score, within, float(sigma_of(lowest).mean()), float(sigma_of(highest).mean()))
        )
    return sorted(scores, key=lambda row: row.score)


def _constant(error: Array) -> Callable[[NDArray[np.bool_]], Array]:
    sigma = spread(error)
    return lambda rows: np.full(int(rows.sum()), sigma)


def _by_quality(error: Array, quality: Array, all_quality: Array) -> Callable[[NDArray[np.bool_]], Array]:
    points = variance_by_quality(error, quality)
    if not points:
        return _constant(error)
    middles = np.array([0.5 * (point.low + point.high) for point in points])
    sigmas = np.sqrt([point.variance_m2_s2 for point in points])
    return lambda rows: np.interp(all_quality[rows], middles, sigmas)


def _by_height(error: Array, height_m: Array, all_height_m: Array) -> Callable[[NDArray[np.bool_]], Array]:
    law = fit_power_law(noise_by_height(error, height_m))
    return lambda rows: law.at(all_height_m[rows])


def combined(intervals: Sequence[Interval]) -> Interval:
    """One value for several with their intervals; how much they differ beyond them widens it.

    Random-effects mean (DerSimonian and Laird 1986).
    """
    values = np.array([interval.value for interval in intervals])
    variances = np.array([((i.high - i.low) / (2.0 * Z_95)) ** 2 for i in intervals])
    variances = np.maximum(variances, 1e-16)
    if len(values) == 1:
        return intervals[0]
    weights = 1.0 / variances
    mean = float(weights @ values / weights.sum())
    excess = float(weights @ (values - mean) ** 2) - (len(values) - 1)
    between = max(0.0, excess / float(weights.sum() - (weights @ weights) / weights.sum()))
    weights = 1.0 / (variances + between)
    return Interval.of(float(weights @ values / weights.sum()), float(np.sqrt(1.0 / weights.sum())))
