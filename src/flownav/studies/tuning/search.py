"""The best factors on the fit windows, one knob after the other, and how sure each of them is; and the verdict.

Do the proposed settings help on windows that the fit never saw? The bootstrap gives the confidence.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.studies.tuning.knobs import limits_of, penalty
from flownav.studies.tuning.scores import WORTH_NATS, Gains, Trials

RESAMPLES = 10_000
MEASURED_SEED = 20260  # a seed each, so that the same logs give the same answer
JUDGED_SEED = 20261
CONFIDENCE = 0.95


def resampled(by_log: Sequence[Array], seed: int) -> Array:
    """Means of drawn windows, (RESAMPLES, k): of each log's (w, k) or (w,) as many as it has, with replacement.

    Windows are drawn log by log, and logs count alike.
    """
    draw = np.random.default_rng(seed)
    total: Array = np.zeros(())
    for values in by_log:
        columns = values.reshape(len(values), -1)
        weights = draw.multinomial(len(columns), np.full(len(columns), 1.0 / len(columns)), RESAMPLES) / len(columns)
        total = total + weights @ columns
    return np.asarray(total / len(by_log))


def interval_of(drawn: Array, windows: int) -> tuple[float, float]:
    """CONFIDENCE interval of a mean of `windows` windows from its draws (RESAMPLES,): expanded percentiles.

    Plain percentiles of few windows are too near to each other, by what Student's t is wider than the normal and the
    root of n / (n - 1) (Hesterberg, What Teachers Should Know About the Bootstrap, The American Statistician 69, 2015).
    """
    from scipy.special import ndtr, stdtrit

    wider = np.sqrt(windows / (windows - 1.0)) * stdtrit(windows - 1.0, 0.5 * (1.0 + CONFIDENCE))
    low, high = np.percentile(drawn, [100.0 * ndtr(-wider), 100.0 * ndtr(wider)])
    return float(low), float(high)


def student_of(values: Array) -> tuple[float, float]:
    """CONFIDENCE interval of the mean of a few values (n,) by Student's t; a bootstrap of three holds it too seldom."""
    from scipy.special import stdtrit

    half = stdtrit(len(values) - 1.0, 0.5 * (1.0 + CONFIDENCE)) * np.std(values, ddof=1) / np.sqrt(len(values))
    return float(np.mean(values) - half), float(np.mean(values) + half)


# -- the verdict -------------------------------------------------------------------------------------------------
ACCEPTED, NOT_ACCEPTED = "accepted", "not accepted"


class Judged(NamedTuple):
    """A mean gain over held-out windows [nats] with its 95 % interval, and over how many windows."""

    mean: float
    low: float
    high: float
    windows: int


class Judgement(NamedTuple):
    """total: predictions and errors together; error: errors alone, None where nothing shows them; why: in words."""

    accepted: bool
    why: str
    total: Judged | None
    error: Judged | None

    @property
    def verdict(self) -> str:
        """In a word or two."""
        return ACCEPTED if self.accepted else NOT_ACCEPTED


UNMOVED = Judgement(False, "the fit windows ask for no other setting", None, None)


def judge(held: Sequence[Gains], whole: Sequence[bool]) -> Judgement:
    """The verdict on the gains on held-out windows, log by log; whole: of which logs nothing at all was fitted.

    Accepted where the interval of the errors' gain lies above zero, that of errors and predictions together too, and
    where the errors of the logs that were held out whole did not grow. Better predictions alone are not enough: a
    filter can predict its own sensors better and err more.
    """
    total = judged([gain.total for gain in held])
    error = judged([_known(gain) for gain in held])
    apart = judged([_known(gain) for gain, is_whole in zip(held, whole, strict=True) if is_whole])
    return Judgement(*_verdict(total, error, apart), total, error)


def judged(by_log: Sequence[Array]) -> Judged | None:
    """Mean and interval of gains (w,) of each log that has some; None without any."""
    counted = [values for values in by_log if len(values) > 1]
    if not counted:
        return None
    mean, windows = float(np.mean([values.mean() for values in counted])), sum(len(values) for values in counted)
    return Judged(mean, *interval_of(resampled(counted, JUDGED_SEED)[:, 0], windows), windows)


def _known(gain: Gains) -> Array:
    return gain.error[np.isfinite(gain.error)]


def _verdict(total: Judged | None, error: Judged | None, apart: Judged | None) -> tuple[bool, str]:
    if error is None or total is None:
        return False, "no GPS, truth or flow shows the path's error in the held-out windows"
    if error.high < 0.0:
        return False, "in the held-out windows the path's error grows"
    if error.low <= 0.0 or error.mean < WORTH_NATS:
        return False, "in the held-out windows the path's error does not shrink beyond chance and 2 %"
    if total.low <= 0.0:
        return False, "in the held-out windows the path's error shrinks by less than the sensors' predictions lose"
    if apart is not None and apart.mean <= 0.0:
        return False, "the path's error does not shrink in the logs that were held out whole"
    return True, "the path's error shrinks in the held-out windows"


STEPS = tuple(math.log(step) for step in (2.0, 1.4, 1.2))  # of a noise, coarse to fine
STRIDES = (-2, -1, 1, 2)  # the second over what is rough in a gain: gates that open, a heading that drifts another way
MOST_SWEEPS = 2  # at each step
PROFILE_STEPS = (-1.0, -0.5, 0.0, 0.5, 1.0)  # in coarsest steps about the best, where its profile is taken


class Found(NamedTuple):
    """Log factors of all knobs, and of those that were moved the 95 % interval of each (None of one that was not)."""

    log_factors: Array
    intervals: list[tuple[float, float] | None]


def objective(trials: Trials, log_factors: Array) -> float:
    """Mean gain over the fit windows, each log counting alike, less the prior's penalty over the number of windows
    [nats].
    """
    gains = trials.gains(log_factors)
    return mean_gain(gains) - penalty(trials.knobs, log_factors) / _windows(gains)


def mean_gain(gains: Sequence[Gains]) -> float:
    """Over windows and then over logs."""
    return float(np.mean([gain.total.mean() for gain in gains]))


def search(trials: Trials, settings: NavigatorSettingsFile) -> Found:
    """Coordinate search; factors that cannot be distinguished from the start are put back and the rest sought again,
    until all can be.
    """
    limits = [limits_of(knob, settings) for knob in trials.knobs]
    kept, steps, best = list(range(len(limits))), STEPS, np.zeros(len(limits))
    while True:
        best = _climb(trials, best, kept, steps, limits)
        tops = [_top(trials, best, k, limits[k]) if best[k] else None for k in range(len(limits))]
        kept_knobs = [k for k in kept if _moved(tops[k]) and _worth(trials, best, k) >= WORTH_NATS]
        if len(kept_knobs) == np.count_nonzero(best):
            return Found(
                np.array([top.place if top else 0.0 for top in tops]), [top.interval if top else None for top in tops]
            )
        best = np.where(np.isin(np.arange(len(limits)), kept_knobs), best, 0.0)
        kept, steps = kept_knobs, STEPS[1:]


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
    """The cost of putting one factor back [nats]."""
    return objective(trials, best) - objective(trials, _at(best, k, 0.0))


def _top(trials: Trials, best: Array, k: int, limits: tuple[float, float]) -> Top:
    """The estimate of one factor by the windows alone, the others fixed: the search's own place is a whole number of
    steps from the start, and drawn to it by the prior. Where the profile has no top: that place, and the limits.

    By the sandwich of an M-estimator (Huber, Robust Statistics, 1981, section 6.3): the slope of the mean over windows
    when they are drawn anew, over the curvature of the profile, which is a parabola by least squares. The unknowns at a
    start differ from log to log and not from window to window: there the logs are the sample.
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
    slope = float(parabola[1] @ mean)
    if trials.knobs[k].start:
        slopes = np.array([values.mean(axis=0) @ parabola[1] for values in by_log])
        ends = student_of(best[k] - slopes / curvature)
    else:
        drawn = resampled(by_log, MEASURED_SEED) @ parabola[1]
        ends = interval_of(best[k] - drawn / curvature, _windows(flown[0]))
    place, low, high = np.clip([best[k] - slope / curvature, *ends], *limits)
    return Top(float(place), (float(low), float(high)))


def _windows(gains: Sequence[Gains]) -> int:
    return sum(len(gain.prediction) for gain in gains)
