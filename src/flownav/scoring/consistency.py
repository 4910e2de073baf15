"""Consistency of a filter: does it know how wrong it is, and is it as good as its own model allows.

Of one flight by its innovations (`consistency_of`): are they as large as it states, and is each one news. Of many
flights by their errors from a known truth. Those are over steps in flight, those without skid contact, from the
filter's start on: at rest on the ground a filter is given zero velocity, a pseudo-measurement whose stated sigma
is a guess, and its errors there are none of a flying vehicle's.

Sums, not flights, are kept: memory does not grow with the number of flights.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, Sensor
from flownav.scoring.errors import STATES

SCORED = 6  # position and velocity, the degrees of freedom of a normalised error squared
GROUP_FLIGHTS = 96  # flights whose mean is held against the band: the test is as sharp however many are flown
BAND_PROBABILITY = 0.95  # probability of the chi-square band
AIRBORNE_SHARE = 0.9  # of the flights without contact: the step is one in flight
SURE_99 = 2.5758293035489004  # standard deviations of a normal distribution that hold 99 % of it
LITTLE_COLOUR = 0.2  # an autocorrelation that does no harm, however many readings prove that it is there
MODEST_SQUARES = (0.5, 2.0)  # mean squares: the stated errors are of the right size, to a factor of 1.4
LEAST_SHARE = 0.01  # of the steps in flight: a height band with fewer says nothing
HEIGHTS_M = (0.0, 0.3, 1.0, 3.5, np.inf)  # of the skids: between them lie the height bands


@dataclass(frozen=True)
class ErrorSums:
    """Sums over the steps in flight of each height band: squares (bands, 6), and how many steps (bands,)."""

    squares: Array
    steps: Array

    def __add__(self, other: ErrorSums) -> ErrorSums:
        return ErrorSums(self.squares + other.squares, self.steps + other.steps)

    def root_mean_square(self) -> Array:
        """Root mean square of each state over all steps, (6,); NaN without a step."""
        return _root(self.squares.sum(axis=0), self.steps.sum())

    def root_mean_square_by_height(self) -> Array:
        """Root mean square of each state in each height band, (bands, 6); NaN where no step was in the band."""
        return _root(self.squares, self.steps[:, None])


@dataclass(frozen=True)
class ConsistencySums:
    """Sums over flights at each step, (epochs,): normalised errors squared, flights whose filter runs, and of these
    the flights without skid contact. errors: of the states; over_stated: the same over what is stated of each.
    """

    flights: int
    nees: Array
    running: Array
    airborne: Array
    errors: ErrorSums
    over_stated: ErrorSums

    def __add__(self, other: ConsistencySums) -> ConsistencySums:
        return ConsistencySums(*(getattr(self, own.name) + getattr(other, own.name) for own in fields(self)))


def error_sums(squares: Array, height_m: Array, airborne: Array) -> ErrorSums:
    """Sums of one block: squares (epochs, 6, lanes), height of the skids and airborne 0/1 (epochs, lanes)."""
    sums = np.zeros((len(HEIGHTS_M) - 1, SCORED))
    steps = np.zeros(len(HEIGHTS_M) - 1)
    band = np.clip(np.searchsorted(HEIGHTS_M, height_m, side="right") - 1, 0, len(steps) - 1)
    for b in range(len(steps)):
        inside = airborne * (band == b)
        sums[b] = np.einsum("esl,el->s", squares, inside)
        steps[b] = inside.sum()
    return ErrorSums(sums, steps)


def consistency_of_block(error: Array, sigma: Array, nees: Array, height_m: Array, on_ground: Array) -> ConsistencySums:
    """Sums of one block: error and its stated sigma (epochs, 6, lanes), the others (epochs, lanes); NaN where the
    filter has not started.
    """
    running = np.isfinite(nees)
    airborne = running * (1.0 - on_ground)
    known = np.where(running[:, None], error, 0.0)
    over = known / np.where(running[:, None], sigma, 1.0)
    return ConsistencySums(
        nees.shape[1],
        np.where(running, nees, 0.0).sum(axis=1),
        running.sum(axis=1),
        airborne.sum(axis=1),
        error_sums(known**2, height_m, airborne),
        error_sums(over**2, height_m, airborne),
    )


# -- one flight, by its innovations -----------------------------------------------------------------------
class InnovationConsistency(NamedTuple):
    """Consistency of a sensor in a flight: the mean normalised innovation squared of its components (1 where the filter
    states its errors rightly), how many they are, whether each one is news, unlike the one before, and which share of
    those that were tested lay outside the gate and is not among them."""

    nis_per_dof: float
    samples: int
    white: bool
    refused: float = 0.0


def consistency_of(component: NDArray[Any], innovation: Array, variance: Array) -> InnovationConsistency | None:
    """Consistency of one sensor's tested components in order of time, (n,) each; None where none was tested.

    component: which of the sensor's values; each is held against the one before of its own kind. variance: of the
    innovation, in its unit squared.
    """
    found = nis_of(innovation, variance)
    if found is None:
        return None
    known = np.isfinite(innovation) & np.isfinite(variance) & (variance > 0.0)
    normal, kind = innovation[known] / np.sqrt(variance[known]), component[known]
    white = all(is_white(normal[kind == one]) for one in np.unique(kind))
    return InnovationConsistency(found.mean, found.tested, white)


def consistency_by_sensor(
    rows_of: Callable[[Sensor], NDArray[np.bool_]], fused: NDArray[np.bool_], component: NDArray[Any],
    innovation: Array, variance: Array,
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """The consistency of each sensor that has fused components, by its name.

    rows_of: which rows of the tested components are a sensor's; fused (n,): which of them lay inside the gate. What
    was refused was not believed: it tells of the sensor, by its share, and not of what the filter states. Of a sensor
    that was refused throughout all count, so that it is judged at all.
    """
    found = {}
    for sensor in Sensor:
        rows = rows_of(sensor)
        kept = rows & fused if (rows & fused).any() else rows
        judged = consistency_of(component[kept], innovation[kept], variance[kept])
        if judged is not None:
            refused = float(np.count_nonzero(rows & ~fused) / np.count_nonzero(rows))
            found[sensor.name.lower()] = judged._replace(refused=refused)._asdict()
    return found


def aloft(t_s: Array, stated_s: Array, landed: Array) -> NDArray[np.bool_]:
    """Which instants (n,) are in flight by a signal (m,) that is 1 on the ground; all where it shows no flight."""
    if not len(stated_s) or not (landed < 0.5).any():
        return np.ones(len(t_s), bool)
    row = np.clip(np.searchsorted(stated_s, t_s, side="right") - 1, 0, len(stated_s) - 1)
    return np.asarray(landed[row] < 0.5)


def is_white(normalised: Array) -> bool:
    """Whether normalised innovations (n,) are uncorrelated, up to chance or an amount too small to matter."""
    band = SURE_99 / np.sqrt(max(len(normalised), 1))
    return bool(abs(lag_one(normalised)) <= max(band, LITTLE_COLOUR))


def lag_one(normalised: Array) -> float:
    """Autocorrelation of neighbours about zero, -1 to 1: an innovation's mean is zero, and a bias is colour too."""
    power = float(np.sum(normalised**2))
    return float(np.sum(normalised[1:] * normalised[:-1])) / power if power > 0.0 else 0.0


# -- many flights, by their errors -----------------------------------------------------------------------
def chi_square_band(flights: int, probability: float = BAND_PROBABILITY) -> tuple[float, float]:
    """Where the mean normalised error squared of `flights` independent flights lies with this probability.

    Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 5.4.2.
    """
    from scipy.special import chdtri

    tail = 0.5 * (1.0 - probability)
    low, high = chdtri(SCORED * flights, 1.0 - tail), chdtri(SCORED * flights, tail)
    return float(low) / flights, float(high) / flights


def steps_in_flight(sums: ConsistencySums) -> NDArray[np.bool_]:
    """The steps at which every filter runs and nearly all flights have no skid contact, (epochs,)."""
    return np.asarray((sums.running == sums.flights) & (sums.airborne >= AIRBORNE_SHARE * sums.flights))


def anees(sums: ConsistencySums) -> float:
    """Mean normalised error squared per degree of freedom over the steps in flight: 1 is modest enough, no more."""
    inside = steps_in_flight(sums)
    return float(np.mean(sums.nees[inside])) / (SCORED * sums.flights) if inside.any() else float("nan")


def inside_steps(sums: ConsistencySums, size: Array | float = 1.0) -> tuple[int, int]:
    """How many steps in flight have their mean over flights inside its 95 % band, and of how many.

    size: of what is stated of the covariance, by which it is multiplied before: of each step (epochs,), or of all.
    """
    inside = steps_in_flight(sums)
    mean = sums.nees[inside] / (sums.flights * np.broadcast_to(size, inside.shape)[inside])
    low, high = chi_square_band(sums.flights)
    return int(np.count_nonzero((mean >= low) & (mean <= high))), len(mean)


class Within(NamedTuple):
    """Shares of the steps in flight whose groups' ANEES is inside its band: as stated, and had the covariance of a
    group been stated as large as the other groups' flights show it to be, by one number for the whole case, or by one
    for each step. NaN where there are no others.

    The second is what a filter can reach whose stated size is right on average, the third one that is right always.
    """

    as_stated: float
    sized: float
    sized_at_each_step: float


def within_band(groups: Sequence[ConsistencySums], sums: ConsistencySums) -> Within:
    """The shares of groups of flights, of which `sums` has all."""
    as_stated, by_case, by_step = [], [], []
    for group in groups:
        as_stated.append(inside_steps(group))
        others = sums.flights - group.flights
        if others > 0:
            ratio = (sums.nees - group.nees) / (SCORED * others)
            inside = steps_in_flight(group)
            by_case.append(inside_steps(group, float(np.mean(ratio[inside])) if inside.any() else 1.0))
            by_step.append(inside_steps(group, np.maximum(ratio, np.finfo(float).tiny)))
    return Within(*map(inside_fraction, (as_stated, by_case, by_step)))


def inside_fraction(groups: Sequence[tuple[int, int]]) -> float:
    """Share of the steps in flight inside the band, over groups as `inside_steps` has them; NaN without a step."""
    inside, steps = (sum(group[i] for group in groups) for i in (0, 1))
    return inside / steps if steps else float("nan")


# -- efficiency -------------------------------------------------------------------------------------------
def efficiency(errors: ErrorSums, bound: ErrorSums) -> dict[str, float]:
    """RMS error over the root of the mean bound, of each state: 1 is what a filter does whose model is the truth."""
    ratio = errors.root_mean_square() / bound.root_mean_square()
    return dict(zip(STATES, map(float, ratio), strict=True))


def over_stated(sums: ConsistencySums) -> dict[str, float]:
    """Root mean square of each state's error over what is stated of it: 1 is as stated, below 1 the error is smaller.

    The NEES weighs all states at once; this separates them.
    """
    return dict(zip(STATES, map(float, sums.over_stated.root_mean_square()), strict=True))


def efficiency_by_height(errors: ErrorSums, bound: ErrorSums) -> dict[str, dict[str, float]]:
    """The efficiency in each height band, keyed "0.3-1 m", that holds LEAST_SHARE of the steps of both."""
    ratios = errors.root_mean_square_by_height() / bound.root_mean_square_by_height()
    share = np.minimum(errors.steps / errors.steps.sum(), bound.steps / bound.steps.sum())
    return {
        band_name(b): dict(zip(STATES, map(float, row), strict=True))
        for b, row in enumerate(ratios)
        if share[b] >= LEAST_SHARE
    }


def band_name(band: int) -> str:
    """A height band's name."""
    low, high = HEIGHTS_M[band], HEIGHTS_M[band + 1]
    return f"above {low:g} m" if high == np.inf else f"{low:g}-{high:g} m"


# -- largest errors -------------------------------------------------------------------------
def largest_horizontal_error(estimate: Array, truth: Array, home: int | None, counted: Array) -> Array:
    """Largest horizontal position error of each flight [m], (lanes,); estimate and truth (epochs, >= 2, lanes).

    home: the step at which the vehicle noted where its pad is; the error is then relative to that step's. None: the
    estimate is counted from where the vehicle takes its pad to be. counted (epochs, lanes) 0/1: the steps that count;
    NaN of a flight without one.
    """
    error = estimate[:, :2] - truth[:, :2]
    relative = error if home is None else error - error[home]
    away = np.where(counted > 0.0, np.sqrt((relative**2).sum(axis=1)), -1.0).max(axis=0)
    return np.asarray(np.where(away >= 0.0, away, np.nan))


def _root(squares: Array, steps: Array) -> Array:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.sqrt(squares / steps))


# -- normalised innovations squared of one sensor ----------------------------------------------------------------
CHI_SQUARE_95 = 3.841458820694124  # one degree of freedom


class Nis(NamedTuple):
    """Of one sensor's scalar components: how many were tested, the mean (1 where the filter is right), and the share
    inside the 95 % band of chi-square with one degree of freedom (0.95 where it is right)."""

    tested: int
    mean: float
    inside_fraction: float


def nis_of(innovation: Array, innovation_variance: Array) -> Nis | None:
    """The NIS of tested components, rejected ones among them, (n,) each; None where there is none."""
    known = np.isfinite(innovation) & np.isfinite(innovation_variance) & (innovation_variance > 0.0)
    if not known.any():
        return None
    squares = innovation[known] ** 2 / innovation_variance[known]
    return Nis(int(known.sum()), float(squares.mean()), float(np.mean(squares <= CHI_SQUARE_95)))
