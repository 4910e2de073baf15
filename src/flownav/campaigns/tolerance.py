"""Statistics of n flights with f failures: plans, binomial intervals, tolerance bounds, verdicts.

A requirement is that at least a share `probability` of all flights succeed. n flights with f failures show it with
confidence `confidence` when f failures or fewer would be unlikely if it did not hold:

    P(at most f failures in n flights | a flight fails with 1 - probability) <= 1 - confidence.

That is the same as: the lower bound of Clopper and Pearson (Biometrika 26, 1934) of the share that succeeds is at least
`probability`; and as: the (n - f)-th smallest figure is an upper tolerance bound (Wilks, Ann. Math. Stat. 12, 1941;
Hanson and Beard, NASA TP-2010-216447). Flights spread evenly over several cells, instead of drawn among them, fail less
variably than a binomial says (Hoeffding, Ann. Math. Stat. 27, 1956), so that the risk stated here is not exceeded.
"""

from collections.abc import Iterable
from typing import Literal, NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.scoring.percentiles import share_with_interval

Verdict = Literal["pass", "fail", "not shown"]

MOST_FLIGHTS = 10**9  # a plan that needs more is none
PLAN_POWER = 0.9  # the chance to pass that a plan for a second campaign should have


class Interval(NamedTuple):
    """One-sided confidence bounds of a share, each with the stated confidence."""

    low: float
    high: float


def needed(probability: float, confidence: float, failures: int = 0) -> int:
    """The fewest flights that show a requirement when `failures` of them fail. ValueError where 10^9 do not.

    probability and confidence in (0, 1), as everywhere here.
    """
    low, high = failures, failures + 1  # `low` flights do not show it
    while not shown(high, failures, probability, confidence):
        low, high = high, 2 * high
        if high > MOST_FLIGHTS:
            raise ValueError(f"a probability of {probability:.12g} needs more than {MOST_FLIGHTS:,} flights")
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if shown(middle, failures, probability, confidence) else (middle, high)
    return high


def shown(flights: int, failures: int, probability: float, confidence: float) -> bool:
    """Whether `flights` flights with `failures` failures show the requirement."""
    return flights > failures and risk(flights, failures, probability) <= 1.0 - confidence


def risk(flights: int, failures: int, probability: float) -> float:
    """The consumer's risk: the probability of at most `failures` failures when the share is only just not met.

    0 for a negative number of failures: such a plan never passes.
    """
    from scipy.special import bdtr

    return float(bdtr(float(failures), flights, 1.0 - probability)) if failures >= 0 else 0.0


def allowed(flights: int, probability: float, confidence: float) -> int:
    """The most failures with which `flights` flights still show the requirement; -1 where they are too few for any."""
    low, high = -1, flights  # `low` passes, `high` does not
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if shown(flights, middle, probability, confidence) else (low, middle)
    return low


def interval(flights: int, failures: int, confidence: float) -> Interval:
    """Bounds of the share that succeeds after Clopper and Pearson, each one-sided with this confidence."""
    _, low, high = share_with_interval(flights - failures, flights, 2.0 * confidence - 1.0)
    return Interval(low, high)


def verdict(flights: int, failures: int, probability: float, confidence: float) -> Verdict:
    """Pass when the requirement is shown, fail when its opposite is: when even the upper bound lies below.

    Whatever the truth, a verdict contradicts it in at most 1 - confidence of all campaigns.
    """
    if shown(flights, failures, probability, confidence):
        return "pass"
    return "fail" if _refuted(flights, failures, probability, confidence) else "not shown"


def _refuted(flights: int, failures: int, probability: float, confidence: float) -> bool:
    """Whether at least `failures` failures would be unlikely if the requirement were met."""
    from scipy.special import bdtrc

    return failures > 0 and float(bdtrc(failures - 1.0, flights, 1.0 - probability)) < 1.0 - confidence


def joint(verdicts: Iterable[Verdict]) -> Verdict:
    """Pass when all pass, fail when one fails.

    A joint pass is wrong only if some requirement that is not met passed: its risk is that requirement's, not more
    (an intersection-union test; Berger, Technometrics 24, 1982).
    """
    found = list(verdicts)
    if "fail" in found:
        return "fail"
    return "pass" if all(each == "pass" for each in found) else "not shown"


def tolerance_bound(figures: Array, probability: float, confidence: float, *, upper: bool = True) -> float:
    """The figure that this share of all flights does not exceed (upper), or reaches (not upper), with this confidence.

    An order statistic, whatever the distribution: infinite where there are too few flights, or too many that have no
    finite figure. figures (flights,), no NaN.
    """
    failures = allowed(len(figures), probability, confidence)
    ordered = np.sort(figures if upper else -figures)
    bound = float(ordered[len(ordered) - 1 - failures]) if failures >= 0 else np.inf
    return bound if upper else -bound


def flights_to_show(failure_rate: float, probability: float, confidence: float, most: int = 10_000) -> int | None:
    """The fewest flights of a new plan that passes with a chance of PLAN_POWER when flights fail at this rate.

    None where the rate is not below what the requirement allows, or a plan would have to allow `most` failures.
    """
    from scipy.special import bdtr

    if failure_rate >= 1.0 - probability:
        return None
    low, high = -1, 1  # plans for `low` failures do not do

    def serves(failures: int) -> bool:
        return float(bdtr(float(failures), needed(probability, confidence, failures), failure_rate)) >= PLAN_POWER

    if serves(0):
        return needed(probability, confidence, 0)
    low = 0
    while not serves(high):
        low, high = high, 2 * high
        if high > most:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if serves(middle) else (middle, high)
    return needed(probability, confidence, high)
