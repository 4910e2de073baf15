"""The verdict: do the proposed settings help on windows that the fit never saw? The bootstrap says how surely."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.studies.tuning.scores import WORTH_NATS, Gains

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
    """CONFIDENCE interval of a mean of so many windows from its draws (RESAMPLES,): expanded percentiles.

    Plain percentiles of few windows are too near to each other, by what Student's t is wider than the normal and the
    root of n / (n - 1) (Hesterberg, What Teachers Should Know About the Bootstrap, The American Statistician 69, 2015).
    """
    from scipy.special import ndtr, stdtrit

    wider = np.sqrt(windows / (windows - 1.0)) * stdtrit(windows - 1.0, 0.5 * (1.0 + CONFIDENCE))
    low, high = np.percentile(drawn, [100.0 * ndtr(-wider), 100.0 * ndtr(wider)])
    return float(low), float(high)


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
