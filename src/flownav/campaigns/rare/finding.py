"""One part of an event: its probability by levels, and how well that is known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.campaigns.rare.chains import Array, States, Walker, together
from flownav.campaigns.rare.subset import WALK, Islands, Ladder, climb, fly_islands
from flownav.scoring.percentiles import share_with_interval

CONFIDENCE = 0.95
LARGEST_CV = 0.3
PILOT_FLIGHTS = 512  # a level
ISLANDS, ISLAND_FLIGHTS = 8, 512  # a level: 512 walks side by side, and seven degrees of freedom for the interval
DIRECT_FLIGHTS = 4096  # at once, where there are no levels to climb
FAR = 3.7  # -ln((1 - CONFIDENCE) / 2): none of n flights shows that the probability is below FAR / n
NEGLIGIBLE, SMALL = 0.02, 0.1  # of the event's other part: not worth flights, or not worth more of them
LEAST = 1e-9  # no probability below that is sought
PILOTS_FACTOR = 5.0  # a pilot's own estimate is seldom so many times too small


class Found(NamedTuple):
    """A probability, its interval and coefficient of variation (infinite: nothing happened, `high` is all there is).

    freedom: degrees of freedom of cv. levels: each with the share of the flights beyond it. beyond: the flights that
    showed it, of these weights, whose sum is the probability.
    """

    probability: float
    low: float
    high: float
    cv: float
    freedom: float
    levels: tuple[tuple[float, float], ...]
    beyond: States
    weights: Array


def find(walker: Walker, limit: float, most: int, beside: float = 0.0) -> Found:
    """The probability of a response beyond the limit: by levels where the response has them, else at random.

    Islands are flown in lots of ISLANDS until the coefficient of variation is small enough or `most` flights are used
    up. beside: the probability of the event's other part: where the pilot finds next to nothing beside it, or at all,
    it is left at that, and the probability counts as 0 with what it may be as `high`.
    """
    negligible = max(NEGLIGIBLE * beside, LEAST)
    ladder = climb(walker, limit, PILOT_FLIGHTS, most // 2, negligible)
    if not ladder.reached and ladder.above < negligible:
        levels, high = tuple((level, np.nan) for level in ladder.levels), PILOTS_FACTOR * ladder.above
        return Found(0.0, 0.0, high, np.inf, np.inf, levels, walker.fresh(0), np.zeros(0))
    if not ladder.reached:
        return at_random(walker, limit, most - walker.flown)
    price = ISLANDS * (1.0 + (len(ladder.levels) - 1) * (1.0 - 1.0 / WALK))  # of a flight of every island and level
    count = min(int((most - walker.flown) / price) // WALK * WALK, ISLAND_FLIGHTS)
    lots: list[Islands] = []
    while True:
        lots.append(fly_islands(walker, ladder, ISLANDS, count))
        found = found_on(ladder, lots, count)
        small = found.cv * found.probability <= SMALL * beside
        if found.cv <= LARGEST_CV or small or walker.flown + price * count > most:
            return found


def found_on(ladder: Ladder, lots: list[Islands], count: int) -> Found:
    """What islands of `count` flights a level say together: the mean of their estimates."""
    estimates = np.concatenate([lot.estimates for lot in lots])
    islands, mean = len(estimates), float(estimates.mean())
    shares = np.concatenate([lot.shares for lot in lots]).mean(axis=0)
    levels = tuple(zip(ladder.levels, shares.tolist(), strict=True))
    beyond = together([lot.beyond for lot in lots])
    if mean == 0.0:
        return Found(0.0, 0.0, FAR / (islands * count), np.inf, np.inf, levels, beyond.at(np.arange(0)), np.zeros(0))
    cv = float(estimates.std(ddof=1)) / mean / np.sqrt(islands)
    own = [lot.estimates[lot.island] / np.bincount(lot.island)[lot.island] for lot in lots]
    low, high = interval_of(mean, cv, islands - 1)
    return Found(mean, low, high, cv, islands - 1, levels, beyond, np.concatenate(own) / islands)


def interval_of(mean: float, cv: float, freedom: float) -> tuple[float, float]:
    """The interval of a mean whose logarithm is nearly normal, as that of a product of many shares is: Student's t."""
    from scipy.stats import t

    factor = float(np.exp(t.ppf(0.5 + 0.5 * CONFIDENCE, freedom) * np.sqrt(np.log1p(cv * cv))))
    return mean / factor, min(mean * factor, 1.0)


def at_random(walker: Walker, limit: float, most: int) -> Found:
    """The share of flights drawn at random, its interval after Clopper and Pearson: of a response without levels."""
    happened, flown = [walker.fresh(0)], 0
    while flown < most:
        states = walker.fresh(min(DIRECT_FLIGHTS, most - flown))
        happened.append(states.at(np.flatnonzero(states.response > limit)))
        flown += len(states.response)
    beyond = together(happened)
    hits = len(beyond.response)
    share, low, high = share_with_interval(hits, flown, CONFIDENCE)
    cv = float(np.sqrt((1.0 - hits / flown) / hits)) if hits else np.inf
    levels = ((limit, share),)
    return Found(share, low, high, cv, np.inf, levels, beyond, np.full(hits, 1.0 / flown))


def together_with(parts: list[Found]) -> tuple[float, float, float, float]:
    """Probability, interval and coefficient of variation of an event in parts that exclude each other.

    A part of which nothing was found adds to the upper end alone.
    """
    known = [part for part in parts if part.probability > 0.0]
    unseen = sum(part.high for part in parts if part.probability == 0.0)
    if not known:
        return 0.0, 0.0, min(unseen, 1.0), np.inf
    variances = np.array([(part.cv * part.probability) ** 2 for part in known])
    total, variance = sum(part.probability for part in known), float(variances.sum())
    cv = np.sqrt(variance) / total
    if len(known) == 1:
        low, high = known[0].low, known[0].high
    else:  # Welch and Satterthwaite's degrees of freedom
        freedom = variance**2 / max(float((variances**2 / [part.freedom for part in known]).sum()), 1e-300)
        low, high = interval_of(total, cv, freedom)
    return total, low, min(high + unseen, 1.0), cv
