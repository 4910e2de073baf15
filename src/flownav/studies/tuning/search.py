"""The best factors on the fit windows, one knob after the other, and how sure each of them is."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.studies.tuning.judge import MEASURED_SEED, interval_of, resampled
from flownav.studies.tuning.knobs import limits_of, penalty
from flownav.studies.tuning.scores import WORTH_NATS, Gains, Trials

STEPS = tuple(math.log(step) for step in (2.0, 1.4, 1.2))  # of a noise, coarse to fine
STRIDES = (-2, -1, 1, 2)  # the second over what is rough in a gain: gates that open, a heading that drifts another way
MOST_SWEEPS = 2  # at each step
PROFILE_STEPS = (-1.0, -0.5, 0.0, 0.5, 1.0)  # in coarsest steps about the best, where its profile is taken


class Found(NamedTuple):
    """Log factors of all knobs, and of those that were moved the 95 % interval of each (None of one that was not)."""

    log_factors: Array
    intervals: list[tuple[float, float] | None]


def objective(trials: Trials, log_factors: Array) -> float:
    """Mean gain over the fit windows, each log counting alike, less the prior as so many windows weigh it [nats]."""
    gains = trials.gains(log_factors)
    return mean_gain(gains) - penalty(trials.knobs, log_factors) / _windows(gains)


def mean_gain(gains: Sequence[Gains]) -> float:
    """Over windows and then over logs."""
    return float(np.mean([gain.total.mean() for gain in gains]))


def search(trials: Trials, settings: NavigatorSettingsFile) -> Found:
    """Coordinate search; what cannot be told from the start is put back and the rest sought again, until all can."""
    limits = [limits_of(knob, settings) for knob in trials.knobs]
    kept, steps, best = list(range(len(limits))), STEPS, np.zeros(len(limits))
    while True:
        best = _climb(trials, best, kept, steps, limits)
        tops = [_top(trials, best, k, limits[k]) if best[k] else None for k in range(len(limits))]
        told = [k for k in kept if _moved(tops[k]) and _worth(trials, best, k) >= WORTH_NATS]
        if len(told) == np.count_nonzero(best):
            return Found(
                np.array([top.place if top else 0.0 for top in tops]), [top.interval if top else None for top in tops]
            )
        best = np.where(np.isin(np.arange(len(limits)), told), best, 0.0)
        kept, steps = told, STEPS[1:]


def _climb(
    trials: Trials, start: Array, knobs: Sequence[int], steps: Sequence[float], limits: Sequence[tuple[float, float]]
) -> Array:
    """Each knob up or down by a step as long as that gains, with ever finer steps."""
    best, value = start, objective(trials, start)
    for step in steps:
        for _ in range(MOST_SWEEPS):
            before = value
            for k in knobs:
                best, value = _along(trials, best, value, k, _step(trials, k, step), limits[k])
            if value <= before:
                break
    return best


def _along(
    trials: Trials, best: Array, value: float, k: int, step: float, limits: tuple[float, float]
) -> tuple[Array, float]:
    """The best place on one knob's line: of STRIDES steps from where it stands, and on from there while that gains."""
    while True:
        places = {float(np.clip(best[k] + stride * step, *limits)) for stride in STRIDES} - {float(best[k])}
        tried = [_at(best, k, place) for place in sorted(places)]
        values = [objective(trials, factors) for factors in tried]
        if not values or max(values) <= value:
            return best, value
        best, value = tried[int(np.argmax(values))], max(values)


def _step(trials: Trials, k: int, step: float) -> float:
    """A step of a noise, made as small as the knob's spread is."""
    return step * trials.knobs[k].spread / math.log(3.0)


def _at(factors: Array, k: int, factor: float) -> Array:
    moved = factors.copy()
    moved[k] = 0.0 if abs(factor) < 1e-9 else factor
    return moved


# -- how sure ---------------------------------------------------------------------------------------------
class Top(NamedTuple):
    """Where one factor's profile has its top, and the 95 % interval of that place."""

    place: float
    interval: tuple[float, float]


def _moved(top: Top | None) -> bool:
    """Whether an interval excludes the start."""
    return top is not None and (top.interval[0] > 0.0 or top.interval[1] < 0.0)


def _worth(trials: Trials, best: Array, k: int) -> float:
    """What it costs to put one factor back [nats]."""
    return objective(trials, best) - objective(trials, _at(best, k, 0.0))


def _top(trials: Trials, best: Array, k: int, limits: tuple[float, float]) -> Top:
    """What the windows alone say of one factor, the others standing: the search's own place is a whole number of steps
    from the start, and drawn to it by the prior. Where the profile has no top: that place, and the limits.

    By the sandwich of an M-estimator (Huber, Robust Statistics, 1981, section 6.3): the slope of the mean over windows
    when they are drawn anew, over the curvature of the profile, which is a parabola by least squares.
    """
    span = _step(trials, k, STEPS[0])
    places = np.unique(np.clip(best[k] + span * np.array(PROFILE_STEPS), *limits))
    flown = [trials.gains(_at(best, k, float(place))) for place in places]
    by_log = [np.array([gains[log].total for gains in flown]).T for log in range(len(trials.courses))]
    parabola = np.linalg.pinv(np.vander(places - best[k], 3))  # rows: curvature / 2, slope, value
    mean = np.mean([values.mean(axis=0) for values in by_log], axis=0)
    curvature = 2.0 * float(parabola[0] @ mean)
    if curvature >= 0.0:
        return Top(float(best[k]), limits)
    slope, drawn = float(parabola[1] @ mean), resampled(by_log, MEASURED_SEED) @ parabola[1]
    ends = interval_of(best[k] - drawn / curvature, _windows(flown[0]))
    place, low, high = np.clip([best[k] - slope / curvature, *ends], *limits)
    return Top(float(place), (float(low), float(high)))


def _windows(gains: Sequence[Gains]) -> int:
    return sum(len(gain.prediction) for gain in gains)
